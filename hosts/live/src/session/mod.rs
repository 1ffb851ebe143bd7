//! A run from start to end: opens a device, chooses a clock, waits for a lost device.

mod card;
mod custody;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use asperity_audio::{OpenError, Request};
use asperity_engine::Finished;
use asperity_node::{Diagnostic, Fact};

use crate::driver::{Clock, Controls, Driver, Options, callback, choose, paced, timer};
use crate::layout::latency;
use crate::meters::Meters;
use crate::player::MicWriter;
use crate::realtime::{Grant, Grants, Machine, PRIORITY};
use crate::view::{Condition, View};
use crate::{GraphController, Listener, Player, RunControl};
use card::Card;
use custody::Custody;
pub use custody::{CoilMonitor, Opened, StartValues};

opaque_debug!(Session);

/// Time between two attempts to open a lost device.
const RETRY: Duration = Duration::from_millis(500);
/// Longest wait for a device's period before a clock is chosen without it.
const LISTEN: Duration = Duration::from_millis(1000);
/// Calls after which the period is known.
const ENOUGH: u64 = 16;

/// Options of a run.
#[derive(Debug)]
pub struct SessionOptions {
    /// The device; `None` runs without audio.
    pub device: Option<Request>,
    /// Clock of the ticks; `None` chooses by the device's period.
    pub clock: Option<Clock>,
    /// Whether to wait for a lost device.
    pub reconnect: bool,
    /// Seconds from silence to full at the start.
    pub start_s: f64,
    /// Whether to request real-time priority, locked memory and waking cores.
    pub realtime: bool,
    /// Mutes and stops it from any thread.
    pub run_control: RunControl,
    /// Knows the heat of the device's coils; `None` lets anybody play.
    pub coil_monitor: Option<Box<dyn CoilMonitor>>,
}

/// Why a run does not start or ends.
#[derive(Debug)]
#[non_exhaustive]
pub enum SessionError {
    /// The device cannot be opened.
    Device(OpenError),
    /// Playing on the device is not allowed.
    Refused(Diagnostic),
    /// The system gives no thread.
    Thread(std::io::Error),
}

impl std::fmt::Display for SessionError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Device(e) => e.fmt(f),
            Self::Refused(d) => f.write_str(&d.message),
            Self::Thread(e) => write!(f, "the system gives no thread: {e}"),
        }
    }
}

impl std::error::Error for SessionError {}

/// A lost device, until it is back. A thread opens it, which may take seconds.
struct Loss {
    since: Instant,
    /// Why it could not be opened last; a new reason is reported.
    reason: String,
    news: Receiver<Result<Card, OpenError>>,
    /// Dropped with this, which ends the thread.
    _waits: Arc<()>,
}

/// A run. Dropping it ramps the output down, as [`stop`](Session::stop) does.
pub struct Session {
    graph_controller: GraphController,
    /// Who runs the ticks. Before the period of the device is known the player waits. Neither: a tick never
    /// ended, or the system gave no thread. The driver is dropped before the card, which plays its ramp.
    driver: Option<Driver<Player>>,
    waiting: Option<Box<Player>>,
    card: Option<Card>,
    options: SessionOptions,
    mic: Option<card::Recorder>,
    listener: Option<Listener>,
    meters: Arc<Meters>,
    machine: Option<Machine>,
    /// Whether refusals of the system were reported.
    told: bool,
    loss: Option<Loss>,
    /// Name of the device for a person, kept while it is lost.
    name: String,
    notices: Vec<String>,
    finished: Vec<Finished>,
    looked: Instant,
    views: u64,
    /// Xruns of earlier streams, and the loop's count when the open one began.
    xruns: [u64; 2],
    /// Dropped last, when the output is down.
    custody: Custody,
}

/// Remains of a run.
#[derive(Debug)]
pub struct Ended {
    /// The engine with its wiring; `None` if a tick never ended.
    pub player: Option<Player>,
    /// Its control side.
    pub graph_controller: GraphController,
    /// Figures of the whole run.
    pub view: View,
    /// Facts of each node at the end; empty if a tick never ended.
    pub facts: Vec<Vec<Fact>>,
}

