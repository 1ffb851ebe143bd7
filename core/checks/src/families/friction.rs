//! Friction and drag: forces that only take energy.
//!
//! The cases run every kind in the registry that answers a velocity in a slot with a force, alone with a
//! stylus, at every tick rate. An effect runs with the examples of its forms, and is compared with its
//! declared law. Another kind runs with its defaults, if it needs no parameter.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use asperity_diagnostics::ron;
use asperity_node::{Descriptor, Effect, Law, Output, Settings, ShapeSpec, Source, Unit, UnitSpec, random};
use asperity_scene::bound::{Passivity, Sampling};

use crate::case::{Case, Family, Figures, Found, Stop, applicable, not_applicable};
use crate::handle::{Device, Handle, Loop};
use crate::played::Played;
use crate::rig::{CaseGraph, Rig, has_to_be_set};
use crate::subject::Subject;
use crate::wall::{Near, Spot, Wall, pitch_mm};

const FRICTION: Family = Family("friction");

pub(super) const CASES: &[Case] = &[
    FRICTION.kinds(
        "friction_takes_energy",
        |s| each(s, &[1e-9, 1e-3, 1.0, 1e4], None, takes),
        "velocities turn through zero, creep, stop and jump, under a normal force of 1e-9 to 1e4 N that \
         changes, at tick rates from 100 to 4000 Hz",
        "the force is finite. It never gives more energy than it has taken: the sum of -F v T is never \
         below 0 (within 1e-9 of the exchanged energy)",
    ),
    FRICTION.kinds(
        "friction_is_quiet_at_rest",
        |s| each(s, &[1e-9, 1.0, 1e4], None, quiet),
        "a stylus at rest moves to and fro by 1e-9 mm per N of normal force in every tick",
        "the force makes no step of Coulomb friction: it is at most what stiffness and damping at rest \
         give, K x + B x/T, within 1 %",
    ),
    FRICTION.kinds(
        "friction_inside_its_bound",
        |s| each(s, &[1e-9, 0.3, 3.3, 1e4], None, inside),
        "friction in ticks stops a device of 0.1 kg that slides at 100 mm/s. The damping of the device is \
         5 % and 50 % above K T/2 + B, with K the stiffness of the bristle",
        "its energy never grows. With 50 %, its speed is below 0.01 mm/s within 40 m / (b + B - K T/2), \
         if that is below 4 s. Let z = (b + B - K T/2) / (2 sqrt(K m)) and n = 2 + 6 ln 10 (1 / (pi z) + \
         1 / ln(b / B)). Until its motion is a millionth of the first, the force changes its sign at most \
         n times, and a quarter more for tick rates near the oscillation",
    ),
    FRICTION.kinds(
        "friction_beyond_its_bound",
        |s| each(s, &[30.0, 1e3, 1e4], Some(LIMIT_N), beyond),
        "the same under up to 1e4 N with a damping of 0.1 N s/m, behind a force limiter of 3.3 N. No \
         device bears such a law: it chatters",
        "after half a second, its speed is at most F sqrt(3 T / (b m)) + 2 F T / m. The first term \
         balances two energies: 2 F v T from a force that turns a tick late, and 2 b v^3 m / (3 F) into \
         damping. The second term is one or two ticks of the force",
    ),
    FRICTION.graph(
        "own_friction",
        rubs,
        "a stylus rubs over the level walls of the graph with 0.3 N and with the most that they push. A \
         device slides there with 5 % more damping than K T/2 + B, as measured along the surface",
        "friction takes energy and never gives it, and the device's energy never grows",
    ),
];

