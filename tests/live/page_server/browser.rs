//! The page in a browser: a pen on it is heard, what is moved on it is asked for, and it says when the run is
//! gone.

use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

use asperity_live::view::Request;
use asperity_live::{RunControl, Sample, SampleReader, SampleWriter, samples};
use asperity_page::{Feed, Options, Page, serve};
use harness::alone::real_time;
use harness::chromium::{Chromium, Look};
use harness::live::{Background, until};

use super::made_up;

/// A made-up run that publishes 60 views a second.
struct Stage {
    page: Option<Page>,
    asked: Receiver<Request>,
    run_control: RunControl,
    _run: Background,
}

impl Stage {
    fn at(options: Options, pen: Option<SampleWriter>) -> Self {
        let feed = Arc::new(Feed::new());
        let run_control = RunControl::default();
        let held = run_control.clone();
        let (tell, asked) = sync_channel(4096);
        let page = serve(options, feed.clone(), run_control.clone(), pen).expect("it serves");
        let run = Background::new(move |stop| {
            let mut run = made_up::Run::at(0);
            feed.publish_layout(run.layout.clone());
            let began = Instant::now();
            for n in 0u32.. {
                (run.muted, run.strength) = (held.muted(), held.strength());
                for (request, _) in held.asked() {
                    run.asked(&request);
                    feed.publish_layout(run.layout.clone());
                    let _ = tell.try_send(request);
                }
                feed.publish(run.view());
                std::thread::sleep((Duration::from_secs(1) * n / 60).saturating_sub(began.elapsed()));
                if stop.load(Relaxed) {
                    return;
                }
            }
        });
        Self { page: Some(page), asked, run_control, _run: run }
    }

    fn page(&self) -> &Page {
        self.page.as_ref().expect("it serves")
    }

    fn address(&self) -> (u16, String) {
        let (host, token) = self.page().url().split_once("/?token=").expect("an address with a token");
        (host.rsplit_once(':').expect("a port").1.parse().expect("a port"), token.to_owned())
    }

    fn muted(&self, is: bool) {
        until(&format!("muted: {is}"), || self.run_control.muted() == is);
    }

    fn asked(&self) -> Request {
        self.asked.recv_timeout(Duration::from_secs(30)).expect("something was asked for")
    }
}

const DESK: Look = Look { width: 1440, height: 900, dark: false };

fn drain(reader: &mut SampleReader, into: &mut Vec<Sample>) {
    into.extend(std::iter::from_fn(|| reader.take()));
}

#[test]
fn a_pen_at_250_hz_is_heard_whole_in_place_and_in_order() {
    let _alone = real_time();
    let Some(mut browser) = Chromium::start() else { return };
    let (to, mut from) = samples();
    let stage = Stage::at(Options::default(), Some(to));
    browser.look(&DESK);
    browser.open(stage.page().url());
    browser.until("document.querySelector('#condition').dataset.is === 'playing'");
    let [x, y] = browser.middle("#surface");
    const EVENTS: u32 = 500;
    // To the right at 0.2 px an event and up and down in a wave, harder and harder: every event has a place
    // of its own.
    let at =
        |i: u32| [(x - 50.0 + 0.2 * f64::from(i)).round() + f64::from(i % 5) / 5.0, y - f64::from(i % 40)];
    let force = |i: u32| 0.1 + 0.8 * f64::from(i) / f64::from(EVENTS);
    let mut heard = Vec::new();
    browser.pen("mousePressed", at(0), force(0));
    let began = Instant::now();
    for i in 1..EVENTS {
        std::thread::sleep((Duration::from_millis(4) * i).saturating_sub(began.elapsed()));
        browser.pen("mouseMoved", at(i), force(i));
        drain(&mut from, &mut heard);
    }
    browser.pen("mouseReleased", at(EVENTS - 1), 0.0);
    let end = Instant::now() + Duration::from_secs(30);
    while heard.last().is_none_or(|s| s.force > 0.0) && Instant::now() < end {
        browser.eval("1");
        drain(&mut from, &mut heard);
    }
    let mm = 25.4 / 96.0;
    let lifted = heard.iter().position(|s| s.force == 0.0).expect("the pen was lifted");
    let mut strokes: Vec<Sample> = heard[..lifted].to_vec();
    // A hand that pauses says again where it is.
    let beats = strokes.len();
    strokes.dedup_by_key(|s| (s.position.map(f64::to_bits), s.force.to_bits()));
    let beats = beats - strokes.len();
    assert!(beats < EVENTS as usize * 3 / 4, "{beats} samples were said again: each event came twice");
    assert!(heard.is_sorted_by(|a, b| a.time_ns < b.time_ns), "times increase");
    assert!(heard.iter().all(|s| s.stroke == heard[0].stroke), "one stroke");
    assert_eq!(strokes.len(), EVENTS as usize, "every event is heard once");
    for (i, s) in strokes.iter().enumerate() {
        let [px, py] = at(i as u32);
        let [dx, dy] = [s.position[0] - (px - x) * mm, s.position[1] - (y - py) * mm];
        assert!(dx.abs() < 0.02 && dy.abs() < 0.02, "event {i} is off by {dx} {dy} mm");
        assert!((s.force - force(i as u32)).abs() < 1e-3, "event {i} presses {}", s.force);
    }
    // A lifted hand goes on to say so.
    let before = heard.len();
    std::thread::sleep(Duration::from_millis(400));
    drain(&mut from, &mut heard);
    assert!(heard.len() > before, "a hand at rest is not a stall");
    assert_eq!(browser.complaints(), Vec::<String>::new());
}

