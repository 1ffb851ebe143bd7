//! `asperity run --page` with a browser: a pen on the page is heard, and what is done on the page happens.

#[path = "common/chromium.rs"]
mod chromium;
mod common;
#[path = "common/pen.rs"]
mod pen;

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use chromium::Chromium;
use common::json;
use common::live::{CARD, EARS, Live, PATIENCE, graph, npy, rms, rows};
use pen::Pen;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

/// Samples of a tick at 48 kHz.
const TICK: usize = 96;

/// Browsers take most of a small machine: one at a time.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A run of graphs/live.ron whose recordings lie in `dir`, and its page's address.
fn run(dir: &Path, more: &[&str]) -> (Live, String) {
    let probes = r#""speed": (kind: "probe", params: (file: "speed.csv")), "place": (kind: "probe", params: (file: "place.csv")),"#;
    let wires = r#"("motion.speed", "speed"), ("stylus.position", "place"),"#;
    let text = graph("live.ron", &format!("{}{probes}", EARS[0]), &format!("{}{wires}", EARS[1]));
    std::fs::write(dir.join("g.ron"), text).expect("a graph");
    let args = ["g.ron", "--page", "--device", CARD, "--report", "r.json"];
    let mut live = Live::start(dir, &[&args, more].concat());
    let url = live.says("the page: ");
    (live, url)
}

/// Where there is a stretch of `ticks` in which the pen never rests or always does, and something holds of its mean speed: the first
/// tick of each.
fn stretches(speeds: &[Vec<f64>], ticks: usize, holds: impl Fn(f64) -> bool) -> Vec<usize> {
    let starts = (0..speeds.len() / ticks).map(|i| i * ticks);
    let mean = |at: usize| speeds[at..at + ticks].iter().map(|row| row[0]).sum::<f64>() / ticks as f64;
    let even = |at: usize| {
        let moving = speeds[at..at + ticks].iter().filter(|row| row[0] > 0.3 * mean(at)).count();
        mean(at) < 1.0 || moving == ticks
    };
    starts.filter(|&at| holds(mean(at)) && even(at)).collect()
}

#[test]
fn a_pen_on_the_page_is_heard_while_it_moves_and_louder_when_it_is_faster() {
    let _alone = alone();
    let Some(browser) = Chromium::start() else { return };
    let dir = tempfile::tempdir().expect("a folder");
    // A browser on a busy machine may hold events back for longer than a source may be silent.
    let (live, url) = run(dir.path(), &["--set", "stylus.timeout_ms=2000"]);
    let mut pen = Pen::over(browser, &url);
    std::thread::sleep(Duration::from_millis(500));
    pen.strokes(1.5, 20.0);
    pen.strokes(1.5, 160.0);
    pen.lifts();
    pen.browser.eval("1");
    std::thread::sleep(Duration::from_millis(700));
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    live.stop().ok();

    let (speeds, heard) = (rows(&dir.path().join("speed.csv")), npy(&dir.path().join("heard.npy")));
    let report = json(&dir.path().join("r.json"));
    assert!(report["sources"][0]["samples"].as_u64() > Some(400), "{report}");
    // A sound comes up to 100 ms after the motion that makes it, so the first half of every stretch counts for nothing.
    const LONG: usize = 100;
    let level = |at: &usize| {
        rms(heard.get((at + LONG / 2) * TICK..(at + LONG) * TICK).expect("as many samples as ticks"))
    };
    let levels = |holds: &dyn Fn(f64) -> bool| -> Vec<f64> {
        stretches(&speeds, LONG, holds).iter().map(level).collect()
    };
    let rest = levels(&|v| v < 0.1);
    let slow = levels(&|v| (14.0..26.0).contains(&v));
    let fast = levels(&|v| (110.0..210.0).contains(&v));
    println!("rms at rest {rest:.5?}, slow {slow:.5?}, fast {fast:.5?}; {} misses", report["misses"]);
    assert!(rest.len() >= 3 && slow.len() >= 2 && fast.len() >= 2, "the pen did not move as it was told");
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    println!("{:.2} times as loud at eight times the speed", mean(&fast) / mean(&slow));
    assert!(slow.iter().all(|x| *x > 1e-4), "a slow stroke is not heard");
    assert!(rest.iter().all(|x| *x < 0.05 * mean(&slow)), "a pen at rest is heard");
    assert!(mean(&fast) > 1.15 * mean(&slow), "a fast stroke is not louder");
}

/// The fall to silence before a run of zeros that begins at `zero`, in samples: from where the card no longer plays what was
/// sent. None where card and graph cannot be laid over each other, because something was lost in between.
fn fall(sent: &[f32], heard: &[f32], zero: usize) -> Option<usize> {
    const MARK: usize = 960;
    let from = zero.checked_sub(3 * MARK)?;
    let mark = heard.get(from..from + MARK)?;
    let lag = (0..24_000.min(from)).find(|lag| sent.get(from - lag..from - lag + MARK) == Some(mark))?;
    let same = (from..zero).take_while(|&i| heard[i] == sent[i - lag]).count();
    Some(zero - from - same)
}

