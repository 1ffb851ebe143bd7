//! A device that plays.
//!
//! The latency that a host reports ([`Block::ahead_ns`](crate::Block::ahead_ns),
//! [`Captured::behind_ns`](crate::Captured::behind_ns), [`Stats::latency_ms`]), at 48 kHz, against the
//! measured time in a loop from output to input:
//!
//! | host | frames a call | ahead [ms] | behind [ms] | loop [ms] |
//! |---|---|---|---|---|
//! | PulseAudio, null sink and its monitor | 1033 (of 1024) | 31.96 | 0.38 | 32.10 |
//! | PulseAudio, null sink and its monitor | 265 (of 256) | 7.99 | 0.38 | 8.02 |
//! | JACK, dummy driver, a cable within JACK | 256 | 5.31 | 5.40 | 0.04 |
//! | ALSA over PulseAudio | 682 (of 1024) | 28.3 | | |
//!
//! PulseAudio's figure is right within 0.4 ms. JACK counts from the start of its cycle and includes the
//! card's converters, one period each way with the dummy driver; a cable within JACK passes neither. ALSA
//! reports its buffer of two periods, without the server behind it.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use cpal::traits::{DeviceTrait, StreamTrait};
use parking_lot::Mutex;
use ringbuf::HeapRb;
use ringbuf::traits::{Producer, Split};

use crate::bounded::bounded;
use crate::callback::{Counts, Filler, Gatherer, Message};
use crate::find::{Side, find};
use crate::format::with_sample;
use crate::hosts::{Listed, SIMULATED};
use crate::plan::{Plan, plan};
use crate::request::{OpenError, Request};
use crate::roll::Roll;
use crate::watch::{CLOSING, Shared, Watched, watch};
use crate::{Capture, Events, Format, Process, now_ns};

/// Longest time that a host may take to open a stream.
const PATIENCE: Duration = Duration::from_secs(5);

/// Figures of one side of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Stats {
    /// Calls of the device.
    pub callbacks: u64,
    /// Frames played or recorded.
    pub frames: u64,
    /// Underruns or overruns that the host reported. PulseAudio and PipeWire report none.
    pub xruns: u64,
    /// Other errors that the host reported.
    pub errors: u64,
    /// Gaps: times without a call of more than 50 ms and three periods.
    pub gaps: u64,
    /// Longest gap [ms].
    pub longest_gap_ms: f64,
    /// Time since the last call [ms]; `None` before the first.
    pub silent_ms: Option<f64>,
    /// Latency that the host last reported [ms]: from the call until the block is heard, or since it was at
    /// the input.
    pub latency_ms: f64,
}

/// One side of an open stream.
#[derive(Clone)]
struct Opened {
    host: String,
    id: String,
    name: String,
    channels: Vec<u16>,
    width: u16,
    format: Format,
    counts: Arc<Counts>,
}

/// An open device. Dropping it closes the device and drops the process.
pub struct Stream {
    output: Opened,
    input: Option<Opened>,
    rate_hz: u32,
    notes: Vec<String>,
    shared: Arc<Shared>,
    watch: Option<JoinHandle<()>>,
}

/// An opened side, before it is watched.
struct Built {
    opened: Opened,
    stream: cpal::Stream,
    watched: Watched,
    notes: Vec<String>,
}

/// The callback of one side.
enum Work {
    Output(Box<dyn Process>),
    Input(Box<dyn Capture>),
}

impl Work {
    fn side(&self) -> Side {
        match self {
            Self::Output(_) => Side::Output,
            Self::Input(_) => Side::Input,
        }
    }
}

