//! What a hand does, as it comes in from a device, a network or a page.

use ringbuf::traits::{Consumer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

opaque_debug!(SampleWriter, SampleReader);

/// Samples that may wait for the tick thread.
pub const QUEUE: usize = 4096;

/// One reading of a hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// When the hand was there, by [`now_ns`](crate::now_ns). Where the device has a clock of its own, that
    /// clock's time mapped to this one; else when it arrived.
    pub time_ns: u64,
    /// When it arrived here, by the same clock; at least about `time_ns`.
    pub arrived_ns: u64,
    /// x, y, z in mm, z up.
    pub position: [f64; 3],
    /// What the device says of how hard: a force in N, or a pressure from 0 to 1, as its node declares. 0
    /// off the surface.
    pub force: f64,
    /// Counts touches that do not join on to what was before: another number means that the hand was lifted
    /// and put down elsewhere, and that nothing between is to be made up.
    pub stroke: u32,
}

/// Where a source puts its samples, in the order of their times. One thread.
pub struct SampleWriter(HeapProd<Sample>);

/// Where the tick thread takes them.
pub struct SampleReader(HeapCons<Sample>);

/// A queue from a source to the tick thread.
pub fn samples() -> (SampleWriter, SampleReader) {
    let (to, from) = HeapRb::new(QUEUE).split();
    (SampleWriter(to), SampleReader(from))
}

impl SampleWriter {
    /// Sends a sample. False where the queue is full, because nobody ticks, or where the values are not
    /// finite: then it is lost.
    pub fn send(&mut self, sample: Sample) -> bool {
        let finite = sample.position.iter().all(|x| x.is_finite()) && sample.force.is_finite();
        finite && self.0.try_push(sample).is_ok()
    }
}

impl SampleReader {
    /// Takes the oldest sample. Tick thread.
    pub fn take(&mut self) -> Option<Sample> {
        self.0.try_pop()
    }
}
