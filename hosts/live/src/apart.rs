//! Runs nodes of foreign code, each on a thread of its own.
//!
//! A thread cannot be stopped from outside, and nothing can replace the tick thread. So foreign code runs
//! on a thread that can be abandoned: the tick thread passes inputs, waits, and takes the outputs. If a
//! call does not return in time, its thread stays in it, with all memory that the call may touch, and the
//! graph goes on without the node.
//!
//! The two threads exchange calls, answers and their data over queues, without locks or allocations.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::Thread;
use std::time::{Duration, Instant};

use asperity_node::{
    Buffer, Fact, Fault, InputRef, Inputs, NodeKind, Outputs, Prepared, Processor, Setup, State, Status,
    Tick, Wiring,
};
use asperity_numbers::denormals::Flushed;
use ringbuf::traits::{Consumer, Observer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

use crate::realtime::ask_priority;

/// Longest call before the node is abandoned. A thread that the machine delays returns sooner.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time to wait for an answer awake: most come within it, and waking up takes half as long again.
const AWAKE: Duration = Duration::from_micros(200);
/// Time after which a thread without calls looks whether it is abandoned.
const IDLE: Duration = Duration::from_secs(1);
/// Time between two looks for an answer after that.
const NAP: Duration = Duration::from_micros(50);

/// The same kind, whose nodes run on threads of their own. With `priority`, these request a real-time
/// priority.
pub fn apart(kind: Arc<NodeKind>, priority: Option<i32>) -> Arc<NodeKind> {
    Arc::new(Arc::unwrap_or_clone(kind).wrapped(move |setup, node| {
        let apart = Apart::start(node.processor, Desk::new(setup), setup.id, priority)
            .map_err(|e| setup.params.node_error(format!("no thread for this node: {e}")))?;
        Ok(Prepared { processor: Box::new(apart), ..node })
    }))
}

/// A call on the thread. Its arguments and answers lie on the desk.
type Job = fn(&mut dyn Processor, &mut Desk) -> Result<(), Fault>;

/// Data that both threads use in turn.
struct Desk {
    index: u64,
    tick_hz: u32,
    /// Copies of the inputs, and a last one that replaces an input of another kind.
    inputs: Vec<Buffer>,
    map: Vec<InputRef>,
    outputs: Vec<Buffer>,
    bytes: Vec<u8>,
    /// Numbers that go in: ticks or an index, a value. `count` and `flag` also come back.
    count: usize,
    value: f64,
    flag: bool,
    status: Status,
    facts: Vec<Fact>,
}

impl Desk {
    fn new(setup: &Setup<'_>) -> Self {
        let make = |wiring: &Wiring| match &wiring.port {
            Some(port) => Buffer::new(port, setup.tick_hz),
            None => Buffer::constant(0, 0.0),
        };
        Self::over(setup.inputs.iter().map(make).collect(), setup.outputs.iter().map(make).collect())
    }

    fn over(mut inputs: Vec<Buffer>, outputs: Vec<Buffer>) -> Self {
        let map = vec![InputRef { buffer: 0, connected: false }; inputs.len()];
        inputs.push(Buffer::constant(0, 0.0));
        Self {
            index: 0,
            tick_hz: 0,
            inputs,
            map,
            outputs,
            bytes: Vec::new(),
            count: 0,
            value: 0.0,
            flag: false,
            status: Status::Continue,
            facts: Vec::new(),
        }
    }

    /// Takes a tick's inputs. Allocates nothing.
    fn take(&mut self, tick: &Tick<'_>) {
        (self.index, self.tick_hz) = (tick.index, tick.tick_hz);
        let nothing = self.map.len();
        for (i, (to, entry)) in self.inputs.iter_mut().zip(&mut self.map).enumerate() {
            let copied = tick.inputs.buffer(i).is_some_and(|from| to.copy_from(from));
            let buffer = if copied { i } else { nothing };
            *entry = InputRef { buffer: buffer as u32, connected: tick.inputs.connected(i) };
        }
    }

    /// Swaps the outputs with the engine's, after copying their content.
    fn lend(&mut self, tick: &mut Tick<'_>) {
        for (ours, theirs) in self.outputs.iter_mut().zip(tick.outputs.buffers()) {
            if ours.copy_from(theirs) {
                std::mem::swap(ours, theirs);
            }
        }
    }

    fn give_back(&mut self, tick: &mut Tick<'_>) {
        self.outputs.iter_mut().zip(tick.outputs.buffers()).for_each(|(a, b)| std::mem::swap(a, b));
    }

    /// Runs `call` with this data as the tick.
    fn tick<T>(&mut self, call: impl FnOnce(&mut Tick<'_>) -> T) -> T {
        let inputs = Inputs::new(&self.inputs, &[], self.inputs.len(), &self.map);
        let outputs = Outputs::new(&mut self.outputs);
        call(&mut Tick { index: self.index, tick_hz: self.tick_hz, inputs, outputs })
    }
}

/// A job, or the end of the node.
type Called = (Option<Job>, Desk);
type Answered = (Result<(), Fault>, Desk);

/// A node whose calls run on a thread of its own.
struct Apart {
    thread: Thread,
    calls: HeapProd<Called>,
    answers: HeapCons<Answered>,
    /// `None` while the thread works on it, and once it is abandoned.
    desk: Option<Desk>,
    fault: Option<Fault>,
}

impl Apart {
    fn start(node: Box<dyn Processor>, desk: Desk, id: &str, priority: Option<i32>) -> std::io::Result<Self> {
        let (calls, called) = HeapRb::new(1).split();
        let (answered, answers) = HeapRb::new(1).split();
        let run = move || work(called, answered, node, priority);
        let thread = std::thread::Builder::new().name(format!("asperity-{id}")).spawn(run)?;
        Ok(Self { thread: thread.thread().clone(), calls, answers, desk: Some(desk), fault: None })
    }

    /// Runs a call on the thread, and returns the desk. An abandoned thread answers [`Fault::Stuck`].
    fn ask(&mut self, before: impl FnOnce(&mut Desk), job: Option<Job>) -> Result<&mut Desk, Fault> {
        let mut desk = self.desk.take().ok_or(Fault::Stuck)?;
        before(&mut desk);
        // There is room: the call before is answered.
        let _ = self.calls.try_push((job, desk));
        self.thread.unpark();
        let begun = Instant::now();
        loop {
            if let Some((answer, desk)) = self.answers.try_pop() {
                let desk = self.desk.insert(desk);
                return answer.map(|()| desk);
            }
            match begun.elapsed() {
                waited if waited > PATIENCE => return Err(Fault::Stuck),
                waited if waited > AWAKE => std::thread::sleep(NAP),
                _ => std::hint::spin_loop(),
            }
        }
    }

    /// Runs a call; a fault is kept for [`Processor::fault`], and the desk is returned without one.
    fn tell(&mut self, before: impl FnOnce(&mut Desk), job: Job) -> Option<&mut Desk> {
        self.fault = self.ask(before, Some(job)).err();
        self.desk.as_mut().filter(|_| self.fault.is_none())
    }
}

impl Drop for Apart {
    /// The thread drops the node; if that does not return, the thread is abandoned too.
    fn drop(&mut self) {
        let _ = self.ask(|_| {}, None);
    }
}

/// The thread: runs calls until it is ended or abandoned.
fn work(
    mut calls: HeapCons<Called>,
    mut answers: HeapProd<Answered>,
    mut node: Box<dyn Processor>,
    priority: Option<i32>,
) {
    // As on the thread that ticks.
    let _flushed = Flushed::new();
    if let Some(priority) = priority {
        ask_priority(priority);
    }
    while calls.write_is_held() || !calls.is_empty() {
        let Some((job, mut desk)) = calls.try_pop() else {
            std::thread::park_timeout(IDLE);
            continue;
        };
        let Some(job) = job else {
            let answer = contain(|| {
                drop(node);
                Ok(())
            });
            let _ = answers.try_push((answer, desk));
            return;
        };
        let answer = contain(|| job(&mut *node, &mut desk));
        let _ = answers.try_push((answer, desk));
    }
}

/// Runs foreign code. After a panic the engine restarts the node, or stops calling it.
fn contain(f: impl FnOnce() -> Result<(), Fault>) -> Result<(), Fault> {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|payload| {
        // It may panic itself when it is dropped.
        std::mem::forget(payload);
        Err(Fault::Panicked)
    })
}

// Every call stands here, so that a new one is not forgotten.
#[warn(clippy::missing_trait_methods)]
impl Processor for Apart {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        let before = |desk: &mut Desk| {
            desk.take(tick);
            desk.lend(tick);
        };
        let run: Job = |node, desk| {
            desk.status = desk.tick(|tick| node.run(tick))?;
            Ok(())
        };
        let status = self.tell(before, run).map(|desk| desk.status);
        // In any case. Buffers that an abandoned thread keeps are copied in the engine.
        if let Some(desk) = &mut self.desk {
            desk.give_back(tick);
        }
        status.unwrap_or(Status::Error(u32::MAX))
    }

    fn reset(&mut self) {
        self.tell(|_| {}, |node, _| node.ask(|n| n.reset()));
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        let wants: Job = |node, desk| {
            desk.flag = desk.tick(|tick| node.ask(|n| n.wants(tick)))?;
            Ok(())
        };
        self.tell(|desk| desk.take(tick), wants).is_some_and(|desk| desk.flag)
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        let absorb: Job = |node, desk| desk.tick(|tick| node.ask(|n| n.absorb(tick)));
        self.tell(|desk| desk.take(tick), absorb);
    }

    fn elapsed(&mut self, ticks: u64) {
        let elapsed: Job = |node, desk| node.ask(|n| n.elapsed(desk.count as u64));
        self.tell(|desk| desk.count = ticks as usize, elapsed);
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        let set: Job = |node, desk| node.ask(|n| n.set_parameter(desk.count, desk.value));
        self.tell(|desk| (desk.count, desk.value) = (index, value), set);
    }

    fn state(&mut self, state: &mut State<'_>) {
        let it = RefCell::new(self);
        let size = || {
            let size: Job = |node, desk| {
                desk.count = node.state_size();
                desk.bytes.reserve(desk.count);
                Ok(())
            };
            it.borrow_mut().ask(|_| {}, Some(size)).map_or(0, |desk| desk.count)
        };
        let save = |bytes: &mut [u8]| {
            let save: Job = |node, desk| {
                desk.bytes.resize(desk.count, 0);
                let saved = node.save(&mut desk.bytes);
                (desk.flag, desk.count) = (saved.is_some(), saved.unwrap_or(0));
                Ok(())
            };
            let mut it = it.borrow_mut();
            let desk = it.ask(|desk| desk.count = bytes.len(), Some(save)).ok().filter(|desk| desk.flag)?;
            bytes.get_mut(..desk.count)?.copy_from_slice(desk.bytes.get(..desk.count)?);
            Some(desk.count)
        };
        let restore = |bytes: &[u8]| {
            let before = |desk: &mut Desk| {
                // There is room: the size was asked first.
                desk.bytes.clear();
                desk.bytes.extend_from_slice(bytes);
            };
            let restore: Job = |node, desk| {
                // The host resets it where that fails.
                desk.flag = State::restore(&desk.bytes, |s| node.state(s));
                Ok(())
            };
            it.borrow_mut().ask(before, Some(restore)).is_ok_and(|desk| desk.flag)
        };
        state.opaque(size, save, restore);
    }

    fn facts(&mut self) -> Vec<Fact> {
        let facts: Job = |node, desk| {
            desk.facts = node.facts();
            Ok(())
        };
        self.ask(|_| {}, Some(facts)).map(|desk| std::mem::take(&mut desk.facts)).unwrap_or_default()
    }

    fn warm(&mut self, heat: f64) {
        self.tell(|desk| desk.value = heat, |node, desk| node.ask(|n| n.warm(desk.value)));
    }

    fn attenuate(&mut self, strength: f32) {
        let attenuate: Job = |node, desk| node.ask(|n| n.attenuate(desk.value as f32));
        self.tell(|desk| desk.value = f64::from(strength), attenuate);
    }

    fn fault(&mut self) -> Option<Fault> {
        self.fault.take()
    }

    fn inner(&mut self, _call: &mut dyn FnMut(&mut dyn Processor)) {}
}

#[cfg(test)]
#[path = "apart_tests.rs"]
mod tests;
