//! What a stylus touches in a scene, tick by tick.

use asperity_diagnostics::Diagnostic;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use super::felt::{ContactSettings, Felt, Motion, VOICED, Voice};
use super::{Kind, Scene, Slots};
use crate::effect::crossing;
use crate::space::{Contact, Entry, Hold, Index};

/// How deep a stylus is at least in what it touches \[mm\].
const TOUCHED_MM: f64 = 1e-6;
/// No place on a surface is further from its middle \[mm\].
const FAR_MM: f64 = 1e7;
/// What no surface, slot or material is.
const NONE: f64 = -1.0;

/// What a wall has, beside its shape.
#[derive(Clone, Copy, Debug)]
struct Wall {
    number: f64,
    stiffness_n_per_mm: f64,
    damping_ns_per_m: f64,
    friction: f64,
    tap: f64,
    material: f64,
    voiced: [f64; 3],
    vibration: f64,
    viscosity: f64,
}

/// What a volume has that does not push back.
#[derive(Clone, Copy, Debug)]
struct Zone {
    number: f64,
    vibration: f64,
    viscosity: f64,
}

/// One of two that fade.
#[derive(Clone, Copy, Debug)]
struct Fading {
    of: Option<Hold>,
    gain: f64,
    place_mm: [f64; 2],
    /// Along which the place goes on where the surface is no longer touched.
    tangents: [[f64; 3]; 2],
    stroke: u64,
}

const SILENT: Fading = Fading { of: None, gain: 0.0, place_mm: [0.0; 2], tangents: FLAT, stroke: 0 };
/// Over how long an approach is measured where places come in steps \[s\].
const APPROACH_S: f64 = 0.02;
/// Most places of that.
const MOST_PLACES: f64 = 80.0;

/// Where a stylus was in the last ticks.
#[derive(Clone, Debug)]
struct Past {
    /// A ring.
    places: Vec<[f64; 3]>,
    next: usize,
    known: usize,
}

impl Past {
    fn new(ticks: f64) -> Self {
        Self { places: vec![[0.0; 3]; ticks.ceil().clamp(1.0, MOST_PLACES) as usize], next: 0, known: 0 }
    }

    fn add(&mut self, place: [f64; 3]) {
        if let Some(to) = self.places.get_mut(self.next) {
            *to = place;
        }
        self.next = (self.next + 1) % self.places.len();
        self.known = (self.known + 1).min(self.places.len());
    }

    /// How many ticks ago, and where, the longest ago first.
    fn iter(&self) -> impl Iterator<Item = (u32, [f64; 3])> {
        let count = self.places.len();
        (1..=self.known)
            .rev()
            .filter_map(move |ago| Some((ago as u32, *self.places.get((self.next + count - ago) % count)?)))
    }

    fn is_sound(&self) -> bool {
        let finite = self.places.iter().flatten().all(|x| x.is_finite());
        finite && self.next < self.places.len() && self.known <= self.places.len()
    }
}

/// Directions along a surface that is not turned.
const FLAT: [[f64; 3]; 2] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Finds what a stylus touches, and says what each effect is to do about it.
///
/// Three searches at most, each as long for many surfaces as for one: among the walls (surfaces with a
/// stiffness), the volumes (those without, that vibrate or drag) and the magnets. The deepest of each is
/// felt. A wall's vibration and drag go before a volume's; of magnets the nearest pulls.
///
/// Textures go from one wall to the next by a crossfade of equal power between two voices. A third wall
/// waits until one of them has faded. A stylus that leaves a wall keeps its voice for
/// [`hold_s`](ContactSettings::hold_s), so that what follows can fade by itself: what it touches after that
/// begins at full level.
#[derive(Clone, Debug)]
pub struct Contacts {
    settings: ContactSettings,
    tick_s: f64,
    walls: Index,
    of_walls: Vec<Wall>,
    zones: Index,
    of_zones: Vec<Zone>,
    magnets: Index,
    /// Slots of the magnets, and numbers of their surfaces.
    of_magnets: Vec<[f64; 2]>,
    held: [Option<Hold>; 3],
    /// Whether the wall that is held is touched.
    touching: bool,
    air_ticks: u64,
    before: Option<[f64; 3]>,
    /// Ticks since then of which nothing is known.
    missed: u64,
    past: Past,
    /// Of what was touched last.
    tangents: [[f64; 3]; 2],
    stroke: f64,
    /// Where along the surface the stylus is.
    place_mm: [f64; 2],
    voices: [Fading; 2],
    current: Option<usize>,
    /// Nothing was touched for so long that what is touched next begins at full level.
    rested: bool,
    network: f64,
    material: f64,
}

