//! `asperity run` on a real JACK server, heard sample by sample beside the same graph rendered offline.
//!
//! On a machine that is busy the server itself runs late now and then. What the program leaves out for it is
//! no failure, but must be what it counts. Freewheel is for the callback clock: a paced thread keeps to time.

use std::f64::consts::PI;
use std::time::Duration;

use harness::live::{Live, told};
use harness::servers::{Jack, inside, inside_beside_others};
use harness::test_name;

use crate::ear::{Ear, heard_from_the_start};
use crate::played::{
    Counted, Followed, START_S, assert_no_clicks, assert_ramps_down, clicks_where_it_should, counted,
    first_sound, follow,
};

/// Time for which a program is held.
const HELD: Duration = Duration::from_millis(100);

/// Conditions of a run.
struct Run {
    rate_hz: u32,
    /// Frames of a callback.
    period: usize,
    /// Seconds in real time.
    seconds: usize,
    /// Seconds as fast as the server goes.
    wheeled: usize,
    /// Whether the program is held for 100 ms in the middle.
    held: bool,
    /// The signal that ends it.
    end: &'static str,
}

const RUN: Run = Run { rate_hz: 48_000, period: 64, seconds: 4, wheeled: 0, held: false, end: "INT" };

/// Plays, stops, and lays what was heard beside what is rendered.
fn plays_what_is_rendered(run: &Run) {
    told(|| is_heard_as_rendered(run));
}

fn is_heard_as_rendered(run: &Run) -> Result<(), String> {
    let &Run { rate_hz, period, seconds, wheeled, .. } = run;
    let dir = tempfile::tempdir().unwrap();
    crate::played::write_graph(dir.path(), rate_hz);
    let rate = rate_hz as usize;
    let in_callback = period * 500 <= rate;
    // A paced thread listens first, and the ramp has begun by then.
    let faint = if in_callback { 1e-12 } else { 1e-8 };
    let (mut program, ear) = heard_from_the_start(dir.path(), &[], (seconds + wheeled + 30) * rate, faint);
    ear.wait(seconds * rate);
    if run.held {
        program.signal("STOP");
        std::thread::sleep(HELD);
        program.signal("CONT");
        ear.wait(rate);
    }
    if wheeled > 0 {
        ear.freewheel(wheeled * rate);
    }
    program.signal(run.end);
    let said = program.end().ok().err;
    // Silence to the end is heard too.
    ear.wait(rate / 10);
    let heard = ear.stop();
    let count = counted(dir.path());
    // A server that is kept from calling for a second is lost, as it should be.
    if count.losses > 0 || count.lost_samples > u64::from(rate_hz) {
        return Err(format!("{count:?} {said}"));
    }
    let rendered = crate::played::offline(dir.path(), count.ticks);
    let channel = |n: usize, of: &[[f32; 2]]| -> Vec<f32> { of.iter().map(|frame| frame[n]).collect() };
    let (one, offline) = (channel(0, &heard), channel(0, &rendered));
    let begin = first_sound(one.iter().copied()).unwrap();
    let start = begin as i64 - first_sound(offline.iter().copied()).unwrap() as i64;
    let up = begin + (START_S * f64::from(rate_hz)) as usize;
    let followed =
        follow(&one, &offline, up, -start, rate_hz).expect("what is heard is nowhere in what is rendered");
    println!("{rate_hz} Hz, {period} frames: {count:?}, {:?}", followed.breaks);
    assert_eq!(count.clock, if in_callback { "callback" } else { "paced" });
    assert!(followed.end - up > (seconds + wheeled - 3) * rate, "only {} samples", followed.end - up);
    if in_callback {
        starts_slowly(&one, &offline, start, &followed, &count, rate_hz);
    }
    // What was lost before the first sound cannot be heard.
    let gaps = count.underruns + count.xruns;
    if in_callback && followed.breaks.len() as u64 != gaps && left_out(&followed, start) < count.lost_samples
    {
        return Err(format!("{} gaps, {:?} heard: {count:?}", gaps, followed.breaks));
    }
    everything_is_counted(&followed, &count, start, in_callback);
    if run.held {
        assert!(count.xruns > 0 && !followed.breaks.is_empty());
        assert!(followed.left_out() as f64 > 0.8 * HELD.as_secs_f64() * f64::from(rate_hz), "{followed:?}");
    }
    assert_no_clicks(&one, rate_hz);
    assert_ramps_down(&one, &offline, &followed, &count, rate_hz);
    clicks_where_it_should(&heard, &rendered, &followed, rate_hz);
    Ok(())
}

