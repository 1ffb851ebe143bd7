//! A stroke from a WAV file and the file that names its channels.

use std::path::Path;

use crate::wav::Wav;
use asperity_diagnostics::ron;
use asperity_diagnostics::{Diagnostic, Source, one_of};

use super::channels::{self, Channels, NONE, QUANTITIES, TIME};
use super::stroke::Stroke;

/// Largest value of a full file, in any unit.
const MAX_FULL_SCALE: f64 = 1e6;

/// A channel: the number of its quantity, unless it is left out, and the value at which the file is full.
type Channel = (Option<usize>, f64);

/// Reads a WAV file; its channels are named in `names`.
pub(super) fn read(path: &Path, names: &Path) -> Result<Stroke, Diagnostic> {
    let fail = |what: String| Diagnostic::new(what).in_file(path);
    if !names.is_file() {
        return Err(fail("nothing says what the channels of this file are".into())
            .help(format!("write {} with `Recording(channels: [...])`", names.display())));
    }
    let source = Source::read(names)?;
    let listed = names_of(&source)?;
    let wav = Wav::read(path, u32::MAX)?;
    let rate_hz = channels::rate(f64::from(wav.rate_hz)).map_err(|e| e.in_file(path))?;
    if wav.channels != listed.len() {
        return Err(fail(format!("{} channels, and {} are named", wav.channels, listed.len()))
            .help(format!("{} names all, those to be left out as `{NONE}`", names.display())));
    }
    let mut read: Channels = std::array::from_fn(|_| None);
    for (number, &(quantity, full_scale)) in listed.iter().enumerate() {
        let Some(quantity) = quantity else { continue };
        let channel: Vec<f64> = wav.channel(number).map(|x| x * full_scale).collect();
        let channels::Quantity { name, range: (least, greatest), unit } = &QUANTITIES[quantity];
        if let Some((i, x)) = channel.iter().enumerate().find(|(_, x)| !(*least..=*greatest).contains(*x)) {
            return Err(fail(format!("`{name}` is {x} at {} s", i as f64 / rate_hz))
                .help(format!("`{name}` is a number from {least} to {greatest} {unit}")));
        }
        read[quantity] = Some(channel);
    }
    channels::stroke(read, rate_hz).map_err(|e| e.in_file(path))
}

fn names_of(source: &std::sync::Arc<Source>) -> Result<Vec<Channel>, Diagnostic> {
    let whole = ron::parse(source)?;
    let mut record = whole.record("Recording")?;
    let list = record.required("channels")?;
    record.finish(&["channels"])?;
    let mut named: Vec<Channel> = Vec::new();
    for entry in list.list()? {
        let mut channel = entry.record("Channel")?;
        let value = channel.required("quantity")?;
        let full_scale = channel.optional("full_scale");
        channel.finish(&["quantity", "full_scale"])?;
        let name = value.text()?;
        let known = || QUANTITIES.iter().skip(TIME + 1).map(|q| q.name).chain([NONE]);
        let quantity = match channels::quantity(name).filter(|q| *q != TIME) {
            None if name == NONE => None,
            None => {
                return Err(value
                    .error(format!("unknown quantity `{name}`"))
                    .help(one_of(name, known().collect::<Vec<_>>())));
            }
            some => some,
        };
        if quantity.is_some() && named.iter().any(|(q, _)| *q == quantity) {
            return Err(value.error(format!("`{name}` is there twice")));
        }
        let full_scale = match (full_scale, quantity) {
            (Some(value), _) => value.f64_in(1e-6..=MAX_FULL_SCALE, "")?,
            (None, None) => 1.0,
            (None, Some(_)) => {
                return Err(entry
                    .error("the field `full_scale` is missing")
                    .help("the value in the quantity's unit at which the file is full"));
            }
        };
        named.push((quantity, full_scale));
    }
    channels::check(|i| named.iter().any(|(q, _)| *q == Some(i))).map_err(|e| e.at(source, list.span()))?;
    Ok(named)
}
