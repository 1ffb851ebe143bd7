//! Faults of the simulated card are told once, in words, and close the stream.

use std::time::Duration;

use asperity_audio::Stream;
use asperity_audio::simulated::Simulated;
use harness::alone::beside_others;
use harness::stage::{by_hand, timed};

use super::parts::{Count, Each, calls, left, loss, on, play, refusal};

/// A card in real time, and a stream that it has called.
fn live(name: &str) -> (Simulated, Stream) {
    let card = Simulated::new(name, timed(64)).unwrap();
    let stream = play(&on(&card), Count::default());
    calls(&stream, 0);
    (card, stream)
}

#[test]
fn underrun_and_few_errors_are_counted_and_do_no_harm() {
    let _alone = beside_others();
    let card = Simulated::new("errors", by_hand()).unwrap();
    let stream = play(&on(&card), Count::default());
    (0..20).for_each(|_| card.error());
    card.xrun();
    card.step(64);
    std::thread::sleep(Duration::from_millis(100));
    let stats = stream.stats();
    assert_eq!((stats.errors, stats.xruns, stats.callbacks, stream.lost()), (20, 1, 1, None));
}

#[test]
fn lost_stream_that_still_calls_fades_out_before_closing() {
    let _alone = beside_others();
    let faded = (0..10).any(|at| {
        let card = Simulated::new(&format!("fade {at}"), timed(64)).unwrap();
        let stream = play(&on(&card), Each(|_| 0.5, 0));
        calls(&stream, 0);
        (0..60).for_each(|_| card.error());
        loss(&stream);
        let steepest = 0.5 * std::f64::consts::FRAC_PI_2 / 480.0 * 1.01;
        assert!(left(&card).windows(2).all(|pair| pair[0] - pair[1] < steepest), "a step");
        // A busy machine may hold the card until nobody waits for it.
        left(&card).last() == Some(&0.0)
    });
    assert!(faded);
}

#[test]
fn lost_stream_says_why_is_closed_and_opens_again() {
    let _alone = beside_others();
    type Way = (&'static str, fn(&Simulated), fn(&Simulated), [&'static str; 2]);
    let ways: [Way; 3] = [
        // Like ALSA over a killed Pulse server.
        ("flood", |card| (0..1000).for_each(|_| card.error()), |_| {}, ["flood", "simulated error"]),
        ("plug", Simulated::unplug, Simulated::plug, ["not available"; 2]),
        ("stop", Simulated::stop, Simulated::resume, ["not called for 1."; 2]),
    ];
    for (name, harm, mend, why) in ways {
        let (card, stream) = live(name);
        harm(&card);
        let reason = loss(&stream);
        assert!(why.iter().all(|part| reason.contains(part)), "{name}: {reason}");
        assert!(!card.in_use());
        assert_eq!(stream.play(), Err(reason));
        if name == "plug" {
            let error = refusal(&on(&card));
            assert!(error.reason.contains("there is no output device `plug`"), "{error}");
        }
        mend(&card);
        // The lost stream is still in hand: it does not stand in the way. Nor does one that is dropped.
        for _ in 0..2 {
            let again = play(&on(&card), Count::default());
            calls(&again, 0);
            assert_eq!(again.id(), stream.id());
            drop(again);
            assert!(!card.in_use());
        }
    }
}

#[test]
fn short_gap_loses_no_sample_and_is_no_loss() {
    let _alone = beside_others();
    let (card, stream) = live("gap");
    card.gap(Duration::from_millis(300));
    calls(&stream, 100);
    assert_eq!(stream.lost(), None);
    drop(stream);
    assert!(left(&card).iter().enumerate().all(|(at, value)| *value == Count::value(at)));
}

#[test]
fn device_that_never_calls_is_lost() {
    let _alone = beside_others();
    let card = Simulated::new("silent", timed(64)).unwrap();
    card.stop();
    let stream = play(&on(&card), Count::default());
    assert!(loss(&stream).contains("has not called once in 2 s"), "{:?}", stream.lost());
}

#[test]
fn panic_while_filling_fades_and_is_a_loss_that_says_so() {
    let _alone = beside_others();
    let card = Simulated::new("no legs", by_hand()).unwrap();
    let legs = |at: usize| {
        assert!(at < 99, "a node has no legs");
        0.25
    };
    let stream = play(&on(&card), Each(legs, 0));
    (0..3).for_each(|_| card.step(64));
    assert!(loss(&stream).contains("a node has no legs"), "{:?}", stream.lost());
    let left = left(&card);
    assert!(left[..64].iter().all(|value| *value == 0.25));
    // The block that it did not finish is not played in part. Telling of the panic may make a gap before the
    // next.
    let steepest = 0.25 * std::f64::consts::FRAC_PI_2 / 480.0 * 1.01;
    assert!(left[63..128].windows(2).all(|pair| pair[1] < pair[0] && pair[0] - pair[1] < steepest));
    assert!(!card.in_use());
}
