//! Bumps that a tool meets one after another: pulses whose spectrum is white.

use super::pattern::Events;
use crate::Float;
use crate::random::{normal, uniform};
use asperity_numbers::Elementary as _;
use asperity_state::State;

/// More bumps per sample than this are replaced by white noise.
const MOST_A_SAMPLE: f64 = 4.0;
/// Bump numbers reserved for each sample at which a stroke may start. No stroke has so many bumps.
const A_SAMPLE: u64 = 1 << 24;
/// Bump rate from which on bumps have all of the power. Rarer bumps keep this rate's height, and noise
/// has the rest of the power: else the next bump would strike a hand that hardly moves.
const LEAST_HZ: f64 = 4.0;
/// Ridge rates between which the share of bumps at ridges rises from none to all.
const RIDGES_HZ: (f64, f64) = (4.0, 12.0);

/// Bumps along a way: the next one, and the distance to it.
///
/// A sample has mean square 1: the rarer the bumps, the higher they are. Their signs are random, so the
/// spectrum is white at any regularity (D. J. Daley and D. Vere-Jones, "An Introduction to the Theory of
/// Point Processes", 2003). Distances and heights are lognormal. The height grows with the root of the
/// distance from the previous bump, as a tip falls far into a wide gap. So the power does not vary with the
/// distances.
#[derive(Clone, Debug)]
pub(super) struct Bumps {
    seed: u64,
    /// Number of the next bump; none before the first. A stroke starts with a number derived from its
    /// first sample, so that it does not repeat the bumps of the stroke before.
    number: Option<u64>,
    /// Distance to the next bump in spacings.
    next: f64,
}

impl Bumps {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed, number: None, next: 0.0 }
    }

    /// Forgets the bumps; the next sample starts a new stroke.
    pub(super) fn reset(&mut self) {
        (self.number, self.next) = (None, 0.0);
    }

    /// Moves along a way, in spacings, from sample `start` on. Calls `met` with each bump's number and
    /// position.
    fn pass(&mut self, start: u64, way: f64, before: impl Fn(u64) -> f64, mut met: impl FnMut(u64, f64)) {
        let mut number = self.number.unwrap_or_else(|| {
            let first = start.wrapping_mul(A_SAMPLE);
            self.next = uniform(self.seed, first, 11);
            first
        });
        while self.next < way {
            met(number, self.next);
            number = number.wrapping_add(1);
            self.next += before(number);
        }
        (self.number, self.next) = (Some(number), self.next - way);
    }

    /// Writes the pulses of a way, in spacings, over the samples from `start` on, at `rate_hz`. Rare
    /// bumps leave the rest of the power to noise.
    pub(super) fn fill<T: Float>(
        &mut self,
        start: u64,
        rate_hz: f64,
        way: f64,
        events: &Events,
        out: &mut [T],
    ) {
        let samples = out.len() as f64;
        let a_sample = if way > 0.0 { way / samples } else { 0.0 };
        let seldom = (a_sample * rate_hz / LEAST_HZ).min(1.0);
        let noise = if a_sample > MOST_A_SAMPLE { 1.0 } else { (1.0 - seldom).sqrt() };
        if noise > 0.0 {
            for (i, x) in out.iter_mut().enumerate() {
                *x = T::of(noise * normal(self.seed, start + i as u64));
            }
        } else {
            out.fill(T::zero());
        }
        if a_sample <= 0.0 || a_sample > MOST_A_SAMPLE {
            return;
        }
        let pulse = pulses(self.seed, (seldom / a_sample).sqrt(), events);
        let before = intervals(self.seed, events);
        self.pass(start, way, &before, |number, at| {
            let at = ((at / way * samples) as usize).min(out.len() - 1);
            out[at] += T::of(pulse(number) * before(number).sqrt());
        });
    }

    pub(super) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.number).keep(&mut self.next);
        state.require(self.next >= 0.0 && self.next < 1e9);
    }
}

/// Adds bumps at the ridges of a way, in turns of a wave, that takes `out.len()` samples at `rate_hz`.
/// `out` holds noise, which stays where few ridges are met.
///
/// Each ridge has a pulse with its own sign, height and position, which is the part of the signal that
/// does not repeat. They belong to the ridge: a hand that comes back meets them again.
pub(super) fn at_ridges<T: Float>(
    seed: u64,
    rate_hz: f64,
    (from, to): (f64, f64),
    events: &Events,
    out: &mut [T],
) {
    let (way, samples) = (to - from, out.len() as f64);
    let pitch_hz = way.abs() / samples * rate_hz;
    let part = ((pitch_hz - RIDGES_HZ.0) / (RIDGES_HZ.1 - RIDGES_HZ.0)).clamp(0.0, 1.0);
    // Ridges closer than samples are noise.
    if part <= 0.0 || pitch_hz > rate_hz {
        return;
    }
    out.iter_mut().for_each(|x| *x *= T::of((1.0 - part).sqrt()));
    let pulse = pulses(seed, (part * samples / way.abs()).sqrt(), events);
    let (least, most) = (from.min(to), from.max(to));
    // A pulse may lie half a pitch beside its ridge.
    for ridge in least.floor() as i64..=most.ceil() as i64 {
        let number = ridge as u64;
        let place = ridge as f64 + (events.interval_cv * drawn(seed, number, 1)).clamp(-0.5, 0.5);
        if place <= least || place > most {
            continue;
        }
        let at = (((place - from) / way * samples) as usize).min(out.len() - 1);
        out[at] += T::of(pulse(number));
    }
}

