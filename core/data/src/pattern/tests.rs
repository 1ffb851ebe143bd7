use super::*;
use crate::made;
use asperity_texture::{Events, Harmonic, Wave};
use std::f64::consts::{PI, TAU};

/// Enough to find known bumps, ..
const QUICK: Effort = Effort {
    seconds: [3.0, 6.0, 12.0],
    spacings: 7,
    rough: [&[-0.9, 0.0], &[0.4], &[0.2, 0.8]],
    factors: &[-0.35, 0.0, 0.35],
    alike: &[0.0, 0.7],
    starts: [2, 1],
    rounds: [3, 2],
    draws: 3,
};
/// .. known waves, which are less by chance, ..
const OF_WAVES: Effort = Effort { seconds: [3.0, 3.0, 6.0], rounds: [3, 1], draws: 1, ..QUICK };
/// .. and a grain: each rendering has all directions.
const OF_GRAIN: Effort = Effort {
    seconds: [12.0, 24.0, 24.0],
    spacings: 9,
    rough: [&[-0.9, 0.0], &[0.2], &[0.2, 0.5]],
    rounds: [4, 1],
    draws: 2,
    ..QUICK
};

/// Magnitudes that fall with frequency.
fn magnitudes() -> Vec<f64> {
    (0..BINS).map(|k| if k == 0 { 0.0 } else { 1.0 / (1.0 + (k as f64 / 30.0).powi(2)) }).collect()
}

fn places(speed: f64, angle_deg: f64, seconds: f64) -> Vec<[f64; 2]> {
    let (sin, cos) = angle_deg.to_radians().sin_cos();
    (0..(seconds / TICK_S) as usize)
        .map(|tick| [speed * tick as f64 * TICK_S * cos, speed * tick as f64 * TICK_S * sin])
        .collect()
}

/// Bumps 0.8 mm apart.
const BUMPS: Events = Events {
    spacing_mm: Some(0.8),
    spacing_exponent: 0.0,
    anisotropy: [0.0; 2],
    interval_cv: 0.3,
    height_cv: 0.3,
};

/// Speeds in mm/s and angles in degrees of strokes over bumps.
const BUMPY: [(f64, f64); 3] = [(40.0, 17.0), (100.0, 200.0), (240.0, 55.0)];

/// Strokes that the kernel makes of a pattern, on one piece.
fn strokes(pattern: &Pattern, seconds: f64) -> Vec<Stroke> {
    strokes_of(pattern, seconds, 100)
}

/// The same with a seed of the noise.
fn strokes_of(pattern: &Pattern, seconds: f64, seed: u64) -> Vec<Stroke> {
    let ways = [(40.0, 17.0), (60.0, 40.0), (80.0, -20.0), (100.0, 200.0), (160.0, 75.0), (240.0, 55.0)];
    strokes_along(&ways, pattern, seconds, seed)
}

/// The same along some ways: speeds in mm/s and angles in degrees.
fn strokes_along(ways: &[(f64, f64)], pattern: &Pattern, seconds: f64, seed: u64) -> Vec<Stroke> {
    let stroke = |(number, &(speed, angle)): (usize, &(f64, f64))| {
        let places = places(speed, angle, seconds);
        let samples = rendered(pattern, &magnitudes(), &places, seed + number as u64);
        let place = |t: f64| places[((t / TICK_S).round() as usize).min(places.len() - 1)];
        Stroke::new(RATE_HZ, &[&samples], place)
    };
    ways.iter().enumerate().map(stroke).collect()
}

/// Largest difference of phases over harmonics, apart from origin and sign.
fn apart(found: &[Harmonic], want: &[Harmonic]) -> f64 {
    let off = |origin: f64, sign: f64| {
        let one = |(h, (a, b)): (usize, (&Harmonic, &Harmonic))| {
            let off = a.phase - b.phase - (h + 1) as f64 * origin + sign;
            ((off + PI).rem_euclid(TAU) - PI).abs()
        };
        found.iter().zip(want).enumerate().map(one).fold(0.0, f64::max)
    };
    let origins = (0..720).map(|n| TAU * f64::from(n) / 720.0);
    origins.flat_map(|origin| [0.0, PI].map(|sign| off(origin, sign))).fold(f64::INFINITY, f64::min)
}

