//! `delay`: the same signal, later. A cycle needs one.

use asperity_node::{
    Descriptor, Diagnostic, Input, Keep, Latency, Node, Output, Param, Prepared, Processor, Setup, Shape,
    ShapeSpec, State, Status, Tick, Unit, time,
};

/// Largest number of values of a control that are on their way.
const MOST_VALUES: u64 = 1 << 24;

/// Delays a signal by a whole number of samples (audio) or ticks (control).
pub struct Delay {
    line: Line,
    /// First sample, or tick, that has not come in.
    next: u64,
    closes_cycle: bool,
}

/// Values on their way. Position p holds the value that came in as sample (or tick) p modulo the length.
enum Line {
    Audio { ring: Vec<f32>, delay: u64, rate_hz: u32 },
    Control { ring: Vec<f64>, delay: u64, count: usize },
}

impl Node for Delay {
    fn descriptor() -> Descriptor {
        Descriptor::new("delay", "Delays a signal, audio or control; a cycle needs one. Silent at the start.")
            .input(Input::new("in", ShapeSpec::Like('s'), Unit::NONE).unit_of('u').doc("what is delayed"))
            .output(Output::new("out", ShapeSpec::Like('s'), Unit::NONE).unit_of('u').doc("the same, later"))
            .param(
                Param::number(
                    "delay_ms",
                    10.0,
                    0.0..=10_000.0,
                    "The delay, rounded to whole samples of audio or ticks of a control; in a cycle at least \
                     a tick.",
                )
                .unit("ms"),
            )
            .timing("the delay itself")
            .closes_cycles("delay_ms")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let seconds = setup.params.number("delay_ms") * 1e-3;
        let Some(shape) = setup.input(0).map(|p| p.shape) else {
            return Err(setup.params.node_error("nothing settles what this `delay` carries"));
        };
        let (rate, per_tick) = match shape {
            Shape::Audio { rate_hz } => (rate_hz, time::max_samples(rate_hz, setup.tick_hz) as u64),
            Shape::Control { .. } => (setup.tick_hz, 1),
            _ => return Err(setup.params.node_error("`delay` delays audio or a control, not frames")),
        };
        let delay = (seconds * f64::from(rate)).round() as u64;
        if setup.closes_cycle && delay < per_tick {
            let least = per_tick as f64 * 1e3 / f64::from(rate);
            return Err(setup
                .params
                .error(
                    "delay_ms",
                    format!("this delay closes a cycle and is shorter than a tick ({least:.4} ms)"),
                )
                .help(format!("at least {least:.4} ms, or a wiring without a cycle")));
        }
        if setup.every != 1 {
            return Err(setup.params.node_error("`delay` must run every tick").help("leave `every` out"));
        }
        if let Shape::Control { count } = shape
            && (delay + 1) * count as u64 > MOST_VALUES
        {
            let message = format!("this delay holds more than {MOST_VALUES} values of a control");
            return Err(setup.params.error("delay_ms", message).help("a shorter delay, or fewer values"));
        }
        let line = match shape {
            Shape::Audio { rate_hz } => {
                Line::Audio { ring: vec![0.0; (delay + per_tick) as usize], delay, rate_hz }
            }
            Shape::Control { count } => {
                Line::Control { ring: vec![0.0; (delay as usize + 1) * count], delay, count }
            }
            _ => unreachable!("refused above"),
        };
        let latency = Latency::samples(delay as i64, rate);
        let it = Self { line, next: 0, closes_cycle: setup.closes_cycle };
        Ok(Prepared::new(it).latency(latency).tail(latency))
    }
}

