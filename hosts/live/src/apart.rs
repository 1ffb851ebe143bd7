//! Runs nodes of foreign code, each on a thread of its own.
//!
//! A thread cannot be stopped from outside, and nothing can replace the tick thread. So foreign code runs
//! on a thread that can be abandoned: the tick thread passes inputs, waits, and takes the outputs. If a
//! call does not return in time, its thread stays in it, with all memory that the call may touch, and the
//! graph goes on without the node.
//!
//! Both threads share a standard mutex, also the tick thread: it waits for the answer in any case. Its
//! futex never allocates; parking_lot's may, for a thread that waits for the first time.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use asperity_node::{
    Buffer, Fact, Fault, InputRef, Inputs, NodeKind, Outputs, Prepared, Processor, Setup, State, Status,
    Tick, Wiring,
};
use asperity_numbers::denormals::Flushed;

use crate::realtime::ask_priority;

/// Longest call before the node is abandoned. A thread that the machine delays returns sooner.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time to wait for an answer awake: most come within it, and waking up takes half as long again.
const AWAKE: Duration = Duration::from_micros(200);

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

/// Mailbox of the two threads.
struct Mail {
    call: Option<Call>,
    answer: Option<Result<Answer, Fault>>,
    /// `None` while the thread works on it.
    desk: Option<Desk>,
}

struct Shared {
    mail: Mutex<Mail>,
    called: Condvar,
    answered: Condvar,
    /// Whether there is an answer; read without the lock.
    ready: AtomicBool,
    /// The thread is abandoned.
    left: AtomicBool,
}

impl Shared {
    fn mail(&self) -> MutexGuard<'_, Mail> {
        self.mail.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A node whose calls run on a thread of its own.
struct Apart {
    shared: Arc<Shared>,
    /// Fault of the last call.
    fault: Option<Fault>,
}

impl Apart {
    fn start(node: Box<dyn Processor>, desk: Desk, id: &str, priority: Option<i32>) -> std::io::Result<Self> {
        let mail = Mail { call: None, answer: None, desk: Some(desk) };
        let shared = Arc::new(Shared {
            mail: Mutex::new(mail),
            called: Condvar::new(),
            answered: Condvar::new(),
            ready: AtomicBool::new(false),
            left: AtomicBool::new(false),
        });
        let apart = Self { shared: Arc::clone(&shared), fault: None };
        let name = format!("asperity-{id}");
        std::thread::Builder::new().name(name).spawn(move || work(&shared, node, priority))?;
        Ok(apart)
    }

    /// Runs a call on the thread; `before` and `after` access the desk. An abandoned thread answers
    /// [`Fault::Stuck`].
    fn ask<T>(
        &self,
        call: Call,
        before: impl FnOnce(&mut Desk),
        after: impl FnOnce(Answer, &mut Desk) -> T,
    ) -> Result<T, Fault> {
        let shared = &*self.shared;
        if shared.left.load(SeqCst) {
            return Err(Fault::Stuck);
        }
        let mut mail = shared.mail();
        if let Some(desk) = &mut mail.desk {
            before(desk);
        }
        mail.call = Some(call);
        shared.ready.store(false, SeqCst);
        drop(mail);
        shared.called.notify_one();
        let begun = Instant::now();
        while !shared.ready.load(SeqCst) && begun.elapsed() < AWAKE {
            std::hint::spin_loop();
        }
        let unanswered = |mail: &mut Mail| mail.answer.is_none();
        let waited = shared.answered.wait_timeout_while(shared.mail(), PATIENCE, unanswered);
        let (mut mail, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let Mail { answer, desk, .. } = &mut *mail;
        match (answer.take(), desk) {
            (Some(answer), Some(desk)) => answer.map(|answer| after(answer, desk)),
            _ => {
                shared.left.store(true, SeqCst);
                Err(Fault::Stuck)
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
fn work(shared: &Shared, node: Box<dyn Processor>, priority: Option<i32>) {
    let mut node = Some(node);
    // As on the thread that ticks.
    let _flushed = Flushed::new();
    if let Some(priority) = priority {
        ask_priority(priority);
    }
    loop {
        let (call, desk) = {
            let nothing = |mail: &mut Mail| mail.call.is_none();
            let mail = shared.called.wait_while(shared.mail(), nothing);
            let mut mail = mail.unwrap_or_else(PoisonError::into_inner);
            (mail.call.take(), mail.desk.take())
        };
        let (Some(call), Some(mut desk)) = (call, desk) else { return };
        let answer = match (&call, &mut node) {
            (Call::End, _) | (_, None) => contain(|| {
                drop(node.take());
                Ok(Answer::Done)
            }),
            (_, Some(node)) => contain(|| answer(&mut **node, call, &mut desk)),
        };
        let mut mail = shared.mail();
        (mail.answer, mail.desk) = (Some(answer), Some(desk));
        shared.ready.store(true, SeqCst);
        shared.answered.notify_one();
        drop(mail);
        if node.is_none() || shared.left.load(SeqCst) {
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
        Call::Restore => Answer::Flag(node.restore(&desk.bytes)),
        Call::Facts => Answer::Facts(node.facts()),
        Call::End => Answer::Done,
    })
}

/// Runs foreign code. After a panic the engine restarts the node, or stops calling it.
fn contain<T>(f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    // The payload of a panic may panic itself when it is dropped.
    let forget = |payload: Box<dyn Any + Send>| std::mem::forget(payload);
    catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|payload| {
        forget(payload);
        Err(Fault::Panicked)
    })
}

// Every call stands here, so that a new one is not forgotten.
#[warn(clippy::missing_trait_methods)]
impl Processor for Apart {
    fn process(&mut self, tick: &mut Tick<'_>) -> Status {
        if self.shared.left.load(SeqCst) {
            self.fault = Some(Fault::Stuck);
            return Status::Error(u32::MAX);
        }
        let before = |desk: &mut Desk| {
            desk.take(tick);
            desk.lend(tick);
        };
        let answer = self.ask(Call::Process, before, |answer, _| answer);
        // In any case. Buffers that an abandoned thread keeps are copied in the engine.
        if let Some(desk) = &mut self.shared.mail().desk {
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
        let size = || match self.ask(Call::StateSize, |_| {}, |answer, _| answer) {
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
            self.ask(Call::Save(room), |_| {}, after).ok().flatten()
        };
        let restore = |bytes: &[u8]| {
            let before = |desk: &mut Desk| {
                // There is room: the size was asked first.
                desk.bytes.clear();
                desk.bytes.extend_from_slice(bytes);
            };
            self.ask(Call::Restore, before, |answer, _| matches!(answer, Answer::Flag(true))).unwrap_or(false)
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
