use std::time::Instant;

use asperity_live::view::{
    Condition, Layout, LiveLayout, Materials, NodeLayout, NodeView, ScopeLayout, SourceView, TimingView, View,
};
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::style::Color;

use super::*;

#[path = "plausible.rs"]
mod plausible;

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

fn playing() -> Board {
    let mut board = Board::default();
    board.lay_out(&plausible::layout());
    board.take(&plausible::view(80.0, 2.0), NOW - Duration::from_secs(3));
    board.take(&plausible::view(83.0, 2.0), NOW);
    board
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
    let all = [
        "graphs/live.ron",
        "PLAYING",
        "0:01:23.0",
        "dBFS",
        "deadline 2000 us",
        "latency 12.8 ms",
        "= 12.8 ms",
    ];
    let shown = text(&mut board, (80, 24));
    assert_shows(&shown, &all);
    assert_shows(
        &shown,
        &["underruns 2", "lost 431", "faults 1", "stylus", "texture", "m/s^2", "q stop", "3 set"],
    );
    assert!(!shown.contains("acceleration peak"));
    board.tab = Tab::Scopes;
    assert_shows(
        &text(&mut board, (80, 24)),
        &["speed peak", "force peak", "acceleration peak", "current peak"],
    );
    board.tab = Tab::Parameters;
    assert_shows(&text(&mut board, (80, 24)), &["> floor.stiffness", "0.5000", "0 .. 2 N/mm", "canvas"]);
    assert_shows(&text(&mut board, (80, 24)), &all);
}

