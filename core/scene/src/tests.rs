use asperity_node::Registry;

use super::*;
use crate::space::Form;

/// Parses a scene and checks its effects.
fn parse(text: &str) -> Result<Scene, String> {
    let scene = Scene::parse(&Source::new("s.ron", text)).map_err(|e| e.to_string())?;
    scene.check(&registry()).map_err(|e| e.to_string())?;
    Ok(scene)
}

fn registry() -> Registry {
    asperity_nodes::registry()
}

/// Parses a scene with these surfaces.
fn scene(surfaces: &str) -> Result<Scene, String> {
    parse(&format!(
        "Scene(version: 1, input: stroke(speed_mm_s: 80), network: (model: \"m.onnx\", \
         library: \"l.ron\"),\n surfaces: {{\n{surfaces}\n}})"
    ))
}

fn refused(surfaces: &str, wanted: &[&str]) {
    let e = scene(surfaces).expect_err(surfaces);
    assert!(wanted.iter().all(|w| e.contains(w)), "{e}");
}

const WALL: &str = "stiffness: (stiffness_n_per_mm: 0.5)";

#[test]
fn scene_is_read_with_its_settings_and_defaults() {
    let scene = scene(&format!(
        "\"left\": (shape: rectangle(size_mm: (40, 60), thickness_mm: 5), place_mm: \
         (-20, 0, 0), material: \"canvas\",\n effects: ({WALL}, friction: \
         dahl(coefficient: 0.4), texture: [network, relief(heights: made(surface: \"hessian\", side: 64))], \
         tap: (sinusoids: [(frequency_hz: 180, decay_ms: 9, gain: -40)]))),\n\
         \"ball\": (shape: sphere(radius_mm: 12), effects: (magnet: \
         (stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 6)))"
    ))
    .unwrap();
    assert_eq!((scene.tick_hz, scene.audio_hz, scene.seed), (500, 48_000, 1));
    assert_eq!(
        (scene.input.kind.as_str(), scene.input.settings[0].0.name.as_str()),
        ("stroke", "speed_mm_s")
    );
    assert_eq!((scene.motion.kind.as_str(), scene.gate.kind.as_str()), ("velocity", "speed_gate"));
    let [left, ball] = &scene.surfaces[..] else { panic!("{:?}", scene.surfaces) };
    assert_eq!(left.surface.pose.place_mm(), [-20.0, 0.0, 0.0]);
    assert!(matches!(left.surface.shape.form(), Form::Rectangle { thickness_mm: 5.0, .. }));
    let effects = &left.effects;
    assert_eq!(effects.stiffness.as_ref().unwrap().of, 0.5);
    let friction = effects.of("friction").next().unwrap().settings(&registry()).unwrap();
    assert_eq!((friction.form(), friction.number("coefficient")), ("dahl", 0.4));
    assert_eq!(friction.number("bristle_stiffness_n_per_mm"), 1.0);
    assert!(effects.of(NETWORK).count() == 1 && effects.of("relief").count() == 1);
    assert_eq!(left.place.position().line, 3);
    let magnet = ball.effects.of("magnet").next().unwrap().settings(&registry()).unwrap();
    assert!(ball.effects.stiffness.is_none() && magnet.number("reach_mm") == 6.0);
}

