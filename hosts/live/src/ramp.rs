//! Envelope behind the graph's sinks: starts, stops and breaks without a click. It only lowers the signal.

use std::f64::consts::PI;

/// Time from silence to full at the start [s].
pub const START_S: f64 = 2.0;
/// Time from full to silence at a stop, mute or panic [s].
pub const DOWN_S: f64 = 0.015;
/// Time from silence to full after a mute [s].
pub const UNMUTE_S: f64 = 0.2;
/// Time from the last sample to silence when samples run out [s].
pub const STARVED_S: f64 = 0.005;
/// Time from silence to full when samples come again [s].
pub const FED_S: f64 = 0.01;

/// State of the envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Silent, and staying so.
    Silent,
    /// Rising.
    Rising,
    /// Full: samples pass unchanged, bit for bit.
    Full,
    /// Falling.
    Falling,
}

/// Raised cosine: 0 at 0, 1 at 1, level at both ends.
fn raised(u: f64) -> f64 {
    0.5 - 0.5 * (PI * u).cos()
}

/// Clamps to 0 and 1, and snaps to them within 1e-9, so that n steps of 1 / n arrive.
fn settled(u: f64) -> f64 {
    if u < 1e-9 {
        0.0
    } else if u > 1.0 - 1e-9 {
        1.0
    } else {
        u
    }
}

/// Envelope over interleaved samples.
///
/// Two gains, each a raised cosine of a position that moves by a fixed step a frame: one for start, mute
/// and stop, one for breaks in the stream. A reversed ramp goes back from where it is. Across a break, the
/// last frame decays while the next ones rise; the two weights never add up to more than 1.
#[derive(Clone, Debug)]
pub struct Ramp {
    rate_hz: f64,
    open: bool,
    /// Position of the gain from 0 to 1, and its upward step a frame.
    place: f64,
    up: f64,
    /// Position of the gain after a break.
    joined: f64,
    /// Position of the last frame's weight, from 1 down.
    held: f64,
    /// Last frame before the break, one value a channel.
    last: Vec<f32>,
    out: Vec<f32>,
}

impl Ramp {
    /// Starts silent, and rises over `start_s` seconds while [`open`](Self::open); 0 opens at once.
    /// Allocates.
    pub fn new(rate_hz: u32, channels: usize, start_s: f64) -> Self {
        let mut ramp = Self {
            rate_hz: f64::from(rate_hz.max(1)),
            open: true,
            place: 0.0,
            up: 0.0,
            joined: 1.0,
            held: 0.0,
            last: vec![0.0; channels.max(1)],
            out: vec![0.0; channels.max(1)],
        };
        ramp.up = ramp.step(start_s);
        ramp
    }

    fn step(&self, seconds: f64) -> f64 {
        1.0 / (seconds * self.rate_hz).max(1.0)
    }

    /// Lets the gain rise, or fall within [`DOWN_S`]. Once it was full, it rises again over [`UNMUTE_S`];
    /// else over the start's time.
    pub fn open(&mut self, open: bool) {
        if self.open && !open && self.place >= 1.0 {
            self.up = self.step(UNMUTE_S);
        }
        self.open = open;
    }

    /// State of the gain of start, mute and stop.
    pub fn level(&self) -> Level {
        match (self.open, self.place) {
            (true, p) if p >= 1.0 => Level::Full,
            (true, _) => Level::Rising,
            (false, p) if p <= 0.0 => Level::Silent,
            (false, _) => Level::Falling,
        }
    }

    /// Whether the output stays silent until it opens: the gain is 0 and no frame decays.
    pub fn silent(&self) -> bool {
        self.level() == Level::Silent && self.held <= 0.0
    }

    /// Marks a break before the next frame: the last frame decays, the next ones rise.
    pub fn broken(&mut self) {
        self.last.copy_from_slice(&self.out);
        self.held = 1.0;
        self.joined = 0.0;
    }

    /// Applies the envelope to frames of the signal. A value that is not finite counts as 0.
    pub fn play(&mut self, frames: &mut [f32]) {
        for frame in frames.chunks_exact_mut(self.out.len()) {
            self.advance();
            if self.joined < 1.0 {
                self.joined = settled(self.joined + self.step(FED_S));
            }
            let gain = if self.place < 1.0 { raised(self.place) } else { 1.0 };
            let gain = if self.joined < 1.0 { gain * raised(self.joined) } else { gain };
            self.put(frame, gain);
        }
    }

    /// Fills frames without a signal: the last frame decays to silence. The signal after this rises.
    pub fn starve(&mut self, frames: &mut [f32]) {
        if frames.len() >= self.out.len() && self.joined > 0.0 {
            self.broken();
        }
        for frame in frames.chunks_exact_mut(self.out.len()) {
            self.advance();
            self.put(frame, 0.0);
        }
    }

    fn advance(&mut self) {
        self.place = settled(self.place + if self.open { self.up } else { -self.step(DOWN_S) });
        if self.held > 0.0 {
            self.held = settled(self.held - self.step(STARVED_S));
        }
    }

    fn put(&mut self, frame: &mut [f32], gain: f64) {
        let held = if self.held > 0.0 { raised(self.held) } else { 0.0 };
        for ((x, out), last) in frame.iter_mut().zip(&mut self.out).zip(&self.last) {
            if gain < 1.0 || held > 0.0 {
                let signal = if x.is_finite() { f64::from(*x) * gain } else { 0.0 };
                *x = (signal + held * f64::from(*last)) as f32;
            } else if !x.is_finite() {
                *x = 0.0;
            }
            *out = *x;
        }
    }
}

#[cfg(test)]
#[path = "ramp_tests.rs"]
mod tests;
