//! A hand over the network: Open Sound Control 1.0 in UDP packets.
//!
//! Any sender of positions can be the hand: a tablet's program, a tracker, a script. Options give the
//! address pattern of the messages and the meaning of their arguments, see [`OscOptions::parse`]. The time of
//! a sample is an argument, if listed; or else the time tag of its bundle, unless that is "immediately"; or
//! else the arrival. The first two are mapped to our clock by the fastest packets, which removes jitter. (A
//! `time` sent as a 32-bit float counts milliseconds exactly for 4.6 hours; send a double or an integer.)
//!
//! A new stroke begins with every 0 to 1 of a listed `touch`, when the sender's clock is set, and when
//! another sender takes over after a pause. Unusable messages are counted, with the reason of the last;
//! they never stop the source. Packets are at most 64 KiB and bundles nest at most 8 deep, so memory is
//! bounded.

mod arguments;
mod packet;
mod plausible;

use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::{Arc, atomic::Ordering::Relaxed};
use std::time::Duration;

use asperity_live::{Order, RemoteClock, Sample, SampleWriter, now_ns, place};
use asperity_node::{Descriptor, Diagnostic, Node, Param, Params, Prepared, Registry, Setup, Unit};
use regex::Regex;
use rosc::OscMessage;

use crate::arm::AGAIN;
use crate::handle::Shared;
use crate::node::{PassOn, hand};
use crate::{HandDevice, Handle, Open, error};
use arguments::{Arguments, Reading};
use plausible::Plausible;

pub use packet::walk;

/// Longest wait for a packet before the thread looks for a stop.
const WAIT: Duration = Duration::from_millis(50);
/// After a longer pause, another sender begins a new stroke [ns].
const PAUSE_NS: u64 = 50_000_000;
/// Largest UDP packet [bytes].
const PACKET: usize = 65_536;

/// Options of the receiver.
#[derive(Clone, Debug)]
pub struct OscOptions {
    listen: SocketAddr,
    address: String,
    pattern: Regex,
    arguments: Arguments,
}

impl OscOptions {
    /// `listen`: the address and port to listen at; port 0 chooses a free one. `anywhere` allows an address
    /// other than this machine's loopback: then anybody on the network can move the stylus. `address`: an
    /// OSC 1.0 address or address pattern, such as `/pen` or `/wacom/{1,2}/*`. `arguments`: a list such as
    /// `x_mm, y_mm, -z_m, force_n, _, time_ms`.
    ///
    /// # Errors
    /// An address, pattern or list that cannot be read; an address beyond loopback without `anywhere`.
    pub fn parse(listen: &str, anywhere: bool, address: &str, arguments: &str) -> Result<Self, Diagnostic> {
        let arguments = Arguments::parse(arguments)?;
        let listen = parse_listen(listen)?;
        let pattern = packet::pattern(address)?;
        if !anywhere && !listen.ip().is_loopback() {
            return Err(error(
                format!("{listen} can be reached from the network"),
                "listen at 127.0.0.1, or say `anywhere` if others may move the stylus",
            ));
        }
        Ok(Self { listen, address: address.to_owned(), pattern, arguments })
    }
}

/// The kind of devices.
pub struct Osc;

impl HandDevice for Osc {
    fn input(&self) -> &'static str {
        "osc_input"
    }

    fn register(&self, registry: Registry) -> Registry {
        registry.with::<OscInput>()
    }

    fn configure(&self, params: &Params, _max_force_n: f64) -> Result<Open, Diagnostic> {
        let [listen, address, arguments] = ["listen", "address", "arguments"].map(|p| params.text(p));
        let options = OscOptions::parse(listen, params.flag("anywhere"), address, arguments)?;
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

/// A stylus whose position comes by Open Sound Control over UDP.
struct OscInput;

impl Node for OscInput {
    fn descriptor() -> Descriptor {
        let anywhere =
            "Allows an address that other machines can reach. Anyone there can then move the actuator.";
        let arguments = "Meaning of each argument of a message, with its unit. Positions: x, y, z in mm, \
                         cm or m, such as `x_mm`; a minus inverts an axis. Others: `force_n`, \
                         `pressure` (0 to 1), `touch` (0 or 1), `time_ms`. `_` skips an argument.";
        let most = "Force at full pressure, if messages have a pressure.";
        let it = Descriptor::new("osc_input", "Reads a stylus that another program tracks, over OSC (UDP).")
            .param(Param::text("listen", "127.0.0.1:9000", "Address and port to listen on."))
            .param(Param::flag("anywhere", false, anywhere))
            .param(Param::text(
                "address",
                "/stylus",
                "OSC address of the messages, or an OSC 1.0 address pattern.",
            ))
            .param(Param::text("arguments", "x_mm, y_mm, z_mm", arguments))
            .param(Param::number("max_force_n", 3.3, 0.0..=100.0, most).unit("N"));
        hand(it, (Unit::NEWTON, "normal force, if messages have it"))
    }

    fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
        let p = setup.params;
        let arguments = p.text("arguments");
        let says = ["force", "pressure"].iter().any(|word| arguments.contains(word));
        if setup.outputs[place::FORCE].connected && !says {
            let message = format!("`{}.force` is wired, but no argument of a message has it", setup.id);
            return Err(p
                .error("arguments", message)
                .help("send force_n too, or compute it with virtual_floor"));
        }
        // A force counts as it is, a pressure of 1 is the largest force.
        let newton = if arguments.contains("pressure") { p.number("max_force_n") } else { 1.0 };
        Ok(Prepared::new(PassOn(newton)))
    }
}

