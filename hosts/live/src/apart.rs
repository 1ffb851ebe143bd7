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

/// Call to the thread. Inputs, outputs and bytes lie on the desk.
enum Call {
    Process,
    Wants,
    Absorb,
    Reset,
    Elapsed(u64),
    SetParameter(usize, f64),
    Warm(f64),
    StateSize,
    Save(usize),
    Restore,
    Facts,
    End,
}

/// Answer of the thread.
enum Answer {
    Status(Status),
    Flag(bool),
    Done,
    Size(usize),
    Saved(Option<usize>),
    Facts(Vec<Fact>),
}

/// Data that both threads use in turn.
struct Desk {
    index: u64,
    tick_hz: u32,
    /// Copies of the inputs, and a last one that replaces an input of another kind.
    inputs: Vec<Buffer>,
    map: Vec<InputRef>,
    outputs: Vec<Buffer>,
    bytes: Vec<u8>,
}

impl Desk {
    fn new(setup: &Setup<'_>) -> Self {
        let make = |wiring: &Wiring| match &wiring.port {
            Some(port) => Buffer::new(port, setup.tick_hz),
            None => Buffer::constant(0, 0.0),
        };
        Self::over(setup.inputs.iter().map(make).collect(), setup.outputs.iter().map(make).collect())
    }

    /// One with these inputs and outputs.
    fn over(mut inputs: Vec<Buffer>, outputs: Vec<Buffer>) -> Self {
        let map = vec![InputRef { buffer: 0, connected: false }; inputs.len()];
        inputs.push(Buffer::constant(0, 0.0));
        Self { index: 0, tick_hz: 0, inputs, map, outputs, bytes: Vec::new() }
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

    /// Swaps them back.
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

type Called = (Call, Desk);
type Answered = (Result<Answer, Fault>, Desk);

/// A node whose calls run on a thread of its own.
struct Apart {
    thread: Thread,
    calls: HeapProd<Called>,
    answers: HeapCons<Answered>,
    /// `None` while the thread works on it, and once it is abandoned.
    desk: Option<Desk>,
    /// Fault of the last call.
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

    /// Runs a call on the thread; `before` and `after` access the desk. An abandoned thread answers
    /// [`Fault::Stuck`].
    fn ask<T>(
        &mut self,
        call: Call,
        before: impl FnOnce(&mut Desk),
        after: impl FnOnce(Answer, &mut Desk) -> T,
    ) -> Result<T, Fault> {
        let mut desk = self.desk.take().ok_or(Fault::Stuck)?;
        before(&mut desk);
        // There is room: the call before is answered.
        let _ = self.calls.try_push((call, desk));
        self.thread.unpark();
        let begun = Instant::now();
        loop {
            if let Some((answer, desk)) = self.answers.try_pop() {
                let desk = self.desk.insert(desk);
                return answer.map(|answer| after(answer, desk));
            }
            match begun.elapsed() {
                waited if waited > PATIENCE => return Err(Fault::Stuck),
                waited if waited > AWAKE => std::thread::sleep(NAP),
                _ => std::hint::spin_loop(),
            }
        }
    }

    /// Runs a call without answer. A fault is kept for [`Processor::fault`].
    fn tell(&mut self, call: Call, before: impl FnOnce(&mut Desk)) {
        self.fault = self.ask(call, before, |_, _| {}).err();
    }
}

impl Drop for Apart {
    /// The thread drops the node; if that does not return, the thread is abandoned too.
    fn drop(&mut self) {
        let _ = self.ask(Call::End, |_| {}, |_, _| {});
    }
}

/// The thread: runs calls until it is ended or abandoned.
fn work(
    mut calls: HeapCons<Called>,
    mut answers: HeapProd<Answered>,
    node: Box<dyn Processor>,
    priority: Option<i32>,
) {
    let mut node = Some(node);
    // As on the thread that ticks.
    let _flushed = Flushed::new();
    if let Some(priority) = priority {
        ask_priority(priority);
    }
    while calls.write_is_held() || !calls.is_empty() {
        let Some((call, mut desk)) = calls.try_pop() else {
            std::thread::park_timeout(IDLE);
            continue;
        };
        let answer = contain(|| match (call, &mut node) {
            (Call::End, _) | (_, None) => {
                drop(node.take());
                Ok(Answer::Done)
            }
            (call, Some(node)) => answer(&mut **node, call, &mut desk),
        });
        let _ = answers.try_push((answer, desk));
        if node.is_none() {
            return;
        }
    }
}

fn answer(node: &mut dyn Processor, call: Call, desk: &mut Desk) -> Result<Answer, Fault> {
    Ok(match call {
        Call::Process => Answer::Status(desk.tick(|tick| node.run(tick))?),
        Call::Wants => Answer::Flag(desk.tick(|tick| node.ask(|n| n.wants(tick)))?),
        Call::Absorb => desk.tick(|tick| node.ask(|n| n.absorb(tick))).map(|()| Answer::Done)?,
        Call::Reset => node.ask(|n| n.reset()).map(|()| Answer::Done)?,
        Call::Elapsed(ticks) => node.ask(|n| n.elapsed(ticks)).map(|()| Answer::Done)?,
        Call::SetParameter(index, value) => {
            node.ask(|n| n.set_parameter(index, value)).map(|()| Answer::Done)?
        }
        Call::Warm(heat) => node.ask(|n| n.warm(heat)).map(|()| Answer::Done)?,
        Call::StateSize => {
            let size = node.state_size();
            desk.bytes.reserve(size);
            Answer::Size(size)
        }
        Call::Save(room) => {
            desk.bytes.resize(room, 0);
            Answer::Saved(node.save(&mut desk.bytes))
        }
        // The host resets it where that fails.
        Call::Restore => Answer::Flag(State::restore(&desk.bytes, |s| node.state(s))),
        Call::Facts => Answer::Facts(node.facts()),
        Call::End => Answer::Done,
    })
}

/// Runs foreign code. After a panic the engine restarts the node, or stops calling it.
fn contain<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
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
        let answer = self.ask(Call::Process, before, |answer, _| answer);
        // In any case. Buffers that an abandoned thread keeps are copied in the engine.
        if let Some(desk) = &mut self.desk {
            desk.give_back(tick);
        }
        self.fault = answer.as_ref().err().copied();
        match answer {
            Ok(Answer::Status(status)) => status,
            _ => Status::Error(u32::MAX),
        }
    }

