//! `waveform`: a texture that is read by the distance travelled.

mod table;

use crate::prelude::*;
use asperity_diagnostics::ron::Value;

use super::gliding;
use super::{Made, Samples, each, gain, made, samples, shared};
pub(crate) use table::close;
pub(super) use table::{Reader, WaveformQuantity, WaveformTable};

/// A loop, drawn or recorded, that is read by distance: faster motion reads faster.
///
/// A slot that comes on begins at its loop's beginning; the path goes on.
pub struct Waveform;

fn effect() -> Effect {
    let example = "waveform(segments: [(0, 0), (0.5, 1), (1, 0)], reference_speed_mm_s: 100)";
    Effect::new("loops", Acts::Gliding)
        .form(
            Form::new("", example)
                .nested("segments")
                .nested("recording")
                .field(number("spacing_mm", 0.05, 1e-4..=100.0, "mm"))
                .doc("distance between the samples of a loop that is made of segments")
                .field(number("crossfade_mm", 0.0, 0.0..=1e5, "mm"))
                .doc("length over which the loop's end crossfades into its start")
                .field(
                    choice("quantity", &["acceleration", "height"]).doc("quantity that `segments` describe"),
                )
                .field(number("reference_speed_mm_s", 100.0, 0.1..=5000.0, "mm/s"))
                .doc("speed at which the loop plays with the amplitude as drawn")
                .field(
                    number("speed_exponent", 1.0, 0.0..=2.0, "")
                        .doc("exponent of the speed in the amplitude"),
                )
                .field(gain()),
        )
        .check(|settings| table(settings, false).map(drop))
}

fn segment(pair: &Value) -> Result<(f64, f64), Diagnostic> {
    match pair.list()? {
        [distance, height] => Ok((distance.f64_in(-1e6..=1e6, "")?, height.f64_in(-1e6..=1e6, "")?)),
        other => Err(pair.error(format!("expected 2 numbers, found {}", other.len()))),
    }
}

/// The loop of a slot, ready to be read. A recording is read from its file; `None` where files are not to be
/// opened.
fn table(settings: &Settings, opens: bool) -> Result<Option<WaveformTable>, Diagnostic> {
    let (spacing_mm, crossfade_mm) = (settings.number("spacing_mm"), settings.number("crossfade_mm"));
    let acceleration = |reference_speed_mm_s| WaveformQuantity::Acceleration {
        reference_speed_mm_s,
        speed_exponent: settings.number("speed_exponent"),
    };
    match samples(settings, ("a waveform", "segments", "[(0, 0), (0.5, 1), (1, 0)]"), (5000.0, false))? {
        Samples::Listed(pairs) => {
            let segments = pairs.iter().map(segment).collect::<Result<Vec<_>, _>>()?;
            let quantity = match settings.text("quantity") {
                "height" => WaveformQuantity::Height,
                _ => acceleration(settings.number("reference_speed_mm_s")),
            };
            let table = WaveformTable::from_segments(&segments, spacing_mm, crossfade_mm, quantity);
            made(settings, table).map(Some)
        }
        Samples::Recorded(recorded) => {
            let not_of_recordings = ["spacing_mm", "quantity", "reference_speed_mm_s"];
            if let Some(name) = not_of_recordings.into_iter().find(|name| settings.is_set(name)) {
                let message = format!("`{name}` is for `segments`, not for a recording");
                return Err(settings.error(name, message));
            }
            if !opens {
                return Ok(None);
            }
            let (rate_hz, values) = recorded.read()?;
            let (spacing_mm, quantity) = (recorded.speed_mm_s / rate_hz, acceleration(recorded.speed_mm_s));
            WaveformTable::new(&values, spacing_mm, crossfade_mm, quantity)
                .map(Some)
                .map_err(|e| Diagnostic::new(e).in_file(&recorded.file))
        }
    }
}

impl Node for Waveform {
    fn descriptor() -> Descriptor {
        gliding::descriptor(
            ("waveform", "Renders a texture from a loop that is read by distance travelled."),
            "index into `loops`, from 0; below 0: silent",
            effect(),
        )
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let mut tables = Made::default();
        let loops = each(setup, |settings| {
            let read = || table(settings, true)?.ok_or_else(|| settings.node_error("a loop without values"));
            let table = shared(&mut tables, settings.text_without("gain"), read)?;
            Ok(Reader::new(table, settings.number("gain")))
        })?;
        gliding::prepare(setup, loops, ("tables", tables.len() as u64))
    }
}
