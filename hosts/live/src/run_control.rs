//! Control of a run from any thread: mute it, stop it, request a change.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use parking_lot::Mutex;

use crate::view::Request;

/// Most requests that may wait. A newer one of the same parameter or texture replaces an older one.
const REQUESTS: usize = 256;

/// Control of a run; every clone controls the same run.
///
/// Muting and stopping never wait: every driver reads them in its next callback, whatever the control
/// thread is doing. Requests wait until the control thread takes them.
#[derive(Clone, Debug, Default)]
pub struct RunControl(Arc<Held>);

#[derive(Debug)]
struct Held {
    muted: AtomicBool,
    /// Bits of an f32.
    strength: AtomicU32,
    stopping: Arc<AtomicBool>,
    requests: Mutex<Vec<Request>>,
}

impl Default for Held {
    fn default() -> Self {
        Self {
            muted: AtomicBool::default(),
            strength: AtomicU32::new(1.0_f32.to_bits()),
            stopping: Arc::default(),
            requests: Mutex::default(),
        }
    }
}

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unheard {
    /// 256 others wait. Try again later.
    Busy,
    /// The run is stopping.
    Over,
}

impl std::fmt::Display for Unheard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if *self == Self::Busy { "The run is busy. Try again." } else { "The run has ended." })
    }
}

impl RunControl {
    /// Control of a run that is not muted. The flag stops it too; a signal handler may set it.
    pub fn stopped_by(flag: Arc<AtomicBool>) -> Self {
        Self(Arc::new(Held { stopping: flag, ..Held::default() }))
    }

    /// Mutes the output within 15 ms, or unmutes it. Ticks go on. A device that comes back stays muted.
    pub fn mute(&self, mute: bool) {
        self.0.muted.store(mute, Relaxed);
    }

    /// Mutes an audible run, unmutes a muted one.
    pub fn toggle_mute(&self) {
        self.0.muted.fetch_not(Relaxed);
    }

    /// Whether the output is to be silent. Never waits.
    pub fn muted(&self) -> bool {
        self.0.muted.load(Relaxed)
    }

    /// Sets the strength of the output from 0 to 1: a factor before every limiter, which it reaches within
    /// 20 ms. Limits stay the same.
    pub fn set_strength(&self, strength: f32) {
        let strength = if strength.is_nan() { 0.0 } else { strength.clamp(0.0, 1.0) };
        self.0.strength.store(strength.to_bits(), Relaxed);
    }

    /// The strength of the output; at first 1. Never waits.
    pub fn strength(&self) -> f32 {
        f32::from_bits(self.0.strength.load(Relaxed))
    }

    /// Ramps the output down within 15 ms, for good. The owner of the run must end it then.
    pub fn stop(&self) {
        self.0.stopping.store(true, Relaxed);
    }

    /// Whether the run is to end. Never waits.
    pub fn stopping(&self) -> bool {
        self.0.stopping.load(Relaxed)
    }

    /// Requests a change. It replaces one that waits for the same parameter or texture.
    ///
    /// # Errors
    /// [`Unheard`] says why it is refused.
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

    /// Takes the requests since the last call, oldest first.
    pub fn asked(&self) -> Vec<Request> {
        std::mem::take(&mut *self.0.requests.lock())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strength_stays_within_0_and_1() {
        let run_control = RunControl::default();
        assert_eq!(run_control.strength(), 1.0);
        for (asked, is) in [(0.4, 0.4), (7.0, 1.0), (-1.0, 0.0), (f32::NAN, 0.0), (f32::INFINITY, 1.0)] {
            run_control.set_strength(asked);
            assert_eq!(run_control.strength(), is, "{asked}");
        }
    }

    fn set(param: &str, value: f64) -> Request {
        Request::Set { node: "gain".into(), param: param.into(), value }
    }

    fn material(node: &str, name: &str) -> Request {
        Request::Material { node: node.into(), name: name.into() }
    }

    #[test]
    fn newer_request_replaces_an_older_one() {
        let run_control = RunControl::default();
        for request in [
            set("gain", 1.0),
            material("a", "felt"),
            set("offset", 2.0),
            material("b", "brick"),
            set("gain", 3.0),
            material("a", "cork"),
        ] {
            assert_eq!(run_control.clone().ask(request), Ok(()));
        }
        let newest = [set("offset", 2.0), material("b", "brick"), set("gain", 3.0), material("a", "cork")];
        assert_eq!(run_control.asked(), newest);
        assert_eq!(run_control.asked(), []);
    }

    #[test]
    fn requests_are_bounded_and_end_with_the_run() {
        let flag = Arc::new(AtomicBool::new(false));
        let run_control = RunControl::stopped_by(flag.clone());
        let refused =
            (0..300).filter(|i| run_control.ask(set(&format!("p{i}"), 0.0)) == Err(Unheard::Busy)).count();
        assert_eq!(refused, 300 - 256);
        assert_eq!(run_control.ask(set("p7", 1.0)), Ok(()), "it takes the place of another");
        flag.store(true, Relaxed);
        assert!(run_control.stopping());
        assert_eq!(run_control.ask(set("p7", 2.0)), Err(Unheard::Over));
    }
}
