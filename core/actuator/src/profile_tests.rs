use super::super::Dynamics;
use super::*;

fn shipped(name: &str) -> Arc<Source> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs/actuators").join(name);
    Source::read(path).unwrap()
}

fn error_after(replace: &str, with: &str) -> Diagnostic {
    let text = shipped("hapcoil_one.ron").text().to_owned();
    assert!(text.contains(replace), "{replace}");
    ActuatorProfile::parse(&Source::new("p.ron", text.replacen(replace, with, 1))).unwrap_err()
}

#[test]
fn shipped_hapcoil_resonates_at_65_hz_on_100_g() {
    let p = ActuatorProfile::parse(&shipped("hapcoil_one.ron")).unwrap();
    let d = Dynamics::new(&p, 100.0).unwrap();
    assert!((d.natural_hz() - 65.0).abs() < 0.01, "{}", d.natural_hz());
    // The basis of the estimates.
    assert!((d.resistance + d.force_factor.powi(2) / d.damping - 1.41 / 0.1478).abs() < 0.02);
    let shorted =
        (d.damping + d.force_factor.powi(2) / d.resistance) / (2.0 * d.reduced_mass() * d.natural_rad_s());
    assert!((2.2 / (shorted * d.natural_rad_s()) - 0.014).abs() < 1e-4);
    assert!((d.moving_mass - 4.4e-3).abs() < 1e-12);
    assert!((d.rated_current - 0.1478).abs() < 1e-12);
    assert!((d.inductance - 128e-6).abs() < 1e-12);
    for (name, q) in p.quantities() {
        let published = ["m_a", "resistance", "inductance", "rated_current"].contains(&name);
        assert_eq!(q.estimate, !published, "{name}");
    }
}

#[test]
fn shipped_haptuator_is_all_estimates() {
    let p = ActuatorProfile::parse(&shipped("haptuator_mark_ii.ron")).unwrap();
    assert!(p.quantities().iter().all(|(_, q)| q.estimate && !q.source.is_empty()));
    let d = Dynamics::new(&p, 100.0).unwrap();
    assert!((d.natural_hz() - 90.0).abs() < 0.05, "{}", d.natural_hz());
    assert!((d.damping_ratio() - 0.2).abs() < 0.001, "{}", d.damping_ratio());
}

#[test]
fn heavier_handle_lowers_the_resonance() {
    let p = ActuatorProfile::parse(&shipped("hapcoil_one.ron")).unwrap();
    let hz = |g| Dynamics::new(&p, g).unwrap().natural_hz();
    let alone = (p.stiffness.value / p.moving_mass.value).sqrt() / std::f64::consts::TAU;
    assert!(hz(10.0) > hz(100.0) && hz(100.0) > hz(1000.0));
    assert!((hz(10_000.0) - alone).abs() < 0.02);
    assert!(Dynamics::new(&p, 0.0).is_err() && Dynamics::new(&p, f64::NAN).is_err());
    let said = Dynamics::new(&p, 0.5).unwrap_err().to_string();
    assert_eq!(said, "a handle's mass of 0.5 g is out of range; allowed is 1 to 10000 g");
}

#[test]
fn bad_profiles_are_refused_where_they_are_wrong() {
    for (replace, with, says, column) in [
        ("g: 4.4", "g: 0", "0 g is out of range (from 0.05 to 1000 g)", 14),
        ("g: 4.4", "kg: 0.0044", "`m_a` needs a value in g, called `g`", 10),
        ("g: 4.4", "g: -4.4", "-4.4 g is out of range", 14),
        ("g: 4.4", "g: 1e999", "not a finite number", 14),
        ("g: 4.4", "g: \"4.4\"", "expected a number", 14),
        ("g: 4.4, source: \"published: moving mass 4.4 g\"", "g: 4.4", "the field `source` is missing", 10),
        ("source: \"published: moving mass 4.4 g\"", "source: \" \"", "a source is not empty", 27),
        ("(g: 4.4, source: \"published: moving mass 4.4 g\")", "4.4", "such as `m_a: (g: 4.4", 10),
        ("m_a:", "m_b:", "the field `m_a` is missing", 5),
        ("version: 1", "version: 2", "this version is not known (write `version: 1`)", 14),
        ("ma: 600", "ma: 100", "the peak current is below the rated current (at least 147.8 mA)", 19),
        ("uh: 128", "uh: 4999.5", "a coil of this inductance", 17),
        ("uh: 128", "uh: 1e50", "uH is out of range", 22),
        ("inductance: (uh: 128", "inductance: (uh: 128, uh: 3", "is given twice", 27),
        ("(uh: 128", "(uh: 128, estimated: true", "did you mean `estimate`?", 27),
        ("name: ", "nmae: \"x\", name: ", "unknown field `nmae` (did you mean `name`?)", 5),
    ] {
        let (replace, with) = if says.starts_with("a coil") {
            // 5 mH through 2 ohm.
            (
                "ohm: 4.5, source: \"published: 4.5 ohm\"),\n    inductance: (uh: 128",
                "ohm: 2, source: \"x\"),\n    inductance: (uh: 4999.5",
            )
        } else {
            (replace, with)
        };
        let e = error_after(replace, with);
        let said = e.to_string();
        assert!(said.contains(says), "{with}: {said}");
        assert_eq!(e.place.unwrap().position().column, column, "{said}");
    }
}
