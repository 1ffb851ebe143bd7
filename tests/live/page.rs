//! `asperity run --page` with a browser: a pen on the page is heard, and what is done on the page happens.

mod crowd;

use std::path::Path;
use std::time::Duration;

use harness::alone::real_time;
use harness::chromium::Chromium;
use harness::json;
use harness::live::{CARD, EARS, Live, graph, npy, rms, rows, told};

use crate::edits::edit;
use crate::pen::Pen;

/// Samples of a tick at 48 kHz.
const TICK: usize = 96;

/// A run of graphs/live.ron whose recordings lie in `dir`, and its page's address.
fn run(dir: &Path, more: &[&str]) -> (Live, String) {
    let probes = r#""speed": (kind: "probe", params: (file: "speed.csv")),
       "place": (kind: "probe", params: (file: "place.csv")),"#;
    let wires = r#"("motion.speed", "speed"), ("stylus.position", "place"),"#;
    let text = graph("live.ron", &format!("{}{probes}", EARS[0]), &format!("{}{wires}", EARS[1]));
    std::fs::write(dir.join("g.ron"), text).expect("a graph");
    let args = ["g.ron", "--page", "--device", CARD, "--report", "r.json"];
    let mut live = Live::start(dir, &[&args, more].concat());
    let url = live.says("the page: ");
    (live, url)
}

/// Where there is a stretch of `ticks` in which the pen hardly ever rests or always does, and something holds
/// of its mean speed: the first tick of each. One begins in the middle of another.
fn stretches(speeds: &[Vec<f64>], ticks: usize, holds: impl Fn(f64) -> bool) -> Vec<usize> {
    let starts = (0..speeds.len().saturating_sub(ticks)).step_by(ticks / 2);
    let mean = |at: usize| speeds[at..at + ticks].iter().map(|row| row[0]).sum::<f64>() / ticks as f64;
    let even = |at: usize| {
        let moving = speeds[at..at + ticks].iter().filter(|row| row[0] > 0.3 * mean(at)).count();
        mean(at) < 1.0 || moving * 10 > ticks * 8
    };
    starts.filter(|&at| holds(mean(at)) && even(at)).collect()
}

