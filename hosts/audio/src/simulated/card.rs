//! The card: calls its streams, keeps what they play, wires output to input.

use std::collections::VecDeque;
use std::time::Duration;

use cpal::{Data, Error, InputCallbackInfo, OutputCallbackInfo, Sample, SampleFormat, StreamInstant};
use parking_lot::{Mutex, MutexGuard};

use super::{Params, Response};
use crate::block::frames_ns;
use crate::format::{DeviceSample, Format, with_sample};
use crate::now_ns;

pub(super) type OutputCall = Box<dyn FnMut(&mut Data, &OutputCallbackInfo) + Send>;
pub(super) type InputCall = Box<dyn FnMut(&Data, &InputCallbackInfo) + Send>;
pub(super) type ErrorCall = Box<dyn FnMut(Error) + Send>;

pub(super) enum Call {
    Output(OutputCall),
    Input(InputCall),
}

/// A stream that plays or records.
pub(super) struct Line {
    pub(super) call: Call,
    pub(super) error: ErrorCall,
    pub(super) format: Format,
    pub(super) rate_hz: u32,
    pub(super) period: u32,
    pub(super) playing: bool,
}

#[derive(Default)]
pub(super) struct State {
    pub(super) output: Option<Line>,
    pub(super) input: Option<Line>,
    pub(super) unplugged: bool,
    pub(super) stopped: bool,
    /// Whether a thread calls its streams.
    pub(super) timed: bool,
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
    pub(super) fn next_call(&self) -> Option<(usize, u32)> {
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
    pub(super) fn line(&mut self, plays: bool) -> &mut Option<Line> {
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