    fn reset(&mut self) {
        self.tell(Call::Reset, |_| {});
    }

    fn wants(&mut self, tick: &mut Tick<'_>) -> bool {
        let answer = self.ask(Call::Wants, |desk| desk.take(tick), |answer, _| answer);
        self.fault = answer.as_ref().err().copied();
        matches!(answer, Ok(Answer::Flag(true)))
    }

    fn absorb(&mut self, tick: &mut Tick<'_>) {
        self.tell(Call::Absorb, |desk| desk.take(tick));
    }

    fn elapsed(&mut self, ticks: u64) {
        self.tell(Call::Elapsed(ticks), |_| {});
    }

    fn set_parameter(&mut self, index: usize, value: f64) {
        self.tell(Call::SetParameter(index, value), |_| {});
    }

    fn state(&mut self, state: &mut State<'_>) {
        let it = RefCell::new(self);
        let size = || match it.borrow_mut().ask(Call::StateSize, |_| {}, |answer, _| answer) {
            Ok(Answer::Size(size)) => size,
            _ => 0,
        };
        let save = |bytes: &mut [u8]| {
            let room = bytes.len();
            let after = |answer, desk: &mut Desk| match answer {
                Answer::Saved(Some(len)) => {
                    bytes.get_mut(..len)?.copy_from_slice(desk.bytes.get(..len)?);
                    Some(len)
                }
                _ => None,
            };
            it.borrow_mut().ask(Call::Save(room), |_| {}, after).ok().flatten()
        };
        let restore = |bytes: &[u8]| {
            let before = |desk: &mut Desk| {
                // There is room: the size was asked first.
                desk.bytes.clear();
                desk.bytes.extend_from_slice(bytes);
            };
            it.borrow_mut()
                .ask(Call::Restore, before, |answer, _| matches!(answer, Answer::Flag(true)))
                .unwrap_or(false)
        };
        state.opaque(size, save, restore);
    }

    fn facts(&mut self) -> Vec<Fact> {
        match self.ask(Call::Facts, |_| {}, |answer, _| answer) {
            Ok(Answer::Facts(facts)) => facts,
            _ => Vec::new(),
        }
    }

    fn warm(&mut self, heat: f64) {
        self.tell(Call::Warm(heat), |_| {});
    }

    fn fault(&mut self) -> Option<Fault> {
        self.fault.take()
    }

    fn inner(&mut self, _call: &mut dyn FnMut(&mut dyn Processor)) {}
}

#[cfg(test)]
#[path = "apart_tests.rs"]
mod tests;
