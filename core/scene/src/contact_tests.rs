use asperity_diagnostics::Source;

use super::*;

const TICK_HZ: f64 = 500.0;
const SETTINGS: ContactSettings = ContactSettings {
    max_force_n: 3.3,
    crossfade_s: 0.02,
    hold_s: 0.02,
    anticipate_mm: 0.0,
    put_down_mm_s: 80.0,
};
const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5)";
const LOOP: &str = "texture: waveform(segments: [(0, 0), (0.5, 1), (1, 0)])";

fn scene(surfaces: &str) -> Scene {
    let text = format!("Scene(version: 1, input: stroke, hysteresis_mm: 0.1, surfaces: {{\n{surfaces}\n}})");
    Scene::parse(&Source::new("s.ron", text)).unwrap_or_else(|e| panic!("{e}"))
}

fn names() -> EffectNames {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    EffectNames {
        touching: names(&["friction"]),
        inside: names(&["vibration", "viscosity"]),
        near: names(&["magnet"]),
        textures: names(&["waveform"]),
    }
}

impl Contacts {
    fn step_once(&mut self, motion: &Motion) -> ContactState {
        self.step(motion).clone()
    }

    /// One tick at rest at a place.
    fn at(&mut self, position_mm: [f64; 3]) -> ContactState {
        self.step_once(&Motion { position_mm, ..Motion::default() })
    }
}

fn contacts(surfaces: &str) -> Contacts {
    Contacts::new(&scene(surfaces), &names(), SETTINGS, TICK_HZ).unwrap()
}

/// Tiles of 20 mm in a row along x from 0 on, each with its effects.
fn tiles(effects: &[&str]) -> String {
    let tile = |(i, e): (usize, &&str)| {
        let x = 10.0 + 20.0 * i as f64;
        format!("\"{i}\": (shape: rectangle(size_mm: (20, 40)), place_mm: ({x}, 0, 0), effects: ({e})),\n")
    };
    effects.iter().enumerate().map(tile).collect()
}

/// A stylus that goes from place to place at a constant velocity, tick by tick.
fn go(contacts: &mut Contacts, from: [f64; 3], to: [f64; 3], ticks: usize) -> Vec<ContactState> {
    let step: [f64; 3] = std::array::from_fn(|k| (to[k] - from[k]) / ticks as f64);
    let velocity = step.map(|s| s * TICK_HZ);
    (0..=ticks)
        .map(|n| {
            let at = std::array::from_fn(|k| from[k] + step[k] * n as f64);
            contacts.step_once(&Motion {
                position_mm: at,
                velocity_mm_s: velocity,
                unfiltered_mm_s: velocity,
                stroke: 0.0,
            })
        })
        .collect()
}

#[test]
fn plane_pushes_by_hookes_law_and_damping_and_never_pulls() {
    let mut c =
        contacts(&format!("\"a\": (shape: plane, effects: ({WALL}, damping: (damping_ns_per_m: 2)))"));
    let at = |z: f64, vz: f64| Motion {
        position_mm: [3.0, -4.0, z],
        velocity_mm_s: [7.0, -9.0, 1.0],
        unfiltered_mm_s: [70.0, -90.0, vz],
        stroke: 0.0,
    };
    let felt = c.step_once(&at(1.0, 0.0));
    assert_eq!((felt.force_n, felt.surface, felt.push_n, felt.normal), (0.0, -1.0, [0.0; 3], [0.0; 3]));
    assert_eq!(felt.velocity_mm_s, [7.0, -9.0]);
    // 0.5 N/mm 2 mm, and 2 N s/m at 100 mm/s is 0.2 N more on the way in.
    let felt = c.step_once(&at(-2.0, -100.0));
    assert_eq!((felt.force_n, felt.depth_mm, felt.surface), (1.0, 2.0, 0.0));
    assert!((felt.push_n[2] - 1.2).abs() < 1e-12 && felt.push_n[0] == 0.0);
    assert_eq!((felt.velocity_mm_s, felt.slide_mm_s), ([7.0, -9.0], [70.0, -90.0]));
    assert_eq!(felt.speed_mm_s, 7.0_f64.hypot(9.0));
    assert_eq!((felt.normal, felt.plane_mm), ([0.0, 0.0, 1.0], [3.0, -4.0, 0.0]));
    // On the way out the wall lets go and does not pull.
    assert_eq!(c.step_once(&at(-2.0, 1000.0)).push_n, [0.0; 3]);
    assert_eq!(c.step_once(&at(-20.0, 0.0)).push_n, [0.0, 0.0, 3.3]);
}

