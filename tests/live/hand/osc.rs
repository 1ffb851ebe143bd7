//! OSC over real sockets, as a sender and a person see it.

use std::net::UdpSocket;
use std::time::Duration;

use asperity_hand::Handle;
use asperity_hand::osc::{self, OscOptions};
use asperity_live::{Sample, SampleReader, samples};
use asperity_node::Diagnostic;
use harness::alone::beside_others;
use harness::live::until;
use rosc::{OscBundle, OscMessage, OscPacket, OscTime, OscType, encoder};

const HERE: &str = "127.0.0.1:0";

fn begin(address: &str, arguments: &str) -> (Handle, SampleReader, UdpSocket) {
    let (to, from) = samples();
    let handle = osc::start(OscOptions::parse(HERE, false, address, arguments).unwrap(), to).unwrap();
    let socket = sender(&handle);
    (handle, from, socket)
}

/// Another sender.
fn sender(to: &Handle) -> UdpSocket {
    let socket = UdpSocket::bind(HERE).unwrap();
    socket.connect(to.address().unwrap()).unwrap();
    socket
}

/// A message of the pen, with numbers.
fn pen(numbers: &[f64]) -> OscPacket {
    message("/pen", numbers.iter().map(|x| OscType::Double(*x)).collect())
}

/// A bundle with an NTP time tag.
fn bundle(seconds: u32, fractional: u32, content: Vec<OscPacket>) -> OscPacket {
    OscPacket::Bundle(OscBundle { timetag: OscTime { seconds, fractional }, content })
}

fn message(address: &str, args: Vec<OscType>) -> OscPacket {
    OscPacket::Message(OscMessage { addr: address.into(), args })
}

fn send(socket: &UdpSocket, packet: &OscPacket) {
    socket.send(&encoder::encode(packet).unwrap()).unwrap();
}

fn take(from: &mut SampleReader, count: usize) -> Vec<Sample> {
    let mut all = Vec::new();
    until("samples", || {
        all.extend(std::iter::from_fn(|| from.take()));
        all.len() >= count
    });
    all
}

#[test]
fn a_message_comes_out_as_a_sample_in_mm_and_newtons() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_m, -y_cm, z_mm, force_n");
    let args = vec![OscType::Double(0.25), OscType::Float(2.0), OscType::Int(-3), OscType::Long(4)];
    send(&socket, &message("/pen", args));
    let sample = take(&mut from, 1)[0];
    assert_eq!((sample.position, sample.force, sample.stroke), ([250.0, -20.0, -3.0], 4.0, 0));
    assert_eq!(sample.time_ns, sample.arrived_ns);
    assert!(sample.time_ns <= asperity_live::now_ns());
    assert_eq!((handle.samples(), handle.bad(), handle.lost()), (1, 0, 0));
}

