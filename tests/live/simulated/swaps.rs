//! A graph that changes while it is played.

use asperity_audio::simulated::Simulated;
use asperity_live::driver::Clock;
use asperity_live::{DeviceQueues, Sample, needs_queues, now_ns, samples};
use harness::alone::{beside_others, shared_stage};
use harness::live::Live;
use harness::stage::{
    STEP, by_hand, channel, graph, largest_step, offline, options, start, start_with, stop, swap, voice,
};

use super::on_channels;
use crate::edits::edit;

/// Two voices; the first is as loud as is asked for, by another limiter.
fn two(amps: f64, dc_corner_hz: f64) -> (asperity_graph::GraphFile, asperity_graph::Compiled) {
    let (nodes, wires) = voice("a", 80.0, amps);
    let nodes = nodes.replace(
        r#"(profile: "hapcoil_one")"#,
        &format!("(profile: \"hapcoil_one\", slew_hz: {dc_corner_hz:?})"),
    );
    let (more, more_wires) = voice("b", 123.0, 0.07);
    graph(&harness::registry(), (500, 48_000), &(nodes + &more), &(wires + &more_wires))
}

#[test]
fn swap_leaves_the_other_channel_and_figures_go_on() {
    let _alone = beside_others();
    let card = Simulated::new("swap", by_hand()).expect("a card");
    let mut session = start(two(0.1, 2000.0), on_channels(&card, &[1, 2], 48_000));
    let step = |n: usize| (0..n).for_each(|_| card.step(97));
    step(100);
    let before = session.view();
    swap(&mut session, two(0.05, 3000.0));
    // Sent and not yet taken over: nothing seems to have been lost.
    let sent = session.view();
    let index = |s: &mut asperity_live::Session, id: &str| {
        s.graph_controller().schedule().index_of(id).expect("a node")
    };
    let kept = index(&mut session, "b tone");
    assert_eq!((sent.layout, sent.nodes[kept].calls), (1, before.nodes[kept].calls));
    assert_eq!(sent.nodes[kept].max_us, before.nodes[kept].max_us);
    // Another one at once: they are taken over one after the other.
    swap(&mut session, two(0.1, 2000.0));
    step(100);
    let view = session.view();
    let kept = index(&mut session, "b tone");
    assert!(view.nodes[kept].calls > before.nodes[kept].calls + 90, "{:?}", view.nodes[kept]);
    // A mean over calls that were timed: no call takes more than the longest of them.
    assert!(
        view.nodes[kept].us > 0.0 && view.nodes[kept].us <= view.nodes[kept].max_us,
        "{:?}",
        view.nodes[kept]
    );
    assert_eq!(session.graph_controller().collect().len(), 2);
    let wanted = offline(two(0.1, 2000.0).1, 19_400);
    let b = channel(&card.played(), 2, 1);
    assert!(b.iter().zip(&wanted[1]).all(|(y, x)| *y == f64::from(*x)));
    let a = channel(&card.played(), 2, 0);
    assert!(largest_step(&a) < STEP, "{}", largest_step(&a));
    assert!(a.iter().zip(&wanted[0]).any(|(y, x)| *y != f64::from(*x)), "the first swap was heard");
    let ended = stop(session, &card);
    let engine = ended.player.as_ref().expect("the player").engine();
    for (i, node) in ended.view.nodes.iter().enumerate() {
        let report = engine.report(i).expect("a report");
        assert_eq!((node.calls, node.slept, node.faults), (report.calls, report.slept, report.faults));
    }
}

#[test]
fn refused_swap_changes_nothing_and_the_next_one_is_taken() {
    let _alone = beside_others();
    let card = Simulated::new("refused", by_hand()).expect("a card");
    let mut session = start(two(0.1, 2000.0), on_channels(&card, &[1, 2], 48_000));
    (0..50).for_each(|_| card.step(97));
    for rates in [(1000, 48_000), (500, 44_100)] {
        let (nodes, wires) = voice("a", 80.0, 0.1);
        let (file, compiled) = graph(&harness::registry(), rates, &nodes, &wires);
        let refused =
            session.graph_controller().swap(compiled, &file, &[], DeviceQueues::default(), Vec::new());
        assert!(refused.is_err());
        assert_eq!(session.graph_controller().layout().number, 0);
    }
    swap(&mut session, two(0.1, 3000.0));
    (0..50).for_each(|_| card.step(97));
    let played = card.played();
    // Were its places those of a graph that never came, both channels would be silent.
    assert!(played[2 * 97 * 90..].chunks(2).any(|f| f[0].abs() > 0.05 && f[1].abs() > 0.01));
    assert_eq!(session.view().layout, 1);
}

