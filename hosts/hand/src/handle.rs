//! A running source, as other threads see it.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use asperity_live::{Sample, SampleWriter};
use parking_lot::Mutex;

use crate::HandError;
use crate::servo::passivity::DeviceDamping;

/// Problems that wait to be read; of more, the newest are lost.
const PROBLEMS: usize = 16;
/// Without a good message for so long, the bad ones are told.
const DEAF: Duration = Duration::from_secs(1);

/// What is known of the device behind a source.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Device {
    /// As its maker calls it, or its number; empty for none.
    pub name: String,
    /// Largest force that it is driven to \[N\]; 0 where it cannot push.
    pub max_force_n: f64,
    /// Largest stiffness that its maker recommends \[N/mm\], where it says so.
    pub max_stiffness_n_per_mm: Option<f64>,
}

impl Device {
    /// What is known of its damping, to be held against [`passivity`](crate::servo::passivity::passivity).
    pub fn damping(&self) -> DeviceDamping {
        self.max_stiffness_n_per_mm.map_or(DeviceDamping::Unknown, DeviceDamping::Recommended)
    }
}

/// A running source. Dropping it stops the source: a device's force is ramped down first; it takes at most
/// about 100 ms.
#[derive(Debug)]
pub struct Handle {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    address: Option<SocketAddr>,
}

/// Starts a source's thread.
///
/// # Errors
/// The system gives no thread.
pub(crate) fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, HandError> {
    Builder::new().name(name.to_owned()).spawn(run).map_err(|e| {
        HandError::missing(format!("no thread for `{name}`: {e}"), "free some memory or processes")
    })
}

impl Handle {
    pub(crate) fn new(shared: Arc<Shared>, thread: JoinHandle<()>, address: Option<SocketAddr>) -> Self {
        Self { shared, thread: Some(thread), address }
    }

    /// Samples sent to the tick thread so far.
    pub fn samples(&self) -> u64 {
        self.shared.samples.load(Relaxed)
    }

    /// Samples that found the queue to the tick thread full.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Relaxed)
    }

    /// Messages that could not be used: not of the format, of a wrong type, not finite.
    pub fn bad(&self) -> u64 {
        self.shared.bad.load(Relaxed)
    }

    /// What was wrong with the last of them, for a person.
    pub fn last_bad(&self) -> Option<String> {
        let text = self.shared.text.lock();
        (!text.bad.is_empty()).then(|| text.bad.clone())
    }

    /// Whether the device or the peer is there. A network source has no peer: then true while the socket is
    /// open.
    pub fn connected(&self) -> bool {
        self.shared.connected.load(Relaxed)
    }

    /// How often the device or the peer was lost.
    pub fn losses(&self) -> u64 {
        self.shared.losses.load(Relaxed)
    }

    /// Size of the force that the device was last told to make \[N\].
    pub fn force_n(&self) -> f64 {
        f64::from_bits(self.shared.force.load(Relaxed))
    }

    /// The oldest thing that went wrong while running and was not read yet; and that it goes again. Each is
    /// said once, and not again before the source has worked in between. The first message that cannot be
    /// used is told, and later ones where no good one came for a second.
    pub fn problem(&self) -> Option<String> {
        let (good, bad) = (self.samples() + self.lost(), self.bad());
        let mut text = self.shared.text.lock();
        text.problems.pop_front().or_else(|| text.unusable(good, bad, Instant::now()))
    }

    /// Where a network source listens: with port 0 asked for, the port that was given.
    pub fn address(&self) -> Option<SocketAddr> {
        self.address
    }

    /// What is known of the device.
    pub fn device(&self) -> Device {
        self.shared.text.lock().device.clone()
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.shared.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// What a source's threads and its handle both see. The counters may be touched from a servo callback; the
/// texts not.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    pub(crate) stop: AtomicBool,
    pub(crate) samples: AtomicU64,
    pub(crate) lost: AtomicU64,
    pub(crate) bad: AtomicU64,
    pub(crate) losses: AtomicU64,
    pub(crate) connected: AtomicBool,
    force: AtomicU64,
    text: Mutex<Text>,
}

#[derive(Debug, Default)]
struct Text {
    bad: String,
    problems: VecDeque<String>,
    /// The problem there is now.
    now: Option<String>,
    device: Device,
    heard: Heard,
}

