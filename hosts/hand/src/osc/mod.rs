//! A hand over the network: Open Sound Control 1.0 in UDP packets.
//!
//! Any sender of positions can be the hand: a tablet's program, a tracker, a script. Options give the
//! address pattern of the messages and the meaning of their arguments, see [`parse_arguments`]. The time of
//! a sample is an argument, if listed; or else the time tag of its bundle, unless that is "immediately"; or
//! else the arrival. The first two are mapped to our clock by the fastest packets, which removes jitter. (A
//! `time` sent as a 32-bit float counts milliseconds exactly for 4.6 hours; send a double or an integer.)
//!
//! A new stroke begins with every 0 to 1 of a listed `touch`, when the sender's clock is set, and when
//! another sender takes over after a pause. Unusable messages are counted, with the reason of the last;
//! they never stop the source. Packets are at most 64 KiB and bundles nest at most 8 deep, so memory is
//! bounded. From the sender's call to the queue it takes 10 us (p50; p99 58 us on a loaded machine).

mod arguments;
mod node;
mod packet;
mod pattern;

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::{Arc, atomic::Ordering::Relaxed};
use std::time::Duration;

use asperity_live::{Order, RemoteClock, Sample, SampleWriter, now_ns};
use asperity_node::{Params, Registry};
use rosc::OscMessage;

use crate::handle::{Handle, Shared, spawn};
use crate::{Device, HandDevice, HandError, Open};
pub use arguments::{Arguments, Reading, parse_arguments};
use pattern::Pattern;

/// Longest wait for a packet before the thread looks for a stop.
const WAIT: Duration = Duration::from_millis(50);
/// Wait before a failed socket is opened again.
const AGAIN: Duration = Duration::from_millis(500);
/// After a longer pause, another sender begins a new stroke [ns].
const PAUSE_NS: u64 = 50_000_000;
/// Largest UDP packet [bytes].
const PACKET: usize = 65_536;

/// Options of the receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct OscOptions {
    /// Address and port to listen at; port 0 chooses a free one.
    pub listen: SocketAddr,
    /// Allows an address other than this machine's loopback: then anybody on the network can move the
    /// stylus.
    pub anywhere: bool,
    /// An OSC 1.0 address or address pattern, such as `/pen` or `/wacom/{1,2}/*`.
    pub address: String,
    /// Meaning of the arguments.
    pub arguments: Arguments,
}

impl OscOptions {
    /// Listens at 127.0.0.1:9000.
    pub fn new(address: impl Into<String>, arguments: Arguments) -> Self {
        let listen = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 9000);
        Self { listen, anywhere: false, address: address.into(), arguments }
    }

    /// Checks the options without opening the port.
    ///
    /// # Errors
    /// An invalid address pattern; a listening address beyond loopback without `anywhere`.
    pub fn check(&self) -> Result<(), HandError> {
        self.pattern().map(drop)
    }

    fn pattern(&self) -> Result<Pattern, HandError> {
        let pattern = Pattern::parse(&self.address)?;
        if !self.anywhere && !self.listen.ip().is_loopback() {
            return Err(HandError::option(
                format!("{} can be reached from the network", self.listen),
                "listen at 127.0.0.1, or say `anywhere` if others may move the stylus",
            ));
        }
        Ok(pattern)
    }
}

/// The kind of devices.
pub struct Osc;

impl HandDevice for Osc {
    fn input(&self) -> &'static str {
        "osc_input"
    }

    fn register(&self, registry: Registry) -> Registry {
        registry.with::<node::OscInput>()
    }

    fn configure(&self, params: &Params, _max_force_n: f64) -> Result<Open, HandError> {
        let options = OscOptions {
            address: params.text("address").to_owned(),
            arguments: parse_arguments(params.text("arguments"))?,
            listen: parse_listen(params.text("listen"))?,
            anywhere: params.flag("anywhere"),
        };
        options.check()?;
        Ok(Box::new(|writer, _| start(options, writer)))
    }

    fn excludes(&self, params: &Params, _open: &Params, address: Option<SocketAddr>) -> bool {
        let ours = parse_listen(params.text("listen"));
        ours.is_ok_and(|ours| address.is_some_and(|theirs| exclude(ours, theirs)))
    }

    fn invitation(&self, params: &Params) -> Option<String> {
        let [address, arguments, listen] = ["address", "arguments", "listen"].map(|p| params.text(p));
        Some(format!("waits for OSC messages {address} ({arguments}) at {listen}"))
    }
}

