//! Visitors of the page who are too many, or do not listen.

use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use harness::alone::real_time;
use harness::json;
use harness::live::{CARD, Live, PATIENCE, npy, told};
use tungstenite::{Message, WebSocket};

use super::TICK;
use crate::edits::{self, edit};
use crate::socket::{connect, got};

/// Reads so many views and says that it has got them. False where it is shown out.
fn views(socket: &mut WebSocket<TcpStream>, many: u64) -> bool {
    let mut count = 0;
    while count < many {
        match socket.read() {
            Ok(Message::Binary(_)) => {
                count += 1;
                if socket.send(got(count)).is_err() {
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

/// Plays a tone on a page, and lets visitors do something while it does. Every tick that ran is recorded, and
/// what is broken is counted. The answer is the share of its time that was not played, or was late: ticks
/// left out, ticks missed, samples lost, whichever is most.
fn tone(dir: &Path, visit: impl FnOnce(&str)) -> f64 {
    edit(dir, edits::tone("", ""));
    let mut live = Live::start(dir, &["g.ron", "--page", "--device", CARD, "--report", "r.json"]);
    let url = live.says("the page: ");
    visit(&url);
    live.stop().ok();

    let (sent, heard) = (npy(&dir.join("sent.npy")), npy(&dir.join("heard.npy")));
    let report = json(&dir.join("r.json"));
    let count = |name: &str| report[name].as_u64().expect("a count");
    let [ticks, skipped, misses] = ["ticks", "skipped_ticks", "misses"].map(count);
    let [lost_samples, underruns] = ["lost_samples", "underruns"].map(count);
    let most = skipped.max(misses).max(lost_samples / TICK as u64);
    let lost = most as f64 / ticks.max(1) as f64;
    println!("{skipped} left out, {misses} missed of {ticks} ticks: {:.2} % lost", 100.0 * lost);
    assert_eq!(sent.len() as u64, (ticks - skipped) * TICK as u64, "a tick is not recorded");
    // From 2.5 s on the card plays at full level.
    let full = heard.get(120_000..heard.len() - 12_000).expect("it ran for more than 3 s");
    let breaks = breaks(full, 80.0);
    assert!(breaks == 0 || lost_samples + underruns > 0, "{breaks} breaks, and nothing is said to be lost");
    lost
}

/// More that may be lost beside a crowd than alone, of the time of a run. An engine that waits for pages
/// loses most of it.
const MARGIN: f64 = 0.05;
/// Shortest time of a run.
const LONG: Duration = Duration::from_millis(3500);

#[test]
fn a_hundred_pages_cost_no_ticks() {
    let _alone = real_time();
    told(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let alone = tone(dir.path(), |_| std::thread::sleep(LONG));
        let beside = tone(dir.path(), a_crowd);
        if beside > alone + MARGIN {
            return Err(format!("{:.1} % lost beside pages, {:.1} % alone", 100.0 * beside, 100.0 * alone));
        }
        Ok(())
    });
}

/// One page that never reads, one that behaves, and a hundred more.
fn a_crowd(url: &str) {
    let (host, query) = url.split_once('?').expect("a token");
    assert_eq!(connect(url, Some("http://evil.example")).err(), Some(403));
    assert_eq!(connect(&url.replace(query, ""), None).err(), Some(403));
    let host = host.trim_end_matches('/');
    let lazy = connect(url, Some(host)).expect("there is room");
    let mut good = connect(url, Some(host)).expect("there is room");
    assert!(views(&mut good, 30));
    let crowd: Vec<_> = (0..100).map(|_| connect(url, Some(host))).collect();
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
    for n in 31_u64.. {
        if n > 150 && begun.elapsed() > LONG {
            break;
        }
        let view = loop {
            match good.read().expect("it is not shown out") {
                Message::Binary(view) => break view,
                _ => continue,
            }
        };
        assert!(!view.is_empty() && begun.elapsed() < PATIENCE);
        good.send(got(n)).expect("it hears");
    }
    let read = readers.into_iter().map(|r| r.join().expect("it reads")).filter(|all| *all).count();
    println!("{read} pages read 120 views");
    drop(lazy);
}
