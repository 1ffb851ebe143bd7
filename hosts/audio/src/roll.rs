//! Checks whether a device is still there.
//!
//! When a device goes away, PulseAudio and PipeWire move its stream to another one, at full level and
//! without notice; cpal cannot prevent it. So their devices are listed repeatedly, beside the watch. Not
//! detected: a device that goes and comes back under its name between two looks, and a stream that a user
//! moves by hand.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use cpal::traits::HostTrait;

use crate::hosts::{Listed, host_id, is_mixer};

/// Time from one list to the next.
const PERIOD: Duration = Duration::from_millis(250);

/// Checks a stream's devices, on a thread of its own, until it is dropped. A host that hangs blocks only
/// that thread.
pub(crate) struct Roll {
    gone: Receiver<String>,
    /// Dropped with this, which ends the thread.
    _done: Sender<()>,
}

impl Roll {
    /// Checks devices by host and id; those of hosts that do not move streams are left out.
    pub(crate) fn new(devices: impl Iterator<Item = (String, String)>) -> std::io::Result<Self> {
        let devices: Vec<_> = devices.filter(|(host, _)| is_mixer(host)).collect();
        let (tell, gone) = channel();
        let (done, wait) = channel();
        if !devices.is_empty() {
            let thread = std::thread::Builder::new().name("audio roll".to_owned());
            thread.spawn(move || call(devices, &tell, &wait))?;
        }
        Ok(Self { gone, _done: done })
    }

    /// Message about a device that is gone, once. Never waits.
    pub(crate) fn look(&self) -> Option<String> {
        self.gone.try_recv().ok()
    }
}

/// Looks until a device is gone or the roll is dropped. Each device keeps one connection: cpal does not
/// always end the threads of a closed PulseAudio connection.
fn call(devices: Vec<(String, String)>, tell: &Sender<String>, wait: &Receiver<()>) {
    let connect = |(name, id): (String, String)| {
        let host = host_id(&name).and_then(|id| cpal::host_from_id(id).ok())?;
        Some((host, name, id))
    };
    let devices: Vec<_> = devices.into_iter().filter_map(connect).collect();
    while wait.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
        if let Some((_, name, id)) = devices.iter().find(|(host, name, id)| is_gone(host, name, id)) {
            // If the stream is lost already, nobody listens.
            let _ = tell.send(format!("the device is gone: {name}:{id}"));
            return;
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
