//! The screens of a study: one server for the participant, another for the experimenter.
//!
//! Each has a token of its own, so that a participant cannot open the experimenter's screen. A page asks for
//! the state that follows the one it shows, and waits. A press waits for the host's verdict.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use asperity_live::SampleWriter;
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use parking_lot::Mutex;
use serde::Deserialize;
use serde_json::Value;
use tokio::sync::{oneshot, watch};
use tokio::time::timeout;

use crate::pad::{self, Pad};
use crate::site::{AWAKE, COLOURS, DRAW, File, HTML, ICON, LINK, Options, POINTER, SCRIPT, STYLE, Site};

/// Most bytes of a press.
pub const PRESS: usize = 64 * 1024;
/// Longest wait for another state, and for a verdict.
const HOLD: Duration = Duration::from_secs(5);

/// Who looks at a screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    /// The person who feels and answers.
    Participant,
    /// The person who mounts samples and looks after the session.
    Experimenter,
}

/// A screen of a study in the browser. A drop stops its server.
pub struct Screen {
    site: Site,
    shared: Arc<Shared>,
}

/// Something that a person pressed, and that waits for a verdict. A drop without one answers 503.
#[derive(Debug)]
pub struct Pressed {
    /// The press: an object of JSON.
    pub press: Value,
    verdict: oneshot::Sender<Result<(), String>>,
}

struct Shared {
    /// The state and its number, from 1.
    shown: watch::Sender<(u64, Value)>,
    pressed: Mutex<VecDeque<Pressed>>,
    stop: watch::Sender<bool>,
}

/// Serves a screen on a thread of its own, until the [`Screen`] is dropped.
///
/// `pointer` takes the strokes of a participant's pad: x to the right and y away from the person, in mm from
/// the middle of the pad, and pressure from 0 to 1 as force. The pad is there while a state has `pad: true`.
///
/// # Errors
///
/// The port is taken. The address is not of this machine. The token has characters that an address may not
/// hold. The system gives no random numbers, or no thread.
pub fn screen(options: Options, who: Who, pointer: Option<SampleWriter>) -> io::Result<Screen> {
    let shared = Arc::new(Shared {
        shown: watch::Sender::new((0, Value::Null)),
        pressed: Mutex::default(),
        stop: watch::Sender::new(false),
    });
    let mut router = Router::new()
        .route("/state", get(state))
        .route("/press", post(press))
        .layer(DefaultBodyLimit::max(PRESS))
        .with_state(shared.clone());
    if let Some(pointer) = pointer {
        let pad = Arc::new(Pad::new(pointer, shared.stop.clone()));
        router = router.merge(Router::new().route("/ws", get(pad::stroke)).with_state(pad));
    }
    let [page, script] = match who {
        Who::Participant => PARTICIPANT,
        Who::Experimenter => EXPERIMENTER,
    };
    let files = [page, script, STYLES, POLL, ICON, COLOURS, AWAKE, LINK, POINTER, DRAW];
    let site = Site::open(options, router, &files, shared.stop.clone(), None)?;
    Ok(Screen { site, shared })
}

const PARTICIPANT: [File; 2] = [
    ("/", HTML, include_str!("../static/study/participant.html")),
    ("/screen.js", SCRIPT, include_str!("../static/study/participant.js")),
];
const EXPERIMENTER: [File; 2] = [
    ("/", HTML, include_str!("../static/study/experimenter.html")),
    ("/screen.js", SCRIPT, include_str!("../static/study/experimenter.js")),
];
const STYLES: File = ("/screen.css", STYLE, include_str!("../static/study/screen.css"));
const POLL: File = ("/poll.js", SCRIPT, include_str!("../static/study/poll.js"));

impl Screen {
    /// The first address to open, with its token.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.urls()[0]
    }

    /// Every address to open, with its token. Those of other machines come first.
    #[must_use]
    pub fn urls(&self) -> &[String] {
        self.site.urls()
    }

    /// Shows a state. One that is shown already costs a comparison only.
    pub fn show(&self, screen: Value) {
        self.shared.shown.send_if_modified(|shown| {
            let is_new = shown.1 != screen;
            if is_new {
                *shown = (shown.0 + 1, screen);
            }
            is_new
        });
    }

    /// The oldest press that waits. The control thread asks some tens of times a second. A press that nobody
    /// takes for 5 s, or whose page has gone, is dropped.
    #[must_use]
    pub fn pressed(&self) -> Option<Pressed> {
        let mut waiting = self.shared.pressed.lock();
        std::iter::from_fn(|| waiting.pop_front()).find(|pressed| !pressed.verdict.is_closed())
    }
}

impl std::fmt::Debug for Screen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Screen").field("number", &self.shared.shown.borrow().0).finish_non_exhaustive()
    }
}

impl Pressed {
    /// Says to the page whether the press counts, and else why not.
    pub fn answer(self, verdict: Result<(), String>) {
        let _ = self.verdict.send(verdict);
    }
}

