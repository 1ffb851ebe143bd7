//! Motions that no hand makes, and places that come late, twice or not at all.

use std::f64::consts::{FRAC_PI_4, SQRT_2, TAU};

use asperity_dsp::low_pass::opened_hz;
use asperity_node::{Role, random};

use crate::case::{Case, Family, Figures, Found, Stop, not_applicable};
use crate::rig::{Rig, values};
use crate::subject::Subject;
use crate::wall::Wall;

const MOTION: Family = Family("motion");

pub(super) const CASES: &[Case] = &[
    MOTION.graph(
        "teleport",
        teleport,
        "the stylus goes round a circle at 60 mm/s, pressed down. It jumps by 200 mm from one tick to the \
         next and back",
        "everything is finite and no node fails. After 1 s the drive has the level of a run without the \
         jump, within 1 dB (as draws of the same noise may differ) or 1 % of its peak",
    ),
    MOTION.graph(
        "one_count_at_rest",
        one_count,
        "a hand rests on a wall. x and y of its sensor flicker by one count D = 0.055 mm (27.5 mm/s at \
         500 Hz before the filter). They flicker together, alternately, at every period up to 60 ticks, \
         and at random",
        "the gate stays shut. Behind a low-pass with corner w the speed is at most 1.05 sqrt(2) D w \
         e^(-pi/4), 4.7 mm/s at 20 Hz. Where the corner rises with speed, w is the corner at the speed \
         that opens the gate",
    ),
    MOTION.graph(
        "around_the_gate",
        around,
        "after a start of 0.5 s the stylus moves 2 % slower than the gate opens (4.9 of 5 mm/s), then 2 % \
         faster, then alternates. A sensor with steps of 0.055 mm sees 0.5 to 1.1 of that speed along, \
         between and across its steps",
        "the gate stays shut at the slower speed. At the faster it opens once, within 0.3 s, and does not \
         shut again between the two. In steps, whose ripple (up to 3 mm/s from crest to crest behind a 20 \
         Hz filter) may open it sooner, it changes at most once",
    ),
    MOTION.graph(
        "sampling_times",
        sampling,
        "a circle at 60 mm/s is read up to a quarter of a tick off its time, or now and then a whole tick \
         late, or each place twice",
        "no node fails and the gate stays open. The speed is within 30 %: at 500 Hz, a 20 Hz filter makes \
         12 % of a late tick and 14 % of jitter. Below 190 Hz its step response w e^(-pi/4) T is larger \
         and counts instead. After 1 s the drive has the level of an undisturbed run, within 1 dB or 2 % \
         of its peak",
    ),
    MOTION.graph(
        "lost_ticks",
        lost,
        "the engine loses 1, 2, 3 ticks and so on, 50 ms apart for 2.5 s, while the stylus goes round a \
         circle at 60 mm/s",
        "no node fails, and the speed stays below 66 mm/s. After 1 s the drive has the level of an \
         undisturbed run, within 1 dB or 2 % of its peak",
    ),
    MOTION.graph(
        "a_gap_of_10_ms",
        gap,
        "no place comes for 10 ms while the stylus goes round a circle at 60 mm/s. Once the last place is \
         held, once it is marked as invalid",
        "no node fails. The drive makes no larger step than a sine of 1000 Hz at its usual peak. The speed \
         stays below 66 mm/s after a marked gap and below 97 mm/s after a held one (10 ms times w \
         e^(-pi/4) more at 20 Hz). After 1 s the drive has the level of an undisturbed run, within 1 dB or \
         2 % of its peak",
    ),
];

/// Force of the stylus \[N\].
const PRESS_N: f64 = 1.0;
/// Its depth where no wall is found \[mm\].
const DEPTH_MM: f64 = 2.0;

/// The input of a tick.
enum Next {
    /// A place beside the spot on the wall \[mm\], and whether it is valid.
    At([f64; 2], bool),
    /// A number of lost ticks.
    Skip(u64),
}

/// The subject's graph under a stylus that presses into a level wall of it and moves there.
struct Stage {
    rig: Rig,
    spot_mm: [f64; 3],
    gate: Option<Gate>,
}

