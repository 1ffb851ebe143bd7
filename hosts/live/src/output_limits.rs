//! Last stage before a device: limits for every channel, behind all ramps and fades.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_graph::{Compiled, Schedule, ScheduledNode};
use asperity_node::{Coil, Guard, Unit};
use parking_lot::Mutex;

opaque_debug!(OutputLimits, DeviceLimits);

/// Limits of a device's channels. The state of coils and movers belongs to the channel: it continues from
/// one graph to the next, over the loss of a device, and from one run to another.
#[derive(Default)]
pub struct OutputLimits {
    channels: Vec<Option<Channel>>,
    changed: u64,
}

struct Channel {
    guard: Box<dyn Guard>,
    /// The drive at full scale \[A or V\].
    unit: f64,
    /// Whether it stays when the graph changes.
    stays: bool,
}

/// Heat and thermal limits of a channel's coil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// Mean square of the current \[A^2\].
    pub heat: f64,
    /// Mean square that the coil bears continuously \[A^2\].
    pub rating: f64,
    /// Time constant with which it cools \[s\].
    pub cools_in: f64,
}

impl OutputLimits {
    /// Limits for the nodes of a graph that play on channels 0, 1, ..., at rest and cold.
    pub fn new(compiled: &Compiled, outs: impl IntoIterator<Item = usize>) -> Self {
        let guarded = |out| {
            let guard = compiled.nodes[limiter_of(&compiled.schedule, out)?].guard.as_ref()?();
            Some(Channel { guard, unit: drive_at_full_scale(&compiled.schedule.nodes[out]), stays: false })
        };
        Self { channels: outs.into_iter().map(guarded).collect(), changed: 0 }
    }

    /// Given limits, each with the drive at full scale \[A or V\]. They stay whatever graph plays.
    pub fn staying(channels: impl IntoIterator<Item = Option<(Box<dyn Guard>, f64)>>) -> Self {
        let stays = |(guard, unit)| Channel { guard, unit, stays: true };
        Self { channels: channels.into_iter().map(|c| c.map(stays)).collect(), changed: 0 }
    }

    /// Continues the coils of other limits, channel by channel, and takes over its limits that stay. Tick
    /// thread.
    pub fn go_on(&mut self, before: &mut Self) {
        self.changed = before.changed;
        for (channel, was) in self.channels.iter_mut().zip(&mut before.channels) {
            match (&mut *channel, &mut *was) {
                (_, Some(was)) if was.stays => {}
                (Some(channel), Some(was)) => {
                    channel.guard.go_on(&was.guard.coil());
                    continue;
                }
                // A silent channel keeps its coil for the next graph.
                (None, Some(_)) => {}
                _ => continue,
            }
            std::mem::swap(channel, was);
        }
    }

    /// Limits interleaved frames; `step` is the number of channels. Tick thread.
    pub fn hold(&mut self, frames: &mut [f32], step: usize) {
        for (first, channel) in self.channels.iter_mut().enumerate().take(step) {
            if let (Some(channel), Some(samples)) = (channel, frames.get_mut(first..)) {
                self.changed += channel.guard.hold(samples, step, channel.unit);
            }
        }
    }

    /// Samples changed so far.
    pub fn changed(&self) -> u64 {
        self.changed
    }

    /// Largest drive of the first channel that plays \[A or V\].
    pub fn peak(&self) -> Option<f64> {
        self.channels.iter().flatten().map(|c| c.guard.peak()).next()
    }

    /// State of each channel's coil; `None` for a silent channel.
    pub fn standing(&self) -> Vec<Option<Standing>> {
        let of = |c: &Channel| Standing {
            heat: c.guard.coil().heat,
            rating: c.guard.rating(),
            cools_in: c.guard.cools_in(),
        };
        self.channels.iter().map(|c| c.as_ref().map(of)).collect()
    }
}

/// Limiter before a node that plays on a device.
pub(crate) fn limiter_of(schedule: &Schedule, out: usize) -> Option<usize> {
    let from = schedule.nodes.get(out)?.inputs.first()?.from?;
    Some(from.0)
}