#[test]
fn large_terminal_shows_everything_at_once() {
    for size in [(120, 40), (200, 60), (80, 50)] {
        let shown = text(&mut playing(), size);
        let wanted = ["timing", "latency", "sources", "nodes 12", "parameters 1 of 7", "materials", "scopes"];
        assert_shows(&shown, &wanted);
        assert_shows(&shown, &["speed peak", "current peak", "card", "guard.slew", "canvas", "? help"]);
    }
    assert_shows(
        &text(&mut playing(), (200, 60)),
        &["actuator_inverse", "hand to actuator", "audio 48000 Hz"],
    );
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
    let texture = lines.iter().find(|line| line.contains("texture_")).unwrap();
    let end = |line: &str, word: &str| line.find(word).map(|at| line[..at].chars().count() + word.len());
    let figures: Vec<&str> = texture.split_whitespace().collect();
    for (column, name) in [(2, "us"), (3, "max us"), (4, "% tick"), (5, "calls")] {
        assert_eq!(end(texture, figures[column]), end(&lines[title], name), "{name}");
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
    let mut board = playing();
    let mut view = plausible::view(83.1, 0.1);
    view.underruns = 3;
    view.sources[0].stalls += 1;
    view.peak = 1.02;
    let at = NOW + Duration::from_millis(10);
    board.take(&view, at);
    view.peak = 0.1;
    let frame = |board: &mut Board, time| {
        let mut buffer = Buffer::empty(ratatui::layout::Rect::new(0, 0, 80, 24));
        board.draw(&mut buffer, time);
        buffer.content().iter().map(|cell| cell.symbol()).collect::<String>()
    };
    board.take(&view, at + Duration::from_millis(1990));
    let held = frame(&mut board, at + Duration::from_millis(1990));
    assert_shows(&held, &["underruns 3!", "STALLED", "0.2 dBFS!"]);
    board.take(&view, at + Duration::from_millis(2000));
    let after = frame(&mut board, at + Duration::from_millis(2000));
    assert_shows(&after, &["underruns 3 ", "-20.0 dBFS "]);
    assert!(!after.contains("STALLED"));
}

#[test]
fn quarantined_node_is_red_with_its_fault() {
    let mut board = playing();
    let mut view = plausible::view(83.1, 0.1);
    view.nodes[6].quarantined = true;
    board.take(&view, NOW);
    let screen = show(&mut board, (120, 40));
    let lines = lines(&screen);
    let row = lines.iter().position(|line| line.contains("OUT: not a number")).unwrap();
    assert_shows(&lines[row], &["phase"]);
    assert_shows(
        &lines.join("\n"),
        &["1 out of use", "phase: is no longer called: not a number in spectrum"],
    );
    assert_eq!(screen.buffer()[(1, row as u16)].fg, Color::Red);
}

#[test]
fn bars_beyond_the_deadline_are_red() {
    let mut board = playing();
    let timing = |late: Vec<u64>| TimingView {
        deadline_us: 2000.0,
        edges_us: vec![1.0, 10.0, 100.0, 1000.0, 10_000.0, 100_000.0],
        compute_counts: vec![0; 6],
        late_counts: late,
        ..TimingView::default()
    };
    let bars = |board: &mut Board, late| {
        board.view.timing = timing(late);
        let screen = show(board, (200, 60));
        let is_bar = |symbol: &str| ('▁'..='█').contains(&symbol.chars().next().unwrap_or(' '));
        let width = usize::from(screen.buffer().area.width);
        let bars = screen.buffer().content().iter().enumerate().filter(|(_, cell)| is_bar(cell.symbol()));
        let red = bars.clone().filter(|(_, cell)| cell.fg == Color::Red).map(|(k, _)| k % width);
        (bars.count(), red.collect::<std::collections::BTreeSet<_>>().len())
    };
    let (all, red) = bars(&mut board, vec![0, 1_000_000, 0, 0, 0, 0]);
    assert!(all > 10 && red == 0, "{all} {red}");
    // A bin on both sides of the deadline may hold ticks that were in time: the mark alone is red.
    assert_eq!(bars(&mut board, vec![0, 0, 0, 0, 9, 0]).1, 1);
    // One tick in a million is seen, and it is red.
    let (more, red) = bars(&mut board, vec![0, 1_000_000, 0, 0, 0, 1]);
    assert!(more > 0 && red > 1, "{more} {red}");
}

#[test]
fn nodes_scroll_by_pages_and_not_past_the_end() {
    let mut board = Board::default();
    let node = |k: usize| NodeLayout { id: format!("node{k:03}"), ..NodeLayout::default() };
    board.lay_out(&Layout { nodes: (0..500).map(node).collect(), ..Layout::default() });
    board.take(&View { nodes: vec![NodeView::default(); 500], ..View::default() }, NOW);
    assert_shows(&text(&mut board, (80, 24)), &["1 to 10 of 500", "node000", "node009"]);
    let press = |board: &mut Board, code| board.press(KeyEvent::new(code, KeyModifiers::NONE));
    press(&mut board, KeyCode::PageDown);
    assert_shows(&text(&mut board, (80, 24)), &["11 to 20 of 500", "node010"]);
    press(&mut board, KeyCode::End);
    assert_shows(&text(&mut board, (80, 24)), &["491 to 500 of 500", "node499"]);
    press(&mut board, KeyCode::PageUp);
    assert_shows(&text(&mut board, (80, 24)), &["481 to 490 of 500"]);
}

#[test]
fn chosen_parameter_is_always_visible() {
    let live = |k: usize| LiveLayout { name: format!("p{k:02}"), most: 1.0, ..LiveLayout::default() };
    let node = NodeLayout { id: "n".into(), live: (0..80).map(live).collect(), ..NodeLayout::default() };
    let mut board = Board { tab: Tab::Parameters, ..Board::default() };
    board.lay_out(&Layout { nodes: vec![node], ..Layout::default() });
    for chosen in 0..80 {
        assert_shows(
            &text(&mut board, (80, 24)),
            &[&format!("> n.p{chosen:02}"), &format!("{} of 80", chosen + 1)],
        );
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

/// Extreme figures, hostile names, and more of everything than fits.
fn hostile(x: f64, n: u64, name: &str) -> (Layout, View) {
    let name = name.to_string();
    let live = |words: &[&str]| LiveLayout {
        name: name.clone(),
        value: x,
        least: -x,
        most: x,
        reach: Some([x, -x]),
        unit: name.clone(),
        words: words.iter().map(|w| (*w).to_string()).collect(),
        whole: false,
    };
    let node = NodeLayout {
        id: name.clone(),
        kind: name.clone(),
        outputs: vec![[name.clone(), name.clone()]],
        live: vec![live(&[]), live(&[&name, "on"])],
        ..NodeLayout::default()
    };
    let scope = ScopeLayout { name: name.clone(), unit: name.clone(), rate_hz: n as u32 };
    let materials = Materials { node: name.clone(), chosen: name.clone(), names: vec![name.clone(); 3] };
    let layout = Layout {
        file: name.clone(),
        tick_hz: n as u32,
        audio_hz: n as u32,
        nodes: vec![node; 40],
        scopes: vec![scope; 9],
        materials: vec![materials; 5],
        ..Layout::default()
    };
    let node = NodeView {
        us: x,
        max_us: x,
        calls: n,
        slept: n,
        faults: n,
        last_fault: name.clone(),
        quarantined: n % 2 == 1,
        values: vec![x as f32],
    };
    let source = SourceView {
        id: name.clone(),
        rate_hz: x,
        age_ms: x,
        delay_ms: x,
        stalls: n,
        stalled: n % 2 == 1,
        samples: n,
    };
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
        clock: name.clone(),
        device: name.clone(),
        period_frames: n as u32,
        ticks: n,
        seconds: x,
        timing,
        underruns: n,
        lost_samples: n,
        xruns: n,
        losses: n,
        faults: n,
        nodes: vec![node; 40],
        sources: vec![source; 20],
        scopes: vec![vec![x as f32; 300]; 9],
        latency_ms: vec![(name, x); 30],
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

/// Prints the time of a frame: `cargo test -p asperity-terminal -- --ignored --nocapture`.
#[test]
#[ignore = "prints a measurement"]
fn time_of_a_frame_is_printed() {
    for size in [(80, 24), (200, 60)] {
        let mut board = playing();
        let view = plausible::view(84.0, 1.0 / 30.0);
        let mut times: Vec<_> = (0..500)
            .map(|k| {
                let mut buffer = Buffer::empty(ratatui::layout::Rect::new(0, 0, size.0, size.1));
                let start = Instant::now();
                board.take(&view, NOW + Duration::from_millis(33 * k));
                board.draw(&mut buffer, NOW);
                start.elapsed()
            })
            .collect();
        times.sort();
        println!("{size:?}: median {:?}, longest {:?}", times[250], times[499]);
    }
}

/// Prints the frame in docs/live.md: `cargo test -p asperity-terminal -- --ignored --nocapture`.
#[test]
#[ignore = "prints a frame"]
fn frame_of_the_docs_is_printed() {
    println!("{}", text(&mut playing(), (104, 44)));
}