/// A gate over a speed: its node, its input of the speed, its output of whether it is open, and the speed
/// that opens it, if known.
#[derive(Clone, Copy)]
struct Gate {
    node: usize,
    speed: usize,
    active: usize,
    opens_mm_s: Option<f64>,
}

/// Figures of a stretch of time.
#[derive(Clone, Debug, Default)]
struct Heard {
    /// Number of times that the gate opened or shut.
    changes: u32,
    /// Ticks in which it was open.
    open: u64,
    /// The last tick in which it changed.
    changed: u64,
    /// Least and greatest speed at the gate \[mm/s\].
    speed: Option<(f64, f64)>,
    /// Largest sample of the drive, and its largest step from sample to sample.
    peak: f32,
    step: f32,
    /// Sum and number of the squares.
    square: (f64, u64),
}

impl Heard {
    /// Root mean square of the drive.
    fn rms(&self) -> f64 {
        (self.square.0 / self.square.1.max(1) as f64).sqrt()
    }

    /// Checks that the speed at the gate is within these \[mm/s\].
    fn speeds(&self, least: f64, most: f64, figures: &mut Figures) -> Result<(), Stop> {
        let Some((slow, fast)) = self.speed else { return Ok(()) };
        figures.note(fast, "mm/s");
        ensure!(
            slow >= least && fast <= most,
            "the speed goes from {slow:.1} to {fast:.1} mm/s; {least:.1} to {most:.1} are allowed"
        );
        Ok(())
    }

    /// Checks that the level is as usual a second later: within 1 dB or a part of the peak.
    ///
    /// A texture of random phases has another waveform after a trouble. The mean square of noise in a band of
    /// B Hz deviates by 1 / sqrt(B T) over T s: 5 % for 200 Hz over 2 s, so that two differ by 0.3 dB. 1 dB
    /// is three times that.
    fn is_as(&self, usual: &Self, part: f64, figures: &mut Figures) -> Result<(), Stop> {
        let [a, b] = [usual, self].map(Self::rms);
        let apart = ((10.0_f64.powf(1.0 / 20.0) - 1.0) * a).max(part * f64::from(usual.peak));
        ensure!((a - b).abs() <= apart, "1 s later its rms is {b:.4}, without {a:.4}");
        figures.note((a - b).abs() / apart.max(f64::MIN_POSITIVE), "of the change of level that is allowed");
        Ok(())
    }
}

impl Stage {
    fn new(subject: &Subject<'_>) -> Result<Self, Stop> {
        let rig = Rig::fed(subject, subject.its_graph()?)?;
        let spot_mm = match spot(subject) {
            Ok(at) => at,
            Err(Stop::NotApplicable(_)) => [0.0, 0.0, -DEPTH_MM],
            Err(other) => return Err(other),
        };
        let gate = rig.schedule.nodes.iter().enumerate().find_map(|(node, n)| {
            let speed = n.inputs.iter().position(|i| i.name == "speed")?;
            let active = n.outputs.iter().position(|o| o.name == "active")?;
            n.gate?;
            let has = n.params.iter().any(|(name, _)| name == "speed_mm_s");
            let opens_mm_s = has.then(|| n.params.number("speed_mm_s"));
            Some(Gate { node, speed, active, opens_mm_s })
        });
        Ok(Self { rig, spot_mm, gate })
    }

    fn tick_hz(&self) -> f64 {
        f64::from(self.rig.schedule.tick_hz)
    }

    /// The speed at which the gate opens \[mm/s\].
    fn opens_mm_s(&self) -> Result<f64, Stop> {
        let Some(gate) = self.gate else { return not_applicable("there is no gate over a speed") };
        match gate.opens_mm_s {
            Some(speed) if speed > 0.0 => Ok(speed),
            _ => not_applicable("the gate opens at no speed that is known"),
        }
    }

