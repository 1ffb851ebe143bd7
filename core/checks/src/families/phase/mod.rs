//! Phase retrieval: every kind that takes magnitudes alone and answers spectra or samples, built in or from
//! a plugin, in the ways in which it can be set.
//!
//! # Energy
//!
//! A stationary signal of variance V has amplitudes `A_k` with `sum A_k^2 = 3 V` on average: its transforms
//! hold `N / 2 sum w^2 V` up to Nyquist, the window's `sum w^2` is `3 N / 8`, and an amplitude is a
//! magnitude over `N / 4`. So what comes in asks for `sum A_k^2 / 3`, and least squares never answer with
//! more (Griffin and Lim 1984: a projection). Methods that scale up what overlap-add takes away
//! (`phase_vocoder` by 1.76 dB, `random_phase` by the overlap) end there on average too; 3 dB are for the
//! luck of the draw over 2 s, and for bin 0 and Nyquist, which count once where all others count twice.
//! Downwards 30 dB are allowed: `random_phase` loses 17 dB by right, and `spsi` 16 of a spectrum without
//! peaks.

mod bench;
mod day;
mod odd;

use std::sync::Arc;

use crate::case::{Case, Family, Found, Not, holds};
use crate::played::Frames;
use crate::subject::Subject;
use bench::{BINS, Heard, Method, decibels, frames, layout, lobe, methods, power, score};

pub(super) const CASES: &[Case] = &[
    Case {
        family: Family::Phase,
        name: "phase_silence",
        hard: "frames without a magnitude, a tone that begins after them, and silence after that",
        must: "before it and from two windows after it on every sample is 0; where it begins no sample is above twice its amplitude, of noise four times",
        of_graph: false,
        run: silence,
    },
    Case {
        family: Family::Phase,
        name: "phase_spectra",
        hard: "DC alone, Nyquist alone, a single bin, two equal bins, a plateau, a flat spectrum, a tone on a floor",
        must: "the energy is at most 3 dB above what the magnitudes ask for, and no more than 30 dB is lost",
        of_graph: false,
        run: spectra,
    },
    Case {
        family: Family::Phase,
        name: "phase_alternating",
        hard: "frames that take turns: a tone and nothing, two tones, all bins and nothing",
        must: "the energy is at most 3 dB above what the magnitudes ask for on average, and two windows later a tone has its level within 1 dB",
        of_graph: false,
        run: odd::alternating,
    },
    Case {
        family: Family::Phase,
        name: "phase_units",
        hard: "a tone of 1e-30, 1e-12, 1e12 and 1e30",
        must: "what is heard is as large as the unit says, within 0.1 dB of the tone of 1",
        of_graph: false,
        run: units,
    },
    Case {
        family: Family::Phase,
        name: "phase_levels",
        hard: "a tone that is a billion times as loud from one frame to the next, and as soft, and 1e18 between; a tone of 1e30, and of 1e-12 after it",
        must: "two windows after each change the level is that of a tone that always was as loud, within 1 dB",
        of_graph: false,
        run: odd::levels,
    },
    Case {
        family: Family::Phase,
        name: "phase_no_magnitudes",
        hard: "magnitudes that are NaN, infinite, negative or the largest number, given to the node itself: in some bins of a frame, in all for a window",
        must: "all samples are finite, the node does not fail, and two windows later a tone has its level within 1 dB",
        of_graph: false,
        run: odd::no_magnitudes,
    },
    Case {
        family: Family::Phase,
        name: "phase_missing_frames",
        hard: "frames that do not come: every seventh, ten, all of a second",
        must: "the energy is at most 3 dB above what the magnitudes ask for, silence is exact two windows into the second, and two windows after each gap a tone has its \
               level within 1 dB",
        of_graph: false,
        run: odd::missing_frames,
    },
    Case {
        family: Family::Phase,
        name: "phase_hop_88_89",
        hard: "hops of 88 and 89 samples by turns: 44.1 kHz",
        must: "a tone's spectral convergence is that of 44 kHz, where all hops are 88, within 1.5 dB, or better than -60 dB",
        of_graph: false,
        run: hop,
    },
    Case {
        family: Family::Phase,
        name: "phase_after_a_day",
        hard: "24 hours that are left out, as in a fast-forward: frame 43 200 000 comes next",
        must: "a tone's spectral convergence is within 1.5 dB of what it was at the start, or better than -40 dB, and its frequency within 0.01 Hz",
        of_graph: false,
        run: day::skipped,
    },
    Case {
        family: Family::Phase,
        name: "phase_for_a_day",
        hard: "24 hours of frames one after the other, 250 a second; 1000 s in `cargo test`, and 100 s in `selftest` unless it is told to take its time",
        must: "as after 24 hours that are left out",
        of_graph: false,
        run: day::run,
    },
    Case {
        family: Family::Phase,
        name: "phase_against_f64",
        hard: "10^7 frames in single precision beside double precision; 200 000 in `cargo test`, and 10 000 in `selftest` unless it is told to take its time",
        must: "the magnitudes of what is heard differ by less than -40 dB, or than the method's own error less 3 dB where that is larger, and at the end by no more than \
               3 dB above what they did at the start",
        of_graph: false,
        run: day::precision,
    },
];

