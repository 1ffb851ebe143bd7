//! Faults of a card, and of a graph.

use std::f64::consts::TAU;
use std::time::Duration;

use asperity_audio::simulated::{Params, Simulated};
use asperity_live::SessionOptions;
use asperity_live::driver::Clock;
use asperity_live::view::Condition;
use asperity_node::{
    Descriptor, Diagnostic, Node, Output, Prepared, Processor, RateSpec, Setup, ShapeSpec, Status, Tick, Unit,
};
use harness::alone::beside_others;
use harness::live::told;
use harness::stage::{STEP, by_hand, channel, graph, largest_step, one_voice, options, poll, start, timed};

/// Samples in which a stop, a mute or a panic must be silent: 20 ms.
const DOWN: usize = 960;

/// Samples from the end of an undisturbed sine to the last that is heard: how long it takes to be silent.
/// None where there is no sine. Each sample of one follows from the two before it; a ramp, or a value that is
/// held, breaks that by 1e-6 and more.
fn fall(all: &[f64], radians: f64) -> Option<usize> {
    /// As many in a row are no ramp that happens to cross zero.
    const ROW: usize = 16;
    let last = all.iter().rposition(|y| *y != 0.0)?;
    let follows = |n: usize| {
        let w = &all[n - 2..=n];
        w[2] != 0.0 && (w[2] - 2.0 * radians.cos() * w[1] + w[0]).abs() < 5e-8
    };
    let full = (ROW + 2..=last).rev().find(|n| (n - ROW..*n).all(follows))?;
    Some(last + 1 - full)
}

fn heard(card: &Simulated) -> Vec<f64> {
    channel(&card.played(), 2, 0)
}

/// Errors without end, and no calls, like ALSA over a killed Pulse server.
fn flood(card: &Simulated) {
    card.stop();
    (0..1000).for_each(|_| card.error());
}

fn playing(session: &mut asperity_live::Session) -> bool {
    session.view().condition == Condition::Playing
}

#[test]
fn mute_is_silent_within_20_ms_and_the_graph_goes_on() {
    let _alone = beside_others();
    let card = Simulated::new("mute", by_hand()).expect("a card");
    let mut session = start(one_voice(), options(&card, Clock::Callback));
    (0..100).for_each(|_| card.step(97));
    session.run_control().mute(true);
    assert_eq!(session.view().condition, Condition::Muted);
    (0..40).for_each(|_| card.step(97));
    session.run_control().mute(false);
    (0..200).for_each(|_| card.step(97));
    assert_eq!(session.view().condition, Condition::Playing);
    let all = heard(&card);
    assert!(largest_step(&all) < STEP, "{}", largest_step(&all));
    assert!(all[9700 + DOWN..13_580].iter().all(|y| *y == 0.0));
    // The graph went on under it: what comes back is where it would have been.
    let wanted = harness::stage::offline(one_voice().1, all.len()).swap_remove(0);
    assert!(all[13_580 + 9700..].iter().zip(&wanted[13_580 + 9700..]).all(|(y, x)| *y == f64::from(*x)));
}

/// Nothing is played after the ramp.
#[test]
fn stop_or_drop_of_a_session_ramps_down_within_20_ms() {
    let _alone = beside_others();
    for (clock, dropped) in
        [(Clock::Callback, false), (Clock::Callback, true), (Clock::Paced, false), (Clock::Paced, true)]
    {
        let mut attempts = 0..;
        told(|| ramps_down(clock, dropped, attempts.next().unwrap_or(0)));
    }
}

