//! Signals for any type of port: each is a function of a seed and the tick.

use asperity_node::{Buffer, Complex, FrameClock, PortType, Shape, random, time};

/// A signal at an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// Uniform in -1 to 1; magnitudes 0 to 1.
    Random,
    /// Zeros that are not marked as silent.
    Zero,
    /// Denormal numbers of f64 and of f32.
    Denormal,
    /// Up to 1e6.
    Huge,
    /// Frames up to 1e30, other signals up to 1e6.
    Enormous,
    /// -2, -1, 0, 1 and 2, held for 37 values each.
    Steps,
    /// NaN, infinities and negative magnitudes among random numbers.
    Bad,
    /// Noise at random levels from 1e-9 to 1e4, with silences of random length and frames that do not come.
    Scattered,
}

impl Signal {
    /// Its name in texts.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Signal::Random => "random",
            Signal::Zero => "zero",
            Signal::Denormal => "denormal",
            Signal::Huge => "huge",
            Signal::Enormous => "enormous",
            Signal::Steps => "step",
            Signal::Bad => "NaN and infinite",
            Signal::Scattered => "scattered",
        }
    }
}

/// A signal on its way into an input.
#[derive(Clone, Debug)]
pub(crate) struct Feed {
    pub(crate) signal: Signal,
    seed: u64,
    port: PortType,
    clock: Option<FrameClock>,
}

/// Ticks of a block of [`Signal::Scattered`], which has one silence.
const BLOCK: u64 = 64;

impl Feed {
    /// A signal for a port of a node that runs every `every`-th tick.
    pub(crate) fn new(signal: Signal, seed: u64, port: &PortType, tick_hz: u32, every: u32) -> Self {
        let clock = match port.shape {
            Shape::Magnitude(l) | Shape::Spectrum(l) => Some(FrameClock::new(tick_hz, every, l.frame_rate)),
            Shape::Control { .. } | Shape::Audio { .. } => None,
        };
        Self { signal, seed, port: port.clone(), clock }
    }

    /// Whether the signal is silent in this tick.
    fn is_silent(&self, tick: u64) -> bool {
        if self.signal != Signal::Scattered {
            return false;
        }
        let draw = |what: u64| random::uniform(self.seed ^ 0x5173, 8 * (tick / BLOCK) + what);
        let (start, len) = ((draw(0) * BLOCK as f64) as u64, (draw(1) * BLOCK as f64) as u64);
        draw(2) < 0.2 || (tick % BLOCK).wrapping_sub(start) < len
    }

    /// Level of a tick.
    fn level(&self, tick: u64) -> f64 {
        match self.signal {
            Signal::Scattered => 10_f64.powf(13.0 * random::uniform(self.seed ^ 0x1e7e, tick / 16) - 9.0),
            Signal::Enormous if self.clock.is_some() => 1e30,
            Signal::Huge | Signal::Enormous => 1e6,
            _ => 1.0,
        }
    }

    fn value(&self, index: u64) -> f64 {
        let noise = 2.0 * random::uniform(self.seed, index) - 1.0;
        match self.signal {
            Signal::Zero => 0.0,
            Signal::Denormal => 1e-310 * noise + f64::from(f32::MIN_POSITIVE) * 0.3 * noise,
            Signal::Steps => noise.signum() * ((index / 37) % 3) as f64,
            Signal::Bad => match random::bits(self.seed ^ 0xbad, index) % 8 {
                0 => f64::NAN,
                1 => f64::INFINITY,
                2 => f64::NEG_INFINITY,
                _ => noise,
            },
            _ => noise,
        }
    }

    /// A magnitude: negative only in a bad signal.
    fn magnitude(&self, index: u64) -> f64 {
        let x = self.value(index);
        if self.signal == Signal::Bad { x } else { x.abs() }
    }

    /// Fills a buffer for a tick: silent where `muted`.
    pub(crate) fn fill(&self, buffer: &mut Buffer, tick: u64, tick_hz: u32, muted: bool) {
        let quiet = muted || self.is_silent(tick);
        let level = self.level(tick);
        match buffer {
            Buffer::Control { values, changed, valid } => {
                (*changed, *valid) = (false, true);
                if quiet {
                    return;
                }
                for (i, x) in values.iter_mut().enumerate() {
                    let new = level * self.value(tick * 100 + i as u64);
                    *changed |= new.to_bits() != x.to_bits();
                    *x = new;
                }
            }
            Buffer::Audio { samples, len, valid, silent } => {
                let Shape::Audio { rate_hz } = self.port.shape else { return };
                let span = time::samples(tick, rate_hz, tick_hz);
                *len = ((span.end - span.start) as usize).min(samples.len());
                (*valid, *silent) = (true, quiet);
                samples.fill(0.0);
                if !quiet {
                    let now = samples.iter_mut().zip(span);
                    now.for_each(|(x, n)| *x = (level * self.value(n)) as f32);
                }
            }
            Buffer::Magnitude { bins, frame, valid } => {
                (*frame, *valid) = (self.frame(tick).filter(|_| !quiet), true);
                let Some((n, _)) = *frame else { return };
                for (i, x) in bins.iter_mut().enumerate() {
                    *x = (level * self.magnitude(n * 10_000 + i as u64)) as f32;
                }
            }
            Buffer::Spectrum { bins, frame, valid } => {
                (*frame, *valid) = (self.frame(tick).filter(|_| !quiet), true);
                let Some((n, _)) = *frame else { return };
                for (i, z) in bins.iter_mut().enumerate() {
                    let i = n * 10_000 + 2 * i as u64;
                    *z = Complex::new((level * self.value(i)) as f32, (level * self.value(i + 1)) as f32);
                }
            }
        }
    }

    /// Number and first sample of the frame of a tick. A fourth of the scattered frames does not come.
    fn frame(&self, tick: u64) -> Option<(u64, u64)> {
        let frame = self.clock.as_ref()?.frame(tick)?;
        let lost =
            self.signal == Signal::Scattered && random::bits(self.seed ^ 0x105e, frame).is_multiple_of(4);
        match self.port.shape {
            Shape::Magnitude(l) | Shape::Spectrum(l) if !lost => {
                Some((frame, l.frame_rate.first_sample(frame, l.rate_hz)))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use asperity_node::Unit;

    #[test]
    fn scattered_signal_has_long_silences() {
        let port = PortType { shape: Shape::Audio { rate_hz: 48_000 }, unit: Unit::NONE, limited: false };
        let feed = Feed::new(Signal::Scattered, 3, &port, 500, 1);
        let mut buffer = Buffer::new(&port, 500);
        let (mut quiet, mut longest, mut now) = (0, 0, 0);
        for tick in 0..10_000 {
            feed.fill(&mut buffer, tick, 500, false);
            now = if buffer.is_silent() { now + 1 } else { 0 };
            quiet += u64::from(buffer.is_silent());
            longest = longest.max(now);
        }
        assert!((2000..8000).contains(&quiet) && longest > 64, "{quiet} {longest}");
    }
}
