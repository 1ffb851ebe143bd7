//! Motion of the stylus of a graph, and its queue from the tick thread to a writer.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_engine::Engine;
use asperity_graph::{Schedule, ScheduledNode};
use asperity_node::{Buffer, Role, Shape};
use ringbuf::traits::{Consumer, Producer, Split};
use ringbuf::{HeapCons, HeapProd, HeapRb};

opaque_debug!(StylusReader);

/// Room for rows that nobody reads [s].
const ROOM_S: f64 = 4.0;

/// Where a graph has the motion of its stylus: a hand, or else a stroke.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stylus {
    node: usize,
    /// Outputs.
    pub(crate) position: usize,
    force: Option<usize>,
    stroke: Option<usize>,
}

/// The stylus in a tick, as exact as the graph has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StylusRow {
    /// Number of the tick.
    pub tick: u64,
    /// x, y, z in mm; z is up.
    pub position: [f64; 3],
    /// Force \[N\]; 0 where the graph has none.
    pub force: f64,
    /// Number of the stroke; 0 where the graph does not count them.
    pub stroke: f64,
}

impl Stylus {
    pub(crate) fn of(schedule: &Schedule) -> Option<Self> {
        let mut moves = [Role::Hand, Role::Stroke].into_iter().flat_map(|role| schedule.with_role(role));
        moves.find_map(|(node, it)| {
            let named = |name| it.outputs.iter().position(|output| output.name == name);
            let is_place =
                |it: &ScheduledNode, at: usize| it.outputs[at].port.shape == Shape::Control { count: 3 };
            let position = named("position").filter(|&at| is_place(it, at))?;
            Some(Self { node, position, force: named("force"), stroke: named("stroke") })
        })
    }

    /// Node and output with the position.
    pub(crate) fn place(&self) -> (usize, usize) {
        (self.node, self.position)
    }
}

pub(super) struct StylusWriter {
    rows: HeapProd<StylusRow>,
    lost: Arc<AtomicU64>,
}

/// Side of the reader.
pub struct StylusReader {
    rows: HeapCons<StylusRow>,
    lost: Arc<AtomicU64>,
}

pub(super) fn tape(tick_hz: u32) -> (StylusWriter, StylusReader) {
    let (to, from) = HeapRb::new((f64::from(tick_hz) * ROOM_S) as usize + 1).split();
    let lost = Arc::new(AtomicU64::new(0));
    (StylusWriter { rows: to, lost: lost.clone() }, StylusReader { rows: from, lost })
}

impl StylusWriter {
    /// Takes down the tick that has just run. Tick thread.
    pub(super) fn take(&mut self, engine: &Engine, stylus: &Stylus) {
        let values = |output| match engine.output(stylus.node, output) {
            Some(Buffer::Control { values, .. }) => &values[..],
            _ => &[],
        };
        let one = |output: Option<usize>| output.and_then(|at| values(at).first().copied()).unwrap_or(0.0);
        let row = StylusRow {
            tick: engine.next_tick().saturating_sub(1),
            position: values(stylus.position).try_into().unwrap_or_default(),
            force: one(stylus.force),
            stroke: one(stylus.stroke),
        };
        if self.rows.try_push(row).is_err() {
            self.lost.fetch_add(1, Relaxed);
        }
    }
}

impl StylusReader {
    /// Takes the oldest row.
    pub fn take(&mut self) -> Option<StylusRow> {
        self.rows.try_pop()
    }

    /// Ticks lost because nobody read for 4 s.
    pub fn lost(&self) -> u64 {
        self.lost.load(Relaxed)
    }
}
