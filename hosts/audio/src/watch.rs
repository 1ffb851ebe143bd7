//! Watches a stream from a thread of its own: hosts do not tell all that goes wrong.
//!
//! PulseAudio reports no underruns and says nothing when its server is stopped; ALSA over a Pulse server
//! that was killed reports 40,000 errors a second until the stream is dropped. So calls are timed here,
//! errors are counted, and a stream that is lost is closed from here, at once.

use std::any::Any;
use std::collections::VecDeque;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use cpal::ErrorKind;
use parking_lot::Mutex;
use ringbuf::HeapCons;
use ringbuf::traits::Consumer;

use crate::callback::{Counts, Message};
use crate::quiet::hush_alsa;
use crate::roll::Roll;
use crate::{Event, Events, now_ns};

/// How often the watch looks.
const PERIOD: Duration = Duration::from_millis(5);
/// No call for so long is a loss, if it is also ten periods [ns].
const LOSS_NS: u64 = 1_000_000_000;
/// How long a device may take to call for the first time [ns].
const FIRST_NS: u64 = 2_000_000_000;
/// A watch that has not looked for so long was held up itself [ns].
const STANDSTILL_NS: u64 = 250_000_000;
/// More errors than this at once are a loss ...
const FLOOD: f64 = 32.0;
/// ... where so many a second do no harm.
const TOLERATED_HZ: f64 = 20.0;
/// How long a lost stream that still calls may take to fade, and again until the fade is heard.
const FADING: Duration = Duration::from_millis(50);
/// How long a host may take to close a stream that is lost before it is left to a thread: word of the loss
/// waits for it, so that whoever opens the device again does not find it taken.
const CLOSING_LOST: Duration = Duration::from_millis(100);
/// The same for a stream that is dropped.
pub(crate) const CLOSING: Duration = Duration::from_millis(500);

/// What the stream, its watch and its owner share.
pub(crate) struct Shared {
    /// The streams of cpal, input first; empty when it is over.
    pub(crate) streams: Mutex<Vec<cpal::Stream>>,
    /// Since when it plays [ns]; 0 while it does not.
    pub(crate) playing_since: std::sync::atomic::AtomicU64,
    /// Why it was lost.
    pub(crate) lost: OnceLock<String>,
    /// Whether the watch is to end.
    pub(crate) done: std::sync::atomic::AtomicBool,
    /// Whether the time between calls says anything: not on a simulated card that is called by hand.
    pub(crate) timed: bool,
}

impl Shared {
    /// Closes the streams, on a thread of its own: a server that hangs would hold the caller.
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

/// One side of the stream, as the watch sees it.
pub(crate) struct Watched {
    pub(crate) counts: Arc<Counts>,
    /// From the data callback and from the error callback.
    pub(crate) messages: [HeapCons<Message>; 2],
    /// Errors, as water in a leaking bucket, and how many had been counted when it was last filled.
    pub(crate) bucket: f64,
    pub(crate) counted: u64,
}

impl Watched {
    pub(crate) fn new(counts: Arc<Counts>, messages: [HeapCons<Message>; 2]) -> Self {
        Self { counts, messages, bucket: 0.0, counted: 0 }
    }

    /// Takes what has come; answers why the stream is lost, if it is.
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

    /// Why it counts as lost, if it has not called for too long; the time before `since` does not count.
    fn silent(&self, now: u64, since: u64) -> Option<String> {
        let last = self.counts.last_ns.load(Relaxed);
        if last == 0 {
            let waited = now.saturating_sub(since);
            return (waited > FIRST_NS).then(|| {
                format!("the device is open and has not called once in {:.0} s", FIRST_NS as f64 / 1e9)
            });
        }
        let ten_periods =
            10 * u64::from(self.counts.longest()) * 1_000_000_000 / u64::from(self.counts.rate_hz.max(1));
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
    format!("what filled the device's blocks panicked: {}", text.as_deref().unwrap_or("no message"))
}

/// Tells a device that is silent from a machine that stood still: nobody calls while this thread cannot run
/// either.
#[derive(Default)]
struct Awake {
    looked: u64,
    since: u64,
}

impl Awake {
    /// Takes note of a look; answers since when this thread has looked without a pause [ns].
    fn look(&mut self, now: u64) -> u64 {
        if now.saturating_sub(self.looked) > STANDSTILL_NS {
            self.since = now;
        }
        self.looked = now;
        self.since
    }
}

/// Watches until the stream is lost or done.
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
        // Where nobody reads, what happened is in the counts.
        waiting.drain(..).for_each(|event| drop(events.try_send(event)));
        if let Some(reason) = lost {
            return lose(shared, &sides, reason, events);
        }
        std::thread::park_timeout(PERIOD);
    }
}

/// Waits until an output that still calls has faded and that is heard.
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

/// Closes the stream and says so, once.
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
