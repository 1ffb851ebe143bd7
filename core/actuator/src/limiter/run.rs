//! The limiter's loop over samples. The parent module describes its stages.

use asperity_state::State;

use super::super::Plant;
use super::{LimiterReport, TINY};

/// Constants of a limiter.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    pub(super) peak: f64,
    pub(super) slew: f64,
    pub(super) ceiling: f64,
    pub(super) dc: f64,
    pub(super) release: f64,
    pub(super) hold: f64,
    pub(super) mute: f64,
    pub(super) unmute: f64,
    pub(super) peak_current: f64,
    // Squares of currents.
    pub(super) rated: f64,
    pub(super) aim: f64,
    pub(super) heat: f64,
    pub(super) short: f64,
    pub(super) wall: f64,
    pub(super) budget: f64,
    // Squares of w_n x.
    pub(super) swing_aim: f64,
    pub(super) swing_wall: f64,
    // Square of a current, and of a swing over that of a current: swings that may become heat.
    pub(super) coolness: f64,
    pub(super) per_warmth: f64,
    // 1 / (2 T) and c / mu, both over k_f / mu.
    pub(super) approach: f64,
    pub(super) drag: f64,
    // Speed that a current gives before it can end: per ampere, and per ampere squared.
    pub(super) kick: f64,
    pub(super) creep: f64,
    pub(super) natural: f64,
    pub(super) resistance: f64,
    pub(super) emf: f64,
}

/// State of a limiter.
#[derive(Clone, Debug)]
pub(super) struct Run {
    pub(super) report: LimiterReport,
    pub(super) good: f64,
    pub(super) bearable: f64,
    pub(super) dc: f64,
    pub(super) gain: f64,
    pub(super) mute: f64,
    // The coil under u, and under y.
    pub(super) asked: Plant,
    pub(super) power: f64,
    pub(super) given: Given,
}

/// The coil under all samples so far.
#[derive(Clone, Debug)]
pub(super) struct Given {
    pub(super) plant: Plant,
    pub(super) last: f64,
    // Squares of currents.
    pub(super) heat: f64,
    pub(super) hottest: f64,
    // w_n x.
    pub(super) farthest: f64,
}

/// A sample within the limits, and which limits acted.
pub(super) struct Held {
    pub(super) sample: f64,
    peak: bool,
    slew: bool,
    rms: bool,
    stroke: bool,
}

impl Given {
    /// At rest and cold.
    pub(super) fn new(plant: Plant) -> Self {
        Self { plant, last: 0.0, heat: 0.0, hottest: 0.0, farthest: 0.0 }
    }

    /// The nearest sample to `want` that is allowed: walls for heat and stroke, then peak and slew,
    /// exactly. With `meek`, a drive against `want` becomes 0.
    #[inline(always)]
    pub(super) fn hold<const VOLTAGE: bool>(&self, f: &Fixed, mut want: f64, meek: bool) -> Held {
        let (mut over_peak, mut over_rms, mut over_stroke, mut over_slew) = (false, false, false, false);
        // Walls, on the current that `want` would drive.
        let [gx, gv, gi] = self.plant.state;
        let current = if VOLTAGE { (want - f.emf * gv) / f.resistance } else { want };
        let mut bounded = current;
        // Speeds: once the present current has gone down as fast as it may; if it lasted for the lag
        // first; if `current` flowed for the lag, which tells whether it turns the mover around.
        let ended = gv + f.creep * gi * gi.abs();
        let lasted = ended + f.kick * gi;
        let kicked = ended + f.kick * current;
        let work = larger(current * lasted, current * kicked);
        let square = lasted * lasted;
        // The damping counts at the least of the speeds. A swing may still become heat.
        let wall = if VOLTAGE {
            smaller(f.swing_wall, (f.coolness - self.heat) * f.per_warmth)
        } else {
            f.swing_wall
        };
        let room = (wall - gx * gx - square) * f.approach + f.drag * smaller(square, lasted * gv);
        if work > 0.0 && work > room {
            bounded = held_back(current, ended, lasted, room.max(0.0), f.kick);
            over_stroke = true;
        }
        let square = f.rated + (f.rated - self.heat) * f.wall;
        if bounded * bounded > square {
            bounded = square.max(0.0).sqrt().copysign(bounded);
            over_rms = true;
        }
        if VOLTAGE && bounded.abs() > f.peak_current {
            bounded = f.peak_current.copysign(bounded);
            over_peak = true;
        }
        if bounded != current {
            let held = if VOLTAGE { f.resistance * bounded + f.emf * gv } else { bounded };
            want = if meek && held * want <= 0.0 { 0.0 } else { held };
        }

        // Peak and slew, exactly.
        if want.abs() > f.peak {
            want = f.peak.copysign(want);
            over_peak = true;
        }
        if (want - self.last).abs() > f.slew {
            want = self.last + f.slew.copysign(want - self.last);
            over_slew = true;
        }
        Held { sample: want, peak: over_peak, slew: over_slew, rms: over_rms, stroke: over_stroke }
    }