#[test]
fn wave_of_known_vector_and_harmonics_is_found() {
    let phases = [0.0, 1.0, -2.0, 0.5, 2.5, -1.0];
    let harmonics = phases.map(|phase| Harmonic { weight: 1.0, share: 0.8, phase }).to_vec();
    let per_mm = [0.6, -0.35];
    let pattern = Pattern { waves: vec![Wave { per_mm, harmonics: harmonics.clone() }], events: None };
    let found = found(&[strokes(&pattern, 4.0)], None, &OF_WAVES);
    let [wave] = &found.waves[..] else { panic!("{found:?}") };
    let sign = wave.per_mm[0].signum();
    let off = (sign * wave.per_mm[0] - per_mm[0]).hypot(sign * wave.per_mm[1] - per_mm[1]);
    assert!(off < 0.005, "{:?}", wave.per_mm);
    // Ridges are the same backwards, with opposite phases.
    let told: Vec<Harmonic> =
        wave.harmonics.iter().map(|h| Harmonic { phase: sign * h.phase, ..*h }).collect();
    assert!(told[..6].iter().all(|h| (h.share - 0.8).abs() < 0.12), "{told:?}");
    assert!(apart(&told[..6], &harmonics) < 0.5, "{told:?}");
}

#[test]
fn weak_wave_counts_where_all_pieces_have_it() {
    // Voile's threads have 3 to 14 % of the power.
    let harmonics = vec![
        Harmonic { weight: 1.0, share: 0.35, phase: 0.0 },
        Harmonic { weight: 1.0, share: 0.0, phase: 0.0 },
    ];
    let pattern = Pattern { waves: vec![Wave { per_mm: [2.1, 0.9], harmonics }], events: None };
    let pieces = [100, 200, 300].map(|seed| strokes_of(&pattern, 4.0, seed));
    let pieces: Vec<Vec<Passage>> =
        pieces.into_iter().map(|strokes| strokes.iter().flat_map(Stroke::passages).collect()).collect();
    let (found, _) = waves::find(&pieces);
    let near = |w: &Wave| (w.per_mm[0] - 2.1).hypot(w.per_mm[1] - 0.9) < 0.05;
    assert!(found.iter().any(near) && found[0].harmonics[0].share < 0.6, "{found:?}");
    assert_eq!(waves::find(&pieces[..1]).0, []);
}

#[test]
fn isotropic_noise_has_neither_wave_nor_bump() {
    assert_eq!(found(&[strokes(&Pattern::default(), 4.0)], None, &QUICK), Pattern::default());
    assert_eq!(found(&[], None, &QUICK), Pattern::default());
}

/// Asserts that a pattern is as bumpy as another at three speeds. Other constants may be as good: rare
/// bumps of one height, or more of several heights.
fn assert_alike(found: &Pattern, known: &Pattern) {
    for speed in [40.0, 100.0, 240.0] {
        let figures = |pattern: &Pattern, seed: u64| {
            Figures::of(&rendered(pattern, &magnitudes(), &places(speed, 33.0, 20.0), seed)).unwrap()
        };
        let (found, truth, noise) = (figures(found, 1), figures(known, 2), figures(&Pattern::default(), 3));
        let kurtosis = (found.kurtosis / truth.kurtosis).ln().abs();
        let modulation = (found.modulation / truth.modulation).ln().abs();
        let repetition = (found.repetition - truth.repetition).abs();
        assert!(
            kurtosis < 0.15 && modulation < 0.25 && repetition < 0.1,
            "{speed} mm/s: {found:?}, {truth:?}, {noise:?}"
        );
    }
}

#[test]
fn found_bumps_pulse_and_peak_like_the_strokes() {
    let known = Pattern { waves: Vec::new(), events: Some(Events { spacing_exponent: -0.9, ..BUMPS }) };
    let found = found(&[strokes_along(&BUMPY, &known, 10.0, 100)], None, &QUICK);
    assert!(found.waves.is_empty() && found.events.is_some(), "{found:?}");
    assert_alike(&found, &known);
}

#[test]
fn bumps_that_are_rarer_across_the_grain_are_found_so() {
    let known = Events { anisotropy: [-0.6, -0.3], ..BUMPS };
    let known = Pattern { waves: Vec::new(), events: Some(known) };
    let ways: Vec<(f64, f64)> = [50.0, 150.0]
        .into_iter()
        .flat_map(|speed| [0.0, 45.0, 90.0, 135.0].map(|angle| (speed, angle + 0.1 * speed)))
        .collect();
    let found = found(&[strokes_along(&ways, &known, 6.0, 100)], None, &OF_GRAIN);
    // Bumps are 2.3 times as long as wide. Forty seconds of rare ones differ by a few per cent by
    // chance.
    for angle in [13.0, 58.0, 103.0, 148.0] {
        let [found, known] = [(&found, 1), (&known, 2)].map(|(pattern, seed)| {
            let x = rendered(pattern, &magnitudes(), &places(100.0, angle, 40.0), seed);
            Figures::of(&x).unwrap().kurtosis
        });
        assert!((found / known).ln().abs() < 0.25, "at {angle} degrees: {found} for {known}");
    }
}

