use asperity_live::view::{Layout, Materials, NodeLayout};

use super::*;

fn live(name: &str, value: f64, least: f64, most: f64) -> LiveLayout {
    LiveLayout { name: name.into(), value, least, most, ..LiveLayout::default() }
}

fn board() -> Board {
    let flag = LiveLayout { words: vec!["off".into(), "on".into()], ..live("mono", 0.0, 0.0, 1.0) };
    let whole = LiveLayout { whole: true, ..live("lines", 8.0, 1.0, 64.0) };
    let gain =
        NodeLayout { id: "gain".into(), live: vec![live("gain", 0.29, 0.0, 1.0)], ..NodeLayout::default() };
    let filter = NodeLayout {
        id: "filter".into(),
        live: vec![live("cutoff_hz", 20.0, 1.0, 10_000.0), whole, flag],
        ..NodeLayout::default()
    };
    let names = ["brick", "felt", "weave"].map(String::from).to_vec();
    let materials = ["left", "right"].map(|node| Materials {
        node: node.into(),
        chosen: "felt".into(),
        names: names.clone(),
    });
    let mut board = Board { tab: Tab::Parameters, ..Board::default() };
    board.lay_out(&Layout { nodes: vec![gain, filter], materials: materials.to_vec(), ..Layout::default() });
    board
}

fn press(board: &mut Board, code: KeyCode) -> Vec<Request> {
    press_with(board, code, KeyModifiers::NONE)
}

fn press_with(board: &mut Board, code: KeyCode, modifiers: KeyModifiers) -> Vec<Request> {
    board.press(KeyEvent::new(code, modifiers));
    std::mem::take(&mut board.requests)
}

fn set(node: &str, param: &str, value: f64) -> Vec<Request> {
    vec![Request::Set { node: node.into(), param: param.into(), value }]
}

#[test]
fn keys_stop_and_mute_at_once() {
    use KeyEventKind::{Press, Release, Repeat};
    let run_control = RunControl::default();
    let (none, control) = (KeyModifiers::NONE, KeyModifiers::CONTROL);
    // Whether each acts, and whether the run is stopped and muted afterwards. A held key counts once.
    for (key, modifiers, kind, does) in [
        (' ', none, Press, (true, false, true)),
        (' ', none, Repeat, (true, false, true)),
        (' ', none, Release, (false, false, true)),
        ('m', none, Press, (true, false, false)),
        ('c', none, Press, (false, false, false)),
        ('q', control, Press, (false, false, false)),
        ('q', none, Press, (true, true, false)),
    ] {
        let done = at_once(&KeyEvent::new_with_kind(KeyCode::Char(key), modifiers, kind), &run_control);
        assert_eq!((done, run_control.stopping(), run_control.muted()), does, "{key:?} {kind:?}");
    }
    let run_control = RunControl::default();
    // Muted on the page meanwhile.
    run_control.mute(true);
    assert!(at_once(&KeyEvent::new(KeyCode::Char('m'), none), &run_control) && !run_control.muted());
    assert!(at_once(&KeyEvent::new(KeyCode::Char('c'), control), &run_control) && run_control.stopping());
}

#[test]
fn step_is_a_hundredth_of_the_range() {
    let mut board = board();
    assert_eq!(press(&mut board, KeyCode::Right), set("gain", "gain", 0.3));
    assert_eq!(press_with(&mut board, KeyCode::Right, KeyModifiers::SHIFT), set("gain", "gain", 0.301));
    assert_eq!(press(&mut board, KeyCode::Left), set("gain", "gain", 0.29));
    for _ in 0..200 {
        press(&mut board, KeyCode::Left);
    }
    assert_eq!(board.layout.nodes[0].live[0].value, 0.0);
    assert_eq!(press(&mut board, KeyCode::Left), []);
}

#[test]
fn range_of_decades_is_moved_is_logarithmic() {
    let mut board = board();
    press(&mut board, KeyCode::Down);
    // Four decades in a hundred steps: 25 steps are a factor of ten.
    for _ in 0..25 {
        press(&mut board, KeyCode::Right);
    }
    let value = board.layout.nodes[1].live[0].value;
    assert!((value - 200.0).abs() < 1e-4, "{value}");
    for _ in 0..500 {
        press(&mut board, KeyCode::Right);
    }
    assert_eq!(board.layout.nodes[1].live[0].value, 10_000.0);
}

