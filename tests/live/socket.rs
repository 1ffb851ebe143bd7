//! A page's server without a browser: its sockets, requests to it, and somebody who looks at a run there.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use harness::live::PATIENCE;
use serde_json::Value;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::{Message, WebSocket};

/// A connection to the page's server.
pub(crate) fn tcp(url: &str) -> TcpStream {
    let (host, _) = url["http://".len()..].split_once('/').expect("an address");
    let stream = TcpStream::connect(host).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    stream
}

/// The answer to a request that begins with this line and these headers.
pub(crate) fn get(url: &str, line: &str, headers: &str) -> String {
    let mut stream = tcp(url);
    write!(stream, "GET {line}\r\n{headers}\r\n").expect("it hears");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("it answers");
    answer
}

/// A page's socket, or the status it was refused with.
pub(crate) fn connect(url: &str, origin: Option<&str>) -> Result<WebSocket<TcpStream>, u16> {
    let address = url.replace("http://", "ws://").replace("/?", "/ws?");
    let mut request = address.into_client_request().expect("a request");
    if let Some(origin) = origin {
        request.headers_mut().insert("Origin", origin.parse().expect("a header"));
    }
    match tungstenite::client(request, tcp(url)) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
            Err(answer.status().as_u16())
        }
        Err(e) => panic!("{e}"),
    }
}

/// A message of numbers, as a page sends it.
pub(crate) fn numbers(numbers: &[f64]) -> Message {
    Message::binary(numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
}

/// The message that so many views have come.
pub(crate) fn got(count: u64) -> Message {
    numbers(&[0.0, count as f64])
}

/// The head of a view.
pub(crate) fn head(view: &[u8]) -> Value {
    let end = 4 + u32::from_le_bytes(view[..4].try_into().expect("four bytes")) as usize;
    serde_json::from_slice(&view[4..end]).expect("JSON")
}

/// The last view and layout.
#[derive(Debug, Default)]
pub struct Shown {
    pub view: Value,
    pub layout: Value,
    /// Whether there is something to stroke.
    pub hand: bool,
}

pub struct Onlooker {
    socket: WebSocket<TcpStream>,
    got: u64,
    pub shown: Shown,
}

impl Onlooker {
    /// Opens the page's socket, by the address that the program says.
    pub fn at(url: &str) -> Self {
        let socket = connect(url, None).expect("it is let in");
        Self { socket, got: 0, shown: Shown::default() }
    }

    /// Asks for something.
    pub fn ask(&mut self, what: &Value) {
        self.socket.send(Message::text(what.to_string())).expect("it hears");
    }

    /// Strokes: a place in mm with a pressure, a time in ms and the number of the touch.
    pub fn touches(&mut self, at_ms: f64, x_mm: f64, pressure: f64, number: f64) {
        let told = numbers(&[1.0, at_ms, at_ms, x_mm, 0.0, pressure, number]);
        self.socket.send(told).expect("it hears");
    }

    /// Looks until something is seen.
    pub fn until(&mut self, what: &str, mut is: impl FnMut(&Shown) -> bool) {
        let begun = Instant::now();
        while !is(&self.shown) {
            assert!(begun.elapsed() < PATIENCE, "never seen: {what}; but {}", self.shown.view);
            self.look();
        }
    }

    /// Looks for so long.
    pub fn looks_on(&mut self, time: Duration) {
        let begun = Instant::now();
        while begun.elapsed() < time {
            self.look();
        }
    }

    /// Reads a message, and says so where it is a view.
    fn look(&mut self) {
        match self.socket.read().expect("it is not shown out") {
            Message::Binary(view) => {
                self.shown.view = head(&view)["view"].take();
                self.got += 1;
                self.socket.send(got(self.got)).expect("it hears");
            }
            Message::Text(text) => {
                let said: Value = serde_json::from_str(&text).expect("JSON");
                if said["layout"].is_array() {
                    self.shown.layout = said["layout"][0].clone();
                    self.shown.hand = said["layout"][1] == true;
                }
            }
            _ => {}
        }
    }
}
