//! Somebody who looks at a run over its page's socket, and asks for things there.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use harness::live::PATIENCE;
use serde_json::Value;
use tungstenite::{Message, WebSocket};

use crate::socket::{connect, got, head, numbers};

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
                if said["layout"].is_object() {
                    self.shown.layout = said["layout"].clone();
                    self.shown.hand = said["hand"] == true;
                }
            }
            _ => {}
        }
    }
}
