//! Contact of a stylus with a scene, tick by tick.

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use super::state::{ContactSettings, ContactState, Motion, Pull, Voice};
use super::{NETWORK, Scene, Slots};
use crate::space::{Contact, Entry, Hold, Index, dot};

/// Least depth at which a stylus touches a surface \[mm\].
const TOUCHED_MM: f64 = 1e-6;
/// Greatest distance of a place on a surface from its middle \[mm\].
const FAR_MM: f64 = 1e7;
/// Number that stands for no surface, slot or material.
const NONE: f64 = -1.0;

/// Effects whose slots the contact reports, by the names of their kinds and by where they act.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EffectNames {
    /// Effects that act while a wall is touched.
    pub touching: Vec<String>,
    /// Effects that act inside of volumes too.
    pub inside: Vec<String>,
    /// Effects that act from both sides of a surface, within a reach.
    pub near: Vec<String>,
    /// Textures, except the one by the network.
    pub textures: Vec<String>,
}

impl EffectNames {
    /// Iterates over all names.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        [&self.touching, &self.inside, &self.near, &self.textures].into_iter().flatten().map(String::as_str)
    }
}

/// The wall of a surface, and the slots of its effects.
#[derive(Clone, Debug)]
struct Wall {
    number: f64,
    stiffness_n_per_mm: f64,
    damping_ns_per_m: f64,
    material: f64,
    touching: Vec<f64>,
    inside: Vec<f64>,
    textures: Vec<f64>,
}

/// A surface without a stiffness, and its slots of `inside`.
#[derive(Clone, Debug)]
struct Volume {
    number: f64,
    inside: Vec<f64>,
}

/// Surfaces of one kind, the state of each, and the one that is held.
#[derive(Clone, Debug)]
struct Group<T> {
    index: Index,
    of: Vec<T>,
    held: Option<Hold>,
}

impl<T> Group<T> {
    fn new(all: Vec<(Entry, T)>, scene: &Scene) -> Result<Self, Diagnostic> {
        let (entries, of) = all.into_iter().unzip();
        Ok(Self { index: Index::new(entries, scene.hysteresis_mm)?, of, held: None })
    }

    /// Finds the surface at a place, and holds it.
    fn find(&mut self, at: [f64; 3]) -> Option<Contact> {
        let found = self.index.find(at, self.held);
        self.held = found.map(|contact| contact.hold());
        found
    }

    fn of(&self, contact: Option<Contact>) -> Option<&T> {
        self.of.get(contact?.entry as usize)
    }
}

/// One of two voices of a crossfade.
#[derive(Clone, Copy, Debug)]
struct Fading {
    of: Option<Hold>,
    gain: f64,
    place_mm: [f64; 2],
    /// Directions along which the place goes on when the surface is no longer touched.
    tangents: [[f64; 3]; 2],
    stroke: u64,
}

const SILENT: Fading = Fading { of: None, gain: 0.0, place_mm: [0.0; 2], tangents: FLAT, stroke: 0 };
/// Time over which an approach is measured if places come in steps \[s\].
const APPROACH_S: f64 = 0.02;
/// Most places that this measurement keeps.
const MOST_PLACES: f64 = 80.0;

/// Places of a stylus in the last ticks, the newest first.
#[derive(Clone, Debug)]
struct Past {
    places: Vec<[f64; 3]>,
    known: usize,
}

impl Past {
    fn new(ticks: f64) -> Self {
        Self { places: vec![[0.0; 3]; ticks.ceil().clamp(1.0, MOST_PLACES) as usize], known: 0 }
    }

    fn add(&mut self, place: [f64; 3]) {
        self.places.rotate_right(1);
        self.places[0] = place;
        self.known = (self.known + 1).min(self.places.len());
    }

    /// Gives the age in ticks and the place of each entry, oldest first.
    fn oldest_first(&self) -> impl Iterator<Item = (usize, [f64; 3])> {
        self.places[..self.known].iter().copied().enumerate().rev().map(|(before, place)| (before + 1, place))
    }
}

