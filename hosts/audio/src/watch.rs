//! Watches a stream from a thread of its own, since hosts do not report everything.
//!
//! PulseAudio reports no underruns, and is silent when its server is stopped. ALSA over a killed Pulse
//! server reports 40,000 errors a second until the stream is dropped. So the watch times calls, counts
//! errors, and closes a lost stream at once.
//!
//! When a device goes away, PulseAudio and PipeWire move its stream to another one, at full level and
//! without notice; cpal cannot prevent it. So a second thread lists their devices repeatedly. Not detected:
//! a device that goes and comes back under its name between two looks, and a stream that a user moves.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;

use cpal::ErrorKind;
use cpal::traits::HostTrait;
use parking_lot::Mutex;
use ringbuf::HeapCons;
use ringbuf::traits::Consumer;

use crate::block::frames_ns;
use crate::bounded::hush_alsa;
use crate::callback::Counts;
use crate::hosts::{Listed, host_id};
use crate::now_ns;

/// Time between two looks.
const PERIOD: Duration = Duration::from_millis(5);
/// Time from one list of devices to the next.
const LISTS: Duration = Duration::from_millis(250);
/// Time without a call that is a loss, if it is also ten periods [ns].
const LOSS_NS: u64 = 1_000_000_000;
/// Longest time before the first call [ns].
const FIRST_NS: u64 = 2_000_000_000;
/// A longer time between two looks is a stall of the machine, on which this thread does not run either [ns].
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

/// State that the stream, its threads and its owner share.
#[derive(Default)]
pub(crate) struct Shared {
    /// cpal's streams, input first; empty when closed.
    pub(crate) streams: Mutex<Vec<cpal::Stream>>,
    /// Start of playing [ns]; 0 while it does not play.
    pub(crate) playing_since: AtomicU64,
    pub(crate) gone: OnceLock<String>,
    pub(crate) lost: OnceLock<String>,
    pub(crate) done: AtomicBool,
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
    pub(crate) errors: HeapCons<cpal::Error>,
    /// Leaky bucket of errors, and the count when it was last filled.
    pub(crate) bucket: f64,
    pub(crate) counted: u64,
}

impl Watched {
    /// Reads errors and counts; returns why the stream is lost, if it is.
    fn look(&mut self) -> Option<String> {
        if let Some(panic) = self.counts.panic.get() {
            return Some(format!("the process that fills the device's blocks panicked: {panic}"));
        }
        let mut last = String::new();
        for error in self.errors.pop_iter().filter(|error| error.kind() != ErrorKind::Xrun) {
            last = error.to_string();
            if is_loss(error.kind()) {
                return Some(last);
            }
        }
        let errors = self.counts.errors.load(Relaxed);
        self.bucket = (self.bucket - TOLERATED_HZ * PERIOD.as_secs_f64()).max(0.0);
        self.bucket += (errors - self.counted) as f64;
        self.counted = errors;
        (self.bucket > FLOOD).then(|| format!("a flood of errors: {last}"))
    }

    /// Why the device is lost by silence, if it is. The time before `since` does not count.
    fn silent(&self, now: u64, since: u64) -> Option<String> {
        let last = self.counts.last_ns.load(Relaxed);
        if last == 0 {
            let over = now.saturating_sub(since) > FIRST_NS;
            return over.then(|| "the device is open and has not called once in 2 s".to_owned());
        }
        let longest = u64::from(self.counts.recent().last().copied().unwrap_or(0));
        let silence = now.saturating_sub(last.max(since));
        let over = silence > LOSS_NS.max(frames_ns(10 * longest, self.counts.rate_hz));
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

/// Watches until the stream is lost or dropped. The first side is the output.
pub(crate) fn watch(shared: &Shared, mut sides: Vec<Watched>) {
    let (mut looked, mut awake_since) = (0, 0);
    while !shared.done.load(Relaxed) {
        let now = now_ns();
        awake_since = awake(now, looked, awake_since);
        looked = now;
        let playing_since = shared.playing_since.load(Relaxed);
        let timed = shared.timed && playing_since > 0;
        let since = playing_since.max(awake_since);
        let lost = sides
            .iter_mut()
            .find_map(|side| side.look().or_else(|| side.silent(now, since).filter(|_| timed)));
        if let Some(reason) = lost.or_else(|| shared.gone.get().cloned()) {
            sides.iter().for_each(|side| side.counts.over.store(true, Relaxed));
            fade(&sides[0].counts);
            shared.close(CLOSING_LOST);
            let _ = shared.lost.set(reason);
            return;
        }
        std::thread::park_timeout(PERIOD);
    }
}

/// Since when looks have come without a stall of the machine [ns].
fn awake(now: u64, looked: u64, since: u64) -> u64 {
    if now.saturating_sub(looked) > STANDSTILL_NS { now } else { since }
}

/// Waits until the fade of a calling output is heard.
fn fade(counts: &Counts) {
    let limit = FADING.as_nanos() as u64;
    let began = now_ns();
    let mut now = began;
    loop {
        let (faded, calls) = (counts.faded_ns.load(Relaxed), counts.last_ns.load(Relaxed));
        let most = if faded > 0 { 2 * limit } else { limit };
        if (faded > 0 && now > faded) || now.saturating_sub(calls) >= limit || now >= began + most {
            return;
        }
        std::thread::park_timeout(Duration::from_millis(1));
        now = now_ns();
    }
}

/// Lists devices by host and id until one is gone or the stream is over. A host that hangs blocks only this
/// thread. Each device keeps one connection: cpal does not always end the threads of a closed PulseAudio one.
pub(crate) fn call_roll(shared: &Shared, devices: Vec<(String, String)>) {
    let connect = |(name, id): (String, String)| {
        let host = host_id(&name).and_then(|id| cpal::host_from_id(id).ok())?;
        Some((host, name, id))
    };
    let devices: Vec<_> = devices.into_iter().filter_map(connect).collect();
    while shared.gone.get().is_none() {
        std::thread::sleep(LISTS);
        if shared.done.load(Relaxed) || shared.lost.get().is_some() {
            return;
        }
        if let Some((_, name, id)) = devices.iter().find(|(host, name, id)| is_gone(host, name, id)) {
            let _ = shared.gone.set(format!("the device is gone: {name}:{id}"));
        }
    }
}

/// Whether a host no longer has a device. One that does not answer counts as having it: the watch sees that
/// it does not call.
fn is_gone(host: &cpal::Host, name: &str, id: &str) -> bool {
    let anew;
    let host = if name == "pipewire" {
        // PipeWire's host lists its devices only when it is made.
        let Ok(made) = cpal::host_from_id(host.id()) else { return false };
        anew = made;
        &anew
    } else {
        host
    };
    let Ok(devices) = host.devices() else { return false };
    let defaults = [host.default_output_device(), host.default_input_device()];
    devices.chain(defaults.into_iter().flatten()).all(|device| Listed::new(name, device).id != id)
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
        Watched { counts: counts.clone(), errors: HeapRb::new(1).split().1, bucket: 0.0, counted: 0 }
    }

    #[test]
    fn stall_of_the_machine_is_no_loss_of_the_device() {
        let counts = Arc::new(Counts::new(48_000));
        let side = watched(&counts);
        counts.last_ns.store(ms(1000), Relaxed);
        let (mut looked, mut since) = (0, 0);
        let mut look = |now: u64| {
            since = awake(now, looked, since);
            looked = now;
            side.silent(now, since)
        };
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