/// Where silences begin that last longer than a tenth of a second.
fn silences(x: &[f32]) -> Vec<usize> {
    let mut found = Vec::new();
    let mut quiet = 0;
    for (i, x) in x.iter().enumerate() {
        quiet = if *x == 0.0 { quiet + 1 } else { 0 };
        if quiet == 4_800 {
            found.push(i + 1 - quiet);
        }
    }
    found
}

fn largest_step(x: &[f32]) -> f32 {
    x.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f32::max)
}

#[test]
fn mute_gain_and_material_on_the_page_take_effect_within_the_stroke() {
    let _alone = alone();
    let Some(browser) = Chromium::start() else { return };
    let dir = tempfile::tempdir().expect("a folder");
    let (live, url) = run(dir.path(), &["--set", "stylus.timeout_ms=2000"]);
    let mut pen = Pen::over(browser, &url);
    const SPEED: f64 = 120.0;
    pen.strokes(1.0, SPEED);
    for _ in 0..4 {
        pen.does("document.querySelector('#mute').click()");
        pen.strokes(0.7, SPEED);
    }
    let gain = |value: u32| {
        format!(
            "(() => {{ const s = document.querySelector('[data-param=\"strength.gain\"]'); s.value = {value}; \
             s.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()"
        )
    };
    let before = pen.browser.eval("document.querySelector('[data-param=\"strength.gain\"]').value");
    pen.strokes(0.3, SPEED);
    pen.does(&gain(0));
    pen.strokes(0.8, SPEED);
    let told =
        pen.browser.eval("document.querySelector('[data-param=\"strength.gain\"] ~ .figure input').value");
    pen.does(&gain(before.as_str().and_then(|v| v.parse().ok()).expect("a place")));
    pen.strokes(1.0, SPEED);
    pen.does(
        "(() => { const s = document.querySelector('#materials select'); s.value = 'brick'; \
         s.dispatchEvent(new Event('change', { bubbles: true })); })()",
    );
    pen.strokes(1.5, SPEED);
    pen.lifts();
    // Another page is told what holds now.
    pen.browser.open(&url);
    pen.browser.until("document.querySelector('#materials select')?.value === 'brick'");
    pen.browser.until("document.querySelector('#condition').dataset.is === 'playing'");
    let kept = pen.browser.eval("document.querySelector('[data-param=\"strength.gain\"]').value");
    assert_eq!(pen.browser.complaints(), Vec::<String>::new());
    live.stop().ok();
    assert_eq!((told.as_str(), &kept), (Some("0"), &before));

    let (sent, heard) = (npy(&dir.path().join("sent.npy")), npy(&dir.path().join("heard.npy")));
    let begins = heard.iter().position(|x| *x != 0.0).expect("a sound");
    let ends = heard.len() - heard.iter().rev().position(|x| *x != 0.0).expect("a sound");
    let stroke = &heard[begins..ends];
    let quiet = silences(stroke);

    assert!(quiet.len() >= 2, "it was muted twice, and there are silences at {quiet:?} only");
    let falls: Vec<usize> = quiet[..2].iter().filter_map(|q| fall(&sent, &heard, begins + q)).collect();
    println!("silences at {quiet:?} of {} samples, falls of {falls:?} samples", stroke.len());
    assert!(!falls.is_empty(), "samples were lost before both mutes");
    // Where samples were left out within a fall, it is longer on the graph's side than it was at the card.
    assert!(
        falls.iter().any(|samples| (1..=960).contains(samples)),
        "muting takes {falls:?} samples, not 20 ms"
    );
    let back = &stroke[quiet[0]..quiet[1]];
    assert!(rms(&back[back.len() * 3 / 4..]) > 0.3 * rms(&stroke[..quiet[0]]), "it did not come back");

    // On the graph's own side: where the pen is as fast as it is told, and nothing comes out, the gain is 0.
    let speeds = rows(&dir.path().join("speed.csv"));
    let moving = (0..speeds.len() / 50).map(|i| 50 * i).filter(|at| {
        let sum: f64 = speeds[*at..at + 50].iter().map(|row| row[0]).sum();
        sum > 50.0 * 0.5 * SPEED
    });
    let levels: Vec<f64> = moving.map(|at| rms(&sent[(at + 25) * TICK..(at + 50) * TICK])).collect();
    let most = levels.iter().copied().fold(0.0, f64::max);
    let silent = levels.iter().filter(|level| **level < 1e-3 * most).count();
    println!("levels while it moves: {levels:.4?}");
    assert!(silent >= 2 && silent < levels.len() / 2, "a gain of 0 is not heard");

    // The material changed some 1.5 s before the pen was lifted.
    let lifted =
        TICK * (speeds.len() - speeds.iter().rev().position(|v| v[0] > 0.5 * SPEED).expect("a stroke"));
    let ago = |from_s: f64, to_s: f64| {
        let at = |s: f64| lifted - (48_000.0 * s) as usize;
        &sent[at(from_s)..at(to_s)]
    };
    let [old, swap, new] = [ago(2.4, 1.9), ago(1.9, 0.8), ago(0.8, 0.1)];
    println!(
        "largest steps: {:.5} before, {:.5}, {:.5} after",
        largest_step(old),
        largest_step(swap),
        largest_step(new)
    );
    // A texture's largest steps are as random as it is; a switch without a crossfade steps by as much as the signal itself.
    let most = largest_step(old).max(largest_step(new));
    println!("a hard switch would step by some {:.5}", rms(old));
    assert!(rms(old) > 5.0 * f64::from(most) && largest_step(swap) <= 3.0 * most, "the swap clicks");
    let bright = |x: &[f32]| rms(&x.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>()) / rms(x);
    println!("brightness {:.4} before, {:.4} after", bright(old), bright(new));
}