fn median(x: &[f64]) -> f64 {
    let mut x = x.to_vec();
    x.sort_by(f64::total_cmp);
    x.get(x.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A browser that every trial of a test has again.
pub(crate) struct Kept(Option<Chromium>);

impl Kept {
    pub(crate) fn pen(&mut self, url: &str) -> Pen {
        Pen::over(self.0.take().expect("it was given back"), url)
    }

    /// A page whose run has ended would complain that it is gone.
    pub(crate) fn take_back(&mut self, mut pen: Pen) {
        pen.browser.open("about:blank");
        self.0 = Some(pen.browser);
    }
}

/// Runs a trial with a browser, if there is one, until it counts.
pub(crate) fn with_browser(mut trial: impl FnMut(&mut Kept) -> Result<(), String>) {
    let _alone = real_time();
    let Some(browser) = Chromium::start() else { return };
    let mut kept = Kept(Some(browser));
    told(|| trial(&mut kept));
}

#[test]
fn pen_on_the_page_is_heard_and_louder_when_faster() {
    with_browser(is_heard_while_it_moves);
}

fn is_heard_while_it_moves(kept: &mut Kept) -> Result<(), String> {
    let dir = tempfile::tempdir().expect("a folder");
    // A browser on a busy machine may hold events back for longer than a source may be silent.
    let (live, url) = run(dir.path(), &["--set", "stylus.timeout_ms=2000"]);
    let mut pen = kept.pen(&url);
    pen.strokes(1.0, 20.0);
    pen.strokes(1.0, 160.0);
    pen.lifts();
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    kept.take_back(pen);
    live.stop().ok();

    let (speeds, heard) = (rows(&dir.path().join("speed.csv")), npy(&dir.path().join("heard.npy")));
    let report = json(&dir.path().join("r.json"));
    // A sound comes up to 100 ms after the motion that makes it, so the first half of every stretch counts
    // for nothing.
    const LONG: usize = 100;
    let level = |at: &usize| {
        rms(heard.get((at + LONG / 2) * TICK..(at + LONG) * TICK).expect("as many samples as ticks"))
    };
    let levels = |holds: &dyn Fn(f64) -> bool| -> Vec<f64> {
        stretches(&speeds, LONG, holds).iter().map(level).collect()
    };
    let rest = levels(&|v| v < 0.1);
    let slow = levels(&|v| (10.0..40.0).contains(&v));
    let fast = levels(&|v| v > 100.0);
    println!("rms at rest {rest:.5?}, slow {slow:.5?}, fast {fast:.5?}; {} misses", report["misses"]);
    let samples = report["sources"][0]["samples"].as_u64().unwrap_or(0);
    assert!(samples > 0, "nothing came from the page");
    if rest.len() < 3 || slow.len() < 2 || fast.len() < 2 {
        return Err(format!("the pen did not move as it was told, {samples} places came"));
    }
    println!("{:.2} times as loud at eight times the speed", median(&fast) / median(&slow));
    assert!(median(&slow) > 1e-3, "a slow stroke is not heard");
    assert!(rest.iter().all(|x| *x < 0.05 * median(&slow)), "a pen at rest is heard");
    assert!(median(&fast) > 1.15 * median(&slow), "a fast stroke is not louder");
    Ok(())
}

/// Where silences begin that last longer than a fifth of a second.
fn silences(x: &[f32]) -> Vec<usize> {
    let mut found = Vec::new();
    let mut quiet = 0;
    for (i, x) in x.iter().enumerate() {
        quiet = if *x == 0.0 { quiet + 1 } else { 0 };
        if quiet == 9_600 {
            found.push(i + 1 - quiet);
        }
    }
    found
}

/// The loudest 50 ms.
pub(crate) fn loudest(x: &[f32]) -> f64 {
    x.chunks(2_400).map(rms).fold(0.0, f64::max)
}

const SPEED: f64 = 120.0;

/// The largest current of the last moment that the page shows.
const CURRENT: &str = "Number(document.querySelector('#drive').getAttribute('aria-valuenow'))";

/// The number beside a slider.
fn typed(slider: &str) -> String {
    format!("{slider}.parentElement.querySelector('.figure input').value")
}

#[test]
fn mute_gain_and_material_of_the_page_act_within_a_stroke() {
    with_browser(what_is_done_takes_effect);
}

fn what_is_done_takes_effect(kept: &mut Kept) -> Result<(), String> {
    let dir = tempfile::tempdir().expect("a folder");
    let (live, url) = run(dir.path(), &["--set", "stylus.timeout_ms=2000"]);
    let mut pen = kept.pen(&url);
    pen.strokes(0.6, SPEED);
    for _ in 0..2 {
        for condition in ["muted", "playing"] {
            pen.does("document.querySelector('#mute').click()");
            pen.strokes_until(
                SPEED,
                &format!("document.querySelector('#condition').dataset.is === '{condition}'"),
            );
            pen.strokes(0.4, SPEED);
        }
    }
    let slider = "document.querySelector('[data-param=\"strength.gain\"]')";
    let gain = |to: &str| {
        format!(
            "(() => {{ const s = {slider}; s.value = {to}; s.dispatchEvent(new Event('input', \
             {{ bubbles: true }})); }})()"
        )
    };
    pen.does(&format!("window.before = {slider}.value"));
    pen.does(&gain("0"));
    pen.strokes_until(SPEED, &format!("{} === '0' && {CURRENT} < 1e-4", typed(slider)));
    pen.strokes(0.5, SPEED);
    pen.does(&gain("window.before"));
    pen.strokes_until(SPEED, &format!("{CURRENT} > 0.02"));
    pen.strokes(0.7, SPEED);
    pen.does(
        "[...document.querySelectorAll('.card')].find((one) => one.textContent === 'sandpaper P40').click()",
    );
    pen.strokes(1.4, SPEED);
    pen.lifts();
    let before = pen.browser.eval("window.before");
    // Another page is told what holds now.
    pen.browser.open(&url);
    pen.browser.until("document.querySelector('#chosen').textContent === 'sandpaper P40'");
    pen.browser.until("document.querySelector('#condition').dataset.is === 'playing'");
    let now = pen.browser.eval(&format!("{slider}.value"));
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    kept.take_back(pen);
    live.stop().ok();
    assert_eq!(now, before);
    let (sent, heard) = (npy(&dir.path().join("sent.npy")), npy(&dir.path().join("heard.npy")));
    // Twice the card is silent for a while, and plays in between.
    let begins = heard.iter().position(|x| *x != 0.0).expect("a sound");
    let ends = heard.len() - heard.iter().rev().position(|x| *x != 0.0).expect("a sound");
    let stroke = &heard[begins..ends];
    let quiet = silences(stroke);
    assert!(quiet.len() >= 2, "it was muted twice, and there are silences at {quiet:?} only");
    let back = &stroke[quiet[0]..quiet[quiet.len() - 1]];
    assert!(loudest(back) > 0.3 * loudest(&stroke[..quiet[0]]), "it did not come back");
    // On the graph's own side: where the pen moves, and nothing comes out, the gain is 0.
    let moving = stretches(&rows(&dir.path().join("speed.csv")), 50, |v| v > 0.5 * SPEED);
    let levels: Vec<f64> = moving.iter().map(|at| rms(&sent[(at + 25) * TICK..(at + 50) * TICK])).collect();
    let most = levels.iter().copied().fold(0.0, f64::max);
    let silent = levels.iter().filter(|level| **level < 1e-3 * most).count();
    println!("{silent} of {} stretches are silent while it moves", levels.len());
    if levels.len() < 20 {
        return Err("the pen hardly moved".into());
    }
    assert!(silent >= 2 && silent < levels.len() / 2, "a gain of 0 is not heard: {levels:.4?}");
    Ok(())
}

/// Longest silence of a source when a page is closed. A busy browser is silent for longer than 50 ms.
const TIMEOUT_TICKS: usize = 100;

/// Ticks at which the stylus came to a stop for at least half a second.
fn stops(places: &[Vec<f64>]) -> Vec<usize> {
    let still = |at: usize| places[at..].iter().take(250).all(|p| p[..2] == places[at][..2]);
    let moved = |at: usize| places[at - 1][..2] != places[at][..2];
    (1..places.len().saturating_sub(250)).filter(|&at| moved(at) && still(at)).collect()
}

#[test]
fn a_page_that_is_closed_or_hangs_in_a_stroke_leaves_no_sound() {
    with_browser(a_page_that_is_gone_is_silent);
}

fn a_page_that_is_gone_is_silent(kept: &mut Kept) -> Result<(), String> {
    let dir = tempfile::tempdir().expect("a folder");
    let (mut live, url) = run(dir.path(), &["--watch", "--set", "stylus.timeout_ms=200"]);
    let mut pen = kept.pen(&url);
    // The pen has another reader from here on.
    pen.strokes(0.2, 160.0);
    let text = std::fs::read_to_string(dir.path().join("g.ron")).expect("a graph");
    assert!(text.contains("depth_mm: 6.6"), "{text}");
    edit(dir.path(), text.replace("depth_mm: 6.6", "depth_mm: 6.5"));
    assert!(live.says("changed:").contains("stylus"), "{}", live.said());
    pen.strokes(0.8, 160.0);
    pen.does("location.href = 'about:blank'");
    std::thread::sleep(Duration::from_millis(900));
    pen.lifts();
    let mut pen = Pen::over(pen.browser, &url);
    pen.strokes(0.8, 160.0);
    pen.browser.signal("STOP");
    std::thread::sleep(Duration::from_millis(900));
    pen.browser.signal("CONT");
    kept.take_back(pen);
    live.stop().ok();

    let (sent, places) = (npy(&dir.path().join("sent.npy")), rows(&dir.path().join("place.csv")));
    let report = json(&dir.path().join("r.json"));
    let stalls = report["sources"][0]["stalls"].as_u64().expect("a count");
    let stops = stops(&places);
    println!("{stalls} stalls, stops at ticks {stops:?}");
    assert!(stalls >= 2, "the page was closed once and hung once");
    // A place was put in where none was lost: both times the pen stood still from within a stroke.
    let mut quiet = 0;
    for at in stops {
        let level = |from: usize, to: usize| {
            rms(sent.get(at * TICK + from * TICK..at * TICK + to * TICK).unwrap_or(&[]))
        };
        let before = rms(&sent[at.saturating_sub(100) * TICK..at * TICK]);
        let after = level(TIMEOUT_TICKS + 10, TIMEOUT_TICKS + 35);
        let later = level(TIMEOUT_TICKS + 35, 250);
        println!("stop at {at}: {before:.5} before, {after:.6} from 220 ms on, {later:.7} from 270 ms on");
        quiet += usize::from(before > 0.01);
        assert!(after < 0.02 * before.max(0.01) && later < 1e-3 * before.max(0.01), "it sounds on");
    }
    if quiet < 2 {
        return Err(format!("{quiet} strokes were heard to the end"));
    }
    Ok(())
}
