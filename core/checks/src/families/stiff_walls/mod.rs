//! Walls: the energy that a sampled wall gives to a device, alone or under a hand.
//!
//! A wall is the answer of a graph to its stylus, at its own rate. The device around it is simulated
//! ([`crate::handle`]). The tests check the theory on a plain floor, at 500 and 1000 Hz.
//!
//! # Energy
//!
//! A force F_k that is read at x_k and held over a tick gives `F_k (x_k+1 - x_k)`. A device's damping b
//! takes least at a speed that is constant from tick to tick: `b sum (x_k+1 - x_k)^2 / T`. The cases play
//! such motions, so no device with this damping can extract more. A wall `F = -K x` gives
//!
//! ```text
//! -K x_k (x_k+1 - x_k) = U(x_k) - U(x_k+1) + K (x_k+1 - x_k)^2 / 2,    U = K x^2 / 2
//! ```
//!
//! Over a closed way this equals a damping of K T/2, and no more where the wall is left on the way, since U
//! is convex. A damper B gives `-B (x_k - x_k-1) (x_k+1 - x_k) / T`, at most `B sum (x_k+1 - x_k)^2 / T`. So
//! the bound is K T/2 + B for any way and any device, also where either force is cut off at 0 or at a
//! largest force.

mod chatter;
mod quantum;
#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use crate::case::{Case, Family, Figures, Found, Stop, applicable, not_applicable};
use crate::handle::{Device, Hand, Handle, Loop};
use crate::subject::{Effort, Subject};
use crate::wall::{Curve, Near, Wall, pitch_mm};
use asperity_node::random;

const WALLS: Family = Family("stiff_walls");

pub(super) const CASES: &[Case] = &[
    WALLS.graph(
        "own_wall_energy",
        |s| own(s, inside),
        "a device without a hand hits the graph's own walls, at the graph's own rate. Its damping is 2 % \
         above b = K (T/2 + t_d) + B. K follows from the force at rest, B is the wall's damping plus \
         drags, t_d is the declared delay",
        "no energy is generated. In every tick, device and wall have at most their initial energy, within \
         1e-4, the accuracy of the wall's energy. No motion extracts more than the bound. With twice the \
         damping the device rests after 60 m / b",
    ),
    WALLS.graph(
        "own_wall_in_steps",
        |s| own(s, |w, n, s, f| quantum::below(w, n, s, f).and_then(|()| quantum::above(w, n, s, f))),
        "a sensor has steps D = 0.055 mm. The wall trembles if the device's dry friction c is below K D / \
         2 (13.8 mN at 0.5 N/mm). The device has 1.5 and 4 times the damping b that it needs",
        "let z = (b - K T/2) / (2 sqrt(K m)). After 40 m / (b - K T/2) it trembles at most (D/2 + c/K) \
         coth(pi z / (2 sqrt(1 - z^2))) around rest, within 10 %. Its rms speed is at most (K D / 2 - c) \
         / (b - K T/2). Between two steps, without dry friction, its speed is at least f / b sqrt(1 - \
         tanh(s/2) / (s/2)). Here f is the least error of the force and s = b T/m. Motions across the \
         border of a step extract the energy of K D / 2 within 0.1 %. With c above K D / 2 it rests, to \
         the last bit, after A K / (4 (c - K D / 2)) swings and one more",
    ),
    WALLS.graph(
        "own_wall_under_a_hand",
        |s| own(s, under_a_hand),
        "a hand in a pen grip presses a device into the graph's own walls. Hands are light and heavy, \
         loose and firm (9 hands, 3 with effort `quick`, 27 with `long`)",
        "no energy is generated. After 24 M / B of hand, device and arm, it rests within 1 um. With a \
         sensor in steps its rms speed is within the bound of `own_wall_in_steps`",
    ),
    WALLS.graph(
        "contact_chatter",
        chatter::rests,
        "a device of 0.1 kg falls on the walls of the graph: at their edges, in their middle, into their \
         corners. It rests there under f = 0.3 N, with a sensor in steps of 0.055 mm",
        "contact begins at most 2 + ln(v m w / f) / (pi z) times. In the last half of 6 s it neither \
         begins nor ends. Where two walls, or two slopes of one wall, take turns, the device's speed is \
         bounded. The bound is (3 sqrt(2) h f^2 / (2 b m))^(1/3) + 2 f T / m, with the hysteresis h = 0.1 \
         mm",
    ),
];