/// Samples of the rendered signal that were not heard. Those before following began are in its shift.
fn left_out(followed: &Followed, start: i64) -> u64 {
    u64::try_from(followed.last_shift() + start).expect("later than it began")
}

/// Asserts that left-out samples and breaks are those that the report counts.
fn everything_is_counted(followed: &Followed, count: &Counted, start: i64, in_callback: bool) {
    assert!(followed.breaks.len() as u64 <= count.underruns + count.xruns, "{followed:?} {count:?}");
    let left_out = left_out(followed, start);
    if in_callback {
        assert_eq!(left_out, count.lost_samples);
    } else {
        assert!(left_out <= count.lost_samples, "{left_out} {count:?}");
    }
}

/// Rises as a raised cosine over two seconds: never above it, and exactly along it as long as nothing breaks.
fn starts_slowly(
    heard: &[f32],
    rendered: &[f32],
    start: i64,
    followed: &Followed,
    count: &Counted,
    rate_hz: u32,
) {
    let rise = START_S * f64::from(rate_hz);
    let first = usize::try_from(start).unwrap();
    // A gap that costs no time fades all the same.
    let after = followed.breaks.len() as u64;
    let unbroken = followed.shift == -start && count.underruns + count.xruns <= after;
    for (k, (x, full)) in heard[first..].iter().zip(rendered).take(rise as usize).enumerate() {
        let gain = 0.5 - 0.5 * (PI * (k + 1) as f64 / rise).cos();
        assert!(f64::from(x.abs()) <= 0.1 * gain + 1e-8, "sample {k} of the ramp is {x} at a gain of {gain}");
        let off = (f64::from(*x) - gain * f64::from(*full)).abs();
        assert!(!unbroken || off < 1e-8, "sample {k} of the ramp is {x}, not {}", gain * f64::from(*full));
    }
    if !unbroken {
        println!("time was left out in the ramp: only its height is compared");
    }
}

/// Ten seconds in real time and a minute in freewheel.
#[test]
fn every_sample_arrives_at_44100_hz_in_10_s_and_freewheel() {
    let Some(_) = inside(test_name!(), || Jack::start(44_100, 64)) else { return };
    plays_what_is_rendered(&Run { rate_hz: 44_100, seconds: 10, wheeled: 60, ..RUN });
}

/// Ten seconds in real time and a minute in freewheel.
#[test]
fn every_sample_arrives_at_48000_hz_in_10_s_and_freewheel() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 64)) else { return };
    plays_what_is_rendered(&Run { seconds: 10, wheeled: 60, ..RUN });
}

/// Ten seconds in real time and a minute in freewheel.
#[test]
fn every_sample_arrives_at_96000_hz_in_10_s_and_freewheel() {
    let Some(_) = inside(test_name!(), || Jack::start(96_000, 128)) else { return };
    plays_what_is_rendered(&Run { rate_hz: 96_000, period: 128, seconds: 10, wheeled: 60, ..RUN });
}

#[test]
fn held_program_skips_ahead_and_is_no_later_than_before() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 64)) else { return };
    plays_what_is_rendered(&Run { held: true, ..RUN });
}

#[test]
fn held_paced_thread_plays_every_sample_at_256_frames() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 256)) else { return };
    plays_what_is_rendered(&Run { period: 256, held: true, end: "TERM", ..RUN });
}

#[test]
fn a_paced_thread_plays_every_sample_at_1024_frames() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 1024)) else { return };
    plays_what_is_rendered(&Run { period: 1024, end: "TERM", ..RUN });
}

/// A sine of 1000 A at the actuator's resonance, behind a limiter of this name and with these parameters.
fn attack(limiter: usize, params: &str) -> String {
    format!(
        r#"Graph(version: 1, nodes: {{
    "tone": (kind: "sine", params: (frequency_hz: 65, amplitude: 1000)),
    "limiter {limiter}": (kind: "limiter", params: ({params})), "out": (kind: "audio_out"),
}}, wires: [("tone", "limiter {limiter}"), ("limiter {limiter}", "out")])"#
    )
}

