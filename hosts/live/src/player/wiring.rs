//! Connections of a graph's nodes with devices, recordings and meters.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_node::Buffer;
use parking_lot::Mutex;
use ringbuf::HeapProd;
use ringbuf::traits::Producer;

use super::{NodeMeters, Stylus, TapeWriter};
use crate::ForceWriter;
use crate::timeline::Timeline;

/// Connections of one graph. Made beforehand; taken over in the tick in which the engine takes over that
/// graph. Only the tick thread takes its locks, by `try_lock`.
pub(crate) struct Wiring {
    /// [`Engine::swaps`] from which it applies.
    pub(crate) swap: u64,
    /// `audio_out` nodes, one a channel.
    pub(crate) outs: Vec<usize>,
    /// The limiter before each of them.
    pub(crate) limiters: Vec<Option<usize>>,
    /// Nodes with the position of a hand, each with the recording of its inputs.
    pub(crate) hands: Vec<(usize, Arc<Hand>, Option<TapeWriter>)>,
    /// `audio_in` nodes, each with its recorded channel.
    pub(crate) mics: Vec<(usize, usize)>,
    /// Sinks whose force a device renders, with their largest force.
    pub(crate) forces: Vec<(usize, f64, Arc<Mutex<ForceWriter>>)>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) tapes: Vec<TapeWriter>,
    /// The stylus, whose motion a recording takes.
    pub(crate) stylus: Option<Stylus>,
    pub(crate) meters: Arc<NodeMeters>,
    /// Buffer for the times of a tick.
    pub(crate) spent: Vec<u64>,
}

/// The hand behind a node, and its figures for other threads. It goes on through swaps.
#[derive(Debug, Default)]
pub(crate) struct Hand {
    /// `None` for a node without a device.
    pub(crate) motion: Option<Mutex<Motion>>,
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

/// Source of a hand's motion.
#[derive(Debug)]
pub(crate) enum Motion {
    Device(Timeline),
    /// Inputs of an earlier run, each with its tick.
    Recorded(VecDeque<(u64, HandInput)>),
}

/// Inputs of a hand's node in a tick. They are single precision, so that a recording holds them exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandInput {
    /// x, y, z in mm.
    pub position: [f32; 3],
    /// As in [`Sample::force`](crate::Sample::force).
    pub force: f32,
    /// Number of the stroke.
    pub stroke: f32,
    /// Whether the hand is there. Otherwise the values are held.
    pub valid: bool,
}

impl HandInput {
    /// Values of a recording: position, force, stroke, and 1 or 0 for valid.
    pub const COUNT: usize = 6;

    pub(super) fn values(&self) -> [f32; Self::COUNT] {
        let [x, y, z] = self.position;
        [x, y, z, self.force, self.stroke, f32::from(u8::from(self.valid))]
    }
}

impl Hand {
    /// Inputs of a tick at its time. Tick thread.
    pub(super) fn read(&self, tick: u64, time_ns: u64) -> Option<HandInput> {
        let mut motion = self.motion.as_ref()?.try_lock()?;
        let timeline = match &mut *motion {
            Motion::Device(timeline) => timeline,
            Motion::Recorded(inputs) => {
                while inputs.pop_front_if(|(of, _)| *of < tick).is_some() {}
                return inputs.pop_front_if(|(of, _)| *of == tick).map(|(_, input)| input);
            }
        };
        let reading = timeline.at(time_ns);
        let seen = timeline.seen();
        self.samples.store(seen.samples, Relaxed);
        self.stalls.store(seen.stalls, Relaxed);
        self.age_ns.store(reading.age_ns, Relaxed);
        self.delay_ns.store(seen.delay_ns, Relaxed);
        self.stalled.store(reading.stalled, Relaxed);
        Some(HandInput {
            position: reading.position.map(|x| x as f32),
            force: reading.force as f32,
            stroke: reading.stroke as f32,
            valid: !reading.stalled,
        })
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