#[test]
fn irregular_events_are_found_at_their_ridges() {
    let harmonics = vec![Harmonic { weight: 1.0, share: 0.7, phase: 0.0 }; 6];
    let at_ridges = Events { spacing_mm: None, interval_cv: 0.03, ..BUMPS };
    let waves = vec![Wave { per_mm: [0.4, 0.1], harmonics }];
    let known = Pattern { waves, events: Some(at_ridges) };
    // A network answers smooth magnitudes. Those of the strokes have the ridges' lines, and a filter
    // with them rings after each bump.
    let smooth = |_: [f64; 2]| std::array::from_fn(|k| magnitudes()[k]);
    let found = found(&[strokes(&known, 4.0)], Some(&smooth), &OF_WAVES);
    assert!(found.events.is_some_and(|e| e.spacing_mm.is_none()), "{found:?}");
    assert_alike(&found, &known);
}

#[test]
fn wave_repeats_about_as_much_as_the_strokes() {
    let of = |pitch: f64| Pattern {
        waves: vec![Wave {
            per_mm: [0.8 * pitch, 0.3 * pitch],
            harmonics: vec![Harmonic { weight: 1.0, share: 0.5, phase: 0.3 }; 4],
        }],
        events: None,
    };
    let pieces = [(0.97, 100), (1.0, 200), (1.03, 300)];
    let ways = [(60.0, 40.0), (80.0, -20.0), (160.0, 75.0), (240.0, 55.0)];
    let pieces = pieces.map(|(pitch, seed)| strokes_along(&ways, &of(pitch), 3.0, seed));
    let found = found(&pieces, None, &OF_WAVES);
    assert_eq!(found.waves.len(), 1, "{found:?}");
    let repeats = |pattern: &Pattern| {
        let x = rendered(pattern, &magnitudes(), &places(100.0, 10.0, 20.0), 5);
        Figures::of(&x).unwrap().wave_repetition
    };
    let (found, known) = (repeats(&found), repeats(&of(1.0)));
    assert!((found - known).abs() < 0.15, "{found} {known}");
}

#[test]
fn made_grating_has_a_wave_and_sandpaper_bumps() {
    // Wide enough that the waves that a piece consists of do not look like ridges.
    let angles = [17.0, 47.0, 77.0, 107.0, 137.0, 167.0];
    let ways: Vec<(f64, f64, f64)> =
        [80.0, 200.0].iter().flat_map(|&speed| angles.map(|a| (speed, a + 0.05 * speed, 2.0))).collect();
    let of = |name: &str, times: usize| {
        let strokes = made::strokes_over(&made::surface(name).unwrap(), times, 5, &ways);
        found(&[strokes], None, &OF_WAVES)
    };
    let grating = of("square grating 1.2 mm", 1);
    let [wave] = &grating.waves[..] else { panic!("{grating:?}") };
    // A piece has a whole number of ridges; pieces differ by 3 %.
    assert!((wave.per_mm[0].abs() * 1.2 - 1.0).abs() < 0.1 && wave.per_mm[1].abs() < 0.01, "{wave:?}");
    assert!(wave.harmonics[..8].iter().all(|h| h.share > 0.85), "{wave:?}");
    assert!(grating.events.is_none_or(|e| e.spacing_mm.is_none()), "{grating:?}");
    let sandpaper = of("sandpaper P40", 2);
    assert!(sandpaper.waves.is_empty(), "{sandpaper:?}");
    assert!(
        sandpaper.events.is_some_and(|e| e.spacing_mm.is_some_and(|mm| (0.05..2.0).contains(&mm))),
        "{sandpaper:?}"
    );
}

#[test]
fn pattern_fits_magnitudes_of_an_erring_network() {
    // The network hears none of the low half. Bumps through the rest should be as bumpy.
    let bumps = Pattern { waves: Vec::new(), events: Some(BUMPS) };
    let strokes = strokes_along(&BUMPY, &bumps, 6.0, 100);
    let network = |[x, y]: [f64; 2]| {
        assert!((20.0..400.0).contains(&x.hypot(y)));
        std::array::from_fn(|k| if k < 30 { 0.01 } else { 1.0 })
    };
    let found = [None, Some(&network as &Network<'_>)]
        .map(|network| found(std::slice::from_ref(&strokes), network, &OF_WAVES).events);
    assert!(found[0].is_some() && found[0] != found[1], "{found:?}");
}