    /// Corner of the low-pass of the velocity before the gate, at the speed that opens it \[Hz\].
    fn cutoff_hz(&self) -> Option<f64> {
        let nodes = &self.rig.schedule.nodes;
        let gate = self.gate?;
        let mut next: Vec<usize> =
            nodes[gate.node].inputs[gate.speed].from.iter().map(|from| from.0).collect();
        let mut seen = vec![false; nodes.len()];
        while let Some(at) = next.pop().filter(|&at| !std::mem::replace(&mut seen[at], true)) {
            if nodes[at].role == Some(Role::Velocity) {
                let [hz, per_mm_s] =
                    ["cutoff_hz", "cutoff_hz_per_mm_s"].map(|name| nodes[at].params.number(name));
                let opens = gate.opens_mm_s.unwrap_or_default();
                return (hz > 0.0).then_some(opened_hz(hz, per_mm_s, opens, self.tick_hz()));
            }
            next.extend(nodes[at].inputs.iter().filter_map(|input| Some(input.from?.0)));
        }
        None
    }

    /// Runs from the first tick, with the inputs of `next` until it gives none. Answers the figures of each
    /// of some stretches, from and to \[s\].
    fn play<const N: usize>(
        &mut self,
        times_s: [(f64, f64); N],
        mut next: impl FnMut(u64) -> Option<Next>,
    ) -> Result<[Heard; N], Stop> {
        self.rig.engine.reset();
        let faults = self.rig.engine.faults();
        let hz = self.tick_hz();
        let mut all: [Heard; N] = std::array::from_fn(|_| Heard::default());
        let (mut open, mut last) = (false, [0.0_f32; 8]);
        loop {
            let tick = self.rig.engine.next_tick();
            let [x, y, z] = self.spot_mm;
            match next(tick) {
                None => break,
                Some(Next::Skip(ticks)) => {
                    self.rig.engine.skip(ticks);
                    continue;
                }
                Some(Next::At(at, valid)) => self.rig.place([x + at[0], y + at[1], z], valid),
            }
            self.rig.engine.tick();
            let now = tick as f64 / hz;
            let counts = all.iter_mut().zip(times_s).filter(|(_, t)| now >= t.0 && now < t.1);
            let mut counts: Vec<&mut Heard> = counts.map(|(heard, _)| heard).collect();
            for (samples, last) in self.rig.drive().zip(&mut last) {
                for &x in samples {
                    ensure!(x.is_finite(), "the drive is not finite in tick {tick}");
                    for heard in &mut counts {
                        heard.peak = heard.peak.max(x.abs());
                        heard.step = heard.step.max((x - *last).abs());
                        heard.square = (heard.square.0 + f64::from(x * x), heard.square.1 + 1);
                    }
                    *last = x;
                }
            }
            let Some(gate) = self.gate else { continue };
            let value = |buffer| values(buffer).first().copied().unwrap_or(0.0);
            let is_open = value(self.rig.engine.output(gate.node, gate.active)) > 0.0;
            let speed = value(self.rig.engine.input(gate.node, gate.speed));
            for heard in counts {
                let (least, most) = heard.speed.unwrap_or((speed, speed));
                heard.speed = Some((least.min(speed), most.max(speed)));
                heard.open += u64::from(is_open);
                if is_open != open {
                    (heard.changes, heard.changed) = (heard.changes + 1, tick);
                }
            }
            open = is_open;
        }
        let faults = self.rig.engine.faults() - faults;
        ensure!(faults == 0, "{faults} faults");
        Ok(all)
    }
}

/// A place in the middle of a level wall, at the depth of a pressed stylus.
fn spot(subject: &Subject<'_>) -> Result<[f64; 3], Stop> {
    let mut wall = Wall::of_graph(subject)?;
    let spots = wall.walls(subject.by_effort(20.0, 10.0, 10.0));
    let Some(spot) = spots.into_iter().find(|s| s.normal[2] > 1.0 - 1e-9) else {
        return not_applicable("there is no level wall");
    };
    let near = wall.near(spot)?;
    Ok(spot.above(-(PRESS_N / near.law.stiffness_n_per_mm).min(near.deep_mm)))
}