/// Parses a listening address: `127.0.0.1:9000`, `localhost:9000`, or a port alone for this machine's
/// loopback.
///
/// # Errors
/// Anything else.
pub fn parse_listen(text: &str) -> Result<SocketAddr, HandError> {
    let here = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let text = text.trim();
    let port = text.strip_prefix("localhost:").unwrap_or(text);
    if let Ok(port) = port.parse::<u16>() {
        return Ok(SocketAddr::new(here, port));
    }
    text.parse().map_err(|_| {
        HandError::option(
            format!("`{text}` is no address to listen at"),
            "write an IP address and a port, such as 127.0.0.1:9000, or a port alone",
        )
    })
}

/// Whether two sources cannot listen at these addresses at once: the port is the same, and the IP address
/// too, or one of them is all addresses (also those of the other IP version: a socket at `[::]` may take
/// IPv4 packets). Port 0 is a free one.
fn exclude(one: SocketAddr, other: SocketAddr) -> bool {
    let (a, b) = (one.ip().to_canonical(), other.ip().to_canonical());
    let all = a.is_unspecified() || b.is_unspecified();
    one.port() != 0 && one.port() == other.port() && (all || a == b)
}

/// Opens the socket and starts to listen.
///
/// # Errors
/// Those of [`OscOptions::check`]; a port that is in use or not allowed.
pub fn start(options: OscOptions, writer: SampleWriter) -> Result<Handle, HandError> {
    let pattern = options.pattern()?;
    let socket = open(options.listen)?;
    let address = socket.local_addr().unwrap_or(options.listen);
    let shared = Arc::new(Shared::default());
    shared.set_device(Device { name: format!("OSC at {address}"), ..Device::default() });
    shared.set_connected(true);
    let mut ear = Ear {
        shared: shared.clone(),
        writer,
        arguments: options.arguments,
        written: options.address,
        pattern,
        known: (String::new(), false),
        clock: RemoteClock::new(),
        sender: None,
        touched: false,
        stroke: 0,
        newest_ns: 0,
        told: false,
    };
    let thread = spawn("osc", move || ear.listen(socket, address))?;
    Ok(Handle::new(shared, thread, Some(address)))
}

fn open(address: SocketAddr) -> Result<UdpSocket, HandError> {
    let socket = UdpSocket::bind(address).map_err(|e| match e.kind() {
        ErrorKind::AddrInUse => HandError::taken(
            format!("UDP port {} is in use", address.port()),
            "stop the other program or listen at another port",
        ),
        _ => HandError::missing(
            format!("cannot listen at {address}: {e}"),
            "choose an address of this machine, and a port from 1024 up",
        ),
    })?;
    let ready = socket.set_read_timeout(Some(WAIT));
    ready.map_err(|e| HandError::missing(format!("cannot listen at {address}: {e}"), "try again"))?;
    Ok(socket)
}

/// The listening thread.
struct Ear {
    shared: Arc<Shared>,
    writer: SampleWriter,
    arguments: Arguments,
    /// The pattern as written.
    written: String,
    pattern: Pattern,
    /// The last address, and whether it matched: senders seldom change it.
    known: (String, bool),
    clock: RemoteClock,
    sender: Option<(SocketAddr, u64)>,
    touched: bool,
    stroke: u32,
    newest_ns: u64,
    /// Whether an address that does not match was reported.
    told: bool,
}

