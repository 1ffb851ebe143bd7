//! Played samples compared with those of the engine alone.

use asperity_audio::Format;
use asperity_audio::simulated::{Params, Simulated};
use asperity_live::SessionOptions;
use asperity_live::driver::Clock;
use harness::alone::{beside_others, real_time};
use harness::live::told;
use harness::stage::{by_hand, channel, graph, offline, one_voice, options, poll, start, stop, timed, voice};

use super::on_channels;
use crate::audio::quantized;

const FRAMES: [&[usize]; 7] =
    [&[64], &[1], &[1024], &[97], &[441], &[64, 1, 1024, 97, 441], &[441, 3, 97, 1024, 2, 64]];
const RATES_HZ: [u32; 3] = [44_100, 48_000, 96_000];
const FORMATS: [Format; 4] = [Format::F32, Format::I16, Format::I24, Format::I32];
/// Channels that are asked for, and how many the card has.
const MAPS: [(&[u16], u16); 3] = [(&[3], 4), (&[3, 4], 5), (&[2, 1], 2)];
const TICKS_HZ: [u32; 5] = [100, 500, 1000, 2500, 4000];

/// Two tones that differ, or the first of them.
fn tones(rates: (u32, u32), outs: usize) -> (asperity_graph::GraphFile, asperity_graph::Compiled) {
    let voices = [voice("a", 80.0, 0.1), voice("b", 123.0, 0.07)];
    let (nodes, wires): (Vec<_>, Vec<_>) = voices.into_iter().take(outs).unzip();
    graph(&harness::registry(), rates, &nodes.concat(), &wires.concat())
}

/// A quarter of a second of one case.
fn check(case: usize) {
    let pick = |n: usize, of: usize| (case / n) % of;
    let (sizes, rate_hz) = (FRAMES[case % FRAMES.len()], RATES_HZ[pick(1, 3)]);
    let (format, (map, width)) = (FORMATS[pick(1, 4)], MAPS[pick(3, 3)]);
    let tick_hz = TICKS_HZ[pick(1, 5)];
    let what = format!("{sizes:?} frames, {rate_hz} Hz, {format}, channels {map:?}, {tick_hz} ticks/s");
    let params = Params { channels: width, format: Some(format), rate_hz: Some(rate_hz), ..by_hand() };
    let card = Simulated::new(&format!("exact {case}"), params).expect("a card");
    let wanted = tones((tick_hz, rate_hz), map.len());
    let mut session = start(tones((tick_hz, rate_hz), map.len()), on_channels(&card, map, rate_hz));
    let mut frames = 0;
    for size in sizes.iter().cycle() {
        card.step(*size);
        frames += size;
        if frames > rate_hz as usize / 4 {
            break;
        }
    }
    assert_eq!(session.view().lost_samples, 0, "{what}");
    let (played, width) = (card.played(), usize::from(width));
    assert!(stop(session, &card).player.is_some(), "{what}");
    let wanted = offline(wanted.1, frames);
    for place in 0..width {
        let heard = channel(&played, width, place);
        assert_eq!(heard.len(), frames, "{what}");
        let asked = map.iter().position(|c| usize::from(*c) == place + 1);
        for (n, y) in heard.iter().enumerate() {
            let x = asked.map_or(0.0, |c| quantized(format, wanted[c][n]));
            assert_eq!(*y, x, "{what}: channel {}, frame {n}", place + 1);
        }
        assert_eq!(heard.iter().any(|y| y.abs() > 0.05), asked.is_some(), "{what}");
    }
}

#[test]
fn every_card_plays_what_the_graph_gives_sample_by_sample() {
    let _alone = beside_others();
    // Every pair of values of any two properties is among these.
    (0..105).for_each(check);
}

/// A paced run of a second, with the priority that a run has. A busy machine may break one, which others look
/// at.
fn paced(frames: u32, attempt: u32) -> Result<(), String> {
    let card = Simulated::new(&format!("paced {frames} {attempt}"), timed(frames)).expect("a card");
    let options = SessionOptions { realtime: true, ..options(&card, Clock::Paced) };
    let mut session = start(one_voice(), options);
    poll(&mut session, "a second", |_| card.played().len() > 2 * 48_000);
    let view = session.stop().view;
    if view.lost_samples + view.underruns + view.xruns > 0 {
        let (lost, underruns, xruns) = (view.lost_samples, view.underruns, view.xruns);
        return Err(format!(
            "{frames} frames: {lost} samples lost, {underruns} underruns, {xruns} of the host"
        ));
    }
    let heard = channel(&card.played(), 2, 0);
    let wanted = offline(one_voice().1, heard.len()).swap_remove(0);
    let (first, begin) = (heard.iter().position(|y| *y != 0.0), wanted.iter().position(|x| *x != 0.0));
    let delay = first.expect("something is heard") - begin.expect("a tone");
    let last = heard.iter().rposition(|y| *y != 0.0).expect("something is heard");
    assert!(last > 45_000, "{last}");
    // It begins in 480, since there was nothing before, and the stop's own ramp takes 720.
    for n in delay + 480..=last - 720 {
        assert_eq!(heard[n], f64::from(wanted[n - delay]), "{frames} frames: {n}");
    }
    Ok(())
}

#[test]
fn a_paced_clock_plays_the_same_behind_a_constant_delay() {
    let _alone = real_time();
    for frames in [97, 1024] {
        let mut attempts = 0..;
        told(|| paced(frames, attempts.next().unwrap_or(0)));
    }
}
