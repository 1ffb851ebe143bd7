//! The page for a phone: `--bind`, its QR code, and who is refused.

use std::net::{IpAddr, TcpListener};

use harness::Room;
use harness::alone::beside_others;
use harness::live::Live;

use crate::socket::{self, connect};

/// A graph that needs no card.
const QUIET: &str = r#"Graph(version: 1, nodes: {
    "s": (kind: "stroke", params: (extent_mm: 40.0, speed_mm_s: 80.0, duration_s: 600.0)),
    "v": (kind: "velocity"), "p": (kind: "probe")}, wires: [("s", "v"), ("v.speed", "p")])"#;

fn run(room: &Room, bind: &str) -> Live {
    room.write("g.ron", QUIET);
    Live::start(room, &["g.ron", "--page", "--bind", bind])
}

/// Host with port, and token, of a page's address.
fn parts(url: &str) -> (&str, &str) {
    url["http://".len()..].split_once("/?token=").expect("an address with a token")
}

/// The status of the answer to a request with these headers.
fn status(url: &str, headers: &str) -> u16 {
    let (_, token) = parts(url);
    let answer = socket::get(url, &format!("/?token={token} HTTP/1.1"), headers);
    answer.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status")
}

/// The text of the QR code in these lines of half blocks.
fn decoded(lines: &[&str]) -> String {
    const MODULE: usize = 4;
    let rows = |line: &str| -> [Vec<bool>; 2] {
        ["▀█", "▄█"].map(|dark| line.chars().map(|c| dark.contains(c)).collect())
    };
    let modules: Vec<Vec<bool>> = lines.iter().flat_map(|line| rows(line)).collect();
    let size = [MODULE * modules[0].len(), MODULE * modules.len()];
    let mut picture = rqrr::PreparedImage::prepare_from_greyscale(size[0], size[1], |x, y| {
        if modules[y / MODULE][x / MODULE] { 0 } else { 255 }
    });
    let grids = picture.detect_grids();
    grids[0].decode().expect("a QR code").1
}

#[test]
fn bound_to_all_its_code_is_the_address_and_others_are_refused() {
    let _alone = beside_others();
    let room = Room::new();
    let mut live = run(&room, "0.0.0.0");
    let url = live.says("the page: ");
    live.says("warning: the connection to the page is not encrypted");
    let said = live.said();
    let code: Vec<&str> =
        said.lines().filter(|l| l.chars().all(|c| " ▀▄█".contains(c)) && l.len() > 9).collect();
    assert_eq!(decoded(&code), url);
    // Four modules of quiet zone on each side.
    assert!(code.iter().all(|line| line.starts_with("    ") && line.ends_with("    ")), "{said}");

    let (host, token) = parts(&url);
    let port = host.rsplit_once(':').expect("a port").1;
    let (right, foreign) = (format!("Host: {host}\r\n"), "Origin: http://evil.example\r\n");
    assert_eq!(status(&url, &right), 200);
    assert_eq!(status(&url, &format!("{right}Origin: http://{host}\r\n")), 200);
    for headers in [
        format!("Host: evil.example:{port}\r\n"),
        format!("Host: 192.0.2.1:{port}\r\n"),
        format!("Host: 0.0.0.0:{port}\r\n"),
        format!("{right}{foreign}"),
        format!("{right}Origin: http://192.0.2.1:{port}\r\n"),
    ] {
        assert_eq!(status(&url, &headers), 403, "{headers}");
    }
    let other = url.replace(token, &token.chars().rev().collect::<String>());
    assert_eq!(status(&other, &right), 403, "the token is needed");
    let loopback = format!("http://127.0.0.1:{port}/?token={token}");
    assert_eq!(status(&loopback, &format!("Host: localhost:{port}\r\n")), 200);
    assert!(connect(&url, Some(&format!("http://{host}"))).is_ok());
    assert_eq!(connect(&url, Some("http://evil.example")).err(), Some(403));
    // The browser may open a socket to this address alone.
    let answer = socket::get(&url, &format!("/?token={token} HTTP/1.1"), &right);
    assert!(answer.contains(&format!("connect-src 'self' ws://{host};")), "{answer}");
    live.stop().ok();
}

#[test]
fn bound_to_one_address_it_is_that_address_alone() {
    let _alone = beside_others();
    // Every Linux machine has all of 127.0.0.0/8.
    for address in ["127.0.0.2", "::1"] {
        let ip: IpAddr = address.parse().expect("an address");
        if TcpListener::bind((ip, 0)).is_err() {
            println!("SKIPPED: this machine has no {address}");
            continue;
        }
        let room = Room::new();
        let mut live = run(&room, address);
        let url = live.says("the page: ");
        let (host, _) = parts(&url);
        let port = host.rsplit_once(':').expect("a port").1;
        assert_eq!(host.rsplit_once(':').expect("a port").0.trim_matches(['[', ']']), address);
        assert_eq!(status(&url, &format!("Host: {host}\r\n")), 200);
        assert_eq!(status(&url, &format!("Host: 127.0.0.3:{port}\r\n")), 403);
        let elsewhere = std::net::TcpStream::connect(("127.0.0.1", port.parse().expect("a port")));
        assert!(elsewhere.is_err(), "it is reached at another address");
        live.stop().ok();
    }
}

#[test]
fn bind_without_page_or_to_a_foreign_address_is_refused() {
    let _alone = beside_others();
    let room = Room::new();
    room.write("g.ron", QUIET);
    let ran = room.run("run g.ron --bind 127.0.0.1");
    assert!(ran.code == 2 && ran.err.contains("--page"), "{}", ran.err);
    let ran = room.run("run g.ron --page --bind phone");
    assert!(ran.code == 2 && ran.err.contains("phone"), "{}", ran.err);
    let ran = room.run("run g.ron --page --bind 192.0.2.1");
    assert!(ran.code == 1 && ran.err.contains("cannot serve the page at 192.0.2.1"), "{}", ran.err);
}
