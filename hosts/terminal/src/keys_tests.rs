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
        ..Materials::default()
    });
    let mut board = Board { tab: Tab::Parameters, ..Board::default() };
    board.lay_out(&Layout { nodes: vec![gain, filter], materials: materials.to_vec(), ..Layout::default() });
    board
}

/// Presses a key: an arrow, with shift as a double one, or a letter. Its requests.
fn press(board: &mut Board, key: char) -> Vec<Request> {
    let (code, modifiers) = match key {
        '↑' => (KeyCode::Up, KeyModifiers::NONE),
        '↓' => (KeyCode::Down, KeyModifiers::NONE),
        '←' => (KeyCode::Left, KeyModifiers::NONE),
        '→' => (KeyCode::Right, KeyModifiers::NONE),
        '⇐' => (KeyCode::Left, KeyModifiers::SHIFT),
        '⇒' => (KeyCode::Right, KeyModifiers::SHIFT),
        '⇞' => (KeyCode::PageUp, KeyModifiers::NONE),
        '⇟' => (KeyCode::PageDown, KeyModifiers::NONE),
        '⤓' => (KeyCode::End, KeyModifiers::NONE),
        key => (KeyCode::Char(key), KeyModifiers::NONE),
    };
    board.press(KeyEvent::new(code, modifiers));
    std::mem::take(&mut board.requests)
}

/// The requests of the last of some keys.
fn last(keys: &str) -> Vec<Request> {
    let mut board = board();
    keys.chars().map(|key| press(&mut board, key)).last().expect("a key")
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
fn parameters_move_by_steps_of_their_range() {
    let many = |before: &str, key: &str, times: usize| before.to_owned() + &key.repeat(times);
    for (keys, node, param, value) in [
        // A hundredth of the range, or a tenth of that.
        ("→", "gain", "gain", 0.3),
        ("→⇒", "gain", "gain", 0.301),
        ("→⇒←", "gain", "gain", 0.29),
        (&many("", "←", 29), "gain", "gain", 0.0),
        // Four decades in a hundred steps: 25 steps are a factor of ten.
        (&many("↓", "→", 25), "filter", "cutoff_hz", 200.0),
        (&many("↓", "→", 68), "filter", "cutoff_hz", 10_000.0),
        // Whole numbers and words move by one.
        ("↓↓→", "filter", "lines", 9.0),
        ("↓↓→⇐", "filter", "lines", 8.0),
        ("↓↓↓→", "filter", "mono", 1.0),
        ("↓↓↓→↓←", "filter", "mono", 0.0),
    ] {
        let [Request::Set { node: n, param: p, value: v }] = &last(keys)[..] else { panic!("{keys}") };
        assert_eq!((n.as_str(), p.as_str()), (node, param), "{keys}");
        assert!((v / value - 1.0).abs() < 1e-6 || *v == value, "{keys}: {v}");
    }
    for end in [many("", "←", 30), many("↓", "→", 69), "↓↓↓→→".to_owned()] {
        assert_eq!(last(&end), [], "{end}");
    }
}

#[test]
fn held_key_asks_once_for_the_last_value() {
    let mut board = board();
    for _ in 0..5 {
        board.press(KeyEvent::new(KeyCode::Right, KeyModifiers::NONE));
    }
    assert_eq!(board.requests, [Request::Set { node: "gain".into(), param: "gain".into(), value: 0.34 }]);
}

#[test]
fn materials_cycle_for_each_texture() {
    for (keys, node, name) in
        [("n", "left", "weave"), ("nn", "left", "brick"), ("nnp", "left", "weave"), ("tp", "right", "brick")]
    {
        assert_eq!(last(keys), [Request::Material { node: node.into(), name: name.into() }], "{keys}");
    }
}

#[test]
fn first_arrow_only_shows_the_parameters() {
    let mut board = board();
    board.tab = Tab::Nodes;
    press(&mut board, '↓');
    assert_eq!((board.tab, board.chosen), (Tab::Parameters, 0));
    press(&mut board, '↓');
    assert_eq!(board.chosen, 1);
}

#[test]
fn keys_are_harmless_without_parameters() {
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
        for key in "↑↓←→⇟⇞⤓npt".repeat(2).chars() {
            for request in press(board, key) {
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
