//! What a person may do to a run at any time, from any thread: mute it, stop it, ask for a change.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use parking_lot::Mutex;

use crate::view::Request;

/// Requests that may wait; of the same parameter or texture only the newest waits.
const REQUESTS: usize = 256;

/// A hand on a run; every clone is one on the same run.
///
/// Muting and stopping wait for nobody: every driver looks here in its own callback, so that the output
/// begins to fall with the next one, whatever the thread that made the run is doing. All else that is asked
/// for is kept until that thread takes it.
#[derive(Clone, Debug, Default)]
pub struct Reins(Arc<Held>);

#[derive(Debug, Default)]
struct Held {
    muted: AtomicBool,
    stopping: Arc<AtomicBool>,
    requests: Mutex<Vec<Request>>,
}

/// Why a request is not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unheard {
    /// 256 others wait: try again.
    Busy,
    /// The run is stopping.
    Over,
}

impl Reins {
    /// Reins of a run that is not muted. It is stopped by this flag too, which a handler of signals may set.
    pub fn stopped_by(flag: Arc<AtomicBool>) -> Self {
        Self(Arc::new(Held { stopping: flag, ..Held::default() }))
    }

    /// Ramps the output down within 15 ms, or up again. Ticks go on. It holds for a device that comes back,
    /// too.
    pub fn mute(&self, mute: bool) {
        self.0.muted.store(mute, Relaxed);
    }

    /// Mutes what is heard, and plays what is muted.
    pub fn toggle_mute(&self) {
        self.0.muted.fetch_not(Relaxed);
    }

    /// Whether the output is to be silent. Never waits.
    pub fn muted(&self) -> bool {
        self.0.muted.load(Relaxed)
    }

    /// Ramps the output down within 15 ms, for good; whoever made the run is to end it then.
    pub fn stop(&self) {
        self.0.stopping.store(true, Relaxed);
    }

    /// Whether the run is to end. Never waits.
    pub fn stopping(&self) -> bool {
        self.0.stopping.load(Relaxed)
    }

    /// Asks for a change. One that waits for the same parameter or texture is replaced.
    ///
    /// # Errors
    /// [`Unheard`] where it is not kept.
    pub fn ask(&self, request: Request) -> Result<(), Unheard> {
        if self.stopping() {
            return Err(Unheard::Over);
        }
        let mut requests = self.0.requests.lock();
        requests.retain(|waiting| !waiting.is_of_the_same(&request));
        if requests.len() >= REQUESTS {
            return Err(Unheard::Busy);
        }
        requests.push(request);
        Ok(())
    }

    /// What was asked for since this was last called, oldest first.
    pub fn asked(&self) -> Vec<Request> {
        std::mem::take(&mut *self.0.requests.lock())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(param: &str, value: f64) -> Request {
        Request::Set { node: "gain".into(), param: param.into(), value }
    }

    fn material(node: &str, name: &str) -> Request {
        Request::Material { node: node.into(), name: name.into() }
    }

    #[test]
    fn newer_request_replaces_an_older_one() {
        let reins = Reins::default();
        for request in [
            set("gain", 1.0),
            material("a", "felt"),
            set("offset", 2.0),
            material("b", "brick"),
            set("gain", 3.0),
            material("a", "cork"),
        ] {
            assert_eq!(reins.clone().ask(request), Ok(()));
        }
        let newest = [set("offset", 2.0), material("b", "brick"), set("gain", 3.0), material("a", "cork")];
        assert_eq!(reins.asked(), newest);
        assert_eq!(reins.asked(), []);
    }

    #[test]
    fn requests_are_bounded_and_end_with_the_run() {
        let flag = Arc::new(AtomicBool::new(false));
        let reins = Reins::stopped_by(flag.clone());
        let refused =
            (0..300).filter(|i| reins.ask(set(&format!("p{i}"), 0.0)) == Err(Unheard::Busy)).count();
        assert_eq!(refused, 300 - 256);
        assert_eq!(reins.ask(set("p7", 1.0)), Ok(()), "it takes the place of another");
        flag.store(true, Relaxed);
        assert!(reins.stopping());
        assert_eq!(reins.ask(set("p7", 2.0)), Err(Unheard::Over));
    }
}