/// Only addresses that match the pattern move the hand.
#[test]
fn unmatched_osc_addresses_are_told_once() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen/{1,2}/*", "x_mm");
    for address in ["/pencil", "/pen/3/at", "/pen/1", "/pen/1/at/x", "/pen/2/at"] {
        send(&socket, &message(address, vec![OscType::Int(5)]));
    }
    assert_eq!(take(&mut from, 1).len(), 1);
    assert_eq!((handle.samples(), handle.bad()), (1, 0));
    assert!(handle.problem().unwrap().contains("`/pencil` came, which `/pen/{1,2}/*` does not match"));
    assert_eq!(handle.problem(), None);
}

/// A sender that counts in m where mm are listed moved the stylus by hundredths of a mm, and nobody said so.
#[test]
fn wrong_osc_units_are_told_once() {
    let _alone = beside_others();
    for (scale, force, doubt) in [
        (0.001, 1.0, "are its places in m?"),
        (1000.0, 1.0, "`x_mm` is in mm, `x_m` in m"),
        (1.0, 300.0, "a force of 300 N came"),
    ] {
        let (handle, mut from, socket) = begin("/pen", "x_mm, y_mm, z_mm, force_n");
        for k in 0..1500 {
            let turn = 0.01 * f64::from(k);
            let place = [20.0 * turn.cos(), 20.0 * turn.sin(), -2.0].map(|x| x * scale);
            send(&socket, &pen(&[place[0], place[1], place[2], force]));
            // Neither queue is to overflow.
            take(&mut from, 1);
        }
        let told: Vec<String> = std::iter::from_fn(|| handle.problem()).collect();
        assert!(told.len() == 1 && told[0].contains(doubt), "{told:?}");
    }
}

#[test]
fn each_touch_is_a_new_stroke() {
    let _alone = beside_others();
    let (_handle, mut from, socket) = begin("/pen", "x_mm, force_n, touch");
    for touch in [1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0] {
        send(&socket, &pen(&[1.0, 2.0, touch]));
    }
    let got: Vec<_> = take(&mut from, 7).iter().map(|s| (s.stroke, s.force)).collect();
    assert_eq!(got, [(1, 2.0), (1, 2.0), (1, 0.0), (1, 0.0), (2, 2.0), (2, 0.0), (3, 2.0)]);
}

#[test]
fn samples_of_a_bundle_are_as_far_apart_as_their_time_tags_say() {
    let _alone = beside_others();
    let (_handle, mut from, socket) = begin("/pen", "x_mm");
    // Four readings at 4 ms, sent in one go.
    let reading = |k: u32| bundle(3_900_000_000, k * 17_179_869, vec![pen(&[f64::from(k)])]);
    send(&socket, &reading(0));
    take(&mut from, 1);
    std::thread::sleep(Duration::from_millis(30));
    send(&socket, &bundle(0, 1, (1..5).map(reading).collect()));
    let got = take(&mut from, 4);
    assert!(got.iter().all(|s| s.arrived_ns == got[0].arrived_ns && s.time_ns <= s.arrived_ns));
    for pair in got.windows(2) {
        let apart = (pair[1].time_ns - pair[0].time_ns) as f64;
        assert!((apart - 4e6).abs() < 2e3, "{apart} ns");
    }
}

#[test]
fn garbage_is_counted_with_a_reason_and_does_no_harm() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_mm, y_mm");
    let two = |a, b| message("/pen", vec![a, b]);
    let mut expect = 0;
    for bad in
        [&b""[..], b"garbage", b"/pen", b"/pen\0\0\0\0,ff\0abc", b"#bundle\0", b"\0\0\0\0", &[0xff; 1000]]
    {
        socket.send(bad).unwrap();
        expect += 1;
        until("a bad packet", || handle.bad() == expect);
    }
    for (bad, why) in [
        (two(OscType::Float(f32::NAN), OscType::Int(0)), "NaN"),
        (two(OscType::Int(0), OscType::String("1".into())), "argument 2 is no number"),
        (message("/pen", vec![OscType::Int(1)]), "1 arguments, 2 are listed"),
    ] {
        send(&socket, &bad);
        expect += 1;
        until("a bad message", || handle.bad() == expect);
        assert!(handle.last_bad().unwrap().contains(why), "{:?}", handle.last_bad());
    }
    // An empty address was told before, as one that does not match.
    let said = std::iter::from_fn(|| handle.problem()).last().unwrap();
    assert!(said.contains("cannot be used: a message for `/pen`: it has 1 arguments"), "{said}");
    assert_eq!(handle.problem(), None);
    let mut nested = two(OscType::Int(1), OscType::Int(2));
    for _ in 0..1000 {
        nested = bundle(0, 1, vec![nested]);
    }
    send(&socket, &nested);
    until("the nested bundle", || handle.bad() == expect + 1);
    assert!(handle.last_bad().unwrap().contains("nested"));
    send(&socket, &two(OscType::Int(7), OscType::Int(8)));
    assert_eq!(take(&mut from, 1)[0].position, [7.0, 8.0, 0.0]);
}

#[test]
fn unread_bundle_of_thousands_only_fills_the_queue() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_mm");
    let bundle = bundle(0, 1, vec![pen(&[1.0]); 2500]);
    for k in 1..=3 {
        send(&socket, &bundle);
        until("the bundle", || handle.samples() + handle.lost() == 2500 * k);
    }
    assert_eq!((handle.samples(), handle.lost()), (4096, 7500 - 4096));
    assert_eq!(take(&mut from, 4096).len(), 4096);
    send(&socket, &pen(&[2.0]));
    assert_eq!(take(&mut from, 1)[0].position[0], 2.0);
}

#[test]
fn a_sender_that_dies_and_comes_back_goes_on_in_another_stroke() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_mm, time_s");
    send(&socket, &pen(&[1.0, 1000.0]));
    send(&socket, &pen(&[2.0, 1000.01]));
    let old = take(&mut from, 2);
    drop(socket);
    std::thread::sleep(Duration::from_millis(80));
    let again = sender(&handle);
    // Its clock began at 0 again.
    send(&again, &pen(&[50.0, 0.5]));
    send(&again, &pen(&[51.0, 0.51]));
    let new = take(&mut from, 2);
    assert_eq!((old[1].stroke, new[0].stroke, new[1].stroke), (0, 1, 1));
    assert!(new[0].time_ns > old[1].time_ns && new[1].time_ns >= new[0].time_ns);
    assert_eq!(handle.bad(), 0);
}

#[test]
fn restarted_recording_is_a_new_stroke_and_late_packets_drop() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_mm, time_s");
    for sample in [[1.0, 20.0], [2.0, 20.02], [3.0, 20.01], [4.0, 20.03], [5.0, 0.0], [6.0, 0.01]] {
        send(&socket, &pen(&sample));
    }
    let got: Vec<_> = take(&mut from, 5).iter().map(|s| (s.position[0], s.stroke)).collect();
    assert_eq!(got, [(1.0, 0), (2.0, 0), (4.0, 0), (5.0, 1), (6.0, 1)]);
    assert!(handle.bad() == 1 && handle.last_bad().unwrap().contains("after a later one"));
}

#[test]
fn replaced_sender_without_a_clock_begins_a_new_stroke() {
    let _alone = beside_others();
    let (handle, mut from, socket) = begin("/pen", "x_mm");
    send(&socket, &pen(&[1.0]));
    take(&mut from, 1);
    drop(socket);
    std::thread::sleep(Duration::from_millis(80));
    send(&sender(&handle), &pen(&[90.0]));
    let after = take(&mut from, 1)[0];
    assert_eq!((after.position[0], after.stroke), (90.0, 1));
}

#[test]
fn a_port_in_use_an_open_address_and_a_bad_pattern_are_told() {
    let _alone = beside_others();
    let (handle, _from, _socket) = begin("/pen", "x_mm");
    let attempt = |listen: &str, anywhere: bool, address: &str| -> Result<Handle, Diagnostic> {
        osc::start(OscOptions::parse(listen, anywhere, address, "x_mm")?, samples().0)
    };
    let port = handle.address().unwrap().to_string();
    for (listen, address, why) in [
        (&*port, "/pen", "in use"),
        ("0.0.0.0:0", "/pen", "`anywhere`"),
        (HERE, "pen", "`pen` is no OSC address"),
    ] {
        let e = attempt(listen, false, address).unwrap_err().to_string();
        assert!(e.contains(why), "{e}");
    }
    attempt("0.0.0.0:0", true, "/pen").unwrap();
    // Dropping it frees the port.
    drop(handle);
    attempt(&port, false, "/pen").unwrap();
}
