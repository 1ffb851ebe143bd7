//! Watches a stream from a thread of its own, since hosts do not report everything.
//!
//! PulseAudio reports no underruns, and is silent when its server is stopped. ALSA over a killed Pulse
//! server reports 40,000 errors a second until the stream is dropped. So the watch times calls, counts
//! errors, and closes a lost stream at once.

use std::any::Any;
use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use cpal::ErrorKind;
use parking_lot::Mutex;
use ringbuf::HeapCons;
use ringbuf::traits::Consumer;

use crate::block::frames_ns;
use crate::callback::{Counts, Message};
use crate::quiet::hush_alsa;
use crate::roll::Roll;
use crate::{Event, Events, now_ns};

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(5);
/// Time without a call that is a loss, if it is also ten periods [ns].
const LOSS_NS: u64 = 1_000_000_000;
/// Longest time before the first call [ns].
const FIRST_NS: u64 = 2_000_000_000;
/// A longer time between two looks is a stall of the machine [ns].
const STANDSTILL_NS: u64 = 250_000_000;
/// More errors than this at once are a loss, ...
const FLOOD: f64 = 32.0;
/// ... but this many a second are tolerated.
const TOLERATED_HZ: f64 = 20.0;
/// Longest fade of a lost stream that still calls, and longest wait until the fade is heard.
const FADING: Duration = Duration::from_millis(50);
/// Longest wait for a host to close a lost stream before the loss is reported. So whoever reopens the
/// device does not find it busy.
const CLOSING_LOST: Duration = Duration::from_millis(100);
/// Longest wait for a host to close a dropped stream.
pub(crate) const CLOSING: Duration = Duration::from_millis(500);

/// State that the stream, its watch and its owner share.
pub(crate) struct Shared {
    /// cpal's streams, input first; empty when closed.
    pub(crate) streams: Mutex<Vec<cpal::Stream>>,
    /// Start of playing [ns]; 0 while it does not play.
    pub(crate) playing_since: std::sync::atomic::AtomicU64,
    /// Reason of the loss.
    pub(crate) lost: OnceLock<String>,
    /// Whether the watch must end.
    pub(crate) done: std::sync::atomic::AtomicBool,
    /// Whether the time between calls is watched: not on a simulated card that is called by hand.
    pub(crate) timed: bool,
}

impl Shared {
    /// Closes the streams on a thread of its own, since a server that hangs would block the caller.
    pub(crate) fn close(&self, patience: Duration) {
        let streams = std::mem::take(&mut *self.streams.lock());
        if streams.is_empty() {
            return;
        }
        let (closed, wait) = mpsc::channel::<()>();
        std::thread::spawn(move || {
            hush_alsa();
            drop(streams);
            drop(closed);
        });
        let _ = wait.recv_timeout(patience);
    }
}

/// The watch's view of one side.
pub(crate) struct Watched {
    pub(crate) counts: Arc<Counts>,
    /// Messages from the data callback and from the error callback.
    pub(crate) messages: [HeapCons<Message>; 2],
    /// Leaky bucket of errors, and the count when it was last filled.
    pub(crate) bucket: f64,
    pub(crate) counted: u64,
}

impl Watched {
    pub(crate) fn new(counts: Arc<Counts>, messages: [HeapCons<Message>; 2]) -> Self {
        Self { counts, messages, bucket: 0.0, counted: 0 }
    }

    /// Reads messages and counts; returns why the stream is lost, if it is.
    fn look(&mut self, events: &mut VecDeque<Event>) -> Option<String> {
        let mut lost = None;
        let mut last = String::new();
        for message in self.messages.iter_mut().flat_map(Consumer::pop_iter) {
            match message {
                Message::Gap(ns) => events.push_back(Event::Gap { ms: ns as f64 / 1e6 }),
                Message::Panic(panic) => lost = lost.or(Some(told(panic))),
                Message::Error(error) if error.kind() == ErrorKind::Xrun => events.push_back(Event::Xrun),
                Message::Error(error) if is_loss(error.kind()) => lost = lost.or(Some(error.to_string())),
                Message::Error(error) => last = error.to_string(),
            }
        }
        let errors = self.counts.errors.load(Relaxed);
        self.bucket = (self.bucket - TOLERATED_HZ * PERIOD.as_secs_f64()).max(0.0);
        self.bucket += (errors - self.counted) as f64;
        self.counted = errors;
        if self.bucket > FLOOD {
            lost = lost.or(Some(format!("a flood of errors: {last}")));
        }
        lost
    }

    /// Why the device is lost by silence, if it is. The time before `since` does not count.
    fn silent(&self, now: u64, since: u64) -> Option<String> {
        let last = self.counts.last_ns.load(Relaxed);
        if last == 0 {
            let waited = now.saturating_sub(since);
            return (waited > FIRST_NS).then(|| {
                format!("the device is open and has not called once in {:.0} s", FIRST_NS as f64 / 1e9)
            });
        }
        let ten_periods = frames_ns(10 * u64::from(self.counts.longest()), self.counts.rate_hz);
        let silence = now.saturating_sub(last.max(since));
        let over = silence > LOSS_NS.max(ten_periods);
        over.then(|| format!("the device has not called for {:.1} s", silence as f64 / 1e9))
    }
}