impl Session {
    /// Opens the device and starts to play, or starts a timer without a device. `mic`: queue for recorded
    /// samples.
    ///
    /// # Errors
    /// The reason of the device or the system; nothing runs then.
    pub fn start(
        graph_controller: GraphController,
        mut player: Player,
        mic: Option<MicWriter>,
        mut options: SessionOptions,
    ) -> Result<Self, SessionError> {
        let (custody, monitor) = (Custody::new(graph_controller.limits()), options.coil_monitor.take());
        let tick_hz = graph_controller.schedule().tick_hz;
        player.obey(&options.run_control);
        let mut it = Self {
            graph_controller,
            driver: None,
            waiting: Some(Box::new(player)),
            card: None,
            listener: mic.as_ref().map(MicWriter::listener),
            mic: mic.map(|to| card::Recorder::new(to, options.realtime.then_some(PRIORITY))),
            meters: Arc::new(Meters::new(tick_hz)),
            machine: options.realtime.then(Machine::ask),
            options,
            told: false,
            loss: None,
            name: String::new(),
            notices: Vec::new(),
            finished: Vec::new(),
            looked: Instant::now(),
            views: 0,
            xruns: [0; 2],
            custody,
        };
        match it.options.device.clone() {
            Some(request) => {
                let card = Card::open(&request, it.mic.as_ref()).map_err(SessionError::Device)?;
                it.name = card.name();
                if let Some(monitor) = monitor {
                    let opened = Opened {
                        id: card.stream.id(),
                        name: it.name.clone(),
                        channels: it.graph_controller.channels_of(card.stream.channels()),
                        coils: Vec::new(),
                    };
                    it.notices.extend(it.custody.open(monitor, opened).map_err(SessionError::Refused)?);
                }
                // After a loss, exactly this device is reopened, even if the request named a default.
                it.options.device = Some(card.pinned(&request));
                it.notices.extend(card.stream.notes().iter().cloned());
                it.card = Some(card);
                it.advance()?;
            }
            None => it.keep_time()?,
        }
        Ok(it)
    }

    /// Control side of the graph.
    pub fn graph_controller(&mut self) -> &mut GraphController {
        &mut self.graph_controller
    }

    /// Mutes and stops it.
    pub fn run_control(&self) -> &RunControl {
        &self.options.run_control
    }

    /// Whether the run goes on: no tick panicked, and the requested device is there or may come back.
    pub fn goes_on(&self) -> bool {
        let given_up = self.loss.is_some() && !self.options.reconnect;
        !(self.failed() || given_up)
    }

    /// Whether a tick panicked or never ended.
    fn failed(&self) -> bool {
        let gone = self.driver.is_none() && self.waiting.is_none();
        gone || self.controls().is_some_and(|c| c.failed())
    }

    /// The driver's; `None` while nobody runs the ticks.
    fn controls(&self) -> Option<&Arc<Controls>> {
        self.driver.as_ref().map(Driver::controls)
    }