#[derive(Deserialize)]
struct Seen {
    #[serde(default)]
    seen: u64,
}

/// The state with another number than the one that the page has seen, or the same after a while.
async fn state(State(shared): State<Arc<Shared>>, Query(Seen { seen }): Query<Seen>) -> Response {
    let (mut shown, mut stop) = (shared.shown.subscribe(), shared.stop.subscribe());
    tokio::select! {
        _ = stop.wait_for(|stop| *stop) => return over(),
        _ = timeout(HOLD, shown.wait_for(|(number, _)| *number != seen)) => {}
    }
    let (number, screen) = &*shown.borrow();
    let body = format!("{{\"number\":{number},\"screen\":{screen}}}");
    ([(header::CONTENT_TYPE, "application/json")], body).into_response()
}

/// Hands a press to the host, and waits for its verdict.
async fn press(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    let Ok(press @ Value::Object(_)) = serde_json::from_slice(&body) else {
        return (StatusCode::BAD_REQUEST, "a press is an object of JSON\n").into_response();
    };
    let mut stop = shared.stop.subscribe();
    let (verdict, told) = oneshot::channel();
    {
        let mut pressed = shared.pressed.lock();
        pressed.retain(|pressed| !pressed.verdict.is_closed());
        pressed.push_back(Pressed { press, verdict });
    }
    let told = tokio::select! {
        _ = stop.wait_for(|stop| *stop) => return over(),
        told = timeout(HOLD, told) => told,
    };
    match told {
        Ok(Ok(Ok(()))) => StatusCode::NO_CONTENT.into_response(),
        Ok(Ok(Err(why))) => (StatusCode::CONFLICT, why).into_response(),
        Ok(Err(_)) | Err(_) => (StatusCode::SERVICE_UNAVAILABLE, "nobody took this press\n").into_response(),
    }
}

