//! The node: frames in and out at their places, also if one is missing.

use asperity_sdk::{
    Descriptor, Diagnostic, Fact, FrameClock, FrameLayout, Input, Latency, LayoutSpec, Node, Output, Param,
    Prepared, Processor, Setup, Shape, ShapeSpec, State, Status, Tick, Unit,
};

use crate::kernel::HeapIntegration;

/// Gives frames of magnitudes the phases that their slopes ask for (Prusa, Sondergaard 2016).
pub struct Rtpghi {
    kernel: HeapIntegration,
    layout: FrameLayout,
    clock: FrameClock,
    look_ahead: bool,
    /// Number and start of the newest frame.
    newest: Option<(u64, u64)>,
    /// The newest frame has not been put out.
    waiting: bool,
    /// Start of the last output.
    before: Option<u64>,
    bad: u64,
}

impl Node for Rtpghi {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "rtpghi",
            "Phase gradient heap integration: phases from the slopes of the log magnitudes, \
             the strongest bins first.",
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
        .param(Param::integer(
            "look_ahead",
            0,
            0..=1,
            "Look-ahead in frames. 0 estimates slopes over time from the past alone.",
        ))
        .param(Param::number(
            "tolerance",
            1e-6,
            1e-9..=0.1,
            "Bins under this part of the largest get a random phase.",
        ))
        .param(
            Param::integer(
                "seed",
                1,
                0..=i64::MAX,
                "Seed of the random phases; left out, derived from the graph's seed.",
            )
            .optional(),
        )
        .timing("`look_ahead` frames")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let Some(Shape::Magnitude(layout)) = setup.input(0).map(|p| p.shape) else {
            return Err(setup.params.node_error("the layout of the frames cannot be determined"));
        };
        let seed = setup.params.get_integer("seed").map_or(setup.seed, |s| s as u64);
        let tolerance = setup.params.number("tolerance");
        let (look_ahead, rate) = (setup.params.integer("look_ahead") > 0, layout.frame_rate);
        let latency = Latency::ratio(i64::from(look_ahead) * i64::from(rate.den()), i64::from(rate.num()));
        let it = Self {
            kernel: HeapIntegration::new(layout.length, layout.bins as usize, tolerance, seed),
            clock: setup.frame_clock(layout.frame_rate),
            layout,
            look_ahead,
            newest: None,
            waiting: false,
            before: None,
            bad: 0,
        };
        Ok(Prepared::new(it).latency(latency).tail(latency))
    }
}

impl Processor for Rtpghi {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let Some(frame) = tick.inputs.magnitude(0) else { return self.flush(tick) };
        let advance = match self.newest {
            Some((index, start)) if frame.index > index => {
                u32::try_from(frame.start.saturating_sub(start)).unwrap_or(u32::MAX)
            }
            // Time went back: this is another stream.
            _ => 0,
        };
        let next = self.newest.is_some_and(|(index, _)| index.checked_add(1) == Some(frame.index));
        if self.waiting && !next {
            // Its place has gone by.
            self.kernel.reset();
        }
        self.newest = Some((frame.index, frame.start));
        self.bad += self.kernel.push(frame.bins, advance) as u64;
        if self.look_ahead && !(std::mem::replace(&mut self.waiting, true) && next) {
            return Status::Quiet;
        }
        self.put_out(tick, frame.index, frame.start, usize::from(self.look_ahead));
        Status::Continue
    }

    fn reset(&mut self) {
        self.kernel.reset();
        (self.newest, self.waiting, self.before) = (None, false, None);
    }

    fn state(&mut self, state: &mut State<'_>) {
        let mut look_ahead = self.look_ahead;
        state.keep(&mut look_ahead).keep(&mut self.newest).keep(&mut self.waiting).keep(&mut self.before);
        self.kernel.state(state);
        state.require(look_ahead == self.look_ahead && (look_ahead || !self.waiting));
    }

    fn facts(&mut self) -> Vec<Fact> {
        vec![Fact::count("bad_magnitudes", self.bad)]
    }
}

impl Rtpghi {
    /// A tick without a frame: where one was to come, the one that waits for it goes out without it.
    fn flush(&mut self, tick: &mut Tick<'_>) -> Status {
        if !self.waiting {
            return Status::Quiet;
        }
        let due = self.clock.frame(tick.index);
        if let Some(index) = due.filter(|&due| self.newest.is_some_and(|(newest, _)| due > newest)) {
            self.waiting = false;
            let start = self.layout.frame_rate.first_sample(index, self.layout.rate_hz);
            self.put_out(tick, index, start, 0);
        }
        Status::Continue
    }

    fn put_out(&mut self, tick: &mut Tick<'_>, index: u64, start: u64, age: usize) {
        let before = self.before.replace(start).unwrap_or(start);
        let advance = u32::try_from(start.saturating_sub(before)).unwrap_or(u32::MAX);
        self.kernel.find(age, advance, index, tick.outputs.spectrum(0, index, start));
    }
}
