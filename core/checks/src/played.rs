//! Kinds that play from memory. Their names have spaces, so that no graph file can name them.

use std::sync::Arc;

use asperity_node::{
    Descriptor, Diagnostic, FrameLayout, Input, LayoutSpec, NodeKind, Output, Prepared, Processor, RateSpec,
    Resume, Setup, ShapeSpec, Status, Tick, Unit,
};

use crate::node::{Feed, Signal};

/// Place of a stylus by the number of the tick: x, y, z in mm, z up.
pub type Motion = Arc<dyn Fn(u64) -> [f64; 3] + Send + Sync>;
/// Values by the number of the tick.
pub type Values = Arc<dyn Fn(u64, &mut [f64]) + Send + Sync>;
/// Samples from the sample of this number on.
pub type Samples = Arc<dyn Fn(u64, &mut [f32]) + Send + Sync>;
/// Bins of a frame by its number; false for a frame that does not come.
pub type Frames = Arc<dyn Fn(u64, &mut [f32]) -> bool + Send + Sync>;

/// Stiffness with which a played stylus presses on a floor at z = 0 \[N/mm\].
const STIFFNESS_N_PER_MM: f64 = 0.5;

/// Values that a node plays.
#[derive(Clone)]
enum What {
    Motion(Motion),
    Fed,
    Control(Values),
    Audio(Samples),
    Magnitude(Frames, FrameLayout),
    Signal(Signal, u64),
}

/// A kind that plays.
pub struct Played {
    descriptor: Descriptor,
    what: What,
}

impl Played {
    /// The input of a stylus whose place a case feeds.
    pub(crate) const PLACE: &str = "place";

    /// A stylus with the outputs of `like`: `position` is played, `force` is that of a floor at z = 0, and
    /// the others stay 0.
    pub fn stylus(name: &str, like: &Descriptor, motion: Motion) -> Arc<NodeKind> {
        let mut descriptor = Descriptor::new(name.to_owned(), "Plays a motion from memory.");
        descriptor.outputs = like.outputs.clone();
        Self { descriptor, what: What::Motion(motion) }.kind()
    }

    /// The same, with a place that the case feeds from tick to tick to input 0, valid or not.
    pub(crate) fn fed_stylus(name: &str, like: &Descriptor) -> Arc<NodeKind> {
        let place = Input::new(Self::PLACE, ShapeSpec::Control(3), Unit::MILLIMETRE).host_fed();
        let mut descriptor = Descriptor::new(name.to_owned(), "Passes on the places of a case.").input(place);
        descriptor.outputs = like.outputs.clone();
        Self { descriptor, what: What::Fed }.kind()
    }

    /// One value, which the case feeds to input 0, at the output `out`.
    pub(crate) fn fed(name: &str, unit: Unit) -> Arc<NodeKind> {
        let one = ShapeSpec::Control(1);
        let input = Input::new("value", one, unit.clone()).host_fed();
        let descriptor = Descriptor::new(name.to_owned(), "Passes on a value of a case.")
            .input(input)
            .output(Output::new("out", one, unit));
        Self { descriptor, what: What::Fed }.kind()
    }

    /// `count` values a tick, at the output `out`.
    pub fn control(name: &str, count: usize, unit: Unit, values: Values) -> Arc<NodeKind> {
        Self::of(name, ShapeSpec::Control(count), unit, What::Control(values))
    }

    /// Audio at the graph's rate, at the output `out`.
    pub fn audio(name: &str, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        Self::of(name, ShapeSpec::Audio(RateSpec::Graph), unit, What::Audio(samples))
    }

    /// The same, valid only while the host feeds a valid value to the input `hand`.
    pub(crate) fn audio_in_hand(name: &str, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        let hand = Input::new("hand", ShapeSpec::Control(1), Unit::NONE).host_fed();
        let output = Output::new("out", ShapeSpec::Audio(RateSpec::Graph), unit);
        let descriptor =
            Descriptor::new(name.to_owned(), "Plays what it is given.").input(hand).output(output);
        Self { descriptor, what: What::Audio(samples) }.kind()
    }

    /// Audio at a rate of its own, at the output `out`.
    pub(crate) fn audio_at(name: &str, rate_hz: u32, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        Self::of(name, ShapeSpec::Audio(RateSpec::Hz(rate_hz)), unit, What::Audio(samples))
    }

    /// Frames of magnitudes \[m/s^2\], one each time the node runs, at the output `out`.
    pub fn magnitudes(name: &str, layout: FrameLayout, frames: Frames) -> Arc<NodeKind> {
        let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
        Self::of(name, shape, Unit::METRE_PER_SECOND_SQUARED, What::Magnitude(frames, layout))
    }

    /// A random signal for an input like `output`.
    pub(crate) fn signal(name: String, output: Output, signal: Signal, seed: u64) -> Arc<NodeKind> {
        // The output depends on the tick alone.
        let descriptor = Descriptor::new(name, "Any signal.").output(output).resumes(Resume::Continue);
        Self { descriptor, what: What::Signal(signal, seed) }.kind()
    }

    fn of(name: &str, shape: ShapeSpec, unit: Unit, what: What) -> Arc<NodeKind> {
        let output = Output::new("out", shape, unit);
        let descriptor = Descriptor::new(name.to_owned(), "Plays what it is given.").output(output);
        Self { descriptor, what }.kind()
    }
}

impl Played {
    fn kind(self) -> Arc<NodeKind> {
        Arc::new(NodeKind::new(self.descriptor.clone(), move |setup| self.prepare(setup)))
    }

    fn prepare(&self, setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let place = |name: &str| self.descriptor.outputs.iter().position(|o| o.name == name);
        let feed = match (&self.what, setup.output(0)) {
            (What::Signal(signal, seed), Some(port)) => {
                Some(Feed::new(*signal, *seed, port, setup.tick_hz, setup.every))
            }
            _ => None,
        };
        Ok(Prepared::new(Player {
            what: self.what.clone(),
            position: place("position"),
            force: place("force"),
            rate_hz: setup.output_rate(0),
            every: u64::from(setup.every),
            feed,
        }))
    }
}

struct Player {
    what: What,
    position: Option<usize>,
    force: Option<usize>,
    rate_hz: u32,
    every: u64,
    feed: Option<Feed>,
}

impl Player {
    /// Writes the outputs of a stylus at a place.
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
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        match &self.what {
            What::Motion(motion) => self.put(tick, motion(tick.index)),
            What::Fed => match tick.inputs.control(0) {
                &[x, y, z] => self.put(tick, [x, y, z]),
                values => tick.outputs.control(0).copy_from_slice(values),
            },
            What::Control(values) => values(tick.index, tick.outputs.control(0)),
            What::Audio(samples) => {
                let first = tick.samples(self.rate_hz).start;
                samples(first, tick.outputs.audio(0));
            }
            What::Magnitude(frames, layout) => {
                let frame = tick.index / self.every;
                let start = layout.frame_rate.first_sample(frame, layout.rate_hz);
                let mut bins = [0.0; 4096];
                let Some(bins) = bins.get_mut(..layout.bins as usize) else { return Status::Error(1) };
                if !frames(frame, bins) {
                    return Status::Quiet;
                }
                tick.outputs.magnitude(0, frame, start).copy_from_slice(bins);
            }
            What::Signal(..) => {
                let (index, hz) = (tick.index, tick.tick_hz);
                for (buffer, feed) in tick.outputs.buffers().iter_mut().zip(&self.feed) {
                    feed.fill(buffer, index, hz, false);
                }
            }
        }
        Status::Continue
    }

    fn reset(&mut self) {}
}