/// Drive of the coil at a sample of 1 \[A or V\].
fn drive_at_full_scale(out: &ScheduledNode) -> f64 {
    let amps = out.inputs.first().and_then(|i| i.port.as_ref()).is_some_and(|p| p.unit == Unit::AMPERE);
    let amplifier = out.params.number(if amps { "amps_per_volt" } else { "volts_per_volt" });
    amplifier * out.params.number("volts_at_full_scale")
}

/// Limits of a run's channels, which its drivers use one after the other. Taken by `try_lock` alone, so no
/// thread ever waits for them.
pub type SharedLimits = Arc<Mutex<DeviceLimits>>;

/// The limits on the device's thread, with its link to the control thread.
pub struct DeviceLimits {
    pub(crate) limits: OutputLimits,
    /// Limits of the next graph; after the exchange, those of the one before.
    next: triple_buffer::Output<OutputLimits>,
    /// This run's share of each limit: a factor on its output.
    share: f32,
    seen: Arc<Seen>,
}

/// Figures of the limits for other threads.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    heat: Vec<AtomicU64>,
    changed: AtomicU64,
}

/// Control side: sends limits of the next graph, reads figures of the current ones.
pub(crate) struct LimitsControl {
    /// Limits of another graph, for the device's next block.
    pub(crate) next: triple_buffer::Input<OutputLimits>,
    pub(crate) shared: SharedLimits,
    pub(crate) seen: Arc<Seen>,
}

/// Limits of a run and their control.
pub(crate) fn device_limits(limits: OutputLimits) -> LimitsControl {
    let (input, next) = triple_buffer::TripleBuffer::<OutputLimits>::default().split();
    let heat = limits.channels.iter().map(|_| AtomicU64::new(0)).collect();
    let seen = Arc::new(Seen { heat, changed: AtomicU64::new(0) });
    let shared = Arc::new(Mutex::new(DeviceLimits { limits, next, share: 1.0, seen: seen.clone() }));
    LimitsControl { next: input, shared, seen }
}

impl DeviceLimits {
    /// Limits the output. Never allocates, frees, locks or waits.
    pub(crate) fn hold(&mut self, frames: &mut [f32], channels: usize) {
        if self.next.update() {
            let next = self.next.output_buffer_mut();
            next.go_on(&mut self.limits);
            std::mem::swap(next, &mut self.limits);
        }
        self.limits.hold(frames, channels);
        if self.share != 1.0 {
            frames.iter_mut().for_each(|x| *x *= self.share);
        }
        self.publish();
    }

    /// Lets every coil rest and cool for a time without output.
    pub(crate) fn rest(&mut self, seconds: f64) {
        self.limits.channels.iter_mut().flatten().for_each(|c| c.guard.rest(seconds));
        self.publish();
    }

    /// Starts with coils of this heat \[A^2\], and a share of each limit. Limits of the machine replace the
    /// graph's.
    pub(crate) fn begin(&mut self, heat: &[f64], share: f32, mut machine: OutputLimits) {
        for (channel, machine) in self.limits.channels.iter_mut().zip(&mut machine.channels) {
            if machine.is_some() {
                std::mem::swap(channel, machine);
            }
        }
        for (channel, heat) in self.limits.channels.iter_mut().zip(heat) {
            if let Some(Channel { guard, .. }) = channel {
                guard.go_on(&Coil { heat: *heat, ..guard.coil() });
            }
        }
        self.share = share;
        self.publish();
    }

    fn publish(&self) {
        for (seen, channel) in self.seen.heat.iter().zip(&self.limits.channels) {
            if let Some(channel) = channel {
                seen.store(channel.guard.coil().heat.to_bits(), Relaxed);
            }
        }
        self.seen.changed.store(self.limits.changed, Relaxed);
    }
}

impl Seen {
    /// How warm the coil of each channel is \[A^2\].
    pub(crate) fn heat(&self) -> impl Iterator<Item = f64> {
        self.heat.iter().map(|bits| f64::from_bits(bits.load(Relaxed)))
    }

    /// Samples changed so far.
    pub(crate) fn changed(&self) -> u64 {
        self.changed.load(Relaxed)
    }
}
