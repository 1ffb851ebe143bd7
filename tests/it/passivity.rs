//! Effects on the devices that ship: what they do by default is passive, and an alarm says what to change.

use asperity_hand::DEVICES;
use asperity_node::Form;
use harness::{Ran, Room};

/// Checks a scene with a surface of these effects on a device; a finding is an error.
fn check(dir: &Room, device: &str, effects: &str) -> Ran {
    let surface = format!("shape: plane, effects: ({effects})");
    let scene = format!("version: 1, input: stroke(duration_s: 1),\n device: ({device})");
    dir.write("s.ron", format!("Scene({scene},\n surfaces: {{\"a\": ({surface})}})"));
    dir.run("check s.ron --strict")
}

/// Every form of an effect with a law of force: without settings if it takes that, else as its example.
fn forms() -> Vec<(String, Vec<Form>)> {
    let registry = harness::registry();
    let of = |kind: &str| {
        let effect = registry.get(kind)?.descriptor().effect.clone()?;
        effect.direction()?;
        Some((kind.to_owned(), effect.forms))
    };
    registry.names().filter_map(of).collect()
}

/// Friction asked for 13.2 N s/m by default, of a device with 2.
#[test]
fn every_default_is_passive_on_every_device() {
    let dir = Room::new();
    let arms = DEVICES.iter().filter_map(|arm| Some((format!("output: {}", arm.force()?), arm.servo()[1])));
    let devices: Vec<(String, f64)> = arms.chain([(String::new(), 0.0)]).collect();
    assert_eq!(devices.len(), 3, "Touch, Inverse3, simulated: {devices:?}");
    let mut checked = 0;
    for (output, delay_s) in &devices {
        let device = format!("damping_ns_per_m: 2, delay_ms: {}, {output}", 1e3 * delay_s);
        for (kind, forms) in forms() {
            for form in forms {
                let needs = form.fields.iter().any(|field| field.default.is_none() && !field.optional);
                let defaults = format!("{kind}: {}", form.name);
                let example = format!("{kind}: {}", form.example);
                let written = if needs { vec![example] } else { vec![defaults, example] };
                for text in written {
                    check(&dir, &device, &format!("stiffness: (stiffness_n_per_mm: 0.5), {text}")).ok();
                    checked += 1;
                }
            }
        }
    }
    println!("{checked} checked");
    // Three laws of friction, each as a word and as its example; viscosity and magnet.
    assert_eq!(checked, 3 * (3 * 2 + 2));
}

/// A number that the alarm tells to set: its name, its value and its effect.
fn told(message: &str) -> Vec<(String, String, String)> {
    let (_, advice) = message.split_once("passive with ").unwrap_or_else(|| panic!("no advice: {message}"));
    let advice = advice.lines().next().unwrap_or_default();
    let number = |text: &str| {
        let mut parts = text.split('`').filter(|part| !part.trim().is_empty());
        let (name, value) = parts.next()?.split_once(": ")?;
        Some((name.to_owned(), value.to_owned(), parts.find(|part| *part != " in ")?.to_owned()))
    };
    advice.split(" and ").map(|text| number(text).unwrap_or_else(|| panic!("{advice}"))).collect()
}

#[test]
fn alarm_names_a_number_and_a_value_that_holds() {
    let dir = Room::new();
    let device = "damping_ns_per_m: 2, position_step_mm: 0.055, friction_n: 0.05";
    for (effects, names) in [
        ("friction: viscous_coulomb(viscosity_s_per_mm: 0.004)", "viscosity_s_per_mm"),
        ("friction: dahl(bristle_stiffness_n_per_mm: 10)", "bristle_stiffness_n_per_mm"),
        ("friction: lugre(bristle_stiffness_n_per_mm: 5)", "bristle_stiffness_n_per_mm"),
        ("friction: lugre(bristle_damping_ns_per_m: 5)", "bristle_damping_ns_per_m"),
        (
            "friction: lugre(bristle_stiffness_n_per_mm: 30, bristle_damping_ns_per_m: 9)",
            "bristle_stiffness_n_per_mm bristle_damping_ns_per_m",
        ),
        ("viscosity: (viscosity_ns_per_m: 20)", "viscosity_ns_per_m"),
        ("magnet: (stiffness_n_per_mm: 7, max_force_n: 1, reach_mm: 2)", "stiffness_n_per_mm"),
        ("damping: (damping_ns_per_m: 1.9)", "damping_ns_per_m"),
        (
            "friction: dahl(bristle_stiffness_n_per_mm: 1.5), viscosity: (viscosity_ns_per_m: 0.9)",
            "bristle_stiffness_n_per_mm",
        ),
    ] {
        let mut text = format!("stiffness: (stiffness_n_per_mm: 0.5), {effects}");
        let first = check(&dir, device, &text).refused("not passive");
        let mut advised: Vec<String> = Vec::new();
        let mut ran = first;
        // A surface may have several findings; each names its own.
        for _ in 0..3 {
            if ran.code == 0 {
                break;
            }
            for (name, value, effect) in told(&ran.err) {
                let at = text.find(&format!("{effect}: ")).unwrap_or_else(|| panic!("{effect}: {}", ran.err));
                let from = at
                    + text[at..].find(&format!("{name}: ")).expect("the number stands there")
                    + name.len()
                    + 2;
                let to = from + text[from..].find([',', ')']).expect("it ends");
                text.replace_range(from..to, &value);
                advised.push(name);
            }
            ran = check(&dir, device, &text);
        }
        println!("{text}");
        assert_eq!(ran.code, 0, "{text}: {}", ran.err);
        for name in names.split(' ') {
            assert!(advised.iter().any(|advised| advised == name), "{name}: {advised:?}");
        }
    }
    // Of a device without damping nothing can be asked.
    let none = "stiffness: (stiffness_n_per_mm: 0.5), friction: dahl";
    check(&dir, "", none).refused("holds on a device with `damping_ns_per_m: 1.1` or more");
    check(&dir, "damping_ns_per_m: 1.1", none).ok();
}
