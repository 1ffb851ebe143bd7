//! Control of a run from any thread: mute it, stop it, request a change, leave a marker.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use parking_lot::Mutex;

use crate::view::{By, Change, Request};

/// Most requests that may wait. A newer one of the same parameter or texture replaces an older one.
const REQUESTS: usize = 256;
/// Most changes and markers that a run lists.
const CHANGES: usize = 100_000;

/// Control of a run; every clone controls the same run.
///
/// Muting and stopping never wait: every driver reads them in its next callback, whatever the control
/// thread is doing. Other requests wait until the control thread takes them. Each change that was carried out
/// is listed with its tick.
#[derive(Clone, Debug, Default)]
pub struct RunControl(Arc<Held>);

#[derive(Debug)]
struct Held {
    muted: AtomicBool,
    /// Bits of an f32.
    strength: AtomicU32,
    stopping: Arc<AtomicBool>,
    requests: Mutex<Vec<(Request, By)>>,
    /// The next tick, and ticks a second.
    tick: AtomicU64,
    tick_hz: AtomicU32,
    changes: Mutex<Vec<Change>>,
}

impl Default for Held {
    fn default() -> Self {
        Self {
            muted: AtomicBool::default(),
            strength: AtomicU32::new(1.0_f32.to_bits()),
            stopping: Arc::default(),
            requests: Mutex::default(),
            tick: AtomicU64::default(),
            tick_hz: AtomicU32::new(1),
            changes: Mutex::default(),
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
    /// The report has room for no more markers.
    Full,
}

impl std::fmt::Display for Unheard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Busy => "the run is busy: try again",
            Self::Over => "the run has ended",
            Self::Full => "the report is full: it lists 100,000 changes and markers",
        })
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

    /// Requests a change. One of a parameter or a texture waits for the control thread, and replaces one that
    /// waits for the same. Any other is carried out at once: it is listed and returned.
    ///
    /// # Errors
    /// [`Unheard`] says why it is refused.
    pub fn ask(&self, request: Request, by: &By) -> Result<Option<Change>, Unheard> {
        if self.stopping() {
            return Err(Unheard::Over);
        }
        let what = match request {
            Request::Set { .. } | Request::Material { .. } => return self.wait(request, by).map(|()| None),
            Request::Mute(mute) => {
                self.mute(mute);
                format!("mute {mute}")
            }
            Request::Strength(strength) => {
                self.set_strength(strength);
                format!("gain {}", self.strength())
            }
            Request::Marker(_) if self.0.changes.lock().len() >= CHANGES => return Err(Unheard::Full),
            Request::Marker(text) => format!("marker {text}"),
            Request::Stop => "stop".to_owned(),
        };
        let change = self.list(what, &by.name);
        if change.what == "stop" {
            self.stop();
        }
        Ok(Some(change))
    }

    fn wait(&self, request: Request, by: &By) -> Result<(), Unheard> {
        let mut requests = self.0.requests.lock();
        requests.retain(|(waiting, _)| !waiting.is_of_the_same(&request));
        if requests.len() >= REQUESTS {
            return Err(Unheard::Busy);
        }
        requests.push((request, by.clone()));
        Ok(())
    }

    /// Takes the requests since the last call, oldest first.
    pub fn asked(&self) -> Vec<(Request, By)> {
        std::mem::take(&mut *self.0.requests.lock())
    }

    /// Lists a change that was carried out just now. A list that is full stays as it is.
    pub fn list(&self, what: String, by: &str) -> Change {
        let tick = self.0.tick.load(Relaxed);
        let at_s = tick as f64 / f64::from(self.0.tick_hz.load(Relaxed));
        let change = Change { tick, at_s, what, by: by.to_owned() };
        let mut changes = self.0.changes.lock();
        if changes.len() < CHANGES {
            changes.push(change.clone());
        }
        change
    }

    /// Changes and markers after the first `known`, oldest first.
    pub fn changes(&self, known: usize) -> Vec<Change> {
        self.0.changes.lock().get(known..).unwrap_or_default().to_vec()
    }

    /// Notes the number of the next tick. Tick thread.
    pub(crate) fn comes_to(&self, tick: u64) {
        self.0.tick.store(tick, Relaxed);
    }

    /// Notes how many ticks a second there are. Before the run.
    pub(crate) fn ticks_at(&self, tick_hz: u32) {
        self.0.tick_hz.store(tick_hz.max(1), Relaxed);
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

    fn ask(run_control: &RunControl, request: Request) -> Result<Option<Change>, Unheard> {
        run_control.ask(request, &By::name("somebody"))
    }

    fn waiting(run_control: &RunControl) -> Vec<Request> {
        run_control.asked().into_iter().map(|(request, _)| request).collect()
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
            assert_eq!(ask(&run_control.clone(), request), Ok(None));
        }
        let newest = [set("offset", 2.0), material("b", "brick"), set("gain", 3.0), material("a", "cork")];
        assert_eq!(waiting(&run_control), newest);
        assert_eq!(waiting(&run_control), []);
    }

    #[test]
    fn requests_are_bounded_and_end_with_the_run() {
        let flag = Arc::new(AtomicBool::new(false));
        let run_control = RunControl::stopped_by(flag.clone());
        let busy = |i: &i32| ask(&run_control, set(&format!("p{i}"), 0.0)) == Err(Unheard::Busy);
        assert_eq!((0..300).filter(busy).count(), 300 - 256);
        assert_eq!(ask(&run_control, set("p7", 1.0)), Ok(None), "it takes the place of another");
        flag.store(true, Relaxed);
        assert!(run_control.stopping());
        assert_eq!(ask(&run_control, set("p7", 2.0)), Err(Unheard::Over));
        assert_eq!(ask(&run_control, Request::Marker("late".into())), Err(Unheard::Over));
    }

    #[test]
    fn immediate_requests_act_and_are_listed_with_their_tick() {
        let run_control = RunControl::default();
        run_control.ticks_at(500);
        let requests =
            [Request::Mute(true), Request::Strength(2.0), Request::Marker("trial 3".into()), Request::Stop];
        for (tick, request) in (0..).zip(requests) {
            run_control.comes_to(100 * tick);
            assert!(ask(&run_control, request).is_ok_and(|change| change.is_some()));
        }
        let listed = run_control.changes(0);
        let told: Vec<_> = listed.iter().map(|c| (c.tick, c.at_s, &*c.what)).collect();
        assert_eq!(
            told,
            [(0, 0.0, "mute true"), (100, 0.2, "gain 1"), (200, 0.4, "marker trial 3"), (300, 0.6, "stop")]
        );
        assert!(run_control.muted() && run_control.stopping() && listed[0].by == "somebody");
        assert_eq!((run_control.changes(3).len(), run_control.changes(4).len()), (1, 0));
    }

    #[test]
    fn full_list_of_changes_takes_no_marker_and_still_mutes() {
        let run_control = RunControl::default();
        (0..CHANGES).for_each(|_| drop(run_control.list("set a.b 1".into(), "a")));
        assert_eq!(ask(&run_control, Request::Marker("x".into())), Err(Unheard::Full));
        assert!(ask(&run_control, Request::Mute(true)).is_ok() && run_control.muted());
        assert_eq!(run_control.changes(0).len(), CHANGES);
    }
}
