//! The control thread's end of an engine.

use std::fmt;
use std::sync::Arc;

use asperity_graph::{Compiled, LiveParam, Schedule};
use asperity_node::{ParamKind, Prepared};
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use super::build::{Running, build};
use super::plan::{Point, live_values, plan};
use super::report::{Change, Finished, SwapError, SwapReport};
use super::takeover::{Command, Link, Set, Swap};

/// Most swaps in progress. Each is taken over when the one before has faded.
pub const MAX_SWAPS: usize = 4;

/// Most commands waiting for the next tick.
const MAX_COMMANDS: usize = 256;

/// Changes a running [`Engine`](crate::Engine) from another thread. Neither waits for the other.
///
/// It knows the graph that the engine will run after all sent changes, and computes new changes against
/// it.
pub struct Controller {
    commands: HeapProd<Command>,
    retired: HeapCons<Box<Swap>>,
    schedule: Arc<Schedule>,
    /// Bytes of each node's state.
    sizes: Vec<usize>,
    /// Last values of each node's live parameters.
    live: Vec<Vec<f64>>,
    sent: u64,
    back: u64,
    finished: Vec<Finished>,
}

impl fmt::Debug for Controller {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut f = f.debug_struct("Controller");
        f.field("sent", &self.sent).field("under_way", &(self.sent - self.back)).finish_non_exhaustive()
    }
}

impl Controller {
    pub(crate) fn new(schedule: &Schedule, nodes: &mut [Prepared]) -> (Self, Link) {
        let (commands, engine_commands) = HeapRb::new(MAX_COMMANDS).split();
        let (engine_retired, retired) = HeapRb::new(MAX_SWAPS).split();
        let it = Self {
            commands,
            retired,
            sizes: nodes.iter_mut().map(|p| p.processor.state_size()).collect(),
            live: schedule.nodes.iter().map(live_values).collect(),
            schedule: Arc::new(schedule.clone()),
            sent: 0,
            back: 0,
            finished: Vec::new(),
        };
        (it, Link::new(engine_commands, engine_retired))
    }

    /// The graph that the engine will run after all sent changes.
    pub fn schedule(&self) -> &Arc<Schedule> {
        &self.schedule
    }

    /// Whether there is room for a [`swap`](Self::swap) now.
    pub fn ready(&mut self) -> bool {
        self.gather();
        self.sent - self.back < MAX_SWAPS as u64 && self.commands.vacant_len() > 0
    }

    /// Sends a changed graph to the engine. `changed` names nodes whose files changed although their
    /// parameters did not.
    ///
    /// Unchanged nodes continue; the others take over the state of the node of the same id and kind.
    /// Changed sources are crossfaded in 10 ms. The engine takes over at the start of a tick, after
    /// earlier swaps have faded.
    ///
    /// # Errors
    /// [`SwapError`] names the remedy. Then nothing is sent, and `compiled` is dropped: ask
    /// [`ready`](Self::ready) first.
    pub fn swap(&mut self, mut compiled: Compiled, changed: &[String]) -> Result<SwapReport, SwapError> {
        let (old, new) = (&self.schedule, &compiled.schedule);
        if old.tick_hz != new.tick_hz {
            return Err(SwapError::TickRate { running: old.tick_hz, asked: new.tick_hz });
        }
        if old.audio_hz != new.audio_hz {
            return Err(SwapError::AudioRate { running: old.audio_hz, asked: new.audio_hz });
        }
        if !self.commands.read_is_held() {
            return Err(SwapError::Stopped);
        }
        if !self.ready() {
            return Err(SwapError::Busy);
        }
        let old = self.schedule.clone();
        let sizes: Vec<usize> = compiled.nodes.iter_mut().map(|p| p.processor.state_size()).collect();
        let (fates, points) = plan(&old, &compiled.schedule, changed);
        let number = self.sent + 1;
        let running = Running { schedule: &old, sizes: &self.sizes, live: &self.live };
        let swap = build(number, &running, compiled, &fates, &points);
        let new = swap.body.schedule.clone();
        let nodes = new.nodes.iter().zip(&fates).map(|(node, fate)| (node.id.clone(), fate.change.clone()));
        let gone = old.nodes.iter().enumerate().filter(|(i, _)| !fates.iter().any(|f| f.old == Some(*i)));
        let parameter = |set: &Set| {
            let node = &new.nodes[set.node];
            let live = node.live.iter().find(|l| l.index == set.param);
            (format!("{}.{}", node.id, live.map_or("", |l| &l.name)), set.value)
        };
        let on_kept = |p: &&Point| p.reader.is_none_or(|(j, _)| fates[j].kept().is_some());
        let report = SwapReport {
            number,
            nodes: nodes.chain(gone.map(|(_, node)| (node.id.clone(), Change::Removed))).collect(),
            parameters: swap.sets.iter().map(parameter).collect(),
            crossfades: points.iter().filter(on_kept).count(),
        };
        if self.commands.try_push(Command::Swap(Box::new(swap))).is_err() {
            return Err(SwapError::Busy);
        }
        self.sent = number;
        self.sizes =
            fates.iter().zip(sizes).map(|(f, new)| f.kept().map_or(new, |i| self.sizes[i])).collect();
        self.live = new.nodes.iter().map(live_values).collect();
        self.schedule = new;
        Ok(report)
    }