#[test]
fn turned_surface_uses_its_own_axes_for_velocity_and_force() {
    // Turned by 90 degrees about y: z, the way out, becomes x; x becomes -z.
    let mut c = contacts(&format!("\"a\": (shape: plane, turn_deg: (0, 90, 0), effects: ({WALL}))"));
    let felt = c.step_once(&Motion {
        position_mm: [-1.0, 5.0, 6.0],
        velocity_mm_s: [1.0, 2.0, 3.0],
        unfiltered_mm_s: [10.0, 20.0, 30.0],
        stroke: 0.0,
    });
    assert_eq!((felt.force_n, felt.push_n), (0.5, [0.5, 0.0, 0.0]));
    assert_eq!((felt.velocity_mm_s, felt.slide_mm_s), ([-3.0, 2.0], [-30.0, 20.0]));
    let back: [f64; 3] = std::array::from_fn(|k| {
        felt.slide_mm_s[0] * felt.tangents[0][k] + felt.slide_mm_s[1] * felt.tangents[1][k]
    });
    assert_eq!(back, [0.0, 20.0, 30.0]);
}

#[test]
fn wall_is_reached_once_with_speed_and_moment_of_approach() {
    let mut c = contacts(&format!("\"a\": (shape: plane, place_mm: (0, 0, 2), effects: ({WALL}))"));
    // 0.3 mm a tick: 150 mm/s. From 2.5 the plane at 2 is passed after 1 2/3 ticks.
    let felt = go(&mut c, [0.0, 0.0, 2.5], [0.0, 0.0, 1.0], 5);
    let hits: Vec<usize> = (0..felt.len()).filter(|&n| felt[n].approach_mm_s > 0.0).collect();
    assert_eq!(hits, [2]);
    assert!((felt[2].approach_mm_s - 150.0).abs() < 1e-9 && (felt[2].moment - 2.0 / 3.0).abs() < 1e-9);
    // A place that comes in steps of 0.1 mm may be on the wall for a tick. The wall is still reached, and
    // only once.
    for steps in [[2.1, 2.0, 1.9, 1.8], [2.05, 2.0, 1.95, 1.9], [2.0, 2.0, 1.7, 1.4]] {
        let mut c = contacts(&format!("\"a\": (shape: plane, place_mm: (0, 0, 2), effects: ({WALL}))"));
        let felt = steps.map(|z| c.at([0.0, 0.0, z]));
        let hits: Vec<usize> = (0..4).filter(|&n| felt[n].approach_mm_s > 0.0).collect();
        assert_eq!(hits, [2], "{steps:?}");
        let wanted = (steps[1] - steps[2]) * TICK_HZ;
        assert!((felt[2].approach_mm_s - wanted).abs() < 1e-6 && felt[2].moment < 1e-4, "{steps:?}");
    }
    // Up again and put down elsewhere. No path lies between, so the speed of arrival is not known.
    go(&mut c, [0.0, 0.0, 1.0], [0.0, 0.0, 3.0], 5);
    let put = |c: &mut Contacts, z: f64, stroke: f64| {
        c.step_once(&Motion { position_mm: [9.0, 9.0, z], stroke, ..Motion::default() })
    };
    let felt = put(&mut c, 1.0, 1.0);
    assert_eq!((felt.surface, felt.approach_mm_s, felt.moment), (0.0, 80.0, 0.0));
    // A stylus that is reported anew on the wall, as after a stall, does not reach it a second time. Nor
    // does a stylus that is put down in the air.
    assert_eq!(put(&mut c, 1.0, 2.0).approach_mm_s, 0.0);
    assert_eq!(put(&mut c, 3.0, 2.0).approach_mm_s, 0.0);
    assert_eq!(put(&mut c, 2.5, 3.0).approach_mm_s, 0.0);
    assert!((put(&mut c, 1.9, 3.0).approach_mm_s - 300.0).abs() < 1e-9);
    // Nor does a stylus that starts in a wall, nor one that moves along it.
    c.reset();
    assert!(go(&mut c, [0.0; 3], [50.0, 0.0, 0.0], 20).iter().all(|f| f.approach_mm_s == 0.0));
}

