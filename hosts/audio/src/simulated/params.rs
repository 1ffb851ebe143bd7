//! Parameters of a simulated device, also as text.

use std::str::FromStr;

use crate::Format;

/// Valid speeds, beside 0.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

/// Parameters of a simulated device. As text, missing ones are as in [`Params::default`]:
/// `frames=64+1+1024,rate=48000,channels=4,inputs=1,format=i16,loopback=1,latency=128,speed=1`. Words that
/// begin with `plant` go to the maker of plants ([`set_plants`](super::set_plants)).
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    /// Frames of its calls, in turn. Empty: as requested.
    pub frames: Vec<u32>,
    /// Its only rate [Hz]; `None`: 44100, 48000 and 96000.
    pub rate_hz: Option<u32>,
    /// Output channels, 1 to 64.
    pub channels: u16,
    /// Input channels, 0 to 64.
    pub inputs: u16,
    /// Its only format; `None`: `f32`, `i32`, `i24` and `i16`.
    pub format: Option<Format>,
    /// Whether each input channel hears the output channel of its number.
    pub loopback: bool,
    /// Frames from the call to the sound, also between output and input of a loopback.
    pub latency_frames: u32,
    /// Speed of its calls relative to real time, 0.01 to 1000. With 0, which a text cannot open, only
    /// [`Simulated::step`](super::Simulated::step) calls it.
    pub speed: f64,
    /// Whether to keep everything played for [`Simulated::played`](super::Simulated::played).
    pub keep: bool,
    /// Words of the plant between the first output and the first input; empty for none.
    pub plant: Vec<(String, String)>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            frames: Vec::new(),
            rate_hz: None,
            channels: 2,
            inputs: 2,
            format: None,
            loopback: false,
            latency_frames: 0,
            speed: 1.0,
            keep: false,
            plant: Vec::new(),
        }
    }
}

impl Params {
    pub(super) fn rates(&self) -> Vec<u32> {
        self.rate_hz.map_or_else(|| crate::RATES_HZ.to_vec(), |rate| vec![rate])
    }

    pub(super) fn formats(&self) -> Vec<Format> {
        let usual = || vec![Format::F32, Format::I32, Format::I24, Format::I16];
        self.format.map_or_else(usual, |format| vec![format])
    }

    /// Checks the values; the error names the valid ones.
    pub(super) fn check(&self) -> Result<(), String> {
        let wrong = if !(1..=64).contains(&self.channels) {
            "`channels` must be 1 to 64"
        } else if self.inputs > 64 {
            "`inputs` must be 0 to 64"
        } else if self.frames.contains(&0) || self.frames.iter().any(|&frames| frames > 1 << 20) {
            "`frames` must be 1 to 1048576"
        } else if self.rate_hz.is_some_and(|rate| !(1000..=1_000_000).contains(&rate)) {
            "`rate` must be 1000 to 1000000"
        } else if self.latency_frames > 1 << 20 {
            "`latency` must be 0 to 1048576"
        } else if self.speed != 0.0 && !SPEEDS.contains(&self.speed) {
            "`speed` must be 0.01 to 1000"
        } else {
            return Ok(());
        };
        Err(wrong.to_owned())
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), String> {
        fn number<T: FromStr>(key: &str, value: &str) -> Result<T, String> {
            value.parse().map_err(|_| format!("`{key}={value}`: a number is wanted"))
        }
        match key {
            "frames" => {
                self.frames = value.split('+').map(|one| number(key, one)).collect::<Result<_, _>>()?;
            }
            "rate" => self.rate_hz = Some(number(key, value)?),
            "channels" => self.channels = number(key, value)?,
            "inputs" => self.inputs = number(key, value)?,
            "format" => self.format = Some(value.parse()?),
            "loopback" => self.loopback = number::<u8>(key, value)? != 0,
            "latency" => self.latency_frames = number(key, value)?,
            "speed" => self.speed = number(key, value)?,
            _ if key == "plant" || key.starts_with("plant_") => {
                self.plant.push((key.to_owned(), value.to_owned()));
            }
            _ => {
                return Err(format!(
                    "a simulated device has no `{key}`; it has frames, rate, channels, inputs, format, \
                     loopback, latency, speed and plant"
                ));
            }
        }
        Ok(())
    }
}

impl FromStr for Params {
    type Err = String;

    /// Reads `key=value,key=value`; the error says which keys there are.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut params = Self::default();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) =
                part.split_once('=').ok_or_else(|| format!("`{part}`: `key=value` is wanted"))?;
            params.set(key.trim(), value.trim())?;
        }
        params.check()?;
        Ok(params)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn device_is_made_by_its_text() {
        let params: Params = "frames=64+1+1024,rate=44100,channels=4,format=i24,speed=0".parse().unwrap();
        assert_eq!(params.frames, [64, 1, 1024]);
        assert_eq!((params.rate_hz, params.channels, params.format), (Some(44_100), 4, Some(Format::I24)));
        assert_eq!("".parse(), Ok(Params::default()));
    }

    #[test]
    fn plant_words_are_kept() {
        let params: Params = "plant=coil,frames=64,plant_handle_g=60".parse().unwrap();
        let words = [("plant", "coil"), ("plant_handle_g", "60")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        assert_eq!((params.plant.as_slice(), params.frames), (&words[..], vec![64]));
    }

    #[test]
    fn invalid_parameter_error_names_valid_values() {
        for (text, says) in [
            ("frames=0", "1 to"),
            ("channels=0", "1 to 64"),
            ("colour=red", "frames, rate"),
            ("rate", "key=value"),
            ("format=i25", "i24"),
            ("speed=NaN", "speed"),
            ("channels=two", "number"),
        ] {
            let error = text.parse::<Params>().unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
