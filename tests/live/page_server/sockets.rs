//! The server over real sockets: refusals, limits and bad clients.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_live::view::{Layout, Pointer, Request, View};
use asperity_live::{RunControl, SampleReader, samples};
use asperity_page::{AHEAD, CONNECTIONS, Feed, MESSAGE, Options, PAGES, Page, serve};
use harness::alone::beside_others;
use harness::live::until;
use tungstenite::protocol::CloseFrame;
use tungstenite::{Message, WebSocket};

use super::made_up;
use crate::socket::{self, connect, got, numbers};

/// All files and places of the server, and one that it does not have.
fn files() -> impl Iterator<Item = &'static str> {
    "/ /colours.css /page.css /scene.css /icon.svg /main.js /link.js /hand.js /awake.js /map.js /strokes.js \
     /graph.js /layers.js /scope.js /spectrum.js /timing.js /health.js /controls.js /draw.js /gallery.js \
     /quilt.js /setting.js /listen.js /record.js /places /materials /picture/texture/canvas /nothing"
        .split(' ')
}

struct Stage {
    page: Page,
    feed: Arc<Feed>,
    run_control: RunControl,
}

/// A page whose hand nobody reads.
fn stage() -> Stage {
    let feed = Arc::new(Feed::new());
    feed.publish_layout(made_up::layout());
    let run_control = RunControl::default();
    let hand = Some(samples().0);
    let page = serve(Options::default(), feed.clone(), run_control.clone(), hand).expect("it serves");
    Stage { page, feed, run_control }
}

impl Stage {
    /// Port and token.
    fn address(&self) -> (u16, &str) {
        let (port, token) =
            self.page.url()["http://127.0.0.1:".len()..].split_once("/?token=").expect("an address");
        (port.parse().expect("a port"), token)
    }

    fn tcp(&self) -> TcpStream {
        socket::tcp(self.page.url())
    }

    /// The answer to a request with these headers.
    fn get(&self, target: &str, headers: &str) -> String {
        socket::get(self.page.url(), &format!("{target} HTTP/1.1"), headers)
    }

    /// The answer where all is right.
    fn right(&self, path: &str) -> String {
        let (port, token) = self.address();
        self.get(&format!("{path}?token={token}"), &format!("Host: 127.0.0.1:{port}\r\n"))
    }

    fn watch(&self) -> Result<WebSocket<TcpStream>, u16> {
        connect(self.page.url(), None)
    }

    /// Waits until so many pages are left.
    fn left(&self, pages: usize) {
        let left = format!("\"pages\":{pages}}}");
        until("others are let go", || self.right("/places").ends_with(&left));
    }
}

/// The next view that a page is shown.
fn view(socket: &mut WebSocket<TcpStream>) -> u64 {
    loop {
        if let Message::Binary(view) = socket.read().expect("it shows") {
            return number(&view);
        }
    }
}

/// Reads until the server closes, and says why it did; none for a connection that is cut.
fn closed(socket: &mut WebSocket<TcpStream>) -> Option<CloseFrame> {
    loop {
        match socket.read() {
            Ok(Message::Close(frame)) => return frame,
            Ok(_) => {}
            Err(_) => return None,
        }
    }
}