#[test]
fn errors_have_a_place_and_the_nearest_name() {
    let plane = |effects: &str| format!("\"a\": (shape: plane, effects: ({effects}))");
    refused(&plane(&format!("{WALL}, fricton: dahl")), &["s.ron:3:", "unknown effect `fricton`", "friction"]);
    refused(&plane(&format!("{WALL}, friction: dall")), &["unknown friction `dall`", "dahl"]);
    refused(&plane(&format!("{WALL}, texture: netwrk")), &["unknown texture `netwrk`", "network"]);
    refused(&plane("stiffness: (stiffness_n_per_mm: 1e4)"), &["out of range", "N/mm"]);
    refused(&plane(&format!("{WALL}, friction: lugre(static_coefficient: 0.2)")), &["s.ron:3:"]);
    refused("\"a\": (shape: cube)", &["unknown shape `cube`"]);
    refused("\"a\": (shape: rectangle(size_mm: (10, 0)))", &["s.ron:3:", "a rectangle"]);
    refused("\"a\": (shape: sphere)", &["a sphere without a size", "radius_mm"]);
    refused("\"a\": (shape: sphere(radius_mm: -1))", &["out of range"]);
    refused("\"a\": (shape: relief(heights: made(surface: \"hesian\")))", &["hesian", "hessian"]);
    refused(
        "\"a\": (shape: plane, material: \"x\", effects: (texture: network))",
        &["`network` on a surface that does not push back"],
    );
    refused(&plane(&format!("{WALL}, texture: network")), &["without a material"]);
    refused(
        &format!("\"a\": (shape: plane, material: \"x\", effects: ({WALL}, texture: [network, network]))"),
        &["two network textures"],
    );
    refused("", &["a scene without surfaces"]);
    refused("\"a\": (shape: plane), \"a\": (shape: plane)", &["s.ron:3:"]);
    let e = parse(
        "Scene(version: 1, input: stroke, surfaces: {\"a\": (shape: plane, material: \"x\", \
         effects: (stiffness: (stiffness_n_per_mm: 1), texture: network))})",
    );
    assert!(e.unwrap_err().contains("without a network"));
}

#[test]
fn truncated_scene_does_not_panic() {
    let text = include_str!("testing.ron");
    assert!(parse(text).is_ok(), "{:?}", parse(text).err());
    for end in 0..text.len() {
        if text.is_char_boundary(end) {
            drop(parse(&text[..end]));
        }
    }
}

#[test]
fn surfaces_that_feel_alike_share_slots() {
    let wall = |name: &str, material: &str, more: &str| {
        format!(
            "\"{name}\": (shape: plane, material: \"{material}\", \
             effects: ({WALL}, texture: network{more})),\n"
        )
    };
    let text = [
        wall("a", "oak", ""),
        wall("b", "ash", ", friction: dahl"),
        wall("c", "oak", ", friction: dahl(coefficient: 0.5)"),
        wall("d", "oak", ", friction: dahl( /* as b */ )"),
    ]
    .concat();
    let scene = scene(&text).unwrap();
    assert_eq!(
        scene.slots(NETWORK),
        Slots { first: vec![0, 1], of: vec![Some(0), Some(1), Some(0), Some(0)] }
    );
    assert_eq!(
        scene.slots("friction"),
        Slots { first: vec![1, 2, 3], of: vec![None, Some(0), Some(1), Some(2)] }
    );
    assert_eq!(scene.slots("tap").first, Vec::<usize>::new());
}

