//! All figures of the run, ready to draw.

use std::collections::VecDeque;
use std::time::Duration;

use asperity_live::view::{Layout, LiveLayout, NodeLayout, NodeView, Request, View};

use crate::recent::{Count, HOLD, Peak, Trace};

/// Figures of nodes change this often: as fast as a person reads them.
const READ: Duration = Duration::from_millis(250);
const NOTES: usize = 100;

/// Panes that share one place on a low terminal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Tab {
    #[default]
    Nodes,
    Scopes,
    Parameters,
}

/// Figures of one node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    /// Mean time of a call since the last reading, in microseconds.
    pub(crate) us: f64,
    /// Share of the time of the tick, and of ticks it slept through since the last reading.
    pub(crate) share: f64,
    pub(crate) asleep: f64,
    /// First value of its first output.
    pub(crate) value: Option<f32>,
    pub(crate) faults: Count,
    pub(crate) last: NodeView,
    /// Time in calls since the last reading, and the counts at that reading.
    busy_us: f64,
    calls: u64,
    slept: u64,
    /// Time of the last notice of a fault.
    noted: Option<Duration>,
}

#[derive(Debug, Default)]
pub(crate) struct Board {
    pub(crate) layout: Layout,
    pub(crate) view: View,
    pub(crate) rows: Vec<Row>,
    pub(crate) traces: Vec<Trace>,
    pub(crate) peak: Peak,
    /// Underruns, lost samples, xruns, losses, faults, missed ticks.
    pub(crate) counts: [Count; 6],
    pub(crate) stalls: Vec<Count>,
    pub(crate) notes: VecDeque<(f64, String)>,
    pub(crate) tab: Tab,
    /// Whether the last frame had room for all panes.
    pub(crate) all_seen: bool,
    pub(crate) help: bool,
    /// First visible node, and visible nodes of the last frame.
    pub(crate) scroll: usize,
    pub(crate) page: usize,
    /// The chosen parameter, counted over all nodes.
    pub(crate) chosen: usize,
    pub(crate) texture: usize,
    /// Requests of the keys that are not sent yet.
    pub(crate) requests: Vec<Request>,
    /// Time of the last reading of the nodes, and the ticks then.
    pub(crate) read: Option<(Duration, u64)>,
}

impl Board {
    /// Shows another graph, or the same one with other values.
    pub(crate) fn lay_out(&mut self, layout: &Layout) {
        if layout.number != self.layout.number || layout.nodes.len() != self.rows.len() {
            self.rows = vec![Row::default(); layout.nodes.len()];
            self.read = None;
        }
        if layout.number != self.layout.number || layout.scopes != self.layout.scopes {
            self.traces = layout.scopes.iter().map(|scope| Trace::new(scope.rate_hz)).collect();
        }
        // The chosen parameter stays chosen in another graph that has it too.
        let name = |(node, live): (&NodeLayout, &LiveLayout)| (node.id.clone(), live.name.clone());
        let chosen = self.parameters().nth(self.chosen).map(name);
        self.layout = layout.clone();
        let again = self.parameters().position(|p| Some(name(p)) == chosen);
        self.chosen = again.unwrap_or(0);
        self.texture = self.texture.min(layout.materials.len().saturating_sub(1));
    }

    /// Takes in a view that arrived at `time`.
    pub(crate) fn take(&mut self, view: &View, time: Duration) {
        let misses = view.timing.misses;
        let counts = [view.underruns, view.lost_samples, view.xruns, view.losses, view.faults, misses];
        for (count, now) in self.counts.iter_mut().zip(counts) {
            count.take(now, time);
        }
        self.peak.take(view.peak, time);
        self.stalls.resize(view.sources.len(), Count::default());
        for (count, source) in self.stalls.iter_mut().zip(&view.sources) {
            count.take(source.stalls, time);
        }
        // Until the layout follows, these figures belong to nodes of another graph.
        if view.layout == self.layout.number {
            self.take_nodes(view, time);
            self.traces.iter_mut().zip(&view.scopes).for_each(|(trace, samples)| trace.take(samples));
        }
        self.view = view.clone();
    }

    fn take_nodes(&mut self, view: &View, time: Duration) {
        let read = self.read.is_none_or(|(last, _)| time.saturating_sub(last) >= READ);
        let ticks = view.ticks.saturating_sub(self.read.map_or(0, |(_, ticks)| ticks));
        let mut notes = Vec::new();
        for ((layout, row), node) in self.layout.nodes.iter().zip(&mut self.rows).zip(&view.nodes) {
            let quarantined = node.quarantined && !row.last.quarantined;
            row.busy_us += node.us * node.calls.saturating_sub(row.last.calls) as f64;
            let fault = row.faults.take(node.faults, time);
            let repeated = row.noted.is_some_and(|at| time.saturating_sub(at) < HOLD);
            if quarantined || (fault && !(repeated && node.last_fault == row.last.last_fault)) {
                row.noted = Some(time);
                let what = if quarantined { "is no longer called" } else { "fault" };
                notes.push(format!("{}: {what}: {}", layout.id, node.last_fault));
            }
            if read {
                row.read(node, ticks as f64 * view.timing.deadline_us);
            }
            row.last.clone_from(node);
        }
        notes.into_iter().take(NOTES).for_each(|text| self.note_at(view.seconds, text));
        if read {
            self.read = Some((time, view.ticks));
        }
    }

