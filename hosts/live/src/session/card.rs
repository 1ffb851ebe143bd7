//! A device while it is open.

use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use asperity_audio::{Capture, Captured, Event, OpenError, Process, Request, Stream, events, open};

use super::switch::{Give, switch};
use crate::player::MicWriter;

/// The longest that a device that is closed may take to play what it holds.
const PLAY_OUT: Duration = Duration::from_millis(500);
/// How much longer than it says a device may take to play what it holds.
const MARGIN: Duration = Duration::from_millis(20);

/// An open device, which plays silence until it is given something to play.
pub(super) struct Card {
    stream: Stream,
    events: Receiver<Event>,
    give: Give,
    playing: bool,
    opened: Instant,
}

/// Where what is recorded goes: the same place for a device and for the one that is opened after it was lost.
#[derive(Clone)]
pub(super) struct Recorder(Arc<Mutex<MicWriter>>);

impl Recorder {
    pub(super) fn new(writer: MicWriter) -> Self {
        Self(Arc::new(Mutex::new(writer)))
    }
}

impl Capture for Recorder {
    fn capture(&mut self, block: &Captured<'_>) {
        // Nobody holds it but a device that is being closed; it is never waited for.
        if let Ok(mut writer) = self.0.try_lock() {
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
        stream.play().map_err(|reason| OpenError::Refused { device: stream.id(), reason })?;
        Ok(Self { stream, events, give, playing: false, opened: Instant::now() })
    }

    /// The request for exactly this device.
    pub(super) fn pinned(&self, request: &Request) -> Request {
        let (device, input_device) = (Some(self.stream.id()), self.stream.input_id());
        Request { host: None, device, input_device, ..request.clone() }
    }

    pub(super) fn stream(&self) -> &Stream {
        &self.stream
    }

    /// The device for a person, with its host.
    pub(super) fn name(&self) -> String {
        format!("{} ({})", self.stream.name(), self.stream.host())
    }

    pub(super) fn since(&self) -> Duration {
        self.opened.elapsed()
    }

    pub(super) fn playing(&self) -> bool {
        self.playing
    }

    pub(super) fn note_playing(&mut self) {
        self.playing = true;
    }

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