/// The same on two channels, whose limiters change their names, and their places.
fn attack_on_both(n: usize) -> String {
    let voice = |id: &str, hz: f64| {
        format!(
            r#""{id} tone {n}": (kind: "sine", params: (frequency_hz: {hz:?}, amplitude: 1000)),
               "{id} limiter {n}": (kind: "limiter"), "{id}": (kind: "audio_out"),"#
        )
    };
    let (a, b) = (voice("a", 65.0), voice("b", 300.0));
    let nodes = if n.is_multiple_of(2) { a + &b } else { b + &a };
    let wires = ["a", "b"]
        .map(|id| format!(r#"("{id} tone {n}", "{id} limiter {n}"), ("{id} limiter {n}", "{id}")"#));
    format!("Graph(version: 1, nodes: {{{nodes}}}, wires: [{}])", wires.join(", "))
}

fn write(dir: &std::path::Path, graph: &str) {
    std::fs::write(dir.join("new"), graph).unwrap();
    std::fs::rename(dir.join("new"), dir.join("live.ron")).unwrap();
}

/// Output while a graph is edited now and then, and the program's counts.
fn heard_under_attack(
    graph: impl Fn(usize) -> String,
    channels: &str,
    every: Duration,
    seconds: usize,
) -> Result<(Vec<[f32; 2]>, Counted), String> {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &graph(0));
    let args = ["--watch", "--channel", channels];
    let (mut program, ear) = heard_from_the_start(dir.path(), &args, (seconds + 30) * 48_000, 1e-3);
    let begun = std::time::Instant::now();
    let mut edits = 0;
    while begun.elapsed() < Duration::from_secs(seconds as u64) {
        std::thread::sleep(every);
        edits += 1;
        write(dir.path(), &graph(edits));
    }
    program.signal("INT");
    let said = program.end().ok().err;
    let heard = ear.stop();
    let count = counted(dir.path());
    // A server that is lost tells nothing.
    if count.losses > 0 {
        return Err(format!("{count:?}"));
    }
    let swaps = said.matches("changed:").count();
    assert!(swaps as f64 > 0.5 * seconds as f64 / every.as_secs_f64().max(1.5), "{swaps} swaps: {said}");
    println!("{every:?}: {swaps} swaps");
    Ok((heard, count))
}

/// The coil behind a channel of the server is given what was heard there.
fn judge(heard: &[[f32; 2]], channel: usize, count: &Counted, what: &str) -> crate::coil::Used {
    let used = crate::coil::Coil::new(48_000).play(heard.iter().map(|frame| f64::from(frame[channel]))).used;
    println!("{what}: {used:?}");
    // A server that leaves samples out makes steps of its own, and the mover swings as nobody meant.
    let gaps = count.xruns + count.underruns > 0;
    let judged = if gaps { crate::coil::Used { slew: 0.0, stroke: used.stroke / 1.1, ..used } } else { used };
    judged.assert_within(&format!("{what}, {count:?}"));
    used
}

fn stays_within_limits(every: Duration, seconds: usize) -> Result<(), String> {
    let (heard, count) = heard_under_attack(|n| attack(n, ""), "1", every, seconds)?;
    let used = judge(&heard, 0, &count, &format!("renamed every {every:?}"));
    assert!(used.rms > 0.85, "too careful: {used:?}");
    Ok(())
}

/// Intervals in seconds, and how long each is kept up.
fn attacks() -> (Vec<f64>, usize) {
    let long = std::env::var_os("ASPERITY_LONG_TICKS").is_some();
    if long { (vec![0.05, 0.1, 0.3, 1.0, 2.0, 5.0], 60) } else { (vec![0.05, 0.3], 6) }
}

#[test]
fn renamed_limiter_lifts_no_limit_in_the_callback() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 64)) else { return };
    let (intervals, seconds) = attacks();
    intervals.iter().for_each(|s| told(|| stays_within_limits(Duration::from_secs_f64(*s), seconds)));
}

#[test]
fn renamed_limiter_lifts_no_limit_of_a_paced_thread() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 512)) else { return };
    let (intervals, seconds) = attacks();
    intervals.iter().for_each(|s| told(|| stays_within_limits(Duration::from_secs_f64(*s), seconds)));
}

#[test]
fn change_of_profile_on_a_server_lifts_no_limit() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 64)) else { return };
    let dir = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(harness::graphs("actuators/hapcoil_one.ron")).unwrap();
    let weak = dir.path().join("weak.ron").display().to_string();
    let changed = text.replace("ma_rms: 147.8", "ma_rms: 74").replace("HapCoil-One", "weak");
    assert_ne!(text, changed);
    std::fs::write(&weak, changed).unwrap();
    let graph =
        |n: usize| if n.is_multiple_of(2) { attack(n, "") } else { attack(n, &format!("profile: {weak:?}")) };
    let (intervals, seconds) = attacks();
    for every in intervals.into_iter().map(Duration::from_secs_f64) {
        told(|| {
            let (heard, count) = heard_under_attack(graph, "1", every, seconds)?;
            judge(&heard, 0, &count, &format!("another profile every {every:?}"));
            Ok(())
        });
    }
}

