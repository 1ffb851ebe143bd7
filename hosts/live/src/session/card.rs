//! A device while it is open.

use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use asperity_audio::{Capture, Captured, Event, OpenError, Process, Request, Stream, events, open};

use super::switch::{Give, switch};
use crate::driver::Slot;
use crate::player::MicWriter;
use crate::realtime::{ask_priority, touch_stack};

/// The longest that a device that is closed may take to play what it holds.
const PLAY_OUT: Duration = Duration::from_millis(500);
/// How much longer than it says a device may take to play what it holds.
const MARGIN: Duration = Duration::from_millis(20);

/// An open device, which plays silence until it is given something to play.
pub(super) struct Card {
    pub(super) stream: Stream,
    events: Receiver<Event>,
    give: Give,
    /// Whether its driver has begun.
    pub(super) playing: bool,
    pub(super) opened: Instant,
}

/// Where what is recorded goes: the same place for a device and for the one that is opened after it was lost.
#[derive(Clone)]
pub(super) struct Recorder {
    to: Arc<Slot<MicWriter>>,
    /// What the device's thread is still to ask for.
    priority: Option<i32>,
}

/// Stack that is brought in at the first callback.
const STACK: usize = 32_768;

impl Recorder {
    /// With the priority that every device's thread asks for.
    pub(super) fn new(writer: MicWriter, priority: Option<i32>) -> Self {
        Self { to: Arc::new(Slot::new(writer)), priority }
    }
}

impl Capture for Recorder {
    fn capture(&mut self, block: &Captured<'_>) {
        if let Some(priority) = self.priority.take() {
            // Where it is refused, so it is to the threads whose answer is told.
            let _ = ask_priority(priority);
            touch_stack::<STACK>();
        }
        // Nobody holds it but a device that is being closed; it is never waited for, and a panic there does
        // not end it here.
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
    /// Opens the device that is asked for, and starts it.
    pub(super) fn open(request: &Request, recorder: Option<&Recorder>) -> Result<Self, OpenError> {
        let (give, switch) = switch();
        let (to, events) = events();
        let capture = recorder.map(|r| Box::new(r.clone()) as Box<dyn Capture>);
        let stream = open(request, Box::new(switch), capture, to)?;
        give.listen(stream.rate_hz());
        stream.play().map_err(|reason| OpenError::Refused { device: stream.id(), reason })?;
        Ok(Self { stream, events, give, playing: false, opened: Instant::now() })
    }

    /// The request for exactly this device.
    pub(super) fn pinned(&self, request: &Request) -> Request {
        let (device, input_device) = (Some(self.stream.id()), self.stream.input_id());
        Request { host: None, device, input_device, ..request.clone() }
    }

    /// Wake-ups that were listened to, and frames that one asks for as far as is known: 0 before the first
    /// call.
    pub(super) fn wakes(&self) -> (u64, u32) {
        let (wakes, frames) = self.give.heard();
        (wakes, frames.max(self.stream.period().unwrap_or(0)))
    }

    /// Whether its host may cut what one wake-up asks for into several calls. JACK never does: there, calls
    /// that come at once are a machine that was late, and say nothing of the period.
    pub(super) fn bunches(&self) -> bool {
        matches!(self.stream.host(), "pulseaudio" | "pipewire" | "alsa")
    }

    /// The device for a person, with its host.
    pub(super) fn name(&self) -> String {
        format!("{} ({})", self.stream.name(), self.stream.host())
    }

    /// Gives the device what it plays.
    pub(super) fn give(&mut self, process: Box<dyn Process>) {
        self.give.give(process);
    }

    /// Waits until what was played last is heard: a device that is closed drops what it still holds.
    fn play_out(&self) {
        if self.playing && self.stream.lost().is_none() {
            let left = Duration::try_from_secs_f64(self.stream.stats().latency_ms * 1e-3).unwrap_or_default();
            std::thread::sleep((left + MARGIN).min(PLAY_OUT));
        }
    }

    /// Why the device is lost, if it is. What else it said is counted by the stream itself.
    pub(super) fn lost(&mut self) -> Option<String> {
        let lost = self.events.try_iter().find_map(|e| match e {
            Event::Lost { reason } => Some(reason),
            _ => None,
        });
        lost.or_else(|| self.stream.lost().map(str::to_owned))
    }
}