/// Ticks at which the stylus came to a stop for at least half a second.
fn stops(places: &[Vec<f64>]) -> Vec<usize> {
    let still = |at: usize| places[at..].iter().take(250).all(|p| p[..2] == places[at][..2]);
    let moved = |at: usize| places[at - 1][..2] != places[at][..2];
    (1..places.len().saturating_sub(250)).filter(|&at| moved(at) && still(at)).collect()
}

#[test]
fn a_page_that_is_closed_or_hangs_in_a_stroke_leaves_no_sound() {
    let _alone = alone();
    let Some(browser) = Chromium::start() else { return };
    let dir = tempfile::tempdir().expect("a folder");
    let (live, url) = run(dir.path(), &[]);
    let mut pen = Pen::over(browser, &url);
    pen.strokes(1.0, 160.0);
    pen.does("location.href = 'about:blank'");
    std::thread::sleep(Duration::from_millis(1_000));
    pen.lifts();
    let mut pen = Pen::over(pen.browser, &url);
    pen.strokes(1.0, 160.0);
    pen.browser.signal("STOP");
    std::thread::sleep(Duration::from_millis(1_000));
    pen.browser.signal("CONT");
    live.stop().ok();

    let (sent, places) = (npy(&dir.path().join("sent.npy")), rows(&dir.path().join("place.csv")));
    let report = json(&dir.path().join("r.json"));
    let stalls = report["sources"][0]["stalls"].as_u64().expect("a count");
    let stops = stops(&places);
    println!("{stalls} stalls, stops at ticks {stops:?}");
    assert!(stalls >= 2 && stops.len() >= 2, "the page was closed once and hung once");
    // A place was put in where none was lost: both times the pen stood still from within a stroke.
    let mut quiet = 0;
    for at in stops {
        let before = rms(&sent[at.saturating_sub(50) * TICK..at * TICK]);
        let after = rms(&sent[(at + 35) * TICK..(at + 60) * TICK]);
        let later = rms(&sent[(at + 60) * TICK..(at + 250) * TICK]);
        println!("stop at {at}: {before:.5} before, {after:.6} from 70 ms on, {later:.7} from 120 ms on");
        quiet += usize::from(before > 0.01);
        assert!(after < 0.02 * before.max(0.01) && later < 1e-3 * before.max(0.01), "it sounds on");
    }
    assert!(quiet >= 2, "nothing was heard before the page was gone");
}

/// The answer to a request of the page's address with these headers.
fn get(url: &str, target: &str, headers: &str) -> String {
    let (host, _) = url["http://".len()..].split_once('/').expect("an address");
    let mut stream = TcpStream::connect(host).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    write!(stream, "GET {target} HTTP/1.1\r\nHost: {host}\r\n{headers}\r\n").expect("it hears");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    answer
}

/// A page's socket, or the status it was refused with.
fn watch(url: &str, origin: &str) -> Result<WebSocket<TcpStream>, u16> {
    let address = url.replace("http://", "ws://").replace("/?", "/ws?");
    let mut request = address.into_client_request().expect("a request");
    request.headers_mut().insert("Origin", origin.parse().expect("a header"));
    let (host, _) = url["http://".len()..].split_once('/').expect("an address");
    let stream = TcpStream::connect(host).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
            Err(answer.status().as_u16())
        }
        Err(e) => panic!("{e}"),
    }
}