/// One end of a run. A busy machine may break the sine just before.
fn ramps_down(clock: Clock, dropped: bool, attempt: u32) -> Result<(), String> {
    // One that is stopped plays what it was given 100 ms later, and is still to be there.
    let latency_frames = if dropped { 0 } else { 4800 };
    let params = Params { latency_frames, ..timed(64) };
    let name = format!("stop {} {dropped} {attempt}", clock.name());
    let card = Simulated::new(&name, params).expect("a card");
    let mut session = start(one_voice(), options(&card, clock));
    // Half a second, in which the limiter's high-pass forgets the start.
    poll(&mut session, "a tone", |s| playing(s) && heard(&card).len() > 24_000);
    let mut view = session.view();
    if dropped {
        drop(session);
    } else {
        let ended = session.stop();
        assert!(ended.player.is_some());
        assert_eq!(ended.view.condition, Condition::Stopping);
        view = ended.view;
    }
    let all = heard(&card);
    let last = all.iter().rposition(|y| *y != 0.0).expect("a tone");
    assert!(!card.in_use());
    let silent = all.len() - last;
    assert!(silent > if dropped { 1 } else { 1000 }, "{name}: cut off {silent} frames after its end");
    if view.underruns + view.xruns > 0 {
        return Err(format!("{name}: {} underruns, {} of the host", view.underruns, view.xruns));
    }
    assert!(largest_step(&all) < STEP, "{name}: {}", largest_step(&all));
    let fall = fall(&all, TAU * 80.0 / 48_000.0).expect("a tone");
    println!("{name}: down in {fall} samples");
    assert!(fall <= DOWN, "{name}: down in {fall} samples, not {DOWN}");
    Ok(())
}

#[test]
fn underrun_and_gap_are_counted_and_join_without_a_step() {
    let _alone = beside_others();
    told(|| {
        let card = Simulated::new("gaps", timed(64)).expect("a card");
        let mut session = start(one_voice(), options(&card, Clock::Callback));
        poll(&mut session, "a second", |s| playing(s) && heard(&card).len() > 48_000);
        let xruns = session.view().xruns;
        // A gap that the loop saw before may stand for some of them.
        poll(&mut session, "the underrun", |s| {
            card.xrun();
            s.view().xruns > xruns
        });
        let before = session.view();
        // While the card's time is being found, as after a stall of a busy machine, a gap shifts that and is
        // no loss: then another.
        let mut frames = 0;
        poll(&mut session, "the gap", |s| {
            if heard(&card).len() > frames {
                frames = heard(&card).len() + 48_000;
                card.gap(Duration::from_millis(120));
            }
            s.view().lost_samples >= before.lost_samples + 4000
        });
        let frames = heard(&card).len();
        poll(&mut session, "more", |_| heard(&card).len() > frames + 9600);
        let view = session.stop().view;
        assert!(view.skipped_ticks >= 40, "{} ticks were left out", view.skipped_ticks);
        assert!(largest_step(&heard(&card)) < STEP);
        // Position is time: what is played is as far on as what went by.
        let heard = heard(&card);
        // The card was listened to before, for longer on a busy machine.
        let begin = heard.iter().position(|y| *y != 0.0).expect("a tone");
        let seconds = ((heard.len() - begin) as u64 + view.lost_samples) as f64 / 48_000.0;
        // A stall while the card's time is being found shifts that.
        if (seconds - view.seconds).abs() < 0.02 {
            Ok(())
        } else {
            Err(format!("{seconds} of {}", view.seconds))
        }
    });
}

