//! `vibration`: a fixed source while a surface is touched.

use std::f64::consts::TAU;

use crate::prelude::*;
use asperity_numbers::Elementary as _;

use super::bounds::check;
use super::mix::Mix;
use super::{Renders, acceleration, made, one_each, pick, slot};

/// Parts of a hertz in which frequencies are counted: 2^32.
const PARTS: f64 = 4_294_967_296.0;

/// A sine from a fixed source. Its phase depends on the sample's number alone. It is counted in integers, so
/// it is as exact after a year as at the start, and skipped samples do not change later ones. It remembers
/// nothing; the caller that starts and stops it fades it.
///
/// 96 samples take 0.9 us on a virtual AMD EPYC core.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sine {
    /// Frequency and rate in parts of a hertz: phase n is `n step mod turn`.
    step: u64,
    turn: u64,
    amplitude_m_s2: f64,
}

impl Sine {
    /// A sine of `frequency_hz`, counted to 2^-32 Hz, and of amplitude `amplitude_m_s2`, at `rate_hz` samples
    /// a second.
    pub(crate) fn new(frequency_hz: f64, amplitude_m_s2: f64, rate_hz: u32) -> Result<Self, String> {
        let range = (0.01, 0.45 * f64::from(rate_hz));
        let frequency = check("a frequency", frequency_hz, range, "Hz")?;
        let step = (frequency * PARTS).round() as u64;
        Ok(Self { step, turn: u64::from(rate_hz) << 32, amplitude_m_s2 })
    }

    /// Writes the samples in m/s^2 from number `first` on: `A sin(2 pi f n / rate)`.
    pub(crate) fn process(&self, first: u64, out: &mut [f64]) {
        let mut phase = (u128::from(first) * u128::from(self.step) % u128::from(self.turn)) as u64;
        let per_turn = TAU / self.turn as f64;
        for out in out {
            *out = self.amplitude_m_s2 * (phase as f64 * per_turn).sine();
            // A turn is below 2^62.
            phase += self.step;
            if phase >= self.turn {
                phase -= self.turn;
            }
        }
    }
}

/// Sources that sound at a time; another begins when one of them has faded out.
const MOST: usize = 8;

/// A sine of a fixed frequency, crossfaded into that of the next surface.
///
/// Phases follow from the sample's number: a source that comes on again is where it would have been. If its
/// slot comes back while it fades out, it fades in again from its present level.
pub struct Vibration {
    sources: Vec<Sine>,
    voices: [Voice; MOST],
    /// Samples of a fade.
    fade: u32,
    mix: Mix,
    rate_hz: u32,
}

/// A source that sounds.
#[derive(Clone, Copy, Debug, Default)]
struct Voice {
    slot: Option<usize>,
    /// Level of its fade, 0 to the samples of a fade.
    level: u32,
}

impl Node for Vibration {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "vibration",
            "Renders a sine of fixed frequency while a surface is touched, with fades between surfaces.",
        )
        .input(slot("index into `sources`, from 0; below 0: silent").wakes())
        .output(acceleration().doc("sine"))
        .param(number("fade_ms", 20.0, 0.1..=1000.0, "ms"))
        .doc("Duration of the linear fade of a source, in or out.")
        .renders(
            Effect::new("sources", Acts::Inside).form(
                Form::new("", "(frequency_hz: 120, amplitude_m_s2: 2)")
                    .field(number("frequency_hz", 0.0, 0.01..=21_600.0, "Hz").required())
                    .doc("frequency, at most 0.45 of the audio rate")
                    .field(number("amplitude_m_s2", 0.0, 0.0..=1000.0, "m/s^2").required())
                    .doc("amplitude of the sine"),
            ),
        )
        .timing("no latency; fades over `fade_ms`, and sleeps while silent")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let rate_hz = setup.audio_hz;
        let sources = one_each(setup, |s| {
            made(s, Sine::new(s.number("frequency_hz"), s.number("amplitude_m_s2"), rate_hz))
        })?;
        let fade = (setup.params.number("fade_ms") * 1e-3 * f64::from(rate_hz)).round().max(1.0) as u32;
        let tail = Latency::samples(i64::from(fade), rate_hz);
        let it = Self { sources, voices: [Voice::default(); MOST], fade, mix: Mix::new(setup), rate_hz };
        Ok(Prepared::new(it).tail(tail))
    }
}