    /// Gives a sample to the coil.
    #[inline(always)]
    pub(super) fn take<const VOLTAGE: bool>(&mut self, f: &Fixed, y: f64) {
        let gi = self.plant.state[2];
        self.last = y;
        self.plant.advance(y);
        // Heats by the larger current of both ends of the interval.
        let end = self.plant.state[2];
        self.heat += f.heat * (if VOLTAGE { (end * end).max(gi * gi) } else { end * end } - self.heat);
        self.hottest = self.hottest.max(self.heat);
        self.farthest = self.farthest.max(self.plant.state[0].abs());
    }

    /// Ends tails before they become denormal.
    pub(super) fn settle(&mut self) {
        self.plant.state.iter_mut().chain([&mut self.heat]).for_each(end_tail);
    }

    /// Cools a coil at rest.
    pub(super) fn rest(&mut self, f: &Fixed, samples: usize) {
        if self.heat != 0.0 {
            for _ in 0..samples {
                self.heat += f.heat * (0.0 - self.heat);
            }
        }
    }
}

impl Run {
    /// At rest and cold.
    pub(super) fn new(mut plant: Plant) -> Self {
        plant.reset();
        Self {
            report: LimiterReport { least_gain: 1.0, ..LimiterReport::default() },
            good: 0.0,
            bearable: 1.0,
            dc: 0.0,
            gain: 1.0,
            mute: 1.0,
            asked: plant.clone(),
            power: 0.0,
            given: Given::new(plant),
        }
    }

    pub(super) fn block<const VOLTAGE: bool>(
        &mut self,
        f: &Fixed,
        muted: bool,
        input: &[f32],
        output: &mut [f32],
    ) {
        let known = input.len().min(output.len());
        let (head, tail) = output.split_at_mut(known);
        for (y, x) in head.iter_mut().zip(input) {
            *y = self.sample::<VOLTAGE>(f, muted, f64::from(*x));
        }
        for y in tail {
            *y = self.sample::<VOLTAGE>(f, muted, f64::NAN);
        }
    }

    pub(super) fn rests(&self) -> bool {
        let zeros = [self.good, self.dc, self.given.last, self.power];
        let states = self.asked.state.iter().chain(&self.given.plant.state);
        zeros.iter().chain(states).all(|x| x.to_bits() == 0)
            && [self.gain, self.bearable, self.mute].iter().all(|x| *x == 1.0)
    }

    /// Advances through silence at rest: the coil cools.
    pub(super) fn rest(&mut self, f: &Fixed, samples: usize) {
        self.report.samples += samples as u64;
        self.given.rest(f, samples);
    }

