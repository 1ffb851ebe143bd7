//! `asperity render SCENE --plot`: the scene from above, with what was felt where.

use std::fmt::Write as _;

use harness::{Room, csv};

/// Five tiles of 20 mm side by side from x = -50 on, each with something of its own; the last is not reached.
const SCENE: &str = r#"Scene(
    version: 1, tick_hz: 500, audio_hz: 48000, seed: 7,
    input: trajectory(file: "t.csv", interpolation: linear),
    output: audio_out(volts_at_full_scale: 1.0, amps_per_volt: 1.0),
    surfaces: {
        "rubs": (shape: rectangle(size_mm: (20, 60)), place_mm: (-40, 0, 0), effects: (
            stiffness: (stiffness_n_per_mm: 0.5), friction: viscous_coulomb(coefficient: 0.3))),
        "rings": (shape: rectangle(size_mm: (20, 60)), place_mm: (-20, 0, 0), effects: (
            stiffness: (stiffness_n_per_mm: 0.5), vibration: (frequency_hz: 150, amplitude_m_s2: 2))),
        "honey": (shape: box(size_mm: (20, 60, 10)), place_mm: (0, 0, 0),
        effects: (viscosity: (viscosity_ns_per_m: 1.5))),
        "ripples": (shape: rectangle(size_mm: (20, 60)), place_mm: (20, 0, 0), effects: (
            stiffness: (stiffness_n_per_mm: 0.5),
            texture: waveform(segments: [(0, 0), (0.5, 4), (1, 0), (1.5, -4), (2, 0)],
            reference_speed_mm_s: 80))),
        "never": (shape: rectangle(size_mm: (20, 60)), place_mm: (40, 0, 0), effects: (
            stiffness: (stiffness_n_per_mm: 0.5), damping: (damping_ns_per_m: 1),
            magnet: (stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 1),
            tap: (sinusoids: [(frequency_hz: 180, decay_ms: 12, gain: 60)]))),
    },
)
"#;

/// Down at x = -45 and half a second's rest there; along x at 40 mm/s for 1.75 s, to 25; half a second's
/// rest, up, and back through the air.
fn stroke() -> String {
    csv(4.0, |t| {
        let down = ((t - 0.2) / 0.1).clamp(0.0, 1.0) * ((3.1 - t) / 0.1).clamp(0.0, 1.0);
        let back = ((t - 3.2) / 0.8).clamp(0.0, 1.0);
        [-45.0 + 40.0 * (t - 0.8).clamp(0.0, 1.75) - 70.0 * back, 0.0, 6.0 - 8.0 * down]
    })
}

/// The picture of a scene and a stroke.
fn plotted(dir: &Room, scene: &str, stroke: &str, more: &str) -> String {
    dir.write("s.ron", scene);
    dir.write("t.csv", stroke);
    dir.run(&format!("render s.ron --plot p.svg --quiet {more}")).ok();
    dir.text("p.svg")
}

/// Texts of a picture in their order, each with its x.
fn texts(svg: &str) -> Vec<(f64, &str)> {
    svg.split("<text x=\"")
        .skip(1)
        .filter_map(|part| {
            let (x, rest) = part.split_once('"')?;
            Some((x.parse().ok()?, rest.split_once('>')?.1.split_once("</text>")?.0))
        })
        .collect()
}

/// The part of the time that the legend gives for an effect, in percent.
fn part(svg: &str, effect: &str) -> Option<f64> {
    let all = texts(svg);
    let at = all.iter().position(|(_, text)| *text == effect)?;
    all[at + 1].1.strip_suffix(" %")?.parse().ok()
}

/// Least and greatest x of an effect's lanes in mm, by the numbers along the axis.
fn span(svg: &str, effect: &str) -> (f64, f64) {
    let pixel = |mm: &str| texts(svg).into_iter().find(|(_, text)| *text == mm).unwrap().0;
    let (a, b) = (pixel("\u{2212}40"), pixel("40"));
    let before = svg.split(&format!("<title>{effect}</title>")).next().unwrap();
    let d = before.rsplit_once("<path d=\"").unwrap().1.split_once('"').unwrap().0;
    let mut found = (f64::MAX, f64::MIN);
    for line in d.split('M').skip(1) {
        let line = line.replace('l', " ").replace('-', " -");
        let numbers: Vec<f64> = line.split_whitespace().map(|n| n.parse().unwrap()).collect();
        let mut x = 0.0;
        for step in numbers.chunks(2) {
            x += step[0];
            let mm = -40.0 + 80.0 * (x - a) / (b - a);
            found = (found.0.min(mm), found.1.max(mm));
        }
    }
    found
}

