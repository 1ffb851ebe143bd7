//! A connection to the service, and the part of its JSON that is used here.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::net::{IpAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use asperity_node::Diagnostic;
use serde::Deserialize;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, Utf8Bytes, WebSocket, client};

use crate::error;

/// Longest message that is read [bytes].
const LONGEST: usize = 1 << 20;
/// Longest wait of one read.
const SLICE: Duration = Duration::from_millis(20);
/// Longest wait for the other side's close.
const GOODBYE: Duration = Duration::from_millis(30);

pub(super) struct Link {
    socket: WebSocket<TcpStream>,
}

impl Link {
    /// Connects to `host:port`, also written `ws://host:port`; each step within `patience`.
    /// Error: nothing answers, or it does not speak WebSocket.
    pub(super) fn connect(host: &str, patience: Duration) -> Result<Self, Diagnostic> {
        let host = bare(host);
        let connected = || -> Result<_, String> {
            let mut why = "the name has no address".to_owned();
            let mut connect = |address| {
                TcpStream::connect_timeout(&address, patience).inspect_err(|e| why = e.to_string()).ok()
            };
            let found = host.to_socket_addrs().map_err(|e| e.to_string())?.find_map(&mut connect);
            let stream = found.ok_or(why)?;
            set(&stream, patience).map_err(|e| e.to_string())?;
            let again = stream.try_clone().map_err(|e| e.to_string())?;
            let config =
                WebSocketConfig::default().max_message_size(Some(LONGEST)).max_frame_size(Some(LONGEST));
            let shaken = client::client_with_config(format!("ws://{host}/"), stream, Some(config));
            let (socket, _) = shaken.map_err(|e| match e {
                HandshakeError::Interrupted(_) => "it does not answer as a WebSocket".to_owned(),
                HandshakeError::Failure(e) => format!("it does not speak WebSocket: {e}"),
            })?;
            again.set_read_timeout(Some(SLICE)).map_err(|e| e.to_string())?;
            Ok(Self { socket })
        };
        connected().map_err(|why| {
            error(
                format!("no Haply Inverse Service answers at {host}: {why}"),
                "start it (the Haply Hub does, or the service alone), or give its address",
            )
        })
    }

    /// Sends a force, which requests a report. Error: the connection is lost.
    pub(super) fn ask(&mut self, id: &str, force: [f64; 3]) -> Result<(), String> {
        self.socket.send(Message::text(command(id, force))).map_err(|e| e.to_string())
    }

    /// The next report; `None` if `stopped`, or if none came until `end`. Error: the connection is lost.
    pub(super) fn hear(
        &mut self,
        end: Instant,
        stopped: impl Fn() -> bool,
    ) -> Result<Option<Utf8Bytes>, String> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => return Ok(Some(text)),
                // Not in the protocol: passed on as a text that is no report.
                Ok(Message::Binary(_)) => return Ok(Some(Utf8Bytes::from_static("binary data"))),
                Ok(Message::Close(_)) => return Err("it closed the connection".to_owned()),
                Ok(_) => {}
                Err(Error::Io(e)) if waits(e.kind()) => {}
                Err(Error::Utf8(_)) => return Err("it sent a text that is not UTF-8".to_owned()),
                Err(e) => return Err(e.to_string()),
            }
            if stopped() || Instant::now() >= end {
                return Ok(None);
            }
        }
    }

    /// Discards unrequested messages until `end`, so that the next report is the newest. True if all were
    /// read. Error: the connection is lost.
    pub(super) fn drain(&mut self, end: Instant) -> Result<bool, String> {
        let set = |link: &Self, on| link.socket.get_ref().set_nonblocking(on).map_err(|e| e.to_string());
        set(self, true)?;
        let all = loop {
            match self.socket.read() {
                Ok(Message::Close(_)) => break Err("it closed the connection".to_owned()),
                Ok(_) if Instant::now() >= end => break Ok(false),
                Ok(_) => {}
                Err(Error::Io(e)) if waits(e.kind()) => break Ok(true),
                Err(e) => break Err(e.to_string()),
            }
        };
        set(self, false)?;
        all
    }

    /// Closes the connection, and waits a moment for the other side's close.
    pub(super) fn close(mut self) {
        let end = Instant::now() + GOODBYE;
        let mut going = self.socket.close(None).is_ok();
        while going && Instant::now() < end {
            going = match self.socket.read() {
                Ok(_) => true,
                Err(Error::Io(e)) => waits(e.kind()),
                Err(_) => false,
            };
        }
    }
}

/// Sends at once, and waits for nothing longer than this.
fn set(stream: &TcpStream, patience: Duration) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(patience))?;
    stream.set_read_timeout(Some(patience))
}

/// Host and port of an address that may be a WebSocket's.
fn bare(address: &str) -> &str {
    let address = address.trim();
    address.strip_prefix("ws://").unwrap_or(address).trim_end_matches('/')
}