fn teleport(subject: &Subject<'_>) -> Found {
    let (mut stage, mut figures) = (Stage::new(subject)?, Figures::default());
    let hz = stage.tick_hz();
    let usual = circles(&mut stage, 1.0 / hz, None)?;
    // There and back within two ticks, so that both runs end at the same places.
    let mut jump = |tick: u64| {
        let [x, y] = circle(tick as f64 / hz);
        Next::At([x + 200.0, y], true)
    };
    let other = circles(&mut stage, 1.0 / hz, Some(&mut jump))?;
    other[1].is_as(&usual[1], 0.01, &mut figures)?;
    Ok(format!("peak {:.3}, {:.3} without the jump; {figures}", other[0].peak, usual[0].peak))
}

/// One count of the usual sensor \[mm\].
const COUNT_MM: f64 = 0.055;
/// Duration of a start \[s\].
const START_S: f64 = 0.5;
/// A sensor without steps, along x.
const IDEAL: (f64, f64) = (0.0, 0.0);
const ALWAYS: (f64, f64) = (0.0, f64::INFINITY);
/// Longest time between two flickers \[ticks\].
const PERIODS: u64 = 60;

fn one_count(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let opens = stage.opens_mm_s()?;
    let ticks = (subject.by_effort(0.3, 1.0, 10.0) * stage.tick_hz()) as u64;
    // 5 % for axes that flicker in turns.
    let bound = stage.cutoff_hz().map(|hz| 1.05 * SQRT_2 * COUNT_MM * TAU * hz * (-FRAC_PI_4).exp());
    let mut figures = Figures::default();
    let mut hold = |how: String, on: &dyn Fn(u64) -> [bool; 2]| {
        let [heard] = stage.play([ALWAYS], |tick| {
            let at = on(tick).map(|on| if on { COUNT_MM } else { 0.0 });
            (tick < ticks).then_some(Next::At(at, true))
        })?;
        figures.about = format!("flickering {how}");
        heard
            .speeds(f64::MIN, bound.unwrap_or(f64::MAX), &mut figures)
            .map_err(|e| e.after(&figures.about))?;
        ensure!(heard.open == 0, "flickering {how} opens the gate of {opens} mm/s");
        Ok::<_, Stop>(())
    };
    hold("once".into(), &|tick| [tick >= 20; 2])?;
    for period in (1..=PERIODS).step_by(subject.by_effort(5, 1, 1)) {
        hold(format!("every {period} ticks"), &|tick| [(tick / period) % 2 == 1; 2])?;
        hold(format!("in turns every {period} ticks"), &|tick| {
            [(tick / period) % 2 == 1, (tick / period.div_ceil(2)) % 2 == 1]
        })?;
    }
    for seed in 0..subject.by_effort(3, 20, 500) {
        // Now often, now rarely.
        let share = 0.5 / (1.0 + seed as f64);
        hold("by chance".into(), &|tick| [0, 1].map(|axis| random::uniform(seed, 2 * tick + axis) < share))?;
    }
    let allowed = bound.map_or_else(String::new, |most| format!("; {most:.2} are allowed"));
    Ok(format!("the gate of {opens} mm/s stays shut; {figures}{allowed}"))
}

