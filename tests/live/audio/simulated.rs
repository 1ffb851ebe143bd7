//! Streams on the simulated card: what is played arrives, bit by bit, whatever the device is like.

use asperity_audio::simulated::{Params, Simulated, set_plants};
use asperity_audio::{Format, OpenError, Request, events, open};
use harness::alone::real_time;
use harness::live::until;
use proptest::prelude::*;

use super::parts::{Count, Ramp, Recorder, by_hand, on, play, ramp};

/// Value that a card with this sample format holds, computed anew: scale, round to the nearest,
/// keep in range.
pub(crate) fn quantized(format: Format, value: f32) -> f64 {
    let full = match format {
        Format::F32 | Format::F64 => return f64::from(value.clamp(-1.0, 1.0)),
        Format::I8 | Format::U8 => 128.0,
        Format::I16 | Format::U16 => 32_768.0,
        Format::I24 | Format::U24 => 8_388_608.0,
        Format::I32 | Format::U32 => 2_147_483_648.0,
    };
    (f64::from(value) * full + 0.5 - f64::from(u8::from(value < 0.0))).trunc().clamp(-full, full - 1.0) / full
}

#[test]
fn every_format_holds_the_nearest_value_on_its_channels() {
    let _alone = real_time();
    for format in Format::ALL {
        let name = format!("format-{format}");
        let params = Params { channels: 5, format: Some(format), ..by_hand() };
        let card = Simulated::new(&name, params).unwrap();
        let request = Request { channels: vec![4, 2], ..on(&card) };
        let stream = play(&request, Ramp::default());
        assert_eq!((stream.format(), stream.device_channels()), (format, 5));
        card.step(300);
        card.step(77);
        let played = card.played();
        assert_eq!(played.len(), 377 * 5);
        for (at, frame) in played.chunks(5).enumerate() {
            // Ramp is -1.3 to 1.3, so both ends are clamped.
            let (first, second) = (ramp(2 * at), ramp(2 * at + 1));
            let wanted = [0.0, quantized(format, second), 0.0, quantized(format, first), 0.0];
            assert_eq!(frame, wanted, "{format}, frame {at}");
        }
    }
}

proptest! {
    #[test]
    fn no_sample_is_lost_or_repeated_at_any_sequence_of_calls(
        sizes in prop::collection::vec(
            prop_oneof![Just(1_usize), Just(64), Just(97), Just(441), Just(1024), 0_usize..200],
            1..12,
        ),
        seed in 0_u32..u32::MAX,
    ) {
        let _alone = real_time();
        let card = Simulated::new(&format!("sizes-{seed}"), Params { channels: 2, ..by_hand() }).unwrap();
        let stream = play(&Request { channels: vec![2], ..on(&card) }, Count::default());
        sizes.iter().for_each(|size| card.step(*size));
        let played = card.played();
        let total: usize = sizes.iter().sum();
        prop_assert_eq!(played.len(), total * 2);
        for (at, frame) in played.chunks(2).enumerate() {
            prop_assert_eq!(frame, [0.0, Count::value(at)]);
        }
        prop_assert_eq!(stream.stats().frames, total as u64);
        prop_assert_eq!(stream.stats().callbacks, sizes.len() as u64);
    }
}

#[test]
fn call_longer_than_the_scratch_is_filled_in_pieces() {
    let _alone = real_time();
    let params = Params { latency_frames: 480, ..by_hand() };
    let card = Simulated::new("long", params).unwrap();
    let (process, seen) = Recorder::new();
    let _stream = play(&Request { channels: vec![1, 2], ..on(&card) }, process);
    card.step(100_000);
    let blocks = seen.lock().unwrap().clone();
    assert!(blocks.len() > 1);
    let mut frames = 0;
    for (length, ahead_ns) in &blocks {
        // The first frame is heard 10 ms after the call, the others when their turn comes.
        assert_eq!(*ahead_ns, 10_000_000 + frames as u64 * 1_000_000_000 / 48_000);
        frames += length;
    }
    assert_eq!(frames, 100_000);
    let played = card.played();
    assert!(played.iter().enumerate().all(|(at, value)| *value == Count::value(at)), "a seam is heard");
}

#[test]
fn what_is_not_finite_never_reaches_the_device() {
    let _alone = real_time();
    let card = Simulated::new("nan", by_hand()).unwrap();
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5];
    let mut at = 0;
    let _stream = play(
        &on(&card),
        super::parts::Each(move || {
            at += 1;
            bad[(at - 1) % 4]
        }),
    );
    card.step(8);
    let left: Vec<f64> = card.played().chunks(2).map(|frame| frame[0]).collect();
    assert_eq!(left, [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5]);
}

