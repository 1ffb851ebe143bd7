//! An open device.

use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use asperity_audio::{Capture, Captured, Event, OpenError, Process, Request, Stream, events, open};

use super::switch::{Give, switch};
use crate::driver::Slot;
use crate::player::MicWriter;
use crate::realtime::{ask_priority, touch_stack};

/// Longest wait for a closing device to play its buffer.
const PLAY_OUT: Duration = Duration::from_millis(500);
/// Margin on top of the device's own latency figure.
const MARGIN: Duration = Duration::from_millis(20);

/// An open device. It plays silence until it is given a process.
pub(super) struct Card {
    pub(super) stream: Stream,
    events: Receiver<Event>,
    give: Give,
    /// Whether its driver has begun.
    pub(super) playing: bool,
    pub(super) opened: Instant,
}

/// Destination of recorded samples: the same for a device and for its replacement after a loss.
#[derive(Clone)]
pub(super) struct Recorder {
    to: Arc<Slot<MicWriter>>,
    /// Priority that the device's thread still has to request.
    priority: Option<i32>,
}

/// Stack that the device's thread touches at its first callback.
const STACK: usize = 32_768;

impl Recorder {
    /// `priority`: requested by the thread of every device.
    pub(super) fn new(writer: MicWriter, priority: Option<i32>) -> Self {
        Self { to: Arc::new(Slot::new(writer)), priority }
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
        if let Some(Some(writer)) = self.to.enter().as_deref_mut() {
            writer.capture(block);
        }
    }
}

impl Drop for Card {
    fn drop(&mut self) {
        self.play_out();
    }
}

impl Card {
    /// Opens the requested device and starts it.
    pub(super) fn open(request: &Request, recorder: Option<&Recorder>) -> Result<Self, OpenError> {
        let (give, switch) = switch();
        let (to, events) = events();
        let capture = recorder.map(|r| Box::new(r.clone()) as Box<dyn Capture>);
        let stream = open(request, Box::new(switch), capture, to)?;
        give.listen(stream.rate_hz());
        stream.play().map_err(|reason| OpenError::Refused { device: stream.id(), reason })?;
        Ok(Self { stream, events, give, playing: false, opened: Instant::now() })
    }

    /// Request for exactly this device.
    pub(super) fn pinned(&self, request: &Request) -> Request {
        let (device, input_device) = (Some(self.stream.id()), self.stream.input_id());
        Request { host: None, device, input_device, ..request.clone() }
    }

    /// Wake-ups so far, and frames a wake-up; 0 before the first call.
    pub(super) fn wakes(&self) -> (u64, u32) {
        let (wakes, frames) = self.give.heard();
        (wakes, frames.max(self.stream.period().unwrap_or(0)))
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

    /// Gives the device what it plays.
    pub(super) fn give(&mut self, process: Box<dyn Process>) {
        self.give.give(process);
    }

    /// Waits until the last samples are heard: a closed device drops its buffer.
    fn play_out(&self) {
        if self.playing && self.stream.lost().is_none() {
            let left = Duration::try_from_secs_f64(self.stream.stats().latency_ms * 1e-3).unwrap_or_default();
            std::thread::sleep((left + MARGIN).min(PLAY_OUT));
        }
    }

    /// Why the device is lost, if it is. The stream itself counts other events.
    pub(super) fn lost(&mut self) -> Option<String> {
        let lost = self.events.try_iter().find_map(|e| match e {
            Event::Lost { reason } => Some(reason),
            _ => None,
        });
        lost.or_else(|| self.stream.lost().map(str::to_owned))
    }
}
