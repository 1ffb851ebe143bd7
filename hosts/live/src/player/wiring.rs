//! Connections of a graph's nodes with devices, recordings and meters.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_node::Buffer;
use ringbuf::HeapProd;
use ringbuf::traits::Producer;

use super::{NodeMeters, TapeWriter};
use crate::ForceWriter;
use crate::timeline::{Reading, Timeline};

/// Connections of one graph. Made beforehand; taken over in the tick in which the engine takes over that
/// graph.
pub(crate) struct Wiring {
    /// [`Engine::swaps`] from which it applies.
    pub(crate) swap: u64,
    /// `audio_out` nodes, one a channel.
    pub(crate) outs: Vec<usize>,
    /// The limiter before each of them.
    pub(crate) limiters: Vec<Option<usize>>,
    pub(crate) hands: Vec<HandSlot>,
    /// `audio_in` nodes, each with its recorded channel.
    pub(crate) mics: Vec<(usize, usize)>,
    pub(crate) forces: Vec<ForceSlot>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) tapes: Vec<TapeWriter>,
    pub(crate) meters: Arc<NodeMeters>,
    /// Buffer for the times of a tick.
    pub(crate) spent: Vec<u64>,
}

/// A node with the position of a hand.
pub(crate) struct HandSlot {
    pub(crate) node: usize,
    /// `None` in a new wiring whose node continues that of the slot `from`.
    pub(crate) timeline: Option<Timeline>,
    /// Slot of the wiring before that it continues.
    pub(crate) from: Option<usize>,
    pub(crate) meter: Arc<SourceMeter>,
}

/// A sink whose force a device renders.
pub(crate) struct ForceSlot {
    pub(crate) node: usize,
    pub(crate) max_force_n: f64,
    pub(crate) writer: Option<ForceWriter>,
    pub(crate) from: Option<usize>,
}

/// A signal on a scope. Samples without room are dropped.
pub(crate) struct Scope {
    pub(crate) node: usize,
    pub(crate) output: usize,
    /// Samples; a vector control gives its length (a speed, a force).
    pub(crate) to: HeapProd<f32>,
}

/// Figures of a source.
#[derive(Debug, Default)]
pub(crate) struct SourceMeter {
    pub(crate) samples: AtomicU64,
    pub(crate) stalls: AtomicU64,
    pub(crate) age_ns: AtomicU64,
    pub(crate) delay_ns: AtomicU64,
    pub(crate) stalled: AtomicBool,
}

impl Wiring {
    /// Takes over continued slots from the wiring before. Tick thread: nothing is dropped here.
    pub(super) fn take_from(&mut self, before: &mut Self) {
        for hand in &mut self.hands {
            if let Some(old) = hand.from.and_then(|i| before.hands.get_mut(i)) {
                std::mem::swap(&mut hand.timeline, &mut old.timeline);
            }
        }
        for force in &mut self.forces {
            if let Some(old) = force.from.and_then(|i| before.forces.get_mut(i)) {
                std::mem::swap(&mut force.writer, &mut old.writer);
            }
        }
    }
}

impl Scope {
    /// Takes down a tick. Tick thread.
    pub(super) fn take(&mut self, engine: &Engine) {
        match engine.output(self.node, self.output) {
            Some(Buffer::Control { values, .. }) => {
                let length = values.iter().map(|x| x * x).sum::<f64>().sqrt();
                let value = if let [x] = **values { x } else { length };
                let _ = self.to.try_push(value as f32);
            }
            Some(Buffer::Audio { samples, len, .. }) => {
                self.to.push_slice(&samples[..*len]);
            }
            _ => {}
        }
    }
}

impl SourceMeter {
    /// Takes down a tick. Tick thread.
    pub(super) fn take(&self, reading: &Reading, timeline: &Timeline) {
        let seen = timeline.seen();
        self.samples.store(seen.samples, Relaxed);
        self.stalls.store(seen.stalls, Relaxed);
        self.age_ns.store(reading.age_ns, Relaxed);
        self.delay_ns.store(seen.delay_ns, Relaxed);
        self.stalled.store(reading.stalled, Relaxed);
    }
}