#[test]
fn what_is_moved_on_the_page_is_asked_of_the_run() {
    let _alone = real_time();
    let Some(mut browser) = Chromium::start() else { return };
    let mut stage = Stage::at(Options::default(), None);
    browser.look(&DESK);
    browser.open(stage.page().url());
    browser.until("document.querySelector('#condition').dataset.is === 'playing'");
    browser.eval(
        "(() => { const s = document.querySelector('[data-param=\"texture.gain\"]'); s.value = 500; \
         s.dispatchEvent(new Event('input', { bubbles: true })); })()",
    );
    let Request::Set { node, param, value } = stage.asked() else { panic!("a parameter was moved") };
    assert_eq!((node.as_str(), param.as_str(), value), ("texture", "gain", 2.0));
    browser.eval("[...document.querySelectorAll('.card')].find((one) => one.textContent === 'felt').click()");
    assert_eq!(stage.asked(), Request::Material { node: "texture".into(), name: "felt".into() });
    browser.eval(
        "(() => { const s = document.querySelector('#strength'); s.value = 40; \
         s.dispatchEvent(new Event('input')); })()",
    );
    until("a strength of 40 %", || stage.run_control.strength() == 0.4);
    browser.click("#mute");
    stage.muted(true);
    browser.until("document.querySelector('#mute').getAttribute('aria-pressed') === 'true'");
    browser.until("document.querySelector('#condition').textContent === 'muted'");
    // The button has the keyboard now, and must not answer the key twice.
    browser.key(" ", "Space");
    stage.muted(false);
    browser.until("document.querySelector('#mute').getAttribute('aria-pressed') === 'false'");
    browser.eval("document.activeElement.blur()");
    browser.key(" ", "Space");
    stage.muted(true);
    browser.until("document.querySelector('#mute').getAttribute('aria-pressed') === 'true'");
    assert!(stage.run_control.muted(), "each was asked for once");
    assert_eq!(stage.asked.try_recv().ok(), None);
    assert_eq!(browser.complaints(), Vec::<String>::new());
    // The run ends, and the page says so; it begins again, and the page finds it.
    let (port, token) = stage.address();
    stage.page = None;
    browser.until("document.querySelector('#notice').textContent.includes('ended')");
    browser.until("document.querySelector('#condition').dataset.is === 'away'");
    browser.complaints();
    let again = Stage::at(Options { port, token: Some(token), ..Options::default() }, None);
    browser.until("document.querySelector('#notice').hidden");
    // What was set here is asked of the new run too.
    until("the strength of before", || again.run_control.strength() == 0.4);
    again.muted(true);
    let mut asked = [again.asked(), again.asked()];
    asked.sort_by_key(|request| matches!(request, Request::Set { .. }));
    assert_eq!(asked[0], Request::Material { node: "texture".into(), name: "felt".into() });
    assert_eq!(asked[1], Request::Set { node: "texture".into(), param: "gain".into(), value: 2.0 });
}

/// The axis of the speed went to 5000 with a trace below 800.
#[test]
fn axis_of_a_scope_shrinks_to_what_is_drawn() {
    let _alone = real_time();
    let Some(mut browser) = Chromium::start() else { return };
    let stage = Stage::at(Options::default(), None);
    browser.open(stage.page().url());
    let tops = browser.eval(
        "(async () => { const token = new URLSearchParams(location.search).get('token'); \
         const { Scale } = await import('./scope.js?token=' + token); const scale = new Scale(); \
         return [[4200, 0], [760, 100], [760, 700], [0, 5000], [900, 5001]].map(([x, ms]) => \
         scale.fit(x, ms)); })()",
    );
    assert_eq!(tops, serde_json::json!([5000, 5000, 800, 800, 1000]), "{tops}");
}

