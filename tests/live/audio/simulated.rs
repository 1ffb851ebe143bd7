//! Streams on the simulated card: what is played arrives, bit by bit, whatever the device is like.

use asperity_audio::simulated::{Params, Simulated, set_plants};
use asperity_audio::{Cause, Format, Request, open};
use harness::alone::{beside_others, real_time};
use harness::live::until;
use harness::stage::by_hand;
use proptest::prelude::*;

use super::parts::{Count, Each, Ear, left, on, play, ramp, record, refusal};

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
    let _alone = beside_others();
    for format in Format::ALL {
        let params = Params { channels: 5, format: Some(format), ..by_hand() };
        let card = Simulated::new(&format!("format-{format}"), params).unwrap();
        let _stream = play(&Request { channels: vec![4, 2], ..on(&card) }, Each(ramp, 0));
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
        let _alone = beside_others();
        let card = Simulated::new(&format!("sizes-{seed}"), Params { channels: 2, ..by_hand() }).unwrap();
        let stream = play(&Request { channels: vec![2], ..on(&card) }, Count::default());
        sizes.iter().for_each(|size| card.step(*size));
        let played = card.played();
        prop_assert_eq!(played.len(), sizes.iter().sum::<usize>() * 2);
        for (at, frame) in played.chunks(2).enumerate() {
            prop_assert_eq!(frame, [0.0, Count::value(at)]);
        }
        prop_assert_eq!(stream.stats().callbacks, sizes.len() as u64);
    }
}

#[test]
fn call_longer_than_the_scratch_is_filled_in_pieces() {
    let _alone = beside_others();
    let card = Simulated::new("long", Params { latency_frames: 480, ..by_hand() }).unwrap();
    let count = Count::default();
    let blocks = count.blocks.clone();
    let stream = play(&Request { channels: vec![1, 2], ..on(&card) }, count);
    card.step(100_000);
    let blocks = blocks.lock().unwrap().clone();
    assert!(blocks.len() > 1);
    assert_eq!(blocks.iter().map(|(frames, _)| frames).sum::<usize>(), 100_000);
    assert!(
        card.played().iter().enumerate().all(|(at, value)| *value == Count::value(at)),
        "a seam is heard"
    );
    assert_eq!(stream.stats().latency_ms, 10.0);
}

#[test]
fn what_is_not_finite_never_reaches_the_device() {
    let _alone = beside_others();
    let card = Simulated::new("nan", by_hand()).unwrap();
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5];
    let _stream = play(&on(&card), Each(move |at| bad[at % 4], 0));
    card.step(8);
    assert_eq!(left(&card), [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5]);
}

#[test]
fn period_is_the_device_own_and_nothing_plays_before_play() {
    let _alone = beside_others();
    let card = Simulated::new("period", Params { frames: vec![97], ..by_hand() }).unwrap();
    let wanted = Request { period_frames: Some(1024), ..on(&card) };
    let stream = open(&wanted, Box::new(Count::default()), None).unwrap();
    let notes = stream.notes();
    assert!(notes.iter().any(|note| note.contains("97") && note.contains("1024")), "{notes:?}");
    card.step(64);
    assert_eq!((card.played().len(), stream.period()), (0, None));
    stream.play().unwrap();
    card.step(500);
    (0..5).for_each(|_| card.step(97));
    assert_eq!(stream.period(), Some(97));
    assert!(left(&card).into_iter().enumerate().all(|(at, x)| x == Count::value(at)));
}

#[test]
fn plant_is_heard_after_the_latency_and_not_before() {
    let _alone = beside_others();
    let params = Params { channels: 3, inputs: 4, latency_frames: 100, ..by_hand() };
    let card = Simulated::new("plant", params).unwrap();
    let mut memory = 0.0;
    card.plant(3, 2, move |value| {
        memory = 0.5 * memory + value;
        memory
    });
    let ear = Ear::default();
    let request = Request { channels: vec![3], inputs: vec![4, 2], ..on(&card) };
    let impulse = Each(|at| if at == 10 { 0.5 } else { 0.0 }, 0);
    let stream = record(&request, impulse, Some(ear.clone()));
    [64, 1, 97].into_iter().for_each(|size| card.step(size));
    let heard = ear.heard();
    assert_eq!(heard.len(), 162 * 2);
    for (at, frame) in heard.chunks(2).enumerate() {
        let wanted = if at < 110 { 0.0 } else { 0.5_f32.powi(at as i32 - 110 + 1) };
        assert_eq!(frame, [0.0, wanted], "frame {at}");
    }
    assert_eq!(stream.input_id(), Some(card.id()));
}

