//! The card: calls its streams, keeps their samples, wires output to input. For cpal it is a device.

use std::collections::VecDeque;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};

use cpal::traits::{DeviceTrait, StreamTrait};
use cpal::{
    BufferSize, Data, DeviceDescription, DeviceDescriptionBuilder, DeviceDirection, DeviceId, Error,
    ErrorKind, FrameCount, HostId, InputCallbackInfo, OutputCallbackInfo, Sample, SampleFormat, StreamConfig,
    StreamInstant, SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};
use parking_lot::{Mutex, MutexGuard};

use super::{Params, Response};
use crate::block::frames_ns;
use crate::format::{DeviceSample, Format, with_sample};
use crate::now_ns;

type ErrorCall = Box<dyn FnMut(Error) + Send>;

enum Call {
    Output(Box<dyn FnMut(&mut Data, &OutputCallbackInfo) + Send>),
    Input(Box<dyn FnMut(&Data, &InputCallbackInfo) + Send>),
}

/// A stream that plays or records.
pub(super) struct Line {
    call: Call,
    pub(super) error: ErrorCall,
    format: Format,
    rate_hz: u32,
    period: u32,
    playing: bool,
}

#[derive(Default)]
pub(super) struct State {
    output: Option<Line>,
    input: Option<Line>,
    pub(super) unplugged: bool,
    pub(super) stopped: bool,
    /// Whether a thread calls its streams.
    timed: bool,
    /// Pause before the next call.
    pub(super) gap: Duration,
    /// Parts of the world between an output and an input channel (from 0).
    pub(super) plants: Vec<(usize, usize, Response)>,
    pub(super) played: Vec<f64>,
    /// Frames on their way from output to input.
    wire: VecDeque<Vec<f32>>,
    calls: usize,
    memory: Vec<u64>,
}

pub(super) struct Card {
    pub(super) id: String,
    pub(super) params: Params,
    state: Mutex<State>,
}

impl Card {
    pub(super) fn new(id: String, params: Params) -> Self {
        Self { id, params, state: Mutex::default() }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock()
    }

    /// Frames of the next call, and their rate. `None` while nothing plays.
    fn next_call(&self) -> Option<(usize, u32)> {
        let mut state = self.lock();
        let cycle = &self.params.frames;
        let frames = cycle.get(state.calls % cycle.len().max(1)).copied();
        let line = state.lines().find(|line| line.playing)?;
        Some((frames.unwrap_or(line.period) as usize, line.rate_hz))
    }

    /// Calls the playing streams once with this many frames.
    pub(super) fn step(&self, frames: usize) {
        let state = &mut *self.lock();
        if state.unplugged || state.stopped {
            return;
        }
        state.calls += 1;
        state.play(frames, &self.params);
        state.record(frames, &self.params);
    }
}

/// Buffer for samples of any format.
fn data(memory: &mut Vec<u64>, samples: usize, format: SampleFormat) -> Data {
    memory.resize((samples * format.sample_size()).div_ceil(8), 0);
    // SAFETY: the memory holds that many samples, is aligned for the largest of them, and any bits are a
    // sample. It outlives the data, which its only callers do not keep.
    unsafe { Data::from_parts(memory.as_mut_ptr().cast(), samples, format) }
}

impl State {
    pub(super) fn lines(&mut self) -> impl Iterator<Item = &mut Line> {
        [&mut self.output, &mut self.input].into_iter().flatten()
    }

    /// The stream of one direction, if there is one.
    fn line(&mut self, plays: bool) -> &mut Option<Line> {
        if plays { &mut self.output } else { &mut self.input }
    }

    fn play(&mut self, frames: usize, params: &Params) {
        let width = usize::from(params.channels);
        let Self { output, memory, played, wire, plants, .. } = self;
        let mut heard = vec![0.0_f64; frames * width];
        if let Some(Line { call: Call::Output(call), format, rate_hz, playing: true, .. }) = output {
            let mut data = data(memory, frames * width, format.to_cpal());
            with_sample!(*format, T => data.as_slice_mut::<T>().unwrap_or_default().fill(T::EQUILIBRIUM));
            let now = now_ns();
            let playback =
                StreamInstant::from_nanos(now + frames_ns(u64::from(params.latency_frames), *rate_hz));
            let stamp = cpal::OutputStreamTimestamp { callback: StreamInstant::from_nanos(now), playback };
            call(&mut data, &OutputCallbackInfo::new(stamp));
            with_sample!(*format, T => {
                let samples = data.as_slice::<T>().unwrap_or_default();
                heard.iter_mut().zip(samples).for_each(|(to, from)| *to = from.to_sample());
            });
            if params.keep {
                played.extend_from_slice(&heard);
            }
        }
        let inputs = usize::from(params.inputs);
        if inputs == 0 {
            return;
        }
        let latency = params.latency_frames as usize;
        if wire.is_empty() {
            wire.extend(std::iter::repeat_n(vec![0.0; inputs], latency));
        }
        for frame in heard.chunks_exact(width) {
            let mut line = vec![0.0; inputs];
            if params.loopback {
                line.iter_mut().zip(frame).for_each(|(to, from)| *to = *from as f32);
            }
            for (output, input, respond) in &mut *plants {
                if let (Some(from), Some(to)) = (frame.get(*output), line.get_mut(*input)) {
                    *to = respond(*from as f32);
                }
            }
            wire.push_back(line);
        }
    }