impl Contacts {
    /// Contacts with the surfaces of a scene, for `run_hz` calls a second.
    ///
    /// # Errors
    /// More surfaces than an [`Index`] takes.
    pub fn new(scene: &Scene, settings: ContactSettings, run_hz: f64) -> Result<Self, Diagnostic> {
        let slots: Vec<(Kind, Slots)> = Kind::ALL.iter().map(|kind| (*kind, scene.slots(*kind))).collect();
        let slot = |kind: Kind, number: usize| -> f64 {
            let slots = slots.iter().find(|(k, _)| *k == kind);
            slots.and_then(|(_, s)| *s.of.get(number)?).map_or(NONE, |slot| slot as f64)
        };
        let (mut walls, mut of_walls) = (Vec::new(), Vec::new());
        let (mut zones, mut of_zones) = (Vec::new(), Vec::new());
        let (mut magnets, mut of_magnets) = (Vec::new(), Vec::new());
        for (number, touchable) in scene.surfaces.iter().enumerate() {
            let entry = |reach_mm| Entry { surface: touchable.surface.clone(), reach_mm };
            let effects = &touchable.effects;
            let (vibration, viscosity) = (slot(Kind::Vibration, number), slot(Kind::Viscosity, number));
            if let Some(stiffness) = &effects.stiffness {
                walls.push(entry(settings.anticipate_mm));
                of_walls.push(Wall {
                    number: number as f64,
                    stiffness_n_per_mm: stiffness.of,
                    damping_ns_per_m: effects.damping.as_ref().map_or(0.0, |d| d.of),
                    friction: slot(Kind::Friction, number),
                    tap: slot(Kind::Tap, number),
                    material: slot(Kind::Network, number),
                    voiced: VOICED.map(|kind| slot(kind, number)),
                    vibration,
                    viscosity,
                });
            } else if vibration >= 0.0 || viscosity >= 0.0 {
                zones.push(entry(0.0));
                of_zones.push(Zone { number: number as f64, vibration, viscosity });
            }
            if let Some(magnet) = &effects.magnet {
                magnets.push(entry(magnet.of.reach_mm));
                of_magnets.push([slot(Kind::Magnet, number), number as f64]);
            }
        }
        let index = |entries| Index::new(entries, scene.hysteresis_mm);
        Ok(Self {
            settings,
            tick_s: 1.0 / run_hz,
            walls: index(walls)?,
            of_walls,
            zones: index(zones)?,
            of_zones,
            magnets: index(magnets)?,
            of_magnets,
            held: [None; 3],
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
        })
    }

    /// Walls, volumes and magnets.
    pub fn counts(&self) -> [usize; 3] {
        [self.of_walls.len(), self.of_zones.len(), self.of_magnets.len()]
    }

    /// Bytes of the search trees.
    pub fn bytes(&self) -> usize {
        self.walls.bytes() + self.zones.bytes() + self.magnets.bytes()
    }

    /// So many ticks have gone by of which no place is known: a wall that the next one lies in was reached
    /// on a way that took so much longer.
    pub fn missed(&mut self, ticks: u64) {
        self.missed = ticks;
        self.past.known = 0;
    }

    /// One tick. Nothing is allocated.
    pub fn step(&mut self, motion: &Motion) -> Felt {
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
            self.held[0] = Some(contact.hold());
        }
        // In the air what was touched last says which way is along, so that what fades goes on as it was.
        self.tangents = touched.map_or(self.tangents, |contact| contact.touch.tangents);
        let tangents = self.tangents;
        let velocity_mm_s = along(tangents, motion.velocity_mm_s);
        let wall = touched.and_then(|contact| self.of_walls.get(contact.entry as usize).copied());
        let approach = match (before, touched) {
            (Some(before), Some(contact)) if !was_touching => self.approach(before, missed, &contact),
            (None, Some(_)) if !was_touching && put_down => Some((self.settings.put_down_mm_s, 0.0)),
            _ => None,
        };
        let (approach_mm_s, moment) = approach.unwrap_or_default();
        self.past.add(at);
        self.fade(touched.as_ref(), wall.as_ref());
        self.place_mm = match &touched {
            Some(contact) => contact.touch.place_mm,
            None => self.onwards(self.place_mm, tangents, motion.unfiltered_mm_s),
        };
        self.follow(motion.unfiltered_mm_s, touched.as_ref());

