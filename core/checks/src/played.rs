//! What comes from outside, from memory: kinds of nodes that no file can name, since their names have spaces.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_node::{
    Config, Descriptor, Diagnostic, Fault, FrameLayout, Input, LayoutSpec, NodeKind, Output, Ports,
    Processor, RateSpec, Setup, ShapeSpec, Status, Tick, Unit,
};

/// Where a stylus is, x, y, z in mm, z up, by the number of the tick.
pub type Motion = Arc<dyn Fn(u64) -> [f64; 3] + Send + Sync>;
/// Values by the number of the tick.
pub type Values = Arc<dyn Fn(u64, &mut [f64]) + Send + Sync>;
/// The samples from a sample on.
pub type Samples = Arc<dyn Fn(u64, &mut [f32]) + Send + Sync>;
/// The bins of a frame by its number; false for a frame that does not come.
pub type Frames = Arc<dyn Fn(u64, &mut [f32]) -> bool + Send + Sync>;

/// Where a stylus is, as a case says from tick to tick: for a motion that depends on what the graph answers.
#[derive(Debug, Default)]
pub struct Place([AtomicU64; 3]);

impl Place {
    /// Puts the stylus there, x, y, z in mm.
    pub fn put(&self, at: [f64; 3]) {
        self.0.iter().zip(at).for_each(|(to, x)| to.store(x.to_bits(), Ordering::Relaxed));
    }

    /// The motion of a stylus that is always where it was put last.
    pub fn motion(self: &Arc<Self>) -> Motion {
        let place = self.clone();
        Arc::new(move |_| {
            std::array::from_fn(|k| place.0.get(k).map_or(0.0, |x| f64::from_bits(x.load(Ordering::Relaxed))))
        })
    }
}

/// Stiffness with which a played stylus presses where nothing else says how hard \[N/mm\].
const STIFFNESS_N_PER_MM: f64 = 0.5;

/// What is played.
#[derive(Clone)]
enum What {
    Motion(Motion),
    Fed,
    Control(Values),
    Audio(Samples),
    Magnitude(Frames, FrameLayout),
}

/// A kind that plays.
pub struct Played {
    descriptor: Descriptor,
    what: What,
}

impl Played {
    /// A stylus, in the place of a kind that moves one: with the same outputs, of which `position` is played, `force` is that of a floor at z = 0,
    /// and the others stay 0.
    pub fn stylus(name: &str, like: &Descriptor, motion: Motion) -> Arc<dyn NodeKind> {
        let mut descriptor = Descriptor::new(name.to_owned(), "Plays a motion from memory.");
        descriptor.outputs = like.outputs.clone();
        Arc::new(Self { descriptor, what: What::Motion(motion) })
    }

    /// The same, whose place the case gives from tick to tick, as a host does, with the mark whether it is to be trusted: at the input 0.
    pub fn fed_stylus(name: &str, like: &Descriptor) -> Arc<dyn NodeKind> {
        let place = Input::new("place", ShapeSpec::Control(3), Unit::MILLIMETRE).fed();
        let mut descriptor = Descriptor::new(name.to_owned(), "Passes on the places of a case.").input(place);
        descriptor.outputs = like.outputs.clone();
        Arc::new(Self { descriptor, what: What::Fed })
    }

    /// So many values a tick, at the output `out`.
    pub fn control(name: &str, count: usize, unit: Unit, values: Values) -> Arc<dyn NodeKind> {
        Self::of(name, ShapeSpec::Control(count), unit, What::Control(values))
    }

    /// Audio at the graph's rate, at the output `out`.
    pub fn audio(name: &str, unit: Unit, samples: Samples) -> Arc<dyn NodeKind> {
        Self::of(name, ShapeSpec::Audio(RateSpec::Graph), unit, What::Audio(samples))
    }

    /// Audio at the graph's rate, at the output `out`, which is to be trusted only while the host vouches for the input `hand`.
    pub fn audio_in_hand(name: &str, unit: Unit, samples: Samples) -> Arc<dyn NodeKind> {
        let hand = Input::new("hand", ShapeSpec::Control(1), Unit::NONE).fed();
        let output = Output::new("out", ShapeSpec::Audio(RateSpec::Graph), unit);
        let descriptor =
            Descriptor::new(name.to_owned(), "Plays what it is given.").input(hand).output(output);
        Arc::new(Self { descriptor, what: What::Audio(samples) })
    }

    /// Audio at a rate of its own, at the output `out`.
    pub fn audio_at(name: &str, rate_hz: u32, unit: Unit, samples: Samples) -> Arc<dyn NodeKind> {
        Self::of(name, ShapeSpec::Audio(RateSpec::Hz(rate_hz)), unit, What::Audio(samples))
    }

    /// Frames of magnitudes in m/s^2, one each time the node runs, at the output `out`.
    pub fn magnitudes(name: &str, layout: FrameLayout, frames: Frames) -> Arc<dyn NodeKind> {
        let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
        Self::of(name, shape, Unit::METRE_PER_SECOND_SQUARED, What::Magnitude(frames, layout))
    }

    fn of(name: &str, shape: ShapeSpec, unit: Unit, what: What) -> Arc<dyn NodeKind> {
        let output = Output::new("out", shape, unit);
        let descriptor = Descriptor::new(name.to_owned(), "Plays what it is given.").output(output);
        Arc::new(Self { descriptor, what })
    }
}

impl NodeKind for Played {
    fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }

    fn ports(&self, _config: &Config<'_>) -> Result<Ports, Diagnostic> {
        Ok(Ports { inputs: self.descriptor.inputs.clone(), outputs: self.descriptor.outputs.clone() })
    }

    fn prepare(&self, setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        let place = |name: &str| self.descriptor.outputs.iter().position(|o| o.name == name);
        Ok(Box::new(Player {
            what: self.what.clone(),
            position: place("position"),
            force: place("force"),
            rate_hz: setup.output_rate(0),
            every: u64::from(setup.every),
        }))
    }
}

struct Player {
    what: What,
    position: Option<usize>,
    force: Option<usize>,
    rate_hz: u32,
    every: u64,
}

impl Player {
    /// The outputs of a stylus that is there.
    fn put(&self, tick: &mut Tick<'_>, at: [f64; 3]) {
        if let Some(output) = self.position {
            tick.outputs.control(output).copy_from_slice(&at);
        }
        if let Some(output) = self.force {
            tick.outputs.set(output, (-at[2] * STIFFNESS_N_PER_MM).max(0.0));
        }
    }
}

impl Processor for Player {
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        match &self.what {
            What::Motion(motion) => self.put(tick, motion(tick.index)),
            What::Fed => {
                let at = tick.inputs.control(0).try_into().unwrap_or_default();
                self.put(tick, at);
            }
            What::Control(values) => values(tick.index, tick.outputs.control(0)),
            What::Audio(samples) => {
                let first = tick.samples(self.rate_hz).start;
                samples(first, tick.outputs.audio(0));
            }
            What::Magnitude(frames, layout) => {
                let frame = tick.index / self.every;
                let start = layout.frame_rate.first_sample(frame, layout.rate_hz);
                let mut bins = [0.0; 4096];
                let Some(bins) = bins.get_mut(..layout.bins as usize) else { return Err(Fault::Failed(1)) };
                if !frames(frame, bins) {
                    return Ok(Status::Quiet);
                }
                tick.outputs.magnitude(0, frame, start).copy_from_slice(bins);
            }
        }
        Ok(Status::Continue)
    }

    fn reset(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