/// A check of a wall near its surface.
type About = fn(&mut Wall, &Near, &Subject<'_>, &mut Figures) -> Result<(), Stop>;

/// Checks the graph's own walls, those that need most damping first.
fn own(subject: &Subject<'_>, about: About) -> Found {
    let mut wall = Wall::of_graph(subject)?;
    let spots = wall.walls(pitch_mm(subject));
    let near = spots.into_iter().map(|spot| wall.near(spot));
    let mut all: Vec<Near> = applicable(near, "no wall was found in this graph")?;
    all.sort_by(|a, b| b.needed_ns_per_m(0.0).total_cmp(&a.needed_ns_per_m(0.0)));
    let Some(first) = all.first() else { return not_applicable("no wall was found in this graph") };
    let mut tells = format!(
        "`{}`: {:.3} N/mm and {:.3} N s/m, passive on a device with at least {:.3} N s/m",
        wall.source,
        first.law.stiffness_n_per_mm,
        first.law.damping_ns_per_m,
        first.needed_ns_per_m(0.0),
    );
    if wall.handed_on {
        tells += " at the graph's rate; a device with a loop of its own bears more";
    }
    if let Some(from) = all.iter().filter_map(|near| near.stiffens_mm).min_by(f64::total_cmp) {
        tells += &format!("; a wall is stiffer from {from:.2} mm on, where its shape goes on another way");
    }
    let mut figures = Figures::default();
    for near in all.iter().take(subject.by_effort(1, 4, 16)) {
        about(&mut wall, near, subject, &mut figures)?;
    }
    Ok(format!("{tells} (the first of {} that differ); {figures}", all.len()))
}

/// Throws devices at a wall: masses that swing in it from slowly to once in a few ticks, from places all
/// over a tick's way.
fn thrown(
    wall: &mut Wall,
    near: &Near,
    (damping_ns_per_m, late): (f64, (usize, usize)),
    radians: &[f64],
    mut each: impl FnMut(Fallen, &Fall<'_>) -> Result<(), Stop>,
) -> Result<(), Stop> {
    let curve = wall.curve(near);
    for &radians in radians {
        let mass_kg = near.mass_kg(radians);
        // Half as deep as Hooke's law holds.
        let speed_mm_s = 0.5 * near.deep_mm * radians / near.tick_s();
        for phase in 0..5 {
            let from_mm = (1.0 + 0.2 * f64::from(phase)) * speed_mm_s * near.tick_s();
            let device = Device { mass_kg, damping_ns_per_m, friction_n: 0.0 };
            let it =
                Fall { near, curve: &curve, device, push_n: 0.0, late, from_mm, speed_mm_s: -speed_mm_s };
            // In and out, and some way after that.
            let ticks = (20.0 + 8.0 / radians) * wall.every as f64;
            each(fall(wall, &it, ticks as u64)?, &it)?;
        }
    }
    Ok(())
}

/// Accuracy of a wall's measured energy.
const KNOWN: f64 = 1e-4;

fn inside(wall: &mut Wall, near: &Near, subject: &Subject<'_>, figures: &mut Figures) -> Result<(), Stop> {
    let bound = near.needed_ns_per_m(0.0);
    let (angle, most_ns_per_m) = swings(wall, near).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
    let at_hz = angle / TAU / near.tick_s();
    let chance = by_chance(wall, near, subject.by_effort(10, 50, 2000));
    for (found, what) in
        [(most_ns_per_m, format!("a motion of {at_hz:.0} Hz")), (chance, "a way in and out".to_owned())]
    {
        ensure!(
            found <= bound * (1.0 + 1e-6),
            "{what} takes out the energy of {found:.4} N s/m; the bound is {bound:.4}"
        );
        figures.note(found / bound, "of the bound taken out");
    }
    let mut check = |done: Fallen, it: &Fall<'_>| {
        let (more, device) = (done.most_mj / done.first_mj - 1.0, it.device);
        figures.note(more, "of its energy gained");
        let (mass, damping, part) = (device.mass_kg, device.damping_ns_per_m, 1.0 + more);
        ensure!(more <= KNOWN, "{mass:.3} kg with {damping:.3} N s/m had {part:.4} of its energy at first");
        Ok(())
    };
    thrown(wall, near, (1.02 * bound, (0, 1)), &[0.05, 0.3, 1.0, 2.5], &mut check)?;
    // A fall with bounces, for seconds.
    let curve = wall.curve(near);
    let seconds = subject.by_effort(1.0, 4.0, 600.0);
    for (part, seconds) in [(1.02, seconds), (2.0, 0.0)] {
        let mass_kg = near.mass_kg(0.2);
        let push_n = 0.2 * near.law.stiffness_n_per_mm * near.deep_mm;
        let device = Device { mass_kg, damping_ns_per_m: part * bound, friction_n: 0.0 };
        // The spring takes the energy of the fall at half the depth to which Hooke's law holds.
        let from_mm = 0.125 * near.law.stiffness_n_per_mm * near.deep_mm.powi(2) / push_n;
        let it = Fall { near, curve: &curve, device, push_n, late: (0, 1), from_mm, speed_mm_s: 0.0 };
        let settles_s = 60.0 * mass_kg / device.damping_ns_per_m;
        let seconds = if seconds > 0.0 { seconds } else { settles_s };
        let done = fall(wall, &it, (seconds * wall.tick_hz()) as u64)?;
        check(done, &it)?;
        let left = done.last_mj / (done.first_mj + 1e-300);
        ensure!(part < 2.0 || left <= 1e-6, "60 m / b after a fall {left:.2e} of its energy still moves");
    }
    Ok(())
}

/// Positions of a swing.
const POINTS: u32 = 64;

/// A way over a wall.
struct Round {
    /// Energy that the wall gave, and that a damper of 1 N s/m would take \[mJ\].
    given: f64,
    taken: f64,
    /// Its length \[mm\].
    way: f64,
}

/// Moves twice through places outside the surface \[mm\], one per run of the wall, at constant speed between
/// them. The sensor has steps of `step_mm`, if that is above 0. The second round counts.
fn round(wall: &mut Wall, near: &Near, places_mm: &[f64], step_mm: f64) -> Round {
    let every = wall.every;
    let seen = |x: f64| if step_mm > 0.0 { (x / step_mm).round() * step_mm } else { x };
    let mut it = Round { given: 0.0, taken: 0.0, way: 0.0 };
    wall.reset();
    for second in [false, true] {
        for (&x, &to) in places_mm.iter().zip(places_mm.iter().cycle().skip(1)) {
            let part = (to - x) / every as f64;
            let given: f64 =
                (0..every).map(|k| wall.above(&near.spot, seen(x + k as f64 * part)) * part).sum();
            if second {
                it.given += given;
                it.taken += 1e-3 * (to - x).powi(2) / near.tick_s();
                it.way += (to - x).abs();
            }
        }
    }
    it
}

/// Amplitude and middle of a swing \[mm\], so that Hooke's law holds all over it, with the force of the
/// damping.
fn swing(near: &Near) -> (f64, f64) {
    let (middle, law) = (0.5 * near.deep_mm, near.law);
    let by_speed = 2e-3 * law.damping_ns_per_m.abs() / near.tick_s();
    let most = middle * law.stiffness_n_per_mm / (law.stiffness_n_per_mm + by_speed);
    (0.5 * most, -middle)
}

/// Energy that swings take out of a wall, as a missing damping \[N s/m\], at every frequency up to half the
/// rate. Answers the angle per tick and that damping.
fn swings(wall: &mut Wall, near: &Near) -> impl Iterator<Item = (f64, f64)> {
    let (size, middle) = swing(near);
    (1..=POINTS / 2).map(move |turns| {
        let angle = TAU * f64::from(turns) / f64::from(POINTS);
        let places: Vec<f64> = (0..POINTS).map(|k| middle + size * (angle * f64::from(k)).cos()).collect();
        let Round { given, taken, .. } = round(wall, near, &places, 0.0);
        (angle, given / taken)
    })
}

/// The same on random ways in and out, from outside and back: the largest value \[N s/m\].
fn by_chance(wall: &mut Wall, near: &Near, ways: u64) -> f64 {
    let mut most = f64::MIN;
    for way in 0..ways {
        let random = |k: u64| random::uniform(0x5717_ff00 + way, k);
        // From small steps to steps that go in and out at once.
        let step = near.deep_mm * 10.0_f64.powf(-2.0 * random(0));
        let mut x = near.deep_mm;
        let mut places = vec![x];
        for k in 1..200 {
            x = (x + step * (2.0 * random(k) - 1.0)).clamp(-0.8 * near.deep_mm, near.deep_mm);
            // A drift inwards and back.
            x -= 0.02 * near.deep_mm * (TAU * k as f64 / 200.0).sin();
            places.push(x);
        }
        let Round { given, taken, .. } = round(wall, near, &places, 0.0);
        most = most.max(given / taken);
    }
    most
}

/// A device on a wall.
struct Fall<'a> {
    near: &'a Near,
    /// Energy of the wall by place.
    curve: &'a Curve,
    device: Device,
    /// A force into the wall beside its own \[N\].
    push_n: f64,
    /// Delay beside the graph's own, as a fraction of a tick.
    late: (usize, usize),
    /// First place \[mm\], outside.
    from_mm: f64,
    /// First speed \[mm/s\], outwards.
    speed_mm_s: f64,
}