#[test]
fn lost_card_is_waited_for_and_fades_in_when_back() {
    let _alone = beside_others();
    type Way = (&'static str, fn(&Simulated), fn(&Simulated));
    let ways: [Way; 3] = [
        ("flood", flood, Simulated::resume),
        ("silence", Simulated::stop, Simulated::resume),
        ("plug", Simulated::unplug, Simulated::plug),
    ];
    let card = Simulated::new("lost", timed(64)).expect("a card");
    let mut session = start(one_voice(), options(&card, Clock::Callback));
    for (losses, (name, harm, mend)) in ways.into_iter().enumerate() {
        poll(&mut session, "a tone", |s| playing(s) && s.view().clock == "callback");
        let ticks = session.view().ticks;
        harm(&card);
        let said = poll(&mut session, name, |s| s.view().condition == Condition::Lost);
        assert!(
            said.iter().any(|s| s.contains("is lost") && s.contains("when the device is back")),
            "{said:?}"
        );
        assert!(session.goes_on());
        let view = session.view();
        assert_eq!((view.losses, view.clock.as_str()), (losses as u64 + 1, "timer"));
        // Without a card the graph goes on.
        let further = view.ticks.max(ticks) + 50;
        poll(&mut session, "ticks without a card", |s| s.view().ticks > further);
        let quiet = heard(&card).len();
        mend(&card);
        let said = poll(&mut session, "the card", |s| playing(s) && s.view().clock == "callback");
        assert!(said.iter().any(|s| s.contains("is back")), "{name}: {said:?}");
        poll(&mut session, "the tone", |_| heard(&card)[quiet..].iter().any(|y| y.abs() > 0.05));
    }
    // One that is not waited for ends the run.
    let ended = session.stop();
    assert!(ended.player.is_some());
    let options = asperity_live::SessionOptions { reconnect: false, ..options(&card, Clock::Callback) };
    let mut session = start(one_voice(), options);
    card.unplug();
    poll(&mut session, "the end", |s| !s.goes_on());
    assert!(session.stop().player.is_some());
}

/// A slow wave, until tick 50: then it panics, or is no number any more.
struct Breaks<const PANICS: bool>;

impl<const PANICS: bool> Node for Breaks<PANICS> {
    fn descriptor() -> Descriptor {
        let out = Output::new("out", ShapeSpec::Audio(RateSpec::Graph), Unit::AMPERE);
        Descriptor::new(if PANICS { "panics" } else { "fails" }, "A wave, then none.").output(out)
    }
    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl<const PANICS: bool> Processor for Breaks<PANICS> {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        assert!(!PANICS || tick.index < 50, "as told");
        let (index, span) = (tick.index, tick.samples(48_000));
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            *y = if index < 50 { 0.1 * (n as f32 * 0.0105).sin() } else { f32::NAN };
        }
        Status::Continue
    }
    fn reset(&mut self) {}
}

/// A graph that plays such a node.
fn breaking(kind: &str) -> (asperity_graph::GraphFile, asperity_graph::Compiled) {
    let registry = harness::registry().with::<Breaks<true>>().with::<Breaks<false>>();
    let nodes =
        format!(r#""bad": (kind: "{kind}"), "limiter": (kind: "limiter"), "out": (kind: "audio_out"),"#);
    graph(&registry, (500, 48_000), &nodes, r#"("bad", "limiter"), ("limiter", "out")"#)
}

#[test]
fn panicking_node_is_named_and_every_clock_goes_on() {
    let _alone = beside_others();
    for clock in [Clock::Callback, Clock::Paced, Clock::Timer] {
        let card = Simulated::new(&format!("breaks {}", clock.name()), timed(64)).expect("a card");
        let options = options(&card, clock);
        let device = if clock == Clock::Timer { None } else { options.device.clone() };
        let mut session = start(breaking("panics"), SessionOptions { device, ..options });
        poll(&mut session, "ticks after the panic", |s| s.view().ticks > 200);
        let view = session.view();
        assert!(session.goes_on() && view.condition == Condition::Playing, "{:?}", view.condition);
        let bad = session.graph_controller().schedule().index_of("bad").expect("the node");
        let node = &view.nodes[bad];
        assert!(node.quarantined && node.last_fault.contains("panicked"), "{node:?}");
        let ended = session.stop();
        assert!(ended.player.is_some());
        if clock != Clock::Timer {
            let all = heard(&card);
            assert!(largest_step(&all) < STEP, "{}: {}", clock.name(), largest_step(&all));
        }
    }
}

#[test]
fn a_node_that_fails_fades_is_named_and_the_run_goes_on() {
    let _alone = beside_others();
    let card = Simulated::new("node", by_hand()).expect("a card");
    let mut session = start(breaking("fails"), options(&card, Clock::Callback));
    (0..200).for_each(|_| card.step(64));
    let view = session.view();
    assert!(session.goes_on() && view.condition == Condition::Playing);
    let bad = session.graph_controller().schedule().index_of("bad").expect("the node");
    assert!(
        view.nodes[bad].quarantined && view.nodes[bad].last_fault.contains("not finite"),
        "{:?}",
        view.nodes[bad]
    );
    assert_eq!(view.faults, view.nodes[bad].faults);
    let all = heard(&card);
    assert!(all[4600..4800].iter().any(|y| y.abs() > 0.01));
    assert!(largest_step(&all) < STEP, "{}", largest_step(&all));
    // What is left is the DC that the limiter takes out, at its corner of 5 Hz.
    assert!(all[4800 + DOWN..].iter().all(|y| y.abs() < 0.003));
    assert!(all[12_000..].iter().all(|y| y.abs() < 1e-4));
}
