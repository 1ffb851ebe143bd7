//! The first tab of the page in a browser: materials are chosen, compared, heard and recorded.

use std::path::Path;
use std::time::Duration;

use harness::live::{CARD, EARS, Live, graph, npy, rms};

use crate::page::{Kept, with_browser};
use crate::pen::Pen;

const SPEED: f64 = 120.0;

/// A run of graphs/live.ron with its recordings in `dir`, and a pen on its page.
fn begin(kept: &mut Kept, dir: &Path) -> (Live, Pen, String) {
    std::fs::write(dir.join("g.ron"), graph("live.ron", EARS[0], EARS[1])).expect("a graph");
    let args = ["g.ron", "--page", "--device", CARD, "--set", "stylus.timeout_ms=2000"];
    let mut live = Live::start(dir, &args);
    let url = live.says("the page: ");
    let mut pen = kept.pen(&url);
    pen.browser.eval("localStorage.clear()");
    pen.browser.open("about:blank");
    pen.browser.open(&url);
    pen.browser.until("document.querySelectorAll('.card').length === 96");
    pen.browser.eval(
        "import('./main.js?token=' + new URLSearchParams(location.search).get('token'))\
         .then((page) => { window.page = page; })",
    );
    (live, pen, url)
}

fn end(kept: &mut Kept, mut pen: Pen, live: Live) {
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    kept.take_back(pen);
    live.stop().ok();
}

/// Whether the card of a material is the chosen one, and the run plays it.
fn plays(name: &str) -> String {
    format!(
        "document.querySelector('.card[aria-pressed=true] span')?.textContent === '{name}' && \
         document.querySelector('#slot-a span').textContent.startsWith('{name},')"
    )
}

/// The place of a material's card, as a selector.
fn card(pen: &mut Pen, name: &str) -> String {
    let place = pen.browser.eval(&format!(
        "[...document.querySelectorAll('.card span')].findIndex((one) => one.textContent === '{name}') + 1"
    ));
    format!("#cards li:nth-child({place})")
}

#[test]
fn material_is_chosen_by_click_key_and_search() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, url) = begin(kept, dir.path());
        pen.browser.until(&plays("canvas"));
        let oak = card(&mut pen, "oak");
        pen.browser.click(&format!("{oak} .card"));
        pen.browser.until(&plays("oak"));
        assert_eq!(pen.browser.eval("document.querySelector('#chosen').textContent"), "oak");
        // Letters jump, arrows move, the space bar chooses.
        pen.browser.eval(&format!("document.querySelector('{oak} .card').focus()"));
        pen.browser.key("b", "KeyB");
        pen.browser.key("e", "KeyE");
        pen.browser.key("ArrowLeft", "ArrowLeft");
        let at = pen.browser.eval("document.activeElement.textContent");
        assert_eq!(at, "coarse loop pile", "the card before berber");
        pen.browser.key("*", "Digit8");
        pen.browser.key(" ", "Space");
        pen.browser.until(&plays("coarse loop pile"));
        pen.browser.eval(
            "(() => { const s = document.querySelector('#search'); s.value = 'wood ash'; \
             s.dispatchEvent(new Event('input')); s.focus(); })()",
        );
        pen.browser.key("Enter", "Enter");
        pen.browser.until(&plays("ash"));
        // A favourite is there the next time.
        pen.browser.open("about:blank");
        pen.browser.open(&url);
        pen.browser.until(&plays("ash"));
        pen.browser.eval("document.querySelector('#families button:nth-child(2)').click()");
        let shown =
            "[...document.querySelectorAll('#cards li:not([hidden]) .card')].map((one) => one.textContent)";
        assert_eq!(pen.browser.eval(shown), serde_json::json!(["coarse loop pile"]));
        let picture = "document.querySelector('#cards li:not([hidden]) img').naturalWidth";
        pen.browser.until(&format!("{picture} === 256"));
        end(kept, pen, live);
        Ok(())
    });
}

/// Moves the strength.
fn strength(percent: u32) -> String {
    format!(
        "(() => {{ const s = document.querySelector('#strength'); s.value = {percent}; \
         s.dispatchEvent(new Event('input')); }})()"
    )
}

