//! Helpers of the tests of all devices.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread::JoinHandle;
use std::time::Duration;

use asperity_hand::Handle;
use asperity_live::{ForceModel, ForceWriter, Sample, SampleReader, now_ns};
use harness::live::until;

/// A floor at z = 0 of the graph, told anew every millisecond until dropped.
pub(crate) struct Floor(Arc<AtomicBool>, Option<JoinHandle<()>>);

impl Floor {
    /// Stiffness in N/mm.
    pub(crate) fn tell(mut to: ForceWriter, stiffness: f64) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = stop.clone();
        let thread = std::thread::spawn(move || {
            while !seen.load(Relaxed) {
                to.write(ForceModel {
                    normal: [0.0, 0.0, 1.0],
                    stiffness_n_per_mm: stiffness,
                    max_force_n: 10.0,
                    valid: true,
                    time_ns: now_ns(),
                    ..ForceModel::default()
                });
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        Self(stop, Some(thread))
    }
}

impl Drop for Floor {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
        self.1.take().unwrap().join().unwrap();
    }
}

pub(crate) fn newest(from: &mut SampleReader) -> Option<Sample> {
    std::iter::from_fn(|| from.take()).last()
}

pub(crate) fn problem(handle: &Handle) -> String {
    let mut said = None;
    until("a problem", || {
        said = handle.problem();
        said.is_some()
    });
    said.unwrap()
}
