//! Figures of every node while it runs: written by the tick thread, read by others, without locks.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_graph::{Schedule, ScheduledNode, ScheduledOutput};
use asperity_node::{Buffer, Fault, Role, Shape};
use parking_lot::Mutex;

use super::Stylus;
use crate::meters::add;
use crate::view::NodeView;

/// Averaging time of an audio level in ticks (first-order mean).
const LEVEL_TICKS: f32 = 25.0;

/// Every node of a graph, in the order they run. A node that goes on in another graph keeps its meter.
#[derive(Debug)]
pub(crate) struct NodeMeters {
    nodes: Vec<Arc<Meter>>,
    /// Faults of all nodes, those of earlier graphs too.
    faults: AtomicU64,
    /// Output with the place of the stylus, and that place as the bits of f32.
    stylus: Option<(usize, usize)>,
    place: [AtomicU32; 3],
    /// The call in progress, as [`enter`](Self::enter) encodes it; 0 for none.
    inside: AtomicU64,
}

/// Bits of the node's number in `inside`; the others are the tick's.
const NODE_BITS: u32 = 20;

#[derive(Debug, Default)]
struct Meter {
    calls: AtomicU64,
    slept: AtomicU64,
    faults: AtomicU64,
    /// Both sides take it by `try_lock` alone.
    fault: Mutex<Option<Fault>>,
    quarantined: AtomicBool,
    /// Timed calls and their time: so far, and at the last look.
    timed: AtomicU64,
    spent_ns: AtomicU64,
    looked: [AtomicU64; 2],
    longest_ns: AtomicU64,
    /// For every output, the bits of an f32; a mean square for audio.
    values: Vec<AtomicU32>,
}

impl NodeMeters {
    /// Meters of a graph, after those of the graph before.
    pub(crate) fn new(schedule: &Schedule, before: Option<(&Schedule, &Self)>) -> Self {
        let meter = |node: &ScheduledNode| {
            let old = before.and_then(|(schedule, meters)| {
                let at = schedule.nodes.iter().position(|n| n.id == node.id && n.kind == node.kind)?;
                meters.nodes.get(at).filter(|old| old.values.len() == node.outputs.len())
            });
            let values = || node.outputs.iter().map(|_| AtomicU32::new(0)).collect();
            old.cloned().unwrap_or_else(|| Arc::new(Meter { values: values(), ..Meter::default() }))
        };
        let position = |node: &ScheduledNode| node.inputs.iter().find(|i| i.name == "position")?.from;
        Self {
            stylus: schedule
                .with_role(Role::Contact)
                .find_map(|(_, node)| position(node))
                .or_else(|| Stylus::of(schedule).map(|stylus| stylus.place())),
            place: Default::default(),
            nodes: schedule.nodes.iter().map(meter).collect(),
            faults: AtomicU64::new(before.map_or(0, |(_, meters)| meters.faults())),
            inside: AtomicU64::new(0),
        }
    }

    /// Notes the node that is called. Tick thread.
    pub(crate) fn enter(&self, tick: u64, node: usize) {
        self.inside.store(tick << NODE_BITS | (node as u64 + 1), Relaxed);
    }

    /// Notes the end of a tick. Tick thread.
    pub(crate) fn leave(&self) {
        self.inside.store(0, Relaxed);
    }

    /// The call in progress (a unique number) and its node; `None` between ticks.
    pub(crate) fn inside(&self) -> Option<(u64, usize)> {
        let call = self.inside.load(Relaxed);
        let node = call & ((1 << NODE_BITS) - 1);
        Some((call, node.checked_sub(1)? as usize))
    }

    /// Faults of all nodes since the start.
    pub(crate) fn faults(&self) -> u64 {
        self.faults.load(Relaxed)
    }

    /// Place of the stylus.
    pub(crate) fn stylus_mm(&self) -> Option<[f32; 3]> {
        self.stylus.map(|_| [0, 1, 2].map(|k| f32::from_bits(self.place[k].load(Relaxed))))
    }