#[test]
fn every_effect_is_shown_where_and_as_long_as_it_was_felt() {
    let dir = Room::new();
    let svg = plotted(&dir, SCENE, &stroke(), "");
    let at = |text: &str| svg.find(text).unwrap_or_else(|| panic!("no {text}"));
    assert!(at("From above") < at("Position") && at("Position") < at("Normal force"));
    assert!(svg.contains(">s</text>"), "the title is the scene's name");
    for name in ["rubs", "rings", "honey", "ripples", "never"] {
        assert!(texts(&svg).iter().any(|(_, text)| *text == name), "{name}");
    }

    // Of 4 s: touched from 0.275 s, on the wall, to 3.025 s; honey, 5 mm high, for its half second.
    for (effect, seconds, off) in [
        ("stiffness", 3.025 - 0.275 - 0.5, 0.6),
        ("touching", 3.025 - 0.275, 0.6),
        ("in the air", 4.0 - (3.025 - 0.275), 0.6),
        // From -45, where it rests without friction, to -30.
        ("friction", 15.0 / 40.0, 0.6),
        ("vibration", 20.0 / 40.0, 0.6),
        ("viscosity", 20.0 / 40.0, 0.6),
        // From 10 to 25, and as long as the gate closes.
        ("waveform", 15.0 / 40.0, 1.0),
    ] {
        let found = part(&svg, effect).unwrap_or_else(|| panic!("no {effect}"));
        assert!((found - 25.0 * seconds).abs() <= off, "{effect}: {found} % for {seconds} s");
    }
    for effect in ["damping", "network", "autoregressive", "relief", "tap", "magnet"] {
        assert_eq!(part(&svg, effect), None, "{effect}");
    }

    // Half a pixel is 0.07 mm, a piece of the way 0.3 mm, a fade 10 ms or 0.4 mm.
    let places = [
        ("stiffness", -45.0, 25.0),
        ("friction", -45.0, -30.0),
        ("vibration", -30.0, -10.0),
        ("viscosity", -10.0, 10.0),
        ("waveform", 10.0, 25.0),
    ];
    for (effect, from, to) in places {
        let (a, b) = span(&svg, effect);
        assert!((a - from).abs() < 1.0 && (b - to).abs() < 1.0, "{effect}: {a} to {b} mm");
    }
}

/// From and to when panels are tinted, in seconds.
fn tinted(svg: &str) -> Vec<(f64, f64)> {
    let at = |s: &str| texts(svg).into_iter().rfind(|(_, text)| *text == s).unwrap().0;
    let (a, b) = (at("1.0"), at("2.0"));
    let number = |part: &str, name: &str| -> f64 {
        part.split_once(&format!("{name}=\"")).unwrap().1.split('"').next().unwrap().parse().unwrap()
    };
    let all = svg.lines().filter(|line| line.contains("fill=\"#f0f6fa\""));
    all.map(|line| {
        let (x, width) = (number(line, " x"), number(line, " width"));
        (1.0 + (x - a) / (b - a), 1.0 + (x + width - a) / (b - a))
    })
    .collect()
}

#[test]
fn only_where_a_texture_is_felt_is_tinted() {
    let dir = Room::new();
    let svg = plotted(&dir, SCENE, &stroke(), "");
    assert!(svg.contains(">texture active<"));
    let tinted = tinted(&svg);
    // On the ripples, from x = 10, from 2.175 s to the rest at 2.55 s; as long as the gate closes, not
    // before.
    assert!(tinted.len() >= 3, "a panel each");
    for (from, to) in tinted {
        assert!((from - 2.175).abs() < 0.03 && (2.5..2.65).contains(&to), "{from} {to}");
    }
    // Without a texture nothing is.
    let (before, rest) = SCENE.split_once("        \"ripples\"").unwrap();
    let (_, after) = rest.split_once("        \"never\"").unwrap();
    let svg = plotted(&dir, &format!("{before}        \"never\"{after}"), &stroke(), "");
    assert!(!svg.contains("texture active") && self::tinted(&svg).is_empty());
}

#[test]
fn picture_is_the_same_with_everything_built_and_awake() {
    let dir = Room::new();
    let [lean, whole] = ["", "--no-sleep --no-prune"].map(|more| plotted(&dir, SCENE, &stroke(), more));
    assert!(lean == whole);
}

#[test]
fn a_graph_has_no_picture_from_above() {
    let dir = Room::new();
    dir.run("render graphs/heravi2024.ron --plot p.svg --seconds 2 --quiet").ok();
    let svg = dir.text("p.svg");
    assert!(!svg.contains("From above") && !svg.contains("clipPath") && svg.contains(">canvas: heravi2024<"));
}

#[test]
fn a_thousand_tiles_and_a_long_scribble_are_a_small_file() {
    let dir = Room::new();
    let mut scene = String::from(
        "Scene(version: 1, tick_hz: 4000, audio_hz: 48000, input: trajectory(file: \"t.csv\", \
         interpolation: linear), surfaces: {\n",
    );
    for i in 0..1024 {
        let (x, y) = (4 * (i % 32) - 62, 4 * (i / 32) - 62);
        let soft = if i % 2 == 0 { "friction: dahl" } else { "damping: (damping_ns_per_m: 0.5)" };
        let _ = writeln!(
            scene,
            "\"tile {i}\": (shape: rectangle(size_mm: (3, 3)), place_mm: ({x}, {y}, 0), \
             effects: (stiffness: (stiffness_n_per_mm: 0.5), {soft})),"
        );
    }
    scene.push_str("})\n");
    // 25 s over all of it at up to 2 m/s, of which 20 are drawn.
    let at = |t: f64| [60.0 * (31.0 * t).sin(), 60.0 * (27.3 * t).cos(), -0.5];
    let scribble = csv(25.0, at);
    let svg = plotted(&dir, &scene, &scribble, "");
    assert!(svg.contains("first 20 s") && !svg.contains("tile "));
    assert!(svg.len() < 2_000_000, "{}", svg.len());
    let drawn = part(&svg, "touching").unwrap();
    // Tiles are 3 of every 4 mm along both axes.
    let on = |x: f64| ((x + 64.0).rem_euclid(4.0) - 2.0).abs() < 1.5;
    let all = (0..80_000).map(|k| at(f64::from(k) / 4000.0));
    let touched = all.filter(|[x, y, _]| on(*x) && on(*y)).count() as f64 / 800.0;
    assert!((drawn - touched).abs() < 1.0, "{drawn} % for {touched} %");
    assert!(part(&svg, "friction").unwrap() > 20.0 && part(&svg, "damping").unwrap() > 20.0);
}
