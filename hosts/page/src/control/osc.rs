//! The protocol over OSC (UDP): addresses `/asperity/NAME` with the arguments of the table.
//!
//! UDP has no connections. An address becomes a client by `/asperity/hello` with the token. Anything else
//! from an address that is no client is ignored, and nothing is sent to it. A client that is silent for
//! [`SILENCE`] is one no more: to listen for long, send an `echo` now and then.

use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use asperity_hand::osc::walk;
use asperity_live::view::By;
use parking_lot::Mutex;
use rosc::{OscMessage, OscPacket, OscType, encoder};
use tokio::net::UdpSocket;
use tokio::sync::mpsc;

use super::{Answer, Command, Subscriptions, Value, obey};
use crate::client::{ASKS, Bucket};
use crate::door::same;
use crate::server::Shared;
use crate::wire::MESSAGE;

/// Most clients at a time.
pub const CLIENTS: usize = 16;
/// Time without a message after which a client is forgotten.
pub const SILENCE: Duration = Duration::from_secs(60);
/// Beginning of all addresses.
const PREFIX: &str = "/asperity/";
/// Most answers that wait to be sent.
const WAITING: usize = 256;

struct Client {
    by: By,
    /// Where answers go.
    to: SocketAddr,
    subscriptions: Mutex<Subscriptions>,
    asks: Bucket,
    /// Whether it heard that it sends too much.
    told: bool,
    heard: Instant,
}

/// An answer, and where it goes.
type Addressed = (Answer, SocketAddr);

/// All clients, by their addresses.
struct Clients {
    token: Arc<str>,
    shared: Arc<Shared>,
    all: HashMap<SocketAddr, Client>,
    /// For answers that come later.
    tell: mpsc::Sender<Addressed>,
}

