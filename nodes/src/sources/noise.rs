//! `noise`: white or pink.

use std::f64::consts::TAU;

use crate::phase::seed_of;
use crate::prelude::*;
use asperity_dsp::Ramp;
use asperity_numbers::Elementary as _;

/// Noise of a level.
///
/// White noise is uniform within 1.73 times its level, and follows from seed and number of the sample alone.
/// Pink noise is that noise through a filter whose poles and zeros lie evenly on a logarithmic axis of
/// frequency (J. Smith and H. F. Smith, "Closed form fractional integration and differentiation via real
/// exponentially spaced pole-zero pairs", arXiv 1606.06154, 2016). A new level is reached in a straight line
/// over 10 ms.
pub struct Noise {
    level: Ramp,
    /// Sections of the pink filter; none for white noise.
    sections: Vec<Section>,
    /// Brings a uniform number within -1 to 1, through the filter, to a level of 1.
    scale: f64,
    seed: u64,
    rate: u32,
}

/// A real pole and a real zero.
#[derive(Clone, Copy, Debug)]
struct Section {
    pole: f64,
    zero: f64,
    memory: f64,
}

impl Section {
    fn step(&mut self, x: f64) -> f64 {
        let y = x + self.memory;
        self.memory = self.pole * y - self.zero * x;
        y
    }
}

/// The lowest pole in Hz: pink from twice this on.
const LOWEST_HZ: f64 = 10.0;
/// The highest pole as a part of the rate. The slope is then right within 0.3 dB up to a fifth of the rate.
const HIGHEST: f64 = 0.3;
/// Largest ratio of two poles.
const RATIO: f64 = 4.0;
/// Place of the live parameter.
const RMS: usize = 0;
/// Number of level ramps that fit into a second.
const RAMPS_PER_SECOND: u32 = 100;

/// The filter from white to pink at a rate.
fn pink(rate: f64) -> Vec<Section> {
    let span = (HIGHEST * rate / LOWEST_HZ).max(RATIO);
    let steps = (span.log_e() / RATIO.log_e()).ceil();
    let ratio = span.power(1.0 / steps);
    let root = |hz: f64| (-TAU * hz / rate).exp_e();
    let section = |k: usize| {
        let pole = LOWEST_HZ * ratio.power(k as f64);
        Section { pole: root(pole), zero: root(pole * ratio.sqrt()), memory: 0.0 }
    };
    (0..=steps as usize).map(section).collect()
}

impl Node for Noise {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "noise",
            "Generates white or pink noise, for example to mask the sound of an actuator.",
        )
        .output(super::output().doc("noise"))
        .param(number("rms", 0.1, 0.0..=1000.0, "").live())
        .doc("Root mean square, in the output's unit. White noise peaks at 1.73 times this.")
        .param(choice("colour", &["white", "pink"]))
        .doc(
            "`white`: equal power at all frequencies. `pink`: 10 dB less a decade, within 0.3 dB from 20 Hz \
                 to a fifth of the audio rate.",
        )
        .param(super::unit_param())
        .param(seed().doc("Seed of the noise; by default from the graph's seed and the node's id."))
    }

    fn ports(config: &Config<'_>, ports: Ports) -> Result<Ports, Diagnostic> {
        Ok(super::with_unit(config, ports))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let (p, rate) = (setup.params, setup.output_rate(0));
        let sections = if p.text("colour") == "pink" { pink(f64::from(rate)) } else { Vec::new() };
        // Sum of the squared impulse response, which has decayed by e^-31 after half a second.
        let mut filter = sections.clone();
        let mut respond = |x: f64| filter.iter_mut().fold(x, |x, section| section.step(x)).powi(2);
        let power = respond(1.0) + (1..rate / 2).map(|_| respond(0.0)).sum::<f64>();
        let level = Ramp::new(p.number("rms"), rate / RAMPS_PER_SECOND);
        let it = Self { level, sections, scale: (3.0 / power).sqrt(), seed: seed_of(setup), rate };
        Ok(Prepared::new(it))
    }
}

impl Processor for Noise {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let span = tick.samples(self.rate);
        for (y, n) in tick.outputs.audio(0).iter_mut().zip(span) {
            let white = self.scale * (2.0 * random::uniform(self.seed, n) - 1.0);
            let noise = self.sections.iter_mut().fold(white, |x, section| section.step(x));
            *y = (self.level.step() * noise) as f32;
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.level.reset();
        self.sections.iter_mut().for_each(|section| section.memory = 0.0);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        if index == RMS {
            self.level.set(value);
        }
    }

    /// Present level, and memory of the filter: a node of the same seed and colour goes on seamlessly.
    fn state(&mut self, state: &mut State<'_>) {
        self.level.state(state);
        for section in &mut self.sections {
            state.keep(&mut section.memory);
            state.require(section.memory.abs() < 1e9);
        }
    }
}
