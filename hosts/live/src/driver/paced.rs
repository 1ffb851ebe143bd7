//! A thread with evenly spaced ticks, steered by the device's clock, that feeds the device through a ring.
//!
//! A tick that begins at position x of the device's frames is due at t(x) - L. Here t is the line of the
//! delay-locked loop over callback times, and L the lead: the device's real period, since a callback may
//! ask for that many frames at once, plus a margin for waking up and for early callbacks. The ring then
//! never holds more than the period, a tick and the margin. The thread measures by position alone, so the
//! fill of the ring needs no control of its own.
//!
//! A late thread runs up to 16 late ticks at once. Beyond that it skips whole ticks, as far as the device
//! has reported that their time has passed.
//!
//! A server faster than real time (JACK in freewheel) asks for more than the thread can compute. Missing
//! samples are silent and counted, and ticks are skipped. The callback clock renders every sample.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, AtomicU64, Ordering::*};

use asperity_audio::{Block, Process};
use asperity_engine::Flushed;
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use super::run::{self, Output, RUN_BEHIND, Rates, SLEW};
use super::{Clock, Controls, Driver, Options, Ticker, sleep_until};
use crate::dll::Line;
use crate::now_ns;
use crate::realtime::Asked;

opaque_debug!(PacedHalf);

/// Margin of the lead beyond the period [ns].
const MARGIN_NS: f64 = 1e6;
/// Callbacks are observed for this long before the stream begins [ns].
const LISTEN_NS: u64 = 100_000_000;
/// Longest sleep [ns]. Between sleeps the thread reads requests and the device's clock.
const NAP_NS: u64 = 5_000_000;
/// Least room of the ring in seconds, beside late ticks: a device may begin to call in bunches later.
const ROOM_S: f64 = 2.0;
/// Least room of the ring in periods. It holds one period, a tick and the margin if the period stays as
/// assumed.
const ROOM_PERIODS: usize = 3;
/// Stack that the device's thread touches at its first callback.
const DEVICE_STACK: usize = 32_768;

/// Starts a run whose ticks a thread calls, and an audio device plays. The thread listens to the device's
/// first callbacks, then begins. The device must have the ticker's rate and channels.
///
/// # Errors
/// The system gives no thread; the ticker is lost then.
pub fn paced<T: Ticker + 'static>(ticker: T, options: &Options) -> std::io::Result<(Driver<T>, PacedHalf)> {
    let controls = Controls::new(options, Some(Asked::default()));
    let rates = ticker.rates();
    let (to, ring) = HeapRb::new(room(&rates, options)).split();
    let (lines, heard) = triple_buffer::triple_buffer(&Line::default());
    let begin = AtomicU64::new(u64::MAX);
    let stream = Arc::new(Stream { begin, owed: AtomicI64::new(0), skipped: AtomicI64::new(0) });
    let half = PacedHalf {
        out: Output::new(Arc::clone(&controls), &rates, options.start_s),
        stream: Arc::clone(&stream),
        ring,
        lines,
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
        lead_ns: 0.0,
        origin: 0.0,
        read_ns: 0,
    };
    Ok((Driver::thread(Clock::Paced, controls, |_| pace.run(ticker))?, half))
}

fn room(rates: &Rates, options: &Options) -> usize {
    let period = options.seen_frames as usize;
    let frames = ((f64::from(rates.rate_hz) * ROOM_S) as usize).max(ROOM_PERIODS * period);
    frames * rates.channels + (RUN_BEHIND as usize + 2) * rates.most()
}

/// Lead that a device needs now [ns].
fn lead(line: &Line) -> f64 {
    line.period_frames as f64 * line.frame_ns() + MARGIN_NS + line.early_ns
}

struct Pace {
    controls: Arc<Controls>,
    stream: Arc<Stream>,
    ring: HeapProd<f32>,
    lines: triple_buffer::Output<Line>,
    rates: Rates,
    samples: Vec<f32>,
    lead_ns: f64,
    /// Sample of the ticker at position 0 of the device.
    origin: f64,
    read_ns: u64,
}

impl Pace {
    fn run<T: Ticker>(mut self, mut ticker: T) -> T {
        if self.begin(&ticker) {
            while !self.over() && self.next(&mut ticker) {}
        }
        // The device still fades its last samples.
        while !self.over() && !self.controls.failed() {
            sleep_until(now_ns() + NAP_NS);
        }
        ticker
    }

    /// Whether the next tick would not be heard.
    fn over(&self) -> bool {
        self.controls.down() || (self.controls.stopping() && self.controls.dead())
    }

