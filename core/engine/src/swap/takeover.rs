//! The tick thread's part of a swap. Nothing here allocates, frees, locks or waits.

use asperity_graph::{GateSets, Step};
use asperity_node::{Buffer, Processor, Status, Tick};
use ringbuf::traits::{Consumer, Producer};
use ringbuf::{HeapCons, HeapProd};

use super::crossfade::{self, Crossfade, Ramp};
use crate::engine::Body;
use crate::slot::Now;

/// A request of the controller.
pub(crate) enum Command {
    Swap(Box<Swap>),
    Set(Set),
}

/// A new value of a live parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Set {
    pub(super) node: usize,
    pub(super) param: usize,
    pub(super) value: f64,
}

/// A graph on its way into an engine; afterwards the parts that the engine no longer needs.
pub(crate) struct Swap {
    pub(super) number: u64,
    /// The new graph with its shadows, as it runs during the fade. From the takeover on, the old graph.
    pub(super) body: Body,
    /// Steps of the new graph after the fade.
    pub(super) settled: Vec<Step>,
    pub(super) fades: Vec<Crossfade>,
    /// New and old index.
    pub(super) kept: Vec<(usize, usize)>,
    pub(super) rebuilt: Vec<Rebuilt>,
    /// Slot and old index.
    pub(super) shadows: Vec<(usize, usize)>,
    /// Old nodes that are not kept.
    pub(super) gone: Vec<usize>,
    pub(super) sets: Vec<Set>,
    /// Gate sets after the fade, for slots with other gate sets during the fade.
    pub(super) gate_sets: Vec<(usize, GateSets)>,
    /// Buffers fed by the host that other nodes continue with: new and old buffer.
    pub(super) fed: Vec<(usize, usize)>,
    /// The takeover happens in a tick that this divides, in which every new node runs.
    pub(super) every: u64,
    /// Tick of the takeover.
    pub(super) begun: u64,
}

/// A node that replaces another.
pub(super) struct Rebuilt {
    pub(super) new: usize,
    pub(super) old: usize,
    /// Memory for the state; `None` if the new node cannot use it.
    pub(super) state: Option<Box<[u8]>>,
    pub(super) adopted: bool,
}

/// The engine's end of its controller, and the swap that it is fading.
pub(crate) struct Link {
    commands: HeapCons<Command>,
    retired: HeapProd<Box<Swap>>,
    /// Taken from the ring, but not due yet.
    next: Option<Command>,
    pub(crate) fading: Option<(Box<Swap>, Ramp)>,
    /// Finished, but not given back yet.
    over: Option<Box<Swap>>,
    /// Number of swaps taken over.
    pub(crate) taken: u64,
    /// Faults of removed nodes.
    pub(crate) faults: u64,
}

impl Link {
    pub(super) fn new(commands: HeapCons<Command>, retired: HeapProd<Box<Swap>>) -> Self {
        Self { commands, retired, next: None, fading: None, over: None, taken: 0, faults: 0 }
    }

    /// Runs one crossfade of this tick.
    pub(crate) fn fade(&self, point: usize, buffers: &mut [Buffer]) {
        if let Some((swap, ramp)) = &self.fading
            && let Some(fade) = swap.fades.get(point)
        {
            fade.run(buffers, *ramp);
        }
    }

    /// Runs due commands before a tick.
    pub(crate) fn listen(&mut self, body: &mut Body, now: Now) {
        if let Some((_, ramp)) = &mut self.fading {
            ramp.tick = now.tick;
            if now.tick >= ramp.end {
                self.settle(body);
            }
        }
        if let Some(over) = self.over.take() {
            self.over = self.retired.try_push(over).err();
        }
        while let Some(command) = self.next.take().or_else(|| self.commands.try_pop()) {
            match command {
                Command::Set(set) => body.set(set, now),
                Command::Swap(swap)
                    if self.fading.is_some()
                        || self.over.is_some()
                        || !now.tick.is_multiple_of(swap.every) =>
                {
                    self.next = Some(Command::Swap(swap));
                    return;
                }
                Command::Swap(swap) => self.take_over(swap, body, now),
            }
        }
    }