impl Ear {
    fn listen(&mut self, mut socket: UdpSocket, address: SocketAddr) {
        let mut buffer = vec![0; PACKET];
        while !self.shared.stopped() {
            match socket.recv_from(&mut buffer) {
                Ok((length, from)) => {
                    let packet = buffer.get(..length).unwrap_or_default();
                    self.hear(packet, from, now_ns());
                }
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) => {}
                Err(e) => {
                    self.shared.set_connected(false);
                    self.shared.trouble(format!("the socket at {address} failed: {e}; it is opened again"));
                    match self.reopen(address) {
                        Some(again) => socket = again,
                        None => return,
                    }
                }
            }
        }
    }

    fn reopen(&self, address: SocketAddr) -> Option<UdpSocket> {
        loop {
            std::thread::park_timeout(AGAIN);
            if self.shared.stopped() {
                return None;
            }
            if let Ok(socket) = open(address) {
                self.shared.set_connected(true);
                self.shared.well(&format!("listening at {address} again"));
                return Some(socket);
            }
        }
    }

    fn hear(&mut self, packet: &[u8], from: SocketAddr, arrived_ns: u64) {
        if let Some((before, then)) = self.sender
            && before != from
            && arrived_ns.saturating_sub(then) > PAUSE_NS
        {
            self.anew();
            self.clock = RemoteClock::new();
        }
        self.sender = Some((from, arrived_ns));
        let end = packet::walk(packet, &mut |message, tag| self.message(&message, tag, arrived_ns));
        if let Err(why) = end {
            self.shared.bad(format!("a packet of {} bytes from {from}: {why}", packet.len()));
        }
    }

    fn message(&mut self, message: &OscMessage, tag: Option<u64>, arrived_ns: u64) {
        if !self.matches(&message.addr) {
            if !self.told && self.shared.samples.load(Relaxed) == 0 {
                self.told = true;
                let heard = message.addr.chars().take(80).collect::<String>();
                self.shared.trouble(format!(
                    "a message for `{heard}` came, which `{}` does not match",
                    self.written
                ));
            }
            return;
        }
        match self.arguments.read(&message.args) {
            Ok(reading) => self.take(reading, tag, arrived_ns),
            Err(why) => self.shared.bad(format!("a message for `{}`: {why}", message.addr)),
        }
    }

    fn matches(&mut self, address: &str) -> bool {
        if self.known.0 != address {
            self.known = (address.to_owned(), self.pattern.fits(address));
        }
        self.known.1
    }

    fn take(&mut self, reading: Reading, tag: Option<u64>, arrived_ns: u64) {
        let time = match reading.time_ns.or(tag.map(ntp_ns)) {
            None => arrived_ns,
            Some(sent_ns) => {
                let sent_s = sent_ns * 1e-9;
                match self.clock.hear(sent_s, arrived_ns) {
                    Order::Next => {}
                    Order::Anew => self.anew(),
                    Order::Late => return self.shared.bad("a sample came after a later one".to_owned()),
                }
                self.clock.time_ns(sent_s, arrived_ns)
            }
        };
        if let Some(touch) = reading.touch {
            if touch && !self.touched {
                self.anew();
            }
            self.touched = touch;
        }
        self.newest_ns = self.newest_ns.max(time);
        let sample = Sample {
            time_ns: self.newest_ns,
            arrived_ns,
            position: reading.position,
            force: reading.force,
            stroke: self.stroke,
        };
        self.shared.send(&mut self.writer, sample);
    }

    fn anew(&mut self) {
        self.stroke = self.stroke.wrapping_add(1);
    }
}

/// NTP time tag in ns since 1900.
fn ntp_ns(tag: u64) -> f64 {
    // In integers, rounded once: a double holds today's count to half a microsecond.
    let (seconds, fraction) = (tag >> 32, tag & 0xffff_ffff);
    (u128::from(seconds) * 1_000_000_000 + ((u128::from(fraction) * 1_000_000_000) >> 32)) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_tag_fraction_converts_to_ns() {
        assert_eq!(ntp_ns((3 << 32) | (1 << 31)), 3.5e9);
        let today = 3_970_000_000u64 << 32;
        assert!((ntp_ns(today + (1 << 22)) - ntp_ns(today) - 976_562.5).abs() < 1000.0);
    }

    #[test]
    fn listen_address_may_be_a_port_alone() {
        assert_eq!(parse_listen("9001").unwrap(), "127.0.0.1:9001".parse().unwrap());
        assert_eq!(parse_listen(" localhost:7 ").unwrap(), "127.0.0.1:7".parse().unwrap());
        assert_eq!(parse_listen("0.0.0.0:9").unwrap(), "0.0.0.0:9".parse().unwrap());
        assert!(parse_listen("here").unwrap_err().to_string().contains("127.0.0.1:9000"));
    }

    #[test]
    fn addresses_that_hear_the_same_packet_exclude_each_other() {
        for (one, other, excluded) in [
            ("127.0.0.1:9731", "127.0.0.1:9731", true),
            ("127.0.0.1:9731", "127.0.0.1:9732", false),
            ("127.0.0.1:9731", "127.0.0.2:9731", false),
            ("127.0.0.1:9731", "[::1]:9731", false),
            ("127.0.0.1:9731", "[::ffff:127.0.0.1]:9731", true),
            ("127.0.0.1:9731", "0.0.0.0:9731", true),
            ("127.0.0.1:9731", "[::]:9731", true),
            ("[::1]:9731", "[::]:9731", true),
            ("0.0.0.0:9731", "[::]:9731", true),
            ("0.0.0.0:9731", "0.0.0.0:9732", false),
            ("127.0.0.1:0", "127.0.0.1:0", false),
        ] {
            let [a, b] = [one, other].map(|text| parse_listen(text).unwrap());
            assert_eq!([exclude(a, b), exclude(b, a)], [excluded; 2], "{one} and {other}");
        }
    }
}