/// Directions along a surface that is not turned.
const FLAT: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Finds the surfaces that a stylus touches, and tells each effect what to do.
///
/// A tick makes at most three searches, each as fast for many surfaces as for one. They go over the walls
/// (surfaces with a stiffness), the volumes (surfaces without, that vibrate or drag) and the magnets. The
/// deepest of each is felt. Vibration and drag of a wall take precedence over those of a volume. Of the
/// magnets, the nearest pulls.
///
/// Textures go from one wall to the next by a crossfade of equal power between two voices. A third wall
/// waits until one of them has faded. When the stylus leaves a wall, its voice stays for
/// [`hold_s`](ContactSettings::hold_s), so that the nodes after it can fade out by themselves. The wall
/// that is touched after that begins at full level.
#[derive(Clone, Debug)]
pub struct Contacts {
    settings: ContactSettings,
    tick_s: f64,
    walls: Group<Wall>,
    volumes: Group<Volume>,
    /// Surfaces with an effect that acts from both sides of them, and their slots.
    near: Vec<Group<f64>>,
    /// Whether the held wall is touched.
    touching: bool,
    air_ticks: u64,
    before: Option<[f64; 3]>,
    /// Ticks since `before` for which no place is known.
    missed: u64,
    past: Past,
    /// Directions along the surface that was touched last.
    tangents: [[f64; 3]; 2],
    stroke: f64,
    /// Place of the stylus along the surface.
    place_mm: [f64; 2],
    voices: [Fading; 2],
    current: Option<usize>,
    /// Whether nothing was touched for so long that the next surface begins at full level.
    rested: bool,
    network: f64,
    material: f64,
    /// Last answer. Its lists are as long as the lists of names.
    state: ContactState,
}

impl Contacts {
    /// Creates the contacts with the surfaces of a scene, for `run_hz` calls per second. `names` says
    /// which effects have their slots reported.
    ///
    /// # Errors
    /// There are more surfaces than an [`Index`] takes, or an effect with a reach has settings without
    /// `reach_mm`.
    pub fn new(
        scene: &Scene,
        names: &EffectNames,
        settings: ContactSettings,
        run_hz: f64,
    ) -> Result<Self, Diagnostic> {
        let slots = |names: &[String]| -> Vec<Slots> { names.iter().map(|name| scene.slots(name)).collect() };
        let [touching, inside, textures] =
            [&names.touching, &names.inside, &names.textures].map(|n| slots(n));
        let network = [scene.slots(NETWORK)];
        let of = |all: &[Slots], number: usize| -> Vec<f64> {
            let slot = |slots: &Slots| slots.of.get(number).copied().flatten();
            all.iter().map(|slots| slot(slots).map_or(NONE, |slot| slot as f64)).collect()
        };
        let (mut walls, mut volumes) = (vec![], vec![]);
        for (n, touchable) in scene.surfaces.iter().enumerate() {
            let entry = |reach_mm| Entry { surface: touchable.surface.clone(), reach_mm };
            let effects = &touchable.effects;
            let (number, inside) = (n as f64, of(&inside, n));
            if let Some(stiffness) = &effects.stiffness {
                let wall = Wall {
                    number,
                    stiffness_n_per_mm: stiffness.of,
                    damping_ns_per_m: effects.damping.as_ref().map_or(0.0, |d| d.of),
                    material: of(&network, n)[0],
                    touching: of(&touching, n),
                    inside,
                    textures: of(&textures, n),
                };
                walls.push((entry(settings.anticipate_mm), wall));
            } else if inside.iter().any(|slot| *slot >= 0.0) {
                volumes.push((entry(0.0), Volume { number, inside }));
            }
        }
        let near = names.near.iter().map(|kind| near(scene, kind)).collect::<Result<_, _>>()?;
        Ok(Self {
            settings,
            tick_s: 1.0 / run_hz,
            walls: Group::new(walls, scene)?,
            volumes: Group::new(volumes, scene)?,
            near,
            touching: false,
            air_ticks: 0,
            before: None,
            missed: 0,
            past: Past::new(if scene.device.position_step_mm > 0.0 { APPROACH_S * run_hz } else { 1.0 }),
            tangents: FLAT,
            stroke: 0.0,
            place_mm: [0.0; 2],
            voices: [SILENT; 2],
            current: None,
            rested: true,
            network: 0.0,
            material: 0.0,
            state: ContactState::of_nothing(names),
        })
    }