/// A check of a law under a normal force \[N\].
type About = fn(&mut Rubbed, f64, &Subject<'_>, &mut Figures) -> Result<(), Stop>;

/// Checks all laws at all rates and normal forces.
fn each(subject: &Subject<'_>, normals_n: &[f64], limit_n: Option<f64>, about: About) -> Found {
    let (laws, mut figures) = (laws(subject), Figures::default());
    if laws.is_empty() {
        return not_applicable("there is no kind of friction or drag");
    }
    let rates: &[u32] = subject.by_effort(
        &[100, 500, 4000],
        &[100, 250, 500, 1000, 2000, 4000],
        &[100, 125, 200, 250, 333, 400, 500, 700, 1000, 1500, 2000, 3000, 4000],
    );
    for rub in &laws {
        figures.about.clone_from(&rub.name);
        for &tick_hz in rates {
            let mut it = Rubbed::new(subject, rub, tick_hz, limit_n)?;
            for &normal in normals_n {
                about(&mut it, normal, subject, &mut figures)
                    .map_err(|e| e.after(&format!("{} at {tick_hz} Hz, {normal:e} N", rub.name)))?;
            }
            it.rig.sound()?;
        }
    }
    let names: Vec<&str> = laws.iter().map(|rub| rub.name.as_str()).collect();
    Ok(format!("{} at {} rates: {figures}", names.join(", "), rates.len()))
}

/// The energy that a force has taken so far, and all that went to and fro \[mJ\].
#[derive(Default)]
struct Balance {
    sum: f64,
    sizes: f64,
    /// Energy that does not count.
    slack: f64,
}

impl Balance {
    /// Adds what a force has taken along a way. At no time may it have given more than it took.
    fn add(&mut self, taken: f64) -> Result<(), Stop> {
        self.sum += taken;
        self.sizes += taken.abs();
        let Self { sum, sizes, slack } = *self;
        ensure!(sum >= -1e-9 * sizes - slack, "it has given {:.3e} mJ of {sizes:.3e}", -sum);
        Ok(())
    }
}

/// Place on a surface by time \[mm\], and a factor of the normal force. All ways begin at rest at 0.
type Way = fn(f64) -> ([f64; 2], f64);

const WAYS: [Way; 6] = [
    // To and fro, slowly and fast, far and near.
    |t| ([20.0 * (1.0 - (TAU * t).cos()), 0.0], 1.0),
    |t| ([0.3 * (1.0 - (TAU * 13.0 * t).cos()), 0.1 * (TAU * 7.0 * t).sin().powi(2)], 1.0),
    // Round a circle, so that the speed is never 0, under a force that changes.
    |t| ([5.0 * (1.0 - (9.0 * t).cos()), 5.0 * (9.0 * t).sin()], 0.5 + 0.5 * (31.0 * t).sin()),
    // Creeping and back.
    |t| ([1e-3 * (1.0 - (TAU * 2.0 * t).cos()), 0.0], 1.0 + 0.9 * (50.0 * t).sin()),
    // Stop and go, at times without a normal force.
    |t| {
        let part = (4.0 * t).fract();
        ([10.0 * (4.0 * t).floor() + 10.0 * (2.0 * part).min(1.0), 0.0], if part > 0.9 { 0.0 } else { 1.0 })
    },
    // At random.
    |t| {
        let random = |k| random::uniform(0xf41c, (1e5 * t) as u64 * 3 + k);
        ([4.0 * random(0) - 2.0, 1e-3 * random(1)], 2.0 * random(2))
    },
];

fn takes(it: &mut Rubbed, normal_n: f64, subject: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let ticks = (subject.by_effort(0.3, 1.0, 20.0) * f64::from(it.tick_hz)) as u64;
    for way in WAYS {
        it.begin(normal_n);
        let (mut before, mut balance) = ([0.0; 2], Balance::default());
        for tick in 1..=ticks {
            let (place, part) = way(tick as f64 * it.tick_s());
            let force = it.at(place, part * normal_n);
            ensure!(force.iter().all(|f| f.is_finite()), "the force is not finite");
            let taken: f64 = (0..2).map(|k| -force[k] * (place[k] - before[k])).sum();
            before = place;
            balance.add(taken).map_err(|e| e.after(&format!("after {tick} ticks")))?;
            figures.note(-balance.sum / balance.sizes.max(f64::MIN_POSITIVE), "of its energy given");
        }
    }
    Ok(())
}

fn quiet(it: &mut Rubbed, normal_n: f64, _: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let law = it.law(normal_n)?;
    let size = 1e-9 * normal_n;
    let most = (law.stiffness_n_per_mm + 1e-3 * law.damping_ns_per_m / it.tick_s()) * size;
    it.begin(normal_n);
    let mut largest = 0.0_f64;
    for tick in 0..200_u32 {
        let x = if tick.is_multiple_of(2) { size } else { 0.0 };
        largest = largest.max(it.at([x, 0.0], normal_n)[0].abs());
    }
    figures.at_most(largest / most, 1.01, "of the force by the law at rest")
}

/// Figures of a slide into rest.
struct Slide {
    /// Largest kinetic energy, as a part of the first.
    most: f64,
    /// Largest speed at last \[mm/s\].
    last_mm_s: f64,
    /// Changes of the sign of the force.
    turns: u32,
}

/// Allowance for the closed form of a swing that takes few ticks.
const NEARLY: f64 = 1.25;
const MASS_KG: f64 = 0.1;
const SPEED_MM_S: f64 = 100.0;

/// Slides for so many ticks; the last speed counts from the tick `late` on.
fn slide(
    mut force: impl FnMut(f64) -> f64,
    device: Device,
    tick_hz: f64,
    (ticks, late): (u64, u64),
) -> Slide {
    let mut servo = Loop::new(Handle::new(device, None, 1.0 / tick_hz), 1, 0, 0.0);
    servo.handle.put(0.0, SPEED_MM_S, 0.0);
    let first = servo.handle.energy_mj();
    let mut it = Slide { most: 0.0, last_mm_s: 0.0, turns: 0 };
    let (mut largest, mut sign) = (0.0_f64, 0.0);
    for tick in 0..ticks {
        let now = force(servo.seen_mm());
        servo.tick(|_| now, 0.0, |_| {});
        it.most = it.most.max(servo.handle.energy_mj() / first);
        largest = largest.max(now.abs());
        // Smaller forces count as rest.
        if now.abs() > 1e-6 * largest {
            it.turns += u32::from(sign * now < 0.0);
            sign = now.signum();
        }
        if tick >= late {
            it.last_mm_s = it.last_mm_s.max(servo.handle.v_mm_s().abs());
        }
    }
    it
}

/// The damping that a device needs for a law \[N s/m\].
fn needed(law: Law, tick_hz: f64) -> f64 {
    Passivity::of(law, Sampling { tick_hz, delay_s: 0.0 }, 0.0).needed_ns_per_m
}

fn inside(it: &mut Rubbed, normal_n: f64, _: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let law = it.law(normal_n)?;
    let (tick_hz, bound) = (f64::from(it.tick_hz), needed(law, f64::from(it.tick_hz)));
    for part in [1.05, 1.5] {
        let device = Device { mass_kg: MASS_KG, damping_ns_per_m: part * bound, friction_n: 0.0 };
        let k = 1e3 * law.stiffness_n_per_mm;
        let spare = device.damping_ns_per_m + law.damping_ns_per_m - 0.5 * k / tick_hz;
        let z = spare / (2.0 * (k * MASS_KG).sqrt());
        // Until its swings, or its speed without a spring, fall to 1e-6; at most some seconds.
        let rest_s = (40.0 * MASS_KG / spare).min(4.0);
        it.begin(normal_n);
        let ticks = ((rest_s * tick_hz) as u64).max(20);
        let times = (ticks, (9 * ticks).div_ceil(10));
        let Slide { most, last_mm_s, turns } =
            slide(|x| it.at([x, 0.0], normal_n)[0], device, tick_hz, times);
        ensure!(most <= 1.0 + 1e-9, "{part} times {bound:.4} N s/m: {most:.6} of its energy at first");
        if part > 1.1 {
            // Swings of a spring, and of a damper that is a tick late: each is a part of the one before.
            let swings = if z > 0.0 && z < 1.0 { 1.0 / (PI * z) } else { 0.0 };
            let rattles = 1.0 / (device.damping_ns_per_m / law.damping_ns_per_m).ln();
            let rattles = if rattles.is_finite() { rattles } else { 0.0 };
            let bound = NEARLY * (2.0 + 6.0 * 10.0_f64.ln() * (swings + rattles));
            let signs = f64::from(turns);
            ensure!(signs <= bound, "its force changes its sign {turns} times; the bound is {bound:.0}");
            let rests = rest_s >= 4.0 || last_mm_s <= 1e-4 * SPEED_MM_S;
            ensure!(rests, "it still moves with {last_mm_s:.3e} mm/s after {rest_s:.2} s");
            figures.note(signs / bound, "of the changes of sign that are allowed");
        }
    }
    Ok(())
}

/// Force limit of a device \[N\].
const LIMIT_N: f64 = 3.3;

fn beyond(it: &mut Rubbed, normal_n: f64, subject: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let tick_hz = f64::from(it.tick_hz);
    let device = Device { mass_kg: MASS_KG, damping_ns_per_m: 0.1, friction_n: 0.0 };
    let (mass, damping) = (device.mass_kg, device.damping_ns_per_m);
    let bound = 1e3 * LIMIT_N * ((3.0 / (tick_hz * damping * mass)).sqrt() + 2.0 / (tick_hz * mass));
    let stops_s = 0.5;
    let look_s = subject.by_effort(0.5, 2.0, 60.0);
    let times = (((stops_s + look_s) * tick_hz) as u64, (stops_s * tick_hz).ceil() as u64);
    it.begin(normal_n);
    let fastest = slide(|x| it.at([x, 0.0], normal_n)[0], device, tick_hz, times).last_mm_s;
    ensure!(fastest <= bound, "{fastest:.1} mm/s; the bound is {bound:.1}");
    figures.note(fastest / bound, "of the speed that may be left");
    Ok(())
}

/// A law of friction or drag.
struct Rub {
    /// Its name in texts.
    name: String,
    kind: String,
    params: Vec<(String, String)>,
    /// The effect and its settings, where the kind tells its law.
    tells: Option<(Effect, Settings)>,
}

/// Number of values of its velocity, and whether it takes a normal force. None for another kind.
fn ports(d: &Descriptor) -> Option<(usize, bool)> {
    let input = |name: &str| d.inputs.iter().find(|i| i.name == name);
    let is = |unit: &UnitSpec, want: &Unit| matches!(unit, UnitSpec::Is(u) if u == want);
    let axes = match input("velocity")?.shape {
        ShapeSpec::Control(n @ 2..=3) => n,
        _ => return None,
    };
    let known = d.inputs.iter().all(|i| i.optional || matches!(&*i.name, "slot" | "velocity" | "force"));
    let pushes = d
        .outputs
        .iter()
        .any(|o| o.name == "force" && o.shape == ShapeSpec::Control(3) && is(&o.unit, &Unit::NEWTON));
    let speed = is(&input("velocity")?.unit, &Unit::MILLIMETRE_PER_SECOND);
    (known && pushes && speed && input("slot").is_some()).then_some((axes, input("force").is_some()))
}

/// Settings to check beside the examples of the forms: gentle and stiff ones.
const MORE: [(&str, &str); 3] = [
    ("friction", "viscous_coulomb(viscosity_s_per_mm: 0.0005)"),
    ("friction", "dahl(coefficient: 0.5, bristle_stiffness_n_per_mm: 10)"),
    ("friction", "lugre(bristle_stiffness_n_per_mm: 10, bristle_damping_ns_per_m: 1)"),
];

/// Every kind of friction and drag: an effect with the examples of its forms, another kind with its defaults.
/// A kind that needs a parameter is left out.
fn laws(subject: &Subject<'_>) -> Vec<Rub> {
    let fits = |d: &&Descriptor| ports(d).is_some() && !has_to_be_set(d, &[]);
    let mut all = Vec::new();
    for d in subject.registry.iter().map(|kind| kind.descriptor()).filter(fits) {
        let kind = d.kind.to_string();
        let Some(effect) = &d.effect else {
            all.push(Rub { name: kind.clone(), kind, params: Vec::new(), tells: None });
            continue;
        };
        let examples = effect.forms.iter().map(|form| form.example.as_ref());
        let more = MORE.iter().filter(|(kind, _)| *kind == d.kind).map(|(_, text)| *text);
        all.extend(examples.chain(more).map(|text| {
            let settings =
                ron::parse(&Source::new("case", text)).and_then(|value| effect.read(&kind, &value));
            let tells = settings.ok().filter(|settings| effect.law_of(settings, 1.0).is_some());
            Rub {
                name: format!("{kind}: {text}"),
                kind: kind.clone(),
                params: vec![(effect.list.to_string(), format!("[{text:?}]"))],
                tells: tells.map(|settings| (effect.clone(), settings)),
            }
        }));
    }
    all
}

/// The law of a force along a surface at rest, by the place \[mm\]: after a step so short that nothing slips.
fn law_at_rest(mut force: impl FnMut(f64) -> f64, step_mm: f64, tick_s: f64) -> Law {
    let still = force(0.0);
    let (moved, held) = (still - force(step_mm), still - force(step_mm));
    Law { stiffness_n_per_mm: held / step_mm, damping_ns_per_m: 1e3 * (moved - held) / step_mm * tick_s }
}

/// A law that runs alone with a stylus.
struct Rubbed<'r> {
    rub: &'r Rub,
    rig: Rig,
    /// Nodes of the normal force and of the force.
    normal: Option<usize>,
    force: usize,
    tick_hz: u32,
}

