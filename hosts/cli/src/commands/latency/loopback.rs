//! Latency of a real-time run, measured over a loopback.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::*};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use asperity_graph::{Compiled, GraphFile};
use asperity_live::view::View;
use asperity_live::{DeviceQueues, Listener, Sample, SampleWriter, now_ns, samples};

use super::Args;
use crate::card::{TICK_HZ, Watching, graph, output_nodes, play};
use crate::failure::Failure;

/// Interval of a hand's samples.
const HAND: Duration = Duration::from_millis(1);
/// Seconds until the output has ramped up and the clock has settled.
const SETTLE_S: f64 = 2.5;
/// Longest that a click is waited for.
const PATIENCE: Duration = Duration::from_secs(1);
/// Most unheard clicks before the first one that is heard: half a minute, in which a user may connect
/// ports.
const SILENT: u32 = 27;
/// Ramp from silence to full level \[s\].
const START_S: f64 = 0.5;

/// Declared and measured latency.
pub struct Loopback {
    /// Name of the device.
    pub device: String,
    /// Clock of the ticks.
    pub clock: String,
    /// Frames of a callback.
    pub period_frames: u32,
    /// Length of a tick \[ms\].
    pub tick_ms: f64,
    /// Declared items, each in words and \[ms\].
    pub items: Vec<(String, f64)>,
    /// Latency of each trial \[ms\].
    pub measured_ms: Vec<f64>,
}

impl Loopback {
    /// Sum of the declared items.
    pub fn declared_ms(&self) -> f64 {
        self.items.iter().map(|(_, ms)| ms).sum()
    }

    /// Median of the trials.
    pub fn median_ms(&self) -> f64 {
        let mut sorted = self.measured_ms.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    }

    /// Shortest trial.
    pub fn least_ms(&self) -> f64 {
        self.measured_ms.iter().copied().fold(f64::NAN, f64::min)
    }

    /// Longest trial.
    pub fn most_ms(&self) -> f64 {
        self.measured_ms.iter().copied().fold(f64::NAN, f64::max)
    }

    /// Whether the median and the sum agree within a tick.
    pub fn agrees(&self) -> bool {
        (self.median_ms() - self.declared_ms()).abs() <= self.tick_ms
    }
}

/// The graph that clicks when a hand touches, and records.
pub fn prepare(args: &Args) -> Result<(GraphFile, Compiled), Failure> {
    let nodes = format!(
        r#""hand": (kind: "pointer_input", params: (max_force_n: 1.0)),
           "click": (kind: "impulse", params: (threshold: 0.5, amplitude: {:?}, unit: "A")),
           "in": (kind: "audio_in", params: (channel: {}, unit: "FS")),
           "heard": (kind: "file_out", params: (file: "x.npy")), {}"#,
        args.amps,
        args.input_channel,
        output_nodes(&args.actuator)?
    );
    let wires = r#"("hand.force", "click"), ("click", "limiter"), ("limiter", "out"), ("in", "heard")"#;
    graph("the measurement", args.rate, &nodes, wires)
}

/// Plays the graph and measures.
pub fn measure(args: &Args, made: (GraphFile, Compiled)) -> Result<Loopback, Failure> {
    let (writer, reader) = samples();
    let queues =
        DeviceQueues { hands: HashMap::from([("hand".to_owned(), reader)]), ..DeviceQueues::default() };
    let hand = Hand::start(writer);
    let mut trials = Trials::new(args.trials, args.level);
    let mut last = View::default();
    let mut view = |view: &View, listener: &Listener| {
        if last.device.is_empty() && view.device.ends_with("(jack)") {
            crate::failure::warn(&ports(args));
        }
        if !view.clock.is_empty() && view.seconds > SETTLE_S {
            trials.step(&hand, listener, view);
        }
        last.clone_from(view);
        !trials.over()
    };
    let watching = Watching { view: &mut view, recorded: &mut |_, _, _| {} };
    let card = args.output.recording_from(args.input_device.as_deref());
    // Long enough for every trial; it ends when they are over.
    let ticks = ((SETTLE_S + 3.0 * f64::from(SILENT + args.trials)) * TICK_HZ) as u64;
    let played = play(made, &card, START_S, queues, ticks, watching);
    drop(hand);
    let (ended, whole) = played?;
    if !whole && !trials.over() {
        let heard = trials.measured_ms.len();
        return Err(Failure::Machine(format!("stopped after {heard} of {} clicks", args.trials)));
    }
    if trials.measured_ms.len() < args.trials as usize / 2 + 1 {
        let heard = trials.measured_ms.len();
        let of = if heard == 0 {
            "no click was".to_owned()
        } else {
            format!("only {heard} of {} clicks were", args.trials)
        };
        return Err(Failure::Machine(format!(
            "{of} heard at input channel {}: join the output to it, and see --level and --amps",
            args.input_channel
        )));
    }
    let tick_ms = 1e3 / TICK_HZ;
    let mut items = trials.items();
    if args.inside {
        // A loopback inside a server goes through no card.
        items.retain(|(what, _)| !what.starts_with("device"));
    } else if let Some(ms) = args.input_latency_ms {
        items.push(("input: from sound to callback, as given".to_owned(), ms));
    }
    Ok(Loopback {
        device: ended.view.device.clone(),
        clock: ended.view.clock.clone(),
        period_frames: last.period_frames,
        tick_ms,
        items,
        measured_ms: trials.measured_ms,
    })
}

