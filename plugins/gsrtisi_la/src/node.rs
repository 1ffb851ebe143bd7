//! The node: frames in and out at their places, also if one is missing.

use asperity_sdk::{
    Descriptor, Diagnostic, Fact, FrameClock, FrameLayout, Input, Latency, LayoutSpec, Node, Output, Param,
    Prepared, Processor, Setup, Shape, ShapeSpec, State, Status, Tick, Unit,
};

use crate::kernel::Estimator;

/// Gives frames of magnitudes phases by iterating on the frames that are not put out yet (Zhu,
/// Beauregard, Wyse 2007).
pub struct GsrtisiLa {
    kernel: Estimator,
    layout: FrameLayout,
    clock: FrameClock,
    look_ahead: u32,
    /// Number of the newest frame.
    newest: Option<u64>,
    /// Frames to come until the last real one is out.
    waiting: u32,
    bad: u64,
}

impl Node for GsrtisiLa {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "gsrtisi_la",
            "Real-time iterative spectrogram inversion with look-ahead: Griffin-Lim on the frames that are \
             not put out yet.",
        )
        .input(
            Input::new("magnitude", ShapeSpec::Magnitude(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("magnitudes of the next frame"),
        )
        .output(
            Output::new("spectrum", ShapeSpec::Spectrum(LayoutSpec::Of('l')), Unit::NONE)
                .unit_of('u')
                .doc("magnitudes with phases, `look_ahead` frames later"),
        )
        .param(Param::integer("look_ahead", 4, 0..=16, "Look-ahead in frames. It adds latency."))
        .param(Param::integer(
            "iterations",
            4,
            1..=20,
            "Rounds over all frames that are not put out, for each that comes.",
        ))
        .timing("`look_ahead` frames")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let Some(Shape::Magnitude(layout)) = setup.input(0).map(|p| p.shape) else {
            return Err(setup.params.node_error("the layout of the frames cannot be determined"));
        };
        let look_ahead = setup.params.integer("look_ahead").clamp(0, 16) as u32;
        let iterations = setup.params.integer("iterations").max(1) as usize;
        let rate = layout.frame_rate;
        let hop = (u64::from(layout.rate_hz) * u64::from(rate.den())).div_ceil(u64::from(rate.num()));
        let hop = hop.min(u64::from(layout.length));
        let kernel =
            Estimator::new(layout.length, layout.bins as usize, hop, look_ahead as usize, iterations);
        let clock = setup.frame_clock(rate);
        let latency = Latency::ratio(i64::from(look_ahead) * i64::from(rate.den()), i64::from(rate.num()));
        let it = Self { kernel, layout, clock, look_ahead, newest: None, waiting: 0, bad: 0 };
        Ok(Prepared::new(it).latency(latency).tail(latency))
    }
}

impl Processor for GsrtisiLa {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return self.flush(tick) };
        let passed = self.newest.is_some_and(|newest| match self.waiting {
            0 => frame.index <= newest,
            _ => newest.checked_add(1) != Some(frame.index),
        });
        if passed {
            // The places of those that wait have gone by, or this is another stream.
            self.kernel.reset();
        }
        self.waiting = self.look_ahead;
        self.step(tick, frame.bins, frame.index, frame.start)
    }

    fn reset(&mut self) {
        self.kernel.reset();
        (self.newest, self.waiting) = (None, 0);
    }

    fn state(&mut self, state: &mut State<'_>) {
        let mut look_ahead = self.look_ahead;
        state.keep(&mut look_ahead).keep(&mut self.newest).keep(&mut self.waiting);
        state.require(look_ahead == self.look_ahead && self.waiting <= look_ahead);
        self.kernel.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}

impl GsrtisiLa {
    /// A tick without a frame: where one was to come, silence takes its place until the last real frame
    /// is out.
    fn flush(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.waiting == 0 {
            return Status::Quiet;
        }
        let due = self.clock.frame(tick.index).filter(|&due| self.newest.is_some_and(|n| due > n));
        let Some(index) = due else { return Status::Quiet };
        self.waiting -= 1;
        let start = self.layout.frame_rate.first_sample(index, self.layout.rate_hz);
        self.step(tick, &[], index, start)
    }

    /// Takes one frame and puts out the one that is due, in the place of the one that came.
    fn step(&mut self, tick: &mut Tick<'_>, bins: &[f32], index: u64, start: u64) -> Status {
        self.newest = Some(index);
        let place = index.saturating_add(u64::from(self.look_ahead));
        let place = self.layout.frame_rate.first_sample(place, self.layout.rate_hz);
        self.bad += self.kernel.push(bins, place) as u64;
        if !self.kernel.answers() {
            return Status::Quiet;
        }
        self.kernel.answer(tick.outputs.spectrum(0, index, start));
        Status::Continue
    }
}