#[test]
fn lost_ticks_do_not_raise_the_approach_speed() {
    for missed in [1, 4, 49] {
        let mut c = contacts(&format!("\"a\": (shape: plane, effects: ({WALL}))"));
        // 150 mm/s, for all missed ticks and one more. The wall is passed after a sixth of the last tick.
        let z = 0.05 - 0.3;
        let from = z + 0.3 * (missed as f64 + 1.0);
        c.at([0.0, 0.0, from]);
        c.missed(missed);
        let felt = c.at([0.0, 0.0, z]);
        assert!((felt.approach_mm_s - 150.0).abs() < 1e-9, "{missed}: {}", felt.approach_mm_s);
        assert!((felt.moment - 1.0 / 6.0).abs() < 1e-9, "{missed}: {}", felt.moment);
        // The next wall is reached as usual.
        c.at([0.0, 0.0, 0.3]);
        let felt = c.at([0.0, 0.0, -0.3]);
        assert!((felt.approach_mm_s - 300.0).abs() < 1e-9, "{missed}: {}", felt.approach_mm_s);
    }
}

#[test]
fn approach_with_position_steps_is_measured_over_20_ms() {
    let text = format!(
        "Scene(version: 1, input: stroke, device: (position_step_mm: 0.055), \
         surfaces: {{\"a\": (shape: plane, effects: ({WALL}))}})"
    );
    let scene = Scene::parse(&Source::new("s.ron", text)).unwrap();
    for tick_hz in [500.0, 1000.0, 4000.0] {
        for speed in [20.0, 60.0, 200.0] {
            let mut c = Contacts::new(&scene, &names(), SETTINGS, tick_hz).unwrap();
            let felt = (0..(0.5 * tick_hz) as usize).map(|n| {
                let z: f64 = 3.01 - speed * n as f64 / tick_hz;
                c.at([0.0, 0.0, 0.055 * (z / 0.055).round()])
            });
            let told: Vec<f64> = felt.map(|f| f.approach_mm_s).filter(|v| *v > 0.0).collect();
            // The error is a step of 0.055 mm at either end of 20 ms, or of a path of 3 mm.
            let off = 2.0 * 0.055 / f64::min(0.02, 3.0 / speed);
            assert!(
                told.len() == 1 && (told[0] - speed).abs() <= off,
                "{told:?} for {speed} mm/s at {tick_hz} Hz"
            );
        }
    }
    // If the stylus left the wall within that time, the approach counts from its oldest place outside.
    let mut c = Contacts::new(&scene, &names(), SETTINGS, 1000.0).unwrap();
    let heights = [0.5, -0.5, -0.5, -0.5, 0.5, 1.0, 0.5, 0.0, -0.5];
    let told = heights.map(|z| c.at([0.0, 0.0, z]).approach_mm_s);
    assert!(told[1] > 0.0 && told[8] > 0.0 && told[8] <= 1000.0, "{told:?}");
}

#[test]
fn textures_crossfade_between_tiles_at_equal_power_in_set_time() {
    let effects = format!("{WALL}, {LOOP}");
    let mut c = contacts(&tiles(&[&effects, &effects.replace("(0.5, 1)", "(0.5, 2)")]));
    let felt = go(&mut c, [10.0, 0.0, -1.0], [30.0, 0.0, -1.0], 100);
    assert_eq!((felt[0].voices[0].level, felt[0].voices[1].level), (1.0, 0.0), "at once from the air");
    assert_eq!((felt[0].textures[0][0], felt[60].textures[1][0]), (0.0, 1.0));
    for f in &felt {
        let [a, b] = f.voices;
        assert!((a.level.powi(2) + b.level.powi(2) - 1.0).abs() < 1e-12, "{a:?} {b:?}");
    }
    let fading = felt.iter().filter(|f| f.voices[0].level > 0.0 && f.voices[0].level < 1.0).count();
    // 20 ms are 10 ticks, so 9 lie between the ends.
    assert_eq!(fading, 9);
    assert_eq!(felt[100].voices[0].level, 0.0);
    // Each voice keeps to its own surface: 0.2 mm per tick, also for the voice that fades.
    for pair in felt.windows(2) {
        for voice in 0..2 {
            let (x, y) = (&pair[0].voices[voice], &pair[1].voices[voice]);
            if x.stroke == y.stroke && x.level > 0.0 && y.level > 0.0 {
                assert!((y.place_mm[0] - x.place_mm[0] - 0.2).abs() < 1e-9, "{x:?} {y:?}");
            }
        }
    }
    assert_eq!(felt[0].voices[1].stroke + 1.0, felt[100].voices[1].stroke, "of another surface");
}

