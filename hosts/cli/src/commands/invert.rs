//! `asperity invert`: magnitude frames from NumPy through any phase-retrieval node.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use asperity_engine::{Engine, Options};
use asperity_graph::{GraphFile, compile};
use asperity_measure::npy;
use asperity_node::{
    Buffer, Config, Descriptor, Diagnostic, Fault, FrameLayout, FrameRate, LayoutSpec, NodeKind, Output,
    Ports, Processor, Registry, Setup, ShapeSpec, Status, Tick, Unit, time,
};
use asperity_source::{Source, one_of};

use crate::args::{Format, Invert};
use crate::failure::{Failure, print, warn};
use crate::kinds;
use crate::output::{Rows, ending, resolved};

/// Frames a second of the input.
const FRAME_HZ: u32 = 500;
/// The graph that says what `default` is.
const SHIPPED: &str = include_str!("../../../../graphs/heravi2024.ron");
/// Rates that are accepted, in Hz.
const RATES: std::ops::RangeInclusive<u32> = 100..=192_000;

/// Runs the command.
pub fn run(args: &Invert) -> Result<ExitCode, Failure> {
    if resolved(&args.out) == resolved(&args.magnitudes) {
        return Err(Diagnostic::new("these are the magnitudes themselves")
            .in_file(&args.out)
            .help("name another file")
            .into());
    }
    let frames = Arc::new(read(args)?);
    let mut registry = kinds::registry(&args.plugins.plugin)?;
    let length = u64::from(frames.layout.length);
    let count = frames.count() as u64;
    let samples = FRAME.first_sample(count - 1, args.rate) + length;
    registry.add(Arc::new(MagnitudesKind { descriptor: descriptor(frames.layout), frames }));
    let graph = graph(args, &registry)?;
    let compiled = compile(&graph, &registry, asperity_graph::Options::default())?;
    let schedule = &compiled.schedule;
    let probe = schedule.index_of("out").ok_or_else(|| Failure::Machine("the probe is gone".into()))?;
    let late = {
        let (num, den) = schedule.latency().as_ratio();
        (i128::from(num) * i128::from(args.rate)).div_euclid(i128::from(den)) as i64
    };

    let rate = match schedule.nodes[probe].inputs[0].port.as_ref().map(|p| p.shape) {
        Some(asperity_node::Shape::Audio { rate_hz }) => rate_hz,
        _ => args.rate,
    };
    if rate != args.rate {
        return Err(Diagnostic::new(format!("this node answers at {rate} Hz, not at --rate {}", args.rate))
            .in_file("--phase")
            .into());
    }
    let mut rows = match ending(&args.out).as_str() {
        "wav" => Rows::wav(&args.out, 1, rate, Format::F32)?,
        "npy" => Rows::npy(&args.out, None)?,
        _ => {
            return Err(Diagnostic::new("cannot tell the format from this name")
                .in_file(&args.out)
                .help("a .wav or .npy file")
                .into());
        }
    };
    let mut engine = Engine::new(compiled, Options::default());
    // What a node declares as latency is taken out: sample i of the file is sample i of the frames.
    let mut signal = vec![0.0_f32; late.min(0).unsigned_abs() as usize];
    let wanted = (samples as i64 + late.max(0)) as usize;
    while signal.len() < wanted {
        engine.tick();
        if let Some(Buffer::Audio { samples, len, .. }) = engine.input(probe, 0) {
            signal.extend_from_slice(&samples[..*len]);
        }
        if engine.next_tick() > 2 * u64::from(FRAME_HZ) + count + wanted as u64 {
            return Err(Failure::Machine("the node put out no audio".into()));
        }
    }
    let skip = late.max(0) as usize;
    rows.append(&signal[skip..wanted], 1, |_| 0.0)?;
    rows.keep()?;
    print(&format!("wrote {}: {samples} samples at {rate} Hz from {count} frames\n", args.out.display()))?;
    match engine.faults() {
        0 => Ok(ExitCode::SUCCESS),
        n => Err(Failure::Machine(format!("the node failed {n} times; what it failed in is silent"))),
    }
}

const FRAME: Rate = Rate;

/// Frame starts at [`FRAME_HZ`].
struct Rate;

impl Rate {
    fn first_sample(&self, frame: u64, rate_hz: u32) -> u64 {
        time::first_sample(frame, rate_hz, FRAME_HZ)
    }
}

/// Magnitudes as amplitudes, and their layout.
struct Frames {
    layout: FrameLayout,
    bins: Vec<f32>,
}

impl Frames {
    fn count(&self) -> usize {
        self.bins.len() / self.layout.bins as usize
    }
}

fn read(args: &Invert) -> Result<Frames, Failure> {
    let rate = args.rate;
    if !RATES.contains(&rate) || !rate.is_multiple_of(10) {
        return Err(Diagnostic::new(format!("--rate {rate} does not fit"))
            .help(format!(
                "{} to {} Hz, and a multiple of 10, so that 0.1 s is a whole number of samples",
                RATES.start(),
                RATES.end()
            ))
            .into());
    }
    let length = rate / 10;
    let array = npy::read(&args.magnitudes)?;
    let &[count, bins] = array.shape.as_slice() else {
        return Err(refuse(&args.magnitudes, &array.shape, "two dimensions: [frames, bins]"));
    };
    let most = length as usize / 2 + 1;
    if count == 0 || bins == 0 || bins > most {
        let help = format!("at least one frame, and 1 to {most} bins at {rate} Hz");
        return Err(refuse(&args.magnitudes, &array.shape, &help));
    }
    let mut values = array.values.into_f32();
    // An unscaled DFT of a Hann window, whose sum is half its length, to amplitudes.
    let scale = 4.0 / length as f32;
    let mut bad = 0_u64;
    for x in &mut values {
        if *x >= 0.0 && x.is_finite() {
            *x *= scale;
        } else {
            bad += 1;
            *x = 0.0;
        }
    }
    if bad > 0 {
        warn(&format!("{bad} magnitudes are negative or not finite and are taken as 0"));
    }
    let frame_rate = FrameRate::new(FRAME_HZ, 1).ok_or_else(|| Failure::Machine("no frame rate".into()))?;
    let layout = FrameLayout { rate_hz: rate, length, bins: bins as u32, frame_rate };
    Ok(Frames { layout, bins: values })
}