    /// Keeps a notice with the time of the graph.
    pub(crate) fn note(&mut self, text: &str) {
        self.note_at(self.view.seconds, text.into());
    }

    fn note_at(&mut self, seconds: f64, text: String) {
        if self.notes.len() == NOTES {
            self.notes.pop_front();
        }
        self.notes.push_back((seconds, text));
    }

    pub(crate) fn parameters(&self) -> impl Iterator<Item = (&NodeLayout, &LiveLayout)> {
        self.layout.nodes.iter().flat_map(|node| node.live.iter().map(move |live| (node, live)))
    }
}

impl Row {
    fn read(&mut self, node: &NodeView, ticks_us: f64) {
        let calls = node.calls.saturating_sub(self.calls) as f64;
        let slept = node.slept.saturating_sub(self.slept) as f64;
        self.us = if calls > 0.0 { self.busy_us / calls } else { 0.0 };
        self.share = if ticks_us > 0.0 { self.busy_us / ticks_us } else { 0.0 };
        self.asleep = if slept > 0.0 { slept / (calls + slept) } else { 0.0 };
        self.value = node.values.first().copied();
        (self.busy_us, self.calls, self.slept) = (0.0, node.calls, node.slept);
    }
}

#[cfg(test)]
mod tests {
    use asperity_live::view::{ScopeLayout, TimingView};

    use super::*;

    const fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn one_node() -> Board {
        let mut board = Board::default();
        let node = NodeLayout { id: "texture".into(), ..NodeLayout::default() };
        let scope = ScopeLayout { rate_hz: 256, ..ScopeLayout::default() };
        board.lay_out(&Layout { number: 1, nodes: vec![node], scopes: vec![scope], ..Layout::default() });
        board
    }

    fn view(ticks: u64, node: NodeView) -> View {
        let timing = TimingView { deadline_us: 2000.0, ..TimingView::default() };
        View { layout: 1, ticks, timing, nodes: vec![node], ..View::default() }
    }

    #[test]
    fn node_figures_cover_the_time_since_last_reading() {
        let mut board = one_node();
        let node =
            |us, calls, slept| NodeView { us, calls, slept, values: vec![1.5, 2.0], ..NodeView::default() };
        board.take(&view(100, node(10.0, 100, 0)), ms(0));
        board.take(&view(150, node(30.0, 110, 40)), ms(100));
        assert_eq!(board.rows[0].us, 10.0);
        board.take(&view(200, node(90.0, 120, 80)), ms(250));
        // 10 calls of 30 us and 10 of 90 us in 100 ticks of 2 ms; 80 of these were slept through.
        let row = &board.rows[0];
        assert_eq!((row.us, row.share, row.asleep, row.value), (60.0, 1200.0 / 200_000.0, 0.8, Some(1.5)));
    }

    #[test]
    fn figures_of_another_graph_are_ignored() {
        let mut board = one_node();
        let mut other = view(10, NodeView { us: 5.0, calls: 10, faults: 2, ..NodeView::default() });
        other.layout = 2;
        other.scopes = vec![vec![3.0; 10]];
        board.take(&other, ms(0));
        assert_eq!((board.rows[0].us, board.rows[0].faults.now, board.traces[0].peak()), (0.0, 0, 0.0));
    }

    #[test]
    fn fault_is_noted_once_and_quarantine_again() {
        let mut board = one_node();
        for (k, (faults, quarantined)) in (0..8).map(|k| (k, false)).chain([(8, true), (8, true)]).enumerate()
        {
            let last_fault = "not a number".into();
            let node = NodeView { faults, quarantined, last_fault, ..NodeView::default() };
            board.take(&view(faults, node), ms(20 * k as u64));
        }
        let notes: Vec<_> = board.notes.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(notes, ["texture: fault: not a number", "texture: is no longer called: not a number"]);
    }

    #[test]
    fn chosen_parameter_stays_chosen_in_another_graph() {
        let node = |id: &str, names: &[&str]| NodeLayout {
            id: id.into(),
            live: names.iter().map(|n| LiveLayout { name: (*n).into(), ..LiveLayout::default() }).collect(),
            ..NodeLayout::default()
        };
        let mut board = Board::default();
        let first = vec![node("a", &["x", "y"]), node("b", &["x"])];
        let second = vec![node("c", &["x", "y", "z"]), node("b", &["w", "x"])];
        for (number, (nodes, chosen)) in (0..).zip([(first, 0), (second, 4), (vec![], 0)]) {
            board.lay_out(&Layout { number, nodes, ..Layout::default() });
            assert_eq!(board.chosen, chosen);
            board.chosen = 2.max(chosen);
        }
    }
}
