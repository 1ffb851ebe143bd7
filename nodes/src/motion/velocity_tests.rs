use super::*;
use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_node::{Buffer, Source};

/// The tick in which the stylus begins to move, at 60 mm/s.
const MOVES: u64 = 100;

/// At rest, then on a straight way.
struct Moved;

impl Node for Moved {
    fn descriptor() -> Descriptor {
        Descriptor::new("moved", "Moves.").output(control_out("position", 3, MM)).resumes(Resume::Never)
    }
    fn prepare(_: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        Ok(Prepared::new(Self))
    }
}

impl Processor for Moved {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let s = tick.index.saturating_sub(MOVES) as f64 / f64::from(tick.tick_hz);
        tick.outputs.control(0).copy_from_slice(&[60.0 * s, 0.0, 0.0]);
        Status::Continue
    }
}

/// The reported speed in ticks from `from` on. `lost` ticks are lost, beginning with the first in which the
/// stylus has moved.
fn told(cutoff_hz: f64, every: u64, lost: u64, from: u64) -> Vec<f64> {
    told_by(&format!("cutoff_hz: {cutoff_hz:?}"), every, lost, from)
}

fn told_by(params: &str, every: u64, lost: u64, from: u64) -> Vec<f64> {
    let text = format!(
        "Graph(version: 1, tick_hz: 500, audio_hz: 48000, nodes: {{\"moved\": (kind: \"moved\"), \
         \"it\": (kind: \"velocity\", every: {every}, \
         params: ({params})), \
         \"probe\": (kind: \"probe\")}}, wires: [(\"moved\", \"it\"), (\"it.velocity\", \"probe\")])"
    );
    let graph = GraphFile::parse(&Source::new("moved.ron", text)).unwrap();
    let compiled = compile(&graph, &crate::registry().with::<Moved>(), Default::default()).unwrap();
    let mut engine = Engine::new(compiled, Options::default());
    let it = engine.schedule().index_of("it").unwrap();
    let mut all = Vec::new();
    while engine.next_tick() < from + 400 {
        let tick = engine.next_tick();
        if tick == MOVES + 1 {
            engine.skip(lost);
        }
        let tick = engine.next_tick();
        engine.tick();
        if tick >= from {
            match engine.output(it, 1).unwrap() {
                Buffer::Control { values, .. } => all.push(values[0]),
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!(engine.faults(), 0);
    all
}

#[test]
fn lost_ticks_leave_no_step_in_speed_at_any_low_pass() {
    for cutoff_hz in [0.0, 0.01, 1.0, 20.0, 80.0] {
        for every in [1, 2] {
            // From just after a gap on: the stylus moved all the while.
            for lost in [1, 9, 49, 51, 499, 501, 3001] {
                let from = MOVES + 1 + lost + lost % every;
                let (lossy, whole) = (told(cutoff_hz, every, lost, from), told(cutoff_hz, every, 0, from));
                for (a, b) in lossy.iter().zip(&whole) {
                    assert!((a - b).abs() < 1e-5, "{lost} ticks lost at {cutoff_hz} Hz: {a} and {b} mm/s");
                }
            }
        }
    }
}

#[test]
fn opening_low_pass_answers_sooner() {
    let fixed = told(20.0, 1, 0, MOVES);
    let opening = told_by("cutoff_hz: 20.0, cutoff_hz_per_mm_s: 1.0", 1, 0, MOVES);
    let half = |speeds: &[f64]| speeds.iter().position(|v| *v > 30.0).unwrap();
    assert!(half(&opening) < half(&fixed), "{} {}", half(&fixed), half(&opening));
    let most = opening.iter().copied().fold(0.0, f64::max);
    assert!((opening[399] - 60.0).abs() < 1e-6 && most < 63.0, "{} {most}", opening[399]);
}

#[test]
fn opening_low_pass_takes_lost_ticks_without_a_jump() {
    let params = "cutoff_hz: 20.0, cutoff_hz_per_mm_s: 1.0";
    let largest = |speeds: &[f64]| speeds.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
    let whole = largest(&told_by(params, 1, 0, MOVES));
    for lost in [1, 9, 51, 501, 3001] {
        let lossy = told_by(params, 1, lost, MOVES + 1 + lost);
        assert!(lossy.iter().all(|v| (0.0..63.0).contains(v)), "{lost} ticks lost: {:?}", &lossy[..4]);
        let step = largest(&lossy);
        assert!(step <= 1.2 * whole, "{lost} ticks lost: a step of {step} mm/s, and {whole} without");
    }
}
