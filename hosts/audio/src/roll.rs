//! Whether a device is still there.
//!
//! PulseAudio and PipeWire move a stream whose device goes away to another one, at full level and without a word; cpal cannot ask
//! them not to. So their devices are listed again and again, beside the watch. A device that goes and comes back under its name
//! between two looks is not missed, nor is a stream that a user moves by hand.

use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::Duration;

use crate::hosts::list;

/// Time from one answer to the next question.
const PERIOD: Duration = Duration::from_millis(250);

/// Hosts that move streams.
const MOVERS: [&str; 2] = ["pulseaudio", "pipewire"];

/// Calls the roll of the devices that a stream has open.
pub(crate) struct Roll {
    /// Host and id of each.
    devices: Vec<(String, String)>,
    /// When to ask again [ns].
    next_ns: u64,
    asked: Option<Receiver<Option<String>>>,
}

impl Roll {
    /// Of devices by host and id; those of hosts that do not move streams are left out.
    pub(crate) fn new(devices: impl Iterator<Item = (String, String)>) -> Self {
        let devices = devices.filter(|(host, _)| MOVERS.contains(&host.as_str())).collect();
        Self { devices, next_ns: 0, asked: None }
    }

    /// Answers which device is gone, once one is. Never waits: a thread asks, one at a time, and a host that hangs keeps it.
    pub(crate) fn look(&mut self, now: u64) -> Option<String> {
        if let Some(asked) = &self.asked {
            let answer = asked.try_recv();
            if answer == Err(TryRecvError::Empty) {
                return None;
            }
            self.asked = None;
            self.next_ns = now + PERIOD.as_nanos() as u64;
            return answer.ok().flatten();
        }
        if !self.devices.is_empty() && now >= self.next_ns {
            let (tell, asked) = channel();
            let devices = self.devices.clone();
            self.asked = Some(asked);
            let thread = std::thread::Builder::new().name("audio roll".to_owned());
            // Where there is no thread, the next look tries again; nobody may wait for the answer any more.
            let _ = thread.spawn(move || drop(tell.send(missing(&devices))));
        }
        None
    }
}

/// The first device that its host does not list. One whose host does not answer is not missed: the watch sees that it does not call.
fn missing(devices: &[(String, String)]) -> Option<String> {
    let gone = |(host, id): &&(String, String)| {
        list(host).is_ok_and(|listed| listed.iter().all(|one| one.id != *id))
    };
    devices.iter().find(gone).map(|(host, id)| format!("the device is gone: {host}:{id}"))
}
