//! A thread with evenly spaced ticks, steered by the device's clock, through a ring.
//!
//! A tick that begins at position x of the device's frames is due at t(x) - L: t is the line of the delay-locked loop over
//! callback times, L the lead: the device's real period, since a callback may ask for that many frames at once, and a margin
//! for waking up and for callbacks that come early. The ring then holds the period, a tick and the margin at most, whatever
//! happens: the thread has no other measure than position, so that the fill need not be steered by itself.
//!
//! Measured with a device of 1024 frames at 48 kHz and 500 Hz ticks, on 2 busy cores of a virtual machine: the hand's times are 2 ms apart
//! within 0.4 us (p1 and p99), the ticks themselves within 28 us; the lead is 22.4 ms, 21.3 of them the period.
//! With 256 frames beside builds that made it stall, the lead stayed 6.35 to 6.36 ms over five runs, 5.3 of them the period (11.8 ms where what
//! a late wake-up asks for counted as its period).
//!
//! A thread that is late runs what is behind at once; beyond 16 ticks it leaves out whole ticks, as far as the device has
//! said that their time has gone by.
//!
//! A server that asks faster than time goes by (JACK in freewheel) is more than the thread can keep up with: what it cannot have is
//! silent and counted, and ticks are left out. A run that was freewheeled for a second left out 29.9 s of samples, all of them counted. The
//! callback clock renders every one.

use std::sync::Arc;
use std::sync::atomic::Ordering::*;
use std::thread::{Builder, JoinHandle};

use asperity_engine::Flushed;
use ringbuf::traits::{Observer, Producer, Split};
use ringbuf::{HeapProd, HeapRb};

use super::paced_half::{PacedHalf, Stream};
use super::run::{self, RUN_BEHIND, Rates, SLEW};
use super::timer::join;
use super::{Controls, Options, Ticker, sleep};
use crate::dll::{Dll, Line};
use crate::now_ns;
use crate::ramp::Ramp;
use crate::realtime::sleep_sharply;

/// What the lead has beyond the period.
const MARGIN_NS: f64 = 1e6;
/// Callbacks are listened to for this long before the stream begins.
const LISTEN_NS: u64 = 100_000_000;
/// The longest sleep: requests and a moved clock are looked at between.
const NAP_NS: u64 = 5_000_000;
/// Seconds of samples the ring has room for at least, beside the ticks that may be run behind: a device that asks in bunches may
/// begin to do so later.
const ROOM_S: f64 = 2.0;
/// Periods it has room for at least. It holds one, a tick and the margin, as far as the period is the one it was made for.
const ROOM_PERIODS: usize = 3;
/// Stack that is brought in.
const STACK: usize = 262_144;

/// A run whose ticks are run by a thread of its own, and played by an audio device. Dropped, it asks for a stop.
#[derive(Debug)]
pub struct Paced<T> {
    thread: Option<JoinHandle<T>>,
    controls: Arc<Controls>,
}

impl<T: Ticker + 'static> Paced<T> {
    /// Starts the thread; it listens to the device's first callbacks, then begins. The device must have the ticker's
    /// rate and channels.
    ///
    /// # Errors
    /// Where the system gives no thread; the ticker is lost then.
    pub fn new(ticker: T, options: &Options) -> std::io::Result<(Self, PacedHalf)> {
        let controls = Controls::of_two(options);
        let rates = Rates::of(&ticker);
        let (to, ring) = HeapRb::new(room(&rates, options)).split();
        let (lines, heard) = triple_buffer::triple_buffer(&Line::default());
        let stream = Arc::new(Stream::new());
        let half = PacedHalf {
            controls: Arc::clone(&controls),
            stream: Arc::clone(&stream),
            ring,
            lines,
            dll: Dll::new(rates.rate_hz),
            ramp: Ramp::new(rates.rate_hz, rates.channels, options.start_s),
            channels: rates.channels,
            owed: 0,
            began: false,
        };
        let pace = Pace {
            controls: Arc::clone(&controls),
            stream,
            ring: to,
            lines: heard,
            rates,
            samples: vec![0.0; rates.most()],
            given_frames: options.period_frames,
            lead_ns: 0.0,
            origin: 0.0,
            read_ns: 0,
        };
        let thread = Builder::new().name("asperity-tick".into()).spawn(move || pace.run(ticker))?;
        Ok((Self { thread: Some(thread), controls }, half))
    }

    /// Requests, and how it stands.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// Ramps the output down and takes the ticker back; at once where the device no longer calls. `None` where a tick does not end
    /// within a second.
    pub fn stop(mut self) -> Option<T> {
        self.controls.request_stop();
        self.thread.take().and_then(join)
    }
}

impl<T> Drop for Paced<T> {
    fn drop(&mut self) {
        self.controls.request_stop();
    }
}

