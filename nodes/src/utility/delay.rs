//! `delay`: the same signal, later. A cycle needs one.

use std::ops::Range;

use crate::prelude::*;

/// Largest number of values of a control that are on their way.
const MOST_VALUES: u64 = 1 << 24;

/// Delays a signal by a whole number of samples (audio) or ticks (control).
pub struct Delay {
    /// Places of `width` values on their way. Place p holds what came in as sample (or tick) p modulo their
    /// number.
    ring: Vec<f64>,
    width: usize,
    delay: u64,
    /// Rate of audio; `None` for a control.
    rate_hz: Option<u32>,
    /// First sample, or tick, that has not come in.
    next: u64,
    closes_cycle: bool,
}

impl Node for Delay {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "delay",
            "Delays audio or a control. A cycle in a graph needs one. Silent at the start.",
        )
        .input(like("in").doc("signal to delay"))
        .output(like_out("out").doc("delayed signal"))
        .param(
            number("delay_ms", 10.0, 0.0..=10_000.0, "ms")
                .doc("Delay, rounded to samples (audio) or ticks (control). In a cycle at least one tick."),
        )
        .timing("latency `delay_ms`")
        .closes_cycles("delay_ms")
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let seconds = setup.params.number("delay_ms") * 1e-3;
        let Some(shape) = setup.input(0).map(|p| p.shape) else {
            return Err(setup.params.node_error("the signal type of this `delay` cannot be determined"));
        };
        let (rate_hz, width) = match shape {
            Shape::Audio { rate_hz } => (Some(rate_hz), 1),
            Shape::Control { count } => (None, count),
            _ => return Err(setup.params.node_error("`delay` delays audio or a control, not frames")),
        };
        let rate = rate_hz.unwrap_or(setup.tick_hz);
        let per_tick = rate_hz.map_or(1, |hz| time::max_samples(hz, setup.tick_hz) as u64);
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
        let values = (delay + per_tick) * width as u64;
        if values > MOST_VALUES {
            let message = format!("this delay holds more than {MOST_VALUES} values of a control");
            return Err(setup.params.error("delay_ms", message).help("a shorter delay, or fewer values"));
        }
        let ring = vec![0.0; values as usize];
        let latency = Latency::samples(delay as i64, rate);
        let it = Self { ring, width, delay, rate_hz, next: 0, closes_cycle: setup.closes_cycle };
        Ok(Prepared::new(it).latency(latency).tail(latency))
    }
}

impl Delay {
    /// Samples, or the tick, of a tick.
    fn span(&self, tick: &Tick<'_>) -> Range<u64> {
        self.rate_hz.map_or(tick.index..tick.index + 1, |hz| tick.samples(hz))
    }

    /// Where value `k` of the places from `start` on, after this delay, lies in the ring.
    fn slot(&self, start: u64, k: usize, delay: u64) -> Option<usize> {
        let place = (start + (k / self.width) as u64).checked_sub(delay)?;
        let places = (self.ring.len() / self.width) as u64;
        Some((place % places) as usize * self.width + k % self.width)
    }

    fn put(&mut self, start: u64, k: usize, x: f64) {
        if let Some(slot) = self.slot(start, k, 0) {
            self.ring[slot] = x;
        }
    }
}

impl Processor for Delay {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if !self.closes_cycle {
            self.absorb(tick);
        }
        let start = self.span(tick).start;
        let past = |k| self.slot(start, k, self.delay).map_or(0.0, |slot| self.ring[slot]);
        if self.rate_hz.is_some() {
            tick.outputs.audio(0).iter_mut().enumerate().for_each(|(k, y)| *y = past(k) as f32);
        } else {
            tick.outputs.control(0).iter_mut().enumerate().for_each(|(k, y)| *y = past(k));
        }
        Status::Continue
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        let span = self.span(tick);
        self.next = span.end;
        if self.rate_hz.is_some() {
            tick.inputs.audio(0).iter().enumerate().for_each(|(k, x)| self.put(span.start, k, f64::from(*x)));
        } else {
            tick.inputs.control(0).iter().enumerate().for_each(|(k, x)| self.put(span.start, k, *x));
        }
    }

    fn reset(&mut self) {
        self.ring.fill(0.0);
    }

    /// Values on their way. A longer or shorter delay takes over as many as it keeps itself. For the older
    /// values that a longer one should have kept, it has silence; the rest rises out of it in 10 ms.
    fn state(&mut self, state: &mut State<'_>) {
        let kept = keep_line(state, &mut self.ring, self.width, &mut self.next);
        if let Some(hz) = self.rate_hz
            && state.restores()
        {
            // The older samples, which a longer delay should have kept, are silence; it must not end with a
            // step.
            fade_in(&mut self.ring, self.next, kept, u64::from(hz) / 100);
        }
    }
}

/// Keeps a ring of places of `width` values each, oldest first, place p at p modulo the ring's; `next` is the
/// place after the newest. A restored ring may be longer or shorter. Returns how many places it had.
fn keep_line(state: &mut State<'_>, ring: &mut [f64], width: usize, next: &mut u64) -> u64 {
    let own = ring.len().checked_div(width).unwrap_or(0) as u64;
    let (mut len, mut saved_width) = (own, width);
    state.keep(next).keep(&mut len).keep(&mut saved_width);
    state.require(saved_width == width && width > 0);
    if state.restores() {
        ring.fill(0.0);
    }
    if len == own && own > 0 {
        // The whole ring at once: it may be seconds long.
        let (newer, older) = ring.split_at_mut((*next % own) as usize * width);
        f64::keep_each(older, state);
        f64::keep_each(newer, state);
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
fn fade_in(ring: &mut [f64], next: u64, kept: u64, over: u64) {
    let own = ring.len() as u64;
    if kept >= own {
        return;
    }
    let over = over.min(kept);
    for i in 0..over {
        // Sample `i` of what was kept, from the oldest on.
        let Some(p) = (next + i).checked_sub(kept) else { continue };
        if let Some(x) = ring.get_mut((p % own) as usize) {
            *x = f64::from(*x as f32 * (i as f32 / over as f32));
        }
    }
}