    fn record(&mut self, frames: usize, params: &Params) {
        let width = usize::from(params.inputs);
        let arrived: Vec<Vec<f32>> = self.wire.drain(..frames.min(self.wire.len())).collect();
        let Some(Line { call: Call::Input(call), format, playing: true, .. }) = &mut self.input else {
            return;
        };
        let mut data = data(&mut self.memory, frames * width, format.to_cpal());
        with_sample!(*format, T => {
            let samples = data.as_slice_mut::<T>().unwrap_or_default();
            samples.fill(T::EQUILIBRIUM);
            for (to, from) in samples.iter_mut().zip(arrived.iter().flatten()) {
                *to = T::from_unit(*from);
            }
        });
        let now = StreamInstant::from_nanos(now_ns());
        let stamp = cpal::InputStreamTimestamp { callback: now, capture: now };
        call(&data, &InputCallbackInfo::new(stamp));
    }
}

/// Default frames a call.
const USUAL_PERIOD: u32 = 256;

/// The card as a device of cpal.
#[derive(Clone)]
pub(super) struct Device(pub(super) Arc<Card>);

impl Device {
    fn configs(&self, channels: u16) -> Vec<SupportedStreamConfigRange> {
        let params = &self.0.params;
        let frames = || params.frames.iter().copied();
        let (min, max) = (frames().min().unwrap_or(1), frames().max().unwrap_or(1 << 20));
        let buffer = SupportedBufferSize::Range { min, max };
        let of = |format: Format, rate| {
            SupportedStreamConfigRange::new(channels, rate, rate, buffer, format.to_cpal())
        };
        let formats = params.formats().into_iter().filter(|_| channels > 0);
        formats.flat_map(|format| params.rates().into_iter().map(move |rate| of(format, rate))).collect()
    }

    fn default_config(&self, channels: u16) -> Result<SupportedStreamConfig, Error> {
        let best = self.configs(channels).into_iter().max_by_key(|config| config.max_sample_rate() == 48_000);
        let none = || Error::new(ErrorKind::UnsupportedOperation);
        best.map(SupportedStreamConfigRange::with_max_sample_rate).ok_or_else(none)
    }

    fn open(
        &self,
        config: StreamConfig,
        format: SampleFormat,
        call: Call,
        error: ErrorCall,
    ) -> Result<Stream, Error> {
        let params = &self.0.params;
        let plays = matches!(call, Call::Output(_));
        let channels = if plays { params.channels } else { params.inputs };
        let format = Format::from_cpal(format).filter(|format| params.formats().contains(format));
        let fits = config.channels == channels && params.rates().contains(&config.sample_rate);
        let format = format.filter(|_| fits).ok_or(Error::new(ErrorKind::UnsupportedConfig))?;
        let period = match config.buffer_size {
            BufferSize::Fixed(frames) => frames,
            BufferSize::Default => USUAL_PERIOD,
        };
        let plant = if plays { super::plant_of(params, f64::from(config.sample_rate)) } else { Ok(None) };
        let plant = plant.map_err(|text| Error::with_message(ErrorKind::UnsupportedConfig, text))?;
        let mut state = self.0.lock();
        if state.unplugged {
            return Err(Error::new(ErrorKind::DeviceNotAvailable));
        }
        if let Some(plant) = plant {
            // At rest.
            state.plants = vec![(0, 0, plant)];
        }
        let place = state.line(plays);
        if place.is_some() {
            return Err(Error::new(ErrorKind::DeviceBusy));
        }
        let rate_hz = config.sample_rate;
        *place = Some(Line { call, error, format, rate_hz, period, playing: false });
        if self.0.params.speed > 0.0 && !std::mem::replace(&mut state.timed, true) {
            let card = Arc::downgrade(&self.0);
            std::thread::spawn(move || keep_time(&card));
        }
        drop(state);
        Ok(Stream { card: self.0.clone(), plays, period })
    }
}