    /// Numbers of walls, of volumes, and of surfaces that act from both sides.
    pub fn counts(&self) -> [usize; 3] {
        let near = self.near.iter().map(|near| near.of.len()).sum();
        [self.walls.of.len(), self.volumes.of.len(), near]
    }

    /// Size of the search trees in bytes.
    pub fn bytes(&self) -> usize {
        let near: usize = self.near.iter().map(|near| near.index.bytes()).sum();
        self.walls.index.bytes() + self.volumes.index.bytes() + near
    }

    /// Notes that for so many ticks no place was known. A wall that the next place lies in was reached on
    /// a path that took so much longer.
    pub fn missed(&mut self, ticks: u64) {
        self.missed = ticks;
        self.past.known = 0;
    }

    /// Runs one tick. Allocates nothing.
    pub fn step(&mut self, motion: &Motion) -> &ContactState {
        let at = motion.position_mm;
        let put_down = motion.stroke != self.stroke;
        if put_down {
            (self.stroke, self.before) = (motion.stroke, None);
            self.past.known = 0;
        }
        let missed = std::mem::take(&mut self.missed);
        let before = self.before.replace(at);
        let found = self.wall(at);
        let touched = found.as_ref().filter(|contact| contact.touch.depth_mm > TOUCHED_MM).copied();
        let was_touching = std::mem::replace(&mut self.touching, touched.is_some());
        self.air_ticks = if touched.is_some() { 0 } else { self.air_ticks.saturating_add(1) };
        if let Some(contact) = touched.as_ref().or(found.as_ref()) {
            self.walls.held = Some(contact.hold());
        }
        // In the air, the surface touched last gives the directions, so that a fading texture goes on as
        // it was.
        self.tangents = touched.map_or(self.tangents, |contact| contact.touch.tangents);
        let tangents = self.tangents;
        let velocity_mm_s = along(tangents, motion.velocity_mm_s);
        let approach = match (before, touched) {
            (Some(before), Some(contact)) if !was_touching => self.approach(before, missed, &contact),
            (None, Some(_)) if !was_touching && put_down => Some((self.settings.put_down_mm_s, 0.0)),
            _ => None,
        };
        let (approach_mm_s, moment) = approach.unwrap_or_default();
        self.past.add(at);
        self.fade(touched.as_ref());
        self.place_mm = match &touched {
            Some(contact) => contact.touch.place_mm,
            None => self.onwards(self.place_mm, tangents, motion.unfiltered_mm_s),
        };
        self.follow(motion.unfiltered_mm_s, touched.as_ref());

        let (near, number) = (self.walls.of(found), self.walls.of(touched).map_or(NONE, |wall| wall.number));
        let depth_mm = touched.map_or(0.0, |contact| contact.touch.depth_mm);
        let (normal, plane_mm) = match found {
            Some(Contact { touch, .. }) => {
                (touch.normal, std::array::from_fn(|k| at[k] + touch.depth_mm * touch.normal[k]))
            }
            None => ([0.0; 3], at),
        };
        let (stiffness, damping) = near.map_or((0.0, 0.0), |w| (w.stiffness_n_per_mm, w.damping_ns_per_m));
        let most = self.settings.max_force_n;
        let hooke = stiffness * depth_mm;
        let outward = dot(motion.unfiltered_mm_s, normal);
        let pushed =
            if touched.is_some() { (hooke - 1e-3 * damping * outward).clamp(0.0, most) } else { 0.0 };
        let volume = self.volumes.find(at);
        self.slots(touched, volume);
        for (near, pull) in self.near.iter_mut().zip(&mut self.state.near) {
            let found = near.find(at);
            *pull = found.map_or(NO_PULL, |Contact { touch, .. }| {
                let slot = near.of(found).copied().unwrap_or(NONE);
                Pull { slot, distance_mm: -touch.depth_mm, normal: touch.normal }
            });
        }
        for i in 0..2 {
            self.state.voices[i] = self.voice(i);
        }
        let [x, y] = self.place_mm;
        let state = &mut self.state;
        state.force_n = hooke.min(most);
        state.depth_mm = depth_mm;
        state.plane_mm = plane_mm;
        state.normal = normal;
        state.stiffness_n_per_mm = stiffness;
        state.damping_ns_per_m = damping;
        state.push_n = normal.map(|n| n * pushed);
        state.tangents = tangents;
        state.place_mm = [x, y, -depth_mm];
        state.velocity_mm_s = velocity_mm_s;
        state.speed_mm_s = velocity_mm_s[0].hypotenuse(velocity_mm_s[1]);
        state.slide_mm_s = along(tangents, motion.unfiltered_mm_s);
        state.surface = number;
        state.volume = self.volumes.of(volume).map_or(NONE, |volume| volume.number);
        state.approach_mm_s = approach_mm_s;
        state.moment = moment;
        state.material = self.material;
        state.network = level(self.network);
        state
    }

