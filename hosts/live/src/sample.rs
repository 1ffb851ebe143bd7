//! Samples of a hand from a device, a network or a page.

use ringbuf::traits::{Consumer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

opaque_debug!(SampleWriter, SampleReader);

/// Size of the queue to the tick thread.
pub const QUEUE: usize = 4096;

/// One reading of a hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time of the reading, by [`now_ns`](crate::now_ns): the device's own clock mapped to ours, or else
    /// the arrival.
    pub time_ns: u64,
    /// Time of arrival, by the same clock; not before `time_ns`, or only little.
    pub arrived_ns: u64,
    /// x, y, z in mm, z up.
    pub position: [f64; 3],
    /// Force in N, or pressure from 0 to 1, as the node declares. 0 off the surface.
    pub force: f64,
    /// Stroke number. A new number means that the hand was lifted and put down elsewhere: nothing is
    /// interpolated between.
    pub stroke: u32,
}

/// Writer of a source, in the order of time. One thread.
pub struct SampleWriter(HeapProd<Sample>);

/// Reader of the tick thread.
pub struct SampleReader(HeapCons<Sample>);

/// A queue from a source to the tick thread.
pub fn samples() -> (SampleWriter, SampleReader) {
    let (to, from) = HeapRb::new(QUEUE).split();
    (SampleWriter(to), SampleReader(from))
}

impl SampleWriter {
    /// Sends a sample. False if it is lost: the queue is full because nothing ticks, or a value is not
    /// finite.
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
