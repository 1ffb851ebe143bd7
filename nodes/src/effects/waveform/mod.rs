//! `waveform`: a texture that is read by the distance travelled.

mod kernel;
mod reader;
mod table;

use std::path::PathBuf;

use asperity_data::wav::Wav;
use asperity_diagnostics::ron::Value;
use asperity_node::{
    Acts, Descriptor, Diagnostic, Effect, Fact, Form, Input, Node, Param, Prepared, Processor, Resume,
    Settings, Setup, ShapeSpec, State, Status, Tick, Unit,
};

use super::mix::Mix;
use super::path::Parts;
use super::shared::Shared;
use super::track::Track;
use super::voices::{Voice, Voices};
use super::{acceleration, each, files, gain, made, slot};
pub use reader::Reader;
pub use table::{WaveformQuantity, WaveformTable};

const SLOT: usize = 0;
const PLACE: usize = 1;
const STROKE: usize = 2;

/// A loop, drawn or recorded, that is read by distance: faster motion reads faster.
///
/// The path between ticks goes through the middles of positions, along parabolas. A slot that comes on begins
/// at its loop's beginning; the path goes on.
pub struct Waveform {
    loops: Voices<Loop>,
    track: Track,
    mix: Mix,
    rate_hz: u32,
    lag_s: f64,
    tables: u64,
}

/// A loop with the state of its reading.
#[derive(Clone)]
struct Loop {
    waveform: Reader,
    gain: f64,
}

impl Voice for Loop {
    fn reset(&mut self) {
        self.waveform.reset();
    }

    fn state(&mut self, state: &mut State<'_>) {
        self.waveform.state(state);
    }
}

/// The position of the stylus along the surface, and the number of its stroke.
pub(super) fn place() -> [Input; 2] {
    [
        Input::new("place", ShapeSpec::Control(2), Unit::MILLIMETRE).doc("of the stylus along the surface"),
        Input::new("stroke", ShapeSpec::Control(1), Unit::NONE)
            .or(0.0)
            .doc("another number: the stylus was put down elsewhere, and what lies between is no motion"),
    ]
}

/// The low-pass for positions.
pub(super) fn smooth_hz() -> Param {
    Param::number(
        "smooth_hz",
        0.0,
        0.0..=1000.0,
        "Cutoff of a low-pass of second order for places, such as 20 for a device that tells them in coarse \
         steps; 0 for none.",
    )
    .unit("Hz")
}

/// Longest recording of a loop in samples.
const MAX_RECORDED: u32 = 1 << 22;

fn effect() -> Effect {
    let example = "waveform(segments: [(0, 0), (0.5, 1), (1, 0)], reference_speed_mm_s: 100)";
    Effect::new("loops", Acts::Gliding)
        .form(
            Form::new("", example)
                .nested("segments")
                .nested("recording")
                .field(
                    Param::number(
                        "spacing_mm",
                        0.05,
                        1e-4..=100.0,
                        "distance of the values made of segments",
                    )
                    .unit("mm"),
                )
                .field(
                    Param::number("crossfade_mm", 0.0, 0.0..=1e5, "how much of the end fades into the start")
                        .unit("mm"),
                )
                .field(Param::choice("quantity", &["acceleration", "height"], "quantity of segments"))
                .field(
                    Param::number(
                        "reference_speed_mm_s",
                        100.0,
                        0.1..=5000.0,
                        "sounds as drawn at this speed",
                    )
                    .unit("mm/s"),
                )
                .field(Param::number("speed_exponent", 1.0, 0.0..=2.0, "the level's power of the speed"))
                .field(gain()),
        )
        .needs("place", "place")
        .needs("stroke", "stroke")
        .check(|settings| match values(settings)? {
            Values::Segments(segments) => {
                let (spacing, crossfade, quantity) = read_as(settings);
                made(settings, WaveformTable::check_segments(&segments, spacing, crossfade, quantity))
            }
            Values::Recorded { .. } => Ok(()),
        })
}

/// Source of a loop's values: pairs of a distance in mm and a value, or a recording at a constant speed whose
/// file is not read yet.
enum Values {
    Segments(Vec<(f64, f64)>),
    Recorded { file: PathBuf, speed_mm_s: f64, full_scale_m_s2: f64 },
}

fn values(settings: &Settings) -> Result<Values, Diagnostic> {
    match (settings.nested("segments"), settings.nested("recording")) {
        (Some(list), None) => {
            list.list()?.iter().map(segment).collect::<Result<_, _>>().map(Values::Segments)
        }
        (None, Some(value)) => {
            for name in ["spacing_mm", "quantity", "reference_speed_mm_s"] {
                if settings.is_set(name) {
                    let message = format!("`{name}` is for `segments`, not for a recording");
                    return Err(settings.error(name, message));
                }
            }
            recording(value)
        }
        (Some(_), Some(second)) => Err(second
            .error("a waveform has both `segments` and a `recording`")
            .help("leave one of the two out")),
        (None, None) => Err(settings.node_error("a waveform needs `segments` or a `recording`").help(
            "segments: [(0, 0), (0.5, 1), (1, 0)], or recording: (file: \"felt.wav\", speed_mm_s: 100, \
             full_scale_m_s2: 50)",
        )),
    }
}

