//! Latency of a real-time run, measured over a loopback.

use std::collections::HashMap;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use asperity_graph::{Compiled, GraphFile};
use asperity_live::view::View;
use asperity_live::{DeviceQueues, Listener, Sample, SampleWriter, now_ns, samples};

use super::{Args, Item};
use crate::card::{TICK_HZ, Watching, graph, output_nodes, play};
use crate::failure::{Failure, warn};

/// Interval of a hand's samples.
const HAND: Duration = Duration::from_millis(1);
/// Seconds until the output has ramped up and the clock has settled.
const SETTLE_S: f64 = 2.5;
const PATIENCE: Duration = Duration::from_secs(1);
/// Most unheard clicks before the first that is heard: half a minute in which a user may connect ports.
const SILENT: u32 = 27;
/// Ramp from silence to full level \[s\].
const START_S: f64 = 0.5;

pub struct Loopback {
    pub device: String,
    pub clock: String,
    pub period_frames: u32,
    /// Declared.
    pub items: Vec<Item>,
    /// Latency of each trial \[ms\].
    pub measured_ms: Vec<f64>,
}

pub const TICK_MS: f64 = 1e3 / TICK_HZ;

impl Loopback {
    pub fn declared_ms(&self) -> f64 {
        self.items.iter().map(|item| item.ms).sum()
    }

    pub fn range_ms(&self) -> [f64; 3] {
        let mut sorted = self.measured_ms.clone();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().saturating_sub(1);
        [0, sorted.len() / 2, last].map(|i| sorted.get(i).copied().unwrap_or(f64::NAN))
    }

    pub fn off_ms(&self) -> f64 {
        self.range_ms()[1] - self.declared_ms()
    }

    /// Whether the median and the sum agree within a tick.
    pub fn agrees(&self) -> bool {
        self.off_ms().abs() <= TICK_MS
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
        output_nodes(&args.actuator.on(&args.output)?)?
    );
    let wires = r#"("hand.force", "click"), ("click", "limiter"), ("limiter", "out"), ("in", "heard")"#;
    graph("the measurement", args.rate, &nodes, wires)
}

pub fn measure(args: &Args, made: (GraphFile, Compiled)) -> Result<Loopback, Failure> {
    let (writer, reader) = samples();
    let queues =
        DeviceQueues { hands: HashMap::from([("hand".to_owned(), reader)]), ..DeviceQueues::default() };
    let hand = Hand::start(writer);
    let mut trials = Trials::new(args.trials, args.level);
    let mut last = View::default();
    let (channel, wanted) = (args.input_channel, args.trials);
    let mut view = |view: &View, listener: &Listener| {
        if last.device.is_empty() && view.device.ends_with("(jack)") {
            let (id, out, into) = (std::process::id(), args.output.channel() - 1, channel - 1);
            warn(&format!(
                "JACK leads clicks back only where ports are joined, here or behind a card: \
                 jack_connect cpal_client_{id}_out:out_{out} cpal_client_{id}_in:in_{into}"
            ));
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
    let ticks = ((SETTLE_S + 3.0 * f64::from(SILENT + wanted)) * TICK_HZ) as u64;
    let played = play(made, &card, START_S, queues, ticks, watching);
    drop(hand);
    let (ended, whole) = played?;
    let heard = trials.measured_ms.len();
    if !whole && !trials.over() {
        return Err(Failure::Machine(format!("stopped after {heard} of {wanted} clicks")));
    }
    if heard < wanted as usize / 2 + 1 {
        let of = match heard {
            0 => "no click was".to_owned(),
            _ => format!("only {heard} of {wanted} clicks were"),
        };
        return Err(Failure::Machine(format!(
            "{of} heard at input channel {channel}: join the output to it, and see --level and --amps"
        )));
    }
    let mut items = trials.items();
    if args.inside {
        // A loopback inside a server goes through no card.
        items.retain(|item| !item.what.starts_with("device"));
    } else if let Some(ms) = args.input_latency_ms {
        items.push(Item { what: "input: from sound to callback, as given".to_owned(), ms });
    }
    let (device, clock) = (ended.view.device.clone(), ended.view.clock.clone());
    let (period_frames, measured_ms) = (last.period_frames, trials.measured_ms);
    Ok(Loopback { device, clock, period_frames, items, measured_ms })
}

/// A simulated hand that touches on command, and tells when. It ends when it is dropped.
struct Hand {
    down: Sender<bool>,
    touched_ns: Receiver<u64>,
}

impl Hand {
    fn start(mut writer: SampleWriter) -> Self {
        let ((down, commands), (told, touched_ns)) = (channel(), channel());
        std::thread::spawn(move || {
            let (mut force, mut stroke) = (0.0, 0);
            loop {
                let time_ns = now_ns();
                writer.send(Sample { time_ns, arrived_ns: now_ns(), force, stroke, ..Sample::default() });
                match commands.recv_timeout(HAND) {
                    Ok(down) => {
                        // A new stroke: nothing is interpolated between air and touch.
                        (force, stroke) = (f64::from(u8::from(down)), stroke + 1);
                        let _ = told.send(now_ns());
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            }
        });
        Self { down, touched_ns }
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
        let (measured_ms, declared) = (Vec::new(), Vec::new());
        let (level, since) = (level as f32, Instant::now());
        Self { wanted, level, measured_ms, declared, missed: 0, silent: 0, since, down: false, phase: 0 }
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
            let _ = hand.down.send(true);
            (self.down, self.since, self.phase) = (true, Instant::now(), self.phase + 1);
        } else if self.down {
            let heard = listener.heard_ns();
            if heard.is_none() && self.since.elapsed() < PATIENCE {
                return;
            }
            let touched = hand.touched_ns.try_iter().last().unwrap_or(0);
            match heard {
                Some(ns) => {
                    self.measured_ms.push((ns as f64 - touched as f64) * 1e-6);
                    self.declared.push(view.latency_ms.clone());
                }
                None if self.measured_ms.is_empty() => self.silent += 1,
                None => self.missed += 1,
            }
            let _ = hand.down.send(false);
            (self.down, self.since) = (false, Instant::now());
        }
    }

    fn items(&self) -> Vec<Item> {
        let names = self.declared.last().into_iter().flatten().map(|(what, _)| what);
        let median = |name: &String| {
            let all = self.declared.iter().flatten().filter(|(what, _)| what == name);
            let mut all: Vec<f64> = all.map(|(_, ms)| *ms).collect();
            all.sort_by(f64::total_cmp);
            Item { what: name.clone(), ms: all.get(all.len() / 2).copied().unwrap_or(0.0) }
        };
        names.map(median).collect()
    }
}
