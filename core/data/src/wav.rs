//! WAV files, in parts of full scale.

use std::io::{BufReader, Read};
use std::path::Path;

use asperity_diagnostics::{Diagnostic, file};
use hound::{SampleFormat, WavReader};

/// Largest WAV file in bytes: its header counts the bytes after its first 8 in 32 bits.
const MAX_BYTES: u64 = (1 << 32) + 8;

/// Samples of a WAV file of integers of 8 to 32 bits or of floats.
#[derive(Clone, Debug, PartialEq)]
pub struct Wav {
    /// Sampling rate of each channel in Hz.
    pub rate_hz: u32,
    /// Number of channels, at least 1.
    pub channels: usize,
    /// Whether its samples are floats.
    pub is_float: bool,
    /// Samples, channel by channel in turn; 1 is full scale.
    pub samples: Vec<f64>,
}

impl Wav {
    /// Reads a file with at most `most` samples a channel.
    ///
    /// # Errors
    /// A file that cannot be read or is not a WAV file; one without channels; one that is longer.
    pub fn read(path: &Path, most: u32) -> Result<Self, Diagnostic> {
        let file = file::open(path, MAX_BYTES)?;
        Self::parse(BufReader::new(file), most).map_err(|e| e.in_file(path))
    }

    /// Reads a file's bytes; see [`read`](Self::read).
    ///
    /// # Errors
    /// As [`read`](Self::read), with no file named.
    pub fn parse(bytes: impl Read, most: u32) -> Result<Self, Diagnostic> {
        let fail = |what: String| Diagnostic::new(what);
        let reader = WavReader::new(bytes).map_err(|e| fail(format!("not a WAV file: {e}")))?;
        let spec = reader.spec();
        if spec.channels == 0 || spec.bits_per_sample == 0 {
            return Err(fail("a WAV file without samples".into()));
        }
        if reader.duration() > most {
            let length = reader.duration();
            return Err(fail(format!("{length} samples are too long")).help(format!("at most {most}")));
        }
        let is_float = spec.sample_format == SampleFormat::Float;
        let samples: Result<Vec<f64>, hound::Error> = match spec.sample_format {
            SampleFormat::Float => reader.into_samples::<f32>().map(|s| s.map(f64::from)).collect(),
            SampleFormat::Int => {
                let full = 2f64.powi(i32::from(spec.bits_per_sample) - 1);
                reader.into_samples::<i32>().map(|s| s.map(|x| f64::from(x) / full)).collect()
            }
        };
        let samples = samples.map_err(|e| fail(format!("not a WAV file that can be read: {e}")))?;
        Ok(Self { rate_hz: spec.sample_rate, channels: usize::from(spec.channels), is_float, samples })
    }

    /// The samples of one channel, from 0. A channel that does not exist is empty.
    pub fn channel(&self, number: usize) -> impl Iterator<Item = f64> {
        let there = if number < self.channels { self.samples.get(number..) } else { None };
        there.unwrap_or_default().iter().step_by(self.channels.max(1)).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hound::{WavSpec, WavWriter};

    fn written(
        spec: WavSpec,
        write: impl FnOnce(&mut WavWriter<std::io::BufWriter<std::fs::File>>),
    ) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let mut writer = WavWriter::create(dir.path().join("a.wav"), spec).unwrap();
        write(&mut writer);
        writer.finalize().unwrap();
        dir
    }

    #[test]
    fn integers_and_floats_are_scaled_and_channels_separated() {
        let spec =
            WavSpec { channels: 2, sample_rate: 8000, bits_per_sample: 16, sample_format: SampleFormat::Int };
        let dir = written(spec, |w| {
            [16_384_i16, -32_768, 0, 8192].iter().for_each(|x| w.write_sample(*x).unwrap())
        });
        let wav = Wav::read(&dir.path().join("a.wav"), 2).unwrap();
        assert_eq!((wav.rate_hz, wav.channels, wav.is_float), (8000, 2, false));
        assert_eq!(wav.channel(0).collect::<Vec<_>>(), [0.5, 0.0]);
        assert_eq!(wav.channel(1).collect::<Vec<_>>(), [-1.0, 0.25]);
        assert_eq!(wav.channel(2).count(), 0);
        let spec = WavSpec {
            channels: 1,
            sample_rate: 48_000,
            bits_per_sample: 32,
            sample_format: SampleFormat::Float,
        };
        let dir = written(spec, |w| [0.5_f32, -1.5].iter().for_each(|x| w.write_sample(*x).unwrap()));
        assert_eq!(Wav::read(&dir.path().join("a.wav"), 9).unwrap().samples, [0.5, -1.5]);
        let e = Wav::read(&dir.path().join("a.wav"), 1).unwrap_err().to_string();
        assert!(e.contains("a.wav: 2 samples are too long (at most 1)"), "{e}");
    }

    #[test]
    fn what_is_no_recording_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.wav");
        let error = || Wav::read(&path, 9).unwrap_err().to_string();
        assert!(error().contains("a.wav: cannot read this file: No such file"), "{}", error());
        for no_wav in [&b"RIFF....WAVE"[..], b"OggS and more of that", b""] {
            std::fs::write(&path, no_wav).unwrap();
            assert!(error().contains("a.wav: not a WAV file"), "{}", error());
        }
    }
}
