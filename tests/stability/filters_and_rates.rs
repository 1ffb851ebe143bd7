//! Rates, tails, changes, and clocks that are off.

use asperity_checks::Subject;
use asperity_live::{Dll, RemoteClock};
use asperity_node::random::uniform;
use asperity_node::{Fault, Tick, time};

use crate::{broken, called, fails, graph, holds, holds_on, subject};

/// A mutant that fails in some ticks.
fn failing<'g>(subject: &Subject<'g>, kind: &str, when: fn(&mut Tick<'_>) -> bool) -> Subject<'g> {
    called(subject, kind, move |_| {
        Box::new(move |node, tick| if when(tick) { Err(Fault::Failed(3)) } else { node.run(tick) })
    })
}

#[test]
fn rates_of_graph() {
    // Frames of the audio rate itself, a tenth of which may not be whole.
    for name in ["texture.ron", "heravi2024_500hz.ron", "heravi2024.ron texture.synthesis_hz=0"] {
        let found = holds("rates_of_graph", &subject(Some(&graph(name))));
        let whole = found.contains("a window of 0.1 s is not a whole number of samples");
        assert_eq!(whole, name.contains("synthesis"), "{name}: {found}");
    }
    holds_on("rates_of_graph", &["scenes/every_effect.ron"].map(graph));
    let graph = graph("texture.ron");
    let subject = subject(Some(&graph));
    let odd = failing(&subject, "velocity", |tick| tick.tick_hz % 10 != 0);
    fails("rates_of_graph", &odd, "faults at");
}

#[test]
fn rates_of_kinds() {
    let subject = subject(None);
    holds("rates_of_kinds", &subject);
    let empty = failing(&subject, "overlap_add", |tick| tick.outputs.audio(0).is_empty());
    fails("rates_of_kinds", &empty, "faults at");
}

/// A change of the first output of a kind: by the samples, the number of the call, and ticks a second.
type Change = fn(&mut [f32], u64, u32);

/// A case of kinds holds, and fails where one of them is changed.
fn holds_but_for(case: &str, mutants: &[(&str, Change, &str)]) {
    let subject = subject(None);
    holds(case, &subject);
    for &(kind, change, why) in mutants {
        let mutant = broken(&subject, kind, move |calls: &mut u64, tick| {
            let hz = tick.tick_hz;
            change(tick.outputs.audio(0), *calls, hz);
            *calls += 1;
        });
        fails(case, &mutant, why);
    }
}

#[test]
fn uneven_hops() {
    let quiet: Change = |y, _, hz| {
        if hz == 4000 {
            y.iter_mut().for_each(|y| *y *= 0.5);
        }
    };
    // Every fifth hop.
    let loud_where_long: Change = |y, _, hz| {
        if hz == 500 && y.len() == 89 {
            y.iter_mut().for_each(|y| *y *= 4.0);
        }
    };
    holds_but_for(
        "uneven_hops",
        &[("overlap_add", quiet, "off the level"), ("overlap_add", loud_where_long, "at 44100 Hz, 500")],
    );
}

#[test]
fn any_tick_length() {
    let begins_anew: Change = |y, _, _| y.iter_mut().take(1).for_each(|y| *y *= 0.999);
    holds_but_for("any_tick_length", &[("resample", begins_anew, "of its largest sample off")]);
}

#[test]
fn tail_of_filters() {
    let denormal: Change = |y, _, _| {
        if let Some(last) = y.last_mut() {
            *last = if *last == 0.0 { f32::from_bits(7) } else { *last };
        }
    };
    let endless: Change = |y, _, _| y.iter_mut().for_each(|y| *y += 1e-20);
    holds_but_for(
        "tail_of_filters",
        &[("gain", denormal, "is denormal in tick"), ("actuator_inverse", endless, "its tail it sounds")],
    );
}

#[test]
fn tail_of_graph() {
    let graphs = ["texture.ron", "heravi2024.ron", "voltage_amplifier.ron"].map(graph);
    holds_on("tail_of_graph", &graphs);
    let scenes = ["scenes/every_effect.ron", "scenes/side_by_side.ron", "scenes/twelve.ron"].map(graph);
    holds_on("tail_of_graph", &scenes);
    let subject = subject(Some(&graphs[0]));
    // Once it has been heard it is never quite silent.
    let hums = broken(&subject, "limiter", |heard: &mut bool, tick| {
        let y = tick.outputs.audio(0);
        *heard |= y.iter().any(|y| *y != 0.0);
        y.iter_mut().filter(|_| *heard).for_each(|y| *y += 1e-9);
    });
    fails("tail_of_graph", &hums, "something is played until");
}

#[test]
fn change_while_ringing() {
    // It clicks a little while after a change, which is in tick 625.
    let clicks: Change = |y, calls, _| {
        if calls == 630 {
            y.iter_mut().take(1).for_each(|y| *y += 0.1);
        }
    };
    // One that becomes softer for ever.
    let softer: Change = |y, calls, _| {
        let part = 1.0 - 0.002 * calls.saturating_sub(650).min(100) as f32;
        y.iter_mut().for_each(|y| *y *= part);
    };
    holds_but_for(
        "change_while_ringing",
        &[("limiter", clicks, "a step of"), ("limiter", softer, "half a second later")],
    );
}

const RATE_HZ: u32 = 48_000;
const TICK_HZ: u32 = 500;
/// Frames of a device's period.
const PERIOD: u64 = 1024;

/// A clock for ticks: told of the time of a callback \[ns\], if there is one, it answers when a frame is
/// asked for.
type Clock<'a> = &'a mut dyn FnMut(Option<f64>, f64) -> f64;

/// An hour of a device whose clock is off by `ppm`, and whose callbacks come late by 0 to 0.5 ms: frames
/// between the ticks that have been run and what the device has taken, the least and the most of them after
/// the first 10 s; and by how much two ticks were nearer or further apart than they should be, in us. Ticks
/// are run by the rule of the paced driver, each a period and 1.5 ms before its first frame is asked for: it
/// is the driver's clock that is looked at here.
fn an_hour(ppm: f64, clock: Clock<'_>) -> (f64, f64, f64) {
    let frame_ns = 1e9 / (f64::from(RATE_HZ) * (1.0 + ppm * 1e-6));
    let lead_ns = PERIOD as f64 * frame_ns + 1.5e6;
    // The stream begins at a frame a little ahead, once a tenth of a second has been listened to.
    let begin = 10 * PERIOD;
    let (mut tick, mut least, mut most, mut uneven) = (0_u64, f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
    let mut before_ns = None;
    for call in 0..3600 * u64::from(RATE_HZ) / PERIOD {
        let asked = call * PERIOD;
        let now = 1e9 + asked as f64 * frame_ns + 5e5 * uniform(5, call);
        clock(Some(now), 0.0);
        if asked < begin {
            continue;
        }
        // All that is due before the next callback.
        let next = now + PERIOD as f64 * frame_ns;
        loop {
            let first = time::first_sample(tick, RATE_HZ, TICK_HZ);
            let due = clock(None, (begin + first) as f64) - lead_ns;
            if due > next {
                break;
            }
            if asked > 10 * u64::from(RATE_HZ) {
                let apart = before_ns.map_or(96.0 * frame_ns, |before| due - before);
                uneven = uneven.max((apart - 96.0 * frame_ns).abs() / 1e3);
            }
            before_ns = Some(due);
            tick += 1;
        }
        if asked > 10 * u64::from(RATE_HZ) {
            let there = time::first_sample(tick, RATE_HZ, TICK_HZ) as f64 - (asked + PERIOD - begin) as f64;
            (least, most) = (least.min(there), most.max(there));
        }
    }
    (least, most, uneven)
}

/// Hard: a card's clock is off by 500 ppm for an hour. Must: no sample is missing, none piles up beyond a
/// period, a tick and 3 ms, and ticks stay evenly apart within 0.1 ms.
#[test]
fn a_clock_that_is_off_by_500_ppm_is_followed_for_an_hour() {
    let bound = PERIOD as f64 + 96.0 + 0.003 * f64::from(RATE_HZ);
    for ppm in [500.0, -500.0, 0.0] {
        let mut dll = Dll::new(RATE_HZ);
        let mut follows = |heard: Option<f64>, position| {
            let lost = heard.map_or(0, |now| dll.callback(now as u64, PERIOD).lost);
            assert_eq!(lost, 0, "nothing was lost");
            dll.line().time_ns(position)
        };
        let (least, most, uneven) = an_hour(ppm, &mut follows);
        println!("{ppm} ppm: {least} to {most} frames ahead, ticks uneven by {uneven:.1} us at most");
        assert!(least >= 0.0 && most <= bound, "{ppm} ppm: {least} to {most} frames, {bound} at most");
        assert!(uneven <= 100.0, "{ppm} ppm: ticks are uneven by {uneven} us");
        // The mutant: it is right at the first callback, and goes by the rate that is written on the device.
        let mut began = None;
        let mut nominal = |heard: Option<f64>, position: f64| {
            began = began.or(heard);
            began.unwrap_or_default() + position * 1e9 / f64::from(RATE_HZ)
        };
        let (least, most, _) = an_hour(ppm, &mut nominal);
        assert_eq!(least < 0.0 || most > bound, ppm != 0.0, "the mutant at {ppm} ppm: {least} to {most}");
    }
}

/// Hard: the clock of a hand on another machine is off by 500 ppm for an hour, and its messages are 0 to 8
/// ms under way beyond the least. Must: each is at its time within 3 ms.
#[test]
fn hand_clock_off_by_500_ppm_is_followed_for_an_hour() {
    for ppm in [500.0, -500.0] {
        let (mut clock, mut worst, mut last, mut first) = (RemoteClock::new(), 0.0_f64, 0.0_f64, None);
        let mut unmapped = 0.0_f64;
        for i in 0..3600 * 250_u64 {
            let at_s = i as f64 * 0.004;
            let arrived = (at_s * 1e9 + 1e6 + 8e6 * uniform(1, i)).max(last);
            last = arrived;
            let theirs = 77.0 + at_s * (1.0 + ppm * 1e-6);
            clock.hear(theirs, arrived as u64);
            let told = clock.time_ns(theirs, arrived as u64) as f64;
            // The least time under way cannot be known.
            let off = (told - at_s * 1e9 - 1e6).abs() * 1e-6;
            if at_s > 5.0 {
                worst = worst.max(off);
            }
            // The mutant: the first message says how the clocks stand for ever.
            let offset = *first.get_or_insert(arrived * 1e-9 - theirs);
            unmapped = unmapped.max((theirs + offset - at_s).abs() * 1e3);
        }
        println!("{ppm} ppm: off by at most {worst:.2} ms");
        assert!(worst <= 3.0, "{ppm} ppm: {worst} ms");
        assert!(unmapped > 3.0, "the mutant is off by {unmapped} ms");
    }
}