#[test]
fn plant_in_words_is_made_at_the_rate_of_the_device() {
    let _alone = beside_others();
    let on = |device: &str| Request {
        device: Some(device.into()),
        inputs: vec![2, 1],
        rate_hz: 96_000,
        ..Request::default()
    };
    let refused = |device: &str| refusal(&on(device)).reason;
    assert!(refused("simulated:plant=kilohertz").contains("knows no plants"));
    assert!(refused("simulated:speed=0").contains("nobody would ever call it"));
    set_plants(|words, rate_hz| match words {
        [(word, name)] if word == "plant" && name == "kilohertz" => {
            Ok(Box::new(move |x| x * (rate_hz / 96_000.0) as f32 * 2.0))
        }
        _ => Err(format!("no {words:?}")),
    });
    assert!(refused("simulated:plant=coil").contains("coil"));
    let ear = Ear::default();
    let _stream = record(&on("simulated:frames=64,plant=kilohertz"), Each(|_| 0.25, 0), Some(ear.clone()));
    // The input may be called before the output plays.
    until("the plant to be heard", || ear.heard().chunks(2).any(|frame| frame == [0.0, 0.5]));
    assert!(ear.heard().iter().all(|x| [0.0, 0.5].contains(x)));
}

#[test]
fn sixteen_bits_come_back_unchanged_through_a_loopback() {
    let _alone = beside_others();
    let params = Params { format: Some(Format::I16), loopback: true, inputs: 2, ..by_hand() };
    let card = Simulated::new("loopback", params).unwrap();
    let ear = Ear::default();
    let _stream = record(&Request { inputs: vec![1], ..on(&card) }, Each(ramp, 0), Some(ear.clone()));
    card.step(1000);
    let wanted: Vec<f32> = (0..1000).map(|at| quantized(Format::I16, ramp(at)) as f32).collect();
    assert_eq!(ear.heard(), wanted);
}

#[test]
fn what_cannot_be_had_is_an_error_that_says_what_can() {
    // Devices of other tests would be listed too.
    let _alone = real_time();
    let text = "rate=44100,channels=2,inputs=1,format=i16,speed=0";
    let card = Simulated::new("left hand", text.parse().unwrap()).unwrap();
    let _other = Simulated::new("right hand", by_hand()).unwrap();
    let able = Request { rate_hz: 44_100, ..on(&card) };
    let named = |name: &str| Request {
        host: Some("simulated".into()),
        device: Some(name.into()),
        ..Request::default()
    };
    let hands = ["simulated:left hand", "simulated:right hand"];
    for (request, cause, said) in [
        (Request { rate_hz: 48_000, ..able.clone() }, Cause::Rate(vec![(44_100, 44_100)]), &["44100"][..]),
        (Request { channels: vec![3], ..able.clone() }, Cause::Channel(2), &["it has 2"]),
        (Request { format: Some(Format::F32), ..able.clone() }, Cause::Format, &["i16"]),
        (Request { inputs: vec![2], ..able.clone() }, Cause::Channel(1), &["input channel 2"]),
        (Request { channels: vec![], ..able.clone() }, Cause::Request, &["no output channel"]),
        (Request { channels: vec![1, 1], ..able.clone() }, Cause::Request, &["twice"]),
        (Request { channels: vec![0], ..able.clone() }, Cause::Request, &["from 1"]),
        (named("simulated:channels=two"), Cause::Device, &["number"]),
        (named("third hand"), Cause::Device, &["third hand", hands[0], hands[1]]),
        // Its name is that of every simulated card: that is no way to mean one of them.
        (named("SIMULATED sound card"), Cause::Device, &["matches several", hands[0]]),
        (Request { host: Some("asio".into()), ..named("x") }, Cause::Host, &["alsa", "jack"]),
    ] {
        let error = refusal(&request);
        assert_eq!((&error.cause, error.input), (&cause, request.inputs == [2]), "{error}");
        assert!(said.iter().all(|part| error.reason.contains(part)), "{error}");
        assert!(!card.in_use(), "left open after: {error}");
    }
    let _stream = play(&able, Count::default());
    assert!(refusal(&able).reason.contains("cannot be opened"));
}

#[test]
fn described_device_calls_with_its_lengths_in_turn() {
    let _alone = beside_others();
    let device = Some("simulated:frames=64+1+1024+97,rate=96000,channels=4,speed=50".into());
    let count = Count::default();
    let blocks = count.blocks.clone();
    let request = Request { device, channels: vec![3], rate_hz: 96_000, ..Request::default() };
    let stream = play(&request, count);
    until("twelve calls", || stream.stats().callbacks >= 12);
    let frames: Vec<usize> = blocks.lock().unwrap().iter().map(|(frames, _)| *frames).take(12).collect();
    assert_eq!((frames, stream.host()), ([64, 1, 1024, 97].repeat(3), "simulated"));
}
