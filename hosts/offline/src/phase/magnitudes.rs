//! Files of magnitudes. An archive (`.npz`) states its convention; an array (`.npy`) does not.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use asperity_accuracy::npy::{self, Archive, Array};
use asperity_diagnostics::{Diagnostic, one_of};

use super::frames::{FRAME_HZ, Frames, Scale, check_rate};

/// A line of Python that writes an archive with everything that is needed.
const SAVE: &str = "np.savez(\"m.npz\", magnitudes=S, rate=2500, hop=5, window=\"hann\", window_length=250, \
                    scale=\"dft\")";
/// The scales in words.
const SCALES: &str = "`--scale dft`: |sum w x|, as numpy.abs(numpy.fft.rfft(w * x)); `--scale amplitude`: \
                      2 |sum w x| / sum w, as in a graph and its probes";

impl fmt::Display for Scale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Dft => "dft",
            Self::Amplitude => "amplitude",
        })
    }
}

impl FromStr for Scale {
    type Err = Diagnostic;

    fn from_str(text: &str) -> Result<Self, Diagnostic> {
        match text {
            "dft" => Ok(Self::Dft),
            "amplitude" => Ok(Self::Amplitude),
            _ => Err(Diagnostic::new(format!("there is no scale `{text}`"))
                .help(one_of(text, ["dft", "amplitude"]))),
        }
    }
}

impl Frames {
    /// Reads a `.npz` or `.npy` file of `magnitudes` \[frames, bins\], bin 0 first: of 0.1 s under a Hann
    /// window, 2 ms apart. Bad values become 0; answers their number.
    ///
    /// A `.npz` file has `rate` \[Hz\], `hop` and `window_length` \[samples\], `window` and `scale`. A `.npy`
    /// file has none of them: its rate and scale are arguments.
    ///
    /// # Errors
    /// A file that cannot be read; another window or hop; a convention that is not stated, or stated twice
    /// and differently.
    pub fn read(path: &Path, rate_hz: Option<u32>, scale: Option<Scale>) -> Result<(Self, u64), Diagnostic> {
        let is_archive = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz"));
        let found = if is_archive {
            Archive::read(path).and_then(|archive| Self::of_archive(&archive, rate_hz, scale))
        } else {
            npy::read(path).and_then(|array| Self::of_array(array, rate_hz, scale))
        };
        found.map_err(|e| if e.path().is_some() { e } else { e.in_file(path) })
    }

    fn of_array(array: Array, rate_hz: Option<u32>, scale: Option<Scale>) -> Result<(Self, u64), Diagnostic> {
        let stated = |what: &str, help: &str| {
            Diagnostic::new(format!("a .npy file does not state {what} of its magnitudes")).help(help)
        };
        let rate_hz = rate_hz.ok_or_else(|| stated("the sample rate", "`--rate HZ`, or a .npz file"))?;
        let scale = scale.ok_or_else(|| stated("the scale", SCALES))?;
        let &[_, bins] = array.shape.as_slice() else {
            return Err(Diagnostic::new(format!("an array of shape {:?} does not fit", array.shape))
                .help("two dimensions: [frames, bins]"));
        };
        Self::new(array.values.into_f32(), bins, rate_hz, scale)
    }