#[test]
fn a_hand_goes_on_across_a_swap_and_its_rate_does_not_jump() {
    let _alone = beside_others();
    let hand = |gain: f64, timeout_ms: f64| {
        let (nodes, wires) = voice("out", 80.0, 0.1);
        let nodes = format!(
            r#"{nodes} "hand": (kind: "pointer_input", params: (timeout_ms: {timeout_ms:?})),
               "gain": (kind: "gain", params: (gain: {gain:?})),
               "force": (kind: "probe", params: (file: "f.csv")),"#
        );
        let wires = format!(r#"{wires} ("hand.force", "gain"), ("gain", "force")"#);
        graph(&harness::registry(), (500, 48_000), &nodes, &wires)
    };
    let card = Simulated::new("swapped hand", by_hand()).expect("a card");
    let (mut writer, reader) = samples();
    let queues = DeviceQueues { hands: [("hand".to_owned(), reader)].into(), ..DeviceQueues::default() };
    let mut session = start_with(hand(1.0, 10_000.0), queues, None, options(&card, Clock::Callback));
    let mut feed = |session: &mut asperity_live::Session| {
        for _ in 0..100 {
            let now = now_ns();
            assert!(writer.send(Sample { time_ns: now, arrived_ns: now, force: 0.5, ..Sample::default() }));
            card.step(96);
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        session.view()
    };
    let before = feed(&mut session);
    assert_eq!(before.sources[0].samples, 100);
    assert!(
        (10.0..500.0).contains(&(before.sources[0].rate_hz / (1.0 - (-0.2_f64).exp()))),
        "{:?}",
        before.sources
    );
    let (file, compiled) = hand(2.0, 10_000.0);
    assert!(needs_queues(session.graph_controller().schedule(), &compiled.schedule).is_empty());
    swap(&mut session, (file, compiled));
    let sent = session.view();
    assert_eq!(sent.sources[0].samples, 100, "before it is taken over");
    // None came since: a count that began anew would have all of them come at once.
    assert!(sent.sources[0].rate_hz <= before.sources[0].rate_hz, "{:?}", sent.sources);
    let view = feed(&mut session);
    assert_eq!((view.sources[0].samples, view.sources[0].stalls), (200, 0));
    // Otherwise set, it needs an end of its own.
    let (_, compiled) = hand(2.0, 60.0);
    assert_eq!(needs_queues(session.graph_controller().schedule(), &compiled.schedule), ["hand"]);
    // Two tapes: the probe of the graph before is read to its end.
    let mut forces = Vec::new();
    session.graph_controller().recorded(|r| forces.push((r.sink.to_owned(), r.start, r.values[0])));
    assert!(forces.windows(2).all(|w| w[1].1 == w[0].1 + 1), "no tick twice or left out");
    assert!(forces.iter().any(|f| f.2 == 1.65) && forces.iter().any(|f| f.2 == 3.3));
}

/// The run goes on.
#[test]
fn edit_of_the_devices_channels_is_refused() {
    let dir = &*shared_stage();
    let write = |voices: &[(String, String)], amps: f64| {
        let (nodes, wires): (Vec<_>, Vec<_>) = voices.iter().cloned().unzip();
        let (nodes, wires) = (nodes.concat().replace("0.1", &format!("{amps:?}")), wires.concat());
        let text =
            format!("Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{{nodes}}}, wires: [{wires}])");
        edit(dir, text);
    };
    let [one, other] = [voice("a", 80.0, 0.1), voice("b", 123.0, 0.07)];
    write(std::slice::from_ref(&one), 0.1);
    let mut run = Live::start(dir, &["g.ron", "--device", "simulated:frames=256", "--watch"]);
    run.says("plays on");
    write(&[one.clone(), other], 0.1);
    run.says("channels of the device would change");
    run.says("the running graph goes on");
    write(&[one], 0.05);
    run.says("changed: ");
    run.stop().ok();
}
