//! `level`: a gate that follows a level.

use super::path::Parts;
use crate::prelude::*;
use asperity_dsp::filter::Sample;

const IN: usize = 0;
const LEVEL: usize = 1;
const SLOT: usize = 2;

/// Multiplies audio by a level. Through the samples of a tick, it goes in a straight line from the last
/// tick's level to this one's.
///
/// Nodes that serve only its audio input sleep while no slot is on, or while the level is 0 and was 0 in the
/// last tick. An invalid level or slot counts as a level of 0.
pub struct Level {
    rate_hz: u32,
    /// The last tick's level; none at the beginning, which has no ramp.
    last: Option<f64>,
}

impl Level {
    /// The levels at the beginning and at the end of the tick; none where no slot is on.
    fn levels(&self, inputs: &Inputs<'_>) -> Option<[f64; 2]> {
        // NaN is not at least 0.
        let on = inputs.value(SLOT) >= 0.0;
        let trusted = inputs.valid(LEVEL) && inputs.valid(SLOT);
        let level = inputs.value(LEVEL);
        let level = if trusted && level > 0.0 { level.min(1.0) } else { 0.0 };
        on.then(|| [self.last.unwrap_or(level), level])
    }
}

impl Node for Level {
    fn descriptor() -> Descriptor {
        Descriptor::new("level", "Multiplies audio by a level. Nodes before it sleep while the level is 0.")
            .input(audio("in").doc("audio to scale"))
            .input(control("level", 1, ONE).or(1.0))
            .doc("level from 0 to 1; a change is a linear ramp over the tick")
            .input(control("slot", 1, ONE).or(0.0))
            .doc("below 0: silent, and the next level starts from 0")
            .output(audio_out("out").doc("scaled audio"))
            .gates("in")
            .timing("no latency; a level is reached at the end of its tick")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self { rate_hz: setup.input_rate(IN), last: None }))
    }
}

impl Processor for Level {
    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        self.levels(&tick.inputs).is_some_and(|[from, to]| from > 0.0 || to > 0.0)
    }

    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let levels = self.levels(&tick.inputs);
        let [from, to] = levels.unwrap_or([0.0; 2]);
        self.last = Some(to);
        let silent = tick.inputs.buffer(IN).is_none_or(|b| b.is_silent());
        if silent || (from == 0.0 && to == 0.0) {
            return Status::Quiet;
        }
        let first = tick.samples(self.rate_hz).start;
        let parts = Parts::new(tick.index, first, self.rate_hz, tick.tick_hz);
        let (input, out) = (tick.inputs.audio(IN), tick.outputs.audio(0));
        if from == 1.0 && to == 1.0 {
            out.iter_mut().zip(input).for_each(|(y, x)| *y = *x);
            return Status::Continue;
        }
        for (n, (y, x)) in out.iter_mut().zip(input).enumerate() {
            *y = f32::narrow((from + (to - from) * parts.at(n)) * f64::from(*x));
        }
        Status::Continue
    }

    fn reset(&mut self) {
        self.last = None;
    }

    /// The last level.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.last);
        state.require(self.last.is_none_or(|level| (0.0..=1.0).contains(&level)));
    }
}