    /// The magnitudes of an archive; see [`read`](Self::read).
    pub(crate) fn of_archive(
        archive: &Archive,
        rate_hz: Option<u32>,
        scale: Option<Scale>,
    ) -> Result<(Self, u64), Diagnostic> {
        let missing = |name: &str| Diagnostic::new(format!("this archive has no `{name}`")).help(SAVE);
        let number = |name: &str| archive.number(name)?.ok_or_else(|| missing(name));
        let text = |name: &str| archive.text(name)?.ok_or_else(|| missing(name));
        let array = archive.array("magnitudes")?.ok_or_else(|| missing("magnitudes"))?;
        let rate = number("rate")?;
        let own_hz = Some(rate as u32).filter(|own| f64::from(*own) == rate);
        let own_hz =
            own_hz.ok_or_else(|| Diagnostic::new(format!("its `rate` of {rate} Hz is no whole number")))?;
        check_rate(&format!("its `rate` of {own_hz} Hz"), own_hz)?;
        if let Some(other) = rate_hz.filter(|hz| *hz != own_hz) {
            return Err(Diagnostic::new(format!("its `rate` is {own_hz} Hz, not {other}"))
                .help("leave `--rate` out: the file states it"));
        }
        let own: Scale = text("scale")?.parse()?;
        if let Some(other) = scale.filter(|scale| *scale != own) {
            return Err(Diagnostic::new(format!("its `scale` is {own}, not {other}"))
                .help("leave `--scale` out: the file states it"));
        }
        let is = |name: &str, wanted: f64, what: &str| {
            let found = number(name)?;
            if (found - wanted).abs() < 1e-6 * wanted {
                return Ok(());
            }
            Err(Diagnostic::new(format!("its `{name}` is {found} samples"))
                .help(format!("{what}: {wanted} samples at {own_hz} Hz")))
        };
        is("hop", f64::from(own_hz) / f64::from(FRAME_HZ), "frames are 2 ms apart")?;
        is("window_length", f64::from(own_hz / 10), "a window is 0.1 s long")?;
        let window = text("window")?;
        if window != "hann" {
            return Err(Diagnostic::new(format!("its `window` is `{window}`"))
                .help("`hann`: the periodic window, 0.5 - 0.5 cos(2 pi n / length)"));
        }
        Self::of_array(array.clone(), Some(own_hz), Some(own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_accuracy::npy::{Entry, Values};

    fn archive() -> Archive {
        let array = Array { shape: vec![2, 2], values: Values::F32(vec![1.0, 2.0, 3.0, 4.0]) };
        let text = |text: &str| Entry::Text(text.to_owned());
        let entries = [
            ("magnitudes", Entry::Array(array)),
            ("rate", Entry::Number(2500.0)),
            ("hop", Entry::Number(5.0)),
            ("window_length", Entry::Number(250.0)),
            ("window", text("hann")),
            ("scale", text("amplitude")),
        ];
        Archive(entries.map(|(name, entry)| (name.to_owned(), entry)).into())
    }

    fn changed(name: &str, entry: Option<Entry>) -> String {
        let mut archive = archive();
        archive.0.remove(name);
        archive.0.extend(entry.map(|entry| (name.to_owned(), entry)));
        let refused = Frames::of_archive(&archive, None, None).err().expect(name);
        format!("{} | {}", refused.message, refused.help.unwrap_or_default())
    }

    #[test]
    fn archive_states_its_scale() {
        let amplitudes = |archive: &Archive| {
            Frames::of_archive(archive, None, None).expect("frames").0.amplitudes().to_vec()
        };
        assert_eq!(amplitudes(&archive()), [1.0, 2.0, 3.0, 4.0]);
        let mut unscaled = archive();
        unscaled.0.insert("scale".into(), Entry::Text("dft".into()));
        assert_eq!(amplitudes(&unscaled), [1.0, 2.0, 3.0, 4.0].map(|x: f32| x * (4.0 / 250.0)));
    }

    #[test]
    fn archive_without_its_whole_convention_is_refused() {
        for name in ["magnitudes", "rate", "hop", "window_length", "window", "scale"] {
            let told = changed(name, None);
            assert!(told.contains(&format!("no `{name}`")) && told.contains("np.savez"), "{told}");
        }
        let text = |text: &str| Some(Entry::Text(text.to_owned()));
        for (name, entry, wanted) in [
            ("rate", Some(Entry::Number(2501.0)), "multiple of 10"),
            ("rate", Some(Entry::Number(2500.5)), "whole number"),
            ("rate", Some(Entry::Number(f64::NAN)), "whole number"),
            ("rate", text("2500"), "not a number"),
            ("hop", Some(Entry::Number(128.0)), "2 ms apart: 5 samples"),
            ("hop", Some(Entry::Number(f64::NAN)), "2 ms apart: 5 samples"),
            ("window_length", Some(Entry::Number(512.0)), "250 samples at 2500 Hz"),
            ("window", text("hamming"), "periodic window"),
            ("scale", text("db"), "no scale `db`"),
        ] {
            let told = changed(name, entry);
            assert!(told.contains(wanted), "{name}: {told}");
        }
    }

    #[test]
    fn arguments_may_not_contradict_an_archive() {
        let refused = |hz, scale| Frames::of_archive(&archive(), hz, scale).err().expect("an error").message;
        assert_eq!(refused(Some(48_000), None), "its `rate` is 2500 Hz, not 48000");
        assert_eq!(refused(None, Some(Scale::Dft)), "its `scale` is amplitude, not dft");
        assert!(Frames::of_archive(&archive(), Some(2500), Some(Scale::Amplitude)).is_ok());
    }
}