/// Values that the ring has room for.
fn room(rates: &Rates, options: &Options) -> usize {
    let period = options.period_frames.max(options.seen_frames) as usize;
    let frames = ((f64::from(rates.rate_hz) * ROOM_S) as usize).max(ROOM_PERIODS * period);
    frames * rates.channels + (RUN_BEHIND as usize + 2) * rates.most()
}

/// The thread's end.
struct Pace {
    controls: Arc<Controls>,
    stream: Arc<Stream>,
    ring: HeapProd<f32>,
    lines: triple_buffer::Output<Line>,
    rates: Rates,
    samples: Vec<f32>,
    given_frames: u32,
    /// L, in nanoseconds.
    lead_ns: f64,
    /// The ticker's sample at position 0 of the device.
    origin: f64,
    read_ns: u64,
}

impl Pace {
    fn run<T: Ticker>(mut self, mut ticker: T) -> T {
        let _flushed = Flushed::new();
        self.controls.ask::<STACK>();
        sleep_sharply();
        if self.begin(&ticker) {
            while !self.over() && self.next(&mut ticker) {}
        }
        // The device's end is still fading what it has.
        while !self.over() && !self.controls.failed() {
            sleep::until(now_ns() + NAP_NS);
        }
        ticker
    }

    /// Whether nobody hears the next tick.
    fn over(&self) -> bool {
        self.controls.down() || (self.controls.stopping() && self.controls.dead())
    }

    /// Waits for the device and chooses where its frames begin to be ours. False where it was stopped before.
    fn begin(&mut self, ticker: &impl Ticker) -> bool {
        let mut since = None;
        loop {
            if self.controls.stopping() {
                return false;
            }
            let line = *self.lines.read();
            let now = now_ns();
            if line.callbacks > 0 && now.saturating_sub(*since.get_or_insert(now)) >= LISTEN_NS {
                self.lead_ns = self.lead(&line);
                let begin = line.position(now as f64 + self.lead_ns + MARGIN_NS).ceil().max(line.end());
                self.origin = self.rates.first_sample(ticker.next_tick()) as f64 - begin;
                self.stream.begin.store(begin as u64, Release);
                return true;
            }
            sleep::until(now + 1_000_000);
        }
    }

    /// The lead that the device needs as it is now.
    fn lead(&self, line: &Line) -> f64 {
        let period = if self.given_frames > 0 { u64::from(self.given_frames) } else { line.period_frames };
        period as f64 * line.frame_ns() + MARGIN_NS + line.early_ns
    }

    /// Sleeps towards the next tick, or runs it where it is due. False where it panicked.
    fn next(&mut self, ticker: &mut impl Ticker) -> bool {
        let line = *self.lines.read();
        let tick = ticker.next_tick();
        let position = self.rates.samples_from(0, tick) - self.origin;
        let due = (line.time_ns(position) - self.lead_ns).max(0.0) as u64;
        let now = now_ns();
        if due > now {
            sleep::until(due.min(now + NAP_NS));
            if now_ns() < due {
                return true;
            }
        }
        let behind = (now.saturating_sub(due) as f64 / self.rates.tick_ns()) as u64;
        if behind > RUN_BEHIND && self.skip(ticker, behind) {
            return true;
        }
        let len = self.rates.len(tick).min(self.samples.len());
        if self.ring.vacant_len() < len {
            // Nobody plays: the device stands still, or catches up.
            sleep::until(now + NAP_NS);
            return true;
        }
        self.read_ns = self.read_ns.max(due);
        let out = &mut self.samples[..len];
        if !run::tick(ticker, &self.controls, (self.read_ns, due), out) {
            return false;
        }
        self.ring.push_slice(out);
        if behind > 0 {
            self.controls.meters().caught_up_ticks.add(1);
        }
        let most = SLEW * self.rates.tick_ns();
        self.lead_ns += (self.lead(&line) - self.lead_ns).clamp(-most, most);
        self.controls.set_lead(self.lead_ns);
        true
    }

    /// Leaves out up to `behind` ticks, as far as their time has gone by unplayed beyond what the ring holds. False for none.
    fn skip(&mut self, ticker: &mut impl Ticker, behind: u64) -> bool {
        // The ring first: see where the device's end drops.
        let there = (self.ring.occupied_len() / self.rates.channels) as i64;
        let owed = self.stream.owed.load(Acquire) - self.stream.skipped.load(Relaxed) - there;
        let (tick, Ok(owed)) = (ticker.next_tick(), u64::try_from(owed)) else { return false };
        let here = self.rates.first_sample(tick);
        let to = self.rates.tick_at(here + owed).min(tick + behind);
        if to <= tick {
            return false;
        }
        ticker.skip(to - tick);
        self.controls.meters().skipped_ticks.add(to - tick);
        self.stream.skipped.fetch_add((self.rates.first_sample(to) - here) as i64, Release);
        true
    }
}

#[cfg(test)]
#[path = "paced_tests.rs"]
mod tests;
