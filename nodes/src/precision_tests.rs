//! Each node in double precision against the same node in single.

use super::*;
use asperity_dsp::{Complex, Stft};
use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{Buffer, FrameLayout, FrameRate, LayoutSpec, Output, ShapeSpec, Source, Unit};
use std::f64::consts::TAU;

const RATE: u32 = 2500;
const N: usize = 250;
const BINS: usize = 101;
const FRAMES: u64 = 400;

/// Half the distance from 1 to the next f32: what one operation rounds by at most, relative.
const EPS: f64 = 1.0 / (1 << 24) as f64;

/// A chirp over noise of many sines, rms about 1 each.
fn signal(i: u64) -> f64 {
    let t = i as f64 / f64::from(RATE);
    let sine = |k: u32| (TAU * (f64::from(k * k % 97) * 9.7 * t) + f64::from(k * k)).sin();
    (TAU * (90.0 + 100.0 * t) * t).sin() + (1..60).map(sine).sum::<f64>() / 30f64.sqrt()
}

/// Amplitudes of a frame's bins.
fn magnitudes(stft: &mut Stft<f64>, frame: u64, x: impl Fn(u64) -> f64) -> Vec<f64> {
    let from = frame * 5;
    let cut: Vec<f64> = (from..from + N as u64).map(x).collect();
    stft.process(&cut).iter().take(BINS).map(|c| c.norm()).collect()
}

/// Plays the magnitudes of [`signal`].
struct Given(Stft<f64>);

impl Node for Given {
    fn descriptor() -> Descriptor {
        let frame_rate = FrameRate::new(500, 1).unwrap();
        let layout = FrameLayout { rate_hz: RATE, length: N as u32, bins: BINS as u32, frame_rate };
        let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
        Descriptor::new("given", "Plays frames.").output(Output::new("magnitude", shape, Unit::NONE))
    }
    fn prepare(_: &Setup<'_>) -> Result<Self, Diagnostic> {
        Ok(Self(Stft::new(N)))
    }
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let mags = magnitudes(&mut self.0, tick.index, signal);
        let out = tick.outputs.magnitude(0, tick.index, tick.index * 5);
        out.iter_mut().zip(mags).for_each(|(to, m)| *to = m as f32);
        Status::Continue
    }
    fn reset(&mut self) {}
}

/// What the node `it` puts out over all ticks, where `before` stands between it and the frames.
fn run(before: &[&str], kind: &str, settings: &str, precision: &str) -> Vec<Complex<f64>> {
    let mut nodes = String::from("\"given\": (kind: \"given\")");
    let mut wires = String::new();
    let mut last = "given";
    for node in before {
        nodes += &format!(", \"{node}\": (kind: \"{node}\")");
        wires += &format!("(\"{last}\", \"{node}\"), ");
        last = node;
    }
    let text = format!(
        "Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{{nodes}, \"it\": (kind: \"{kind}\", \
         params: ({settings} precision: \"{precision}\")), \"probe\": (kind: \"probe\")}}, \
         wires: [{wires}(\"{last}\", \"it\"), (\"it\", \"probe\")])"
    );
    let graph = GraphFile::parse(&Source::new("precision.ron", text)).unwrap();
    let compiled = compile(&graph, &crate::registry().with::<Given>(), Default::default()).unwrap();
    let mut engine = Engine::new(compiled, Options::default());
    let it = engine.schedule().index_of("it").unwrap();
    let mut all = Vec::new();
    for _ in 0..FRAMES {
        engine.tick();
        match engine.output(it, 0).unwrap() {
            Buffer::Audio { samples, len, .. } => {
                all.extend(samples[..*len].iter().map(|&y| Complex::new(f64::from(y), 0.0)));
            }
            Buffer::Spectrum { bins, .. } => {
                all.extend(bins.iter().map(|c| Complex::new(f64::from(c.re), f64::from(c.im))));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(engine.faults(), 0);
    all
}

/// The same in both precisions.
fn both(before: &[&str], kind: &str, settings: &str) -> [Vec<Complex<f64>>; 2] {
    ["f32", "f64"].map(|precision| run(before, kind, settings, precision))
}

/// The largest difference over `scale`, of values in order.
fn apart(both: &[Vec<Complex<f64>>; 2], scale: impl Fn(usize) -> f64) -> f64 {
    let [single, double] = both;
    assert_eq!(single.len(), double.len());
    let each = single.iter().zip(double).enumerate();
    each.map(|(i, (a, b))| (a - b).norm() / scale(i)).fold(0.0, f64::max)
}

/// The largest value.
fn peak(values: &[Complex<f64>]) -> f64 {
    values.iter().map(|y| y.norm()).fold(0.0, f64::max)
}

#[test]
fn explore() {
    for (before, kind, settings) in [
        (&[][..], "phase_vocoder", ""),
        (&[], "random_phase", ""),
        (&[], "spsi", ""),
        (&[], "oscillator_bank", ""),
        (&[], "oscillator_bank", "partials: \"tracked\","),
        (&[], "sample_commit", ""),
        (&[], "sample_commit", "emission: 0,"),
        (&["random_phase"], "overlap_add", ""),
        (&["phase_vocoder", "overlap_add"], "resample", ""),
        (&["phase_vocoder", "overlap_add"], "resample", "phase: \"minimum\","),
    ] {
        let both = both(before, kind, settings);
        let top = peak(&both[0]);
        println!("{kind} {settings} peak {top} apart/peak/EPS {}", apart(&both, |_| top * EPS));
        if both[0].len() == FRAMES as usize * BINS {
            println!("   each: {}", apart(&both, |i| both[0][i].norm().max(1e-20) * EPS));
            let mut e: Vec<f64> =
                both[0].iter().zip(&both[1]).map(|(a, b)| (a - b).norm() / a.norm() / EPS).collect();
            e.sort_by(f64::total_cmp);
            println!(
                "   each: median {} {} {} {} {}",
                e[e.len() / 2],
                e[e.len() * 9 / 10],
                e[e.len() * 99 / 100],
                e[e.len() * 999 / 1000],
                e[e.len() - 1]
            );
        } else {
            let n = both[0].len();
            for q in 0..8 {
                let r = n * q / 8..n * (q + 1) / 8;
                let d = both[0][r.clone()]
                    .iter()
                    .zip(&both[1][r])
                    .map(|(a, b)| (a - b).norm())
                    .fold(0.0, f64::max);
                println!("   {q} {}", d / top / EPS);
            }
        }
    }
}
