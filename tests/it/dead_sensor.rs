//! Fits of autoregressive models to strokes over made surfaces, whole and with a sensor that drops out.

use asperity_autoregressive::fit::{Recording, Report, Settings, Why};
use asperity_data::felt::Hand;
use asperity_data::made::{self, Ground};
use asperity_motion::STIFFNESS_N_PER_MM;
use asperity_numbers::Random;
use asperity_surfaces::stylus::SAMPLE_HZ;
use asperity_surfaces::topography::{MadeSurface, made_surfaces};

/// Noise of the sensor: that of a MEMS accelerometer, about 100 ug in the root of a hertz.
const NOISE_M_S2: f64 = 0.02;
/// Speeds in mm/s, each with all forces in N.
const SPEEDS: [f64; 4] = [15.0, 50.0, 110.0, 220.0];
const FORCES: [f64; 3] = [0.5, 1.0, 2.0];
/// Time at each, and on the way to the next, in s.
const HOLD_S: f64 = 1.5;
const WAY_S: f64 = 0.3;

struct Stroke {
    force_n: Vec<f64>,
    speed_mm_s: Vec<f64>,
    axes: Vec<Vec<f64>>,
}

/// A stroke at all speeds and forces, twice.
fn stroke(surface: &MadeSurface) -> Stroke {
    let rate_hz = f64::from(SAMPLE_HZ);
    let places: Vec<[f64; 2]> = SPEEDS.iter().flat_map(|v| FORCES.map(|f| [*v, f])).collect();
    let at = |t: f64| {
        let stay = (t / (HOLD_S + WAY_S)) as usize;
        let part = ((t - stay as f64 * (HOLD_S + WAY_S) - HOLD_S) / WAY_S).clamp(0.0, 1.0);
        let [from, to] = [stay, stay + 1].map(|i| places[i % places.len()]);
        [0, 1].map(|k| from[k] + part * (to[k] - from[k]))
    };
    let seconds = 2.0 * places.len() as f64 * (HOLD_S + WAY_S);
    let mut way = 0.0;
    let hand = Hand::new(seconds, |t| {
        let [speed, force] = at(t);
        way += speed / rate_hz;
        [0.8 * way, 0.6 * way, -force / STIFFNESS_N_PER_MM]
    });
    let felt = Ground::new(surface, 3).felt(&hand.unwrap(), 4);
    let mut random = Random::new(5);
    let mut axes = felt.acceleration_m_s2;
    // Gravity on one axis.
    axes[0].iter_mut().for_each(|x| *x += 9.81);
    axes.iter_mut().flatten().for_each(|x| *x += NOISE_M_S2 * random.normal());
    let moments = (0..axes[0].len()).map(|n| at(n as f64 / rate_hz));
    let (speed_mm_s, force_n) = moments.map(|[v, f]| (v, f)).unzip();
    Stroke { force_n, speed_mm_s, axes }
}

fn fit(stroke: &Stroke, axes: &[Vec<f64>]) -> Report {
    let recording = Recording {
        rate_hz: f64::from(SAMPLE_HZ),
        force_n: &stroke.force_n,
        speed_mm_s: &stroke.speed_mm_s,
        acceleration_m_s2: axes.iter().map(Vec::as_slice).collect(),
    };
    recording.fit(&Settings::default()).unwrap().1
}

/// Seconds that are left out since there is no signal.
fn left_out(report: &Report) -> Vec<[f64; 2]> {
    let no_signal = report.dropped.iter().filter(|d| matches!(d.why, Why::Still | Why::Clipped | Why::Dead));
    no_signal.map(|d| [d.start_s, d.start_s + d.length_s]).collect()
}

/// Seconds of a stroke in which its sensor drops out: within a stay, across several, and a whole one.
const OUT_S: [[f64; 2]; 4] = [[3.8, 4.1], [12.0, 13.1], [21.0, 25.0], [34.2, 35.8]];

/// Ways in which a sensor drops out, from its samples, noise and the number of the stretch.
const WAYS: [(&str, fn(f64, f64) -> f64); 4] = [
    ("noise alone", |_, noise| noise),
    ("noise at another level", |_, noise| noise - 9.81),
    ("zeros", |_, _| 0.0),
    ("a thousandth", |x, noise| 1e-3 * x + noise),
];

/// Part of the seconds out that are left out, and seconds left out that were not out.
fn found(surface: &MadeSurface, way: fn(f64, f64) -> f64) -> (f64, f64) {
    let stroke = stroke(surface);
    let mut axes = stroke.axes.clone();
    let mut random = Random::new(6);
    for [from, to] in OUT_S.map(|out| out.map(|t| (t * f64::from(SAMPLE_HZ)) as usize)) {
        for axis in &mut axes {
            let mean = axis[from..to].iter().sum::<f64>() / (to - from) as f64;
            axis[from..to].iter_mut().for_each(|x| *x = way(*x - mean, NOISE_M_S2 * random.normal()));
        }
    }
    let told = left_out(&fit(&stroke, &axes));
    let both = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (b.min(d) - a.max(c)).max(0.0);
    let overlap: f64 = OUT_S.iter().flat_map(|out| told.iter().map(|t| both(*out, *t))).sum();
    let out: f64 = OUT_S.iter().map(|[from, to]| to - from).sum();
    let all: f64 = told.iter().map(|[from, to]| to - from).sum();
    (overlap / out, all - overlap)
}

#[test]
fn sensor_that_drops_out_is_left_out_of_the_fit() {
    for name in ["canvas", "sandpaper P80", "rubber pebble mat"] {
        let surface = made::surface(name).unwrap();
        let whole = stroke(&surface);
        assert_eq!(left_out(&fit(&whole, &whole.axes)), [] as [[f64; 2]; 0], "{name}");
        for (how, way) in WAYS {
            let (part, wrong) = found(&surface, way);
            assert!(part > 0.98 && wrong < 0.2, "{name}, {how}: {part} and {wrong} s");
        }
    }
}

#[test]
#[ignore = "some minutes: every made surface"]
fn drop_outs_over_all_made_surfaces() {
    let all = made_surfaces();
    let mut lost = 0.0;
    for surface in &all {
        let whole = stroke(surface);
        let told = left_out(&fit(&whole, &whole.axes));
        lost += told.iter().map(|[a, b]| b - a).sum::<f64>();
        let ways = WAYS.map(|(_, way)| found(surface, way));
        let ways = ways.map(|(part, wrong)| format!("{:.0} % {wrong:.2} s", 100.0 * part));
        println!("{:24} {told:?} {}", surface.name, ways.join("  "));
    }
    println!("{} surfaces, {lost} s of whole strokes left out", all.len());
}