    #[inline(always)]
    fn sample<const VOLTAGE: bool>(&mut self, f: &Fixed, muted: bool, x: f64) -> f32 {
        let count = &mut self.report;
        count.samples += 1;
        if x.is_finite() {
            self.good = x.clamp(-f.ceiling, f.ceiling);
        } else {
            self.good *= f.hold;
            count.not_finite += 1;
        }
        if self.bearable < self.gain {
            self.gain = self.bearable;
            count.least_gain = count.least_gain.min(self.gain);
        } else if self.gain < 1.0 {
            self.gain += f.release * (self.bearable - self.gain);
            // The last step back, 100 dB down.
            if self.gain > 0.99999 {
                self.gain = 1.0;
            }
        }
        count.reduced += u64::from(self.gain < 1.0);
        let u = self.good - self.dc;
        let mut want = u * self.gain;

        // The input's effect on the coil gives the gain for the next sample. So roots and divisions are
        // off the critical path. The bounds below protect this sample.
        let (mut over_peak, mut over_rms, mut over_stroke) = (u.abs() > f.peak, false, false);
        self.asked.advance(u);
        let [ax, av, ai] = self.asked.state;
        self.power += f.short * (ai * ai - self.power);
        // The squared gain as a fraction, so that one root is enough.
        let (mut over, mut under) = (1.0, 1.0);
        let allowed = f.aim + (f.aim - self.given.heat) * f.budget;
        if self.power > allowed {
            (over, under) = (allowed.max(0.0), self.power);
            over_rms = true;
        }
        let swing = ax * ax + av * av;
        if swing > f.swing_aim {
            if f.swing_aim * under < over * swing {
                (over, under) = (f.swing_aim, swing);
            }
            over_stroke = true;
        }
        if VOLTAGE && ai.abs() > f.peak_current {
            let (most, square) = (f.peak_current * f.peak_current, ai * ai);
            if most * under < over * square {
                (over, under) = (most, square);
            }
            over_peak = true;
        }
        self.bearable = if over < under { (over / under).sqrt() } else { 1.0 };
        if u.abs() > f.peak {
            self.bearable = self.bearable.min(f.peak / u.abs());
        }

        // Muting.
        if muted || self.mute < 1.0 {
            self.mute = if muted { (self.mute - f.mute).max(0.0) } else { (self.mute + f.unmute).min(1.0) };
            want *= self.mute;
            count.muted += u64::from(self.mute < 1.0);
        }

        // Muting never applies a voltage of its own to hold the current down.
        let held = self.given.hold::<VOLTAGE>(f, want, self.mute < 1.0);
        count.peak += u64::from(over_peak || held.peak);
        count.rms += u64::from(over_rms || held.rms);
        count.stroke += u64::from(over_stroke || held.stroke);
        count.slew += u64::from(held.slew);

        let given = held.sample as f32;
        let y = f64::from(given);
        self.dc += f.dc * y;
        self.given.take::<VOLTAGE>(f, y);
        count.largest = count.largest.max(y.abs());
        given
    }

    pub(super) fn state(&mut self, state: &mut State<'_>) {
        state.keep(&mut self.good).keep(&mut self.bearable).keep(&mut self.dc).keep(&mut self.gain);
        let given = &mut self.given;
        state.keep(&mut self.mute).keep(&mut given.last).keep(&mut self.power).keep(&mut given.heat);
        self.asked.state(state);
        given.plant.state(state);
    }

    /// Holds a restored state to the limits. False if that is impossible.
    pub(super) fn hold(&mut self, f: &Fixed) -> bool {
        // NaN is not within.
        let parts = [self.gain, self.bearable, self.mute].iter().all(|x| (0.0..=1.0).contains(x));
        let squares = [self.power, self.given.heat].iter().all(|x| (0.0..1e18).contains(x));
        let signals = [self.good, self.dc, self.given.last].iter().all(|x| x.is_finite());
        self.good = self.good.clamp(-f.ceiling, f.ceiling);
        self.given.last = self.given.last.clamp(-f.peak, f.peak);
        self.settle(f);
        parts && squares && signals
    }

    /// Ends tails before they become denormal. Also bounds values that no known input drives far.
    pub(super) fn settle(&mut self, f: &Fixed) {
        self.dc = self.dc.clamp(-2.0 * f.ceiling, 2.0 * f.ceiling);
        self.given.settle();
        for x in self.asked.state.iter_mut().chain([&mut self.good, &mut self.dc, &mut self.power]) {
            end_tail(x);
        }
    }
}

fn end_tail(x: &mut f64) {
    if x.abs() < TINY {
        *x = 0.0;
    }
}

/// The largest current towards `current` whose work is at most `room`: at `lasted`, and at the speed it
/// gives before it can end. Work and room are over k_f / mu.
#[inline(always)]
fn held_back(current: f64, ended: f64, lasted: f64, room: f64, kick: f64) -> f64 {
    let along = 1.0f64.copysign(current);
    let (ended, lasted) = (ended * along, lasted * along);
    // The positive root of kick I^2 + ended I = room.
    let mut most = ((ended * ended + 4.0 * kick * room).sqrt() - ended) / (2.0 * kick);
    if lasted > 0.0 {
        most = most.min(room / lasted);
    }
    along * most.min(current.abs())
}

// One instruction each. Neither has to be right for NaN.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}