impl Processor for Vibration {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let wanted = pick(tick.inputs.value(0), self.sources.len());
        if wanted.is_some()
            && self.voices.iter().all(|v| v.slot != wanted)
            && let Some(free) = self.voices.iter_mut().find(|v| v.slot.is_none())
        {
            *free = Voice { slot: wanted, level: 0 };
        }
        if self.voices.iter().all(|v| v.slot.is_none()) {
            return Status::Asleep;
        }
        let span = tick.samples(self.rate_hz);
        self.mix.begin((span.end - span.start) as usize);
        let fade = self.fade;
        for voice in &mut self.voices {
            let Some(source) = voice.slot.and_then(|slot| self.sources.get(slot)) else { continue };
            let on = voice.slot == wanted;
            if on && voice.level == fade {
                self.mix.add(|| 1.0, |part| source.process(span.start, part));
                continue;
            }
            let level = || {
                voice.level = if on { fade.min(voice.level + 1) } else { voice.level.saturating_sub(1) };
                f64::from(voice.level) / f64::from(fade)
            };
            self.mix.add(level, |part| source.process(span.start, part));
            if !on && voice.level == 0 {
                voice.slot = None;
            }
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.voices = [Voice::default(); MOST];
    }

    /// Sources that sound, and how far each is faded in, kept as a part of the fade.
    fn state(&mut self, state: &mut State<'_>) {
        let mut fade = self.fade;
        state.keep(&mut fade);
        for voice in &mut self.voices {
            state.keep(&mut voice.slot).keep(&mut voice.level);
            if fade != self.fade {
                let level = u64::from(voice.level) * u64::from(self.fade) / u64::from(fade.max(1));
                voice.level = u32::try_from(level).unwrap_or(u32::MAX);
            }
            let slots = self.sources.len();
            state.require(voice.level <= self.fade && voice.slot.is_none_or(|slot| slot < slots));
        }
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("slots", self.sources.len() as u64)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sine_of_its_sample_number_and_comes_back_exactly() {
        let v = Sine::new(250.0, 3.0, 48_000).unwrap();
        let mut out = [0.0f64; 1000];
        v.process(0, &mut out);
        for (n, x) in out.iter().enumerate() {
            assert!((x - 3.0 * (TAU * 250.0 * n as f64 / 48_000.0).sin()).abs() < 1e-12, "{n}: {x}");
        }
        assert_eq!(out[0], 0.0);
        // 192 samples a period: the same bits after a year and more.
        let mut late = [0.0f64; 1000];
        v.process(192 * 10_000_000_000, &mut late);
        assert_eq!(out, late);
    }

    #[test]
    fn samples_do_not_depend_on_how_they_are_cut() {
        let v = Sine::new(123.456_789, 1.0, 44_100).unwrap();
        let mut whole = [0.0f64; 500];
        v.process(1 << 50, &mut whole);
        for (n, x) in whole.iter().enumerate() {
            let mut one = [0.0f64];
            v.process((1 << 50) + n as u64, &mut one);
            assert_eq!(one[0], *x);
        }
        v.process(0, &mut [0.0f64; 0]);
    }

    #[test]
    fn a_frequency_that_is_no_fraction_of_the_rate_keeps_its_phase() {
        // In seconds and periods: exact by hand with integers of 10^-6 Hz.
        let v = Sine::new(61.000_001, 1.0, 48_000).unwrap();
        let n: u64 = 48_000 * 3600 * 24;
        let mut out = [0.0f64];
        v.process(n, &mut out);
        let turns = (u128::from(n) * 61_000_001 % 48_000_000_000) as f64 / 48e9;
        // Rounded to 2^-33 Hz, a day is 1e-5 periods.
        assert!((out[0] - (TAU * turns).sin()).abs() < 7e-5, "{} {}", out[0], (TAU * turns).sin());
    }

    #[test]
    fn what_cannot_be_is_refused() {
        assert!(Sine::new(21_601.0, 1.0, 48_000).is_err() && Sine::new(21_600.0, 1.0, 48_000).is_ok());
        let fastest = Sine::new(0.45e9, 1.0, 1_000_000_000).unwrap();
        let mut out = [0.0f64; 100];
        fastest.process(u64::MAX - 50, &mut out);
        assert!(out.iter().all(|x| x.abs() <= 1.0) && out.iter().any(|x| x.abs() > 0.5));
    }
}