fn over() -> Response {
    (StatusCode::SERVICE_UNAVAILABLE, "the session has ended\n").into_response()
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpStream;
    use std::thread::{JoinHandle, spawn};
    use std::time::Instant;

    use serde_json::json;

    use super::*;

    fn open(who: Who) -> Screen {
        screen(Options::default(), who, None).expect("it serves")
    }

    /// Status and body of the answer to a request for a path with its query, on a thread of its own.
    fn ask(screen: &Screen, path: &str, body: Option<String>) -> JoinHandle<(u16, String)> {
        let (host, token) = screen.url()["http://".len()..].split_once("/?").expect("an address");
        let target = format!("{path}{}{token}", if path.contains('?') { "&" } else { "?" });
        let (host, method) = (host.to_owned(), if body.is_some() { "POST" } else { "GET" });
        spawn(move || {
            let body = body.unwrap_or_default();
            let mut stream = TcpStream::connect(&host).expect("it listens");
            let length = body.len();
            let head =
                format!("{method} {target} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n");
            stream.write_all(head.as_bytes()).expect("it hears");
            // A body that is too long is not read to its end.
            let _ = stream.write_all(body.as_bytes());
            let mut answer = String::new();
            let _ = stream.read_to_string(&mut answer);
            let (head, body) = answer.split_once("\r\n\r\n").expect("a head and a body");
            (head["HTTP/1.1 ".len()..][..3].parse().expect("a status"), body.to_owned())
        })
    }

    fn get(screen: &Screen, path: &str) -> (u16, String) {
        ask(screen, path, None).join().expect("it answers")
    }

    fn post(screen: &Screen, body: &str) -> JoinHandle<(u16, String)> {
        ask(screen, "/press", Some(body.to_owned()))
    }

    /// The next press that waits.
    fn taken(screen: &Screen) -> Pressed {
        let until = Instant::now() + Duration::from_secs(20);
        loop {
            if let Some(pressed) = screen.pressed() {
                return pressed;
            }
            assert!(Instant::now() < until, "no press came");
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Waits until so many requests wait for another state.
    fn asked(screen: &Screen, count: usize) {
        let until = Instant::now() + Duration::from_secs(20);
        while screen.shared.shown.receiver_count() < count {
            assert!(Instant::now() < until, "{} ask", screen.shared.shown.receiver_count());
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    #[test]
    fn each_screen_serves_its_own_page_to_its_own_token() {
        let (participant, experimenter) = (open(Who::Participant), open(Who::Experimenter));
        for (screen, body) in
            [(&participant, "class=\"participant\""), (&experimenter, "class=\"experimenter\"")]
        {
            let (status, page) = get(screen, "/");
            assert!(status == 200 && page.contains(body), "{page}");
            for file in ["/screen.js", "/screen.css", "/poll.js", "/colours.css", "/draw.js", "/icon.svg"] {
                let (status, text) = get(screen, file);
                assert!(
                    status == 200 && !text.contains("\"./draw.js\""),
                    "{file} lacks the token in its imports"
                );
            }
            assert_eq!(get(screen, "/ws").0, 404);
        }
        assert!(get(&participant, "/").1.contains("<title>Study</title>"));
        let token = |screen: &Screen| screen.url().split_once("token=").expect("a token").1.to_owned();
        assert_ne!(token(&participant), token(&experimenter));
        let foreign = |path: &str, headers: &str| {
            let host = participant.url()["http://".len()..].split_once('/').expect("an address").0;
            let mut stream = TcpStream::connect(host).expect("it listens");
            write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n{headers}\r\n").expect("it hears");
            let mut answer = String::new();
            stream.read_to_string(&mut answer).expect("it answers");
            assert!(answer.starts_with("HTTP/1.1 403"), "{path} {headers}: {answer}");
        };
        foreign(&format!("/state?token={}", token(&experimenter)), "");
        foreign("/state?seen=0", "");
        foreign(&format!("/?token={}", token(&participant)), "Origin: http://evil.example\r\n");
    }

    #[test]
    fn state_is_sent_as_soon_as_it_differs_from_the_seen_one() {
        let screen = open(Who::Participant);
        // Two pages wait for the first state.
        let pages = [(); 2].map(|()| ask(&screen, "/state?seen=0", None));
        asked(&screen, 2);
        screen.show(json!({ "state": "welcome" }));
        for page in pages {
            let (status, body) = page.join().expect("it answers");
            assert_eq!((status, body.as_str()), (200, r#"{"number":1,"screen":{"state":"welcome"}}"#));
        }
        // The same state again has the same number, and one that is behind gets it at once.
        screen.show(json!({ "state": "welcome" }));
        assert!(get(&screen, "/state").1.starts_with(r#"{"number":1,"#));
        let page = ask(&screen, "/state?seen=1", None);
        asked(&screen, 1);
        screen.show(json!({ "state": "end" }));
        assert_eq!(page.join().expect("it answers").1, r#"{"number":2,"screen":{"state":"end"}}"#);
        assert_eq!(get(&screen, "/state?seen=x").0, 400);
    }

    #[test]
    fn unchanged_state_is_sent_again_after_some_seconds() {
        let screen = open(Who::Experimenter);
        screen.show(json!({}));
        let began = Instant::now();
        assert_eq!(get(&screen, "/state?seen=1"), (200, r#"{"number":1,"screen":{}}"#.to_owned()));
        assert!(began.elapsed() >= HOLD);
    }

    #[test]
    fn press_is_answered_with_the_hosts_verdict() {
        let screen = open(Who::Participant);
        let press = |text: &str| post(&screen, text);
        let page = press(r#"{"press":"next","token":"1"}"#);
        let pressed = taken(&screen);
        assert_eq!(pressed.press, json!({ "press": "next", "token": "1" }));
        pressed.answer(Ok(()));
        assert_eq!(page.join().expect("it answers"), (204, String::new()));
        let page = press(r#"{"press":"next","token":"1"}"#);
        taken(&screen).answer(Err("this screen is not shown any more".to_owned()));
        assert_eq!(page.join().expect("it answers"), (409, "this screen is not shown any more".to_owned()));
        let page = press("{}");
        drop(taken(&screen));
        assert_eq!(page.join().expect("it answers").0, 503);
        for bad in ["", "[]", "3", "{", "\"next\""] {
            assert_eq!(press(bad).join().expect("it answers").0, 400, "{bad}");
        }
        assert!(screen.pressed().is_none());
    }

    #[test]
    fn press_is_limited_in_length() {
        let screen = open(Who::Participant);
        let of = |length: usize| format!("{{\"text\":\"{}\"}}", "x".repeat(length - 11));
        assert_eq!(post(&screen, &of(PRESS + 1)).join().expect("it answers").0, 413);
        let page = post(&screen, &of(PRESS));
        taken(&screen).answer(Ok(()));
        assert_eq!(page.join().expect("it answers").0, 204);
    }

    /// A press that was told to have failed must not count later.
    #[test]
    fn press_that_nobody_takes_is_withdrawn() {
        let screen = open(Who::Participant);
        assert_eq!(post(&screen, "{}").join().expect("it answers").0, 503);
        assert!(screen.pressed().is_none());
    }

    #[test]
    fn drop_of_a_screen_answers_those_who_wait() {
        let screen = open(Who::Participant);
        let polls = [(); 3].map(|()| ask(&screen, "/state?seen=0", None));
        asked(&screen, 3);
        let press = post(&screen, "{}");
        let pressed = taken(&screen);
        let began = Instant::now();
        drop(screen);
        assert!(began.elapsed() < Duration::from_secs(2), "{:?}", began.elapsed());
        for waiting in polls.into_iter().chain([press]) {
            assert_eq!(waiting.join().expect("it answers").0, 503);
        }
        pressed.answer(Ok(()));
    }
}
