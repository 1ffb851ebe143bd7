//! Connections of a graph's nodes with devices, recordings and meters.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_node::Buffer;
use parking_lot::Mutex;
use ringbuf::HeapProd;
use ringbuf::traits::Producer;

use super::{NodeMeters, TapeWriter};
use crate::ForceWriter;
use crate::timeline::{Reading, Timeline};

/// Connections of one graph. Made beforehand; taken over in the tick in which the engine takes over that
/// graph. Only the tick thread takes its locks, by `try_lock`.
pub(crate) struct Wiring {
    /// [`Engine::swaps`] from which it applies.
    pub(crate) swap: u64,
    /// `audio_out` nodes, one a channel.
    pub(crate) outs: Vec<usize>,
    /// The limiter before each of them.
    pub(crate) limiters: Vec<Option<usize>>,
    /// Nodes with the position of a hand.
    pub(crate) hands: Vec<(usize, Arc<Hand>)>,
    /// `audio_in` nodes, each with its recorded channel.
    pub(crate) mics: Vec<(usize, usize)>,
    /// Sinks whose force a device renders, with their largest force.
    pub(crate) forces: Vec<(usize, f64, Arc<Mutex<ForceWriter>>)>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) tapes: Vec<TapeWriter>,
    pub(crate) meters: Arc<NodeMeters>,
    /// Buffer for the times of a tick.
    pub(crate) spent: Vec<u64>,
}

/// The hand behind a node, and its figures for other threads. It goes on through swaps.
#[derive(Debug, Default)]
pub(crate) struct Hand {
    /// `None` for a node without a device.
    pub(crate) timeline: Option<Mutex<Timeline>>,
    pub(crate) samples: AtomicU64,
    pub(crate) stalls: AtomicU64,
    pub(crate) age_ns: AtomicU64,
    pub(crate) delay_ns: AtomicU64,
    pub(crate) stalled: AtomicBool,
}

/// A signal on a scope. Samples without room are dropped.
pub(crate) struct Scope {
    pub(crate) node: usize,
    pub(crate) output: usize,
    /// Whether it is shown as strong as it is played: it comes before a limiter.
    pub(crate) attenuated: bool,
    /// Samples; a vector control gives its length (a speed, a force).
    pub(crate) to: HeapProd<f32>,
}

impl Hand {
    /// Where the hand is at a time. Tick thread.
    pub(super) fn read(&self, time_ns: u64) -> Option<Reading> {
        let mut timeline = self.timeline.as_ref()?.try_lock()?;
        let reading = timeline.at(time_ns);
        let seen = timeline.seen();
        self.samples.store(seen.samples, Relaxed);
        self.stalls.store(seen.stalls, Relaxed);
        self.age_ns.store(reading.age_ns, Relaxed);
        self.delay_ns.store(seen.delay_ns, Relaxed);
        self.stalled.store(reading.stalled, Relaxed);
        Some(reading)
    }
}

impl Scope {
    /// Takes down a tick, over which the strength goes from one value to the other. Tick thread.
    pub(super) fn take(&mut self, engine: &Engine, [from, to]: [f32; 2]) {
        match engine.output(self.node, self.output) {
            Some(Buffer::Control { values, .. }) => {
                let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
                let value = if let [x] = **values { x } else { length };
                let _ = self.to.try_push(value as f32);
            }
            Some(Buffer::Audio { samples, len, .. }) => {
                let samples = &samples[..*len];
                if !self.attenuated || [from, to] == [1.0; 2] {
                    self.to.push_slice(samples);
                    return;
                }
                let step = (to - from) / (*len).max(1) as f32;
                let gain = |i: usize| from + step * (i + 1) as f32;
                self.to.push_iter(samples.iter().enumerate().map(|(i, x)| x * gain(i)));
            }
            _ => {}
        }
    }
}
