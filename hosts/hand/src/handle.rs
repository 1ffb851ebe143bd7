//! A running source, for other threads.

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use asperity_live::{Sample, SampleWriter};
use asperity_node::Diagnostic;
use parking_lot::Mutex;

/// Most unread problems; newer ones are dropped.
const PROBLEMS: usize = 16;
/// After this time without a usable message, unusable ones are reported.
const DEAF: Duration = Duration::from_secs(1);

/// A running source. Dropping it stops the source within about 100 ms; a device's force ramps down first.
#[derive(Debug)]
pub struct Handle {
    shared: Arc<Shared>,
    /// `None` for a thread that is not waited for.
    pub(crate) thread: Option<JoinHandle<()>>,
    address: Option<SocketAddr>,
}

impl Handle {
    /// Starts a source's thread. Error: the system gives no thread.
    pub(crate) fn start(
        name: &str,
        shared: Arc<Shared>,
        address: Option<SocketAddr>,
        run: impl FnOnce() + Send + 'static,
    ) -> Result<Self, Diagnostic> {
        let thread = Builder::new().name(name.to_owned()).spawn(run).map_err(|e| {
            crate::error(format!("no thread for `{name}`: {e}"), "free some memory or processes")
        })?;
        Ok(Self { shared, thread: Some(thread), address })
    }

    /// Samples sent to the tick thread so far.
    pub fn samples(&self) -> u64 {
        self.shared.samples.load(Relaxed)
    }

    /// Samples lost because the queue to the tick thread was full.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Relaxed)
    }

    /// Unusable messages: wrong format, wrong type, not finite.
    pub fn bad(&self) -> u64 {
        self.shared.bad.load(Relaxed)
    }

    /// Why the last of them was unusable, for a person.
    pub fn last_bad(&self) -> Option<String> {
        Some(self.shared.text.lock().bad.clone()).filter(|why| !why.is_empty())
    }

    /// Oldest unread problem, or the notice of its end. Each is reported once, and again only after the
    /// source has worked in between. Unusable messages are reported at the first one, and later after a
    /// second without a usable one.
    pub fn problem(&self) -> Option<String> {
        let (good, bad) = (self.samples() + self.lost(), self.bad());
        let mut text = self.shared.text.lock();
        text.problems.pop_front().or_else(|| text.unusable(good, bad, Instant::now()))
    }

    /// Address where a network source listens, with the actual port if port 0 was requested.
    pub fn address(&self) -> Option<SocketAddr> {
        self.address
    }

    /// Largest stiffness that the device's maker recommends \[N/mm\], if any.
    pub fn max_stiffness_n_per_mm(&self) -> Option<f64> {
        self.shared.text.lock().max_stiffness_n_per_mm
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

/// State that a source's threads share with its handle. A servo callback may touch the counters, but not
/// the texts.
#[derive(Debug, Default)]
pub(crate) struct Shared {
    stop: AtomicBool,
    pub(crate) samples: AtomicU64,
    lost: AtomicU64,
    pub(crate) bad: AtomicU64,
    text: Mutex<Text>,
}

#[derive(Debug, Default)]
struct Text {
    /// Why the last unusable message was unusable.
    bad: String,
    problems: VecDeque<String>,
    now: Option<String>,
    max_stiffness_n_per_mm: Option<f64>,
    /// Usable and unusable messages as of the last [`Handle::problem`].
    heard: [u64; 2],
    /// Time of the last usable one.
    heard_at: Option<Instant>,
    /// Whether unusable ones were reported since, and ever.
    told: [bool; 2],
}

impl Text {
    fn push(&mut self, problem: String) {
        if self.problems.len() < PROBLEMS {
            self.problems.push_back(problem);
        }
    }

    /// Report of unusable messages, if it is due.
    fn unusable(&mut self, good: u64, bad: u64, now: Instant) -> Option<String> {
        let [before, bad_before] = std::mem::replace(&mut self.heard, [good, bad]);
        if good != before {
            (self.heard_at, self.told[0]) = (Some(now), false);
        }
        let deaf = !self.told[1] || self.heard_at.is_none_or(|at| now.saturating_duration_since(at) >= DEAF);
        // A servo counts them without a reason.
        if bad <= bad_before || !deaf || self.told[0] || self.bad.is_empty() {
            return None;
        }
        self.told = [true; 2];
        Some(format!("messages that cannot be used: {}", self.bad))
    }
}

impl Shared {
    pub(crate) fn send(&self, writer: &mut SampleWriter, sample: Sample) {
        let counter = if writer.send(sample) { &self.samples } else { &self.lost };
        counter.fetch_add(1, Relaxed);
    }

    pub(crate) fn stopped(&self) -> bool {
        self.stop.load(Relaxed)
    }

    pub(crate) fn recommends(&self, n_per_mm: Option<f64>) {
        self.text.lock().max_stiffness_n_per_mm = n_per_mm;
    }

    pub(crate) fn bad(&self, why: String) {
        self.bad.fetch_add(1, Relaxed);
        self.text.lock().bad = why;
    }

    /// Reports a problem, unless it is the current one.
    pub(crate) fn trouble(&self, what: String) {
        let mut text = self.text.lock();
        if text.now.as_ref() != Some(&what) {
            text.push(what.clone());
            text.now = Some(what);
        }
    }

    /// Reports a remark on a source that works.
    pub(crate) fn note(&self, what: String) {
        self.text.lock().push(what);
    }

    /// Ends the current problem, and reports `what` if there was one.
    pub(crate) fn well(&self, what: &str) {
        let mut text = self.text.lock();
        if text.now.take().is_some() {
            text.push(what.to_owned());
        }
    }

    /// Tries until `open` succeeds or the source stops, with a pause before each attempt.
    pub(crate) fn reopen<T>(&self, pause: Duration, mut open: impl FnMut() -> Option<T>) -> Option<T> {
        while !self.stopped() {
            std::thread::park_timeout(pause);
            if !self.stopped()
                && let Some(again) = open()
            {
                return Some(again);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problem_is_reported_once_until_it_is_over() {
        let shared = Arc::new(Shared::default());
        let handle = Handle::start("test", shared.clone(), None, || {}).unwrap();
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