impl<'r> Rubbed<'r> {
    /// A graph of the law at a rate, behind a limiter of `limit_n` \[N\] if there is one.
    fn new(subject: &Subject<'_>, rub: &'r Rub, tick_hz: u32, limit_n: Option<f64>) -> Result<Self, Stop> {
        let position = Output::new("position", ShapeSpec::Control(3), Unit::MILLIMETRE);
        let like = Descriptor::new("stylus", "").output(position);
        let slot = Played::control("slot from memory", 1, Unit::NONE, Arc::new(|_, to| to.fill(0.0)));
        let (axes, takes) = ports(subject.kind(&rub.kind)?.descriptor()).unwrap_or((2, false));
        let params: Vec<(&str, &str)> =
            rub.params.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
        let mut graph = CaseGraph::new(tick_hz, 48_000)
            .plays("stylus", Played::fed_stylus("stylus from memory", &like))?
            .node("motion", "velocity", &[("cutoff_hz", "0")])?
            .plays("slot", slot)?
            .node("rub", &rub.kind, &params)?
            .wire("stylus.position", "motion.position")
            .wire("slot", "rub.slot")
            .wire(if axes == 2 { "motion.velocity" } else { "motion.unfiltered" }, "rub.velocity");
        if takes {
            graph = graph
                .plays("normal", Played::fed("normal force from memory", Unit::NEWTON))?
                .wire("normal", "rub.force");
        }
        let mut last = "rub";
        if let Some(limit_n) = limit_n {
            graph = graph
                .node("limit", "force_limiter", &[("max_force_n", &format!("{limit_n}"))])?
                .wire("rub.force", "limit.force");
            last = "limit";
        }
        let graph = graph.node("probe", "probe", &[])?.wire(&format!("{last}.force"), "probe");
        let rig = graph.rig(subject)?;
        let force = rig.schedule.index_of(last).ok_or_else(|| "the force is not built".to_owned())?;
        Ok(Self { rub, normal: rig.schedule.index_of("normal"), rig, force, tick_hz })
    }

