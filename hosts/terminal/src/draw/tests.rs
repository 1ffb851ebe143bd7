use asperity_live::view::{Layout, NodeLayout, NodeView, TimingView, View};
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::*;

#[path = "../../../../tests/live/page_server/made_up.rs"]
#[allow(dead_code, unreachable_pub, reason = "the tests of the page use all of it")]
mod made_up;

const NOW: Duration = Duration::from_secs(5);
const SIZES: [(u16, u16); 9] =
    [(80, 24), (120, 40), (200, 60), (40, 10), (72, 20), (80, 50), (110, 36), (300, 21), (1, 1)];

/// The screen of a terminal of this size, drawn through a backend that takes changed cells only.
fn show(board: &mut Board, (width, height): (u16, u16)) -> TestBackend {
    let mut terminal = ratatui::Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| board.draw(frame.buffer_mut(), NOW)).unwrap();
    terminal.backend().clone()
}

fn lines(screen: &TestBackend) -> Vec<String> {
    let buffer = screen.buffer();
    let row = |y| (0..buffer.area.width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
    (0..buffer.area.height).map(row).collect()
}

fn text(board: &mut Board, size: (u16, u16)) -> String {
    lines(&show(board, size)).join("\n")
}

/// A board that has shown a run for a second, and a view that might come next.
fn shown() -> (Board, View) {
    let (mut board, mut run) = (Board::default(), made_up::Run::at(4));
    // One node less, so that all fit.
    run.layout.nodes.pop();
    board.lay_out(&run.layout);
    let counted = |view| View { underruns: 2, lost_samples: 431, faults: 1, ..view };
    for frame in (0..60).rev() {
        board.take(&counted(run.view()), NOW - Duration::from_secs(1) / 60 * frame);
    }
    (board, counted(run.view()))
}

fn playing() -> Board {
    shown().0
}

#[track_caller]
fn assert_shows(text: &str, wanted: &[&str]) {
    for what in wanted {
        assert!(text.contains(what), "{what:?} is not in\n{text}");
    }
}

#[test]
fn small_terminal_shows_one_pane_at_a_time() {
    let mut board = playing();
    let always = ["_pointer.ron", "PLAYING", "0:00:04.9", "dBFS", "deadline 2000 us", "latency 7.7 ms"];
    let always =
        [&always[..], &["device 2.7 =", "underruns 2", "lost 431", "faults 1", "q stop", "3 set"]].concat();
    let scopes = ["speed peak", "force peak", "acceleration peak", "current peak"];
    for (tab, own) in [
        (Tab::Nodes, &["stylus", "texture", "m/s²"][..]),
        (Tab::Scopes, &scopes),
        (Tab::Parameters, &["> floor.stiffness_n_per_mm", "0.5", "0.05 .. 2 N/mm", "canvas"]),
    ] {
        board.tab = tab;
        let shown = text(&mut board, (80, 24));
        assert_shows(&shown, &always);
        assert_shows(&shown, own);
        assert_eq!(shown.contains(scopes[0]), tab == Tab::Scopes, "{shown}");
    }
}

#[test]
fn large_terminal_shows_everything_at_once() {
    for size in [(120, 40), (200, 60), (80, 50)] {
        let shown = text(&mut playing(), size);
        let panes = ["timing", "latency", "sources", "nodes 12", "parameters 1 of 6", "materials", "scopes"];
        assert_shows(&shown, &panes);
        assert_shows(&shown, &["speed peak", "current peak", "limiter", "gate.fade", "canvas", "? help"]);
    }
    let wide = text(&mut playing(), (200, 60));
    assert_shows(&wide, &["actuator_inverse", "hand to actuator", "audio 48000 Hz"]);
}

#[test]
fn tiny_terminal_shows_the_condition() {
    let mut board = playing();
    board.view.condition = Condition::Failed;
    let shown = text(&mut board, (40, 10));
    assert_shows(&shown, &["too small: 40 x 10", "need 72 x 20", "FAILED", "q stop"]);
}

#[test]
fn node_figures_are_below_their_titles() {
    let lines = lines(&show(&mut playing(), (120, 40)));
    let title = lines.iter().position(|line| line.contains("% tick")).unwrap();
    let floor = lines.iter().find(|line| line.contains("virtual")).unwrap();
    let end = |line: &str, word: &str| line.find(word).map(|at| line[..at].chars().count() + word.len());
    let figures: Vec<&str> = floor.split_whitespace().collect();
    for (column, name) in [(2, " us"), (3, "max us"), (4, "% tick"), (5, "calls")] {
        assert_eq!(end(floor, figures[column]), end(&lines[title], name), "{name}");
    }
}

#[test]
fn conditions_are_words_in_terminal_colours() {
    use Condition::*;
    let named = [Color::Reset, Color::Red, Color::Green, Color::Cyan, Color::Magenta];
    let words = [
        (Starting, "STARTING"),
        (Playing, "PLAYING"),
        (Muted, "MUTED"),
        (Lost, "DEVICE LOST"),
        (Stopping, "STOPPING"),
        (Failed, "FAILED"),
    ];
    for (condition, word) in words {
        let mut board = playing();
        board.view.condition = condition;
        let screen = show(&mut board, (80, 24));
        assert_shows(&lines(&screen)[0], &[word]);
        for cell in screen.buffer().content() {
            assert!(named.contains(&cell.fg) && cell.bg == Color::Reset, "{cell:?}");
        }
    }
}

#[test]
fn underrun_and_stall_are_marked_for_two_seconds() {
    let (mut board, mut view) = shown();
    view.underruns = 3;
    view.sources[0].stalls += 1;
    view.peak = 1.02;
    let at = NOW + Duration::from_millis(10);
    board.take(&view, at);
    view.peak = 0.1;
    let mut frame = |time| {
        board.take(&view, time);
        let mut buffer = Buffer::empty(Rect::new(0, 0, 80, 24));
        board.draw(&mut buffer, time);
        buffer.content().iter().map(|cell| cell.symbol()).collect::<String>()
    };
    let held = frame(at + Duration::from_millis(1990));
    assert_shows(&held, &["underruns 3!", "STALLED", "0.2 dBFS!"]);
    let after = frame(at + Duration::from_millis(2000));
    assert_shows(&after, &["underruns 3 ", "-20.0 dBFS "]);
    assert!(!after.contains("STALLED"));
}

#[test]
fn quarantined_node_is_red_with_its_fault() {
    let (mut board, mut view) = shown();
    view.nodes[5].quarantined = true;
    view.nodes[5].last_fault = "not a number in spectrum".into();
    board.take(&view, NOW);
    let screen = show(&mut board, (120, 40));
    let lines = lines(&screen);
    let row = lines.iter().position(|line| line.contains("OUT: not a number")).unwrap();
    assert_shows(&lines[row], &["phase"]);
    let noted = "phase: is no longer called: not a number in spectrum";
    assert_shows(&lines.join("\n"), &["1 out of use", noted]);
    assert_eq!(screen.buffer()[(1, row as u16)].fg, Color::Red);
}

#[test]
fn bars_beyond_the_deadline_are_red() {
    let mut board = playing();
    for (late, red) in [
        (vec![0, 1_000_000, 0, 0, 0, 0], false),
        // A bar on both sides of the deadline may hold ticks that were in time.
        (vec![0, 0, 0, 0, 9, 0], false),
        // One tick in a million is seen, and it is red.
        (vec![0, 1_000_000, 0, 0, 0, 1], true),
    ] {
        board.view.timing = TimingView {
            deadline_us: 2000.0,
            edges_us: vec![1.0, 10.0, 100.0, 1000.0, 10_000.0, 100_000.0],
            compute_counts: vec![0; 6],
            late_counts: late.clone(),
            ..TimingView::default()
        };
        let screen = show(&mut board, (200, 60));
        let bars = screen.buffer().content().iter().filter(|cell| "▁▂▃▄▅▆▇█".contains(cell.symbol()));
        let bars: Vec<_> = bars.filter(|cell| cell.symbol() != " ").collect();
        assert_eq!(bars.iter().any(|cell| cell.fg == Color::Red), red, "{late:?}");
        assert!(!bars.is_empty());
    }
}

#[test]
fn nodes_scroll_by_pages_and_not_past_the_end() {
    let mut board = Board::default();
    let node = |k: usize| NodeLayout { id: format!("node{k:03}"), ..NodeLayout::default() };
    board.lay_out(&Layout { nodes: (0..500).map(node).collect(), ..Layout::default() });
    board.take(&View { nodes: vec![NodeView::default(); 500], ..View::default() }, NOW);
    for (key, first) in
        [(KeyCode::Home, 0), (KeyCode::PageDown, 9), (KeyCode::End, 491), (KeyCode::PageUp, 482)]
    {
        text(&mut board, (80, 24));
        board.press(KeyEvent::new(key, KeyModifiers::NONE));
        let head = format!("{} to {} of 500", first + 1, first + 9);
        let ends = [format!("node{first:03}"), format!("node{:03}", first + 8)];
        assert_shows(&text(&mut board, (80, 24)), &[&head, &ends[0], &ends[1]]);
    }
}

#[test]
fn chosen_parameter_is_always_visible() {
    let live = |k: usize| LiveLayout { name: format!("p{k:02}"), most: 1.0, ..LiveLayout::default() };
    let node = NodeLayout { id: "n".into(), live: (0..80).map(live).collect(), ..NodeLayout::default() };
    let mut board = Board { tab: Tab::Parameters, ..Board::default() };
    board.lay_out(&Layout { nodes: vec![node], ..Layout::default() });
    for chosen in 0..80 {
        let wanted = [format!("> n.p{chosen:02}"), format!("{} of 80", chosen + 1)];
        assert_shows(&text(&mut board, (80, 24)), &[&wanted[0], &wanted[1]]);
        board.press(KeyEvent::new(KeyCode::Down, KeyModifiers::NONE));
    }
}

#[test]
fn arrow_chooses_where_parameters_are_visible() {
    for (size, chosen) in [((80, 24), 0), ((120, 40), 1)] {
        let mut board = playing();
        text(&mut board, size);
        board.press(KeyEvent::new(KeyCode::Down, KeyModifiers::NONE));
        assert_eq!(board.chosen, chosen, "{size:?}");
    }
}

#[test]
fn empty_board_is_drawn() {
    for size in SIZES {
        for tab in [Tab::Nodes, Tab::Scopes, Tab::Parameters] {
            let mut board = Board { tab, help: true, ..Board::default() };
            text(&mut board, size);
            board.take(&View::default(), NOW);
            text(&mut board, size);
        }
    }
    let wanted = ["no device", "not known yet", "no hand", "STARTING"];
    assert_shows(&text(&mut Board::default(), (80, 24)), &wanted);
}

/// More of everything than fits, with one text for all names, one number and one count for all figures.
fn hostile(x: f64, n: u64, name: &str) -> (Layout, View) {
    let text = || name.to_owned();
    let live = |words: Vec<String>| LiveLayout {
        name: text(),
        value: x,
        least: -x,
        most: x,
        reach: Some([x, -x]),
        unit: text(),
        words,
        whole: false,
    };
    let node = NodeLayout {
        id: text(),
        kind: text(),
        outputs: vec![[text(), text()]],
        live: vec![live(vec![]), live(vec![text(), "on".into()])],
        ..NodeLayout::default()
    };
    let layout = Layout {
        file: text(),
        tick_hz: n as u32,
        audio_hz: n as u32,
        nodes: vec![node; 40],
        scopes: vec![ScopeLayout { name: text(), unit: text(), rate_hz: n as u32 }; 9],
        materials: vec![
            Materials {
                node: text(),
                chosen: text(),
                names: vec![text(); 3],
                gallery: Vec::new()
            };
            5
        ],
        ..Layout::default()
    };
    let (quarantined, stalled) = (n % 2 == 1, n % 2 == 1);
    let node = NodeView {
        us: x,
        max_us: x,
        calls: n,
        slept: n,
        faults: n,
        last_fault: text(),
        quarantined,
        values: vec![x as f32],
    };
    let source =
        SourceView { id: text(), rate_hz: x, age_ms: x, delay_ms: x, stalls: n, stalled, samples: n };
    let timing = TimingView {
        deadline_us: x,
        misses: n,
        woke_late: n,
        late_us: [x; 4],
        compute_us: [x; 4],
        recovery_us: [0.0; 4],
        edges_us: vec![x; 7],
        late_counts: vec![n; 8],
        compute_counts: vec![n; 3],
    };
    let view = View {
        clock: text(),
        device: text(),
        period_frames: n as u32,
        ticks: n,
        seconds: x,
        timing,
        underruns: n,
        lost_samples: n,
        faults: n,
        nodes: vec![node; 40],
        sources: vec![source; 20],
        scopes: vec![vec![x as f32; 300]; 9],
        latency_ms: vec![(text(), x); 30],
        peak: x as f32,
        ..View::default()
    };
    (layout, view)
}

#[test]
fn hostile_figures_and_names_are_drawn() {
    let long = "n".repeat(300);
    let wide = "触覚レンダリング".repeat(40);
    let names =
        [long.as_str(), &wide, "a\u{1b}[31m\u{7}\r\nb", "\u{202e}e\u{301}\u{301}\u{301}\u{200d}👩‍🚀", ""];
    let figures = [0.0, -1.0, 1e-300, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for (name, size) in names.into_iter().flat_map(|name| SIZES.map(|size| (name, size))) {
        for (x, n) in figures.into_iter().zip([0, 1, 7, u64::MAX, u64::MAX - 1, 12, 1 << 40]) {
            let (layout, view) = hostile(x, n, name);
            let tab = [Tab::Nodes, Tab::Scopes, Tab::Parameters][n as usize % 3];
            let mut board = Board { tab, ..Board::default() };
            board.lay_out(&layout);
            board.take(&view, NOW);
            let shown = text(&mut board, size);
            assert!(!shown.contains(|c: char| c.is_control() && c != '\n'));
        }
    }
}

#[test]
fn title_keeps_condition_and_time_beside_long_names() {
    let wide = "触覚レンダリング".repeat(40);
    let (mut layout, view) = hostile(1.0, 3, &wide);
    layout.file = format!("{wide}/weave.ron");
    let mut board = Board::default();
    board.lay_out(&layout);
    board.take(&view, NOW);
    for size in [(72, 20), (80, 24), (200, 60)] {
        assert_shows(&lines(&show(&mut board, size))[0], &["weave.ron", "STARTING", "0:00:01.0"]);
    }
}

/// Prints the frame in docs/how-to/play-and-record.md:
/// `cargo test -p asperity-terminal -- --ignored --nocapture`.
#[test]
#[ignore = "prints a frame"]
fn frame_of_the_docs_is_printed() {
    println!("{}", text(&mut playing(), (104, 44)));
}