/// Parses a listening address: `127.0.0.1:9000`, `localhost:9000`, or a port alone for this machine's
/// loopback.
fn parse_listen(text: &str) -> Result<SocketAddr, Diagnostic> {
    let text = text.trim();
    let port = text.strip_prefix("localhost:").unwrap_or(text);
    if let Ok(port) = port.parse::<u16>() {
        return Ok(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
    }
    text.parse().map_err(|_| {
        error(
            format!("`{text}` is not an address to listen on"),
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

/// Opens the socket and starts to listen. Error: a port that is in use or not allowed.
pub fn start(options: OscOptions, writer: SampleWriter) -> Result<Handle, Diagnostic> {
    let socket = open(options.listen)?;
    let address = socket.local_addr().unwrap_or(options.listen);
    let shared = Arc::new(Shared::default());
    let mut ear = Ear {
        shared: shared.clone(),
        writer,
        options,
        clock: RemoteClock::new(),
        sender: None,
        touched: false,
        stroke: 0,
        newest_ns: 0,
        told: false,
        plausible: Plausible::default(),
    };
    Handle::start("osc", shared, Some(address), move || ear.listen(socket, address))
}

fn open(address: SocketAddr) -> Result<UdpSocket, Diagnostic> {
    let bound = UdpSocket::bind(address).and_then(|s| s.set_read_timeout(Some(WAIT)).map(|()| s));
    bound.map_err(|e| match e.kind() {
        ErrorKind::AddrInUse => error(
            format!("UDP port {} is in use", address.port()),
            "stop the other program or listen at another port",
        ),
        _ => error(
            format!("cannot listen at {address}: {e}"),
            "choose an address of this machine, and a port from 1024 up",
        ),
    })
}

struct Ear {
    shared: Arc<Shared>,
    writer: SampleWriter,
    options: OscOptions,
    clock: RemoteClock,
    sender: Option<(SocketAddr, u64)>,
    touched: bool,
    stroke: u32,
    newest_ns: u64,
    /// Whether an address that does not match was reported.
    told: bool,
    plausible: Plausible,
}

impl Ear {
    fn listen(&mut self, mut socket: UdpSocket, address: SocketAddr) {
        let mut buffer = vec![0; PACKET];
        while !self.shared.stopped() {
            match socket.recv_from(&mut buffer) {
                Ok((length, from)) => self.hear(&buffer[..length], from, now_ns()),
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) => {}
                Err(e) => {
                    self.shared.trouble(format!("the socket at {address} failed: {e}; it is opened again"));
                    let Some(again) = self.shared.reopen(AGAIN, || open(address).ok()) else { return };
                    socket = again;
                    self.shared.well(&format!("listening at {address} again"));
                }
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
        if !packet::fits(&self.options.pattern, &message.addr) {
            if !self.told && self.shared.samples.load(Relaxed) == 0 {
                self.told = true;
                let heard = message.addr.chars().take(80).collect::<String>();
                self.shared.trouble(format!(
                    "a message for `{heard}` came, which `{}` does not match",
                    self.options.address
                ));
            }
            return;
        }
        match self.options.arguments.read(&message.args) {
            Ok(reading) => self.take(reading, tag, arrived_ns),
            Err(why) => self.shared.bad(format!("a message for `{}`: {why}", message.addr)),
        }
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
        if let Some(doubt) = self.plausible.doubt(&reading) {
            self.shared.note(doubt);
        }
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
