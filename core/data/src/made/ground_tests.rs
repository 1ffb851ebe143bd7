use asperity_accuracy::accuracy::{Spectrogram, compare, waveform_db};
use asperity_motion::{Shape, StrokeParams};
use std::sync::LazyLock;

use super::super::expectations;
use super::super::strokes::Drawn;
use super::*;

/// Two pieces of a surface each, made once for all tests.
static CANVAS: LazyLock<[Ground; 2]> = LazyLock::new(|| pieces("canvas"));
static SANDPAPER: LazyLock<[Ground; 2]> = LazyLock::new(|| pieces("sandpaper P120"));

fn pieces(name: &str) -> [Ground; 2] {
    let surface = surface(name).unwrap();
    [3, 4].map(|seed| Ground::new(&surface, seed))
}

/// A circle at one speed and force.
fn hand(mean_speed_mm_s: f64, force_n: f64, duration_s: f64) -> Hand {
    let of = StrokeParams {
        shape: Shape::Circle,
        mean_speed_mm_s,
        force_n,
        force_swing: 0.0,
        duration_s,
        approach_s: 0.2,
        clearance_mm: 1.0,
        tremor_mm: 0.0,
        ..StrokeParams::default()
    };
    Hand::stroke(&of).unwrap()
}

fn seen(felt: &Felt) -> Spectrogram {
    Spectrogram::new(&felt.axes(), felt.rate_hz).unwrap()
}

#[test]
fn two_seeds_agree_in_spectrum_and_differ_in_waveform() {
    let hand = hand(100.0, 1.0, 8.0);
    let glass = seen(&Ground::new(&surface("float glass").unwrap(), 3).felt(&hand, 1));
    for (name, [ground, another]) in [("canvas", &*CANVAS), ("sandpaper P120", &*SANDPAPER)] {
        let [one, other] = [1, 2].map(|seed| ground.felt(&hand, seed));
        let truth = [seen(&one)];
        // Draws of a noise of 8 s differ by 0.5 dB (asperity-accuracy). These pass over the same 20 mm
        // twelve times.
        let place = compare(&seen(&other), &truth).unwrap();
        assert!(place.level_db.abs() < 0.5 && (0.4..1.3).contains(&place.spectrum_db), "{name}: {place:?}");
        assert!(place.perceptual > 0.95, "{name}: {place:?}");
        // Two independent signals of one level: 3 dB.
        for (a, b) in one.axes().iter().zip(other.axes()) {
            let apart = waveform_db(b, a).unwrap();
            assert!((1.5..5.5).contains(&apart), "{name}: {apart}");
        }
        // Pieces differ by 3 % in pitch and 8 % in height.
        let another = another.felt(&hand, 1);
        assert_ne!(another, one);
        let piece = compare(&seen(&another), &truth).unwrap();
        assert!(piece.level_db.abs() < 1.5 && piece.spectrum_db < 2.0 && piece.perceptual > 0.9, "{piece:?}");
        // Another surface differs.
        let far = compare(&glass, &truth).unwrap();
        assert!(far.level_db < -20.0 && far.perceptual < 0.2, "{name}: {far:?}");
    }
}

#[test]
fn recorded_stroke_feels_as_before_sensor_rounding() {
    use asperity_motion::{Stroke, Trajectory};
    let params =
        StrokeParams { duration_s: 4.0, mean_speed_mm_s: 80.0, quantum_mm: 0.055, ..StrokeParams::default() };
    let (exact, rounded) = (Hand::stroke(&params).unwrap(), Stroke::new(params).unwrap());
    let mut text = String::from("t_s,x_mm,y_mm,z_mm\n");
    for tick in 0..=2000 {
        let [x, y, z] = rounded.sample(f64::from(tick) * 0.002).position;
        text += &format!("{:.3},{x:.3},{y:.3},{z:.3}\n", f64::from(tick) * 0.002);
    }
    let source = asperity_diagnostics::Source::new("t.csv", &text);
    let recorded = Trajectory::parse(&source, &Default::default()).unwrap();
    let raw = Hand::new(4.0, |t| recorded.sample(t).position).unwrap();
    let ground = &CANVAS[0];
    let want = [seen(&ground.felt(&exact, 1))];
    let error = |hand: &Hand| compare(&seen(&ground.felt(hand, 1)), &want).unwrap();
    let (found, struck) = (error(&Hand::trajectory(&recorded).unwrap()), error(&raw));
    assert!(found.level_db.abs() < 0.3 && found.spectrum_db < 0.8 && found.perceptual > 0.97, "{found:?}");
    assert!(
        struck.spectrum_db > 2.0 * found.spectrum_db,
        "every step strikes the tool: {struck:?}, not {found:?}"
    );
}

