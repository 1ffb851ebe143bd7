//! `force_limiter`: the limits of any force on a device that pushes back.

use crate::prelude::*;

/// The live parameters.
const LIVE: [&str; 2] = ["max_force_n", "slew_n_per_s"];
/// Time in which a force that becomes invalid fades out, and comes back \[s\].
const FADE_S: f64 = 0.02;

/// Limits a force to a largest length, keeping its direction, and limits its rate of change.
///
/// While its input is invalid, the force fades to 0 within 20 ms. It comes back as slowly.
pub struct ForceLimiter {
    /// Values of [`LIVE`]. A slew of 0 is none.
    live: [f64; 2],
    dt_s: f64,
    /// Runs of a fade, 1 at least.
    fade: u32,
    /// Number of these by which it is faded in; none before the first run.
    trust: Option<u32>,
    /// The force of the last run.
    last: [f64; 3],
    /// Runs in which the force, its change or its trust was held.
    held: [u64; 3],
}

/// Shortens a vector to at most `most`. Also returns whether it was longer.
fn held(v: [f64; 3], most: f64) -> ([f64; 3], bool) {
    // By the largest part, lest squares of large numbers overflow.
    let largest = v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    if largest == 0.0 {
        return (v, false);
    }
    let direction = v.map(|x| x / largest);
    let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
    if largest * length <= most { (v, false) } else { (direction.map(|x| x * (most / length)), true) }
}

/// A vector by a part of a whole; 0 where there is none.
fn scaled(v: [f64; 3], part: u32, whole: u32) -> [f64; 3] {
    let share = if whole > 0 { f64::from(part) / f64::from(whole) } else { 0.0 };
    v.map(|x| share * x)
}

impl Node for ForceLimiter {
    fn descriptor() -> Descriptor {
        Descriptor::new(
            "force_limiter",
            "Limits a force in size and rate of change, and removes it when its inputs are invalid.",
        )
        .input(control("force", 3, N).doc("sum of the effects' forces, x, y, z"))
        .output(control_out("force", 3, N).limited().doc("limited force, in the same direction"))
        .param(number("max_force_n", 3.3, 0.0..=100.0, "N").live().doc("Largest force."))
        .param(number("slew_n_per_s", 0.0, 0.0..=1e4, "N/s").live())
        .doc("Largest change of the force per second; 0 turns this limit off.")
        .timing("no latency; an invalid force fades out in 20 ms")
        .resumes(Resume::Never)
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let runs_hz = f64::from(setup.tick_hz) / f64::from(setup.every);
        Ok(Prepared::new(Self {
            live: LIVE.map(|name| setup.params.number(name)),
            dt_s: 1.0 / runs_hz,
            fade: (FADE_S * runs_hz).max(1.0) as u32,
            trust: None,
            last: [0.0; 3],
            held: [0; 3],
        }))
    }
}

impl Processor for ForceLimiter {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let [max_force_n, slew_n_per_s] = self.live;
        let wanted = <[f64; 3]>::try_from(tick.inputs.control(0)).unwrap_or_default();
        let trusted = tick.inputs.valid(0) && wanted.iter().all(|f| f.is_finite());
        let before = self.trust.unwrap_or(if trusted { self.fade } else { 0 });
        let trust = if trusted { self.fade.min(before + 1) } else { before.saturating_sub(1) };
        self.trust = Some(trust);
        if trusted {
            let (wanted, longer) = held(wanted, max_force_n);
            self.held[0] += u64::from(longer);
            let wanted = if trust < self.fade { scaled(wanted, trust, self.fade) } else { wanted };
            let change = std::array::from_fn(|i| wanted[i] - self.last[i]);
            let most = if slew_n_per_s > 0.0 { slew_n_per_s * self.dt_s } else { f64::INFINITY };
            let (change, faster) = held(change, most);
            self.held[1] += u64::from(faster);
            self.last = if faster { std::array::from_fn(|i| self.last[i] + change[i]) } else { wanted };
            // A largest force that was lowered counts before a change that is too large.
            self.last = held(self.last, max_force_n).0;
        } else {
            self.held[2] += 1;
            self.last = scaled(self.last, trust, before);
        }
        tick.outputs.control(0).iter_mut().zip(self.last).for_each(|(out, f)| *out = f);
        Status::Continue
    }

    fn reset(&mut self) {
        (self.trust, self.last) = (None, [0.0; 3]);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        self.live.get_mut(index).into_iter().for_each(|parameter| *parameter = value);
    }

    /// The force, and how far it is faded.
    fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.trust).keep(&mut self.last);
        state.require(self.trust.is_none_or(|t| t <= self.fade) && self.last.iter().all(|f| f.abs() <= 1e3));
    }

    fn facts(&mut self) -> Vec<Fact> {
        let names = ["limited_force", "limited_slew", "limited_trust"];
        names.into_iter().zip(self.held).map(|(name, count)| Fact::count(name, count)).collect()
    }
}