/// Calls a card in real time until its last stream is gone.
fn keep_time(card: &Weak<Card>) {
    let mut due = Instant::now();
    loop {
        let Some(card) = card.upgrade() else { return };
        let gap = {
            let mut state = card.lock();
            if state.lines().next().is_none() {
                state.timed = false;
                return;
            }
            std::mem::take(&mut state.gap)
        };
        std::thread::sleep(gap);
        let Some((frames, rate_hz)) = card.next_call() else {
            std::thread::sleep(Duration::from_millis(1));
            due = Instant::now();
            continue;
        };
        let now = Instant::now();
        let lasts = Duration::from_secs_f64(frames as f64 / f64::from(rate_hz) / card.params.speed);
        // Calls missed while this thread could not run are not made up for.
        if now > due + lasts * 4 {
            due = now;
        }
        std::thread::sleep(due.saturating_duration_since(now));
        card.step(frames);
        due += lasts;
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.id)
    }
}

impl fmt::Debug for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl PartialEq for Device {
    fn eq(&self, other: &Self) -> bool {
        self.0.id == other.0.id
    }
}

impl Eq for Device {}

impl Hash for Device {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.id.hash(state);
    }
}

impl DeviceTrait for Device {
    type SupportedInputConfigs = std::vec::IntoIter<SupportedStreamConfigRange>;
    type SupportedOutputConfigs = std::vec::IntoIter<SupportedStreamConfigRange>;
    type Stream = Stream;

    fn description(&self) -> Result<DeviceDescription, Error> {
        let direction =
            if self.0.params.inputs > 0 { DeviceDirection::Duplex } else { DeviceDirection::Output };
        Ok(DeviceDescriptionBuilder::new("Simulated sound card").direction(direction).build())
    }

    fn id(&self) -> Result<DeviceId, Error> {
        Ok(DeviceId::new(HostId::Custom, &self.0.id))
    }

    fn supported_input_configs(&self) -> Result<Self::SupportedInputConfigs, Error> {
        Ok(self.configs(self.0.params.inputs).into_iter())
    }

    fn supported_output_configs(&self) -> Result<Self::SupportedOutputConfigs, Error> {
        Ok(self.configs(self.0.params.channels).into_iter())
    }

    fn default_input_config(&self) -> Result<SupportedStreamConfig, Error> {
        self.default_config(self.0.params.inputs)
    }

    fn default_output_config(&self) -> Result<SupportedStreamConfig, Error> {
        self.default_config(self.0.params.channels)
    }

    fn build_input_stream_raw<D, E>(
        &self,
        config: StreamConfig,
        format: SampleFormat,
        call: D,
        error: E,
        _timeout: Option<Duration>,
    ) -> Result<Stream, Error>
    where
        D: FnMut(&Data, &InputCallbackInfo) + Send + 'static,
        E: FnMut(Error) + Send + 'static,
    {
        self.open(config, format, Call::Input(Box::new(call)), Box::new(error))
    }

    fn build_output_stream_raw<D, E>(
        &self,
        config: StreamConfig,
        format: SampleFormat,
        call: D,
        error: E,
        _timeout: Option<Duration>,
    ) -> Result<Stream, Error>
    where
        D: FnMut(&mut Data, &OutputCallbackInfo) + Send + 'static,
        E: FnMut(Error) + Send + 'static,
    {
        self.open(config, format, Call::Output(Box::new(call)), Box::new(error))
    }
}

/// A stream of the card; ends when dropped.
pub(super) struct Stream {
    card: Arc<Card>,
    plays: bool,
    period: u32,
}

impl Stream {
    fn set_playing(&self, playing: bool) -> Result<(), Error> {
        let mut state = self.card.lock();
        if state.unplugged {
            return Err(Error::new(ErrorKind::DeviceNotAvailable));
        }
        state.line(self.plays).iter_mut().for_each(|line| line.playing = playing);
        Ok(())
    }
}

impl StreamTrait for Stream {
    fn play(&self) -> Result<(), Error> {
        self.set_playing(true)
    }

    fn pause(&self) -> Result<(), Error> {
        self.set_playing(false)
    }

    fn buffer_size(&self) -> Result<FrameCount, Error> {
        Ok(self.period)
    }

    fn now(&self) -> StreamInstant {
        StreamInstant::from_nanos(now_ns())
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        let mut state = self.card.lock();
        let line = state.line(self.plays).take();
        // The line may itself lock the card: it is dropped without the lock.
        drop(state);
        drop(line);
    }
}