    /// Reports the slots of a wall and of a volume. Slots of the wall take precedence.
    fn slots(&mut self, wall: Option<Contact>, volume: Option<Contact>) {
        let (wall, volume) = (self.walls.of(wall), self.volumes.of(volume));
        for (i, slot) in self.state.touching.iter_mut().enumerate() {
            *slot = wall.map_or(NONE, |wall| wall.touching[i]);
        }
        for (i, slot) in self.state.inside.iter_mut().enumerate() {
            let of_wall = wall.map(|wall| wall.inside[i]).filter(|slot| *slot >= 0.0);
            *slot = of_wall.or_else(|| Some(volume?.inside[i])).unwrap_or(NONE);
        }
    }

    /// Finds the wall that is touched, or nearly touched.
    fn wall(&self, at: [f64; 3]) -> Option<Contact> {
        let held = self.walls.held.filter(|_| self.touching || self.settings.anticipate_mm > 0.0);
        self.walls.index.find(at, held)
    }

    /// Speed with which a wall was reached from outside, and the part of the tick at which that was.
    /// `missed` ticks were lost on the way.
    fn approach(&self, before: [f64; 3], missed: u64, contact: &Contact) -> Option<(f64, f64)> {
        let surface = &self.walls.index.entries().get(contact.entry as usize)?.surface;
        let (from, to) = (-surface.depth_mm(before), -contact.touch.depth_mm);
        // A place that comes in steps may be on the surface, or so little inside that it is no touch yet.
        let moment = if from.abs() <= TOUCHED_MM && to < -TOUCHED_MM { 0.0 } else { crossing(from, to)? };
        // The speed is measured over the part of the path that lies outside. In a single tick, a step of
        // the device can look like any speed or none.
        let far = self.past.oldest_first().find_map(|(ticks, place)| {
            let from = -surface.depth_mm(place);
            (from > 0.0 && from.is_finite()).then_some((from - to) / (ticks as f64 * self.tick_s))
        });
        let ticks = 1.0 + missed as f64;
        // The wall was reached in the missed ticks, or in this one.
        let moment = (moment * ticks - missed as f64).max(0.0);
        Some((far.unwrap_or((from - to) / (ticks * self.tick_s)), moment))
    }

