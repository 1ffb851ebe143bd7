//! Crossfade from the old source to the new one in 10 ms.

use asperity_node::{Buffer, time};

/// Length of a crossfade in seconds.
pub const CROSSFADE_S: f64 = 0.01;

/// Ticks of a crossfade: [`CROSSFADE_S`], rounded up to whole ticks.
pub(super) fn ticks(tick_hz: u32) -> u64 {
    ((CROSSFADE_S * f64::from(tick_hz)).ceil() as u64).max(1)
}

/// Progress of a crossfade.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    /// Its first tick, and the first after it.
    pub(crate) begun: u64,
    pub(crate) end: u64,
    pub(crate) tick: u64,
    pub(crate) tick_hz: u32,
}

/// One crossfade, by buffer.
#[derive(Debug)]
pub(crate) struct Crossfade {
    pub(super) old: Option<usize>,
    pub(super) new: usize,
    /// Buffer after both of them, or `None` for a crossfade written over `new`.
    pub(super) mix: Option<usize>,
    /// New node and input that read that buffer.
    pub(super) reader: Option<(usize, usize)>,
    /// Rate of audio; 0 for a control.
    pub(super) rate_hz: u32,
    /// Passes the new signal alone.
    pub(super) through: bool,
}

/// Smoothstep, which has no corner at either end. The two gains of a crossfade sum to 1.
fn smooth(part: f64) -> f64 {
    let g = part.clamp(0.0, 1.0);
    g * g * (3.0 - 2.0 * g)
}

impl Ramp {
    /// Gain of the new signal for a control in this tick; 1 in the last.
    fn gain(&self) -> f64 {
        let ticks = (self.end - self.begun).max(1) as f64;
        smooth((self.tick + 1).saturating_sub(self.begun) as f64 / ticks)
    }

    /// Gain of the new signal for every sample of this tick.
    fn gains(&self, rate_hz: u32) -> impl Iterator<Item = f32> + use<> {
        let first = |tick| time::first_sample(tick, rate_hz, self.tick_hz);
        let (begun, end, now) = (first(self.begun), first(self.end), first(self.tick));
        let step = 1.0 / end.saturating_sub(begun).max(1) as f64;
        let done = now.saturating_sub(begun);
        (1..).map(move |i: u64| smooth((done + i) as f64 * step) as f32)
    }
}

impl Crossfade {
    /// Runs this tick of the crossfade.
    pub(crate) fn run(&self, buffers: &mut [Buffer], mut ramp: Ramp) {
        if self.through {
            ramp.tick = ramp.end;
        }
        match self.mix {
            Some(at) => self.before_input(buffers, at, ramp),
            None => self.on_output(buffers, ramp),
        }
    }

    fn before_input(&self, buffers: &mut [Buffer], at: usize, ramp: Ramp) {
        let Some((sources, rest)) = buffers.split_at_mut_checked(at) else { return };
        let (Some(new), Some(mix)) = (sources.get(self.new), rest.first_mut()) else { return };
        let old = self.old.and_then(|i| sources.get(i));
        match (mix, old, new) {
            (
                Buffer::Control { values, changed, valid },
                Some(Buffer::Control { values: from, .. }),
                Buffer::Control { values: to, valid: trusted, .. },
            ) => {
                let gain = ramp.gain();
                (*changed, *valid) = (false, *trusted);
                for ((y, a), b) in values.iter_mut().zip(from).zip(to) {
                    let x = a * (1.0 - gain) + b * gain;
                    *changed |= *y != x;
                    *y = x;
                }
            }
            (
                Buffer::Audio { samples, len, valid, silent },
                old,
                Buffer::Audio { samples: to, len: to_len, valid: trusted, silent: to_silent },
            ) => {
                let (from, was_silent) = audio(old);
                (*len, *valid, *silent) = (*to_len, *trusted, was_silent && *to_silent);
                let pairs = from.zip(&to[..*to_len]).zip(ramp.gains(self.rate_hz));
                for (y, ((a, b), gain)) in samples.iter_mut().zip(pairs) {
                    *y = a * (1.0 - gain) + b * gain;
                }
            }
            _ => {}
        }
    }

    fn on_output(&self, buffers: &mut [Buffer], ramp: Ramp) {
        let at = self.old.unwrap_or(buffers.len());
        let Some((ours, rest)) = buffers.split_at_mut_checked(at) else { return };
        let Some(Buffer::Audio { samples, len, silent, .. }) = ours.get_mut(self.new) else { return };
        let (from, was_silent) = audio(rest.first());
        *silent &= was_silent;
        for ((y, a), gain) in samples[..*len].iter_mut().zip(from).zip(ramp.gains(self.rate_hz)) {
            *y = a * (1.0 - gain) + *y * gain;
        }
    }
}

/// Samples of the old source, and whether they are silent; silence if there is none.
fn audio(old: Option<&Buffer>) -> (impl Iterator<Item = f32>, bool) {
    let (samples, silent) = match old {
        Some(Buffer::Audio { samples, len, silent, .. }) => (&samples[..*len], *silent),
        _ => (&[][..], true),
    };
    (samples.iter().copied().chain(std::iter::repeat(0.0)), silent)
}
