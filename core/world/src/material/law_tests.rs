use super::*;
use crate::material::{Random, Surface, made_materials};

fn weave() -> Law {
    made_materials().unwrap().into_iter().find(|m| m.name == "coarse weave").unwrap().law
}

fn plain() -> Parameters {
    Parameters {
        level_m_s2: 2.0,
        speed_exponent: 0.8,
        force_exponent: 0.5,
        floor_corner_per_mm: 0.8,
        floor_exponent: 2.0,
        lines: vec![Line { per_mm: 1.0, half_width_per_mm: 0.01, share: 4.0 }],
        tip_per_mm: 1000.0,
        resonance_hz: 300.0,
        resonance_damping: 0.2,
        resonance_gain: 1.0,
    }
}

fn rms(law: &Law, speed: f64, force: f64) -> f64 {
    let step = 0.02;
    (0..50_000).map(|i| law.psd(speed, force, (i as f64 + 0.5) * step) * step).sum::<f64>().sqrt()
}

#[test]
fn there_are_twelve_materials_with_distinct_names_and_vectors() {
    let made = made_materials().unwrap();
    assert_eq!(made.len(), 12);
    assert!(made.windows(2).all(|m| m[0].name < m[1].name));
    for (i, a) in made.iter().enumerate() {
        for b in &made[..i] {
            let (a, b) = (super::super::embed(&a.law), super::super::embed(&b.law));
            let distance = a.iter().zip(&b).map(|(x, y)| (x - y).powi(2)).sum::<f32>().sqrt();
            assert!(distance > 1.0, "{distance}");
        }
    }
}

#[test]
fn levels_are_those_of_real_tools_on_real_surfaces() {
    for m in made_materials().unwrap() {
        let at_reference = rms(&m.law, 100.0, 1.0);
        assert!(
            (at_reference / m.law.parameters().level_m_s2 - 1.0).abs() < 0.02,
            "{}: {at_reference}",
            m.name
        );
        let fast = rms(&m.law, 150.0, 1.0);
        assert!((0.5..10.0).contains(&fast), "{}: {fast} m/s^2", m.name);
        assert!(rms(&m.law, 300.0, 3.3) < 60.0, "{}", m.name);
    }
}

#[test]
fn no_speed_or_no_force_is_no_vibration() {
    let law = weave();
    for (v, f) in [(0.0, 1.0), (100.0, 0.0), (-5.0, 1.0), (100.0, -1.0), (f64::NAN, 1.0), (1.0, f64::NAN)] {
        assert_eq!(law.psd(v, f, 100.0), 0.0);
        assert_eq!(law.expected_power(v, f), [0.0; BINS]);
    }
    assert_eq!(law.psd(100.0, 1.0, 0.0), 0.0);
}

#[test]
fn power_is_kept_when_speed_changes_the_variable() {
    // Without growth, resonance and tip, and far above the hand's corner, all that speed does is stretch the
    // spectrum: the band [f, f + df] at speed v holds the power of [2 f, 2 f + 2 df] at 2 v.
    let law = Law::new(Parameters { speed_exponent: 0.0, ..plain() }).unwrap();
    let band = |v: f64, low: f64, high: f64| -> f64 {
        let n = 4000;
        let step = (high - low) / n as f64;
        (0..n).map(|i| law.psd(v, 1.0, low + (i as f64 + 0.5) * step) * step).sum()
    };
    let (slow, fast) = (band(100.0, 90.0, 200.0), band(200.0, 180.0, 400.0));
    assert!((slow / fast - 1.0).abs() < 2e-3, "{slow} {fast}");
}

#[test]
fn pitch_is_speed_times_spatial_frequency() {
    let law = Law::new(plain()).unwrap();
    for v in [60.0, 110.0, 240.0] {
        let peak = (100..4000)
            .map(|i| f64::from(i) * 0.1)
            .max_by(|a, b| law.psd(v, 1.0, *a).total_cmp(&law.psd(v, 1.0, *b)))
            .unwrap();
        assert!((peak - v).abs() < 0.02 * v, "{peak} Hz at {v} mm/s");
    }
}

#[test]
fn level_grows_with_force_by_its_exponent() {
    let law = weave();
    let b = law.parameters().force_exponent;
    let ratio = law.psd(80.0, 3.0, 70.0) / law.psd(80.0, 1.5, 70.0);
    assert!((ratio - 2f64.powf(2.0 * b)).abs() < 1e-9, "{ratio}");
}