/// What [`Handle::problem`] saw of the messages when it was asked last.
#[derive(Debug, Default)]
struct Heard {
    good: u64,
    bad: u64,
    /// When a good one was seen last.
    at: Option<Instant>,
    /// Whether the bad ones were told since.
    told: bool,
    /// Whether they were ever told.
    ever: bool,
}

impl Text {
    /// A line on messages that cannot be used, if it is to be said now.
    fn unusable(&mut self, good: u64, bad: u64, now: Instant) -> Option<String> {
        let heard = &mut self.heard;
        if good != heard.good {
            (heard.good, heard.at, heard.told) = (good, Some(now), false);
        }
        let more = bad > std::mem::replace(&mut heard.bad, bad);
        let deaf = !heard.ever || heard.at.is_none_or(|at| now.saturating_duration_since(at) >= DEAF);
        // A servo counts without a reason.
        if !more || !deaf || heard.told || self.bad.is_empty() {
            return None;
        }
        (heard.told, heard.ever) = (true, true);
        Some(format!("messages that cannot be used: {}", self.bad))
    }
}

impl Shared {
    /// Sends a sample and counts it.
    pub(crate) fn send(&self, writer: &mut SampleWriter, sample: Sample) {
        let counter = if writer.send(sample) { &self.samples } else { &self.lost };
        counter.fetch_add(1, Relaxed);
    }

    pub(crate) fn set_force(&self, force_n: f64) {
        self.force.store(force_n.to_bits(), Relaxed);
    }

    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Relaxed)
    }

    pub(crate) fn set_device(&self, device: Device) {
        self.text.lock().device = device;
    }

    /// Counts a message that could not be used.
    pub(crate) fn bad(&self, why: String) {
        self.bad.fetch_add(1, Relaxed);
        self.text.lock().bad = why;
    }

    /// Says what went wrong, unless that is what was said last.
    pub(crate) fn trouble(&self, what: String) {
        let mut text = self.text.lock();
        if text.now.as_ref() != Some(&what) {
            if text.problems.len() < PROBLEMS {
                text.problems.push_back(what.clone());
            }
            text.now = Some(what);
        }
    }

    /// It works; what went wrong before may be said again. `what` is told if something had gone wrong.
    pub(crate) fn well(&self, what: &str) {
        let mut text = self.text.lock();
        if text.now.take().is_some() && text.problems.len() < PROBLEMS {
            text.problems.push_back(what.to_owned());
        }
    }

    /// The device or the peer is there, or is gone.
    pub(crate) fn set_connected(&self, there: bool) {
        if self.connected.swap(there, Relaxed) && !there {
            self.losses.fetch_add(1, Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problem_is_reported_once_until_it_is_over() {
        let shared = Arc::new(Shared::default());
        let handle = Handle::new(shared.clone(), std::thread::spawn(|| {}), None);
        for _ in 0..100 {
            shared.trouble("gone".into());
        }
        assert_eq!(handle.problem().as_deref(), Some("gone"));
        assert_eq!(handle.problem(), None);
        shared.well("back");
        shared.well("back");
        shared.trouble("gone".into());
        assert_eq!(
            [handle.problem(), handle.problem(), handle.problem()],
            [Some("back".into()), Some("gone".into()), None]
        );
    }

    #[test]
    fn unusable_messages_are_reported_once_per_silence() {
        let mut text = Text { bad: "a text".into(), ..Text::default() };
        let begin = Instant::now();
        let mut said = |good, bad, ms| text.unusable(good, bad, begin + Duration::from_millis(ms));
        assert_eq!(said(0, 0, 0), None);
        assert_eq!(said(5, 1, 10).as_deref(), Some("messages that cannot be used: a text"), "the first");
        assert_eq!(said(5, 9, 5000), None, "once");
        assert_eq!(said(6, 10, 5010), None, "it works, if not always");
        assert_eq!(said(6, 11, 5900), None, "not for a second yet");
        assert_eq!(said(6, 11, 6100), None, "no more of them");
        assert!(said(6, 12, 6200).is_some(), "again");
        assert_eq!(said(6, 13, 9000), None);
    }

    #[test]
    fn unread_problems_are_bounded() {
        let shared = Shared::default();
        (0..1000).for_each(|i| shared.trouble(format!("problem {i}")));
        assert_eq!(shared.text.lock().problems.len(), PROBLEMS);
    }
}
