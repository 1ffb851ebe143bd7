//! A page's server without a browser: its sockets, and requests to it.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use harness::live::PATIENCE;
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
pub(crate) fn head(view: &[u8]) -> serde_json::Value {
    let end = 4 + u32::from_le_bytes(view[..4].try_into().expect("four bytes")) as usize;
    serde_json::from_slice(&view[4..end]).expect("JSON")
}