#[test]
fn strength_attenuates_what_is_played_without_a_click() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, _) = begin(kept, dir.path());
        pen.strokes(2.0, SPEED);
        pen.does(&strength(25));
        pen.strokes(2.0, SPEED);
        pen.does(&strength(0));
        pen.strokes(1.0, SPEED);
        pen.lifts();
        let says = pen.browser.eval("document.querySelector('#strength-now').textContent");
        assert_eq!(says, "0 %");
        end(kept, pen, live);
        let sent = npy(&dir.path().join("sent.npy"));
        // Levels of 0.2 s, from the first sound on: two plateaus and silence.
        let begins = sent.iter().position(|x| x.abs() > 1e-3).expect("a sound");
        let levels: Vec<f64> = sent[begins..].chunks(9_600).map(rms).collect();
        println!("levels {levels:.4?}");
        let loud = levels.iter().copied().fold(0.0, f64::max);
        let weak = levels.iter().filter(|x| (0.1 * loud..0.45 * loud).contains(*x)).count();
        let strong = levels.iter().filter(|x| **x > 0.55 * loud).count();
        if strong < 4 || weak < 4 {
            return Err("the pen hardly moved".into());
        }
        assert!(levels[levels.len() - 3..].iter().all(|x| *x < 1e-4), "a strength of 0 is heard");
        // A click is a step of about the signal itself. Compared are the time of full strength, with whatever
        // bursts its strokes have, and the rest from shortly before its end.
        let step = |x: &[f32]| x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max);
        let full = begins + 9_600 * (1 + levels.iter().rposition(|x| *x > 0.55 * loud).unwrap_or(0));
        let (after, before) = (step(&sent[full - 19_200..]), step(&sent[begins..full]));
        println!("largest step from the change on {after}, at full strength {before}");
        assert!(after < 1.5 * before, "a click: {after} against {before}");
        Ok(())
    });
}

#[test]
fn a_and_b_swap_and_match_their_level() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, _) = begin(kept, dir.path());
        let says = "document.querySelector('#matched').textContent";
        pen.does("document.querySelector('#match').click()");
        pen.strokes(3.5, SPEED);
        pen.does("document.querySelector('#slot-b').click()");
        let rough = card(&mut pen, "sandpaper P36");
        pen.does(&format!("document.querySelector('{rough} .card').click()"));
        let chosen = "document.querySelector('#slot-b span').textContent.startsWith('sandpaper P36')";
        pen.strokes_until(SPEED, chosen);
        let early = pen.browser.eval(says);
        assert!(early.as_str().is_some_and(|text| text.starts_with("Not yet measured")), "{early}");
        pen.strokes_until(SPEED, &format!("/^[AB] is lowered by \\d+\\.\\d dB/.test({says})"));
        pen.strokes(1.0, SPEED);
        let text = pen.browser.eval(says).as_str().expect("a text").to_owned();
        println!("{text}");
        let quieter = if text.starts_with('A') { "b" } else { "a" };
        let louder = if quieter == "a" { "b" } else { "a" };
        // The quieter one keeps its strength, the louder one loses what is said.
        let view = "page.setting.strength";
        let db: f64 = text.split(' ').nth(4).and_then(|x| x.parse().ok()).expect("a figure");
        pen.does(&format!("document.querySelector('#slot-{louder}').click()"));
        pen.strokes(1.0, SPEED);
        let lowered = pen.browser.eval(view).as_f64().expect("a strength");
        pen.does(&format!("document.querySelector('#slot-{quieter}').click()"));
        pen.strokes(1.0, SPEED);
        let whole = pen.browser.eval(view).as_f64().expect("a strength");
        pen.lifts();
        println!("{lowered} of {whole}, {db} dB");
        assert_eq!(whole, 1.0, "the quieter one is lowered");
        assert!((20.0 * lowered.log10() + db).abs() < 1.5, "{lowered} is not {db} dB");
        let name = pen.browser.eval("document.querySelector('#chosen').textContent");
        assert_eq!(name, if quieter == "a" { "canvas" } else { "sandpaper P36" });
        end(kept, pen, live);
        Ok(())
    });
}