#[test]
fn third_tile_waits_for_a_voice_and_return_reverses_the_fade() {
    let effects = format!("{WALL}, {LOOP}");
    let all: Vec<String> = (1..4).map(|i| effects.replace("(0.5, 1)", &format!("(0.5, {i})"))).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let mut c = contacts(&tiles(&all));
    let heard = |f: &ContactState, slot: f64| -> f64 {
        f.voices.iter().zip(&f.textures).filter(|(_, t)| t[0] == slot).map(|(v, _)| v.level).sum()
    };
    go(&mut c, [18.0, 0.0, -1.0], [18.0, 0.0, -1.0], 5);
    // Over the middle tile within 8 ms.
    let over = go(&mut c, [18.0, 0.0, -1.0], [42.0, 0.0, -1.0], 5);
    assert!(over.iter().all(|f| heard(f, 2.0) == 0.0), "both voices are taken");
    let then = go(&mut c, [42.0, 0.0, -1.0], [42.0, 0.0, -1.0], 40);
    assert!(heard(&then[40], 2.0) == 1.0 && heard(&then[40], 0.0) == 0.0 && heard(&then[40], 1.0) == 0.0);
    let mut before = over.last().unwrap().voices;
    for f in &then {
        for (old, new) in before.iter().zip(&f.voices) {
            assert!(old.stroke == new.stroke || old.level == 0.0, "a voice that sounds changes its surface");
            assert!((old.level - new.level).abs() < 0.16, "{old:?} {new:?}");
        }
        before = f.voices;
    }
    // Back and forth over an edge faster than a fade uses the same two voices.
    let strokes = before.map(|v| v.stroke);
    let there = go(&mut c, [42.0, 0.0, -1.0], [39.0, 0.0, -1.0], 3);
    let back = go(&mut c, [39.0, 0.0, -1.0], [42.0, 0.0, -1.0], 3);
    assert!(heard(&there[3], 2.0) < 1.0);
    let end = go(&mut c, [42.0, 0.0, -1.0], [42.0, 0.0, -1.0], 10);
    let strokes_then = end[10].voices.map(|v| v.stroke);
    assert_eq!(strokes_then[0] + strokes_then[1], strokes[0] + strokes[1] + 1.0, "{back:?}");
    assert_eq!(heard(&end[10], 2.0), 1.0);
}

#[test]
fn voice_is_held_in_the_air_and_next_touch_starts_at_full_level() {
    let effects = format!("{WALL}, {LOOP}");
    let mut c = contacts(&tiles(&[&effects, WALL]));
    go(&mut c, [10.0, 0.0, -1.0], [12.0, 0.0, -1.0], 10);
    let air = go(&mut c, [12.0, 0.0, 1.0], [16.0, 0.0, 1.0], 20);
    let stays = air.iter().take_while(|f| f.voices[0].level == 1.0).count();
    // 20 ms and not less.
    assert_eq!(stays, 10);
    assert!(
        air[..stays]
            .windows(2)
            .all(|w| { (w[1].voices[0].place_mm[0] - w[0].voices[0].place_mm[0] - 0.2).abs() < 1e-9 })
    );
    assert!(air[stays..].iter().all(|f| f.voices.iter().all(|v| v.level == 0.0)));
    let again = go(&mut c, [16.0, 0.0, -1.0], [16.0, 0.0, -1.0], 1);
    assert_eq!(again[0].voices[0].level, 1.0);
    // On a tile without texture the voice fades out. Back on the first tile it fades in, since that is no
    // landing.
    let off = go(&mut c, [19.9, 0.0, -1.0], [21.0, 0.0, -1.0], 30);
    assert!(off[30].voices.iter().all(|v| v.level == 0.0));
    let on = go(&mut c, [21.0, 0.0, -1.0], [19.0, 0.0, -1.0], 10);
    let first = on.iter().flat_map(|f| f.voices).map(|v| v.level).find(|l| *l > 0.0).unwrap();
    assert!(first < 0.2, "{first}");
}

