//! Haptic devices and OSC by the library's own interface, with stand-ins of the devices.

mod haply;
mod openhaptics;
mod osc;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use asperity_hand::Handle;
use asperity_live::{ForceModel, ForceWriter, Sample, SampleReader, now_ns};
use harness::live::{Background, until};

/// A floor of 0.5 N/mm at z = 0 of the graph, told anew every millisecond until dropped.
pub(crate) fn floor(mut to: ForceWriter) -> Background {
    Background::new(move |stop| {
        while !stop.load(Relaxed) {
            to.write(ForceModel {
                normal: [0.0, 0.0, 1.0],
                stiffness_n_per_mm: 0.5,
                max_force_n: 10.0,
                valid: true,
                time_ns: now_ns(),
                ..ForceModel::default()
            });
            std::thread::sleep(Duration::from_millis(1));
        }
    })
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

/// Builds a stand-in of the library for OpenHaptics devices.
#[cfg(unix)]
pub(crate) fn library(folder: &Path, source: &str, flag: &str) -> PathBuf {
    let library = folder.join("libHD.so");
    let done = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", flag, "-o"])
        .arg(&library)
        .arg(harness::root().join("tests/live/hand/standin").join(source))
        .args(["-lpthread", "-lm"])
        .status()
        .expect("a C compiler, `cc`");
    assert!(done.success());
    library
}
