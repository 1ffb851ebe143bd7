//! Exchange between a hand's device and the ticks: samples of the hand, a local model of the surface.

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

/// Contact model: a plane with a spring and a damper. The device's servo thread evaluates it at its own
/// rate and position, so neither a tick nor an audio buffer lies inside the loop of the wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceModel {
    /// A point of the plane \[mm\], in the graph's axes, z up.
    pub point: [f64; 3],
    /// Outward normal of the plane; a unit vector, or all 0 for no surface.
    pub normal: [f64; 3],
    /// Stiffness \[N/mm\], at least 0.
    pub stiffness_n_per_mm: f64,
    /// Damping along the normal while in the plane \[N s/m\], at least 0.
    pub damping_ns_per_m: f64,
    /// Force beside the plane \[N\]: friction, drag, pull; constant within a tick.
    pub beside_n: [f64; 3],
    /// Largest force \[N\]; the device's own limit also applies.
    pub max_force_n: f64,
    /// Whether the values are valid; if not, the device releases its force.
    pub valid: bool,
    /// Time of the tick, by [`now_ns`](crate::now_ns). A model that is too old counts as invalid.
    pub time_ns: u64,
}

/// Writer of the tick thread.
pub type ForceWriter = triple_buffer::Input<ForceModel>;

/// Reader of a servo thread.
pub type ForceReader = triple_buffer::Output<ForceModel>;

/// Holds the newest model; neither side waits.
pub fn force_model() -> (ForceWriter, ForceReader) {
    triple_buffer::triple_buffer(&ForceModel::default())
}