    /// Fades the textures towards those of the touched surface.
    fn fade(&mut self, touched: Option<&Contact>) {
        let step = (self.tick_s / self.settings.crossfade_s.max(self.tick_s)).min(1.0);
        let (Some(contact), Some(wall)) = (touched, self.walls.of(touched.copied())) else {
            let airborne_s = self.air_ticks as f64 * self.tick_s;
            if airborne_s > self.settings.hold_s {
                (self.current, self.rested) = (None, true);
                self.voices.iter_mut().for_each(|voice| (voice.of, voice.gain) = (None, 0.0));
                self.network = 0.0;
            }
            return;
        };
        let step = if std::mem::take(&mut self.rested) { 1.0 } else { step };
        if wall.textures.iter().all(|slot| *slot < 0.0) {
            self.current = None;
        } else {
            let hold = Some(contact.hold());
            let known = (0..2).find(|&i| self.voices[i].of == hold && self.voices[i].gain > 0.0);
            let free = (0..2).find(|&i| self.voices[i].gain == 0.0);
            if let Some(i) = known {
                self.current = Some(i);
            } else if let Some(i) = free {
                let voice = &mut self.voices[i];
                *voice = Fading { of: hold, stroke: voice.stroke.wrapping_add(1), ..*voice };
                self.current = Some(i);
            }
        }
        for (i, voice) in self.voices.iter_mut().enumerate() {
            voice.gain = towards(voice.gain, self.current == Some(i), step);
        }
        if wall.material >= 0.0 {
            self.material = wall.material;
        }
        self.network = towards(self.network, wall.material >= 0.0, step);
    }

    /// Moves the places of the textures on. A place follows the touch of its surface. Without one, it
    /// follows the stylus, as if the surface went on.
    fn follow(&mut self, velocity_mm_s: [f64; 3], touched: Option<&Contact>) {
        for i in 0..self.voices.len() {
            let Fading { of, gain, place_mm, tangents, .. } = self.voices[i];
            if gain > 0.0 {
                let voice = match touched.filter(|contact| Some(contact.hold()) == of) {
                    Some(Contact { touch, .. }) => (touch.place_mm, touch.tangents),
                    None => (self.onwards(place_mm, tangents, velocity_mm_s), tangents),
                };
                (self.voices[i].place_mm, self.voices[i].tangents) = voice;
            }
        }
    }

    /// Place one tick later, as if its surface went on.
    fn onwards(&self, place_mm: [f64; 2], tangents: [[f64; 3]; 2], velocity_mm_s: [f64; 3]) -> [f64; 2] {
        let way = along(tangents, velocity_mm_s);
        let here = std::array::from_fn(|k| place_mm[k] + self.tick_s * way[k]);
        if here.iter().all(|x: &f64| x.abs() < FAR_MM) { here } else { place_mm }
    }

    /// Voice as it is now. Its slots are reported beside it.
    fn voice(&mut self, number: usize) -> Voice {
        let voice = self.voices[number];
        let wall = voice.of.and_then(|hold| self.walls.of.get(hold.entry as usize));
        for (i, slot) in self.state.textures[number].iter_mut().enumerate() {
            *slot = wall.map_or(NONE, |wall| wall.textures[i]);
        }
        Voice { level: level(voice.gain), place_mm: voice.place_mm, stroke: voice.stroke as f64 }
    }

    /// Forgets where the stylus was.
    pub fn reset(&mut self) {
        (self.walls.held, self.volumes.held) = (None, None);
        self.near.iter_mut().for_each(|near| near.held = None);
        (self.touching, self.air_ticks, self.before, self.stroke) = (false, 0, None, 0.0);
        (self.past.known, self.missed) = (0, 0);
        (self.tangents, self.voices, self.place_mm) = (FLAT, [SILENT; 2], [0.0; 2]);
        (self.current, self.rested, self.network, self.material) = (None, true, 0.0, 0.0);
    }