/// Formulas of the module's page written again in Python and integrated by SciPy:
///
/// ```text
/// from math import *; from scipy.integrate import quad
/// def S(f,v,F,P,C=1):
///   lev,a,b,qc,p,L,qt,fr,z,g=P; q=f/v
///   G=p*sin(pi/p)/(pi*qc)/(1+(q/qc)**p)+sum(s*w/pi*(1/((q-x)**2+w*w)+1/((q+x)**2+w*w)) for x,w,s in L)
///   rh=f/15; r=f/fr
///   H=rh**4/(1+rh**4)*((1-r*r)**2+(2*g*z*r)**2)/((1-r*r)**2+(2*z*r)**2)
///   return C*(v/100)**(2*a)*F**(2*b)*G/(1+(q/qt)**4)/v*H
/// weave=(3.6,.85,.65,.9,2.6,[(.71,.045,1.6),(1.42,.09,.9),(2.13,.14,.3)],4.,240.,.22,1.8)
/// def integral(g,lo,hi): return sum(quad(g,x,x+1,epsrel=1e-10)[0] for x in range(lo,hi))
/// C=weave[0]**2/integral(lambda f:S(f,100,1,weave),0,1000)
/// def K(d):
///   x=abs(d)*.1; w=1 if x<1e-9 else .5 if abs(x-1)<1e-9 else sin(pi*x)/(pi*x)/(1-x*x); return w*w
/// def amp(k,v,F): return sqrt(pi/4*2*integral(lambda f:S(abs(f),v,F,weave,C)*K(f-10*k),-200,10*k+400))
/// print([amp(k,v,F) for k,v,F in [(1,100,1),(7,100,1),(14,100,1),(40,100,1),(3,35,2.5),(9,35,2.5),(24,290,.4),(80,290,.4)]])
/// ```
#[test]
fn expected_magnitudes_match_scipy() {
    let law = weave();
    let want = SCIPY;
    for (k, v, f, amplitude) in want {
        let got = law.expected_magnitudes(v, f)[k - 1];
        assert!((got / amplitude - 1.0).abs() < 0.02, "bin {k} at {v} mm/s, {f} N: {got} for {amplitude}");
    }
}

const SCIPY: [(usize, f64, f64, f64); 8] = [
    (1, 100.0, 1.0, 0.409124),
    (7, 100.0, 1.0, 2.224295),
    (14, 100.0, 1.0, 1.536117),
    (40, 100.0, 1.0, 0.115117),
    (3, 35.0, 2.5, 1.669737),
    (9, 35.0, 2.5, 0.421213),
    (24, 290.0, 0.4, 1.712671),
    (80, 290.0, 0.4, 0.192478),
];

/// Mean of `2 |sum w x| / sum w` over draws, the transform written out.
fn drawn_magnitudes(law: &Law, speed: f64, force: f64, bins: &[usize], draws: u64) -> Vec<f64> {
    let (rate, n) = (2500.0, 250);
    let window: Vec<f64> =
        (0..n).map(|i| 0.5 - 0.5 * (2.0 * PI * f64::from(i) / f64::from(n)).cos()).collect();
    let total: f64 = window.iter().sum();
    let mut sums = vec![0.0; bins.len()];
    for seed in 0..draws {
        let x = Surface::new(law, 1100.0 / speed, seed).play(rate, (0..n).map(|_| (speed, force)));
        for (sum, &k) in sums.iter_mut().zip(bins) {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, (w, x)) in window.iter().zip(&x).enumerate() {
                let angle = 2.0 * PI * (k * i) as f64 / f64::from(n);
                re += w * x * angle.cos();
                im -= w * x * angle.sin();
            }
            *sum += 2.0 * re.hypot(im) / total / draws as f64;
        }
    }
    sums
}

#[test]
fn signals_drawn_from_the_law_have_the_expected_magnitudes() {
    let law = weave();
    let bins = [3, 9, 17, 30, 60];
    for (speed, force) in [(120.0, 1.0), (250.0, 2.0)] {
        let drawn = drawn_magnitudes(&law, speed, force, &bins, 80);
        let expected = law.expected_magnitudes(speed, force);
        for (&k, drawn) in bins.iter().zip(drawn) {
            // a Rayleigh mean of 80 draws deviates by 5.8 %; four of those
            let ratio = drawn / expected[k - 1];
            assert!((ratio - 1.0).abs() < 0.235, "bin {k} at {speed} mm/s: {ratio}");
        }
    }
}

#[test]
fn the_newest_samples_of_a_history_say_most() {
    let law = weave();
    let loud = |from: usize, to: usize| -> f64 {
        let history: Vec<_> =
            (0..10).map(|i| (100.0, if (from..to).contains(&i) { 1.0 } else { 0.0 })).collect();
        law.expected_after(&history)[7]
    };
    let all = loud(0, 10);
    assert!((all / law.expected_magnitudes(100.0, 1.0)[7] - 1.0).abs() < 1e-12);
    // newest 3 of 10: (8 + 9 + 10) / 55 of the power
    assert!((loud(7, 10) / all - (27.0f64 / 55.0).sqrt()).abs() < 1e-12);
    assert!(loud(0, 3) < loud(7, 10));
    assert_eq!(loud(0, 0), 0.0);
    assert_eq!(law.expected_after(&[]), [0.0; BINS]);
}

#[test]
fn the_table_agrees_with_the_law() {
    let law = weave();
    let table = LawTable::new(&law, 300.0);
    let mut random = Random::new(1);
    for _ in 0..50 {
        let (start, slope) = (random.range(6.0, 280.0), random.range(-2.0, 2.0));
        let history: Vec<_> =
            (0..10).map(|i| (start + slope * f64::from(i), random.range(0.0, 3.5))).collect();
        let history: Vec<_> =
            history.into_iter().map(|(v, f): (f64, f64)| (v.clamp(4.0, 300.0), f)).collect();
        let mut got = [0.0; BINS];
        table.expected_after(&history, &mut got);
        for (got, want) in got.iter().zip(law.expected_after(&history)) {
            assert!((f64::from(*got) - want).abs() < 0.02 * want + 1e-5, "{got} {want}");
        }
    }
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let e = Law::new(Parameters { floor_exponent: 1.0, ..plain() }).unwrap_err().to_string();
    assert!(e.contains("floor_exponent") && e.contains("1.1"), "{e}");
    assert!(Law::new(Parameters { level_m_s2: f64::NAN, ..plain() }).is_err());
}