#[test]
fn listening_plays_the_acceleration_at_its_full_rate() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, _) = begin(kept, dir.path());
        assert_eq!(pen.browser.eval("page.listen.output"), serde_json::Value::Null);
        pen.browser.click("#listen");
        pen.browser.eval(
            "(() => { const { output } = page.listen; \
             window.ear = output.context.createAnalyser(); \
             ear.fftSize = 8192; output.connect(ear); \
             window.from = [performance.now(), page.listen.scheduled]; })()",
        );
        pen.strokes(3.0, SPEED);
        let heard = pen.browser.eval(
            "(() => { const x = new Float32Array(8192); ear.getFloatTimeDomainData(x); \
             const { listen } = page; \
             const s = (performance.now() - from[0]) / 1000; \
             return [Math.sqrt(x.reduce((a, b) => a + b * b, 0) / 8192), Math.max(...x.map(Math.abs)), \
             (listen.scheduled - from[1]) / s, ear.context.sampleRate]; })()",
        );
        pen.lifts();
        let [level, peak, rate, context] = [0, 1, 2, 3].map(|i| heard[i].as_f64().expect("a number"));
        let says = pen.browser.eval("document.querySelector('#heard').textContent");
        println!("rms {level}, peak {peak}, {rate} samples a second; {says}");
        assert!(peak <= 0.5 * 10_f64.powf(1.5 * (0.4 - 1.0)), "it is louder than the volume allows");
        assert_eq!(context, 48_000.0);
        assert!(says.as_str().is_some_and(|text| text.contains("ms late")), "{says}");
        pen.browser.click("#listen");
        assert_eq!(pen.browser.eval("document.querySelector('#listen').textContent"), "Listen");
        end(kept, pen, live);
        // A browser that gets no time loses views.
        if (rate / 48_000.0 - 1.0).abs() > 0.05 {
            return Err(format!("{rate} samples a second are not 48000"));
        }
        assert!(level > 1e-4, "silence");
        Ok(())
    });
}

#[test]
fn recording_gives_a_wav_of_what_was_played() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, _) = begin(kept, dir.path());
        pen.strokes(0.5, SPEED);
        pen.does("document.querySelector('#record').click()");
        pen.strokes(1.5, SPEED);
        pen.does("document.querySelector('#record').click()");
        pen.lifts();
        pen.browser.until("document.querySelector('#take').href.startsWith('blob:')");
        assert_eq!(pen.browser.eval("document.querySelector('#take').download"), "asperity canvas.wav");
        let bytes =
            pen.browser.eval("page.record.file.arrayBuffer().then((all) => [...new Uint8Array(all)])");
        let bytes: Vec<u8> = serde_json::from_value(bytes).expect("bytes");
        let mut wav = hound::WavReader::new(bytes.as_slice()).expect("a WAV file");
        let spec = wav.spec();
        assert_eq!((spec.channels, spec.sample_rate, spec.bits_per_sample), (1, 48_000, 32));
        let samples: Vec<f32> = wav.samples::<f32>().map(|x| x.expect("a sample")).collect();
        let level = rms(&samples);
        println!("{} samples, {level} m/s² rms", samples.len());
        assert!(samples.len() > 48_000 && (0.05..20.0).contains(&level), "{} {level}", samples.len());
        let says = pen.browser.eval("document.querySelector('#taken').textContent");
        assert!(says.as_str().is_some_and(|text| text.contains("48000 Hz, 1.0 is 1 m/s²")), "{says}");
        end(kept, pen, live);
        Ok(())
    });
}

#[test]
fn scope_goes_on_while_the_other_tab_is_shown() {
    with_browser(|kept| {
        let dir = tempfile::tempdir().expect("a folder");
        let (live, mut pen, _) = begin(kept, dir.path());
        pen.strokes(1.0, SPEED);
        pen.lifts();
        // By keys alone.
        pen.browser.eval("document.querySelector('#tab-feel').focus()");
        pen.browser.key("ArrowRight", "ArrowRight");
        pen.browser.until("document.querySelectorAll('#graph .node').length > 10");
        assert_eq!(
            pen.browser.eval("[document.activeElement.id, document.querySelector('#feel').hidden]"),
            serde_json::json!(["tab-scope", true])
        );
        // What was stroked before is on the scope: no panel is blank where the signal was.
        let whole = pen.browser.eval(
            "(() => { const { samples } = page.scopes.all.find((one) => one.name === 'acceleration'); \
             return samples.next > 48000 && samples.ring.some((x) => x !== 0); })()",
        );
        assert_eq!(whole, true, "the scope began anew");
        pen.browser.key("Home", "Home");
        pen.browser.until("!document.querySelector('#feel').hidden");
        std::thread::sleep(Duration::from_millis(100));
        end(kept, pen, live);
        Ok(())
    });
}
