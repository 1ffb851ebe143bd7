//! The program as it plays in real time, and what it plays laid beside the same graph rendered offline.

use std::path::Path;

use harness::live::Live;
use harness::{json, run};

/// Seconds from silence to full at the start of a run.
pub(crate) const START_S: f64 = 2.0;
/// When the click is, in ticks.
pub(crate) const CLICK_TICK: u64 = 1_500;
/// Stretch that must agree where a signal is found again, in seconds.
const WINDOW_S: f64 = 0.01;
/// Longest break, and longest time left out at one, in seconds.
const BREAK_S: f64 = 3.0;
/// Largest error of a step from one sample to the next behind a break: the limiter's high-pass remembers
/// what was left out, and slowly forgets it. A shift by one sample is seen: it changes steps by up to 5e-6 at
/// 96 kHz.
const REMEMBERED: f32 = 5e-7;
/// Largest error of a sample after this many seconds, when the high-pass has forgotten.
const FORGOTTEN: (f32, f64) = (1e-6, 3.0);

/// Writes the graph: a sweep of two minutes and a sine on channel 1, whose every stretch is like no other,
/// and a click on channel 2.
pub(crate) fn write_graph(dir: &Path, rate_hz: u32) {
    let click_s = CLICK_TICK as f64 / 500.0;
    let rows = format!("0,0,0,0\n{:.3},0,0,0\n{click_s:.3},1,0,0\n1000,1,0,0\n", click_s - 0.002);
    std::fs::write(dir.join("hand.csv"), format!("t_s,x_mm,y_mm,z_mm\n{rows}")).unwrap();
    let graph = format!(
        r#"Graph(
    version: 1, tick_hz: 500, audio_hz: {rate_hz},
    nodes: {{
        "sweep": (kind: "sweep", params: (from_hz: 60, to_hz: 200, seconds: 120, amplitude: 0.05,
        before_s: 0)),
        "sine": (kind: "sine", params: (frequency_hz: 173.20508, amplitude: 0.03)),
        "both": (kind: "mix", params: (inputs: 2)),
        "limiter": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
        "out": (kind: "audio_out"),
        "hand": (kind: "trajectory", params: (file: "hand.csv", interpolation: linear, max_gap_s: 2000)),
        "velocity": (kind: "velocity", params: (cutoff_hz: 0)),
        "click": (kind: "impulse", params: (threshold: 100, amplitude: 0.1)),
        "limiter2": (kind: "limiter", params: (profile: "hapcoil_one", handle_mass_g: 100)),
        "out2": (kind: "audio_out"),
    }},
    wires: [
        ("sweep", "both.in1"), ("sine", "both.in2"), ("both", "limiter"), ("limiter", "out"),
        ("hand.position", "velocity.position"), ("velocity.speed", "click"), ("click", "limiter2"),
        ("limiter2", "out2"),
    ],
)
"#
    );
    std::fs::write(dir.join("live.ron"), graph).unwrap();
}

/// That graph, rendered offline.
pub(crate) fn offline(dir: &Path, ticks: u64) -> Vec<[f32; 2]> {
    let seconds = (ticks as f64 / 500.0 + 1.0).to_string();
    run(dir, &["render", "live.ron", "--seconds", &seconds, "--out", "offline.wav", "--quiet"]).ok();
    let (samples, _) = harness::wav(&dir.join("offline.wav"));
    samples.chunks_exact(2).map(|frame| [frame[0], frame[1]]).collect()
}

/// `asperity run` of the graph, with a report. A call may take as long as it likes: a machine that is
/// busy is no fault of a node.
pub(crate) fn play(dir: &Path, args: &[&str]) -> Live {
    let all = ["live.ron", "--report", "report.json", "--limit-us", "10000000"];
    Live::start(dir, &[&all[..], args].concat())
}

/// Counts of a report.
#[derive(Debug)]
pub(crate) struct Counted {
    pub(crate) ticks: u64,
    pub(crate) underruns: u64,
    pub(crate) lost_samples: u64,
    pub(crate) xruns: u64,
    pub(crate) losses: u64,
    pub(crate) clock: String,
}