fn segment(pair: &Value) -> Result<(f64, f64), Diagnostic> {
    match pair.list()? {
        [distance, height] => Ok((distance.f64_in(-1e6..=1e6, "")?, height.f64_in(-1e6..=1e6, "")?)),
        other => Err(pair.error(format!("{} numbers, where 2 are wanted", other.len()))),
    }
}

fn recording(value: &Value) -> Result<Values, Diagnostic> {
    let mut record = value.record("recording")?;
    let file = record.required("file")?.path()?;
    let speed_mm_s = record.required("speed_mm_s")?.f64_in(0.1..=5000.0, "mm/s")?;
    let full_scale_m_s2 = record.required("full_scale_m_s2")?.f64_in(1e-3..=1e5, "m/s^2")?;
    record.finish()?;
    Ok(Values::Recorded { file, speed_mm_s, full_scale_m_s2 })
}

/// Spacing and crossfade \[mm\] of segments, and the quantity of their values.
fn read_as(settings: &Settings) -> (f64, f64, WaveformQuantity) {
    let quantity = match settings.text("quantity") {
        "height" => WaveformQuantity::Height,
        _ => WaveformQuantity::Acceleration {
            reference_speed_mm_s: settings.number("reference_speed_mm_s"),
            speed_exponent: settings.number("speed_exponent"),
        },
    };
    (settings.number("spacing_mm"), settings.number("crossfade_mm"), quantity)
}

/// The loop of a slot, ready to be read. A recording is read from its file.
fn table(settings: &Settings) -> Result<WaveformTable, Diagnostic> {
    let (spacing_mm, crossfade_mm, quantity) = read_as(settings);
    match values(settings)? {
        Values::Segments(segments) => {
            made(settings, WaveformTable::from_segments(&segments, spacing_mm, crossfade_mm, quantity))
        }
        Values::Recorded { file, speed_mm_s, full_scale_m_s2 } => {
            let wav = Wav::read(&file, MAX_RECORDED)?;
            let values: Vec<f64> = wav.channel(0).map(|x| full_scale_m_s2 * x).collect();
            let quantity = WaveformQuantity::Acceleration {
                reference_speed_mm_s: speed_mm_s,
                speed_exponent: settings.number("speed_exponent"),
            };
            let spacing_mm = speed_mm_s / f64::from(wav.rate_hz);
            WaveformTable::new(&values, spacing_mm, crossfade_mm, quantity)
                .map_err(|e| Diagnostic::new(e.to_string()).in_file(&file))
        }
    }
}

impl Node for Waveform {
    fn descriptor() -> Descriptor {
        let [place, stroke] = place();
        Descriptor::new("waveform", "A texture from a loop that is read by the distance travelled.")
            .input(slot("which of `loops`, from 0; below 0 none sounds"))
            .input(place)
            .input(stroke)
            .output(acceleration().doc("the vibration of gliding"))
            .param(Param::texts(
                "loops",
                "Loops, each a text as behind `texture` in a scene; or a list of them, `[waveform(..), \
                 waveform(..)]`, whose sum is one entry.",
            ))
            .param(smooth_hz())
            .timing(
                "a tick and a half less a sample; silent in the first tick after it wakes, which has no \
                 speed yet, and faded in over the second; smoothing at 20 Hz adds 11 ms",
            )
            .resumes(Resume::Restart)
            .effect(effect())
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut tables = Shared::default();
        let loops = each(setup, |settings| {
            let table = tables.get(settings, || table(settings))?;
            Ok(Loop { waveform: Reader::new(table), gain: settings.number("gain") })
        })?;
        let track = Track::new(setup, setup.params.number("smooth_hz"))?;
        let latency = track.latency(setup);
        let it = Self {
            loops: Voices::new(loops),
            lag_s: track.lag_s(),
            track,
            mix: Mix::new(setup),
            rate_hz: setup.audio_hz,
            tables: tables.count(),
        };
        Ok(Prepared::new(it).latency(latency).files(files(setup)))
    }
}

impl Processor for Waveform {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let turned = self.loops.turn(tick.inputs.value(SLOT));
        let place = tick.inputs.control(PLACE).try_into().unwrap_or([f64::NAN; 2]);
        let path = self.track.advance(place, tick.inputs.value(STROKE)).copied();
        let loops = self.loops.on();
        let Some(path) = path.filter(|_| !loops.is_empty()) else { return Status::Quiet };
        if self.track.begins() {
            loops.iter_mut().for_each(|one| one.waveform.lift());
        }
        let span = tick.samples(self.rate_hz);
        let parts = Parts::new(tick.index, span.start, self.rate_hz, tick.tick_hz);
        self.mix.begin((span.end - span.start) as usize);
        for one in loops {
            self.mix.add(one.gain, |part| one.waveform.process(&path, &parts, part));
        }
        if turned || self.track.begins() {
            self.mix.fade_in(&parts);
        }
        self.mix.write(tick.outputs.audio(0));
        Status::Continue
    }

    fn reset(&mut self) {
        self.loops.reset();
        self.track.reset();
    }

    /// Last positions of the stylus, and position in its loop. Another loop continues at the same distance.
    fn state(&mut self, state: &mut State<'_>) {
        self.track.state(state);
        self.loops.state(state);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let mut facts =
            vec![Fact::count("slots", self.loops.count() as u64), Fact::count("tables", self.tables)];
        if self.lag_s > 0.0 {
            facts.push(Fact::number("response_lag", 1e3 * self.lag_s, "ms"));
        }
        facts
    }
}
