//! Ticks inside the audio callback: the least latency.
//!
//! Tick k begins at position x_k = k rate / tick rate of the device's frames, and reads the hand at t(x_k)
//! - D. Here t is the line of the delay-locked loop, and D the device's real period (the frames of one
//!   wake-up). A callback runs the ticks that begin before its end, which is at most D after its beginning.
//!   So the last tick reads the hand at the callback's own time, and none reads the future. D follows a
//!   change of the period by 2 % of time, so ticks are evenly spaced in the hand's time, however they bunch
//!   in real time. With 64 frames at 48 kHz the delay is 1.3 ms.

use std::ops::Range;
use std::sync::Arc;

use asperity_audio::{Block, Process};
use asperity_engine::Flushed;
use parking_lot::Mutex;

use super::run::{self, Output, Rates, SLEW};
use super::{Clock, Controls, Driver, Options, Runs, Ticker};
use crate::dll::{Heard, Line};

/// Stack that the device's thread touches at the first callback. Its stack may be small.
const STACK: usize = 65_536;

/// The device's side.
#[derive(Debug)]
pub struct CallbackHalf<T> {
    slot: Arc<Mutex<Option<T>>>,
    out: Output,
    stream: Stream,
}

/// A run whose ticks an audio device calls, and its process for the device, which must have the ticker's
/// rate and channels.
pub fn callback<T: Ticker>(ticker: T, options: &Options) -> (Driver<T>, CallbackHalf<T>) {
    let controls = Controls::new(options, None);
    let out = Output::new(Arc::clone(&controls), &ticker.rates(), options.start_s);
    let stream = Stream::new(&ticker);
    let slot = Arc::new(Mutex::new(Some(ticker)));
    let runs = Some(Runs::Callback(Arc::clone(&slot)));
    (Driver { clock: Clock::Callback, controls, runs }, CallbackHalf { slot, out, stream })
}

impl<T: Ticker> Process for CallbackHalf<T> {
    fn process(&mut self, block: &mut Block<'_>) {
        let _flushed = Flushed::new();
        let Some(heard) = self.out.begin(block) else { return };
        let (controls, line) = (&*self.out.controls, self.out.dll.line());
        controls.asked.once::<STACK>(controls.priority);
        let filled = match self.slot.try_lock().as_deref_mut() {
            Some(Some(ticker)) if !controls.failed() && !controls.down() => {
                self.stream.fill(ticker, controls, line, heard, block.output)
            }
            _ => 0,
        };
        self.out.end(block.output, 0, filled);
    }
}

/// Turns the ticker's samples into the device's frames.
#[derive(Debug)]
struct Stream {
    rates: Rates,
    /// Samples of the last tick, and the range not yet played (in values, not frames).
    samples: Vec<f32>,
    left: Range<usize>,
    /// Sample of the ticker at position 0 of the device.
    origin: i64,
    /// Frames of time that passed unplayed and are not skipped yet: less than a tick.
    owed: u64,
    /// The delay D [ns]; 0 before the first callback.
    delay_ns: f64,
    read_ns: u64,
}

impl Stream {
    fn new(ticker: &impl Ticker) -> Self {
        let rates = ticker.rates();
        Self {
            rates,
            samples: vec![0.0; rates.most()],
            left: 0..0,
            origin: rates.first_sample(ticker.next_tick()) as i64,
            owed: 0,
            delay_ns: 0.0,
            read_ns: 0,
        }
    }

    /// Fills frames by running ticks; returns how many. Fewer than `out` holds if a tick panicked.
    fn fill(
        &mut self,
        ticker: &mut impl Ticker,
        controls: &Controls,
        line: &Line,
        heard: Heard,
        out: &mut [f32],
    ) -> usize {
        let channels = self.rates.channels;
        if heard.lost > 0 {
            self.catch_up(ticker, controls, heard);
        }
        let due_ns = line.time_ns(heard.position as f64).max(0.0) as u64;
        let mut filled = 0;
        loop {
            let n = self.left.len().min(out.len() - filled);
            out[filled..filled + n].copy_from_slice(&self.samples[self.left.start..self.left.start + n]);
            self.left.start += n;
            filled += n;
            if filled == out.len() {
                return filled / channels;
            }
            let (tick, time_ns) = (ticker.next_tick(), self.time_of(ticker.next_tick(), controls, line));
            let len = self.rates.len(tick).min(self.samples.len());
            if !run::tick(ticker, controls, (time_ns, due_ns), &mut self.samples[..len]) {
                self.left = 0..0;
                return filled / channels;
            }
            self.left = 0..len;
        }
    }

    /// Time at which a tick reads the hand; never before that of the tick before.
    fn time_of(&mut self, tick: u64, controls: &Controls, line: &Line) -> u64 {
        let period_ns = line.period_frames as f64 * line.frame_ns();
        if self.delay_ns == 0.0 {
            self.delay_ns = period_ns;
        }
        let most = SLEW * self.rates.tick_ns();
        self.delay_ns += (period_ns - self.delay_ns).clamp(-most, most);
        controls.lead_ns.store(self.delay_ns as u64, std::sync::atomic::Ordering::Relaxed);
        let position = self.rates.samples_from(0, tick) - self.origin as f64;
        let time_ns = (line.time_ns(position) - self.delay_ns).max(0.0) as u64;
        self.read_ns = self.read_ns.max(time_ns);
        self.read_ns
    }

    /// Skips the ticks of a gap, and goes on with the last tick that had begun by then.
    fn catch_up(&mut self, ticker: &mut impl Ticker, controls: &Controls, heard: Heard) {
        self.owed += heard.lost;
        let (tick, left) = (ticker.next_tick(), (self.left.len() / self.rates.channels) as u64);
        let here = self.rates.first_sample(tick).saturating_sub(left);
        let to = self.rates.tick_at(here + self.owed);
        let mut now = here;
        if to >= tick {
            ticker.skip(to - tick);
            self.left = 0..0;
            now = self.rates.first_sample(to);
            controls.meters().skipped_ticks.add(to - tick);
            controls.meters().lost_samples.add(now - here);
            self.owed -= now - here;
        }
        self.origin = now as i64 - heard.position as i64;
    }
}

#[cfg(test)]
#[path = "callback_tests.rs"]
mod tests;
