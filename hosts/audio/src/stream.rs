//! A device that plays.
//!
//! The latency that a host reports ([`Stats::latency_ms`] of output and input), at 48 kHz, against the
//! measured time in a loop from output to input:
//!
//! | host | frames a call | output [ms] | input [ms] | loop [ms] |
//! |---|---|---|---|---|
//! | PulseAudio, null sink and its monitor | 1033 (of 1024) | 31.96 | 0.38 | 32.10 |
//! | PulseAudio, null sink and its monitor | 265 (of 256) | 7.99 | 0.38 | 8.02 |
//! | JACK, dummy driver, a cable within JACK | 256 | 5.31 | 5.40 | 0.04 |
//! | ALSA over PulseAudio | 682 (of 1024) | 28.3 | | |
//!
//! PulseAudio's figure is right within 0.4 ms. JACK counts from the start of its cycle and includes the
//! card's converters, one period each way with the dummy driver; a cable within JACK passes neither. ALSA
//! reports its buffer of two periods, without the server behind it.

use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use cpal::traits::{DeviceTrait, StreamTrait};
use ringbuf::HeapRb;
use ringbuf::traits::{Producer, Split};

use crate::bounded::bounded;
use crate::callback::{Counts, Filler, Gatherer};
use crate::format::with_sample;
use crate::hosts::{Listed, SIMULATED, Side, find, is_mixer};
use crate::request::{Cause, OpenError, Request, plan};
use crate::watch::{CLOSING, Shared, Watched, call_roll, watch};
use crate::{Capture, Process, now_ns};

/// Longest time that a host may take to open a stream.
const PATIENCE: Duration = Duration::from_secs(5);

/// Figures of one side of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// Calls of the device.
    pub callbacks: u64,
    /// Underruns or overruns that the host reported. PulseAudio and PipeWire report none.
    pub xruns: u64,
    /// Other errors that the host reported.
    pub errors: u64,
    /// Latency that the host last reported [ms]: from the call until the block is heard, or since it was at
    /// the input.
    pub latency_ms: f64,
}

/// An open device. Dropping it closes the device and drops the process.
pub struct Stream {
    output: Opened,
    input: Option<Opened>,
    rate_hz: u32,
    channels: Vec<u16>,
    notes: Vec<String>,
    shared: Arc<Shared>,
    watch: Option<JoinHandle<()>>,
}

/// One side of an open stream.
struct Opened {
    host: String,
    id: String,
    name: String,
    counts: Arc<Counts>,
}

/// An opened side, before it is watched.
struct Built {
    opened: Opened,
    stream: cpal::Stream,
    watched: Watched,
    notes: Vec<String>,
}

enum Work {
    Output(Box<dyn Process>),
    Input(Box<dyn Capture>),
}

/// Opens exactly the requested device. It calls `process` for every block to play, and `capture` for every
/// recorded block if input channels are requested. The stream stands still until [`Stream::play`]. Once it
/// is [lost](Stream::lost) it is closed, and must be opened again.
pub fn open(
    request: &Request,
    process: Box<dyn Process>,
    capture: Option<Box<dyn Capture>>,
) -> Result<Stream, OpenError> {
    request.check()?;
    // The first use of the clock sets it up, which must not happen on the audio thread.
    now_ns();
    let of_input = |error| OpenError { input: true, ..error };
    let found = find(request.host.as_deref(), request.device.as_deref(), Side::Output)?;
    let input = match capture.filter(|_| !request.inputs.is_empty()) {
        Some(capture) => Some((find_input(request, &found).map_err(of_input)?, capture)),
        None => None,
    };
    let timed = found.host != SIMULATED || !crate::simulated::is_by_hand(&found.id);
    let Built { opened: output, stream, watched, mut notes } = build(found, Work::Output(process), request)?;
    let (mut streams, mut sides, mut recorded) = (vec![stream], vec![watched], None);
    if let Some((found, capture)) = input {
        let built = build(found, Work::Input(capture), request).map_err(of_input)?;
        notes.extend(built.notes.into_iter().filter(|note| !notes.contains(note)).collect::<Vec<_>>());
        streams.insert(0, built.stream);
        sides.push(built.watched);
        recorded = Some(built.opened);
    }
    let shared = Arc::new(Shared { streams: streams.into(), timed, ..Shared::default() });
    let mixed = [Some(&output), recorded.as_ref()].into_iter().flatten().filter(|side| is_mixer(&side.host));
    let mixed: Vec<_> = mixed.map(|side| (side.host.clone(), side.id.clone())).collect();
    let (watched, called) = (shared.clone(), shared.clone());
    let thread = |name: &str| Builder::new().name(name.to_owned());
    let threads = thread("audio watch").spawn(move || watch(&watched, sides)).and_then(|watch| {
        if !mixed.is_empty() {
            thread("audio roll").spawn(move || call_roll(&called, mixed))?;
        }
        Ok(watch)
    });
    let (rate_hz, channels) = (request.rate_hz, request.channels.clone());
    let mut stream = Stream { output, input: recorded, rate_hz, channels, notes, shared, watch: None };
    let no_thread = |error| OpenError::refused(&stream.id(), format!("no thread to watch it: {error}"));
    stream.watch = Some(threads.map_err(no_thread)?);
    Ok(stream)
}