    /// Checks the device: handles a loss, reopens it. Call it some tens of times a second. Returns notices
    /// for a person, each once.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn poll(&mut self) -> Result<Vec<String>, SessionError> {
        self.finished.append(&mut self.graph_controller.collect());
        self.custody.poll();
        if let Some(reason) = self.card.as_ref().and_then(|card| card.stream.lost()).map(str::to_owned) {
            self.lose(&reason)?;
        }
        self.advance()?;
        self.come_back();
        self.tell_refusals();
        Ok(std::mem::take(&mut self.notices))
    }

    /// Swaps that the engine took over since the last call.
    pub fn finished(&mut self) -> Vec<Finished> {
        std::mem::take(&mut self.finished)
    }

    /// How the run stands.
    pub fn condition(&self) -> Condition {
        match (self.controls(), &self.loss) {
            _ if self.failed() => Condition::Failed,
            _ if self.run_control().stopping() => Condition::Stopping,
            (_, Some(_)) => Condition::Lost,
            _ if self.run_control().muted() => Condition::Muted,
            // The device is back and does not play yet.
            _ if self.card.as_ref().is_some_and(|card| !card.playing) => Condition::Starting,
            (Some(controls), None) if controls.up() => Condition::Playing,
            _ => Condition::Starting,
        }
    }

    /// Figures now.
    pub fn view(&mut self) -> View {
        let since = self.looked.elapsed();
        self.looked = Instant::now();
        self.views += 1;
        let schedule = self.graph_controller.schedule().clone();
        let ticks = self.meters.next_tick();
        let mut view = View {
            number: self.views,
            condition: self.condition(),
            muted: self.run_control().muted(),
            strength: self.run_control().strength(),
            clock: self.driver.as_ref().map_or("", |d| d.clock().name()).into(),
            device: self.name.clone(),
            period_frames: self.card.as_ref().and_then(|c| c.stream.period()).unwrap_or(0),
            ticks,
            seconds: ticks as f64 / f64::from(schedule.tick_hz),
            timing: self.meters.timing(),
            underruns: self.meters.underruns.get(),
            lost_samples: self.meters.lost_samples.get(),
            guarded: self.graph_controller.limits().seen.changed(),
            xruns: self.xruns(),
            losses: self.meters.losses.get(),
            skipped_ticks: self.meters.skipped_ticks.get(),
            recording_gaps: self.listener.as_ref().map_or(0, Listener::gaps),
            peak: self.controls().map_or(0.0, |c| c.peak()),
            ..View::default()
        };
        self.graph_controller.look(&mut view, since);
        view.latency_ms = self.latency(&view);
        view
    }

    /// Xruns of all streams. The loop over callback times sees a gap, and some hosts report one, most often
    /// the same: of each stream the larger count is taken.
    fn xruns(&self) -> u64 {
        let reported = self.card.as_ref().map_or(0, |card| card.stream.stats().xruns);
        self.xruns[0] + reported.max(self.meters.xruns.get() - self.xruns[1])
    }

    /// Items of the latency from the hand to the actuator, in milliseconds.
    fn latency(&self, view: &View) -> Vec<(String, f64)> {
        let Some(controls) = self.controls() else { return Vec::new() };
        if self.options.device.is_some() && self.card.is_none() {
            // Nothing is heard.
            return Vec::new();
        }
        let delay = view.sources.iter().map(|s| s.delay_ms).fold(0.0, f64::max);
        let mut items = Vec::new();
        if !view.sources.is_empty() {
            items.push(("hand: reading delay".to_owned(), delay));
        }
        let schedule = self.graph_controller.schedule();
        items.push(("tick: mean wait for the next one".to_owned(), 500.0 / f64::from(schedule.tick_hz)));
        items.push(("clock: lead before the callback".to_owned(), controls.lead_ns() as f64 * 1e-6));
        items.extend(latency(schedule));
        if let Some(card) = &self.card {
            items.push(("device: callback to sound".to_owned(), card.stream.stats().latency_ms));
        }
        items
    }

    /// Ramps the output down and ends the run.
    pub fn stop(mut self) -> Ended {
        let before = self.view();
        let mut player = self.take_player(Driver::stop);
        self.custody.note();
        let mut view = self.view();
        // The stopped driver has no clock and no latency.
        (view.clock, view.latency_ms) = (before.clock, before.latency_ms);
        view.condition =
            if before.condition == Condition::Failed { Condition::Failed } else { Condition::Stopping };
        let facts = player.as_mut().map(Player::facts).unwrap_or_default();
        Ended { player, graph_controller: self.graph_controller, view, facts }
    }

    /// Answers of the system to the real-time requests.
    pub fn grants(&self) -> Option<Grants> {
        let priority = self.controls()?.priority();
        Some(self.machine.as_ref()?.grants(priority))
    }

    fn driver_options(&self) -> Options {
        let mut options = Options::new(self.meters.clone());
        options.start_s = self.options.start_s;
        options.run_control = self.options.run_control.clone();
        options.limits = Some(self.graph_controller.limits().shared.clone());
        if !self.options.realtime {
            options.priority = None;
        }
        options
    }

    /// Takes the player; from a driver by [`Driver::stop`] or [`Driver::take`]. `None` if a tick does not
    /// end.
    fn take_player(&mut self, end: fn(Driver<Player>) -> Option<Player>) -> Option<Player> {
        match self.driver.take() {
            Some(driver) => end(driver),
            None => self.waiting.take().map(|player| *player),
        }
    }

    /// Starts the driver once the device's period is known.
    fn advance(&mut self) -> Result<(), SessionError> {
        let Some(card) = self.card.as_ref().filter(|card| !card.playing) else { return Ok(()) };
        let (calls, period) = card.heard();
        let known = self.options.clock.is_some() || calls >= ENOUGH;
        if !known && card.opened.elapsed() < LISTEN {
            return Ok(());
        }
        let (rate_hz, tick_hz) = (card.stream.rate_hz(), self.graph_controller.schedule().tick_hz);
        // A device that has not called yet may call with any number of frames.
        let called = if card.bunches() { period } else { card.stream.period().unwrap_or(period) };
        let clock = choose(self.options.clock, called.max(1), rate_hz, tick_hz);
        let clock = if period == 0 && self.options.clock.is_none() { Clock::Paced } else { clock };
        let Some(player) = self.take_player(Driver::stop) else { return Ok(()) };
        let options = Options { seen_frames: period, ..self.driver_options() };
        let Some(card) = &mut self.card else { return Ok(()) };
        self.driver = Some(match clock {
            Clock::Callback => {
                let (driver, half) = callback(player, &options);
                card.give(half);
                driver
            }
            Clock::Paced => {
                let (driver, half) = paced(player, &options).map_err(SessionError::Thread)?;
                card.give(half);
                driver
            }
            Clock::Timer => timer(player, &options).map_err(SessionError::Thread)?,
        });
        card.playing = true;
        Ok(())
    }

    fn keep_time(&mut self) -> Result<(), SessionError> {
        let Some(player) = self.take_player(Driver::take) else { return Ok(()) };
        self.driver = Some(timer(player, &self.driver_options()).map_err(SessionError::Thread)?);
        Ok(())
    }

    fn lose(&mut self, reason: &str) -> Result<(), SessionError> {
        self.meters.losses.add(1);
        let what = if self.options.reconnect { "; it will go on when the device is back" } else { "" };
        self.notices.push(format!("`{}` is lost: {reason}{what}", self.name));
        self.xruns = [self.xruns(), self.meters.xruns.get()];
        self.card = None;
        let (tell, news) = channel();
        let waits = Arc::new(());
        if self.options.reconnect {
            let (request, mic) = (self.options.device.clone().unwrap_or_default(), self.mic.clone());
            let waits = Arc::downgrade(&waits);
            let open = move || {
                let mut back = false;
                while !back {
                    std::thread::sleep(RETRY);
                    if waits.strong_count() == 0 {
                        return;
                    }
                    let card = Card::open(&request, mic.as_ref());
                    back = card.is_ok();
                    let _ = tell.send(card);
                }
            };
            let thread = std::thread::Builder::new().name("asperity-open".into());
            thread.spawn(open).map_err(SessionError::Thread)?;
        }
        self.loss = Some(Loss { since: Instant::now(), reason: String::new(), news, _waits: waits });
        // Ticks go on, for hands and forces.
        self.keep_time()
    }

    /// Takes a lost device when it is open again.
    fn come_back(&mut self) {
        let Some(loss) = &mut self.loss else { return };
        match loss.news.try_recv() {
            Ok(Ok(card)) => {
                self.name = card.name();
                self.notices.push(format!("`{}` is back", self.name));
                self.custody.back(loss.since.elapsed());
                (self.card, self.loss) = (Some(card), None);
            }
            Ok(Err(error)) if error.reason != loss.reason => {
                self.notices.push(format!("`{}` is not back: {error}", self.name));
                loss.reason = error.reason;
            }
            _ => {}
        }
    }

    fn tell_refusals(&mut self) {
        let asked = self.controls().is_some_and(|c| c.priority() != Grant::NotAsked);
        if self.told || !asked {
            return;
        }
        self.told = true;
        let refused = self.grants().map(|g| g.refused()).unwrap_or_default();
        self.notices.extend(refused.into_iter().map(|line| format!("not granted: {line}")));
    }
}
