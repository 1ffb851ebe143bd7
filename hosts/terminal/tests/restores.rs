//! The terminal is restored however a program ends. The test runs itself in a pseudo-terminal of `script`
//! (util-linux).

use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use asperity_live::RunControl;
use asperity_live::view::{Layout, ScopeLayout, View};
use asperity_terminal::Terminal;

const ENTER: &str = "\x1b[?1049h";
const LEAVE: &str = "\x1b[?1049l";
const SHOW_CURSOR: &str = "\x1b[?25h";

/// Child, keys that are typed, what is on the screen that stays, and how often the terminal was taken over.
const CASES: [(&str, &[u8], &str, usize); 5] = [
    ("child-panics", b"", "drawn and done", 1),
    ("child-main-panics", b"", "main is done", 1),
    ("child-worker-panics", b"", "thread worker panicked: worker-is-done", 1),
    ("child-catches", b"", "", 2),
    ("child-waits", b"\x03", "asked to stop", 1),
];

fn main() {
    match std::env::args().nth(1).filter(|arg| arg.starts_with("child-")) {
        Some(child) => run_child(&child),
        None if !script_is_there() => {
            eprintln!("SKIPPED: there is no `script` here to make a pseudo-terminal")
        }
        None => {
            for (child, keys, said, entered) in CASES {
                let out = run_in_terminal(child, keys);
                assert_restored(&out, said, entered);
                let first = out.find(LEAVE).unwrap_or(0);
                match child {
                    // It is shown while the run goes on.
                    "child-worker-panics" => assert!(out[..first].contains("worker-is-done"), "{out:?}"),
                    // The message is readable, and then the run goes on.
                    "child-catches" => {
                        let said = out[first..].find("only a try");
                        assert!(said.is_some() && said < out[first..].find(ENTER), "{out:?}");
                    }
                    _ => {}
                }
            }
            pipe_is_refused_with_a_reason();
            terminal_that_does_not_read_blocks_nobody();
            println!("7 cases hold");
        }
    }
}

fn script_is_there() -> bool {
    cfg!(target_os = "linux")
        && Command::new("script").arg("--version").output().is_ok_and(|out| out.status.success())
}

fn start_in_terminal(child: &str) -> Child {
    let own = std::env::current_exe().expect("this program has a path");
    let command = format!(
        "stty rows 60 cols 200; a=$(stty -g); '{}' {child} 2>&1; b=$(stty -g); \
         [ \"$a\" = \"$b\" ] && echo SAME",
        own.display()
    );
    Command::new("script")
        .args(["-qec", &command, "/dev/null"])
        .env("TERM", "xterm-256color")
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("script starts")
}

/// Output of a child to its terminal. `keys` are typed after it has drawn.
fn run_in_terminal(child: &str, keys: &[u8]) -> String {
    let mut script = start_in_terminal(child);
    let mut stdin = script.stdin.take().expect("stdin is a pipe");
    let keys = keys.to_vec();
    // The pipe stays open until the child has ended: script passes an end on as Ctrl-D.
    let typist = thread::spawn(move || {
        thread::sleep(Duration::from_millis(700));
        let _ = stdin.write_all(&keys);
        stdin
    });
    let out = script.wait_with_output().expect("script ends");
    drop(typist.join());
    String::from_utf8_lossy(&out.stdout).into_owned()
}

#[track_caller]
fn assert_restored(out: &str, said: &str, entered: usize) {
    assert_eq!(out.matches(ENTER).count(), entered, "{out:?}");
    let leave = out.rfind(LEAVE).unwrap_or_else(|| panic!("the alternate screen was never left:\n{out:?}"));
    assert!(out.rfind(ENTER) < Some(leave) && out[leave..].contains(SHOW_CURSOR), "{out:?}");
    assert!(out[leave..].contains(said), "{said:?} is not on the screen that stays:\n{out:?}");
    assert!(out.contains("SAME"), "the terminal's settings differ:\n{out:?}");
}

