//! Callbacks that fill and record blocks.

use std::sync::{Arc, Mutex};

use asperity_audio::simulated::Simulated;
use asperity_audio::{Block, Capture, Captured, OpenError, Process, Request, Stream, open};
use harness::live::until;

/// The first channel of the card.
pub(crate) fn on(card: &Simulated) -> Request {
    Request { device: Some(card.id()), ..Request::default() }
}

/// The first channel of what a card kept.
pub(crate) fn left(card: &Simulated) -> Vec<f64> {
    card.played().chunks(2).map(|frame| frame[0]).collect()
}

/// Opens and plays.
pub(crate) fn play(request: &Request, process: impl Process + 'static) -> Stream {
    record(request, process, None)
}

/// Opens, plays and records.
pub(crate) fn record(request: &Request, process: impl Process + 'static, ear: Option<Ear>) -> Stream {
    let stream = open(request, Box::new(process), ear.map(|ear| Box::new(ear) as Box<dyn Capture>)).unwrap();
    stream.play().unwrap();
    stream
}

/// Why a device is not opened.
pub(crate) fn refusal(request: &Request) -> OpenError {
    match open(request, Box::new(Count::default()), Some(Box::new(Ear::default()))) {
        Ok(stream) => panic!("{} was opened", stream.id()),
        Err(error) => error,
    }
}

/// Waits for calls.
pub(crate) fn calls(stream: &Stream, more: u64) {
    let before = stream.stats().callbacks;
    until("calls", || stream.stats().callbacks > before + more);
}

/// Waits for the loss of a stream; its reason.
pub(crate) fn loss(stream: &Stream) -> String {
    until("a loss", || stream.lost().is_some());
    stream.lost().unwrap().to_owned()
}

/// A saw from -1.3 to 1.3 over 101 samples.
pub(crate) fn ramp(at: usize) -> f32 {
    (at % 101) as f32 / 100.0 * 2.6 - 1.3
}

/// Plays what a function says of every sample, by its number over all channels.
pub(crate) struct Each<F>(pub(crate) F, pub(crate) usize);

impl<F: FnMut(usize) -> f32 + Send> Process for Each<F> {
    fn process(&mut self, block: &mut Block<'_>) {
        for sample in &mut *block.output {
            assert_eq!(*sample, 0.0, "a block arrives zeroed");
            *sample = (self.0)(self.1);
            self.1 += 1;
        }
    }
}

/// Plays a number that says which sample it is, exactly, for 2^22 samples; remembers the frames of every
/// block, and when it was called for.
#[derive(Default)]
pub(crate) struct Count {
    at: usize,
    pub(crate) blocks: Arc<Mutex<Vec<(usize, u64)>>>,
}

impl Count {
    pub(crate) fn value(at: usize) -> f64 {
        (at % (1 << 22) + 1) as f64 / f64::from(1 << 23)
    }
}

impl Process for Count {
    fn process(&mut self, block: &mut Block<'_>) {
        self.blocks.lock().unwrap().push((block.frames(), block.now_ns));
        let mut count = Each(|at| Self::value(at) as f32, self.at);
        count.process(block);
        self.at = count.1;
    }
}

/// Blocks as frames with the time of the call, and samples.
type Tape = Arc<Mutex<(Vec<(usize, u64)>, Vec<f32>)>>;

/// Keeps what it hears.
#[derive(Clone, Default)]
pub(crate) struct Ear(pub(crate) Tape);

impl Ear {
    pub(crate) fn heard(&self) -> Vec<f32> {
        self.0.lock().unwrap().1.clone()
    }
}

impl Capture for Ear {
    fn capture(&mut self, block: &Captured<'_>) {
        let mut tape = self.0.lock().unwrap();
        tape.0.push((block.input.len() / block.channels, block.now_ns));
        tape.1.extend_from_slice(block.input);
    }
}

/// Checks that what was heard is [`Count`] of one channel, in order and nothing twice, silence apart. Frames
/// that were not heard, and the median time from a frame's call to be played to its call to be heard [ms].
pub(crate) fn around(played: &[(usize, u64)], ear: &Ear) -> (usize, f64) {
    let (recorded, heard) = ear.0.lock().unwrap().clone();
    let number = |sample: f32| (f64::from(sample) * f64::from(1 << 23)) as usize;
    let (mut last, mut lost) = (None, 0);
    for (at, sample) in heard.iter().enumerate().filter(|(_, sample)| **sample != 0.0) {
        let this = number(*sample);
        assert!(last.is_none_or(|last| this > last), "frame {at}: {this} follows {last:?}");
        lost += last.map_or(0, |last| this - last - 1);
        last = Some(this);
    }
    let starts = |blocks: &[(usize, u64)]| -> Vec<(usize, u64)> {
        let mut frame = 0;
        let start = |(frames, at): &(usize, u64)| {
            frame += frames;
            (frame - frames, *at)
        };
        blocks.iter().map(start).collect()
    };
    let (played, recorded) = (starts(played), starts(&recorded));
    // The first second settles.
    let times = recorded.iter().filter(|(frame, _)| *frame > 48_000).filter_map(|(frame, at)| {
        let sample = heard.get(*frame).filter(|sample| **sample != 0.0)?;
        let from = played[played.partition_point(|(first, _)| *first < number(*sample)) - 1];
        Some((*at - from.1) as f64 / 1e6)
    });
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    (lost, *times.get(times.len() / 2).expect("something is heard"))
}