    fn tick_s(&self) -> f64 {
        1.0 / f64::from(self.tick_hz)
    }

    /// Starts anew: the stylus has rested at 0 for two ticks under this normal force.
    fn begin(&mut self, normal_n: f64) {
        self.rig.engine.reset();
        (0..2).for_each(|_| _ = self.at([0.0; 2], normal_n));
    }

    /// Runs a tick with the stylus at a place on the surface \[mm\] under a normal force. Answers the force
    /// along it \[N\].
    fn at(&mut self, [x, y]: [f64; 2], normal_n: f64) -> [f64; 2] {
        self.rig.place([x, y, 0.0], true);
        if let Some(normal) = self.normal {
            self.rig.engine.feed_control(normal, 0, &[normal_n], true);
        }
        self.rig.engine.tick();
        let values = self.rig.values(self.force, 0);
        [0, 1].map(|k| values.get(k).copied().unwrap_or(0.0))
    }

    /// Measures the law at rest under a normal force. Fails where it is not the known law.
    fn law(&mut self, normal_n: f64) -> Result<Law, Stop> {
        self.begin(normal_n);
        let tick_s = self.tick_s();
        let found = law_at_rest(|x| self.at([x, 0.0], normal_n)[0], 1e-7 * normal_n, tick_s);
        let tells = self.rub.tells.as_ref();
        let told = tells.and_then(|(effect, settings)| effect.law_of(settings, normal_n));
        let Some((_, want)) = told else { return Ok(found) };
        let whole = |k: f64, b: f64| 1e3 * k.abs() * tick_s + b.abs();
        let [[k, b], [want_k, want_b]] = [found, want].map(|it| [it.stiffness_n_per_mm, it.damping_ns_per_m]);
        ensure!(
            whole(k - want_k, b - want_b) <= 1e-3 * whole(want_k, want_b),
            "it is {k:.4} N/mm and {b:.4} N s/m at rest, not {want_k:.4} and {want_b:.4}"
        );
        Ok(want)
    }
}