fn is_loss(kind: ErrorKind) -> bool {
    matches!(
        kind,
        ErrorKind::DeviceNotAvailable
            | ErrorKind::DeviceChanged
            | ErrorKind::StreamInvalidated
            | ErrorKind::HostUnavailable
            | ErrorKind::PermissionDenied
            | ErrorKind::ResourceExhausted
    )
}

fn told(panic: Box<dyn Any + Send>) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!(
        "the process that fills the device's blocks panicked: {}",
        text.as_deref().unwrap_or("no message")
    )
}

/// Tells a silent device from a stalled machine, on which this thread does not run either.
#[derive(Default)]
struct Awake {
    looked: u64,
    since: u64,
}

impl Awake {
    /// Notes a look; returns since when looks have come without a stall [ns].
    fn look(&mut self, now: u64) -> u64 {
        if now.saturating_sub(self.looked) > STANDSTILL_NS {
            self.since = now;
        }
        self.looked = now;
        self.since
    }
}

/// Watches until the stream is lost or dropped.
pub(crate) fn watch(shared: &Shared, mut sides: Vec<Watched>, roll: &Roll, events: &Events) {
    let mut waiting = VecDeque::new();
    let mut awake = Awake::default();
    while !shared.done.load(Relaxed) {
        let now = now_ns();
        let awake_since = awake.look(now);
        let playing_since = shared.playing_since.load(Relaxed);
        let timed = shared.timed && playing_since > 0;
        let mut lost = None;
        for side in &mut sides {
            let quiet = if timed { side.silent(now, playing_since.max(awake_since)) } else { None };
            let said = side.look(&mut waiting);
            lost = lost.or(said).or(quiet);
        }
        lost = lost.or_else(|| roll.look());
        // If nobody reads events, the counts still tell.
        waiting.drain(..).for_each(|event| drop(events.try_send(event)));
        if let Some(reason) = lost {
            return lose(shared, &sides, reason, events);
        }
        std::thread::park_timeout(PERIOD);
    }
}

/// Waits until the fade of a calling output is heard.
fn fade(counts: &Counts) {
    let limit = FADING.as_nanos() as u64;
    let began = now_ns();
    let calls = |now: u64| now.saturating_sub(counts.last_ns.load(Relaxed)) < limit;
    let faded = || counts.faded_ns.load(Relaxed);
    let heard = |now: u64| faded() > 0 && now > faded();
    let mut now = began;
    while calls(now) && !heard(now) && now < began + if faded() > 0 { 2 * limit } else { limit } {
        std::thread::park_timeout(Duration::from_millis(1));
        now = now_ns();
    }
}

/// Closes the stream and reports the loss, once.
fn lose(shared: &Shared, sides: &[Watched], reason: String, events: &Events) {
    sides.iter().for_each(|side| side.counts.over.store(true, Relaxed));
    // The first side is the output.
    sides.first().iter().for_each(|side| fade(&side.counts));
    let _ = shared.lost.set(reason.clone());
    shared.close(CLOSING_LOST);
    let mut event = Event::Lost { reason };
    while let Err(mpsc::TrySendError::Full(back)) = events.try_send(event) {
        if shared.done.load(Relaxed) {
            return;
        }
        event = back;
        std::thread::park_timeout(PERIOD);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringbuf::HeapRb;
    use ringbuf::traits::Split;

    fn ms(ms: u64) -> u64 {
        ms * 1_000_000
    }

    fn watched(counts: &Arc<Counts>) -> Watched {
        Watched::new(counts.clone(), [(); 2].map(|()| HeapRb::new(1).split().1))
    }

    #[test]
    fn stall_of_the_machine_is_no_loss_of_the_device() {
        let counts = Arc::new(Counts::new(48_000));
        let side = watched(&counts);
        counts.last_ns.store(ms(1000), Relaxed);
        let mut awake = Awake::default();
        let mut look = |now: u64| side.silent(now, awake.look(now));
        assert_eq!((1000..1500).step_by(5).find_map(|at| look(ms(at))), None);
        // It stands still for 3 s: the device has a second from then on.
        assert_eq!((4500..=5500).step_by(5).find_map(|at| look(ms(at))), None);
        assert!(look(ms(5505)).is_some_and(|reason| reason.contains("1.0 s")));
    }

    #[test]
    fn long_periods_get_more_time() {
        let counts = Arc::new(Counts::new(1000));
        let side = watched(&counts);
        counts.called(ms(1), 300, 0);
        assert_eq!(side.silent(ms(3001), 0), None);
        assert!(side.silent(ms(3002), 0).is_some());
    }
}