fn around(subject: &Subject<'_>) -> Found {
    let mut stage = Stage::new(subject)?;
    let (opens, hz) = (stage.opens_mm_s()?, stage.tick_hz());
    let seen = |x: f64, count: f64| if count > 0.0 { (x / count).round() * count } else { x };
    // Over the spot from one side to the other, so that the way is on the wall.
    let mut straight = |seconds: f64, (count, angle): (f64, f64), speed: &dyn Fn(f64) -> f64| {
        let mut along = -0.5 * opens * seconds;
        let [heard] = stage.play([ALWAYS], |tick| {
            let t = tick as f64 / hz;
            let at = [angle.cos(), angle.sin()].map(|part| seen(along * part, count));
            // A start at once would overshoot by 4 % behind the low-pass.
            along += (t / START_S).min(1.0) * speed(t) / hz;
            (t < seconds).then_some(Next::At(at, true))
        })?;
        Ok::<_, Stop>(heard)
    };
    let slow = straight(2.0, IDEAL, &|_| 0.98 * opens)?;
    ensure!(slow.open == 0, "at {:.2} mm/s the gate of {opens} opens", 0.98 * opens);
    let fast = straight(2.0, IDEAL, &|_| 1.02 * opens)?;
    let (slower, faster, after) = (0.98 * opens, 1.02 * opens, fast.changed as f64 / hz);
    ensure!(
        fast.changes == 1 && after <= START_S + 0.3,
        "at {faster:.2} mm/s the gate of {opens} changes {} times, the last after {after:.2} s",
        fast.changes
    );
    // No longer: 60 s are 300 mm, beyond the surfaces of a scene, where the gate has to shut.
    let turns = subject.by_effort(2.0, 4.0, 8.0);
    let between = straight(turns, IDEAL, &|t| {
        if ((t / 0.25) as u64).is_multiple_of(2) { 1.02 * opens } else { 0.98 * opens }
    })?;
    ensure!(between.changes == 1, "now faster, now slower the gate changes {} times", between.changes);
    let mut figures = Figures::default();
    let (speeds, angles) = subject.by_effort((7, 2), (25, 4), (121, 19));
    let between = |n: u32, of: u32, from: f64, to: f64| from + (to - from) * f64::from(n) / f64::from(of - 1);
    let all = (0..angles).flat_map(|a| (0..speeds).map(move |s| (s, a)));
    let all = all.map(|(s, a)| (between(s, speeds, 0.5, 1.1), between(a, angles, 0.0, 45.0)));
    for (speed, degrees) in all.chain([(0.98, 0.0), (1.02, 0.0)]) {
        let steps = straight(turns, (COUNT_MM, degrees.to_radians()), &|_| speed * opens)?;
        let place =
            format!("at {:.2} mm/s in steps, at {degrees:.0} degrees to them, the gate", speed * opens);
        let changes = figures.at_most(f64::from(steps.changes), 1.0, "changes in steps");
        changes.map_err(|e| e.after(&place))?;
    }
    Ok(format!(
        "the gate of {opens} mm/s stays shut at {slower:.2} and opens at {faster:.2} after {:.0} ms; between \
         them it changes once; {figures}",
        1e3 * after
    ))
}

/// Speed and radius of the circle \[mm/s, mm\].
const SPEED_MM_S: f64 = 60.0;
const RADIUS_MM: f64 = 5.0;
/// Time at which the trouble begins, and the time over which a level is measured \[s\].
const BEGINS_S: f64 = 1.0;
const LOOKS_S: f64 = 1.5;
/// Duration of the lost ticks, and of a gap \[s\].
const LOSES_S: f64 = 2.5;
const GAP_S: f64 = 0.01;
/// The usual filter of a velocity \[Hz\].
const CUTOFF_HZ: f64 = 20.0;
/// Upper end of the textures' band \[Hz\].
const TOP_HZ: f64 = 1000.0;

fn circle(seconds: f64) -> [f64; 2] {
    let turn = seconds * SPEED_MM_S / RADIUS_MM;
    [RADIUS_MM * turn.cos(), RADIUS_MM * turn.sin()]
}

/// Plays the circle, with the inputs of `wrong` for `wrong_s` from [`BEGINS_S`] on, if there are any.
/// Answers the figures of that time, and those from a second after it on.
fn circles(
    stage: &mut Stage,
    wrong_s: f64,
    mut wrong: Option<&mut dyn FnMut(u64) -> Next>,
) -> Result<[Heard; 2], Stop> {
    let hz = stage.tick_hz();
    let [begins, ends] = [BEGINS_S, BEGINS_S + wrong_s].map(|s| (s * hz).round() as u64);
    let later = BEGINS_S + wrong_s + 1.0;
    let times = [(BEGINS_S, BEGINS_S + wrong_s + 0.3), (later, later + LOOKS_S)];
    stage.play(times, |tick| {
        let now = match &mut wrong {
            Some(next) if (begins..ends).contains(&tick) => next(tick),
            _ => Next::At(circle(tick as f64 / hz), true),
        };
        (tick as f64 / hz < times[1].1).then_some(now)
    })
}