#[test]
fn the_spectrum_of_a_sine_stands_on_its_bin_with_its_amplitude() {
    let _alone = real_time();
    let Some(mut browser) = Chromium::start() else { return };
    let stage = Stage::at(Options::default(), None);
    browser.open(stage.page().url());
    let off = browser.eval(
        "(async () => { const token = new URLSearchParams(location.search).get('token'); \
         const { fft, amplitudes } = await import('./spectrum.js?token=' + token); \
         const n = 64, x = Float64Array.from({ length: n }, (_, i) => Math.sin(i * i * 0.37) + (i % 7)); \
         const re = x.slice(), im = new Float64Array(n); fft(re, im); let off = 0; \
         for (let k = 0; k < n; k += 1) { let [a, b] = [0, 0]; \
           for (let i = 0; i < n; i += 1) { a += x[i] * Math.cos(2 * Math.PI * k * i / n); b -= x[i] * \
           Math.sin(2 * Math.PI * k * i / n); } \
           off = Math.max(off, Math.abs(re[k] - a), Math.abs(im[k] - b)); } \
         const sine = Float32Array.from({ length: 1024 }, (_, i) => 0.7 * Math.sin(2 * Math.PI * 80 * i / \
         1024)); \
         return [off, Math.abs(amplitudes(sine)[80] - 0.7), amplitudes(sine)[84]]; })()",
    );
    for i in 0..3 {
        assert!(off[i].as_f64().expect("a number") < 1e-6, "{off}");
    }
    // Decimated from 48 to 6 kHz: the passband keeps its amplitude, and aliases are gone.
    let slow = browser.eval(
        "(async () => { const token = new URLSearchParams(location.search).get('token'); \
         const { slowed, amplitudes } = await import('./spectrum.js?token=' + token); \
         const sine = (bin) => (i) => Math.sin(2 * Math.PI * bin * i / (8 * 2048)); \
         const seen = (bin, at) => { const x = sine(bin); \
           return amplitudes(slowed(Float32Array.from({ length: 17000 }, (_, i) => x(i)), 8, 2048))[at]; }; \
         return [seen(68, 68), seen(341, 341), seen(2048 - 341, 341), seen(2048 - 68, 68), \
         seen(2048 + 68, 68)]; })()",
    );
    let slow: Vec<f64> = (0..5).map(|i| slow[i].as_f64().expect("a number")).collect();
    println!("200 Hz and 1 kHz {:.5?}, folded {:.7?}", &slow[..2], &slow[2..]);
    assert!(slow[..2].iter().all(|x| (x - 1.0).abs() < 1e-3), "{slow:?}");
    assert!(slow[2..].iter().all(|x| *x < 1e-3), "{slow:?}");
}

/// Holds the page against the rules of axe, if `scripts/setup.sh tests` could install it.
fn no_fault(browser: &mut Chromium, place: &str) {
    let file = harness::root().join("target/axe/axe.min.js");
    let Ok(axe) = std::fs::read_to_string(file) else {
        let _ = std::io::stderr().write_all(b"SKIPPED: axe-core is not installed: `make setup-tests`\n");
        return;
    };
    browser.eval("document.querySelector('.advanced').open = true");
    browser.eval(&format!("{axe}; 0"));
    let faults = browser.eval(
        "axe.run().then(({ violations }) => violations.map(({ id, nodes }) => \
         [id, ...nodes.map(({ target, failureSummary }) => `${target}: ${failureSummary}`)].join('\\n')))",
    );
    assert_eq!(faults, serde_json::json!([]), "accessibility of {place}");
}

#[test]
fn the_page_is_drawn_at_every_width_without_a_complaint() {
    let _alone = real_time();
    let Some(mut browser) = Chromium::start() else { return };
    let (to, _from) = samples();
    let stage = Stage::at(Options::default(), Some(to));
    for (name, width, height, dark) in [
        ("desk_light", 1440, 900, false),
        ("desk_dark", 1440, 900, true),
        ("tablet_light", 900, 1100, false),
        ("phone_light", 360, 740, false),
        ("phone_dark", 390, 844, true),
    ] {
        browser.look(&Look { width, height, dark });
        browser.open(stage.page().url());
        browser.until("document.querySelector('#condition').dataset.is !== 'away'");
        browser.until("document.querySelectorAll('.card').length === 5");
        for tab in ["feel", "scope"] {
            browser.eval(&format!("document.querySelector('#tab-{tab}').click()"));
            browser.until(&format!("!document.querySelector('#{tab}').hidden"));
            let wide = browser.eval("document.documentElement.scrollWidth");
            assert_eq!(wide.as_u64(), Some(u64::from(width)), "{name} scrolls sideways on {tab}");
            no_fault(&mut browser, &format!("{name} {tab}"));
        }
        browser.until("document.querySelectorAll('#graph .node').length === 13");
    }
    assert_eq!(browser.complaints(), Vec::<String>::new());
}