#[test]
fn two_outputs_on_a_server_stay_within_their_limits() {
    let Some(_) = inside_beside_others(test_name!(), || Jack::start(48_000, 64)) else { return };
    let (intervals, seconds) = attacks();
    for every in intervals.into_iter().map(Duration::from_secs_f64) {
        told(|| {
            let (heard, count) = heard_under_attack(attack_on_both, "1,2", every, seconds)?;
            (0..2).for_each(|channel| {
                let used =
                    judge(&heard, channel, &count, &format!("output {channel}, renamed every {every:?}"));
                assert!(used.rms > 0.8, "too careful: {used:?}");
            });
            Ok(())
        });
    }
}

#[test]
fn runs_in_a_row_on_a_server_heat_the_coil_no_more_than_one() {
    let Some(_) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    told(|| {
        let dir = tempfile::tempdir().unwrap();
        let state = tempfile::tempdir().unwrap();
        write(dir.path(), &attack(0, ""));
        let mut coil = crate::coil::Coil::new(48_000);
        let mut ended: Option<std::time::Instant> = None;
        for n in 0..4 {
            let ear = Ear::new(60 * 48_000);
            let mut command = harness::asperity(dir.path());
            command.env("ASPERITY_STATE", state.path());
            command.args(["run", "live.ron", "--report", "report.json", "--host", "jack", "--channel", "1"]);
            let mut program = Live::of(command);
            ear.hear(program.id());
            ear.wait(4 * 48_000);
            program.signal("INT");
            program.end().ok();
            let heard = ear.stop();
            let count = counted(dir.path());
            if count.losses + count.xruns + count.underruns > 0 {
                return Err(format!("run {n}: {count:?}"));
            }
            // It lay still for no longer than it was not heard.
            let still = ended.map_or(0.0, |at| at.elapsed().as_secs_f64() - heard.len() as f64 / 48_000.0);
            coil.rest(still.max(0.0));
            ended = Some(std::time::Instant::now());
            coil.play(heard.iter().map(|[x, _]| f64::from(*x)));
            println!("run {n}: {:?}", coil.used);
            coil.used.assert_within(&format!("run {n}"));
        }
        assert!(coil.used.rms > 0.85, "too careful: {:?}", coil.used);
        Ok(())
    });
}

#[test]
fn server_that_was_lost_finds_its_coil_as_warm_as_it_was() {
    let Some(server) = inside(test_name!(), || Jack::start(48_000, 256)) else { return };
    told(|| {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path(), &attack(0, ""));
        let (mut program, ear) = heard_from_the_start(dir.path(), &["--channel", "1"], 60 * 48_000, 1e-3);
        ear.wait(5 * 48_000);
        server.stop();
        program.says("is lost: ");
        server.go_on();
        program.says("` is back");
        let before = ear.stop();
        let ear = Ear::new(60 * 48_000);
        ear.hear(program.id());
        ear.wait(5 * 48_000);
        program.signal("INT");
        program.end().ok();
        let after = ear.stop();
        let current = |heard: &[[f32; 2]]| heard.iter().map(|[x, _]| f64::from(*x)).collect::<Vec<_>>();
        let mut coil = crate::coil::Coil::new(48_000);
        coil.play(current(&before));
        assert!(coil.used.rms > 0.85, "too careful: {:?}", coil.used);
        // Where the mover was when the ear joined is not known: it settles first. How warm the coil was is.
        let swings = coil.used;
        coil.rest(0.0);
        let (first, rest) = after.split_at(after.len().min(24_000));
        coil.play(current(first));
        coil.used = crate::coil::Used { stroke: swings.stroke, slew: swings.slew, ..coil.used };
        coil.play(current(rest));
        println!("lost and back: {swings:?}, then {:?}", coil.used);
        // Samples that the server left out as it was stopped are steps of its own.
        crate::coil::Used { slew: 0.0, stroke: coil.used.stroke / 1.1, ..coil.used }
            .assert_within("lost and back");
        Ok(())
    });
}
