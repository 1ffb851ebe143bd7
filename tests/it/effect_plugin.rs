//! An effect that a plugin brings: a scene uses it by its name, like a built-in one.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use asperity_accuracy::npy;
use harness::{Room, csv, node, plugins, run};

/// The template's effect in every language.
fn libraries(dir: &Room) -> Vec<PathBuf> {
    let [c, cpp] = plugins::templates(dir, "effect", "my_effect");
    vec![plugins::rust("my_effect"), c, cpp]
}

/// Writes a scene of a wall with the effect, a wall without, and a stroke over both at 50 mm/s.
fn scene(dir: &Room, plugin: &Path, settings: &str) {
    let surface = |name: &str, x: i32, more: &str| {
        format!(
            "{name:?}: (shape: rectangle(size_mm: (40, 40)), place_mm: ({x}, 0, 0), \
             effects: (stiffness: (stiffness_n_per_mm: 0.5){more})),\n"
        )
    };
    let text = format!(
        "Scene(\nversion: 1, tick_hz: 1000, audio_hz: 48000, plugins: [{:?}],\n\
         input: trajectory(file: \"t.csv\"), device: (damping_ns_per_m: 2),\nsurfaces: {{\n{}{}}})\n",
        plugin.display().to_string(),
        surface("ridges", -20, &format!(",\nmy_effect: {settings}")),
        surface("smooth", 20, ""),
    );
    dir.write("s.ron", text);
    dir.write("t.csv", csv(1.5, |t| [-35.0 + 50.0 * t, 0.0, -1.0]));
}

#[test]
fn plugin_effect_in_every_language_follows_its_law() {
    let dir = Room::new();
    for library in libraries(&dir) {
        scene(&dir, &library, "(force_n: 0.2, spacing_mm: 4)");
        let probes = "--probe my_effect.force=f.npy --probe contact.place=p.npy";
        dir.run(&format!("render s.ron {probes} --report r.json")).ok();
        let read = |name: &str| npy::read(dir.join(name)).unwrap().values.into_f64();
        let (force, place) = (read("f.npy"), read("p.npy"));
        let mut on = 0;
        for (force, place) in force.chunks(3).zip(place.chunks(3)).take(700) {
            let wanted = -0.2 * (TAU * place[0] / 4.0).sin();
            assert!((force[0] - wanted).abs() < 1e-6 && force[1] == 0.0, "{force:?} {wanted}");
            on += usize::from(force[0] != 0.0);
        }
        assert!(on > 600, "{on}");
        // On the smooth wall it lets go, and is called no more.
        assert!(force[3 * 1000..].iter().all(|x| *x == 0.0));
        let report = dir.json("r.json");
        let [calls, slept] = ["calls", "slept"].map(|n| node(&report, "my_effect")[n].as_u64().unwrap());
        assert!((690..720).contains(&calls) && calls + slept == 1500, "{calls} {slept}");
    }
}

#[test]
fn explain_counts_calls_of_a_plugin_effect() {
    let dir = Room::new();
    scene(&dir, &plugins::rust("my_effect"), "(force_n: 0.2, spacing_mm: 4)");
    let ran = dir.run("scene explain s.ron").ok();
    // On the ridges from -35 to 0 mm, then once to let go: 702 of 1500 ticks.
    let starts = |words: &[&str]| {
        let has = |line: &str| line.split_whitespace().take(words.len()).eq(words.iter().copied());
        ran.out.lines().find(|line| has(line)).unwrap_or_else(|| panic!("{words:?}: {}", ran.out))
    };
    assert!(starts(&["my_effect", "yes"]).contains("47 %   1 surface, 1 setting"), "{}", ran.out);
    starts(&["my_effect", "my_effect", "702"]);
}

// The scene loads with a warning. With `--strict` it is an error.
#[test]
fn plugin_effect_beyond_passivity_is_a_warning() {
    let dir = Room::new();
    for library in libraries(&dir) {
        // K = 2 pi 5 / 0.5 N/mm needs b > K T / 2 = 31 N s/m at 1 kHz.
        scene(&dir, &library, "(force_n: 5, spacing_mm: 0.5)");
        dir.run("check s.ron").ok().says(&["my_effect", "62.832 N/mm", "passive with `force_n: "]);
        dir.run("check s.ron --strict").refused("");
        scene(&dir, &library, "(force_n: 0.2, spacing_mm: 4)");
        let ran = dir.run("check s.ron --strict").ok();
        assert!(!ran.err.contains("my_effect"), "{}", ran.err);
    }
}

#[test]
fn wrong_settings_of_a_plugin_effect_point_at_their_place() {
    let dir = Room::new();
    for library in libraries(&dir) {
        for (settings, says) in [
            ("(force_n: 11)", "s.ron:6:22: error: 11 N is out of range"),
            ("(forse_n: 1)", "s.ron:6:13: error: unknown field `forse_n`"),
            ("hard", "s.ron:6:12: error: expected `my_effect(...)`"),
        ] {
            scene(&dir, &library, settings);
            dir.run("check s.ron").refused(says);
        }
    }
}

#[test]
fn plugin_effect_passes_every_check_with_its_examples() {
    let dir = Room::new();
    for library in libraries(&dir) {
        run(&dir, &["plugin", "check", library.to_str().unwrap(), "--ticks", "3000"])
            .ok()
            .says(&[" 0 failed"]);
    }
}