fn refuse(path: &Path, shape: &[usize], wanted: &str) -> Failure {
    Diagnostic::new(format!("an array of shape {shape:?} does not fit")).in_file(path).help(wanted).into()
}

/// frames -> the node -> overlap_add where it answers spectra -> probe
fn graph(args: &Invert, registry: &Registry) -> Result<GraphFile, Failure> {
    let mut graph = GraphFile::empty("asperity invert");
    graph.tick_hz = FRAME_HZ;
    graph.seed = args.seed;
    let (kind, settings) = args.phase.split_once(':').unwrap_or((&args.phase, ""));
    let phases: Vec<&str> = registry
        .iter()
        .filter(|k| answers(k.descriptor()).is_some())
        .map(|k| k.descriptor().kind.as_ref())
        .collect();
    graph.add_node("frames", MAGNITUDES, &[], "invert")?;
    graph.add_node("out", "probe", &[], "invert")?;
    let kind = if kind == "default" {
        let shipped = GraphFile::parse(&Source::new("heravi2024.ron (shipped)", SHIPPED))?;
        let node = shipped.nodes.iter().find(|n| phases.contains(&n.kind.as_str()));
        let node = node.ok_or_else(|| Failure::Machine("the shipped graph has no phase retrieval".into()))?;
        let mut node = node.clone();
        node.id = "phase".into();
        graph.nodes.push(node.clone());
        node.kind
    } else {
        if !phases.contains(&kind) {
            return Err(Diagnostic::new(format!("`{kind}` is no phase-retrieval node"))
                .in_file("--phase")
                .help(one_of(kind, phases.iter().copied()))
                .into());
        }
        graph.add_node("phase", kind, &[], "--phase")?;
        kind.to_owned()
    };
    for setting in settings.split(',').filter(|s| !s.trim().is_empty()) {
        graph.set(&format!("phase.{}", setting.trim()), "--phase")?;
    }
    let descriptor = registry.get(&kind).map(|k| k.descriptor().clone());
    let Some((input, output, to)) = descriptor.as_ref().and_then(answers) else {
        return Err(Failure::Machine(format!("`{kind}` has lost its ports")));
    };
    graph.add_wire("frames.magnitude", &format!("phase.{input}"), "invert");
    if to == Answer::Audio {
        graph.add_wire(&format!("phase.{output}"), "out.in", "invert");
    } else {
        graph.add_node("synthesis", "overlap_add", &[], "invert")?;
        graph.add_wire(&format!("phase.{output}"), "synthesis.spectrum", "invert");
        graph.add_wire("synthesis.signal", "out.in", "invert");
    }
    Ok(graph)
}

#[derive(PartialEq)]
enum Answer {
    Spectrum,
    Audio,
}

/// Input and output of a kind that retrieves phase, and what it answers.
fn answers(d: &Descriptor) -> Option<(&str, &str, Answer)> {
    let input = d.inputs.iter().find(|p| matches!(p.shape, ShapeSpec::Magnitude(_)))?;
    d.outputs.iter().find_map(|p| {
        let answer = match p.shape {
            ShapeSpec::Spectrum(_) => Answer::Spectrum,
            ShapeSpec::Audio(_) => Answer::Audio,
            _ => return None,
        };
        Some((input.name.as_ref(), p.name.as_ref(), answer))
    })
}

const MAGNITUDES: &str = "magnitudes of a file";

/// A source that plays frames from memory; this command's own.
struct MagnitudesKind {
    descriptor: Descriptor,
    frames: Arc<Frames>,
}

fn descriptor(layout: FrameLayout) -> Descriptor {
    let shape = ShapeSpec::Magnitude(LayoutSpec::Is(layout));
    Descriptor::new(MAGNITUDES, "Plays the frames of the file.").output(Output::new(
        "magnitude",
        shape,
        Unit::METRE_PER_SECOND_SQUARED,
    ))
}

impl NodeKind for MagnitudesKind {
    fn descriptor(&self) -> &Descriptor {
        &self.descriptor
    }

    fn ports(&self, _config: &Config<'_>) -> Result<Ports, Diagnostic> {
        Ok(Ports { inputs: Vec::new(), outputs: self.descriptor.outputs.clone() })
    }

    fn prepare(&self, _setup: &Setup<'_>) -> Result<Box<dyn Processor>, Diagnostic> {
        Ok(Box::new(Magnitudes(self.frames.clone())))
    }
}

struct Magnitudes(Arc<Frames>);

impl Processor for Magnitudes {
    fn process(&mut self, tick: &mut Tick<'_>) -> Result<Status, Fault> {
        let Frames { layout, bins } = &*self.0;
        let at = tick.index as usize * layout.bins as usize;
        let Some(frame) = bins.get(at..at + layout.bins as usize) else { return Ok(Status::Asleep) };
        let start = FRAME.first_sample(tick.index, layout.rate_hz);
        tick.outputs.magnitude(0, tick.index, start).copy_from_slice(frame);
        Ok(Status::Continue)
    }

    fn reset(&mut self) -> Result<(), Fault> {
        Ok(())
    }
}
