//! Figures of every node while it runs: written by the tick thread, read by others, without locks.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_node::{Buffer, Fault};

use crate::meters::add;
use crate::view::NodeView;

/// Averaging time of an audio level in ticks (first-order mean).
const LEVEL_TICKS: f32 = 25.0;

/// Every node of a graph, in the order they run.
#[derive(Debug)]
pub(crate) struct NodeMeters {
    nodes: Vec<Meter>,
    /// Faults of all nodes, those of earlier graphs too.
    faults: AtomicU64,
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
    fault: AtomicU64,
    quarantined: AtomicBool,
    /// Timed calls and their time. A node that continues in another graph starts there from 0.
    timed: AtomicU64,
    spent_ns: AtomicU64,
    longest_ns: AtomicU64,
    /// For every output, the bits of an f32; a mean square for audio.
    values: Vec<AtomicU32>,
}

impl NodeMeters {
    /// Meters of a graph. A node that the graph before had continues its figures.
    pub(crate) fn new(schedule: &Schedule, before: Option<(&Schedule, &Self)>) -> Self {
        let seen = |node: &ScheduledNode| {
            let (schedule, meters) = before?;
            let at = schedule.nodes.iter().position(|n| n.id == node.id && n.kind == node.kind)?;
            meters.nodes.get(at)
        };
        let meter = |node: &ScheduledNode| {
            let new = Meter {
                values: node.outputs.iter().map(|_| AtomicU32::new(0)).collect(),
                ..Meter::default()
            };
            if let Some(old) = seen(node) {
                new.go_on(old);
            }
            new
        };
        Self {
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

    /// Takes down a tick. Tick thread.
    pub(crate) fn take(&self, engine: &Engine, spent_ns: &[u64]) {
        self.faults.store(engine.faults(), Relaxed);
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
            if report.faults != meter.faults.load(Relaxed) {
                meter.faults.store(report.faults, Relaxed);
                meter.fault.store(report.last_fault.map_or(0, code), Relaxed);
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

    /// Figures now. `before`: timed calls and time of each node at the last look.
    pub(crate) fn view(&self, schedule: &Schedule, before: &mut Vec<(u64, u64)>) -> Vec<NodeView> {
        before.resize(self.nodes.len(), (0, 0));
        let of = |((meter, node), was): ((&Meter, _), &mut (u64, u64))| {
            let (timed, spent) = (meter.timed.load(Relaxed), meter.spent_ns.load(Relaxed));
            let fresh = timed.saturating_sub(was.0);
            let us = if fresh == 0 { 0.0 } else { spent.saturating_sub(was.1) as f64 * 1e-3 / fresh as f64 };
            *was = (timed, spent);
            let node: &ScheduledNode = node;
            let value = |(value, output): (&AtomicU32, &asperity_graph::ScheduledOutput)| {
                let x = f32::from_bits(value.load(Relaxed));
                if matches!(output.port.shape, asperity_node::Shape::Audio { .. }) { x.sqrt() } else { x }
            };
            NodeView {
                us,
                max_us: meter.longest_ns.load(Relaxed) as f64 * 1e-3,
                calls: meter.calls.load(Relaxed),
                slept: meter.slept.load(Relaxed),
                faults: meter.faults.load(Relaxed),
                last_fault: fault_text(meter.fault.load(Relaxed)),
                quarantined: meter.quarantined.load(Relaxed),
                values: meter.values.iter().zip(&node.outputs).map(value).collect(),
            }
        };
        self.nodes.iter().zip(&schedule.nodes).zip(before).map(of).collect()
    }
}

impl Meter {
    /// Continues the figures of the node in the graph before.
    fn go_on(&self, old: &Self) {
        for (new, old) in [
            (&self.calls, &old.calls),
            (&self.slept, &old.slept),
            (&self.faults, &old.faults),
            (&self.fault, &old.fault),
            (&self.longest_ns, &old.longest_ns),
        ] {
            new.store(old.load(Relaxed), Relaxed);
        }
        self.quarantined.store(old.quarantined.load(Relaxed), Relaxed);
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

/// A fault as a number; 0 for none.
fn code(fault: Fault) -> u64 {
    match fault {
        Fault::Panicked => 1,
        Fault::NotFinite => 2,
        Fault::Overrun => 3,
        Fault::Stuck => 4,
        Fault::Failed(n) => 5 + u64::from(n),
    }
}

/// A fault in words; none for 0.
fn fault_text(code: u64) -> String {
    let fault = match code {
        0 => return String::new(),
        1 => Fault::Panicked,
        2 => Fault::NotFinite,
        3 => Fault::Overrun,
        4 => Fault::Stuck,
        n => Fault::Failed((n - 5) as u32),
    };
    fault.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_code_reads_back_as_its_text() {
        assert_eq!(fault_text(0), "");
        for fault in [
            Fault::Panicked,
            Fault::NotFinite,
            Fault::Overrun,
            Fault::Stuck,
            Fault::Failed(0),
            Fault::Failed(u32::MAX),
        ] {
            assert_eq!(fault_text(code(fault)), fault.to_string());
        }
    }

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