/// The report that a run left.
pub(crate) fn counted(dir: &Path) -> Counted {
    let report = json(&dir.join("report.json"));
    let count = |name: &str| report[name].as_u64().unwrap_or_else(|| panic!("no `{name}` in {report}"));
    Counted {
        ticks: count("ticks"),
        underruns: count("underruns"),
        lost_samples: count("lost_samples"),
        xruns: count("xruns"),
        losses: count("losses"),
        clock: report["clock"].as_str().unwrap_or_default().to_owned(),
    }
}

/// Where what was heard is not what was rendered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Break {
    /// First sample of what was heard that is another.
    pub(crate) at: usize,
    /// Number of such samples.
    pub(crate) length: usize,
    /// Samples of the graph that were left out there, beside those which the broken ones stand for.
    pub(crate) left_out: usize,
}

/// Heard samples compared with rendered ones.
#[derive(Debug)]
pub(crate) struct Followed {
    /// Offset from a heard sample to the rendered one, where following began.
    pub(crate) shift: i64,
    pub(crate) breaks: Vec<Break>,
    /// First sample behind the last one that is the graph's.
    pub(crate) end: usize,
}

impl Followed {
    /// Samples that were left out at all breaks.
    pub(crate) fn left_out(&self) -> u64 {
        self.breaks.iter().map(|b| b.left_out as u64).sum()
    }

    /// The shift at the end.
    pub(crate) fn last_shift(&self) -> i64 {
        self.shift + self.left_out() as i64
    }
}

/// Follows a signal from a place on to the last sample that is the graph's. Until the first break every
/// sample must be the rendered one, bit for bit; `unbroken` is the shift that it must have if there was none
/// before. At a break time may only be left out: where a signal goes on later than it should, or again, it is
/// not found.
pub(crate) fn follow(
    heard: &[f32],
    rendered: &[f32],
    from: usize,
    unbroken: i64,
    rate_hz: u32,
) -> Option<Followed> {
    let reach = (BREAK_S * f64::from(rate_hz)) as usize;
    let window = (WINDOW_S * f64::from(rate_hz)) as usize;
    let (from, place) = (from..(from + reach).min(heard.len()))
        .step_by(16)
        .find_map(|at| Some((at, find((heard, at), rendered, 0, window)?)))?;
    let mut it = Followed { shift: place as i64 - from as i64, breaks: Vec::new(), end: from };
    let (mut at, mut shift) = (from, place as i64 - from as i64);
    let mut broken = (shift != unbroken).then_some(from);
    let memory = (FORGOTTEN.1 * f64::from(rate_hz)) as usize;
    while at < heard.len() {
        let place = (at as i64 + shift) as usize;
        let same = match broken {
            None => rendered.get(place).is_some_and(|x| x == &heard[at]),
            Some(since) if at - since > memory => {
                rendered.get(place).is_some_and(|x| (x - heard[at]).abs() <= FORGOTTEN.0)
            }
            Some(_) => steps_alike(heard, at, rendered, place),
        };
        if same {
            at += 1;
            it.end = at;
            continue;
        }
        // Where it goes on.
        let candidates = (at..(at + reach).min(heard.len())).step_by(16);
        let found = candidates.into_iter().find_map(|to| {
            let least = (to as i64 + shift) as usize;
            let end = (least + reach).min(rendered.len());
            Some((to, find((heard, to), rendered.get(..end)?, least, window)?))
        });
        let Some((to, place)) = found else { break };
        let next = place as i64 - to as i64;
        it.breaks.push(Break { at, length: to - at, left_out: (next - shift) as usize });
        // The window's own samples are alike; the step to its first one need not be.
        (at, shift, broken) = (to + 1, next, Some(to));
        it.end = at;
    }
    Some(it)
}

