//! A connection to the service.

use std::io::ErrorKind;
use std::net::{IpAddr, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use asperity_node::Diagnostic;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, HandshakeError, Message, Utf8Bytes, WebSocket, client};

use super::message;
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
        self.socket.send(Message::text(message::command(id, force))).map_err(|e| e.to_string())
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
                Err(Error::Utf8(_)) => return Err("it sent a text that is none".to_owned()),
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
