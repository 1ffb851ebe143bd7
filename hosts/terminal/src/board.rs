//! All figures of the run, ready to draw.

use std::collections::VecDeque;
use std::time::Duration;

use asperity_live::view::{Layout, NodeLayout, NodeView, Request, View};

use crate::held::{Count, Peak};
use crate::text::{clean, columns};
use crate::trace::Trace;

/// Figures of nodes change this often: as fast as a person reads them.
const READ: Duration = Duration::from_millis(250);
/// Most columns of a name.
const LONGEST: usize = 40;
/// Most notices that are kept.
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
    /// Share of the time of the tick.
    pub(crate) share: f64,
    /// Share of ticks it slept through since the last reading.
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

/// Everything that a frame shows.
#[derive(Debug, Default)]
pub(crate) struct Board {
    pub(crate) layout: Layout,
    pub(crate) view: View,
    pub(crate) rows: Vec<Row>,
    /// Columns of the longest id and kind.
    pub(crate) names: [usize; 2],
    pub(crate) traces: Vec<Trace>,
    pub(crate) peak: Peak,
    /// Underruns, lost samples, xruns, losses, faults, missed ticks.
    pub(crate) counts: [Count; 6],
    /// Stalls of each source.
    pub(crate) stalls: Vec<Count>,
    pub(crate) notes: VecDeque<(f64, String)>,
    pub(crate) tab: Tab,
    /// Whether the last frame had room for all panes.
    pub(crate) all_seen: bool,
    pub(crate) help: bool,
    /// First visible node.
    pub(crate) scroll: usize,
    /// Visible nodes of the last frame: the length of a page.
    pub(crate) page: usize,
    /// The chosen parameter, counted over all nodes.
    pub(crate) chosen: usize,
    /// The chosen texture node.
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
        let name = self.parameter(self.chosen).map(|(n, p)| self.parameter_name(n, p));
        self.layout = layout.clone();
        let longest = |name: fn(&NodeLayout) -> &str| {
            layout.nodes.iter().map(|node| columns(&clean(name(node), LONGEST))).max().unwrap_or(0)
        };
        self.names = [longest(|node| &node.id), longest(|node| &node.kind)];
        let all = (0..self.parameters())
            .find(|&k| self.parameter(k).map(|(n, p)| self.parameter_name(n, p)) == name && name.is_some());
        self.chosen = all.unwrap_or(0);
        self.texture = self.texture.min(layout.materials.len().saturating_sub(1));
    }

    /// Takes in a view that arrived at `time`.
    pub(crate) fn take(&mut self, view: &View, time: Duration) {
        let timing = &view.timing;
        let counts = [view.underruns, view.lost_samples, view.xruns, view.losses, view.faults, timing.misses];
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
            for (trace, samples) in self.traces.iter_mut().zip(&view.scopes) {
                trace.take(samples, time);
            }
        }
        self.view = view.clone();
    }

    fn take_nodes(&mut self, view: &View, time: Duration) {
        let read = self.read.is_none_or(|(last, _)| time.saturating_sub(last) >= READ);
        let ticks = view.ticks.saturating_sub(self.read.map_or(0, |(_, ticks)| ticks));
        let mut notes = Vec::new();
        for (index, (row, node)) in self.rows.iter_mut().zip(&view.nodes).enumerate() {
            let quarantined = node.quarantined && !row.last.quarantined;
            row.busy_us += node.us * node.calls.saturating_sub(row.last.calls) as f64;
            let fault = row.faults.take(node.faults, time);
            let repeated = row.noted.is_some_and(|at| time.saturating_sub(at) < crate::held::HOLD);
            if quarantined || (fault && !(repeated && node.last_fault == row.last.last_fault)) {
                row.noted = Some(time);
                let what = if quarantined { "is no longer called" } else { "fault" };
                notes.push((index, format!("{what}: {}", node.last_fault)));
            }
            if read {
                row.read(node, ticks as f64 * view.timing.deadline_us);
            }
            row.last.clone_from(node);
        }
        for (index, what) in notes.into_iter().take(NOTES) {
            let id = self.layout.nodes.get(index).map_or("", |node| &node.id);
            self.note_at(view.seconds, format!("{id}: {what}"));
        }
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

    /// Number of live parameters.
    pub(crate) fn parameters(&self) -> usize {
        self.layout.nodes.iter().map(|node| node.live.len()).sum()
    }

    /// Node and index within it of a live parameter, counted over all nodes.
    pub(crate) fn parameter(&self, mut index: usize) -> Option<(usize, usize)> {
        for (n, node) in self.layout.nodes.iter().enumerate() {
            if index < node.live.len() {
                return Some((n, index));
            }
            index -= node.live.len();
        }
        None
    }

    fn parameter_name(&self, node: usize, param: usize) -> String {
        let node = &self.layout.nodes[node];
        format!("{}.{}", node.id, node.live[param].name)
    }
}

impl Row {
    fn read(&mut self, node: &NodeView, ticks_us: f64) {
        let calls = node.calls.saturating_sub(self.calls);
        let slept = node.slept.saturating_sub(self.slept);
        self.us = if calls > 0 { self.busy_us / calls as f64 } else { 0.0 };
        self.share = if ticks_us > 0.0 { self.busy_us / ticks_us } else { 0.0 };
        self.asleep = if slept > 0 { slept as f64 / (calls as f64 + slept as f64) } else { 0.0 };
        self.value = node.values.first().copied();
        (self.busy_us, self.calls, self.slept) = (0.0, node.calls, node.slept);
    }
}

#[cfg(test)]
mod tests {
    use asperity_live::view::{LiveLayout, ScopeLayout, TimingView};

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
        let node = |faults, quarantined| NodeView {
            faults,
            quarantined,
            last_fault: "not a number".into(),
            ..NodeView::default()
        };
        for faults in 0..=7 {
            board.take(&view(faults, node(faults, false)), ms(20 * faults));
        }
        board.take(&view(8, node(8, true)), ms(160));
        board.take(&view(9, node(8, true)), ms(180));
        let notes: Vec<_> = board.notes.iter().map(|(_, text)| text.as_str()).collect();
        assert_eq!(notes, ["texture: fault: not a number", "texture: is no longer called: not a number"]);
    }

    #[test]
    fn chosen_parameter_stays_chosen_in_another_graph() {
        let live = |name: &str| LiveLayout { name: name.into(), ..LiveLayout::default() };
        let node = |id: &str, names: &[&str]| NodeLayout {
            id: id.into(),
            live: names.iter().map(|n| live(n)).collect(),
            ..NodeLayout::default()
        };
        let mut board = Board::default();
        board
            .lay_out(&Layout { nodes: vec![node("a", &["x", "y"]), node("b", &["x"])], ..Layout::default() });
        board.chosen = 2;
        let nodes = vec![node("c", &["x", "y", "z"]), node("b", &["w", "x"])];
        board.lay_out(&Layout { number: 1, nodes, ..Layout::default() });
        assert_eq!(board.chosen, 4);
        board.lay_out(&Layout { number: 2, ..Layout::default() });
        assert_eq!(board.chosen, 0);
    }
}