#[test]
fn stiffness_beyond_the_passive_limit_is_found_with_numbers() {
    let at = |device: &str, tick_hz: u32, effects: &str| {
        let text = format!(
            "Scene(version: 1, tick_hz: {tick_hz}, input: stroke, device: ({device}), \
             surfaces: {{\"wall\": (shape: plane, effects: ({effects}))}})"
        );
        parse(&text).unwrap().findings(&registry())
    };
    // b > K T / 2: 0.5 N/mm at 500 Hz need 0.5 N s/m.
    assert!(at("damping_ns_per_m: 0.51", 500, WALL).is_empty());
    let found = at("damping_ns_per_m: 0.49", 500, WALL);
    assert_eq!(found.len(), 1);
    assert!(found[0].message.contains("`wall` along its normal") && found[0].message.contains("0.500 N s/m"));
    assert_eq!(found[0].place.position().line, 1);
    assert!(at("damping_ns_per_m: 0.26", 1000, WALL).is_empty());
    // A delay of 1 ms adds K t_d.
    assert_eq!(at("damping_ns_per_m: 0.51, delay_ms: 1", 500, WALL).len(), 1);
    // Damping counts in full.
    assert_eq!(at("damping_ns_per_m: 1", 500, &format!("{WALL}, damping: (damping_ns_per_m: 0.6)")).len(), 1);
    // 0.004 s/mm of 3.3 N are 13.2 N s/m.
    let steep = format!("{WALL}, friction: viscous_coulomb(viscosity_s_per_mm: 0.004)");
    let found = at("damping_ns_per_m: 10", 500, &steep);
    assert!(found.len() == 1 && found[0].message.contains("13.2"), "{found:?}");
    // Laws along one direction add up: three of 1.9 N s/m are 5.7.
    let three = "stiffness: (stiffness_n_per_mm: 1.9), magnet: (stiffness_n_per_mm: 1.9, \
                 max_force_n: 1, reach_mm: 3), viscosity: (viscosity_ns_per_m: 1.9)";
    assert!(at("damping_ns_per_m: 5.8", 500, three).is_empty());
    let found = at("damping_ns_per_m: 5.6", 500, three);
    assert!(found.len() == 1 && found[0].message.contains("(wall + magnet + viscosity)"), "{found:?}");
    assert!(found[0].message.contains("5.700 N s/m"), "{found:?}");
    // Along the surface, a bristle of 1 N/mm and drag of 1.5 N s/m are 2.5.
    let two = "stiffness: (stiffness_n_per_mm: 0.1), friction: dahl, viscosity: (viscosity_ns_per_m: 1.5)";
    assert!(at("damping_ns_per_m: 2.6", 500, two).is_empty());
    let found = at("damping_ns_per_m: 2.4", 500, two);
    assert!(
        found.len() == 1 && found[0].message.contains("along its surface (friction + viscosity)"),
        "{found:?}"
    );
    let found = at("damping_ns_per_m: 1", 500, "viscosity: (viscosity_ns_per_m: 1.5)");
    assert!(found.len() == 1 && found[0].message.contains("in its volume (viscosity)"), "{found:?}");
    // 13.8 mN at 0.5 N/mm and 0.055 mm.
    let quantised = "damping_ns_per_m: 2, position_step_mm: 0.055, friction_n";
    assert!(at(&format!("{quantised}: 0.0139"), 500, WALL).is_empty());
    assert_eq!(at(&format!("{quantised}: 0.0136"), 500, WALL).len(), 1);
}

#[test]
fn scene_is_told_from_a_graph_after_any_comments() {
    let meant = |text: &str| Scene::is_meant(&Source::new("s.ron", text));
    assert!(
        meant("Scene(version: 1)") && meant("// Graph(\n\n  /* a /* b */ Graph( */ // c\nScene (version: 1)")
    );
    assert!(meant("\u{feff}Scene(") && meant("Scene"));
    for other in [
        "",
        "//",
        "// Scene(",
        "/* Scene(",
        "/* /* */ Scene(",
        "Graph(version: 1)",
        "Scenery(",
        "(Scene: 1)",
        "\"Scene\"",
    ] {
        assert!(!meant(other), "{other}");
    }
}

#[test]
fn surfaces_of_the_same_heights_share_them() {
    let relief =
        "shape: relief(heights: made(surface: \"hessian\", side: 16, step_mm: 0.1), size_mm: (30, 30))";
    let other = relief.replace("side: 16", "side: 32");
    let scene =
        scene(&format!("\"a\": ({relief}), \"b\": ({relief}, place_mm: (40, 0, 0)), \"c\": ({other})"))
            .unwrap();
    let grids: Vec<_> = scene
        .surfaces
        .iter()
        .map(|s| match s.surface.shape.form() {
            Form::Relief(relief) => relief.grid.clone(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert!(std::sync::Arc::ptr_eq(&grids[0], &grids[1]) && !std::sync::Arc::ptr_eq(&grids[0], &grids[2]));
}