#[test]
fn whole_numbers_and_words_move_by_one() {
    let mut board = board();
    press(&mut board, KeyCode::Down);
    press(&mut board, KeyCode::Down);
    assert_eq!(press(&mut board, KeyCode::Right), set("filter", "lines", 9.0));
    assert_eq!(press_with(&mut board, KeyCode::Left, KeyModifiers::SHIFT), set("filter", "lines", 8.0));
    press(&mut board, KeyCode::Down);
    assert_eq!(press(&mut board, KeyCode::Right), set("filter", "mono", 1.0));
    assert_eq!(press(&mut board, KeyCode::Right), []);
    press(&mut board, KeyCode::Down);
    assert_eq!(press(&mut board, KeyCode::Left), set("filter", "mono", 0.0));
}

#[test]
fn held_key_asks_once_for_the_last_value() {
    let mut board = board();
    for _ in 0..5 {
        board.press(KeyEvent::new(KeyCode::Right, KeyModifiers::NONE));
    }
    assert_eq!(board.requests, set("gain", "gain", 0.34));
}

#[test]
fn materials_cycle_for_each_texture() {
    let mut board = board();
    let asked = |node: &str, name: &str| vec![Request::Material { node: node.into(), name: name.into() }];
    assert_eq!(press(&mut board, KeyCode::Char('n')), asked("left", "weave"));
    assert_eq!(press(&mut board, KeyCode::Char('n')), asked("left", "brick"));
    assert_eq!(press(&mut board, KeyCode::Char('p')), asked("left", "weave"));
    press(&mut board, KeyCode::Char('t'));
    assert_eq!(press(&mut board, KeyCode::Char('p')), asked("right", "brick"));
}

#[test]
fn first_arrow_only_shows_the_parameters() {
    let mut board = board();
    board.tab = Tab::Nodes;
    press(&mut board, KeyCode::Down);
    assert_eq!((board.tab, board.chosen), (Tab::Parameters, 0));
    press(&mut board, KeyCode::Down);
    assert_eq!(board.chosen, 1);
}

#[test]
fn keys_are_harmless_without_parameters() {
    let codes = [
        KeyCode::Up,
        KeyCode::Down,
        KeyCode::Left,
        KeyCode::Right,
        KeyCode::PageDown,
        KeyCode::PageUp,
        KeyCode::End,
        KeyCode::Char('n'),
        KeyCode::Char('p'),
        KeyCode::Char('t'),
    ];
    let mut empty = Board::default();
    let broken =
        LiveLayout { words: vec!["only".into()], ..live("x", f64::NAN, f64::NEG_INFINITY, f64::INFINITY) };
    let mut odd = Board::default();
    odd.lay_out(&Layout {
        nodes: vec![NodeLayout { live: vec![live("y", 1.0, 1.0, 1.0), broken], ..NodeLayout::default() }],
        materials: vec![Materials::default()],
        ..Layout::default()
    });
    for board in [&mut empty, &mut odd] {
        for code in codes.into_iter().chain(codes) {
            for request in press(board, code) {
                assert!(!matches!(request, Request::Set { value, .. } if !value.is_finite()));
            }
        }
    }
}

#[test]
fn key_release_does_nothing() {
    let mut board = board();
    let key = KeyEvent::new_with_kind(KeyCode::Right, KeyModifiers::NONE, KeyEventKind::Release);
    board.press(key);
    assert_eq!(board.requests, []);
}

#[test]
fn arrow_moves_beyond_the_slider() {
    let gain = LiveLayout { reach: Some([0.0, 2.0]), ..live("gain", 2.0, -1e6, 1e6) };
    assert_eq!(place(&gain), 1.0);
    let next = moved(&gain, 1.0);
    assert!(next > 2.0 && next < 2.2, "{next}");
    assert!(moved(&gain, -1.0) < 2.0);
}
