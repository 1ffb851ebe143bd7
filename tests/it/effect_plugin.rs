//! An effect that a plugin brings: a scene uses it by its name, like a built-in one.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use asperity_accuracy::npy;
use harness::{csv, json, plugins, root, run};

/// The template's effect in every language.
fn libraries(dir: &Path) -> Vec<PathBuf> {
    let mut all = vec![plugins::rust("my_effect")];
    for language in ["c", "cpp"] {
        let source = root().join(format!("plugins/template/effect/{language}/my_effect.{language}"));
        let library = dir.join(format!("{language}.so"));
        plugins::compile(&source, &library, &[]);
        all.push(library);
    }
    all
}

/// Writes a scene of a wall with the effect, a wall without, and a stroke over both at 50 mm/s.
fn scene(dir: &Path, plugin: &Path, settings: &str) {
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
    std::fs::write(dir.join("s.ron"), text).unwrap();
    std::fs::write(dir.join("t.csv"), csv(1.5, |t| [-35.0 + 50.0 * t, 0.0, -1.0])).unwrap();
}

#[test]
fn plugin_effect_in_every_language_follows_its_law() {
    let dir = tempfile::tempdir().unwrap();
    for library in libraries(dir.path()) {
        scene(dir.path(), &library, "(force_n: 0.2, spacing_mm: 4)");
        let args = ["render", "s.ron", "--probe", "my_effect.force=f.npy", "--probe", "contact.place=p.npy"];
        run(dir.path(), &[&args[..], &["--report", "r.json"]].concat()).ok();
        let read = |name: &str| npy::read(dir.path().join(name)).unwrap().values.into_f64();
        let (force, place) = (read("f.npy"), read("p.npy"));
        let mut on = 0;
        for (force, place) in force.chunks(3).zip(place.chunks(3)).take(700) {
            let wanted = -0.2 * (TAU * place[0] / 4.0).sin();
            assert!((force[0] - wanted).abs() < 1e-12 && force[1] == 0.0, "{force:?} {wanted}");
            on += usize::from(force[0] != 0.0);
        }
        assert!(on > 600, "{on}");
        // On the smooth wall it lets go, and is called no more.
        assert!(force[3 * 1000..].iter().all(|x| *x == 0.0));
        let report = json(&dir.path().join("r.json"));
        let nodes = report["nodes"].as_array().unwrap();
        let node = nodes.iter().find(|node| node["kind"] == "my_effect").unwrap();
        let (calls, slept) = (node["calls"].as_u64().unwrap(), node["slept"].as_u64().unwrap());
        assert!((690..720).contains(&calls) && calls + slept == 1500, "{node}");
    }
}

#[test]
fn explain_counts_calls_of_a_plugin_effect() {
    let dir = tempfile::tempdir().unwrap();
    scene(dir.path(), &plugins::rust("my_effect"), "(force_n: 0.2, spacing_mm: 4)");
    let ran = run(dir.path(), &["scene", "explain", "s.ron"]).ok();
    let line =
        ran.out.lines().find(|line| line.contains("my_effect")).unwrap_or_else(|| panic!("{}", ran.out));
    assert!(line.contains("ridges") || ran.out.contains("1 slot"), "{}", ran.out);
}

#[test]
fn plugin_effect_beyond_passivity_is_a_warning_and_an_error_if_strict() {
    let dir = tempfile::tempdir().unwrap();
    for library in libraries(dir.path()) {
        // K = 2 pi 5 / 0.5 N/mm needs b > K T / 2 = 31 N s/m at 1 kHz.
        scene(dir.path(), &library, "(force_n: 5, spacing_mm: 0.5)");
        let ran = run(dir.path(), &["check", "s.ron"]).ok();
        assert!(ran.err.contains("my_effect") && ran.err.contains("62.8 N/mm"), "{}", ran.err);
        let ran = run(dir.path(), &["check", "s.ron", "--strict"]);
        assert_eq!(ran.code, 2, "{}", ran.err);
        scene(dir.path(), &library, "(force_n: 0.2, spacing_mm: 4)");
        let ran = run(dir.path(), &["check", "s.ron", "--strict"]).ok();
        assert!(!ran.err.contains("my_effect"), "{}", ran.err);
    }
}

#[test]
fn wrong_settings_of_a_plugin_effect_point_at_their_place() {
    let dir = tempfile::tempdir().unwrap();
    for library in libraries(dir.path()) {
        for (settings, says) in [
            ("(force_n: 11)", "s.ron:6:21: 11 is out of range (from 0 to 10 N)"),
            ("(forse_n: 1)", "s.ron:6:13: unknown field `forse_n`"),
            ("hard", "s.ron:6:12: expected `my_effect(...)`"),
        ] {
            scene(dir.path(), &library, settings);
            let ran = run(dir.path(), &["check", "s.ron"]);
            assert!(ran.code == 2 && ran.err.contains(says), "{settings}: {}", ran.err);
        }
    }
}

#[test]
fn plugin_effect_passes_every_check_with_its_examples() {
    let dir = tempfile::tempdir().unwrap();
    for library in libraries(dir.path()) {
        let ran = run(dir.path(), &["plugin", "check", library.to_str().unwrap(), "--ticks", "3000"]);
        assert!(ran.code == 0 && ran.out.contains(" 0 failed"), "{}\n{}", ran.out, ran.err);
    }
}