    /// Saves or restores the held surfaces and the fades. A state fits only the surfaces that it was
    /// saved with, since it holds their numbers.
    pub fn state(&mut self, state: &mut State<'_>) {
        state
            .keep(&mut self.walls.held)
            .keep(&mut self.volumes.held)
            .keep(&mut self.touching)
            .keep(&mut self.air_ticks)
            .keep(&mut self.before)
            .keep(&mut self.missed)
            .keep(&mut self.past.places)
            .keep(&mut self.past.known)
            .keep(&mut self.tangents)
            .keep(&mut self.place_mm)
            .keep(&mut self.stroke);
        for near in &mut self.near {
            state.keep(&mut near.held);
        }
        for voice in &mut self.voices {
            state.keep(&mut voice.of).keep(&mut voice.gain).keep(&mut voice.place_mm);
            state.keep(&mut voice.tangents).keep(&mut voice.stroke);
        }
        state.keep(&mut self.current).keep(&mut self.rested).keep(&mut self.network).keep(&mut self.material);
        let part = |x: f64| (0.0..=1.0).contains(&x);
        let near = |place: &[f64; 2]| place.iter().all(|x| x.abs() < FAR_MM);
        let length = |tangents: &[[f64; 3]; 2]| tangents.iter().flatten().all(|x| x.abs() < 1.1);
        let sound = |voice: &Fading| part(voice.gain) && length(&voice.tangents) && near(&voice.place_mm);
        self.past.known = self.past.known.min(self.past.places.len());
        state.require(
            self.voices.iter().all(sound)
                && length(&self.tangents)
                && part(self.network)
                && near(&self.place_mm)
                && self.current.is_none_or(|i| i < 2)
                && self.material.is_finite()
                && self.before.iter().chain(&self.past.places).flatten().all(|x| x.is_finite()),
        );
    }
}

/// Collects the surfaces with an effect that acts as far as `reach_mm` in its settings says.
fn near(scene: &Scene, kind: &str) -> Result<Group<f64>, Diagnostic> {
    let slots = scene.slots(kind);
    let mut all = Vec::new();
    for (touchable, slot) in scene.surfaces.iter().zip(&slots.of) {
        if let (Some(named), Some(slot)) = (touchable.effects.of(kind).next(), slot) {
            let reach_mm = named.value.record(kind)?.required("reach_mm")?.f64_in(1e-3..=1000.0, "mm")?;
            all.push((Entry { surface: touchable.surface.clone(), reach_mm }, *slot as f64));
        }
    }
    Group::new(all, scene)
}

const NO_PULL: Pull = Pull { slot: NONE, distance_mm: 0.0, normal: [0.0; 3] };

impl ContactState {
    /// State without contact.
    fn of_nothing(names: &EffectNames) -> Self {
        let none = |names: &[String]| vec![NONE; names.len()];
        Self {
            tangents: FLAT,
            surface: NONE,
            volume: NONE,
            touching: none(&names.touching),
            inside: none(&names.inside),
            near: vec![NO_PULL; names.near.len()],
            textures: [none(&names.textures), none(&names.textures)],
            ..Self::default()
        }
    }
}

/// Moment between two ticks at which a surface was passed, from the distances above it before and now in
/// mm. The answer is a part of the tick, above 0 and at most 1, or `None` if the surface was not passed
/// from outside. The speed of approach is the fall in distance times the tick rate.
fn crossing(before_mm: f64, now_mm: f64) -> Option<f64> {
    let fell = before_mm > 0.0 && now_mm <= 0.0 && before_mm.is_finite() && now_mm.is_finite();
    let part = before_mm / (before_mm - now_mm);
    let part = if part.is_finite() { part.clamp(0.0, 1e6) } else { 0.0 };
    fell.then(|| part.clamp(f64::MIN_POSITIVE, 1.0))
}

/// Level for a gain of equal power: the squares of the two levels of a crossfade add up to 1.
fn level(gain: f64) -> f64 {
    if gain >= 1.0 { 1.0 } else { (std::f64::consts::FRAC_PI_2 * gain).sine() }
}

fn towards(gain: f64, up: bool, step: f64) -> f64 {
    // A last step that only rounding leaves over counts as none.
    const LEFT: f64 = 1e-9;
    let gain = if up { gain + step } else { gain - step };
    if gain > 1.0 - LEFT {
        1.0
    } else if gain < LEFT {
        0.0
    } else {
        gain
    }
}

/// Velocity along two directions; 0 if it is not a number.
fn along(tangents: [[f64; 3]; 2], velocity: [f64; 3]) -> [f64; 2] {
    tangents.map(|t| Some(dot(t, velocity)).filter(|v| v.is_finite()).unwrap_or(0.0))
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
