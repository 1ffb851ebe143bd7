//! Settings of effects as a scene or a list of slots writes them.

use asperity_diagnostics::ron;
use asperity_node::{Settings, Source};

use crate::bench::refused;
use crate::registry;

/// Settings of an effect from a text.
fn read(kind: &str, text: &str) -> Result<Settings, String> {
    let registry = registry();
    let effect = registry.get(kind).and_then(|kind| kind.descriptor().effect.clone()).unwrap();
    let value = ron::parse(&Source::new("folder/g.ron", text)).map_err(|e| e.to_string())?;
    effect.read(kind, &value).map_err(|e| e.to_string())
}

#[test]
fn fields_that_are_left_out_have_their_usual_values() {
    let friction = read("friction", "dahl").unwrap();
    assert_eq!((friction.form(), friction.number("coefficient")), ("dahl", 0.3));
    assert_eq!(friction.number("bristle_stiffness_n_per_mm"), 1.0);
    assert_eq!(read("viscosity", "(viscosity_ns_per_m: 2)").unwrap().number("max_force_n"), 3.3);
    let magnet = read("magnet", "(stiffness_n_per_mm: 0.2, max_force_n: 0.5, reach_mm: 4)").unwrap();
    assert_eq!(magnet.number("reach_mm"), 4.0);
    let model = read("autoregressive", "autoregressive(model: \"a.ron\", gain: 0.5)").unwrap();
    assert_eq!((model.file("model").to_str(), model.number("gain")), (Some("folder/a.ron"), 0.5));
    assert_eq!(model.files(), [std::path::Path::new("folder/a.ron")]);
}

#[test]
fn settings_that_do_not_fit_are_refused_at_their_place() {
    let sinusoids = "sinusoids: [(frequency_hz: 180, decay_ms: 9, gain: 40)]";
    let recording = "recording: (file: \"tap.wav\", speed_mm_s: 80, full_scale_m_s2: 50, gain: 2)";
    let recorded = "recording: (file: \"felt.wav\", speed_mm_s: 80, full_scale_m_s2: 50)";
    let cases = [
        ("friction", "dall", "unknown friction `dall`"),
        ("friction", "lugre(static_coefficient: 0.2)", "coefficient"),
        ("vibration", "(frequency_hz: 120)", "the field `amplitude_m_s2` is missing"),
        ("magnet", "(stiffness_n_per_mm: 1, max_force_n: 1, reach_mm: 1e9)", "out of range"),
        ("tap", &format!("({sinusoids}, {recording})"), "both `sinusoids` and a `recording`"),
        ("tap", "(min_speed_mm_s: 3)", "needs `sinusoids` or a `recording`"),
        ("tap", &format!("({sinusoids}, min_speed_mm_s: 5, max_speed_mm_s: 3)"), "`min_speed_mm_s` (5)"),
        ("tap", "(sinusoid: [])", "unknown field `sinusoid`"),
        ("tap", "(sinusoids: [])", "0 sinusoids"),
        ("tap", "(recording: (file: \"tap.wav\", speed_mm_s: 80))", "full_scale_m_s2"),
        ("tap", "(recording: (file: \"t.wav\", speed_mm_s: 0, full_scale_m_s2: 1))", "out of range"),
        ("tap", "(recording: (file: \"\", speed_mm_s: 1, full_scale_m_s2: 1))", "an empty path"),
        (
            "waveform",
            &format!("waveform({recorded}, reference_speed_mm_s: 90)"),
            "`reference_speed_mm_s` is for `segments`",
        ),
        (
            "waveform",
            &format!("waveform({recorded}, segments: [(0, 0), (1, 1)])"),
            "both `segments` and a `recording`",
        ),
        ("waveform", "waveform(gain: 1)", "needs `segments` or a `recording`"),
        ("waveform", "waveform(recording: (file: \"felt.wav\", speed_mm_s: 80))", "full_scale_m_s2"),
        ("waveform", "relief(heights: made(surface: \"hessian\"))", "expected `waveform(...)`"),
        ("relief", "relief(heights: made(surface: \"hesian\"))", "hessian"),
        ("relief", "relief", "needs `heights`"),
    ];
    for (kind, text, wanted) in cases {
        let e = read(kind, text).unwrap_err();
        assert!(e.contains(wanted) && e.starts_with("folder/g.ron:1:"), "{kind} {text}: {e}");
    }
}

#[test]
fn refused_text_of_a_list_is_told_at_its_place() {
    let lists = [
        (
            "friction",
            "laws",
            "lugr(static_coefficient: 0.4)",
            "unknown friction `lugr` (did you mean `lugre`?",
        ),
        ("friction", "laws", "dahl(coefficient: 11)", "11 is out of range"),
        ("viscosity", "drags", "(viscosity_ns_per_m: -1)", "-1 N s/m is out of range"),
        (
            "magnet",
            "magnets",
            "(stiffness_n_per_mm: 1, max_force_n: -1, reach_mm: 1)",
            "-1 N is out of range",
        ),
        ("magnet", "magnets", "(stiffness_n_per_mm: 1, max_force_n: 1, reach_mm: 0)", "0 mm is out of range"),
        ("magnet", "magnets", "(stiffness_n_per_mm: 1)", "max_force_n"),
        ("vibration", "sources", "(frequency_hz: 21700, amplitude_m_s2: 2)", "21700 Hz is out of range"),
        ("waveform", "loops", "relief(heights: made(surface: \"hessian\"))", "expected `waveform(...)`"),
    ];
    for (kind, list, text, wanted) in lists {
        let e = refused(kind, &[(list, &format!("[{text:?}]"))]);
        assert!(e.starts_with("folder/g.ron:1:") && e.contains(wanted), "{kind} {text}: {e}");
    }
    // Files are looked for beside the graph.
    for (kind, list, text, file) in [
        ("tap", "taps", "(recording: (file: \"no.wav\", speed_mm_s: 50, full_scale_m_s2: 20))", "no.wav"),
        (
            "waveform",
            "loops",
            "waveform(recording: (file: \"no.wav\", speed_mm_s: 50, full_scale_m_s2: 20))",
            "no.wav",
        ),
        (
            "relief",
            "reliefs",
            "relief(heights: picture(file: \"no.png\", step_mm: 1, height_mm: 1))",
            "no.png",
        ),
        ("autoregressive", "models", "autoregressive(model: \"no.ron\")", "no.ron"),
        // A bare text is the path of a model.
        ("autoregressive", "models", "no.ron", "no.ron"),
    ] {
        let e = refused(kind, &[(list, &format!("[{text:?}]"))]);
        assert!(e.starts_with(&format!("folder/{file}: cannot read this file")), "{e}");
    }
    let relief = "[\"relief(heights: made(surface: \\\"hessian\\\"))\"]";
    let e = refused("relief", &[("reliefs", relief), ("smooth_hz", "250.0")]);
    assert!(e.contains("250 Hz is not between 0 and half the rate of 500 Hz"), "{e}");
}