/// Figures of a fall.
#[derive(Clone, Copy, Debug)]
struct Fallen {
    /// Energy of device and wall at first \[mJ\].
    first_mj: f64,
    /// The largest energy in any tick.
    most_mj: f64,
    /// Kinetic energy after the first contact, a tick after the wall let go \[mJ\].
    back_mj: f64,
    /// Largest kinetic energy in the last quarter \[mJ\].
    last_mj: f64,
}

/// Lets a device go for so many ticks.
fn fall(wall: &mut Wall, it: &Fall<'_>, ticks: u64) -> Result<Fallen, Stop> {
    wall.reset();
    let (late, of) = it.late;
    let steps = of.max(1) * if it.device.friction_n > 0.0 { 40 } else { 1 };
    let late = late * steps / of.max(1);
    let step_s = 1.0 / wall.tick_hz() / steps as f64;
    let mut servo = Loop::new(Handle::new(it.device, None, step_s), steps, late, 0.0);
    servo.handle.put(it.from_mm, it.speed_mm_s, 0.0);
    let energy = |h: &Handle| h.energy_mj() + it.push_n * h.x_mm() + it.curve.energy_mj(h.x_mm());
    let first_mj = energy(&servo.handle);
    let mut done = Fallen { first_mj, most_mj: f64::MIN, back_mj: 0.0, last_mj: 0.0 };
    let (mut inside, mut left) = (false, None);
    let lets_go = it.late.0.div_ceil(of.max(1)) as u64 + wall.every;
    for tick in 0..ticks {
        servo.tick(|x| wall.above(&it.near.spot, x), -it.push_n, |_| {});
        let (now, moves) = (energy(&servo.handle), servo.handle.energy_mj());
        ensure!(now.is_finite(), "the device is nowhere after {tick} ticks");
        done.most_mj = done.most_mj.max(now);
        if 4 * tick >= 3 * ticks {
            done.last_mj = done.last_mj.max(moves);
        }
        let enters = servo.handle.x_mm() < 0.0;
        if inside && !enters {
            left.get_or_insert(tick);
        }
        if left.is_some_and(|left| tick == left + lets_go) {
            done.back_mj = moves;
        }
        inside = enters;
    }
    Ok(done)
}

