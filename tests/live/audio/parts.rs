//! Callbacks that fill and record blocks.

use std::sync::{Arc, Mutex};
use std::time::Duration;

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

/// Frames and `ahead_ns` of blocks.
type Blocks = Arc<Mutex<Vec<(usize, u64)>>>;

/// Plays [`Count`] and remembers frames and `ahead_ns` of every block.
pub(crate) struct Recorder(Count, Blocks);

impl Recorder {
    pub(crate) fn new() -> (Self, Blocks) {
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

/// A block as it was seen: the number of its first frame, when it was called for, and when the host says that
/// frame is heard or was at the input [ns].
#[derive(Clone, Copy)]
struct Seen {
    frame: usize,
    called_ns: u64,
    sounds_ns: u64,
}

/// Latency of a loop: medians in ms, for the first frame of each block heard.
#[derive(Debug)]
pub(crate) struct Heard {
    /// Frames that were played and not heard, after the first that was.
    pub(crate) lost: usize,
    /// From the call that played a frame to the call that heard it.
    pub(crate) whole: f64,
    /// The output's latency, as the host says.
    pub(crate) ahead: f64,
    /// The input's.
    pub(crate) behind: f64,
}

/// Plays and records one channel in a loop, and keeps what the host says of time.
pub(crate) struct Loop {
    played: Arc<Mutex<Vec<Seen>>>,
    heard: Arc<Mutex<(Vec<Seen>, Vec<f32>)>>,
}

struct LoopOut(Count, Arc<Mutex<Vec<Seen>>>);

impl Process for LoopOut {
    fn process(&mut self, block: &mut Block<'_>) {
        let sounds_ns = block.now_ns + block.ahead_ns;
        self.1.lock().unwrap().push(Seen { frame: self.0.0, called_ns: block.now_ns, sounds_ns });
        self.0.process(block);
    }
}

struct LoopIn(Arc<Mutex<(Vec<Seen>, Vec<f32>)>>);

impl Capture for LoopIn {
    fn capture(&mut self, block: &Captured<'_>) {
        let mut all = self.0.lock().unwrap();
        let sounds_ns = block.now_ns - block.behind_ns;
        let seen = Seen { frame: all.1.len(), called_ns: block.now_ns, sounds_ns };
        all.0.push(seen);
        all.1.extend_from_slice(block.input);
    }
}

impl Loop {
    /// One channel played, one recorded.
    pub(crate) fn new() -> (Self, Box<dyn Process>, Box<dyn Capture>) {
        let (played, heard) = (Arc::default(), Arc::default());
        let process = Box::new(LoopOut(Count::default(), Arc::clone(&played)));
        let capture = Box::new(LoopIn(Arc::clone(&heard)));
        (Self { played, heard }, process, capture)
    }

    /// Frames that have been recorded.
    pub(crate) fn frames(&self) -> usize {
        self.heard.lock().unwrap().1.len()
    }

    /// Checks that what was heard is what was played, in order and nothing twice, silence apart.
    pub(crate) fn check(&self, rate_hz: u32) -> Heard {
        let played = self.played.lock().unwrap().clone();
        let (blocks, heard) = self.heard.lock().unwrap().clone();
        let number = |sample: f32| (f64::from(sample) * f64::from(1 << 23)) as usize;
        let (mut last, mut lost) = (None, 0);
        for (at, sample) in heard.iter().enumerate().filter(|(_, sample)| **sample != 0.0) {
            let this = number(*sample);
            assert!(last.is_none_or(|last| this > last), "frame {at}: {this} follows {last:?}");
            lost += last.map_or(0, |last| this - last - 1);
            last = Some(this);
        }
        let (mut whole, mut ahead, mut behind) = (Vec::new(), Vec::new(), Vec::new());
        // The first second settles.
        for block in blocks.iter().filter(|block| block.frame > rate_hz as usize) {
            let Some(sample) = heard.get(block.frame).filter(|sample| **sample != 0.0) else { continue };
            let frame = number(*sample) - 1;
            let from = played[played.partition_point(|from| from.frame <= frame) - 1];
            let ms = |ns: u64| ns as f64 / 1e6;
            let within = (frame - from.frame) as f64 * 1e3 / f64::from(rate_hz);
            whole.push(ms(block.called_ns) - ms(from.called_ns));
            ahead.push(ms(from.sounds_ns) - ms(from.called_ns) + within);
            behind.push(ms(block.called_ns) - ms(block.sounds_ns));
        }
        let median = |mut all: Vec<f64>| {
            all.sort_by(f64::total_cmp);
            *all.get(all.len() / 2).expect("something is heard")
        };
        Heard { lost, whole: median(whole), ahead: median(ahead), behind: median(behind) }
    }
}
