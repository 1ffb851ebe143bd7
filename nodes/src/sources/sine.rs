//! `sine`: one frequency.

use std::f64::consts::TAU;

use crate::prelude::*;
use asperity_actuator::identify::raised_cosine;
use asperity_dsp::Ramp;
use asperity_numbers::Elementary as _;

/// A sine that fades in and, where it ends, out.
///
/// Its phase follows from the sample's number, so it does not drift. A new frequency goes on from the phase
/// that the old one has reached. A new amplitude is reached in a straight line over 10 ms.
pub struct Sine {
    /// The parameter \[Hz\].
    frequency: f64,
    amplitude: Ramp,
    phase: Phase,
    rate: u32,
    /// Samples of a fade.
    fade: f64,
    /// The sample at which it is over.
    end: Option<u64>,
}

/// A phase that is known at one sample, and continues from there with one frequency.
#[derive(Clone, Copy)]
struct Phase {
    frequency: f64,
    /// The sample.
    from: u64,
    /// The phase there, in periods, 0 to 1.
    periods: f64,
    /// The first sample that has not been put out.
    next: u64,
}

impl Phase {
    fn new(frequency: f64) -> Self {
        Self { frequency, from: 0, periods: 0.0, next: 0 }
    }

    /// The phase at sample `n`, in periods, 0 to below 2. The remainder is exact; only the product is
    /// rounded.
    fn at(&self, n: u64, rate: f64) -> f64 {
        self.periods + (self.frequency * n.saturating_sub(self.from) as f64) % rate / rate
    }

    /// Goes on with another frequency.
    fn turn(&mut self, frequency: f64, rate: f64) {
        if frequency != self.frequency {
            self.periods = self.at(self.next, rate).fract();
            (self.from, self.frequency) = (self.next, frequency);
        }
    }
}

/// Places of the live parameters.
const FREQUENCY_HZ: usize = 0;
const AMPLITUDE: usize = 1;
const FADE_S: f64 = 0.02;
/// Number of amplitude ramps that fit into a second.
const RAMPS_PER_SECOND: u32 = 100;
/// Highest frequency of a sine, as a part of the rate.
const HIGHEST: f64 = 0.45;

impl Node for Sine {
    fn descriptor() -> Descriptor {
        Descriptor::new("sine", "Generates a sine with fades, for example to test an actuator.")
            .output(super::output().doc("sine"))
            .param(number("frequency_hz", 80.0, 0.01..=20_000.0, "Hz").live())
            .doc("Frequency, at most 0.45 of the audio rate. A change keeps the phase.")
            .param(number("amplitude", 0.1, 0.0..=1000.0, "").live().doc("Amplitude, in the output's unit."))
            .param(number("seconds", 0.0, 0.0..=1e6, "s"))
            .doc("Duration with fades of 20 ms; 0: endless. A short sine has shorter fades.")
            .param(super::unit_param())
            .resumes(Resume::Continue)
    }

    fn ports(config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(super::with_unit(config, ports))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let rate = setup.output_rate(0);
        let (frequency, seconds) = (p.number("frequency_hz"), p.number("seconds"));
        let highest = HIGHEST * f64::from(rate);
        if frequency > highest {
            let message = format!("a sine of {frequency} Hz does not fit an audio rate of {rate} Hz");
            return Err(p.error("frequency_hz", message).help(format!("at most {highest} Hz")));
        }
        let end = (seconds > 0.0).then(|| ((seconds * f64::from(rate)).round() as u64).max(1));
        let fade = (FADE_S * f64::from(rate)).min(end.map_or(f64::INFINITY, |n| n as f64 / 2.0));
        let amplitude = Ramp::new(p.number("amplitude"), rate / RAMPS_PER_SECOND);
        let duration = end.and_then(|end| i64::try_from(end).ok()).map(|end| Latency::samples(end, rate));
        let it = Self { frequency, amplitude, phase: Phase::new(frequency), rate, fade, end };
        Ok(Prepared::new(it).duration(duration))
    }
}

impl Processor for Sine {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate);
        self.phase.next = span.end;
        if self.end.is_some_and(|end| span.start >= end) {
            return Status::Quiet;
        }
        let rate = f64::from(self.rate);
        let (first, step) = (self.phase.at(span.start, rate), self.phase.frequency / rate);
        for ((i, y), n) in tick.outputs.audio(0).iter_mut().enumerate().zip(span) {
            let ahead = self.end.map_or(f64::INFINITY, |end| end.saturating_sub(n + 1) as f64);
            let fade = raised_cosine((n as f64).min(ahead), self.fade);
            let sine = (TAU * (first + step * i as f64).fract()).sine();
            *y = (self.amplitude.step() * fade * sine) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.amplitude.reset();
        self.phase = Phase::new(self.frequency);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        match index {
            FREQUENCY_HZ => {
                self.frequency = value.min(HIGHEST * f64::from(self.rate));
                self.phase.turn(self.frequency, f64::from(self.rate));
            }
            AMPLITUDE => self.amplitude.set(value),
            _ => {}
        }
    }

    /// Present phase and amplitude. From there they go on to this node's own.
    fn state(&mut self, state: &mut State<'_>) {
        self.amplitude.state(state);
        let mut that = self.phase;
        state.keep(&mut that.frequency).keep(&mut that.from).keep(&mut that.periods).keep(&mut that.next);
        if !state.restores() {
            return;
        }
        state.require((0.0..=1e6).contains(&that.frequency) && (0.0..=1.0).contains(&that.periods));
        if !state.failed() {
            that.turn(self.frequency, f64::from(self.rate));
            self.phase = that;
        }
    }
}
