//! Common parts of the drivers' tests: a ticker and its expected output.

use std::sync::Arc;
use std::time::Duration;

use asperity_audio::{Block, Process};
use asperity_node::time;

use super::{Options, Rates, Ticker};
use crate::meters::Meters;
use crate::ramp::Ramp;

/// Writes the number of each sample as its value, negative on odd channels.
pub(super) struct Counter {
    pub(super) rates: Rates,
    pub(super) next: u64,
    /// Ticks with the times they were given.
    pub(super) times: Vec<(u64, u64)>,
    pub(super) stall: Option<(u64, Duration)>,
    pub(super) panic_at: Option<u64>,
}

impl Counter {
    pub(super) fn new(rate_hz: u32, tick_hz: u32, channels: usize, next: u64) -> Self {
        let (rates, times) = (Rates { tick_hz, rate_hz, channels }, Vec::with_capacity(200_000));
        Self { rates, next, times, stall: None, panic_at: None }
    }

    pub(super) fn first_sample(&self) -> u64 {
        self.rates.first_sample(self.next)
    }
}

/// Value of a channel at a sample; exact in f32 for the first five minutes.
pub(super) fn value(sample: u64, channel: usize) -> f32 {
    sample as f32 * if channel.is_multiple_of(2) { 1.0 } else { -1.0 }
}

impl Ticker for Counter {
    fn rates(&self) -> Rates {
        self.rates
    }

    fn next_tick(&self) -> u64 {
        self.next
    }

    fn tick(&mut self, time_ns: u64, out: &mut [f32]) {
        let Rates { tick_hz, rate_hz, channels } = self.rates;
        let samples = time::samples(self.next, rate_hz, tick_hz);
        assert_eq!(out.len() as u64, (samples.end - samples.start) * channels as u64);
        assert!(self.panic_at != Some(self.next), "asked for");
        if let Some((_, long)) = self.stall.filter(|(tick, _)| *tick == self.next) {
            std::thread::sleep(long);
        }
        for (frame, sample) in out.chunks_exact_mut(channels).zip(samples) {
            frame.iter_mut().enumerate().for_each(|(c, x)| *x = value(sample, c));
        }
        self.times.push((self.next, time_ns));
        self.next += 1;
    }

    fn skip(&mut self, n: u64) {
        self.next += n;
    }
}

/// Options without a slow start and without a priority.
pub(super) fn options(tick_hz: u32) -> Options {
    Options { priority: None, start_s: 0.0, ..Options::new(Arc::new(Meters::new(tick_hz))) }
}

/// Calls a device's side for a block, and returns the block.
pub(super) fn call(half: &mut dyn Process, now_ns: u64, frames: usize, channels: usize) -> Vec<f32> {
    let mut output = vec![0.0; frames * channels];
    half.process(&mut Block { output: &mut output, channels, now_ns });
    output
}

/// Expected output: the counter's samples in order, behind an envelope of its own.
pub(super) struct Reference {
    pub(super) ramp: Ramp,
    pub(super) next: u64,
    channels: usize,
}

impl Reference {
    pub(super) fn new(rate_hz: u32, channels: usize, next: u64) -> Self {
        Self { ramp: Ramp::new(rate_hz, channels, 0.0), next, channels }
    }

    pub(super) fn play(&mut self, frames: usize) -> Vec<f32> {
        let mut block: Vec<f32> = (self.next..self.next + frames as u64)
            .flat_map(|s| (0..self.channels).map(move |c| value(s, c)))
            .collect();
        self.next += frames as u64;
        self.ramp.play(&mut block);
        block
    }

    pub(super) fn starve(&mut self, frames: usize) -> Vec<f32> {
        let mut block = vec![0.0; frames * self.channels];
        self.ramp.starve(&mut block);
        block
    }
}