        let near = found.and_then(|contact| self.of_walls.get(contact.entry as usize).copied());
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
        let zone = self.zone(at);
        let of_zone = |pick: fn(&Zone) -> f64| zone.as_ref().map_or(NONE, pick);
        let of_wall = |pick: fn(&Wall) -> f64| wall.as_ref().map_or(NONE, pick);
        let first = |wall: f64, zone: f64| if wall >= 0.0 { wall } else { zone };
        let (magnet, magnet_distance_mm, magnet_normal) = self.magnet(at);
        Felt {
            force_n: hooke.min(most),
            depth_mm,
            plane_mm,
            normal,
            stiffness_n_per_mm: stiffness,
            damping_ns_per_m: damping,
            push_n: normal.map(|n| n * pushed),
            tangents,
            place_mm: [self.place_mm[0], self.place_mm[1], -depth_mm],
            velocity_mm_s,
            speed_mm_s: velocity_mm_s[0].hypotenuse(velocity_mm_s[1]),
            slide_mm_s: along(tangents, motion.unfiltered_mm_s),
            surface: of_wall(|w| w.number),
            volume: of_zone(|z| z.number),
            approach_mm_s,
            moment,
            friction: of_wall(|w| w.friction),
            tap: of_wall(|w| w.tap),
            material: self.material,
            network: level(self.network),
            voices: self.voices.map(|voice| self.voice(&voice)),
            vibration: first(of_wall(|w| w.vibration), of_zone(|z| z.vibration)),
            viscosity: first(of_wall(|w| w.viscosity), of_zone(|z| z.viscosity)),
            magnet,
            magnet_distance_mm,
            magnet_normal,
        }
    }

    /// The wall that is touched, or near to be.
    fn wall(&self, at: [f64; 3]) -> Option<Contact> {
        let held = self.held[0].filter(|_| self.touching || self.settings.anticipate_mm > 0.0);
        if self.settings.anticipate_mm > 0.0 {
            self.walls.nearest(at, held)
        } else {
            self.walls.deepest(at, held)
        }
    }

    /// Speed and part of the tick at which a wall was reached from outside, where so many ticks were missed
    /// on the way.
    fn approach(&self, before: [f64; 3], missed: u64, contact: &Contact) -> Option<(f64, f64)> {
        let surface = &self.walls.entries().get(contact.entry as usize)?.surface;
        let (from, to) = (-surface.depth_mm(before), -contact.touch.depth_mm);
        // A place that comes in steps may be on the surface, or as little within it as is no touch yet.
        let moment = if from.abs() <= TOUCHED_MM && to < -TOUCHED_MM { 0.0 } else { crossing(from, to)? };
        // Over as long a way as lies outside, since in one tick a step of the device is any speed or none.
        let far = self.past.iter().find_map(|(ticks, place)| {
            let from = -surface.depth_mm(place);
            (from > 0.0 && from.is_finite()).then_some((from - to) / (f64::from(ticks) * self.tick_s))
        });
        let ticks = 1.0 + missed as f64;
        // Before this tick, of what went by, or in it.
        let moment = (moment * ticks - missed as f64).max(0.0);
        Some((far.unwrap_or((from - to) / (ticks * self.tick_s)), moment))
    }

    fn zone(&mut self, at: [f64; 3]) -> Option<Zone> {
        if self.of_zones.is_empty() {
            return None;
        }
        let found = self.zones.deepest(at, self.held[1]);
        self.held[1] = found.map(|contact| contact.hold());
        self.of_zones.get(found?.entry as usize).copied()
    }

    fn magnet(&mut self, at: [f64; 3]) -> (f64, f64, [f64; 3]) {
        let none = (NONE, 0.0, [0.0; 3]);
        if self.of_magnets.is_empty() {
            return none;
        }
        let found = self.magnets.nearest(at, self.held[2]);
        self.held[2] = found.map(|contact| contact.hold());
        let Some(contact) = found else { return none };
        let slot = self.of_magnets.get(contact.entry as usize).map_or(NONE, |[slot, _]| *slot);
        (slot, -contact.touch.depth_mm, contact.touch.normal)
    }

    /// Takes textures on towards what is touched.
    fn fade(&mut self, touched: Option<&Contact>, wall: Option<&Wall>) {
        let step = (self.tick_s / self.settings.crossfade_s.max(self.tick_s)).min(1.0);
        let (Some(contact), Some(wall)) = (touched, wall) else {
            let airborne_s = self.air_ticks as f64 * self.tick_s;
            if airborne_s > self.settings.hold_s {
                (self.current, self.rested) = (None, true);
                self.voices.iter_mut().for_each(|voice| (voice.of, voice.gain) = (None, 0.0));
                self.network = 0.0;
            }
            return;
        };
        let step = if std::mem::take(&mut self.rested) { 1.0 } else { step };
        if wall.voiced.iter().all(|slot| *slot < 0.0) {
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

    /// Takes the places of textures on: to where their surface is touched, else as far as the stylus goes,
    /// as if the surface went on.
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

    /// A place a tick later, as if its surface went on.
    fn onwards(&self, place_mm: [f64; 2], tangents: [[f64; 3]; 2], velocity_mm_s: [f64; 3]) -> [f64; 2] {
        let way = along(tangents, velocity_mm_s);
        let here = std::array::from_fn(|k| place_mm[k] + self.tick_s * way[k]);
        if here.iter().all(|x: &f64| x.abs() < FAR_MM) { here } else { place_mm }
    }

    fn voice(&self, voice: &Fading) -> Voice {
        let wall = voice.of.and_then(|hold| self.of_walls.get(hold.entry as usize));
        Voice {
            level: level(voice.gain),
            place_mm: voice.place_mm,
            stroke: voice.stroke as f64,
            slots: wall.map_or([NONE; 3], |wall| wall.voiced),
        }
    }

    /// Forgets where the stylus was.
    pub fn reset(&mut self) {
        self.held = [None; 3];
        (self.touching, self.air_ticks, self.before, self.stroke) = (false, 0, None, 0.0);
        (self.past.known, self.missed) = (0, 0);
        (self.tangents, self.voices, self.place_mm) = (FLAT, [SILENT; 2], [0.0; 2]);
        (self.current, self.rested, self.network, self.material) = (None, true, 0.0, 0.0);
    }

    /// What is held, and how far it has faded. Where surfaces are others than before, their numbers mean
    /// others.
    pub fn state(&mut self, state: &mut State<'_>) {
        state
            .keep(&mut self.held)
            .keep(&mut self.touching)
            .keep(&mut self.air_ticks)
            .keep(&mut self.before)
            .keep(&mut self.missed)
            .keep(&mut self.past.places[..])
            .keep(&mut self.past.next)
            .keep(&mut self.past.known)
            .keep(&mut self.tangents)
            .keep(&mut self.place_mm)
            .keep(&mut self.stroke);
        for voice in &mut self.voices {
            state.keep(&mut voice.of).keep(&mut voice.gain).keep(&mut voice.place_mm);
            state.keep(&mut voice.tangents).keep(&mut voice.stroke);
        }
        state.keep(&mut self.current).keep(&mut self.rested).keep(&mut self.network).keep(&mut self.material);
        if state.restores() {
            let part = |x: f64| (0.0..=1.0).contains(&x);
            let length = |tangents: &[[f64; 3]; 2]| tangents.iter().flatten().all(|x| x.abs() < 1.1);
            let sound = self.voices.iter().all(|voice| {
                part(voice.gain) && length(&voice.tangents) && voice.place_mm.iter().all(|x| x.abs() < FAR_MM)
            }) && length(&self.tangents)
                && part(self.network)
                && self.place_mm.iter().all(|x| x.abs() < FAR_MM)
                && self.current.is_none_or(|i| i < 2)
                && self.material.is_finite()
                && self.before.is_none_or(|p| p.iter().all(|x| x.is_finite()))
                && self.past.is_sound();
            if !sound {
                self.reset();
            }
            state.require(sound);
        }
    }
}

/// Equal power: the squares of two that fade over into one another add up to 1.
fn level(gain: f64) -> f64 {
    if gain >= 1.0 { 1.0 } else { (std::f64::consts::FRAC_PI_2 * gain).sine() }
}

fn towards(gain: f64, up: bool, step: f64) -> f64 {
    // A last step that rounding left over is none.
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

/// A velocity along two directions; 0 where it is no number.
fn along(tangents: [[f64; 3]; 2], velocity: [f64; 3]) -> [f64; 2] {
    tangents.map(|t| Some(dot(t, velocity)).filter(|v| v.is_finite()).unwrap_or(0.0))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