/// Whether the steps that lead to these places are the same.
fn steps_alike(heard: &[f32], at: usize, rendered: &[f32], place: usize) -> bool {
    let step = |of: &[f32], n: usize| Some(of.get(n)? - of.get(n.checked_sub(1)?)?);
    let pair = step(heard, at).zip(step(rendered, place));
    pair.is_some_and(|(a, b)| (a - b).abs() <= REMEMBERED)
}

/// The first place from `least` on where the window that begins at a place of what was heard is rendered.
fn find((heard, at): (&[f32], usize), rendered: &[f32], least: usize, window: usize) -> Option<usize> {
    if heard.get(at..at + window)?.iter().all(|x| x.abs() < 1e-4) {
        return None;
    }
    // The step to the first sample is no part of it.
    let same = |place: &usize| (1..window).all(|n| steps_alike(heard, at + n, rendered, place + n));
    (least..rendered.len().saturating_sub(window)).find(same)
}

/// The first sample that is not silent.
pub(crate) fn first_sound(samples: impl IntoIterator<Item = f32>) -> Option<usize> {
    samples.into_iter().position(|x| x != 0.0)
}

/// No sample may be farther from the one before than the graph itself and the fades go: nothing clicks.
pub(crate) fn assert_no_clicks(heard: &[f32], rate_hz: u32) {
    let most = 3e-3 * 48_000.0 / rate_hz as f32;
    for (at, pair) in heard.windows(2).enumerate() {
        assert!((pair[1] - pair[0]).abs() < most, "a click at sample {at}: {} to {}", pair[0], pair[1]);
    }
}

/// Asserts the end of a run: full until `end`, then down to silence within 20 ms, by gains that only fall,
/// and silent from there on.
pub(crate) fn assert_ramps_down(
    heard: &[f32],
    rendered: &[f32],
    followed: &Followed,
    count: &Counted,
    rate_hz: u32,
) {
    let down = rate_hz as usize / 50;
    let after = &heard[followed.end..];
    let sounds = after.iter().rposition(|x| *x != 0.0).map_or(0, |at| at + 1);
    if sounds > down && (followed.breaks.len() as u64) < count.underruns + count.xruns {
        println!("the end is behind a break of the last moment, and is not compared");
        return;
    }
    assert!(sounds <= down, "it sounds for {sounds} samples more at {rate_hz} Hz");
    assert!(after.len() > down, "the capture ended too soon");
    let place = (followed.end as i64 + followed.last_shift()) as usize;
    let mut gain = 1.0;
    for (x, full) in after[..sounds].iter().zip(&rendered[place..]).filter(|(_, full)| full.abs() > 0.02) {
        let now = x / full;
        assert!((-5e-2..=gain + 5e-2).contains(&now), "a gain of {now} behind one of {gain}");
        gain = now;
    }
    assert!(sounds * 1000 > 5 * rate_hz as usize, "it broke off within {sounds} samples");
}

/// The click of channel 2 begins with the first sample of its tick, by the places of channel 1, and is the
/// rendered one bit for bit until something is left out. What was left out before it was silence.
pub(crate) fn clicks_where_it_should(
    heard: &[[f32; 2]],
    rendered: &[[f32; 2]],
    followed: &Followed,
    rate_hz: u32,
) {
    let click = first_sound(heard.iter().map(|frame| frame[1])).expect("a click");
    let before: usize = followed.breaks.iter().filter(|b| b.at <= click).map(|b| b.left_out).sum();
    if followed.breaks.iter().any(|b| (b.at..b.at + b.length).contains(&click)) {
        println!("the click is in a break, and is not compared");
        return;
    }
    let place = (click as i64 + followed.shift) as usize + before;
    assert_eq!(place as u64, CLICK_TICK * u64::from(rate_hz) / 500);
    let until = followed.breaks.iter().map(|b| b.at).find(|at| *at > click).unwrap_or(followed.end);
    for (n, (x, wanted)) in heard[click..until].iter().zip(&rendered[place..]).enumerate() {
        assert_eq!(x[1], wanted[1], "channel 2, {n} samples behind the click");
    }
}
