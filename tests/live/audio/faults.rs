//! Faults of the simulated card are told once, in words, and close the stream.

use std::sync::mpsc::Receiver;
use std::time::Duration;

use asperity_audio::simulated::{Params, Simulated};
use asperity_audio::{Event, Process, Stream, events, open};
use harness::alone::real_time;
use harness::live::until;

use super::parts::{Count, Each, by_hand, on, wait_for_loss};

fn live(card: &Simulated, process: impl Process + 'static) -> (Stream, Receiver<Event>) {
    let (sender, received) = events();
    let stream = open(&on(card), Box::new(process), None, sender).unwrap();
    stream.play().unwrap();
    (stream, received)
}

fn in_time() -> Params {
    Params { frames: vec![64], keep: true, ..Params::default() }
}

#[test]
fn an_underrun_is_told_and_the_stream_goes_on() {
    let _alone = real_time();
    let card = Simulated::new("xrun", by_hand()).unwrap();
    let (stream, received) = live(&card, Count::default());
    card.step(64);
    card.xrun();
    assert_eq!(received.recv_timeout(Duration::from_secs(20)), Ok(Event::Xrun));
    card.step(64);
    assert_eq!((stream.stats().xruns, stream.stats().callbacks, stream.lost()), (1, 2, None));
}

#[test]
fn a_few_errors_are_counted_and_do_no_harm() {
    let _alone = real_time();
    let card = Simulated::new("errors", by_hand()).unwrap();
    let (stream, received) = live(&card, Count::default());
    (0..20).for_each(|_| card.error());
    card.step(64);
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!((stream.stats().errors, stream.lost()), (20, None));
    assert_eq!(received.try_iter().count(), 0);
}

#[test]
fn flood_of_errors_is_one_loss_and_closes_the_stream() {
    let _alone = real_time();
    let card = Simulated::new("flood", in_time()).unwrap();
    let (stream, received) = live(&card, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    card.flood();
    let (reason, _) = wait_for_loss(&received);
    assert!(reason.contains("flood") && reason.contains("simulated error"), "{reason}");
    assert!(!card.in_use());
    let errors = stream.stats().errors;
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(stream.stats().errors, errors, "errors still come");
    assert_eq!(received.try_iter().count(), 0);
    assert_eq!(stream.lost(), Some(reason.as_str()));
    assert_eq!(stream.play(), Err(reason));
}

#[test]
fn lost_stream_that_still_calls_fades_out_before_closing() {
    let _alone = real_time();
    let faded = (0..10).any(|at| {
        let card = Simulated::new(&format!("fade {at}"), in_time()).unwrap();
        let (stream, received) = live(&card, Each(|| 0.5));
        until("a call", || stream.stats().callbacks > 0);
        (0..60).for_each(|_| card.error());
        wait_for_loss(&received);
        let left: Vec<f64> = card.played().chunks(2).map(|frame| frame[0]).collect();
        let steepest = 0.5 * std::f64::consts::FRAC_PI_2 / 480.0 * 1.01;
        assert!(left.windows(2).all(|pair| pair[0] - pair[1] < steepest), "a step");
        // A busy machine may hold the card until nobody waits for it.
        left.last() == Some(&0.0)
    });
    assert!(faded);
}

#[test]
fn unplugged_device_is_lost_and_opens_again_when_back() {
    let _alone = real_time();
    let card = Simulated::new("plug", in_time()).unwrap();
    let (stream, received) = live(&card, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    card.unplug();
    let (reason, _) = wait_for_loss(&received);
    assert!(reason.contains("not available"), "{reason}");
    let (sender, _events) = events();
    let error = open(&on(&card), Box::new(Count::default()), None, sender).err().unwrap();
    assert!(error.to_string().contains("there is no output device `plug`"), "{error}");
    card.plug();
    // The lost stream is still in hand: it does not stand in the way.
    let (again, _received) = live(&card, Count::default());
    until("a call", || again.stats().callbacks > 0);
    assert_eq!(again.id(), stream.id());
}

#[test]
fn short_gap_is_told_with_its_length_and_loses_no_sample() {
    let _alone = real_time();
    let card = Simulated::new("gap", in_time()).unwrap();
    let (stream, received) = live(&card, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    card.gap(Duration::from_millis(300));
    until("the gap", || stream.stats().longest_gap_ms >= 300.0);
    let told = received.recv_timeout(Duration::from_secs(20)).unwrap();
    // A busy machine may have made a gap of its own before.
    assert!(matches!(told, Event::Gap { ms } if ms > 50.0), "{told:?}");
    assert_eq!(stream.lost(), None);
    drop(stream);
    let left: Vec<f64> = card.played().chunks(2).map(|frame| frame[0]).collect();
    assert!(left.iter().enumerate().all(|(at, value)| *value == Count::value(at)));
}

#[test]
fn a_device_that_stops_calling_without_a_word_is_lost() {
    let _alone = real_time();
    let card = Simulated::new("stop", in_time()).unwrap();
    let (stream, received) = live(&card, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    card.stop();
    let (reason, _) = wait_for_loss(&received);
    assert!(reason.contains("not called for 1."), "{reason}");
    assert!(!card.in_use());
}

#[test]
fn a_device_that_never_begins_to_call_is_lost() {
    let _alone = real_time();
    let card = Simulated::new("mute", in_time()).unwrap();
    card.stop();
    let (_stream, received) = live(&card, Count::default());
    let (reason, _) = wait_for_loss(&received);
    assert!(reason.contains("has not called once in 2 s"), "{reason}");
}

#[test]
fn a_stream_that_is_paused_is_not_missed() {
    let _alone = real_time();
    let card = Simulated::new("pause", in_time()).unwrap();
    let (stream, received) = live(&card, Count::default());
    until("a call", || stream.stats().callbacks > 0);
    stream.pause().unwrap();
    std::thread::sleep(Duration::from_millis(1300));
    let before = stream.stats().callbacks;
    stream.play().unwrap();
    until("a call", || stream.stats().callbacks > before);
    assert_eq!(stream.lost(), None);
    assert!(!received.try_iter().any(|event| matches!(event, Event::Lost { .. })));
}

#[test]
fn a_panic_while_filling_fades_and_is_a_loss_that_says_so() {
    let _alone = real_time();
    let card = Simulated::new("panic", by_hand()).unwrap();
    let mut left = 100;
    let (stream, received) = live(
        &card,
        Each(move || {
            left -= 1;
            assert!(left > 0, "a node has no legs");
            0.25
        }),
    );
    card.step(64);
    card.step(64);
    card.step(64);
    let (reason, _) = wait_for_loss(&received);
    assert!(reason.contains("a node has no legs"), "{reason}");
    let left: Vec<f64> = card.played().chunks(2).map(|frame| frame[0]).collect();
    assert!(left[..64].iter().all(|value| *value == 0.25));
    // The block that it did not finish is not played in part. Telling of the panic may make a gap before the
    // next.
    let steepest = 0.25 * std::f64::consts::FRAC_PI_2 / 480.0 * 1.01;
    assert!(left[63..128].windows(2).all(|pair| pair[1] < pair[0] && pair[0] - pair[1] < steepest));
    assert!(stream.lost().is_some() && !card.in_use());
}

#[test]
fn a_stream_that_is_dropped_leaves_the_device_to_the_next() {
    let _alone = real_time();
    let card = Simulated::new("next", in_time()).unwrap();
    for _ in 0..5 {
        let (stream, _received) = live(&card, Count::default());
        until("a call", || stream.stats().callbacks > 0);
        drop(stream);
        assert!(!card.in_use());
    }
}