#[test]
fn stream_is_silent_before_play_and_while_paused() {
    let _alone = real_time();
    let card = Simulated::new("paused", by_hand()).unwrap();
    let (sender, _events) = events();
    let stream = open(&on(&card), Box::new(Count::default()), None, sender).unwrap();
    card.step(64);
    assert_eq!((card.played().len(), stream.period()), (0, None));
    stream.play().unwrap();
    card.step(64);
    stream.pause().unwrap();
    card.step(64);
    stream.play().unwrap();
    card.step(64);
    let left: Vec<f64> = card.played().chunks(2).map(|frame| frame[0]).collect();
    assert_eq!(left, (0..128).map(Count::value).collect::<Vec<_>>());
}

#[test]
fn the_period_is_what_the_device_does_not_what_was_asked_for() {
    let _alone = real_time();
    let params = Params { frames: vec![97], ..by_hand() };
    let card = Simulated::new("period", params).unwrap();
    let stream = play(&Request { period_frames: Some(1024), ..on(&card) }, Count::default());
    assert!(
        stream.notes().iter().any(|note| note.contains("97") && note.contains("1024")),
        "{:?}",
        stream.notes()
    );
    card.step(500);
    (0..5).for_each(|_| card.step(97));
    assert_eq!((stream.period(), stream.period_range()), (Some(97), Some((97, 500))));
}

#[test]
fn plant_is_heard_after_the_latency_and_not_before() {
    let _alone = real_time();
    let params = Params { channels: 3, inputs: 4, latency_frames: 100, ..by_hand() };
    let card = Simulated::new("plant", params).unwrap();
    let mut memory = 0.0;
    card.plant(3, 2, move |value| {
        memory = 0.5 * memory + value;
        memory
    });
    let (capture, heard) = super::parts::Ear::new();
    let request = Request { channels: vec![3], inputs: vec![4, 2], ..on(&card) };
    let (sender, _events) = events();
    let mut at = -1_i32;
    let impulse = super::parts::Each(move || {
        at += 1;
        if at == 10 { 0.5 } else { 0.0 }
    });
    let stream = open(&request, Box::new(impulse), Some(Box::new(capture)), sender).unwrap();
    stream.play().unwrap();
    for size in [64, 1, 97] {
        card.step(size);
    }
    let heard = heard.lock().unwrap().clone();
    assert_eq!(heard.len(), 162 * 2);
    for (at, frame) in heard.chunks(2).enumerate() {
        let wanted = if at < 110 { 0.0 } else { 0.5_f32.powi(at as i32 - 110 + 1) };
        assert_eq!(frame, [0.0, wanted], "frame {at}");
    }
    assert_eq!(stream.input_id(), Some(card.id()));
}

#[test]
fn plant_in_words_is_made_at_the_rate_of_the_device() {
    let _alone = real_time();
    let (capture, heard) = super::parts::Ear::new();
    let on = |device: &str| Request {
        device: Some(device.into()),
        inputs: vec![2, 1],
        rate_hz: 96_000,
        ..Request::default()
    };
    let open = |device: &str, capture| {
        let (sender, _events) = events();
        open(&on(device), Box::new(super::parts::Each(|| 0.25)), Some(Box::new(capture)), sender)
    };
    let refused = |device: &str| match open(device, super::parts::Ear::new().0) {
        Err(OpenError::Description { reason, .. }) => reason,
        other => panic!("{:?}", other.err()),
    };
    assert!(refused("simulated:plant=kilohertz").contains("knows no plants"));
    assert!(refused("simulated:speed=0").contains("nobody would ever call it"));
    set_plants(|words, rate_hz| match words {
        [(word, name)] if word == "plant" && name == "kilohertz" => {
            Ok(Box::new(move |x| x * (rate_hz / 96_000.0) as f32 * 2.0))
        }
        _ => Err(format!("no {words:?}")),
    });
    assert!(refused("simulated:plant=coil").contains("coil"));
    let stream = open("simulated:frames=64,plant=kilohertz", capture).unwrap();
    stream.play().unwrap();
    // The input may be called before the output plays.
    until("the plant to be heard", || heard.lock().unwrap().chunks(2).any(|frame| frame == [0.0, 0.5]));
    assert!(heard.lock().unwrap().iter().all(|x| [0.0, 0.5].contains(x)));
}