/// Steps of the device per tick under a hand and a sensor in steps.
const HAND_STEPS: usize = 4;
/// Largest motion of a device that lies still \[mm\].
const STILL_MM: f64 = 1e-3;

/// The usual hand, with half to twice its mass, grip and arm.
fn hands(effort: Effort) -> Vec<Hand> {
    let part = |n: usize| [0.5, 1.0, 2.0].get(n % 3).copied().unwrap_or(1.0);
    let all = (0..27).map(|n| [part(n), part(n / 3), part(n / 9)]);
    let quick = |v: &[f64; 3]| match effort {
        Effort::Quick => v[0] == v[1] && v[1] == v[2],
        Effort::Full => v[1] == v[2],
        Effort::Long => true,
    };
    all.filter(quick).map(|v| Hand::PEN.varied(v)).collect()
}

fn under_a_hand(
    wall: &mut Wall,
    near: &Near,
    subject: &Subject<'_>,
    figures: &mut Figures,
) -> Result<(), Stop> {
    let curve = wall.curve(near);
    let bound = near.needed_ns_per_m(0.0);
    let in_steps = quantum::is_deep(near).then_some((quantum::STEP_MM, 1.5, HAND_STEPS));
    for hand in hands(subject.effort) {
        // A third of the wall's force where Hooke's law ends.
        let push_n = 0.3 * near.law.stiffness_n_per_mm * near.deep_mm;
        let wants_mm = -1e3 * push_n / hand.arm[0];
        // The hand swings on its arm with the device: e^-12 of that is left.
        let mass_kg = near.mass_kg(0.14);
        let settle_s = 24.0 * (hand.mass_kg + mass_kg) / hand.arm[1];
        for (step_mm, part, steps) in [(0.0, 1.02, 1)].into_iter().chain(in_steps) {
            let device = Device { mass_kg, damping_ns_per_m: part * bound, friction_n: 0.0 };
            let handle = Handle::new(device, Some(hand), 1.0 / wall.tick_hz() / steps as f64);
            let mut servo = Loop::new(handle, steps, 0, step_mm);
            servo.handle.put(0.5 * near.deep_mm, 0.0, wants_mm);
            let energy = |h: &Handle| h.energy_mj() + curve.energy_mj(h.x_mm());
            let (first, mut most) = (energy(&servo.handle), f64::MIN);
            let moves =
                quantum::settle(wall, near, &mut servo, 0.0, (settle_s, 0.5), |h| most = most.max(energy(h)));
            let Hand { mass_kg: kg, grip: [grip, _], arm: [arm, _] } = hand;
            let told = format!("{kg:.2} kg of hand, grip {grip:.0} N/m, arm {arm:.0} N/m");
            let within = if step_mm == 0.0 {
                let energy =
                    figures.at_most(most / first, 1.0 + KNOWN, "of the energy at first under a hand");
                let span = moves.span.1 - moves.span.0;
                energy.and_then(|()| figures.at_most(span, STILL_MM, "mm by which it still moves"))
            } else {
                let (_, fast) = quantum::bounds(near, device);
                figures.at_most(moves.rms_mm_s / fast, 1.0, "of the speed with which it may tremble")
            };
            within.map_err(|e| e.after(&told))?;
        }
    }
    Ok(())
}