/// Normal number of a bump: column 0 for its height, 1 for its position.
fn drawn(seed: u64, number: u64, column: u64) -> f64 {
    normal(seed, number.wrapping_mul(3).wrapping_add(column))
}

/// Distance of each bump, by number, from the one before in spacings; their mean is 1.
fn intervals(seed: u64, events: &Events) -> impl Fn(u64) -> f64 + use<> {
    let law = lognormal(events.interval_cv);
    move |number| law(drawn(seed, number, 1))
}

/// Height of each bump, by number, with a root mean square of `rms`.
fn pulses(seed: u64, rms: f64, events: &Events) -> impl Fn(u64) -> f64 + use<> {
    // The square of a lognormal number of mean 1 has the mean 1 + cv^2.
    let high = rms / (1.0 + events.height_cv * events.height_cv).sqrt();
    let law = lognormal(events.height_cv);
    move |number| {
        let sign = if uniform(seed, number, 7) < 0.5 { -high } else { high };
        sign * law(drawn(seed, number, 0))
    }
}

/// Normal numbers become lognormal ones of mean 1 and this deviation, above 0.001: no two bumps coincide.
fn lognormal(cv: f64) -> impl Fn(f64) -> f64 {
    let variance = (1.0 + cv * cv).log_e();
    let deviation = variance.sqrt();
    move |normal| (deviation * normal - 0.5 * variance).exp_e().max(1e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulses(spacing_mm: f64, interval_cv: f64, height_cv: f64) -> Vec<f64> {
        let events = Events::plain(Some(spacing_mm), interval_cv, height_cv);
        let mut bumps = Bumps::new(7);
        let mut all = vec![0.0; 200_000];
        for (tick, out) in all.chunks_exact_mut(5).enumerate() {
            bumps.fill(5 * tick as u64, 2500.0, 0.2 / spacing_mm, &events, out);
        }
        all
    }

    #[test]
    fn pulses_have_unit_power_and_the_wanted_rate() {
        for (spacing, interval, height) in
            [(1.0, 0.0, 0.0), (0.5, 0.5, 0.5), (0.1, 1.0, 0.5), (0.02, 0.2, 0.0)]
        {
            let x = pulses(spacing, interval, height);
            let square = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
            assert!((square - 1.0).abs() < 0.05, "{spacing} {interval} {height}: {square}");
        }
        let count = pulses(1.0, 0.3, 0.0).iter().filter(|x| **x != 0.0).count();
        assert!((count as f64 / 8000.0 - 1.0).abs() < 0.02, "{count}");
    }

    #[test]
    fn pulse_power_is_independent_of_the_spacing() {
        let x = pulses(1.0, 0.8, 0.0);
        // Forty distances each. If heights did not follow them it would be 0.8 / sqrt(40) = 0.126.
        let powers: Vec<f64> =
            x.chunks(1000).map(|x| x.iter().map(|x| x * x).sum::<f64>() / 1000.0).collect();
        let swing = powers.iter().map(|power| (power - 1.0).powi(2)).sum::<f64>() / powers.len() as f64;
        assert!(swing.sqrt() < 0.06, "{}", swing.sqrt());
        let fourth = x.iter().map(|x| x.powi(4)).sum::<f64>() / x.len() as f64;
        // 25 samples a distance; the mean square of distances is 1 + 0.8^2.
        assert!((fourth / (25.0 * 1.64) - 1.0).abs() < 0.1, "{fourth}");
    }

    #[test]
    fn pulses_are_uncorrelated() {
        for (interval, height) in [(0.0, 0.0), (0.3, 0.5), (1.0, 1.0)] {
            let x = pulses(0.4, interval, height);
            for lag in [1, 2, 25, 50] {
                let sum: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum();
                assert!((sum / x.len() as f64).abs() < 0.05, "{interval} {height} at {lag}");
            }
        }
    }

    #[test]
    fn rare_bumps_leave_the_rest_to_noise() {
        // From ten bumps a second to one in 50 s, and none: a soft sponge under a slow hand was silent.
        for spacing in [10.0, 40.0, 200.0, 5000.0, 1e9] {
            let x = pulses(spacing, 0.3, 0.5);
            let square = x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
            assert!((square - 1.0).abs() < 0.25, "{spacing} mm: {square}");
        }
    }

    #[test]
    fn hand_at_rest_meets_no_bump() {
        let (mut bumps, mut out) = (Bumps::new(1), [1.0_f32; 5]);
        let events = Events::plain(Some(1.0), 0.2, 0.2);
        bumps.fill(0, 2500.0, 0.0, &events, &mut out);
        let noise: [f32; 5] = std::array::from_fn(|i| normal(1, i as u64) as f32);
        assert_eq!(out, noise);
    }
}
