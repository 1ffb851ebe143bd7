//! The response lag of a method.
//!
//! The method is given magnitudes that stand still but for their level, which steps up by 12 dB and down again every 0.2
//! to 0.24 s; and, in a second run, the same without steps. What is heard live, with whatever latency the method has, is
//! compared around every step up, whose time is that of the tick in which the first louder frame comes.

use std::sync::Arc;

use asperity_accuracy::response::{Steps, lag_ms};
use asperity_diagnostics::Diagnostic;
use asperity_node::Registry;

use super::builtin;
use crate::failure::Failure;
use crate::phase::{Chain, FRAME_HZ, Frames, Method};

const RATE_HZ: u32 = 2500;
/// Amplitude after a step up over that before it.
const RISE: f32 = 4.0;
/// Most latency with which a method has settled within [`AFTER`], in ms.
const MOST_LATENCY_MS: f64 = 50.0;
/// Frames for which a level stands still: two windows. To them come up to [`JITTER`], so that no beat of a method keeps
/// time with the steps.
const STAND: usize = 100;
const JITTER: usize = 20;
/// What is looked at around a step, in frames.
const BEFORE: usize = 20;
const AFTER: usize = 100;

/// What a method is given.
pub struct Stimulus {
    stepped: Arc<Frames>,
    still: Arc<Frames>,
    /// First sample of every step up.
    steps: Vec<usize>,
}

/// What came of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    /// Times in ms of 10, 50 and 90 % of the way; none where the method did not follow.
    pub ms: Option<[f64; 3]>,
    /// Whether the same frames gave other samples the second time.
    pub differs: bool,
}

impl Stimulus {
    /// A broad noise: mean magnitudes that fall slowly from 400 Hz on, with 120 steps.
    ///
    /// # Errors
    /// None that depends on anything.
    pub fn texture() -> Result<Self, Diagnostic> {
        let density = |hz: f64| (hz / 20.0).clamp(0.0, 1.0) * builtin::band(hz) / (hz / 400.0).hypot(1.0);
        let spectrum = builtin::mean_magnitudes(&density);
        let top = spectrum.iter().copied().fold(0.0, f64::max);
        Self::new(&spectrum.iter().map(|x| (x / top) as f32).collect::<Vec<_>>(), 120)
    }

    /// A sine of 250 Hz, on a bin, with 10 steps.
    ///
    /// # Errors
    /// None that depends on anything.
    pub fn tone() -> Result<Self, Diagnostic> {
        let mut spectrum = [0.0; 101];
        spectrum[24..27].copy_from_slice(&[0.5, 1.0, 0.5]);
        Self::new(&spectrum, 10)
    }

    fn new(spectrum: &[f32], count: usize) -> Result<Self, Diagnostic> {
        let mut levels = vec![1.0; STAND];
        let mut frames_of_steps = Vec::new();
        for k in 0..count {
            frames_of_steps.push(levels.len());
            levels.resize(levels.len() + STAND + k * 7 % (JITTER + 1), RISE);
            levels.resize(levels.len() + STAND + k * 11 % (JITTER + 1), 1.0);
        }
        let frames = |levels: &[f32]| {
            let bins = levels.iter().flat_map(|level| spectrum.iter().map(move |x| x * level));
            Frames::from_amplitudes(bins.collect(), spectrum.len(), RATE_HZ).map(Arc::new)
        };
        let (stepped, still) = (frames(&levels)?, frames(&vec![1.0; levels.len()])?);
        let steps = frames_of_steps.iter().map(|&n| stepped.start(n as u64) as usize).collect();
        Ok(Self { stepped, still, steps })
    }

    /// Drives a method with it.
    ///
    /// # Errors
    /// A method that refuses the frames.
    pub fn drive(&self, registry: &Registry, method: &Method) -> Result<Lag, Failure> {
        const SEED: u64 = 1;
        let hear = |frames| {
            let mut chain = Chain::new(registry, method, frames, SEED)?;
            let latency = chain.latency().ms();
            if latency > MOST_LATENCY_MS {
                return Err(Failure::Machine(format!(
                    "its {latency:.0} ms of latency are too many to see it"
                )));
            }
            Ok(chain.live())
        };
        let (stepped, still) = (hear(&self.stepped)?, hear(&self.still)?);
        let samples = |frames: usize| frames * (RATE_HZ / FRAME_HZ) as usize;
        let steps =
            Steps { rate_hz: RATE_HZ, at: &self.steps, before: samples(BEFORE), after: samples(AFTER) };
        // Up to the first step both were given the same, and what comes later cannot be known.
        let first = self.steps.first().copied().unwrap_or(0);
        let bits = |signal: &[f32]| signal.iter().take(first).map(|x| x.to_bits()).collect::<Vec<_>>();
        Ok(Lag { ms: lag_ms(&stepped, &still, &steps), differs: bits(&stepped) != bits(&still) })
    }
}