/// Opens exactly the requested device. It calls `process` for every block to play, and `capture` for every
/// recorded block if input channels are requested. The stream stands still until [`Stream::play`]. Its
/// events go to `events`; after [`Event::Lost`](crate::Event::Lost) it is closed, and must be opened again.
pub fn open(
    request: &Request,
    process: Box<dyn Process>,
    capture: Option<Box<dyn Capture>>,
    events: Events,
) -> Result<Stream, OpenError> {
    request.check()?;
    // The first use of the clock sets it up, which must not happen on the audio thread.
    now_ns();
    let found = find(request.host.as_deref(), request.device.as_deref(), Side::Output)?;
    let input = match capture.filter(|_| !request.inputs.is_empty()) {
        Some(capture) => Some((find_input(request, &found)?, capture)),
        None => None,
    };
    let output = build(found, Work::Output(process), request)?;
    let input = match input {
        Some((found, capture)) => Some(build(found, Work::Input(capture), request)?),
        None => None,
    };
    let by_hand =
        |built: &Built| built.opened.host == SIMULATED && crate::simulated::is_by_hand(&built.opened.id);
    let timed = !by_hand(&output);
    let sides = [Some(&output), input.as_ref()].into_iter().flatten();
    let roll = Roll::new(sides.map(|side| (side.opened.host.clone(), side.opened.id.clone())));
    let roll = roll.map_err(|error| OpenError::Refused {
        device: output.opened.full_id(),
        reason: format!("no thread to see whether it is there: {error}"),
    })?;
    let mut notes = output.notes;
    let (mut streams, mut sides) = (Vec::new(), vec![output.watched]);
    let input = input.map(|built| {
        let news: Vec<_> = built.notes.into_iter().filter(|note| !notes.contains(note)).collect();
        notes.extend(news);
        streams.push(built.stream);
        sides.push(built.watched);
        built.opened
    });
    streams.push(output.stream);
    let shared = Arc::new(Shared {
        streams: Mutex::new(streams),
        playing_since: 0.into(),
        lost: OnceLock::new(),
        done: false.into(),
        timed,
    });
    let theirs = shared.clone();
    let thread = std::thread::Builder::new().name("audio watch".to_owned());
    let watch = thread.spawn(move || watch(&theirs, sides, &roll, &events)).map_err(|error| {
        shared.close(CLOSING);
        OpenError::Refused {
            device: output.opened.full_id(),
            reason: format!("no thread to watch it: {error}"),
        }
    })?;
    let rate_hz = request.rate_hz;
    Ok(Stream { output: output.opened, input, rate_hz, notes, shared, watch: Some(watch) })
}

/// The input device: on the same host unless its id names another; on a simulated card the same card.
fn find_input(request: &Request, output: &Listed) -> Result<Listed, OpenError> {
    let wanted = request.input_device.as_deref();
    let same = wanted.is_none_or(|wanted| wanted == output.id || wanted == output.full_id());
    if output.host == SIMULATED && same {
        return Ok(output.clone());
    }
    match find(Some(&output.host), wanted, Side::Input) {
        Err(OpenError::NoDevice { .. }) if request.host.is_none() && wanted.is_some() => {
            find(None, wanted, Side::Input)
        }
        found => found,
    }
}

/// Opens one side of a device.
fn build(found: Listed, work: Work, request: &Request) -> Result<Built, OpenError> {
    let (host, device) = (found.host.clone(), found.full_id());
    let request = request.clone();
    let build = move || {
        let side = work.side();
        let channels = if side == Side::Output { &request.channels } else { &request.inputs };
        let plan = plan(&found, side, channels, &request)?;
        start(found, &plan, channels, work)
            .map(|mut built| {
                built.notes = plan.notes;
                built
            })
            .map_err(|(device, error)| OpenError::Refused { device, reason: error.to_string() })
    };
    let reason = "no answer from its host".to_owned();
    bounded(&host, PATIENCE, build).unwrap_or(Err(OpenError::Refused { device, reason }))
}