/// Where the tone lies: between bins, and off the middle between two.
const TONE: f64 = 15.37;

/// The energy that amplitudes ask for: a mean square.
fn asked(bins: impl Fn(usize) -> f64) -> f64 {
    (0..BINS as usize).map(|k| bins(k).powi(2)).sum::<f64>() / 3.0
}

/// Runs over all methods; each answers a figure, of which the largest counts. Answers how many there are,
/// it, and whose it is.
///
/// # Errors
/// What does not hold, of all for which it does not.
fn each(
    subject: &Subject<'_>,
    settings: bool,
    mut run: impl FnMut(&Method) -> Result<f64, Not>,
) -> Result<(usize, f64, String), Not> {
    let methods = methods(subject, settings)?;
    let mut worst = (f64::NEG_INFINITY, String::new());
    let mut wrong = Vec::new();
    for method in &methods {
        match run(method) {
            Ok(figure) if figure > worst.0 => worst = (figure, method.name()),
            Ok(_) => {}
            Err(Not::Held(why)) => wrong.push(format!("{}: {why}", method.name())),
            Err(other @ Not::Applicable(_)) => return Err(other),
        }
    }
    holds(wrong.is_empty(), || wrong.join("; "))?;
    Ok((methods.len(), worst.0, worst.1))
}

fn silence(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let (begins, ends) = (150, 400);
    let (count, worst, of) = each(subject, true, |method| {
        let sounds = move |n: u64| (begins..ends).contains(&n);
        let tone = frames(move |n, k| if sounds(n) { lobe(TONE, k) } else { 0.0 });
        let mut heard = method.begin(subject, layout, tone)?;
        let before = heard.next(begins)?;
        holds(before.iter().all(|x| *x == 0.0), || "it is heard before it is asked".to_owned())?;
        let during = heard.next(ends - begins)?;
        let peak = during.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        // Noise of a tone's power is above 4 times its amplitude once in 10^8 samples.
        let most = if method.name().starts_with("shaped_noise") { 4.0 } else { 2.0 };
        holds(peak <= most, || format!("it begins with a sample of {peak:.2} times the tone's amplitude"))?;
        holds(power(&during) > 0.0, || "it is never heard".to_owned())?;
        let settles = heard.settles(&layout);
        let end = heard.next(settles)?;
        let rest = heard.next(250)?;
        holds(rest.iter().all(|x| *x == 0.0), || {
            format!("not silent {settles} frames after the last that sounds")
        })?;
        Ok(end.iter().fold(peak, |m, x| m.max(x.abs())))
    })?;
    Ok(format!("{count} methods; the largest sample is {worst:.2} times the tone's amplitude ({of})"))
}

