//! Methods that need all frames at once, as references: Griffin-Lim and its fast variant.

use std::str::FromStr;

use asperity_diagnostics::{Diagnostic, one_of};
use asperity_dsp::Framing;
use asperity_dsp::griffin_lim::{Options, Start, griffin_lim};

use super::Frames;
use super::method::OPTION;
use crate::failure::Failure;

/// Their names.
pub const OFFLINE: [&str; 2] = ["griffin_lim", "fast_griffin_lim"];

/// Settings of both; the first method has no `alpha`.
const SETTINGS: [&str; 3] = ["iterations", "seed", "alpha"];
/// Most iterations.
const MAX_ITERATIONS: usize = 100_000;

/// Griffin-Lim or its fast variant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offline {
    options: Options,
    /// Its own seed, if one was set.
    seed: Option<u64>,
}

impl Offline {
    /// Parses `param=value,...` of a method; `None` if the name is no offline method.
    ///
    /// # Errors
    /// The method does not have the setting, or the value is out of range.
    pub fn parse(name: &str, settings: &str) -> Option<Result<Self, Diagnostic>> {
        let fast = match name {
            "griffin_lim" => false,
            "fast_griffin_lim" => true,
            _ => return None,
        };
        let options =
            Options { alpha: if fast { Options::default().alpha } else { 0.0 }, ..Options::default() };
        let mut it = Self { options, seed: None };
        let mut parts = settings.split(',').map(str::trim).filter(|s| !s.is_empty());
        Some(parts.try_for_each(|s| it.set(name, s, fast)).map(|()| it))
    }

    fn set(&mut self, name: &str, setting: &str, fast: bool) -> Result<(), Diagnostic> {
        let fail = |what: String, help: String| Diagnostic::new(what).in_file(OPTION).help(help);
        let known = if fast { &SETTINGS[..] } else { &SETTINGS[..2] };
        let Some((key, value)) = setting.split_once('=') else {
            return Err(fail(format!("there is no `=` in `{setting}`"), format!("{name}:iterations=100")));
        };
        let (key, value) = (key.trim(), value.trim());
        match key {
            "iterations" => self.options.iterations = number(value, 1..=MAX_ITERATIONS, key)?,
            "seed" => self.seed = Some(number(value, 0..=u64::MAX, key)?),
            "alpha" if fast => self.options.alpha = number(value, 0.0..=1.0, key)?,
            _ => {
                return Err(fail(
                    format!("`{name}` has no parameter `{key}`"),
                    one_of(key, known.iter().copied()),
                ));
            }
        }
        Ok(())
    }

    /// The signal of these frames.
    ///
    /// # Errors
    /// None for frames that were read.
    pub fn signal(&self, frames: &Frames, seed: u64) -> Result<Vec<f32>, Failure> {
        let l = frames.layout();
        let framing = Framing {
            rate_hz: l.rate_hz,
            fft_len: l.length as usize,
            bins: l.bins as usize,
            frame_num: l.frame_rate.num(),
            frame_den: l.frame_rate.den(),
        };
        let options = Options { start: Start::Random(self.seed.unwrap_or(seed)), ..self.options };
        let found = griffin_lim(frames.amplitudes(), framing, options, |_| {});
        Ok(found.map_err(|e| Failure::Machine(e.to_string()))?.signal)
    }
}

fn number<T: FromStr + PartialOrd + std::fmt::Debug>(
    text: &str,
    range: std::ops::RangeInclusive<T>,
    name: &str,
) -> Result<T, Diagnostic> {
    let (least, most) = (range.start(), range.end());
    text.parse().ok().filter(|x| range.contains(x)).ok_or_else(|| {
        Diagnostic::new(format!("`{name}` cannot be `{text}`"))
            .in_file(OPTION)
            .help(format!("a number from {least:?} to {most:?}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_parsed_and_wrong_ones_refused() {
        let parse = |name: &str, settings: &str| Offline::parse(name, settings).unwrap();
        assert_eq!(parse("griffin_lim", "").unwrap().options.alpha, 0.0);
        let it = parse("fast_griffin_lim", "iterations=7, alpha=0.5,seed=3").unwrap();
        assert_eq!((it.options.iterations, it.options.alpha, it.seed), (7, 0.5, Some(3)));
        assert!(Offline::parse("spsi", "").is_none());
        for (name, settings) in [
            ("griffin_lim", "alpha=0.5"),
            ("griffin_lim", "iterations=0"),
            ("fast_griffin_lim", "alpha=NaN"),
            ("fast_griffin_lim", "alpha=2"),
            ("fast_griffin_lim", "iterations"),
            ("fast_griffin_lim", "iteration=5"),
        ] {
            assert!(parse(name, settings).is_err(), "{name}:{settings}");
        }
    }
}
