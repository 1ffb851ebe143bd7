//! Motions that no hand makes, and places that come late, twice or not at all.

use asperity_checks::Subject;

use crate::{broken, fails, graph, holds, holds_on, subject};

#[test]
fn teleport() {
    let graph = graph("texture.ron");
    let subject = subject(Some(&graph));
    holds("teleport", &subject);
    // A velocity that does not get over a jump.
    let hurt = broken(&subject, "velocity", |(before, hurt): &mut (f64, bool), tick| {
        let x = tick.inputs.control(0)[0];
        *hurt |= tick.index > 1 && (x - *before).abs() > 50.0;
        *before = x;
        if *hurt {
            (0..2).for_each(|output| tick.outputs.control(output).iter_mut().for_each(|v| *v *= 0.1));
        }
    });
    fails("teleport", &hurt, "1 s later its rms is");
}

/// The shipped graphs that say most: the recommended one, one of overlap-add, and a scene.
fn everywhere(case: &str) {
    holds_on(case, &["texture.ron", "voltage_amplifier.ron", "scenes/every_effect.ron"].map(graph));
}

/// Velocities that are spoilt in the tick after one that was lost or not to be trusted.
fn after_a_gap<'g>(subject: &Subject<'g>) -> Subject<'g> {
    broken(subject, "velocity", |(last, more): &mut (u64, f64), tick| {
        if tick.inputs.valid(0) {
            if tick.index > *last + 1 && *last > 0 {
                *more = 300.0;
            }
            *last = tick.index;
        }
        *more *= 0.9;
        tick.outputs.control(1)[0] += *more;
    })
}

#[test]
fn one_count_at_rest() {
    everywhere("one_count_at_rest");
    let fast = graph("texture.ron motion.cutoff_hz=40");
    fails("one_count_at_rest", &subject(Some(&fast)), "opens the gate");
    // A gate that would not notice a filter that tells twice the speed.
    let deaf = graph("texture.ron gate.speed_mm_s=30");
    let twice = broken(&subject(Some(&deaf)), "velocity", |(): &mut (), tick| {
        (0..2).for_each(|output| tick.outputs.control(output).iter_mut().for_each(|v| *v *= 2.0));
    });
    fails("one_count_at_rest", &twice, "are allowed");
}

#[test]
fn around_the_gate() {
    everywhere("around_the_gate");
    let without = graph("texture.ron gate.hysteresis=1");
    fails("around_the_gate", &subject(Some(&without)), "the gate changes");
    // A gate that opens at once and for good.
    let graph = graph("texture.ron");
    let open = broken(&subject(Some(&graph)), "speed_gate", |(): &mut (), tick| tick.outputs.set(1, 1.0));
    fails("around_the_gate", &open, "opens");
}

#[test]
fn sampling_times() {
    everywhere("sampling_times");
    // As it was: a tick of 10 ms was held to what one of 2 ms does.
    holds("sampling_times", &subject(Some(&graph("texture.ron tick_hz=100"))));
    let raw = graph("texture.ron motion.cutoff_hz=0");
    fails("sampling_times", &subject(Some(&raw)), "are allowed");
}

#[test]
fn lost_ticks() {
    everywhere("lost_ticks");
    let graph = graph("texture.ron");
    fails("lost_ticks", &after_a_gap(&subject(Some(&graph))), "are allowed");
}

#[test]
fn a_gap_of_10_ms() {
    everywhere("a_gap_of_10_ms");
    let graph = graph("texture.ron");
    let subject = subject(Some(&graph));
    fails("a_gap_of_10_ms", &after_a_gap(&subject), "marked");
    // What is played clicks where trust ends.
    let clicks = broken(&subject, "limiter", |(): &mut (), tick| {
        if !tick.inputs.valid(0) {
            tick.outputs.audio(0).iter_mut().take(1).for_each(|x| *x += 0.2);
        }
    });
    fails("a_gap_of_10_ms", &clicks, "a step of");
}