    /// Takes down a tick. Tick thread.
    pub(crate) fn take(&self, engine: &Engine, spent_ns: &[u64]) {
        self.faults.store(engine.faults(), Relaxed);
        if let Some((node, output)) = self.stylus
            && let Some(Buffer::Control { values, .. }) = engine.output(node, output)
        {
            self.place.iter().zip(values).for_each(|(to, x)| to.store((*x as f32).to_bits(), Relaxed));
        }
        for (i, (meter, spent)) in self.nodes.iter().zip(spent_ns).enumerate() {
            let Some(report) = engine.report(i) else { continue };
            if report.calls != meter.calls.load(Relaxed) {
                add(&meter.timed, 1);
                add(&meter.spent_ns, *spent);
                if *spent > meter.longest_ns.load(Relaxed) {
                    meter.longest_ns.store(*spent, Relaxed);
                }
            }
            meter.calls.store(report.calls, Relaxed);
            meter.slept.store(report.slept, Relaxed);
            if report.faults != meter.faults.load(Relaxed)
                && let Some(mut fault) = meter.fault.try_lock()
            {
                meter.faults.store(report.faults, Relaxed);
                *fault = report.last_fault;
            }
            meter.quarantined.store(report.quarantined, Relaxed);
            for (output, value) in meter.values.iter().enumerate() {
                if let Some(buffer) = engine.output(i, output) {
                    let before = f32::from_bits(value.load(Relaxed));
                    value.store(level(buffer, before).to_bits(), Relaxed);
                }
            }
        }
    }

    /// Figures now.
    pub(crate) fn view(&self, schedule: &Schedule) -> Vec<NodeView> {
        let of = |(meter, node): (&Arc<Meter>, &ScheduledNode)| {
            let [calls, spent] = [&meter.timed, &meter.spent_ns].map(|now| now.load(Relaxed));
            let [called, used] = [&meter.looked[0], &meter.looked[1]].map(|then| then.load(Relaxed));
            meter.looked[0].store(calls, Relaxed);
            meter.looked[1].store(spent, Relaxed);
            let value = |(value, output): (&AtomicU32, &ScheduledOutput)| {
                let x = f32::from_bits(value.load(Relaxed));
                if matches!(output.port.shape, Shape::Audio { .. }) { x.sqrt() } else { x }
            };
            NodeView {
                us: spent.saturating_sub(used) as f64 * 1e-3 / calls.saturating_sub(called).max(1) as f64,
                max_us: meter.longest_ns.load(Relaxed) as f64 * 1e-3,
                calls: meter.calls.load(Relaxed),
                slept: meter.slept.load(Relaxed),
                faults: meter.faults.load(Relaxed),
                last_fault: meter
                    .fault
                    .try_lock()
                    .and_then(|f| *f)
                    .map(|f| f.to_string())
                    .unwrap_or_default(),
                quarantined: meter.quarantined.load(Relaxed),
                values: meter.values.iter().zip(&node.outputs).map(value).collect(),
            }
        };
        self.nodes.iter().zip(&schedule.nodes).map(of).collect()
    }
}

/// One figure of a buffer: the first value of a control, the mean square of audio, the largest bin.
fn level(buffer: &Buffer, before: f32) -> f32 {
    match buffer {
        Buffer::Control { values, .. } => values.first().map_or(0.0, |x| *x as f32),
        Buffer::Audio { silent: true, .. } => before * (1.0 - 1.0 / LEVEL_TICKS),
        Buffer::Audio { samples, len, .. } => {
            let power: f32 = samples[..*len].iter().map(|x| x * x).sum();
            before + (power / (*len).max(1) as f32 - before) / LEVEL_TICKS
        }
        Buffer::Magnitude { frame: None, .. } | Buffer::Spectrum { frame: None, .. } => before,
        Buffer::Magnitude { bins, .. } => bins.iter().fold(0.0, |most, x| x.max(most)),
        Buffer::Spectrum { bins, .. } => bins.iter().fold(0.0_f32, |most, z| z.norm_sqr().max(most)).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_of_a_tone_is_its_rms_and_decays_in_silence() {
        let sine = |n: usize| (0.1 * n as f32).sin();
        let mut level_of = 0.0;
        for k in 0..200 {
            let samples: Box<[f32]> = (0..96).map(|n| sine(96 * k + n)).collect();
            level_of = level(&Buffer::Audio { samples, len: 96, valid: true, silent: false }, level_of);
        }
        assert!((level_of.sqrt() - 0.5_f32.sqrt()).abs() < 0.02, "{level_of}");
        let silence = Buffer::Audio { samples: vec![0.0; 96].into(), len: 96, valid: true, silent: true };
        for _ in 0..500 {
            level_of = level(&silence, level_of);
        }
        assert!(level_of < 1e-6);
    }
}