/// Reads so many views and says that it has got them. False where it is shown out.
fn views(socket: &mut WebSocket<TcpStream>, many: u64) -> bool {
    let mut got = 0_u64;
    while got < many {
        match socket.read() {
            Ok(Message::Binary(_)) => {
                got += 1;
                let told = [0.0, got as f64].map(f64::to_le_bytes).concat();
                if socket.send(Message::binary(told)).is_err() {
                    return false;
                }
            }
            Ok(Message::Close(_)) | Err(_) => return false,
            Ok(_) => {}
        }
    }
    true
}

/// Places where a sine breaks, other than at zeros, which are put where nothing was recorded.
fn breaks(x: &[f32], hz: f64) -> usize {
    let c = 2.0 * (std::f64::consts::TAU * hz / 48_000.0).cos();
    let broken = |w: &[f32]| (f64::from(w[2]) - c * f64::from(w[1]) + f64::from(w[0])).abs() > 1e-5;
    x.windows(3).filter(|w| w.iter().all(|x| *x != 0.0) && broken(w)).count()
}

#[test]
fn strangers_are_refused_and_a_hundred_pages_cost_no_sample_that_is_not_counted() {
    let dir = tempfile::tempdir().expect("a folder");
    let text = format!(
        r#"Graph(version: 1, nodes: {{"sine": (kind: "sine", params: (frequency_hz: 80.0)), "limiter": (kind: "limiter"),
           "out": (kind: "audio_out"), {}}}, wires: [("sine", "limiter"), ("limiter", "out"), {}])"#,
        EARS[0], EARS[1]
    );
    std::fs::write(dir.path().join("g.ron"), text).expect("a graph");
    let mut live = Live::start(dir.path(), &["g.ron", "--page", "--device", CARD, "--report", "r.json"]);
    let url = live.says("the page: ");
    let (host, query) = url.split_once("/?").expect("an address with a token");
    let right = format!("/?{query}");

    assert!(get(&url, &right, "").starts_with("HTTP/1.1 200"));
    for (target, headers, says) in [
        ("/", "", "needs the token"),
        ("/?token=0123456789abcdef0123456789abcdef", "", "needs the token"),
        (&right, "Origin: http://evil.example\r\n", "another page"),
        (&right, "Origin: null\r\n", "another page"),
    ] {
        let answer = get(&url, target, headers);
        assert!(answer.starts_with("HTTP/1.1 403") && answer.contains(says), "{target} {headers}: {answer}");
    }
    assert_eq!(watch(&url, "http://evil.example").err(), Some(403));
    assert_eq!(watch(url.split_once('?').expect("a query").0, host).err(), Some(403));

    // One that never reads, one that behaves, and a crowd.
    let lazy = watch(&url, host).expect("there is room");
    let mut good = watch(&url, host).expect("there is room");
    assert!(views(&mut good, 30));
    let crowd: Vec<_> = (0..100).map(|_| watch(&url, host)).collect();
    let (inside, outside): (Vec<_>, Vec<_>) = crowd.into_iter().partition(Result::is_ok);
    assert!(
        inside.len() >= 8 && outside.iter().all(|r| r.as_ref().err() == Some(&503)),
        "{} got in",
        inside.len()
    );
    let readers: Vec<_> = inside
        .into_iter()
        .filter_map(Result::ok)
        .map(|mut socket| std::thread::spawn(move || views(&mut socket, 120)))
        .collect();
    // `good` goes on where it was.
    let begun = Instant::now();
    for n in 31.. {
        if n > 150 && begun.elapsed() > Duration::from_secs(5) {
            break;
        }
        let view = loop {
            match good.read().expect("it is not shown out") {
                Message::Binary(view) => break view,
                _ => continue,
            }
        };
        assert!(!view.is_empty() && begun.elapsed() < PATIENCE);
        good.send(Message::binary([0.0, f64::from(n)].map(f64::to_le_bytes).concat())).expect("it hears");
    }
    let read = readers.into_iter().map(|r| r.join().expect("it reads")).filter(|all| *all).count();
    drop(lazy);
    live.stop().ok();

    let (sent, heard) = (npy(&dir.path().join("sent.npy")), npy(&dir.path().join("heard.npy")));
    let report = json(&dir.path().join("r.json"));
    let count = |name: &str| report[name].as_u64().expect("a count");
    let (ticks, losses) = (count("ticks"), count("underruns") + count("lost_samples"));
    println!(
        "{read} pages read 120 views; {ticks} ticks, {} misses, {} underruns, {} samples lost",
        count("misses"),
        count("underruns"),
        count("lost_samples")
    );
    assert_eq!(sent.len() as u64, ticks * TICK as u64, "a tick is not recorded");
    // From 2.5 s on the card plays at full level.
    let full = heard.get(120_000..heard.len() - 12_000).expect("it ran for more than 3 s");
    let breaks = breaks(full, 80.0);
    assert!(breaks == 0 || losses > 0, "{breaks} breaks, and nothing is said to be lost");
}