fn sampling(subject: &Subject<'_>) -> Found {
    let (mut stage, mut figures) = (Stage::new(subject)?, Figures::default());
    let (hz, wrong_s) = (stage.tick_hz(), subject.by_effort(0.5, 2.0, 600.0));
    let jitter = |tick: u64| random::uniform(0x71ff, tick) * 0.5 - 0.25;
    let late = |tick: u64| if tick % 37 == 5 || tick % 37 == 11 { -1.0 } else { 0.0 };
    let twice = |tick: u64| if tick % 2 == 1 { -1.0 } else { 0.0 };
    let all: [(&str, &dyn Fn(u64) -> f64); 3] =
        [("read off its time", &jitter), ("read late", &late), ("read twice", &twice)];
    // A place that is a tick late is a step of a tick's way. A low-pass of two poles answers a step with
    // w e^(-pi/4) of it at most.
    let most = (TAU * CUTOFF_HZ * (-FRAC_PI_4).exp() / hz).max(0.3);
    let usual = circles(&mut stage, wrong_s, None)?;
    for (what, off) in all {
        figures.about = what.into();
        let mut next = |tick: u64| Next::At(circle((tick as f64 + off(tick)) / hz), true);
        let other = circles(&mut stage, wrong_s, Some(&mut next))?;
        let speeds = other[0].speeds((1.0 - most) * SPEED_MM_S, (1.0 + most) * SPEED_MM_S, &mut figures);
        ensure!(other[0].changes == usual[0].changes, "{what} the gate changes {} times", other[0].changes);
        let later = speeds.and_then(|()| other[1].is_as(&usual[1], 0.02, &mut figures));
        later.map_err(|e| e.after(what))?;
    }
    Ok(figures.to_string())
}

fn lost(subject: &Subject<'_>) -> Found {
    let (mut stage, mut figures) = (Stage::new(subject)?, Figures::default());
    let hz = stage.tick_hz();
    // One more every time, 50 ms apart.
    let apart = (0.05 * hz) as u64;
    let (mut lose, mut at) = (0, (BEGINS_S * hz).round() as u64);
    let mut next = |tick: u64| {
        if tick < at {
            return Next::At(circle(tick as f64 / hz), true);
        }
        lose += 1;
        at = tick + lose + apart;
        Next::Skip(lose)
    };
    let usual = circles(&mut stage, LOSES_S, None)?;
    let other = circles(&mut stage, LOSES_S, Some(&mut next))?;
    other[0].speeds(0.0, 1.1 * SPEED_MM_S, &mut figures)?;
    other[1].is_as(&usual[1], 0.02, &mut figures)?;
    Ok(figures.to_string())
}

fn gap(subject: &Subject<'_>) -> Found {
    let (mut stage, mut figures) = (Stage::new(subject)?, Figures::default());
    let hz = stage.tick_hz();
    let before = circle(((BEGINS_S * hz).round() - 1.0) / hz);
    let usual = circles(&mut stage, GAP_S, None)?;
    // A click is a step that no signal in the band of textures makes.
    let step = usual[0].peak * (TAU * TOP_HZ / f64::from(stage.rig.schedule.audio_hz)) as f32;
    for (valid, most, what) in [(true, 97.0 / 60.0, "held"), (false, 1.1, "marked")] {
        figures.about = what.into();
        let other = circles(&mut stage, GAP_S, Some(&mut |_| Next::At(before, valid)))?;
        let speeds = other[0].speeds(0.0, most * SPEED_MM_S, &mut figures);
        ensure!(other[0].step <= step, "{what}: a step of {:.4}; {step:.4} are allowed", other[0].step);
        let later = speeds.and_then(|()| other[1].is_as(&usual[1], 0.02, &mut figures));
        later.map_err(|e| e.after(what))?;
    }
    Ok(figures.to_string())
}