#[test]
fn levels_are_those_of_the_expectations_over_many_places() {
    let surface = surface("sandpaper P120").unwrap();
    let strokes = [Drawn::new(2.0, &mut Random::new(9)).unwrap()];
    let settings = Settings { pieces: [0, 3], ..Settings::default() };
    let expected = expectations(&surface, &settings, &strokes, 8);
    let hand = Hand::new(2.0, |t| {
        let ([x, y], z) = strokes[0].at(&strokes[0].exact, t);
        [x, y, z]
    })
    .unwrap();
    // Every 20 ms an expectation of the frame that begins there, with bins of 10 to 1000 Hz. The first
    // bin is left out. A sine's amplitude A has a power of A^2 / 3.
    let want: f64 = expected.iter().flat_map(|e| &e.rms[1..]).map(|m| f64::from(m * m) / 3.0).sum::<f64>()
        / expected.len() as f64;
    let another = Ground::new(&surface, 0);
    let grounds = [&SANDPAPER[0], &SANDPAPER[1], &another];
    let levels: Vec<f64> = (0..6)
        .map(|seed| {
            let felt = grounds[seed as usize % 3].felt(&hand, seed);
            10.0 * (seen(&felt).mean(0..usize::MAX).iter().sum::<f64>() / want).log10()
        })
        .collect();
    let mean = levels.iter().sum::<f64>() / levels.len() as f64;
    assert!(mean.abs() < 0.6 && levels.iter().all(|level| level.abs() < 1.3), "{levels:.2?} dB");
}

#[test]
fn wide_piece_does_not_repeat_where_another_does() {
    let wide = Ground::wide(&surface("sandpaper P120").unwrap(), 3, 30.0);
    let hand = Hand::new(1.0, |t| [64.0 * t, 0.0, -2.0]).unwrap();
    // At 64 mm/s a piece of 20.48 mm repeats after 0.32 s.
    let alike = |ground: &Ground| {
        let felt = ground.felt(&hand, 1);
        let normal = &felt.axes()[0][2000..];
        let later = &normal[3200..];
        let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let now = &normal[..later.len()];
        sum(now, later) / (sum(now, now) * sum(later, later)).sqrt()
    };
    let [narrow, wide] = [&SANDPAPER[0], &wide].map(alike);
    assert!(narrow > 0.9 && wide.abs() < 0.2, "{narrow} {wide}");
}

#[test]
fn seeds_make_bits_and_air_is_silent() {
    let hand = hand(80.0, 0.8, 1.5);
    let felt = CANVAS[0].felt(&hand, 9);
    assert_eq!(felt, Ground::new(&surface("canvas").unwrap(), 3).felt(&hand, 9));
    assert_ne!(felt, CANVAS[0].felt(&hand, 10));
    assert!((felt.duration_s() - 1.5).abs() < 1e-9 && felt.axes().len() == 3);
    let touched: Vec<bool> = hand.position_mm()[1..].iter().map(|p| p[2] < 0.0).collect();
    assert!(touched.iter().any(|t| *t) && touched.iter().any(|t| !t));
    for axis in felt.axes() {
        assert!(axis.iter().zip(&touched).all(|(a, touched)| *touched || *a == 0.0));
        assert!(axis.iter().any(|a| *a != 0.0) && axis.iter().all(|a| a.is_finite()));
    }
}

#[test]
fn unknown_surface_name_is_an_error_with_nearest_name() {
    assert_eq!(surface("canvas").unwrap().name, "canvas");
    let told = surface("canvass").unwrap_err().to_string();
    assert!(told.contains("canvass"), "{told}");
}