/// Builds cpal's stream.
fn start(found: Listed, plan: &Plan, channels: &[u16], work: Work) -> Result<Built, (String, cpal::Error)> {
    let counts = Arc::new(Counts::new(plan.config.sample_rate));
    let (messages, from_data) = HeapRb::<Message>::new(16).split();
    let (mut errors, from_errors) = HeapRb::<Message>::new(64).split();
    let counting = counts.clone();
    // May run on the audio thread, and may be called without end.
    let on_error = move |error: cpal::Error| {
        let xrun = error.kind() == cpal::ErrorKind::Xrun;
        let count = if xrun { &counting.xruns } else { &counting.errors };
        count.fetch_add(1, Relaxed);
        // Dropping it would free memory on this thread. The watch closes a flooding stream, which bounds
        // the leak.
        if let Err(Message::Error(error)) = errors.try_push(Message::Error(error))
            && !counting.over.load(Relaxed)
        {
            std::mem::forget(error);
        }
    };
    let width = plan.config.channels;
    let (device, config, wait) = (&found.device, plan.config, Some(Duration::from_secs(3)));
    let counted = counts.clone();
    let stream = match work {
        Work::Output(process) => {
            let mut filler = Filler::new(counted, messages, channels, width, process);
            with_sample!(plan.format, T => device.build_output_stream::<T, _, _>(
                config, move |data, info| filler.fill(data, info), on_error, wait))
        }
        Work::Input(capture) => {
            let mut gatherer = Gatherer::new(counted, messages, channels, width, capture);
            with_sample!(plan.format, T => device.build_input_stream::<T, _, _>(
                config, move |data, info| gatherer.gather(data, info), on_error, wait))
        }
    };
    let stream = stream.map_err(|error| (found.full_id(), error))?;
    let watched = Watched::new(counts.clone(), [from_data, from_errors]);
    let channels = channels.to_vec();
    let Listed { host, id, name, .. } = found;
    let opened = Opened { host, id, name, channels, width, format: plan.format, counts };
    Ok(Built { opened, stream, watched, notes: Vec::new() })
}

impl Opened {
    fn full_id(&self) -> String {
        format!("{}:{}", self.host, self.id)
    }

    fn stats(&self) -> Stats {
        let counts = &self.counts;
        let last = counts.last_ns.load(Relaxed);
        Stats {
            callbacks: counts.calls.load(Relaxed),
            frames: counts.frames.load(Relaxed),
            xruns: counts.xruns.load(Relaxed),
            errors: counts.errors.load(Relaxed),
            gaps: counts.gaps.load(Relaxed),
            longest_gap_ms: counts.longest_gap_ns.load(Relaxed) as f64 / 1e6,
            silent_ms: (last > 0).then(|| now_ns().saturating_sub(last) as f64 / 1e6),
            latency_ms: counts.latency_ns.load(Relaxed) as f64 / 1e6,
        }
    }
}

impl Stream {
    /// Starts the stream, or resumes it after [`Stream::pause`]. The error is the device's.
    pub fn play(&self) -> Result<(), String> {
        self.each_side(|counts| counts.last_ns.store(0, Relaxed));
        self.shared.playing_since.store(now_ns(), Relaxed);
        self.each_stream(StreamTrait::play)
    }

    /// Pauses the stream: the device plays silence or stands still, and is not watched. Some devices
    /// cannot.
    pub fn pause(&self) -> Result<(), String> {
        let since = self.shared.playing_since.swap(0, Relaxed);
        self.each_stream(StreamTrait::pause)
            .inspect_err(|_| self.shared.playing_since.store(since, Relaxed))?;
        self.each_side(|counts| counts.last_ns.store(0, Relaxed));
        Ok(())
    }

    fn each_side(&self, act: impl Fn(&Counts)) {
        [Some(&self.output), self.input.as_ref()].into_iter().flatten().for_each(|side| act(&side.counts));
    }

    fn each_stream(&self, act: impl Fn(&cpal::Stream) -> Result<(), cpal::Error>) -> Result<(), String> {
        if let Some(reason) = self.lost() {
            return Err(reason.to_owned());
        }
        let streams = self.shared.streams.lock();
        streams.iter().try_for_each(|stream| act(stream).map_err(|error| error.to_string()))
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
        &self.output.channels
    }

    /// Channels of the open device.
    pub fn device_channels(&self) -> u16 {
        self.output.width
    }

    /// Sample format.
    pub fn format(&self) -> Format {
        self.output.format
    }

    /// Notes for a user on how the device was opened, as sentences; often none.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Frames a call: median of the last 64 calls. `None` before the first.
    pub fn period(&self) -> Option<u32> {
        let mut recent = self.output.counts.recent();
        recent.sort_unstable();
        recent.get(recent.len() / 2).copied()
    }

    /// Shortest and longest of the last 64 calls [frames]. `None` before the first.
    pub fn period_range(&self) -> Option<(u32, u32)> {
        let recent = self.output.counts.recent();
        Some((recent.iter().copied().min()?, recent.iter().copied().max()?))
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