/// Listens until the run ends.
pub(crate) async fn talk(socket: UdpSocket, token: Arc<str>, shared: Arc<Shared>) {
    let (tell, mut late) = mpsc::channel(WAITING);
    let (mut stop, mut news) = (shared.stop.subscribe(), shared.feed.news());
    let mut clients = Clients { token, shared: Arc::clone(&shared), all: HashMap::new(), tell };
    // One byte more than a message may have, to know a longer one.
    let mut buffer = vec![0; MESSAGE + 1];
    loop {
        let failed = tokio::select! {
            _ = stop.wait_for(|stop| *stop) => break,
            received = socket.recv_from(&mut buffer) => {
                if let Ok((length, from)) = received {
                    let answers = clients.take(&buffer[..length], from);
                    answers.into_iter().for_each(|(answer, to)| send(&socket, &answer, to));
                }
                received.is_err()
            }
            Some((answer, to)) = late.recv() => {
                send(&socket, &answer, to);
                false
            }
            _ = news.changed() => {
                news.mark_unchanged();
                let (now, figures) = (Instant::now(), shared.feed.figures());
                for (_, gone) in clients.all.extract_if(|_, client| now - client.heard > SILENCE) {
                    shared.leave(gone.by.client);
                }
                for client in clients.all.values() {
                    let due = client.subscriptions.lock().due(now, &figures, &shared.run_control);
                    due.iter().for_each(|answer| send(&socket, answer, client.to));
                }
                false
            }
        };
        if failed {
            // An answer came to a port that nobody has, or the network is down.
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    for client in clients.all.values() {
        send(&socket, &Answer::ended(), client.to);
        shared.leave(client.by.client);
    }
}

impl Clients {
    /// Obeys the messages of a packet. Answers, each with its address.
    fn take(&mut self, packet: &[u8], from: SocketAddr) -> Vec<Addressed> {
        let mut answers = Vec::new();
        let whole = match packet.len() {
            ..=MESSAGE => walk(packet, &mut |message, _| {
                answers.extend(self.hear(message, from));
            }),
            _ => Err(format!("a packet has more than {MESSAGE} bytes")),
        };
        if let (Err(why), Some(client)) = (whole, self.all.get(&from)) {
            answers.push((Answer::error("", &why, "send OSC 1.0 messages"), client.to));
        }
        answers
    }

    /// Obeys a message. Answers, each with its address.
    fn hear(&mut self, message: OscMessage, from: SocketAddr) -> Vec<Addressed> {
        let Self { token, shared, all: clients, tell } = self;
        let command = command(&message);
        if let Ok(Command::Hello { token: shown, port }) = &command
            && same(shown, token)
        {
            let to = SocketAddr::new(from.ip(), port.unwrap_or(from.port()));
            if !clients.contains_key(&from) && clients.len() >= CLIENTS {
                let what = format!("{CLIENTS} programs control this run already");
                return vec![(Answer::error("hello", &what, "end one, or wait a minute"), to)];
            }
            let client = clients.entry(from).or_insert_with(|| client(from, to, shared));
            client.to = to;
            let tell = tell.clone();
            // An answer too many is left out.
            shared.enter(client.by.client, Box::new(move |answer| drop(tell.try_send((answer, to)))));
        }
        let Some(client) = clients.get_mut(&from) else { return Vec::new() };
        client.heard = Instant::now();
        if !client.asks.take() {
            let what = format!("more than {} messages a second", ASKS[0]);
            let answer = Answer::error("", &what, "those beyond are left out");
            return if std::mem::replace(&mut client.told, true) {
                vec![]
            } else {
                vec![(answer, client.to)]
            };
        }
        client.told = false;
        let answers = match command {
            Ok(Command::Hello { token: shown, .. }) if !same(&shown, token) => {
                vec![Answer::error("hello", "this is not the token", "the program prints it at its start")]
            }
            Ok(command) => obey(command, &client.by, shared, &client.subscriptions),
            Err(wrong) => vec![wrong],
        };
        answers.into_iter().map(|answer| (answer, client.to)).collect()
    }
}

fn client(from: SocketAddr, to: SocketAddr, shared: &Shared) -> Client {
    Client {
        by: By { name: format!("OSC {from}"), client: shared.next_number() },
        to,
        subscriptions: Mutex::default(),
        asks: Bucket::new(ASKS),
        told: false,
        heard: Instant::now(),
    }
}

fn command(message: &OscMessage) -> Result<Command, Answer> {
    let Some(name) = message.addr.strip_prefix(PREFIX) else {
        let what = format!("`{}` is no address of this program", message.addr);
        return Err(Answer::error("", &what, "addresses begin with /asperity/"));
    };
    let value = |argument: &OscType| {
        Some(match argument {
            OscType::Int(x) => Value::Whole((*x).into()),
            OscType::Long(x) => Value::Whole(*x),
            OscType::Float(x) => Value::single(*x),
            OscType::Double(x) => Value::Number(*x),
            OscType::String(text) => Value::Text(text.clone()),
            OscType::Bool(on) => Value::Flag(*on),
            _ => return None,
        })
    };
    let Some(mut values) = message.args.iter().map(value).collect::<Option<Vec<_>>>() else {
        return Err(Answer::error(name, "an argument is of another type", "send s, f, d, i, h, T or F"));
    };
    // Many senders have no flags: 0 and 1 stand for them.
    if let ("mute", [value]) = (name, &mut values[..])
        && let Some(number @ (0.0 | 1.0)) = value.number()
    {
        *value = Value::Flag(number == 1.0);
    }
    Command::read(name, &values)
}

/// A message as a packet.
fn packet(answer: &Answer) -> Vec<u8> {
    let argument = |value: &Value| match value {
        Value::Flag(on) => OscType::Bool(*on),
        Value::Whole(x) => OscType::Int(i32::try_from(*x).unwrap_or(i32::MAX)),
        Value::Number(x) => OscType::Float(*x as f32),
        Value::Text(text) => OscType::String(text.clone()),
    };
    let args = answer.values.iter().map(argument).collect();
    let message = OscMessage { addr: format!("{PREFIX}{}", answer.name), args };
    encoder::encode(&OscPacket::Message(message)).unwrap_or_default()
}

/// Sends a message, unless the system has no room for it.
fn send(socket: &UdpSocket, answer: &Answer, to: SocketAddr) {
    let _ = socket.try_send_to(&packet(answer), to);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn osc(name: &str, args: Vec<OscType>) -> Result<Command, Answer> {
        command(&OscMessage { addr: format!("/asperity/{name}"), args })
    }

    #[test]
    fn osc_arguments_are_those_of_json() {
        let text = |text: &str| OscType::String(text.into());
        let set = |value| Ok(Command::Set { parameter: "a.b".into(), value });
        assert_eq!(osc("set", vec![text("a.b"), OscType::Float(0.1)]), set(Value::Number(0.1)));
        assert_eq!(osc("set", vec![text("a.b"), OscType::Double(0.1)]), set(Value::Number(0.1)));
        assert_eq!(osc("set", vec![text("a.b"), OscType::Int(-3)]), set(Value::Whole(-3)));
        assert_eq!(osc("set", vec![text("a.b"), text("oak")]), set(Value::Text("oak".into())));
        assert_eq!(osc("set", vec![text("a.b"), OscType::Bool(true)]), set(Value::Flag(true)));
        for on in [OscType::Bool(true), OscType::Int(1), OscType::Float(1.0)] {
            assert_eq!(osc("mute", vec![on]), Ok(Command::Mute(true)));
        }
        assert_eq!(osc("stop", vec![]), Ok(Command::Stop));
    }

    #[test]
    fn osc_message_that_is_no_command_is_answered_by_an_error() {
        let told = |result: Result<Command, Answer>| result.expect_err("no command").values[1].to_string();
        assert!(told(osc("mut", vec![OscType::Bool(true)])).contains("no command `mut`"));
        assert!(told(osc("mute", vec![OscType::Int(2)])).contains("`on` is no flag"));
        assert!(told(osc("gain", vec![OscType::Float(f32::NAN)])).contains("is no number"));
        assert!(told(osc("gain", vec![OscType::Nil])).contains("another type"));
        let other = command(&OscMessage { addr: "/stylus".into(), args: vec![] });
        assert!(told(other).contains("no address of this program"));
    }

    #[test]
    fn answer_is_packed_as_osc() {
        let bytes = packet(&Answer::done("mute true", 1.5));
        let mut seen = Vec::new();
        walk(&bytes, &mut |message, _| seen.push((message.addr, message.args))).expect("OSC");
        let args = vec![OscType::String("mute true".into()), OscType::Float(1.5)];
        assert_eq!(seen, [("/asperity/done".to_owned(), args)]);
    }
}