impl Processor for Delay {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if !self.closes_cycle {
            self.absorb(tick);
        }
        match &self.line {
            Line::Audio { ring, delay, rate_hz } => {
                let span = tick.samples(*rate_hz);
                for (y, at) in tick.outputs.audio(0).iter_mut().zip(span) {
                    *y = at.checked_sub(*delay).map_or(0.0, |p| ring[(p % ring.len() as u64) as usize]);
                }
            }
            Line::Control { ring, delay, count } => {
                let out = tick.outputs.control(0);
                match tick.index.checked_sub(*delay) {
                    Some(p) => {
                        let at = (p % (delay + 1)) as usize * count;
                        out.copy_from_slice(&ring[at..at + count]);
                    }
                    None => out.fill(0.0),
                }
            }
        }
        Status::Continue
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        match &mut self.line {
            Line::Audio { ring, rate_hz, .. } => {
                let (span, len) = (tick.samples(*rate_hz), ring.len() as u64);
                self.next = span.end;
                for (x, at) in tick.inputs.audio(0).iter().zip(span) {
                    ring[(at % len) as usize] = *x;
                }
            }
            Line::Control { ring, delay, count } => {
                self.next = tick.index + 1;
                let at = (tick.index % (*delay + 1)) as usize * *count;
                for (slot, x) in ring[at..].iter_mut().zip(tick.inputs.control(0)) {
                    *slot = *x;
                }
            }
        }
    }

    fn reset(&mut self) {
        match &mut self.line {
            Line::Audio { ring, .. } => ring.fill(0.0),
            Line::Control { ring, .. } => ring.fill(0.0),
        }
    }

    /// Values on their way. A longer or shorter delay takes over as many as it keeps itself. For the older
    /// values that a longer one should have kept, it has silence; the rest rises out of it in 10 ms.
    fn state(&mut self, state: &mut State<'_>) {
        match &mut self.line {
            Line::Audio { ring, rate_hz, .. } => {
                let kept = keep_line(state, ring, 1, &mut self.next);
                if state.restores() {
                    // The older samples, which a longer delay should have kept, are silence; it must not end
                    // with a step.
                    fade_in(ring, self.next, kept, u64::from(*rate_hz) / 100);
                }
            }
            Line::Control { ring, count, .. } => {
                keep_line(state, ring, *count, &mut self.next);
            }
        }
    }
}

/// Keeps a ring of places of `width` values each, oldest first, place p at p modulo the ring's; `next` is the
/// place after the newest. A restored ring may be longer or shorter. Returns how many places it had.
fn keep_line<T: Keep + Copy + Default>(
    state: &mut State<'_>,
    ring: &mut [T],
    width: usize,
    next: &mut u64,
) -> u64 {
    let own = ring.len().checked_div(width).unwrap_or(0) as u64;
    let (mut len, mut saved_width) = (own, width);
    state.keep(next).keep(&mut len).keep(&mut saved_width);
    state.require(saved_width == width && width > 0);
    if state.restores() {
        ring.fill(T::default());
    }
    if len == own && own > 0 {
        // The whole ring at once: it may be seconds long.
        let (newer, older) = ring.split_at_mut((*next % own) as usize * width);
        T::keep_each(older, state);
        T::keep_each(newer, state);
        return len;
    }
    for age in (1..=len).rev() {
        // A refused state ends here, whatever length it claims.
        if state.failed() {
            return len;
        }
        let place = next.checked_sub(age).filter(|_| age <= own).map(|p| (p % own) as usize * width);
        for i in 0..width {
            let slot = place.and_then(|at| ring.get_mut(at + i));
            let mut value = slot.as_deref().copied().unwrap_or_default();
            state.keep(&mut value);
            if let Some(slot) = slot {
                *slot = value;
            }
        }
    }
    len
}

/// Lets the oldest of `kept` samples begin from silence, over `over` of them, where the ring has room for
/// more.
fn fade_in(ring: &mut [f32], next: u64, kept: u64, over: u64) {
    let own = ring.len() as u64;
    if kept >= own {
        return;
    }
    let over = over.min(kept);
    for i in 0..over {
        // Sample `i` of what was kept, from the oldest on.
        let Some(p) = (next + i).checked_sub(kept) else { continue };
        if let Some(x) = ring.get_mut((p % own) as usize) {
            *x *= i as f32 / over as f32;
        }
    }
}