/// Whether the server keeps a connection open until reading times out.
fn waits(mut stream: &TcpStream) -> bool {
    let end = stream.read_to_end(&mut Vec::new());
    end.is_err_and(|e| matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
}

fn number(view: &[u8]) -> u64 {
    socket::head(view)["view"]["number"].as_u64().expect("a number")
}

#[test]
fn address_without_token_host_or_origin_is_refused() {
    let _alone = beside_others();
    let stage = stage();
    let (port, token) = stage.address();
    let other = token.chars().rev().collect::<String>();
    let host = format!("Host: 127.0.0.1:{port}\r\n");
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
                   Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let right = format!("?token={token}");
    let queries = ["", "?token=", &format!("?token={other}"), &format!("?token={}", &token[1..])]
        .map(str::to_owned)
        .into_iter()
        .chain([format!("{right}x"), format!("{right}&token={other}")])
        .map(|query| (query, host.clone()));
    let hosts = [
        format!("Host: evil.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".to_owned(),
        format!("Host: 127.0.0.1:{port}.evil.example\r\n"),
        format!("{host}Host: evil.example\r\n"),
    ];
    let origins = [
        "http://evil.example".to_owned(),
        format!("http://127.0.0.1:{}", port ^ 1),
        format!("https://127.0.0.1:{port}"),
        "null".to_owned(),
        format!("http://localhost:{port}"),
    ];
    let headers = hosts.into_iter().chain(origins.map(|origin| format!("{host}Origin: {origin}\r\n")));
    let refused: Vec<_> = queries.chain(headers.map(|headers| (right.clone(), headers))).collect();
    for path in files().chain(["/ws"]) {
        let extra = if path == "/ws" { upgrade } else { "" };
        for (query, headers) in &refused {
            let answer = stage.get(&format!("{path}{query}"), &format!("{headers}{extra}"));
            let bad = answer.starts_with("HTTP/1.1 403") || answer.starts_with("HTTP/1.1 400");
            assert!(bad, "{path}{query} {headers}: {answer}");
            assert!(!answer.contains(token), "the token is not told");
        }
    }
    // HTTP/1.1 without a Host never comes to the guard, 1.0 does.
    let answer = socket::get(stage.page.url(), &format!("/?token={token} HTTP/1.0"), "");
    assert!(answer.starts_with("HTTP/1.0 403"), "{answer}");
    stage.left(0);
    assert!(stage.watch().is_ok(), "the program that knows the token may watch");
    let localhost = format!("Host: localhost:{port}\r\nOrigin: http://localhost:{port}\r\n");
    assert!(stage.get(&format!("/?token={token}"), &localhost).starts_with("HTTP/1.1 200"));
}

#[test]
fn files_forbid_and_ask_for_nothing_from_elsewhere() {
    let _alone = beside_others();
    let stage = stage();
    for path in files() {
        let answer = stage.right(path);
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
        let head = head.to_lowercase();
        // The made-up materials have no pictures.
        let is_there = path != "/nothing" && !path.starts_with("/picture");
        assert_eq!(head.starts_with("http/1.1 200"), is_there, "{path}: {head}");
        for header in [
            "content-security-policy: default-src 'none'; script-src 'self'; style-src 'self';",
            "x-content-type-options: nosniff",
            "referrer-policy: no-referrer",
            "cache-control: no-store",
        ] {
            assert!(head.contains(header), "{path} lacks {header}: {head}");
        }
        assert!(!head.contains("unsafe"), "{head}");
        let body = body.replace("http://www.w3.org/2000/svg", "").replace("${scheme}//", "");
        assert!(!body.contains("://"), "{path} names another place");
        for file in files().filter(|file| file.len() > 1) {
            assert!(!body.contains(&format!("\".{file}\"")), "{path} asks for {file} without the token");
        }
    }
}

#[test]
fn of_a_hundred_pages_sixteen_watch_and_the_rest_are_told() {
    let _alone = beside_others();
    let stage = stage();
    let (mut watching, mut refused) = (Vec::new(), Vec::new());
    for _ in 0..100 {
        match stage.watch() {
            Ok(socket) => watching.push(socket),
            Err(status) => refused.push(status),
        }
    }
    assert_eq!((watching.len(), refused), (PAGES, vec![503; 100 - PAGES]));
    assert!(stage.right("/places").ends_with(r#"{"most":16,"pages":16}"#));
    for number in 1..=3 {
        stage.feed.publish(View { number, ..View::default() });
    }
    for socket in &mut watching {
        while view(socket) < 3 {}
    }
    drop(watching.pop());
    stage.left(PAGES - 1);
    watching.push(stage.watch().expect("a place was free"));
}

/// A view as heavy as a run makes one.
fn heavy(number: u64) -> View {
    View { number, scopes: vec![vec![0.5; 8192]; 8], ..View::default() }
}

#[test]
fn pages_that_do_not_read_hold_up_nobody_and_are_let_go() {
    let _alone = beside_others();
    let stage = stage();
    let silent = stage.watch().expect("a place");
    let mut liar = stage.watch().expect("a place");
    let mut good = stage.watch().expect("a place");
    let reader = std::thread::spawn(move || {
        let mut seen = Vec::new();
        while let Ok(message) = good.read() {
            if let Message::Binary(view) = message {
                seen.push(number(&view));
                good.send(got(seen.len() as u64)).expect("it hears");
            }
        }
        seen
    });
    let (began, mut gone, mut n) = (Instant::now(), false, 0u32);
    // Neither reads. One is silent, one claims to read: to that one much is sent.
    while n < 600 && (!gone || n < 200) {
        n += 1;
        stage.feed.publish(heavy(u64::from(n)));
        if n.is_multiple_of(2) {
            let _ = liar.send(got(u64::from(n / 4)));
        }
        gone |= n.is_multiple_of(20) && stage.right("/places").ends_with("\"pages\":1}");
        std::thread::sleep((Duration::from_secs(1) * n / 60).saturating_sub(began.elapsed()));
    }
    stage.left(1);
    drop((silent, liar, stage));
    let (published, seen) = (u64::from(n), reader.join().expect("it reads"));
    assert!(seen.is_sorted(), "in order");
    // Views that come while a busy machine holds the page are left out.
    assert!(seen.len() as u64 * 2 > published, "the good page saw {} of {published}", seen.len());
    assert_eq!(seen.last(), Some(&published), "and the last of all");
}

#[test]
fn page_that_does_not_read_is_still_heard() {
    let _alone = beside_others();
    let stage = stage();
    let mut page = stage.watch().expect("a place");
    // It claims to read, until a send to it waits.
    for n in 1..=100 {
        stage.feed.publish(heavy(n));
        page.send(got(n / 4)).expect("it hears");
        std::thread::sleep(Duration::from_millis(5));
    }
    page.send(Message::Text("\"stop\"".into())).expect("it hears");
    until("the run to be stopped", || stage.run_control.stopping());
    assert!(stage.right("/places").ends_with("\"pages\":1}"), "it was heard before it was let go");
}

#[test]
fn a_page_that_says_nothing_is_sent_no_more_than_a_few_views() {
    let _alone = beside_others();
    let stage = stage();
    let mut silent = stage.watch().expect("a place");
    for n in 1..=400 {
        stage.feed.publish(View { number: n, ..View::default() });
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(Duration::from_millis(200));
    // Once it answers it gets the newest view, not those it missed.
    let (mut seen, mut last) = (0, 0);
    while last < 400 {
        last = view(&mut silent);
        seen += 1;
        silent.send(got(seen)).expect("it hears");
    }
    assert_eq!(seen, AHEAD + 1);
}

#[test]
fn bad_binary_or_too_much_ends_only_its_connection() {
    let _alone = beside_others();
    let stage = stage();
    let mut good = stage.watch().expect("a place");
    let bad = [
        Message::binary(vec![7; 33]),
        numbers(&[1.0, 0.0, 0.0, f64::NAN, 0.0, 0.5, 1.0]),
        got(1_000_000),
        Message::text("x".repeat(MESSAGE + 1)),
        Message::binary(vec![0; 4 << 20]),
    ];
    for message in bad {
        let mut socket = stage.watch().expect("a place");
        let what = format!("{:.30}", format!("{message:?}"));
        // It may be cut while it still sends.
        let sent = socket.send(message);
        let frame = closed(&mut socket);
        assert!(sent.is_err() || frame.is_none_or(|frame| u16::from(frame.code) != 1000), "{what}");
        stage.left(1);
    }
    // Not of the protocol at all.
    let mut raw = stage.watch().expect("a place");
    raw.get_mut().write_all(&[0xff; 4096]).expect("it hears");
    closed(&mut raw);
    let mut raw = stage.tcp();
    raw.write_all(&[0x16; 70_000]).ok();
    raw.read_to_end(&mut Vec::new()).ok();
    // Too often.
    let mut flood = stage.watch().expect("a place");
    for _ in 0..4000 {
        if flood.send(Message::text(r#"{"mute":true}"#)).is_err() {
            break;
        }
    }
    closed(&mut flood);
    stage.left(1);
    stage.feed.publish(View { number: 9, ..View::default() });
    assert_eq!(view(&mut good), 9, "the good one is shown what is new");
    assert!(stage.run_control.muted() && stage.run_control.asked().is_empty());
}

#[test]
fn idle_connections_are_bounded_and_closed() {
    let _alone = beside_others();
    let stage = stage();
    let mut good = stage.watch().expect("a place");
    let idle: Vec<TcpStream> = (0..CONNECTIONS + 40).map(|_| stage.tcp()).collect();
    stage.feed.publish(View::default());
    view(&mut good);
    assert!(idle.iter().all(|stream| !waits(stream)));
}

/// Once, idle connections without a token filled the server, and a page with the token got 503 for 5 s.
#[test]
fn idle_connections_keep_no_page_with_token_out() {
    let _alone = beside_others();
    let stage = stage();
    let idle: Vec<TcpStream> = (0..3 * CONNECTIONS).map(|_| stage.tcp()).collect();
    let begun = Instant::now();
    for _ in 0..20 {
        let answer = stage.right("/places");
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        assert!(stage.watch().is_ok());
    }
    assert!(begun.elapsed() < Duration::from_secs(4), "{:?}", begun.elapsed());
    // The oldest were closed for the newest, which wait on.
    assert!(!waits(&idle[0]));
    let newest = &idle[idle.len() - 1];
    newest.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
    assert!(waits(newest));
}

/// A request for a part that the graph does not have is refused with a reason; any other is asked for.
#[test]
fn request_for_a_missing_part_is_refused_with_a_reason() {
    let _alone = beside_others();
    let stage = stage();
    let mut socket = stage.watch().expect("a place");
    let mut ask = |text: &str| {
        socket.send(Message::text(text)).expect("it hears");
        loop {
            if let Message::Text(answer) = socket.read().expect("it answers")
                && answer.starts_with("{\"error\":")
            {
                return answer.as_str().to_owned();
            }
        }
    };
    for (text, why) in [
        ("garbage", "no command"),
        (&"[".repeat(MESSAGE - 1), "no command"),
        (r#"{"mut":true}"#, "did you mean `mute`?"),
        (r#"{"mute":true,"more":1}"#, "no command"),
        (r#"{"set":["texture.gain"]}"#, "`value` is missing"),
        (r#"{"set":["nobody.gain",1]}"#, "nobody has no parameter gain"),
        (r#"{"set":["texture.loud",1]}"#, "texture has no parameter loud"),
        (r#"{"set":["texture.gain",4.01]}"#, "0 to 4"),
        (r#"{"set":["texture.gain",-1e300]}"#, "0 to 4"),
        (r#"{"set":["texture.gain","loud"]}"#, "0 to 4"),
        (r#"{"set":["texture.material","../../etc/passwd"]}"#, "no material"),
        (r#"{"material":["../../etc/passwd"]}"#, "no material"),
        (r#"{"material":["felt","gate"]}"#, "no materials"),
        (r#"{"gain":1.5}"#, "0 to 1"),
        (r#"{"subscribe":"forces"}"#, "did you mean `force`?"),
    ] {
        assert!(ask(text).contains(why), "{text}");
    }
    assert!(stage.run_control.asked().is_empty(), "nothing of this comes to the run");
    for n in 0..4 {
        let text = format!(r#"{{"set":["texture.gain",{n}]}}"#);
        socket.send(Message::text(text)).expect("it hears");
    }
    for text in [r#"{"mute":true}"#, "\"stop\"", r#"{"set":["texture.gain",1]}"#] {
        socket.send(Message::text(text)).expect("it hears");
    }
    while !matches!(socket.read().expect("it answers"), Message::Text(text) if text.contains("has ended")) {}
    // Of one parameter the newest value counts, and a run that is to stop takes no more.
    let set = Request::Set { node: "texture".into(), param: "gain".into(), value: 3.0 };
    let asked: Vec<_> =
        stage.run_control.asked().into_iter().map(|(request, by)| (request, by.name)).collect();
    assert_eq!(asked, [(set, "page 1".to_owned())]);
    assert!(stage.run_control.muted() && stage.run_control.stopping());
}

#[test]
fn pages_are_told_that_the_run_has_ended() {
    let _alone = beside_others();
    let stage = stage();
    let mut socket = stage.watch().expect("a place");
    let (port, _) = stage.address();
    let ending = std::thread::spawn(move || drop(stage));
    // A page that is in the middle of telling something is not cut off before it has heard: a browser that
    // cannot write does not read on.
    for _ in 0..5 {
        std::thread::sleep(Duration::from_millis(10));
        socket.get_mut().write_all(&[0x8a, 0x80, 0, 0, 0, 0]).expect("it still hears");
    }
    let frame = closed(&mut socket).expect("a reason");
    assert_eq!((u16::from(frame.code), frame.reason.as_str()), (1001, "the run has ended"));
    drop(socket);
    ending.join().expect("it ends");
    assert!(TcpStream::connect(("127.0.0.1", port)).is_err(), "the port is free again");
}

#[test]
fn a_port_that_is_taken_and_a_token_that_is_none_are_errors() {
    let _alone = beside_others();
    let stage = stage();
    let taken = Options { port: stage.address().0, ..Options::default() };
    let odd = Options { token: Some("a&b".into()), ..Options::default() };
    for (options, kind) in [(taken, ErrorKind::AddrInUse), (odd, ErrorKind::InvalidInput)] {
        let error = serve(options, stage.feed.clone(), RunControl::default(), None).expect_err("an error");
        assert_eq!(error.kind(), kind);
    }
}

#[test]
fn hand_goes_on_with_another_writer_and_new_strokes() {
    let _alone = beside_others();
    let stage = stage();
    let (to, mut first) = samples();
    stage.page.set_pointer(Some(to));
    let mut socket = stage.watch().expect("a place");
    let mut touch = |x: f64, number: f64| {
        socket.send(numbers(&[1.0, x, x, x, 0.0, 0.5, number])).expect("it hears");
    };
    let next = |from: &mut SampleReader| {
        let mut sample = None;
        until("a sample", || {
            sample = from.take();
            sample.is_some()
        });
        sample.expect("a sample")
    };
    touch(1.0, 1.0);
    let before = next(&mut first);
    let (to, mut second) = samples();
    stage.page.set_pointer(Some(to));
    for (x, number, on) in [(2.0, 1.0, 0), (3.0, 2.0, 1)] {
        touch(x, number);
        let after = next(&mut second);
        assert_eq!((after.position[0], after.stroke), (x, before.stroke + on));
        assert!(after.time_ns > before.time_ns);
    }
    assert!(first.take().is_none());
}

/// A stroke of so many rows, with one number in place of another.
fn stroke(rows: usize, odd: Option<(usize, f64)>) -> Vec<u8> {
    let mut numbers: Vec<f64> = (0..rows).flat_map(|i| [i as f64 * 1e-3, 1.0, 2.0, 0.5, 0.0, 0.0]).collect();
    if let Some((at, value)) = odd {
        numbers[at] = value;
    }
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

#[test]
fn bad_strokes_and_a_second_render_are_refused() {
    let _alone = beside_others();
    let stage = stage();
    let (port, token) = stage.address();
    let post = |path: &str, body: &[u8]| {
        let mut stream = stage.tcp();
        let host = format!("Host: 127.0.0.1:{port}\r\nContent-Length: {}", body.len());
        write!(stream, "POST {path}?token={token} HTTP/1.1\r\n{host}\r\n\r\n").expect("it hears");
        // It may answer before all is sent.
        let _ = stream.write_all(body);
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        answer.split(' ').nth(1).and_then(|code| code.parse::<u16>().ok()).expect("a status")
    };
    let good = stroke(100, None);
    assert_eq!(post("/render", &good), 409, "the graph has no pointer");
    let pointer = Some(Pointer { depth_mm: 6.6, lift_mm: 2.0, max_force_n: 3.3, height_mm: 0.0 });
    stage.feed.publish_layout(Layout { pointer, ..made_up::layout() });
    for path in ["/render", "/stroke.csv"] {
        assert_eq!(post(path, &stroke(100, Some((7, f64::NAN)))), 400);
        assert_eq!(post(path, &stroke(100, Some((9, 2.0)))), 400);
        assert_eq!(post(path, &stroke(100, Some((12, 1e9)))), 400);
        assert_eq!(post(path, &good[1..]), 400);
        assert_eq!(post(path, b""), 400);
        assert_eq!(post(path, &stroke(60_001, None)), 413);
        assert_eq!(post(path, &good), 200);
    }
    assert_eq!(post("/render", &good), 409, "one at a time");
    assert!(stage.page.wants_rendered().is_some_and(|csv| csv.lines().count() == 101));
    assert_eq!(post("/render", &good), 409, "still one at a time");
    assert!(stage.page.wants_rendered().is_none());
    stage.page.rendered(Err("no such thing".into()));
    assert!(stage.right("/render").contains("no such thing"));
    assert!(
        stage
            .get(&format!("/render.wav?token={token}&number=1"), &format!("Host: 127.0.0.1:{port}\r\n"))
            .starts_with("HTTP/1.1 404")
    );
    assert_eq!(post("/render", &good), 200);
}