    /// Waits for the device and chooses the position at which the stream begins. False if it is stopped
    /// before.
    fn begin(&mut self, ticker: &impl Ticker) -> bool {
        let mut since = None;
        loop {
            if self.controls.stopping() {
                return false;
            }
            let line = *self.lines.read();
            let now = now_ns();
            if line.callbacks > 0 && now.saturating_sub(*since.get_or_insert(now)) >= LISTEN_NS {
                self.lead_ns = lead(&line);
                let begin = line.position(now as f64 + self.lead_ns + MARGIN_NS).ceil().max(line.end());
                self.origin = self.rates.first_sample(ticker.next_tick()) as f64 - begin;
                self.stream.begin.store(begin as u64, Release);
                return true;
            }
            sleep_until(now + 1_000_000);
        }
    }

    /// Sleeps until the next tick, or runs it when it is due. False if it panicked.
    fn next(&mut self, ticker: &mut impl Ticker) -> bool {
        let line = *self.lines.read();
        let tick = ticker.next_tick();
        let position = self.rates.samples_from(0, tick) - self.origin;
        let due = (line.time_ns(position) - self.lead_ns).max(0.0) as u64;
        let now = now_ns();
        if due > now {
            sleep_until(due.min(now + NAP_NS));
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
            // The ring is full: the device stands still, or catches up.
            sleep_until(now + NAP_NS);
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
        self.lead_ns += (lead(&line) - self.lead_ns).clamp(-most, most);
        self.controls.lead_ns.store(self.lead_ns as u64, Relaxed);
        true
    }

    /// Skips up to `behind` ticks whose time has passed unplayed beyond the ring's content. False if there
    /// is none.
    fn skip(&mut self, ticker: &mut impl Ticker, behind: u64) -> bool {
        // Read the ring before `owed`; `PacedHalf::take` writes them in the opposite order.
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

/// Stream state that both sides share, in frames.
#[derive(Debug)]
struct Stream {
    /// Position of the device at which the stream begins; `u64::MAX` until the thread has chosen it.
    begin: AtomicU64,
    /// Frames of time that passed unplayed, less those that the device's side has dropped since.
    owed: AtomicI64,
    /// Of these, frames that the thread skipped.
    skipped: AtomicI64,
}

/// The device's side: takes samples from the ring, and reports the device's time to the thread.
///
/// Position in the stream is position in time. Samples that were missing at their time, or that a gap passed
/// over, are owed: as many are dropped, or skipped by the thread, before anything plays again.
pub struct PacedHalf {
    out: Output,
    stream: Arc<Stream>,
    ring: HeapCons<f32>,
    lines: triple_buffer::Input<Line>,
    /// Frames owed, without the thread's skips.
    owed: i64,
    began: bool,
}

impl Process for PacedHalf {
    fn process(&mut self, block: &mut Block<'_>) {
        let _flushed = Flushed::new();
        let Some(heard) = self.out.begin(block) else { return };
        let (controls, channels) = (Arc::clone(&self.out.controls), self.out.channels);
        // Ticks run on another thread, but a late callback is audible too.
        if let Some(asked) = &controls.device_asked {
            asked.once::<DEVICE_STACK>(controls.priority);
        }
        self.lines.write(*self.out.dll.line());
        if heard.lost > 0 && self.began {
            self.owe(heard.lost);
        }
        let frames = block.frames();
        let before = self.silent_before_begin(heard.position, frames as u64) as usize;
        let over = controls.down() || controls.failed();
        let filled = if over { 0 } else { self.take(&mut block.output[before * channels..]) / channels };
        let missing = frames - before - filled;
        if missing > 0 && !over {
            controls.meters().underruns.add(1);
            self.owe(missing as u64);
        }
        self.out.end(block.output, before, filled);
    }
}

impl PacedHalf {
    /// Frames of this block before the stream begins.
    fn silent_before_begin(&mut self, position: u64, frames: u64) -> u64 {
        if self.began {
            return 0;
        }
        let begin = self.stream.begin.load(Acquire);
        let silent = begin.saturating_sub(position).min(frames);
        if silent < frames {
            self.began = true;
            let late = position.saturating_sub(begin);
            if late > 0 {
                self.owe(late);
            }
        }
        silent
    }

    fn owe(&mut self, frames: u64) {
        self.out.controls.meters().lost_samples.add(frames);
        self.owed += frames as i64;
        self.stream.owed.store(self.owed, Release);
    }

    /// Drops owed frames, then fills `out`; returns how many values it filled.
    fn take(&mut self, out: &mut [f32]) -> usize {
        if self.began {
            let there = (self.ring.occupied_len() / self.out.channels) as i64;
            let owed = self.owed - self.stream.skipped.load(Acquire);
            let drop = owed.min(there).max(0);
            if drop > 0 {
                self.owed -= drop;
                // Stored before the drop: the thread reads the ring first, so it never sees more owed than
                // there is.
                self.stream.owed.store(self.owed, Release);
                self.ring.skip(drop as usize * self.out.channels);
            }
            // Samples pushed in the meantime are owed too.
            if owed > drop {
                return 0;
            }
        }
        // The ring holds whole frames, and `out` is whole frames.
        self.ring.pop_slice(out)
    }
}

#[cfg(test)]
#[path = "paced_tests.rs"]
mod tests;