#[test]
fn volume_acts_beside_a_wall_but_effects_of_the_wall_win() {
    let mut c = contacts(&format!(
        "\"honey\": (shape: box(size_mm: (40, 40, 20)), effects: \
         (viscosity: (viscosity_ns_per_m: 1), vibration: (frequency_hz: 90, amplitude_m_s2: 1))),\n\
         \"floor\": (shape: plane, effects: ({WALL})),\n\
         \"buzz\": (shape: rectangle(size_mm: (4, 4)), place_mm: (10, 0, 0.5), effects: \
         ({WALL}, vibration: (frequency_hz: 150, amplitude_m_s2: 1)))"
    ));
    let mut at = |x: f64, z: f64| c.at([x, 0.0, z]);
    let felt = at(0.0, 5.0);
    assert_eq!((felt.surface, felt.volume), (-1.0, 0.0));
    assert_eq!((felt.volume, felt.inside[1], felt.inside[0], felt.force_n), (0.0, 0.0, 0.0, 0.0));
    // Deep in the honey and slightly in the floor: both act.
    let felt = at(0.0, -1.0);
    assert_eq!((felt.surface, felt.inside[1], felt.inside[0], felt.force_n), (1.0, 0.0, 0.0, 0.5));
    let felt = at(10.0, 0.2);
    assert_eq!((felt.surface, felt.inside[1], felt.inside[0]), (2.0, 0.0, 1.0));
    let felt = at(0.0, 11.0);
    assert_eq!((felt.volume, felt.inside[1], felt.inside[0]), (-1.0, -1.0, -1.0));
}

#[test]
fn magnet_is_reported_within_its_reach_on_both_sides() {
    let mut c = contacts(&format!(
        "\"a\": (shape: sphere(radius_mm: 10), effects: ({WALL}, \
         magnet: (stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)))"
    ));
    let mut at = |z: f64| c.at([0.0, 0.0, z]);
    assert_eq!(at(15.0).near[0].slot, -1.0);
    let felt = at(12.0);
    assert_eq!((felt.near[0].slot, felt.surface, felt.near[0].normal), (0.0, -1.0, [0.0, 0.0, 1.0]));
    assert!((felt.near[0].distance_mm - 2.0).abs() < 1e-12);
    let felt = at(9.0);
    assert!((felt.near[0].distance_mm + 1.0).abs() < 1e-12 && felt.surface == 0.0);
}

#[test]
fn invalid_places_touch_nothing_and_leave_no_trace() {
    let effects = format!("{WALL}, {LOOP}, tap: (sinusoids: [(frequency_hz: 180, decay_ms: 9, gain: 40)])");
    let mut c = contacts(&tiles(&[&effects]));
    go(&mut c, [10.0, 0.0, 1.0], [10.0, 0.0, -1.0], 4);
    for bad in [f64::NAN, f64::INFINITY, -1e300] {
        let felt = c.at([bad; 3]);
        assert!(felt.force_n == 0.0 && felt.surface == -1.0 && felt.approach_mm_s == 0.0);
        assert!(felt.velocity_mm_s.iter().all(|v| v.is_finite()), "{felt:?}");
        assert!(felt.voices.iter().all(|v| v.place_mm.iter().all(|x| x.is_finite())));
    }
    assert_eq!(c.at([10.0, 0.0, -1.0]).force_n, 0.5);
}

#[test]
fn crossing_is_where_the_distance_is_zero() {
    assert_eq!(crossing(0.3, -0.1), Some(0.3 / 0.4));
    assert_eq!((crossing(0.2, 0.0), crossing(0.0, -0.2), crossing(0.5, 0.1)), (Some(1.0), None, None));
    assert_eq!((crossing(-0.1, -0.3), crossing(-0.1, 0.4)), (None, None));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!((crossing(bad, -1.0), crossing(1.0, bad)), (None, None));
    }
    assert!(crossing(f64::MAX, -f64::MAX).is_some_and(|p| (0.0..=1.0).contains(&p)));
}