    /// Sets a live parameter. A flag is 0 or 1, a choice the place of its word. A later [`swap`](Self::swap)
    /// sets it to the new graph's value.
    ///
    /// # Errors
    /// The text names the remedy; nothing is sent then.
    pub fn set_parameter(&mut self, node: &str, param: &str, value: f64) -> Result<(), String> {
        let at = self.schedule.index_of(node).ok_or_else(|| format!("there is no node `{node}`"))?;
        let live = &self.schedule.nodes[at].live;
        let Some(k) = live.iter().position(|l| l.name == param) else {
            let others: Vec<&str> = live.iter().map(|l| l.name.as_str()).collect();
            let others = if others.is_empty() { "" } else { &format!("; what can: {}", others.join(", ")) };
            return Err(format!("`{node}.{param}` cannot change while the node runs{others}"));
        };
        check(&live[k], value)?;
        if !self.commands.read_is_held() {
            return Err("the engine is gone".into());
        }
        let set = Set { node: at, param: live[k].index, value };
        let full = |_| "too much waits for the next tick: try again";
        self.commands.try_push(Command::Set(set)).map_err(full)?;
        self.live[at][k] = value;
        Ok(())
    }

    /// Drops what the engine gave back, and says which swaps are over since it was last asked.
    pub fn collect(&mut self) -> Vec<Finished> {
        self.gather();
        std::mem::take(&mut self.finished)
    }

    fn gather(&mut self) {
        while let Some(swap) = self.retired.try_pop() {
            self.back += 1;
            // The box holds the old graph now; a node that is rebuilt kept its id.
            let id = |old: usize| swap.body.schedule.nodes[old].id.clone();
            let anew = swap.rebuilt.iter().filter(|r| !r.adopted).map(|r| id(r.old)).collect();
            self.finished.push(Finished { number: swap.number, tick: swap.begun, anew });
        }
    }
}

/// Whether a live parameter may take a value.
fn check(live: &LiveParam, value: f64) -> Result<(), String> {
    let whole = |least: f64, most: f64| {
        let fits = value.fract() == 0.0 && (least..=most).contains(&value);
        (fits, format!("a whole number from {least} to {most}"))
    };
    let (fits, takes) = match &live.kind {
        ParamKind::Number(r) => {
            (r.contains(&value), format!("a number from {:?} to {:?}", r.start(), r.end()))
        }
        ParamKind::Integer(r) => whole(*r.start() as f64, *r.end() as f64),
        ParamKind::Flag => whole(0.0, 1.0),
        ParamKind::Choice(words) => whole(0.0, words.len().saturating_sub(1) as f64),
        ParamKind::Text | ParamKind::File | ParamKind::Numbers(_) | ParamKind::Texts => {
            (false, "nothing while the node runs".into())
        }
    };
    if fits { Ok(()) } else { Err(format!("`{}` cannot be {value}: it takes {takes}", live.name)) }
}