/// Host and port for comparison: all names of this machine are one.
pub(super) fn place(address: &str) -> (String, String) {
    let host = bare(address);
    let (name, port) = host.rsplit_once(':').unwrap_or((host, ""));
    let name = name.trim_start_matches('[').trim_end_matches(']').to_lowercase();
    let ip = name.parse::<IpAddr>().map(|ip| ip.to_canonical());
    let name = match ip {
        // A connection to "any address" goes to this machine.
        Ok(ip) if ip.is_loopback() || ip.is_unspecified() => "localhost".to_owned(),
        Ok(ip) => ip.to_string(),
        Err(_) => name,
    };
    (name, port.to_owned())
}

fn waits(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

/// Longest valid distance of a device \[m\].
const FAR_M: f64 = 10.0;

#[derive(Deserialize)]
struct Report<'a> {
    #[serde(borrow, default)]
    inverse3: Vec<Entry<'a>>,
}

#[derive(Deserialize)]
struct Entry<'a> {
    #[serde(borrow)]
    device_id: Cow<'a, str>,
    state: Option<State>,
}

#[derive(Deserialize)]
struct State {
    cursor_position: Option<Vector>,
}

#[derive(Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

fn parse(text: &str) -> Result<Report<'_>, String> {
    serde_json::from_str(text).map_err(|e| {
        let start: String = text.chars().take(40).collect();
        format!("`{start}` is no report of the service: {e}")
    })
}

/// Ids of the devices in a report. Error: the fault in the text, for a person.
pub(super) fn devices(text: &str) -> Result<Vec<String>, String> {
    Ok(parse(text)?.inverse3.into_iter().map(|d| d.device_id.into_owned()).collect())
}

/// Position of a device in mm, in its own axes; `None` where the report does not have the device. Error: the
/// fault in the text, for a person.
pub(super) fn position(text: &str, id: &str) -> Result<Option<[f64; 3]>, String> {
    let report = parse(text)?;
    let Some(entry) = report.inverse3.iter().find(|d| d.device_id == id) else { return Ok(None) };
    let at = entry.state.as_ref().and_then(|s| s.cursor_position.as_ref());
    let at = at.ok_or_else(|| format!("a report has no position of `{id}`"))?;
    let metres = [at.x, at.y, at.z];
    if metres.iter().any(|m| m.is_nan() || m.abs() > FAR_M) {
        return Err(format!("`{id}` cannot be at {metres:?} m"));
    }
    Ok(Some(metres.map(|m| m * 1e3)))
}

/// Command for a finite force \[N\] of a device, in its own axes.
pub(super) fn command(id: &str, force: [f64; 3]) -> String {
    let id = serde_json::Value::from(id);
    let [x, y, z] = force.map(|f| format!("{f:.6}"));
    let force = format!(r#"{{"set_cursor_force":{{"values":{{"x":{x},"y":{y},"z":{z}}}}}}}"#);
    format!(r#"{{"inverse3":[{{"device_id":{id},"commands":{force}}}]}}"#)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_is_json_with_the_force() {
        let json: serde_json::Value = serde_json::from_str(&command("04\"9D", [0.5, -1e-7, -2.25])).unwrap();
        let device = &json["inverse3"][0];
        assert_eq!(device["device_id"], "04\"9D");
        let values = &device["commands"]["set_cursor_force"]["values"];
        assert_eq!(
            (values["x"].as_f64(), values["y"].as_f64(), values["z"].as_f64()),
            (Some(0.5), Some(0.0), Some(-2.25))
        );
    }

    #[test]
    fn report_is_read_in_mm() {
        let text = r#"{"session_id":7,"inverse3":[{"device_id":"A","state":null},
        {"device_id":"049D","config":{"type":"inverse3","x":[1,2]},"status":{},
         "state":{"cursor_velocity":{"x":1,"y":1,"z":1},
            "cursor_position":{"x":0.01,"y":-0.12,"z":0.15}}}],"verse_grip":[]}"#;
        assert_eq!(position(text, "049D"), Ok(Some([10.0, -120.0, 150.0])));
        assert_eq!(position(text, "B"), Ok(None));
        assert!(position(text, "A").unwrap_err().contains("no position of `A`"));
        assert_eq!(devices(text).unwrap(), ["A", "049D"]);
        assert!(devices("{}").unwrap().is_empty());
    }

    #[test]
    fn invalid_report_error_says_why() {
        let far = r#"{"inverse3":[{"device_id":"A","state":{"cursor_position":{"x":0,"y":1e9,"z":0}}}]}"#;
        let null = r#"{"inverse3":[{"device_id":"A","state":{"cursor_position":{"x":0,"y":null,"z":0}}}]}"#;
        for (text, why) in [
            ("hello", "`hello` is no report"),
            ("", "is no report"),
            ("[1,2]", "is no report"),
            (r#"{"inverse3":3}"#, "is no report"),
            (null, "is no report"),
            (far, "cannot be at"),
        ] {
            assert!(position(text, "A").unwrap_err().contains(why), "{text}");
        }
        let deep = "[".repeat(100_000);
        assert!(position(&deep, "A").is_err());
    }
}
