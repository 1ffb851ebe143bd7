//! Queue of recorded values from the tick thread to their writer.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_graph::ScheduledNode;
use asperity_node::{Buffer, Shape, time};
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use super::HandInput;
use crate::driver::Rates;

opaque_debug!(TapeReader);

/// Room for values that nobody reads [s].
const ROOM_S: f64 = 4.0;

pub(crate) struct TapeWriter {
    node: usize,
    /// A probe records its input, another sink its output.
    input: bool,
    shape: Shape,
    values: HeapProd<f32>,
    /// Start and number of the values of each tick.
    heads: HeapProd<(u64, usize)>,
    lost: Arc<AtomicU64>,
}

/// Side of the reader.
pub struct TapeReader {
    values: HeapCons<f32>,
    heads: HeapCons<(u64, usize)>,
    lost: Arc<AtomicU64>,
}

/// Tape for a sink; `None` if the type of its signal is not settled.
pub(crate) fn tape(at: usize, node: &ScheduledNode, tick_hz: u32) -> Option<(TapeWriter, TapeReader)> {
    let input = node.outputs.is_empty();
    let shape = if input { node.inputs.first()?.port.as_ref()?.shape } else { node.outputs[0].port.shape };
    let values = match shape {
        Shape::Control { count } => count,
        Shape::Audio { rate_hz } => time::max_samples(rate_hz, tick_hz),
        Shape::Magnitude(l) => l.bins as usize,
        Shape::Spectrum(l) => 2 * l.bins as usize,
    };
    Some(of_size(at, input, shape, values, (f64::from(tick_hz) * ROOM_S) as usize))
}

/// Tape for the inputs of a hand's node.
pub(crate) fn hand_tape(node: usize, tick_hz: u32) -> (TapeWriter, TapeReader) {
    let count = HandInput::COUNT;
    let ticks = (f64::from(tick_hz) * ROOM_S) as usize;
    of_size(node, true, Shape::Control { count }, count, ticks)
}

/// Tape for the samples of all channels.
pub(super) fn played_tape(rates: Rates) -> (TapeWriter, TapeReader) {
    let each = time::max_samples(rates.rate_hz, rates.tick_hz) * rates.channels;
    let ticks = (f64::from(rates.tick_hz) * ROOM_S) as usize;
    of_size(usize::MAX, false, Shape::Audio { rate_hz: rates.rate_hz }, each, ticks)
}

fn of_size(node: usize, input: bool, shape: Shape, each: usize, ticks: usize) -> (TapeWriter, TapeReader) {
    let (values, values_in) = HeapRb::new(each * ticks).split();
    let (heads, heads_in) = HeapRb::new(ticks).split();
    let lost = Arc::new(AtomicU64::new(0));
    let reader = TapeReader { values: values_in, heads: heads_in, lost: lost.clone() };
    (TapeWriter { node, input, shape, values, heads, lost }, reader)
}

impl TapeWriter {
    /// Takes down the tick that has just run. Tick thread.
    pub(super) fn take(&mut self, engine: &Engine) {
        let buffer = if self.input { engine.input(self.node, 0) } else { engine.output(self.node, 0) };
        let tick = engine.next_tick().saturating_sub(1);
        match (buffer, self.shape) {
            (Some(Buffer::Control { values, .. }), _) => {
                self.push(tick, values.len(), values.iter().map(|x| *x as f32));
            }
            (Some(Buffer::Audio { samples, len, .. }), Shape::Audio { rate_hz }) => {
                let start = time::first_sample(tick, rate_hz, engine.schedule().tick_hz);
                self.push(start, *len, samples[..*len].iter().copied());
            }
            (Some(Buffer::Magnitude { bins, frame: Some((_, start)), .. }), _) => {
                self.push(*start, bins.len(), bins.iter().copied());
            }
            (Some(Buffer::Spectrum { bins, frame: Some((_, start)), .. }), _) => {
                self.push(*start, 2 * bins.len(), bins.iter().flat_map(|z| [z.re, z.im]));
            }
            _ => {}
        }
    }

    /// Takes down the inputs of a hand's node. Tick thread.
    pub(super) fn note(&mut self, tick: u64, input: &HandInput) {
        self.push(tick, HandInput::COUNT, input.values().into_iter());
    }

    /// Takes down interleaved samples from `start` on, with their channels in this order. Tick thread.
    pub(super) fn note_frames(&mut self, start: u64, samples: &[f32], order: &[usize]) {
        let frames = samples.chunks_exact(order.len().max(1));
        let count = frames.len() * order.len();
        self.push(start, count, frames.flat_map(|frame| order.iter().map(move |&channel| frame[channel])));
    }

    /// Records a tick whole, or counts it as lost.
    fn push(&mut self, start: u64, count: usize, values: impl Iterator<Item = f32>) {
        if self.values.vacant_len() < count || self.heads.is_full() {
            self.lost.fetch_add(1, Relaxed);
            return;
        }
        self.values.push_iter(values);
        let _ = self.heads.try_push((start, count));
    }
}

impl TapeReader {
    /// Takes the values of the next recorded tick, and returns their start: a tick for controls, a sample
    /// at the signal's rate for audio and frames.
    pub fn next(&mut self, values: &mut Vec<f32>) -> Option<u64> {
        values.clear();
        let (start, count) = self.heads.try_pop()?;
        values.extend(self.values.pop_iter().take(count));
        Some(start)
    }

    /// Whether nothing more can come.
    pub(crate) fn ended(&self) -> bool {
        !self.heads.write_is_held() && self.heads.is_empty()
    }

    /// Ticks lost for want of room.
    pub fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tape_holds_a_tick_whole_or_counts_it_lost() {
        let (mut to, mut from) = of_size(0, true, Shape::Control { count: 3 }, 3, 3);
        let mut values = Vec::new();
        // So often that it goes round.
        for start in 0..30 {
            (0..4).for_each(|i| to.push(start + i, 3, [start as f32, i as f32, -0.5].into_iter()));
            for i in 0..3 {
                assert_eq!(from.next(&mut values), Some(start + i));
                assert_eq!(values, [start as f32, i as f32, -0.5]);
            }
            assert_eq!(from.next(&mut values), None);
        }
        assert_eq!(from.lost(), 30);
        // Without a writer it ends when it is read.
        to.push(7, 3, [1.0, 2.0, 3.0].into_iter());
        drop(to);
        assert!(!from.ended());
        assert_eq!(from.next(&mut values), Some(7));
        assert!(from.ended());
    }
}