/// Says how to connect the ends of a loopback on JACK.
fn ports(args: &Args) -> String {
    let (id, out, into) = (std::process::id(), args.output.channel() - 1, args.input_channel - 1);
    format!(
        "JACK leads clicks back only where ports are joined, here or behind a card: \
         jack_connect cpal_client_{id}_out:out_{out} cpal_client_{id}_in:in_{into}"
    )
}

/// A simulated hand that touches on command.
struct Hand {
    down: Arc<AtomicBool>,
    /// When it last touched.
    touched_ns: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Hand {
    fn start(mut writer: SampleWriter) -> Self {
        let (down, stop) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let touched_ns = Arc::new(AtomicU64::new(0));
        let (is_down, stopped, touched) = (down.clone(), stop.clone(), touched_ns.clone());
        let thread = std::thread::spawn(move || {
            let (mut was, mut stroke) = (false, 0);
            while !stopped.load(Relaxed) {
                let now = is_down.load(Acquire);
                let time_ns = now_ns();
                if now != was {
                    // A new stroke: nothing is interpolated between air and touch.
                    stroke += 1;
                    was = now;
                    if now {
                        touched.store(time_ns, Release);
                    }
                }
                let force = f64::from(u8::from(now));
                writer.send(Sample { time_ns, arrived_ns: now_ns(), force, stroke, ..Sample::default() });
                std::thread::sleep(HAND);
            }
        });
        Self { down, touched_ns, stop, thread: Some(thread) }
    }
}

impl Drop for Hand {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The clicks, one after the other.
struct Trials {
    wanted: u32,
    level: f32,
    measured_ms: Vec<f64>,
    /// Items declared at each trial: on a busy machine the lead grows while it runs.
    declared: Vec<Vec<(String, f64)>>,
    missed: u32,
    /// Clicks before the first that was heard.
    silent: u32,
    /// When the hand last moved down or up.
    since: Instant,
    down: bool,
    /// Number of the wait: waits differ, so that the hand comes at every phase of a tick.
    phase: u32,
}

impl Trials {
    fn new(wanted: u32, level: f64) -> Self {
        let since = Instant::now();
        Self {
            wanted,
            level: level as f32,
            measured_ms: Vec::new(),
            declared: Vec::new(),
            missed: 0,
            silent: 0,
            since,
            down: false,
            phase: 0,
        }
    }

    fn over(&self) -> bool {
        self.measured_ms.len() as u32 + self.missed >= self.wanted || self.silent >= SILENT
    }

    /// Continues the trial under way.
    fn step(&mut self, hand: &Hand, listener: &Listener, view: &View) {
        // The golden ratio's multiples are spread evenly over a tick.
        let wait = Duration::from_micros(120_000 + u64::from(self.phase.wrapping_mul(1236) % 2000));
        if !self.down && self.since.elapsed() >= wait {
            listener.listen(self.level);
            hand.down.store(true, Release);
            (self.down, self.since, self.phase) = (true, Instant::now(), self.phase + 1);
        } else if self.down {
            let heard = listener.heard_ns();
            if heard.is_none() && self.since.elapsed() < PATIENCE {
                return;
            }
            match heard {
                Some(ns) => {
                    let touched = hand.touched_ns.load(Acquire);
                    self.measured_ms.push((ns as f64 - touched as f64) * 1e-6);
                    self.declared.push(view.latency_ms.clone());
                }
                None if self.measured_ms.is_empty() => self.silent += 1,
                None => self.missed += 1,
            }
            hand.down.store(false, Release);
            (self.down, self.since) = (false, Instant::now());
        }
    }

    /// Median of each declared item.
    fn items(&self) -> Vec<(String, f64)> {
        let names = self.declared.last().into_iter().flatten().map(|(what, _)| what);
        let median = |name: &String| {
            let all = self.declared.iter().flatten().filter(|(what, _)| what == name);
            let mut all: Vec<f64> = all.map(|(_, ms)| *ms).collect();
            all.sort_by(f64::total_cmp);
            (name.clone(), all.get(all.len() / 2).copied().unwrap_or(0.0))
        };
        names.map(median).collect()
    }
}
