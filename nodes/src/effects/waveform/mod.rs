//! `waveform`: a texture that is read by the distance travelled.

mod kernel;
mod reader;
mod table;

use std::path::PathBuf;

use crate::ports::{Doc, choice, number};
use asperity_data::wav::Wav;
use asperity_diagnostics::ron::Value;
use asperity_node::{Acts, Descriptor, Diagnostic, Effect, Form, Node, Prepared, Settings, Setup};

use super::gliding::{self, Gained};
use super::{Made, each, gain, made, shared};
pub(super) use reader::Reader;
pub(super) use table::{WaveformQuantity, WaveformTable};

/// A loop, drawn or recorded, that is read by distance: faster motion reads faster.
///
/// A slot that comes on begins at its loop's beginning; the path goes on.
pub struct Waveform;

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
                    number("spacing_mm", 0.05, 1e-4..=100.0, "mm")
                        .doc("distance of the values made of segments"),
                )
                .field(
                    number("crossfade_mm", 0.0, 0.0..=1e5, "mm")
                        .doc("how much of the end fades into the start"),
                )
                .field(choice("quantity", &["acceleration", "height"]).doc("quantity of segments"))
                .field(
                    number("reference_speed_mm_s", 100.0, 0.1..=5000.0, "mm/s")
                        .doc("sounds as drawn at this speed"),
                )
                .field(number("speed_exponent", 1.0, 0.0..=2.0, "").doc("the level's power of the speed"))
                .field(gain()),
        )
        .check(|settings| match values(settings)? {
            Values::Segments(_) => table(settings).map(drop),
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

/// The loop of a slot, ready to be read. A recording is read from its file.
fn table(settings: &Settings) -> Result<WaveformTable, Diagnostic> {
    let (spacing_mm, crossfade_mm) = (settings.number("spacing_mm"), settings.number("crossfade_mm"));
    let acceleration = |reference_speed_mm_s| WaveformQuantity::Acceleration {
        reference_speed_mm_s,
        speed_exponent: settings.number("speed_exponent"),
    };
    match values(settings)? {
        Values::Segments(segments) => {
            let quantity = match settings.text("quantity") {
                "height" => WaveformQuantity::Height,
                _ => acceleration(settings.number("reference_speed_mm_s")),
            };
            made(settings, WaveformTable::from_segments(&segments, spacing_mm, crossfade_mm, quantity))
        }
        Values::Recorded { file, speed_mm_s, full_scale_m_s2 } => {
            let wav = Wav::read(&file, MAX_RECORDED)?;
            let values: Vec<f64> = wav.channel(0).map(|x| full_scale_m_s2 * x).collect();
            let spacing_mm = speed_mm_s / f64::from(wav.rate_hz);
            WaveformTable::new(&values, spacing_mm, crossfade_mm, acceleration(speed_mm_s))
                .map_err(|e| Diagnostic::new(e.to_string()).in_file(&file))
        }
    }
}

impl Node for Waveform {
    fn descriptor() -> Descriptor {
        gliding::descriptor(
            ("waveform", "A texture from a loop that is read by the distance travelled."),
            "which of `loops`, from 0; below 0 none sounds",
            (
                "loops",
                "Loops, each a text as behind `texture` in a scene; or a list of them, `[waveform(..), \
                 waveform(..)]`, whose sum is one entry.",
            ),
            effect(),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut tables = Made::default();
        let loops = each(setup, |settings| {
            let table = shared(&mut tables, settings.text_without("gain"), || table(settings))?;
            Ok(Gained { kernel: Reader::new(table), gain: settings.number("gain") })
        })?;
        gliding::prepare(setup, loops, ("tables", tables.len() as u64))
    }
}
