//! An open device, and a process that plays silence until it is given another one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_audio::{Block, Capture, Captured, OpenError, Process, Request, Stream, open};
use parking_lot::{Mutex, MutexGuard};

use crate::dll::Dll;
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

/// Time at the start that does not count: a device fills its buffer first [ns].
const FILL_NS: u64 = 50_000_000;

/// Process that a device calls from its start on. Both sides take it by `try_lock` alone; the device plays a
/// block of silence while the control thread looks.
#[derive(Clone)]
pub(super) struct Switch(Arc<Mutex<Inside>>);

struct Inside {
    dll: Dll,
    began_ns: Option<u64>,
    process: Option<Box<dyn Process>>,
}

impl Switch {
    pub(super) fn new(rate_hz: u32) -> Self {
        Self(Arc::new(Mutex::new(Inside { dll: Dll::new(rate_hz), began_ns: None, process: None })))
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        loop {
            if let Some(it) = self.0.try_lock() {
                return it;
            }
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// Calls that were measured, and frames a wake-up (all calls of a bunch together); 0 for none.
    pub(super) fn heard(&self) -> (u64, u32) {
        let line = *self.lock().dll.line();
        (line.callbacks, line.period_frames as u32)
    }

    pub(super) fn give(&self, process: Box<dyn Process>) {
        self.lock().process = Some(process);
    }
}

impl Process for Switch {
    fn process(&mut self, block: &mut Block<'_>) {
        let Some(mut it) = self.0.try_lock() else { return };
        if let Some(process) = &mut it.process {
            process.process(block);
        } else if block.now_ns.saturating_sub(*it.began_ns.get_or_insert(block.now_ns)) > FILL_NS {
            it.dll.callback(block.now_ns, block.frames() as u64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Silence;

    impl Process for Silence {
        fn process(&mut self, _: &mut Block<'_>) {}
    }

    fn call(switch: &mut Switch, now_ns: u64, frames: u64) {
        let mut output = vec![1.0; frames as usize];
        switch.process(&mut Block { output: &mut output, channels: 1, now_ns });
    }

    /// A device that is awake every `every` frames, and then asks for as many calls of `frames` as have
    /// come due.
    #[test]
    fn bunched_calls_are_one_wake_up_and_first_fill_is_none() {
        for (every, frames, prefill, late, period) in [
            (128, 73, 292, None, 146),
            // 96 frames are a tick of 2 ms: a call fits, a wake-up of this device does not.
            (96, 64, 256, None, 128),
            (2048, 512, 4096, None, 2048),
            (64, 64, 256, None, 64),
            (64, 64, 64, Some(60), 64),
            (64, 64, 256, Some(60), 64),
            (16_384, 16_384, 16_384, None, 16_384),
        ] {
            let (mut switch, mut asked, mut now) = (Switch::new(48_000), 0, 1_000_000_000);
            for wake in 0..16 + 3_000 / every {
                let came = now + if late == Some(wake) { every * 20_000 } else { 0 };
                let calls = (wake * every + prefill - asked) / frames;
                (0..calls).for_each(|n| call(&mut switch, came + n * 5_000, frames));
                asked += calls * frames;
                now += every * 1_000_000_000 / 48_000;
            }
            let (calls, found) = switch.heard();
            let what = format!("{every} frames, calls of {frames}, {late:?}: {found}");
            assert!(calls >= 8 && (period - 2..=period).contains(&found), "{what}");
            switch.give(Box::new(Silence));
            call(&mut switch, now, 9 * frames);
            assert_eq!(switch.heard(), (calls, found), "it is given work");
        }
    }
}