/// Force of a light stylus \[N\].
const LIGHT_N: f64 = 0.3;

/// A stylus at a depth in a wall that moves along it.
struct Pressed<'a> {
    wall: &'a mut Wall,
    spot: Spot,
    depth_mm: f64,
}

impl Pressed<'_> {
    /// Runs the wall once with the stylus at a place along x \[mm\]. Answers the force along x \[N\].
    fn at(&mut self, x_mm: f64) -> f64 {
        let [x, y, z] = self.spot.above(-self.depth_mm);
        let mut force = 0.0;
        (0..self.wall.every).for_each(|_| [force, ..] = self.wall.at([x + x_mm, y, z]));
        force
    }

    fn begin(&mut self) {
        self.wall.reset();
        (0..3).for_each(|_| _ = self.at(0.0));
    }

    /// Measures the law along the surface at rest.
    fn law(&mut self) -> Law {
        self.begin();
        let tick_s = 1.0 / self.wall.sampling().tick_hz;
        let Law { stiffness_n_per_mm, damping_ns_per_m } = law_at_rest(|x| self.at(x), 1e-7, tick_s);
        let [stiffness_n_per_mm, damping_ns_per_m] =
            [stiffness_n_per_mm, damping_ns_per_m].map(|x| if x.abs() < 1e-4 { 0.0 } else { x });
        Law { stiffness_n_per_mm, damping_ns_per_m }
    }
}

