//! Kinds that play from memory. Their names have spaces, so that no graph file can name them.

use std::sync::Arc;

use asperity_node::{
    Descriptor, FrameLayout, Input, LayoutSpec, NodeKind, Output, RateSpec, Resume, ShapeSpec, Status, Tick,
    Unit,
};

use crate::node::{Feed, Signal};
use crate::wrap::stateless;

/// Place of a stylus by the number of the tick: x, y, z in mm, z up.
pub type Motion = Arc<dyn Fn(u64) -> [f64; 3] + Send + Sync>;
/// Values by the number of the tick.
pub type Values = Arc<dyn Fn(u64, &mut [f64]) + Send + Sync>;
/// Samples from the sample of this number on.
pub type Samples = Arc<dyn Fn(u64, &mut [f32]) + Send + Sync>;
/// Bins of a frame by its number; false for a frame that does not come.
pub type Frames = Arc<dyn Fn(u64, &mut [f32]) -> bool + Send + Sync>;

/// Samples by their number.
pub(crate) fn samples(of: impl Fn(u64) -> f32 + Send + Sync + 'static) -> Samples {
    Arc::new(move |first, out| out.iter_mut().zip(first..).for_each(|(x, n)| *x = of(n)))
}

/// Stiffness with which a played stylus presses on a floor at z = 0 \[N/mm\].
const STIFFNESS_N_PER_MM: f64 = 0.5;

/// Makes kinds that play.
#[derive(Debug)]
pub struct Played;

/// A kind without inputs, with an output `out`.
fn source(name: &str, shape: ShapeSpec, unit: Unit) -> Descriptor {
    Descriptor::new(name.to_owned(), "Plays given samples.").output(Output::new("out", shape, unit))
}

/// A stylus with the outputs of `like`: `position` is where `place` says, `force` is that of a floor at z =
/// 0, and the others stay 0.
fn stylus(
    mut descriptor: Descriptor,
    like: &Descriptor,
    place: impl Fn(&Tick<'_>) -> [f64; 3] + Clone + Send + Sync + 'static,
) -> Arc<NodeKind> {
    descriptor.outputs = like.outputs.clone();
    let output = |name: &str| like.outputs.iter().position(|o| o.name == name);
    let (position, force) = (output("position"), output("force"));
    stateless(descriptor, move |_| {
        let place = place.clone();
        move |tick| {
            let at = place(tick);
            if let Some(output) = position {
                tick.outputs.control(output).copy_from_slice(&at);
            }
            if let Some(output) = force {
                tick.outputs.set(output, (-at[2] * STIFFNESS_N_PER_MM).max(0.0));
            }
            Status::Continue
        }
    })
}

impl Played {
    /// The input of a stylus whose place a case feeds.
    pub(crate) const PLACE: &str = "place";

    /// A stylus with the outputs of `like`: `position` is played, `force` is that of a floor at z = 0, and
    /// the others stay 0.
    pub fn stylus(name: &str, like: &Descriptor, motion: Motion) -> Arc<NodeKind> {
        let descriptor = Descriptor::new(name.to_owned(), "Plays a motion from memory.");
        stylus(descriptor, like, move |tick| motion(tick.index))
    }

    /// The same, with a place that the case feeds from tick to tick to input 0, valid or not.
    pub(crate) fn fed_stylus(name: &str, like: &Descriptor) -> Arc<NodeKind> {
        let place = Input::new(Self::PLACE, ShapeSpec::Control(3), Unit::MILLIMETRE).host_fed();
        let descriptor = Descriptor::new(name.to_owned(), "Passes on the places of a case.").input(place);
        stylus(descriptor, like, |tick| tick.inputs.control(0).try_into().unwrap_or_default())
    }

    /// One value, which the case feeds to input 0, at the output `out`.
    pub(crate) fn fed(name: &str, unit: Unit) -> Arc<NodeKind> {
        let one = ShapeSpec::Control(1);
        let input = Input::new("value", one, unit.clone()).host_fed();
        stateless(source(name, one, unit).input(input), |_| {
            |tick| {
                tick.outputs.set(0, tick.inputs.value(0));
                Status::Continue
            }
        })
    }

    /// `count` values a tick, at the output `out`.
    pub fn control(name: &str, count: usize, unit: Unit, values: Values) -> Arc<NodeKind> {
        stateless(source(name, ShapeSpec::Control(count), unit), move |_| {
            let values = values.clone();
            move |tick| {
                values(tick.index, tick.outputs.control(0));
                Status::Continue
            }
        })
    }

    /// Audio at the graph's rate, at the output `out`.
    pub fn audio(name: &str, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        sounds(source(name, ShapeSpec::Audio(RateSpec::Graph), unit), samples)
    }

    /// The same, valid only while the host feeds a valid value to the input `hand`.
    pub(crate) fn audio_in_hand(name: &str, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        let hand = Input::new("hand", ShapeSpec::Control(1), Unit::NONE).host_fed();
        sounds(source(name, ShapeSpec::Audio(RateSpec::Graph), unit).input(hand), samples)
    }

    /// Audio at a rate of its own, at the output `out`.
    pub(crate) fn audio_at(name: &str, rate_hz: u32, unit: Unit, samples: Samples) -> Arc<NodeKind> {
        sounds(source(name, ShapeSpec::Audio(RateSpec::Hz(rate_hz)), unit), samples)
    }

    /// Frames of magnitudes \[m/s^2\], one each time the node runs, at the output `out`.
    pub fn magnitudes(name: &str, layout: FrameLayout, frames: Frames) -> Arc<NodeKind> {
        let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
        stateless(source(name, shape, Unit::METRE_PER_SECOND_SQUARED), move |setup| {
            let (every, frames) = (u64::from(setup.every), frames.clone());
            let mut bins = vec![0.0; layout.bins as usize];
            move |tick| {
                let frame = tick.index / every;
                if !frames(frame, &mut bins) {
                    return Status::Quiet;
                }
                let start = layout.frame_rate.first_sample(frame, layout.rate_hz);
                tick.outputs.magnitude(0, frame, start).copy_from_slice(&bins);
                Status::Continue
            }
        })
    }

    /// A random signal for an input like `output`.
    pub(crate) fn signal(name: String, output: Output, signal: Signal, seed: u64) -> Arc<NodeKind> {
        // The output depends on the tick alone.
        let descriptor = Descriptor::new(name, "Any signal.").output(output).resumes(Resume::Continue);
        stateless(descriptor, move |setup| {
            let port = setup.output(0);
            let feed = port.map(|port| Feed::new(signal, seed, port, setup.tick_hz, setup.every));
            move |tick| {
                let (index, hz) = (tick.index, tick.tick_hz);
                for (buffer, feed) in tick.outputs.buffers().iter_mut().zip(&feed) {
                    feed.fill(buffer, index, hz, false);
                }
                Status::Continue
            }
        })
    }
}

/// A kind that plays samples.
fn sounds(descriptor: Descriptor, samples: Samples) -> Arc<NodeKind> {
    stateless(descriptor, move |setup| {
        let (rate_hz, samples) = (setup.output_rate(0), samples.clone());
        move |tick| {
            let first = tick.samples(rate_hz).start;
            samples(first, tick.outputs.audio(0));
            Status::Continue
        }
    })
}