/// A bin of one of the odd spectra.
fn odd_spectrum(what: &str, k: usize) -> f64 {
    let last = BINS as usize - 1;
    let at = |bin: usize, value: f64| if k == bin { value } else { 0.0 };
    match what {
        // A constant of 1 reads 2 in bin 0 and 1 beside it; so does what alternates, at the other end.
        "DC" => at(0, 2.0) + at(1, 1.0),
        "Nyquist" => at(last, 2.0) + at(last - 1, 1.0),
        "DC without a lobe" => at(0, 2.0),
        "a single bin" => at(40, 1.0),
        "two equal bins" => lobe(15.5, k),
        "a plateau" => [0.2, 0.2, 0.1, 0.1][k % 4],
        "a flat spectrum" => 0.1,
        // 26.2 dB under the tone.
        "a tone on a floor" => lobe(TONE, k).max(0.049),
        _ => lobe(TONE, k),
    }
}

fn spectra(subject: &Subject<'_>) -> Found {
    let layout = layout(2500, BINS);
    let all = [
        "DC",
        "Nyquist",
        "DC without a lobe",
        "a single bin",
        "two equal bins",
        "a plateau",
        "a flat spectrum",
        "a tone on a floor",
        "a tone",
    ];
    let mut least = f64::INFINITY;
    let (count, worst, of) = each(subject, true, |method| {
        let mut most = f64::NEG_INFINITY;
        for what in all {
            let mut heard = method.begin(subject, layout, frames(move |_, k| odd_spectrum(what, k)))?;
            let settles = heard.settles(&layout);
            heard.pass(settles)?;
            let db = decibels(power(&heard.next(1000)?), asked(|k| odd_spectrum(what, k)));
            holds((-30.0..=3.0).contains(&db), || {
                format!("{what}: the energy is {db:+.1} dB off what was asked for")
            })?;
            most = most.max(db);
            least = least.min(db);
        }
        Ok(most)
    })?;
    Ok(format!(
        "{count} methods: {least:.1} to {worst:+.1} dB of what {} spectra ask for, most by {of}",
        all.len()
    ))
}

/// What is heard of a tone, once it has settled.
fn steady(subject: &Subject<'_>, method: &Method, scale: f64) -> Result<Vec<f64>, Not> {
    let layout = layout(2500, BINS);
    let mut heard = method.begin(subject, layout, frames(move |_, k| scale * lobe(TONE, k)))?;
    heard.pass(heard.settles(&layout))?;
    heard.next(500)
}

fn units(subject: &Subject<'_>) -> Found {
    let (count, worst, of) = each(subject, true, |method| {
        let one = power(&steady(subject, method, 1.0)?);
        let mut worst = 0.0_f64;
        for scale in [1e-30, 1e-12, 1e12, 1e30] {
            let scaled: Vec<f64> = steady(subject, method, scale)?.iter().map(|x| x / scale).collect();
            let db = decibels(power(&scaled), one);
            holds(db.abs() <= 0.1, || format!("a tone of {scale:e} is {db:+.2} dB off"))?;
            worst = worst.max(db.abs());
        }
        Ok(worst)
    })?;
    Ok(format!("{count} methods; at most {worst:.3} dB off ({of})"))
}

fn hop(subject: &Subject<'_>) -> Found {
    let tone: Frames = frames(|_, k| lobe(TONE, k));
    let (count, worst, of) = each(subject, false, |method| {
        let of = |rate_hz: u32| {
            let layout = layout(rate_hz, 101);
            let mut heard: Heard = method.begin(subject, layout, Arc::clone(&tone))?;
            let all = heard.aligned(240)?;
            Ok::<f64, Not>(score(&layout, |k| lobe(TONE, k), &all)?.convergence_db)
        };
        let (even, odd) = (of(44_000)?, of(44_100)?);
        holds(odd < (even + 1.5).max(-60.0), || format!("{odd:.1} dB at 44.1 kHz, {even:.1} dB at 44 kHz"))?;
        Ok(odd - even)
    })?;
    Ok(format!("{count} kinds; at most {worst:+.2} dB worse ({of})"))
}