fn rubs(subject: &Subject<'_>) -> Found {
    let mut wall = Wall::of_graph(subject)?;
    let level = |spot: &Spot| spot.normal[2] > 1.0 - 1e-9;
    let spots = wall.walls(pitch_mm(subject)).into_iter().filter(level);
    let near = spots.map(|spot| wall.near(spot));
    let all: Vec<Near> = applicable(near, "no level wall was found in this graph")?;
    let mut found: Vec<String> = Vec::new();
    let tick_hz = wall.sampling().tick_hz;
    for near in all.iter().take(subject.by_effort(4, 16, 400)) {
        let light = (LIGHT_N / near.law.stiffness_n_per_mm).min(near.deep_mm);
        for depth_mm in [light, near.deep_mm] {
            let push_n = depth_mm * near.law.stiffness_n_per_mm;
            let mut it = Pressed { wall: &mut wall, spot: near.spot, depth_mm };
            let law = it.law();
            // To and fro by 4 mm at 1 Hz, by 0.05 mm at 20 Hz, fast, and by very little.
            for (size, hz) in [(2.0, 1.0), (0.025, 20.0), (1.0, 60.0), (1e-4, 5.0)] {
                it.begin();
                let (mut before, mut balance) = (0.0, Balance { slack: 1e-12, ..Balance::default() });
                for tick in 1..=(subject.by_effort(0.5, 1.0, 20.0) * tick_hz) as u64 {
                    let x = size * (1.0 - (TAU * hz * tick as f64 / tick_hz).cos());
                    let taken = -it.at(x) * (x - before);
                    before = x;
                    balance.add(taken).map_err(|e| e.after(&format!("rubbing {push_n:.1} N")))?;
                }
            }
            let bound = needed(law, tick_hz);
            let device = Device { mass_kg: MASS_KG, damping_ns_per_m: 1.05 * bound, friction_n: 0.0 };
            it.begin();
            // No further than some mm, within the wall.
            let most = slide(|x| it.at(x), device, tick_hz, ((0.03 * tick_hz) as u64, u64::MAX)).most;
            ensure!(most <= 1.0 + 1e-9, "1.05 times {bound:.4} N s/m: {most:.6} of its energy at first");
            let Law { stiffness_n_per_mm: k, damping_ns_per_m: b } = law;
            found.push(format!("{push_n:.1} N: {k:.2} N/mm and {b:.2} N s/m, at least {bound:.2} N s/m"));
        }
    }
    wall.sound()?;
    if found.iter().all(|f| f.ends_with("at least 0.00 N s/m")) {
        return not_applicable("no wall of this graph has friction");
    }
    found.sort();
    found.dedup();
    found.truncate(8);
    Ok(format!("rubbed with {}", found.join("; ")))
}
