//! Queue of recorded values from the tick thread to their writer.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_graph::ScheduledNode;
use asperity_node::{Buffer, Shape, time};
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

opaque_debug!(TapeReader);

/// Room for values that nobody reads [s].
const ROOM_S: f64 = 4.0;
/// Words before the values of a tick: their count, and their start, low half first.
const HEAD: usize = 3;

/// Side of the tick thread.
pub(crate) struct TapeWriter {
    node: usize,
    /// A probe records its input, another sink its output.
    input: bool,
    shape: Shape,
    to: HeapProd<u32>,
    lost: Arc<AtomicU64>,
}

/// Side of the reader.
pub struct TapeReader {
    from: HeapCons<u32>,
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
    let ticks = (f64::from(tick_hz) * ROOM_S) as usize;
    let (to, from) = HeapRb::new((values + HEAD) * ticks).split();
    let lost = Arc::new(AtomicU64::new(0));
    Some((TapeWriter { node: at, input, shape, to, lost: lost.clone() }, TapeReader { from, lost }))
}

impl TapeWriter {
    /// Takes down the tick that has just run. Tick thread.
    pub(super) fn take(&mut self, engine: &Engine) {
        let buffer = if self.input { engine.input(self.node, 0) } else { engine.output(self.node, 0) };
        let tick = engine.next_tick().saturating_sub(1);
        match (buffer, self.shape) {
            (Some(Buffer::Control { values, .. }), _) => self.push(tick, values.iter().map(|x| *x as f32)),
            (Some(Buffer::Audio { samples, len, .. }), Shape::Audio { rate_hz }) => {
                let start = time::first_sample(tick, rate_hz, engine.schedule().tick_hz);
                self.push(start, samples[..*len].iter().copied());
            }
            (Some(Buffer::Magnitude { bins, frame: Some((_, start)), .. }), _) => {
                self.push(*start, bins.iter().copied());
            }
            (Some(Buffer::Spectrum { bins, frame: Some((_, start)), .. }), _) => {
                self.push(*start, Pairs(bins.iter(), None));
            }
            _ => {}
        }
    }

    /// Records a tick whole, or counts it as lost.
    fn push(&mut self, start: u64, values: impl ExactSizeIterator<Item = f32>) {
        let count = values.len();
        if self.to.vacant_len() < count + HEAD {
            self.lost.fetch_add(1, Relaxed);
            return;
        }
        let head = [count as u32, start as u32, (start >> 32) as u32];
        self.to.push_iter(head.into_iter().chain(values.map(f32::to_bits)));
    }
}

/// Real and imaginary parts, one after the other.
struct Pairs<'a>(std::slice::Iter<'a, asperity_node::Complex<f32>>, Option<f32>);

impl Iterator for Pairs<'_> {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        self.1.take().or_else(|| {
            let z = self.0.next()?;
            self.1 = Some(z.im);
            Some(z.re)
        })
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let n = 2 * self.0.len() + usize::from(self.1.is_some());
        (n, Some(n))
    }
}

impl ExactSizeIterator for Pairs<'_> {}

impl TapeReader {
    /// Takes the values of the next recorded tick, and returns their start: a tick for controls, a sample
    /// at the signal's rate for audio and frames.
    pub fn next(&mut self, values: &mut Vec<f32>) -> Option<u64> {
        values.clear();
        // The values may come a moment after their head.
        let count = *self.from.iter().next()? as usize;
        if self.from.occupied_len() < count + HEAD {
            return None;
        }
        let mut head = [0; HEAD];
        self.from.pop_slice(&mut head);
        values.extend(self.from.pop_iter().take(count).map(f32::from_bits));
        Some(u64::from(head[1]) | u64::from(head[2]) << 32)
    }

    /// Whether nothing more can come.
    pub(crate) fn ended(&self) -> bool {
        !self.from.write_is_held() && self.from.is_empty()
    }

    /// Ticks lost for want of room.
    pub fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blank(words: usize) -> (TapeWriter, TapeReader) {
        let (to, from) = HeapRb::new(words).split();
        let (lost, shape) = (Arc::new(AtomicU64::new(0)), Shape::Control { count: 3 });
        let writer = TapeWriter { node: 0, input: true, shape, to, lost: lost.clone() };
        (writer, TapeReader { from, lost })
    }

    #[test]
    fn tape_holds_a_tick_whole_or_counts_it_lost() {
        let (mut to, mut from) = blank(20);
        let mut values = Vec::new();
        // A start beyond 32 bits; and so often that it goes round.
        for start in (1 << 40)..(1 << 40) + 30 {
            (0..4).for_each(|i| to.push(start + i, [start as f32, i as f32, -0.5].into_iter()));
            for i in 0..3 {
                assert_eq!(from.next(&mut values), Some(start + i));
                assert_eq!(values, [start as f32, i as f32, -0.5]);
            }
            assert_eq!(from.next(&mut values), None);
        }
        assert_eq!(from.lost(), 30);
    }

    #[test]
    fn tape_without_writer_ends_when_read() {
        let (mut to, mut from) = blank(20);
        let bins = [asperity_node::Complex::new(1.0, 2.0), asperity_node::Complex::new(3.0, 4.0)];
        to.push(7, Pairs(bins.iter(), None));
        assert!(!from.ended());
        drop(to);
        assert!(!from.ended());
        let mut values = Vec::new();
        assert_eq!(from.next(&mut values), Some(7));
        assert_eq!(values, [1.0, 2.0, 3.0, 4.0]);
        assert!(from.ended());
    }
}