    fn take_over(&mut self, mut swap: Box<Swap>, body: &mut Body, now: Now) {
        std::mem::swap(body, &mut swap.body);
        let old = &mut swap.body;
        for &(to, from) in &swap.fed {
            std::mem::swap(&mut body.buffers[to], &mut old.buffers[from]);
        }
        for it in &mut swap.rebuilt {
            let (to, from) = (&mut body.slots[it.new], &mut old.slots[it.old]);
            it.adopted = to.adopt(from, it.state.as_deref_mut());
            carry_controls(&mut body.buffers[to.outputs.clone()], &old.buffers[from.outputs.clone()]);
        }
        self.taken += 1;
        self.faults += swap.gone.iter().map(|&i| old.slots[i].report.faults).sum::<u64>();
        for &(to, from) in swap.kept.iter().chain(&swap.shadows) {
            let (to, from) = (&mut body.slots[to], &mut old.slots[from]);
            to.trade(from);
            let pairs = to.outputs.clone().zip(from.outputs.clone());
            pairs.for_each(|(to, from)| std::mem::swap(&mut body.buffers[to], &mut old.buffers[from]));
        }
        for fade in &mut swap.fades {
            let reader = |it: &&Rebuilt| fade.reader.is_some_and(|(node, _)| it.new == node);
            let Some(it) = swap.rebuilt.iter().find(reader) else { continue };
            if it.adopted {
                // It continues from what it read before, and still reads it.
                fade.through = fade.old.is_none();
            } else {
                fade.old = None;
            }
        }
        // So that an unchanged control does not count as changed.
        for fade in &swap.fades {
            if let (Some(mix), Some(old)) = (fade.mix, fade.old)
                && let Some((sources, mix)) = body.buffers.split_at_mut_checked(mix)
            {
                carry_controls(&mut mix[..1], &sources[old..=old]);
            }
        }
        swap.sets.iter().for_each(|set| body.set(*set, now));
        swap.begun = now.tick;
        let ticks = if swap.fades.is_empty() { 0 } else { crossfade::ticks(now.tick_hz) };
        let end = now.tick + ticks;
        let ramp = Ramp { begun: now.tick, end, tick: now.tick, tick_hz: now.tick_hz };
        self.fading = Some((swap, ramp));
        if ticks == 0 {
            self.settle(body);
            self.over = self.over.take().and_then(|over| self.retired.try_push(over).err());
        }
    }

    /// Ends a crossfade: readers get their new sources, and the parts that only the old graph needed go
    /// back.
    pub(crate) fn settle(&mut self, body: &mut Body) {
        let Some((mut swap, _)) = self.fading.take() else { return };
        for fade in &swap.fades {
            let Some((node, input)) = fade.reader else { continue };
            body.slots[node].inputs[input].buffer = fade.new as u32;
            // A reader of a control is called once with the final value, even if no control wakes it.
            if fade.rate_hz == 0 {
                body.slots[node].rouse();
            }
        }
        for (slot, gate_sets) in &mut swap.gate_sets {
            std::mem::swap(&mut body.slots[*slot].gate_sets, gate_sets);
        }
        for &(slot, old) in &swap.shadows {
            body.slots[slot].trade(&mut swap.body.slots[old]);
        }
        std::mem::swap(&mut body.steps, &mut swap.settled);
        self.over = Some(swap);
    }
}

impl Body {
    fn set(&mut self, set: Set, now: Now) {
        if let Some(slot) = self.slots.get_mut(set.node) {
            slot.set_parameter(set.param, set.value, now);
        }
    }
}

/// Copies controls, which hold their values until they are written, from one graph to the next.
fn carry_controls(to: &mut [Buffer], from: &[Buffer]) {
    for pair in to.iter_mut().zip(from) {
        if let (Buffer::Control { values: to, valid, .. }, Buffer::Control { values: from, valid: was, .. }) =
            pair
            && to.len() == from.len()
        {
            to.copy_from_slice(from);
            *valid = *was;
        }
    }
}

/// Placeholder for a node that comes from another graph.
pub(super) struct Absent;

impl Processor for Absent {
    fn process(&mut self, _: &mut Tick<'_>) -> Status {
        Status::Asleep
    }
    fn reset(&mut self) {}
}