#[test]
fn sixteen_bits_come_back_unchanged_through_a_loopback() {
    let _alone = real_time();
    let params = Params { format: Some(Format::I16), loopback: true, inputs: 2, ..by_hand() };
    let card = Simulated::new("loopback", params).unwrap();
    let (capture, heard) = super::parts::Ear::new();
    let request = Request { inputs: vec![1], ..on(&card) };
    let (sender, _events) = events();
    let stream = open(&request, Box::new(Ramp::default()), Some(Box::new(capture)), sender).unwrap();
    stream.play().unwrap();
    card.step(1000);
    let heard = heard.lock().unwrap();
    let wanted: Vec<f32> = (0..1000).map(|at| quantized(Format::I16, ramp(at)) as f32).collect();
    assert_eq!(*heard, wanted);
}

#[test]
fn missing_device_is_an_error_that_lists_the_others() {
    let _alone = real_time();
    let _one = Simulated::new("left hand", by_hand()).unwrap();
    let _two = Simulated::new("right hand", by_hand()).unwrap();
    let request =
        Request { host: Some("simulated".into()), device: Some("third hand".into()), ..Request::default() };
    let error = refusal(&request);
    assert!(matches!(error, OpenError::NoDevice { .. }), "{error}");
    for said in ["third hand", "simulated:left hand", "simulated:right hand"] {
        assert!(error.to_string().contains(said), "{error}");
    }
    // Its name is that of every simulated card: that is no way to mean one of them.
    let request = Request { device: Some("SIMULATED sound card".into()), ..request };
    let error = refusal(&request);
    assert!(matches!(error, OpenError::Ambiguous { .. }), "{error}");
    assert!(error.to_string().contains("simulated:left hand"), "{error}");
    let request = Request { host: Some("asio".into()), ..request };
    let error = refusal(&request);
    assert!(matches!(&error, OpenError::NoHost { .. }), "{error}");
    assert!(error.to_string().contains("alsa") && error.to_string().contains("jack"), "{error}");
}

#[test]
fn what_a_device_cannot_do_is_an_error_that_says_what_it_can() {
    let _alone = real_time();
    let card = Simulated::new("small", "rate=44100,channels=2,inputs=1,format=i16,speed=0".parse().unwrap())
        .unwrap();
    let able = Request { rate_hz: 44_100, ..on(&card) };
    for (request, said) in [
        (Request { rate_hz: 48_000, ..able.clone() }, "44100"),
        (Request { channels: vec![3], ..able.clone() }, "it has 2"),
        (Request { format: Some(Format::F32), ..able.clone() }, "i16"),
        (Request { inputs: vec![2], ..able.clone() }, "input channel 2"),
        (Request { channels: vec![], ..able.clone() }, "no output channel"),
        (Request { channels: vec![1, 1], ..able.clone() }, "twice"),
        (Request { channels: vec![0], ..able.clone() }, "from 1"),
        (Request { device: Some("simulated:channels=two".into()), ..able.clone() }, "number"),
    ] {
        let error = refusal(&request);
        assert!(error.to_string().contains(said), "{error}");
        assert!(!card.in_use(), "left open after: {error}");
    }
    let _stream = play(&able, Count::default());
    assert!(matches!(refusal(&able), OpenError::Refused { .. }));
}

#[test]
fn device_described_by_its_id_is_made_on_request() {
    let _alone = real_time();
    let request = Request {
        device: Some("simulated:frames=97,rate=96000,channels=4,format=i24,speed=50".into()),
        channels: vec![3],
        rate_hz: 96_000,
        ..Request::default()
    };
    let (process, seen) = Recorder::new();
    let stream = play(&request, process);
    until("ten calls", || stream.stats().callbacks >= 10);
    assert_eq!((stream.host(), stream.format(), stream.period()), ("simulated", Format::I24, Some(97)));
    assert!(seen.lock().unwrap().iter().all(|(frames, _)| *frames == 97));
}

#[test]
fn a_described_device_calls_with_its_lengths_in_turn() {
    let _alone = real_time();
    let device = Some("simulated:frames=64+1+1024+97,speed=50".into());
    let (process, seen) = Recorder::new();
    let stream = play(&Request { device, ..Request::default() }, process);
    until("twelve calls", || stream.stats().callbacks >= 12);
    let seen: Vec<usize> = seen.lock().unwrap().iter().map(|(frames, _)| *frames).take(12).collect();
    assert_eq!(seen, [64, 1, 1024, 97].repeat(3));
}

fn refusal(request: &Request) -> OpenError {
    let (sender, _events) = events();
    let (capture, _) = super::parts::Ear::new();
    match open(request, Box::new(Count::default()), Some(Box::new(capture)), sender) {
        Ok(stream) => panic!("{} was opened", stream.id()),
        Err(error) => error,
    }
}
