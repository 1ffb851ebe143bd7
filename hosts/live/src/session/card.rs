//! An open device.

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_audio::{Capture, Captured, OpenError, Process, Request, Stream, open};
use parking_lot::Mutex;

use super::switch::Switch;
use crate::player::MicWriter;
use crate::realtime::{ask_priority, touch_stack};

/// Longest wait for a closing device to play its buffer.
const PLAY_OUT: Duration = Duration::from_millis(500);
/// Margin on top of the device's own latency figure.
const MARGIN: Duration = Duration::from_millis(20);
/// Stack that the device's thread touches at its first callback.
const STACK: usize = 32_768;

/// An open device. It plays silence until it is given a process.
pub(super) struct Card {
    pub(super) stream: Stream,
    switch: Switch,
    pub(super) playing: bool,
    pub(super) opened: Instant,
}

/// Destination of recorded samples: the same for a device and for its replacement after a loss.
#[derive(Clone)]
pub(super) struct Recorder {
    to: Arc<Mutex<MicWriter>>,
    /// Priority that the device's thread still has to request.
    priority: Option<i32>,
}

impl Recorder {
    /// `priority`: requested by the thread of every device.
    pub(super) fn new(writer: MicWriter, priority: Option<i32>) -> Self {
        Self { to: Arc::new(Mutex::new(writer)), priority }
    }
}

impl Capture for Recorder {
    fn capture(&mut self, block: &Captured<'_>) {
        if let Some(priority) = self.priority.take() {
            // If this is refused, so are the requests of the ticking threads, which are reported.
            let _ = ask_priority(priority);
            touch_stack::<STACK>();
        }
        // Only a closing device may hold it. This thread never waits for it.
        if let Some(mut writer) = self.to.try_lock() {
            writer.capture(block);
        }
    }
}

impl Drop for Card {
    /// Waits until the last samples are heard: a closed device drops its buffer.
    fn drop(&mut self) {
        if self.playing && self.stream.lost().is_none() {
            let left = Duration::try_from_secs_f64(self.stream.stats().latency_ms * 1e-3).unwrap_or_default();
            std::thread::sleep((left + MARGIN).min(PLAY_OUT));
        }
    }
}

impl Card {
    /// Opens the requested device and starts it.
    pub(super) fn open(request: &Request, recorder: Option<&Recorder>) -> Result<Self, OpenError> {
        let switch = Switch::new(request.rate_hz);
        let capture = recorder.map(|r| Box::new(r.clone()) as Box<dyn Capture>);
        let stream = open(request, Box::new(switch.clone()), capture)?;
        stream.play().map_err(|reason| OpenError::refused(&stream.id(), reason))?;
        Ok(Self { stream, switch, playing: false, opened: Instant::now() })
    }

    pub(super) fn pinned(&self, request: &Request) -> Request {
        let (device, input_device) = (Some(self.stream.id()), self.stream.input_id());
        Request { host: None, device, input_device, ..request.clone() }
    }

    /// Calls that were measured, and frames a wake-up; 0 before the first call.
    pub(super) fn heard(&self) -> (u64, u32) {
        let (calls, frames) = self.switch.heard();
        (calls, frames.max(self.stream.period().unwrap_or(0)))
    }

    /// Whether its host may split a wake-up into several calls. JACK never does: calls in quick succession
    /// come from a late machine there.
    pub(super) fn bunches(&self) -> bool {
        matches!(self.stream.host(), "pulseaudio" | "pipewire" | "alsa")
    }

    /// Name of the device with its host, for a person.
    pub(super) fn name(&self) -> String {
        format!("{} ({})", self.stream.name(), self.stream.host())
    }

    pub(super) fn give(&mut self, process: impl Process + 'static) {
        self.switch.give(Box::new(process));
        self.playing = true;
    }
}
