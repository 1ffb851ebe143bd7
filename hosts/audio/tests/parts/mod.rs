//! What tests fill and record blocks with.
#![allow(dead_code, reason = "no test file uses all of it")]

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use asperity_audio::simulated::{Params, Simulated};
use asperity_audio::{Block, Capture, Captured, Event, Process, Request, Stream, events, open};

/// A card that calls only when it is told to, and keeps what it hears.
pub(crate) fn by_hand() -> Params {
    Params { speed: 0.0, keep: true, ..Params::default() }
}

/// The first channel of the card.
pub(crate) fn on(card: &Simulated) -> Request {
    Request { device: Some(card.id()), ..Request::default() }
}

/// Opens and plays, with nobody listening to what happens.
pub(crate) fn play(request: &Request, process: impl Process + 'static) -> Stream {
    let (sender, _events) = events();
    let stream = open(request, Box::new(process), None, sender).unwrap();
    stream.play().unwrap();
    stream
}

/// Waits until it is so, at most 20 s.
pub(crate) fn wait(what: &str, is_so: impl Fn() -> bool) {
    let began = Instant::now();
    while !is_so() {
        assert!(began.elapsed() < Duration::from_secs(20), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits for the loss of a stream, at most 20 s; answers its reason and what came before.
pub(crate) fn wait_for_loss(received: &std::sync::mpsc::Receiver<Event>) -> (String, Vec<Event>) {
    let mut before = Vec::new();
    loop {
        match received.recv_timeout(Duration::from_secs(20)) {
            Ok(Event::Lost { reason }) => return (reason, before),
            Ok(event) => before.push(event),
            Err(_) => panic!("no loss was told, only {before:?}"),
        }
    }
}

/// A saw from -1.3 to 1.3 over 101 samples.
pub(crate) fn ramp(at: usize) -> f32 {
    (at % 101) as f32 / 100.0 * 2.6 - 1.3
}

/// Plays the saw, sample by sample, over all channels.
#[derive(Default)]
pub(crate) struct Ramp(usize);

impl Process for Ramp {
    fn process(&mut self, block: &mut Block<'_>) {
        for sample in &mut *block.output {
            *sample = ramp(self.0);
            self.0 += 1;
        }
    }
}

/// Plays a number that says which sample it is, exactly, for 2^22 samples.
#[derive(Default)]
pub(crate) struct Count(usize);

impl Count {
    pub(crate) fn value(at: usize) -> f64 {
        (at % (1 << 22) + 1) as f64 / f64::from(1 << 23)
    }
}

impl Process for Count {
    fn process(&mut self, block: &mut Block<'_>) {
        for sample in &mut *block.output {
            assert_eq!(*sample, 0.0, "a block arrives zeroed");
            *sample = Count::value(self.0) as f32;
            self.0 += 1;
        }
    }
}

/// Plays what a function says.
pub(crate) struct Each<F>(pub(crate) F);

impl<F: FnMut() -> f32 + Send> Process for Each<F> {
    fn process(&mut self, block: &mut Block<'_>) {
        block.output.iter_mut().for_each(|sample| *sample = (self.0)());
    }
}

/// Plays [`Count`] and remembers frames and `ahead_ns` of every block.
pub(crate) struct Recorder(Count, Arc<Mutex<Vec<(usize, u64)>>>);

impl Recorder {
    pub(crate) fn new() -> (Self, Arc<Mutex<Vec<(usize, u64)>>>) {
        let seen = Arc::default();
        (Self(Count::default(), Arc::clone(&seen)), seen)
    }
}

impl Process for Recorder {
    fn process(&mut self, block: &mut Block<'_>) {
        self.1.lock().unwrap().push((block.frames(), block.ahead_ns));
        self.0.process(block);
    }
}

/// Keeps what it hears.
pub(crate) struct Ear(Arc<Mutex<Vec<f32>>>);

impl Ear {
    pub(crate) fn new() -> (Self, Arc<Mutex<Vec<f32>>>) {
        let heard = Arc::default();
        (Self(Arc::clone(&heard)), heard)
    }
}

impl Capture for Ear {
    fn capture(&mut self, block: &Captured<'_>) {
        self.0.lock().unwrap().extend_from_slice(block.input);
    }
}