/// The input device: on the same host unless its id names another; on a simulated card the same card.
fn find_input(request: &Request, output: &Listed) -> Result<Listed, OpenError> {
    let wanted = request.input_device.as_deref();
    let same = wanted.is_none_or(|wanted| wanted == output.id || wanted == output.full_id());
    if output.host == SIMULATED && same {
        return Ok(output.clone());
    }
    match find(Some(&output.host), wanted, Side::Input) {
        Err(e) if e.cause == Cause::Device && request.host.is_none() && wanted.is_some() => {
            find(None, wanted, Side::Input)
        }
        found => found,
    }
}

fn build(found: Listed, work: Work, request: &Request) -> Result<Built, OpenError> {
    let (host, device) = (found.host.clone(), found.full_id());
    let request = request.clone();
    let build = move || {
        let (side, channels) = match work {
            Work::Output(_) => (Side::Output, &request.channels),
            Work::Input(_) => (Side::Input, &request.inputs),
        };
        let plan = plan(&found, side, channels, &request)?;
        let counts = Arc::new(Counts::new(plan.config.sample_rate));
        let (mut to, errors) = HeapRb::<cpal::Error>::new(64).split();
        let counting = counts.clone();
        // May run on the audio thread, and may be called without end.
        let on_error = move |error: cpal::Error| {
            let xrun = error.kind() == cpal::ErrorKind::Xrun;
            let count = if xrun { &counting.xruns } else { &counting.errors };
            count.fetch_add(1, Relaxed);
            // Dropping it would free memory on this thread. The watch closes a flooding stream, which bounds
            // the leak.
            if let Err(error) = to.try_push(error)
                && !counting.over.load(Relaxed)
            {
                std::mem::forget(error);
            }
        };
        let (config, width, wait) = (plan.config, plan.config.channels, Some(Duration::from_secs(3)));
        let stream = match work {
            Work::Output(process) => {
                let mut filler = Filler::new(counts.clone(), channels, width, process);
                with_sample!(plan.format, T => found.device.build_output_stream::<T, _, _>(
                    config, move |data, info| filler.fill(data, info), on_error, wait))
            }
            Work::Input(capture) => {
                let mut gatherer = Gatherer::new(counts.clone(), channels, width, capture);
                with_sample!(plan.format, T => found.device.build_input_stream::<T, _, _>(
                    config, move |data, info| gatherer.gather(data, info), on_error, wait))
            }
        };
        let stream = stream.map_err(|error| OpenError::refused(&found.full_id(), error))?;
        let watched = Watched { counts: counts.clone(), errors, bucket: 0.0, counted: 0 };
        let Listed { host, id, name, .. } = found;
        Ok(Built { opened: Opened { host, id, name, counts }, stream, watched, notes: plan.notes })
    };
    let silent = || Err(OpenError::refused(&device, "no answer from its host"));
    bounded(&host, PATIENCE, build).unwrap_or_else(silent)
}

impl Opened {
    fn full_id(&self) -> String {
        format!("{}:{}", self.host, self.id)
    }

    fn stats(&self) -> Stats {
        let counts = &self.counts;
        Stats {
            callbacks: counts.calls.load(Relaxed),
            xruns: counts.xruns.load(Relaxed),
            errors: counts.errors.load(Relaxed),
            latency_ms: counts.latency_ns.load(Relaxed) as f64 / 1e6,
        }
    }
}

impl Stream {
    /// Starts the stream. The error is the device's.
    pub fn play(&self) -> Result<(), String> {
        if let Some(reason) = self.lost() {
            return Err(reason.to_owned());
        }
        // PulseAudio calls when it is opened, and then perhaps not for almost two seconds.
        for side in [Some(&self.output), self.input.as_ref()].into_iter().flatten() {
            side.counts.last_ns.store(0, Relaxed);
        }
        self.shared.playing_since.store(now_ns(), Relaxed);
        let streams = self.shared.streams.lock();
        streams.iter().try_for_each(|stream| stream.play().map_err(|error| error.to_string()))
    }

    /// Name of its host.
    pub fn host(&self) -> &str {
        &self.output.host
    }

    /// Name of the device, for people.
    pub fn name(&self) -> &str {
        &self.output.name
    }

    /// Id that opens exactly this device again: `host:id`.
    pub fn id(&self) -> String {
        self.output.full_id()
    }

    /// `host:id` of the input device, if there is one.
    pub fn input_id(&self) -> Option<String> {
        self.input.as_ref().map(Opened::full_id)
    }

    /// Frames a second [Hz].
    pub fn rate_hz(&self) -> u32 {
        self.rate_hz
    }

    /// Device channels (from 1) of the block's channels.
    pub fn channels(&self) -> &[u16] {
        &self.channels
    }

    /// Notes for a user on how the device was opened, as sentences; often none.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Frames a call: median of the last 32 calls. `None` before the first.
    pub fn period(&self) -> Option<u32> {
        let recent = self.output.counts.recent();
        recent.get(recent.len() / 2).copied()
    }

    /// Figures of the output.
    pub fn stats(&self) -> Stats {
        self.output.stats()
    }

    /// Figures of the input, if there is one.
    pub fn input_stats(&self) -> Option<Stats> {
        self.input.as_ref().map(Opened::stats)
    }

    /// Why the stream is lost, if it is. It never comes back: open another one.
    pub fn lost(&self) -> Option<&str> {
        self.shared.lost.get().map(String::as_str)
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.shared.done.store(true, Relaxed);
        if let Some(watch) = self.watch.take() {
            watch.thread().unpark();
            let _ = watch.join();
        }
        self.shared.close(CLOSING);
    }
}
