//! Sums of kernels over a tick.

use super::path::Parts;
use crate::prelude::*;
use asperity_dsp::filter::Sample;

/// Buffer for the samples of a tick, in which parts are added up.
pub(super) struct Mix {
    sum: Box<[f64]>,
    part: Box<[f64]>,
    len: usize,
}

impl Mix {
    /// A buffer large enough for any tick at the audio rate.
    pub(super) fn new(setup: &Setup<'_>) -> Self {
        let room = || vec![0.0; time::max_samples(setup.audio_hz, setup.tick_hz)].into();
        Self { sum: room(), part: room(), len: 0 }
    }

    /// Begins a tick of so many samples.
    pub(super) fn begin(&mut self, len: usize) {
        self.len = len.min(self.sum.len());
        self.sum[..self.len].fill(0.0);
    }

    /// Adds the samples that `fill` writes, each times the next value of `gain`.
    pub(super) fn add(&mut self, mut gain: impl FnMut() -> f64, fill: impl FnOnce(&mut [f64])) {
        let part = &mut self.part[..self.len];
        fill(part);
        self.sum.iter_mut().zip(part).for_each(|(sum, x)| *sum += gain() * *x);
    }

    /// Lets the sum rise from 0 at the beginning of the tick to itself at its end.
    pub(super) fn fade_in(&mut self, parts: &Parts) {
        self.sum[..self.len].iter_mut().enumerate().for_each(|(n, x)| *x *= parts.at(n));
    }

    /// The sum.
    pub(super) fn write(&self, out: &mut [f32]) {
        out.iter_mut().zip(&self.sum[..self.len]).for_each(|(out, x)| *out = f32::narrow(*x));
    }
}