fn pipe_is_refused_with_a_reason() {
    let own = std::env::current_exe().expect("this program has a path");
    let out = Command::new(own).arg("child-waits").stdin(Stdio::null()).output().expect("it starts");
    let text = String::from_utf8_lossy(&out.stdout);
    assert!(text.contains("standard output is no terminal"), "{text}");
    assert!(!text.contains('\x1b'), "{text:?}");
}

fn terminal_that_does_not_read_blocks_nobody() {
    let done = std::env::temp_dir().join(format!("asperity-terminal-{}", std::process::id()));
    let mut script = start_in_terminal(&format!("child-floods={}", done.display()));
    // Nobody reads the output of script: its pipe fills up, and then the pseudo-terminal.
    let until = Instant::now() + Duration::from_secs(60);
    while !done.exists() && Instant::now() < until {
        thread::sleep(Duration::from_millis(20));
    }
    let held_up = !done.exists();
    let _ = script.kill();
    let _ = script.wait();
    let _ = std::fs::remove_file(&done);
    assert!(!held_up, "the program waits for a terminal that does not read");
}

/// Draws frames that have nothing in common, some megabytes in all; then makes the file `done`.
fn flood(terminal: &mut Terminal, done: &str) {
    let scope = ScopeLayout { name: "noise".into(), rate_hz: 48_000, ..ScopeLayout::default() };
    terminal.layout(&Layout { number: 1, scopes: vec![scope; 4], ..Layout::default() });
    for frame in 0..600u32 {
        let noise = |k: u32| ((k ^ frame).wrapping_mul(2_654_435_761) >> 8) as f32 / 8e6 - 1.0;
        let samples: Vec<f32> = (0..96_000).map(noise).collect();
        let view = View { layout: 1, scopes: vec![samples; 4], seconds: f64::from(frame), ..View::default() };
        if terminal.draw(&view).is_err() {
            break;
        }
        thread::sleep(Duration::from_millis(2));
    }
    std::fs::write(done, "done").expect("a file can be made");
}

fn open() -> Option<(Terminal, RunControl)> {
    let run_control = RunControl::default();
    match Terminal::open(run_control.clone()) {
        Ok(mut terminal) => {
            terminal.layout(&Layout { file: "weave.ron".into(), ..Layout::default() });
            Some((terminal, run_control))
        }
        Err(error) => {
            println!("{error}");
            None
        }
    }
}

fn draw_for(terminal: &mut Terminal, ms: u64) {
    let until = Instant::now() + Duration::from_millis(ms);
    while Instant::now() < until {
        terminal.draw(&View::default()).expect("the terminal is there");
        thread::sleep(Duration::from_millis(20));
    }
}

fn run_child(child: &str) {
    let Some((mut terminal, run_control)) = open() else { return };
    draw_for(&mut terminal, 100);
    match child {
        "child-panics" => panic!("drawn and done"),
        "child-main-panics" => {
            thread::spawn(move || draw_for(&mut terminal, 60_000));
            thread::sleep(Duration::from_millis(200));
            panic!("main is done");
        }
        "child-worker-panics" => {
            let worker = thread::Builder::new().name("worker".into());
            let worker = worker.spawn(|| panic!("worker-is-done")).expect("a thread starts");
            assert!(worker.join().is_err());
            draw_for(&mut terminal, 200);
        }
        _ if child.starts_with("child-floods=") => flood(&mut terminal, &child["child-floods=".len()..]),
        "child-catches" => {
            assert!(std::panic::catch_unwind(|| panic!("only a try")).is_err());
            draw_for(&mut terminal, 200);
        }
        _ => {
            let until = Instant::now() + Duration::from_secs(20);
            while !run_control.stopping() && Instant::now() < until {
                draw_for(&mut terminal, 40);
            }
            drop(terminal);
            if run_control.stopping() {
                println!("asked to stop");
            }
        }
    }
}
