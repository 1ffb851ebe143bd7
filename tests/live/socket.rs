//! A page's WebSocket without a browser.

use std::net::TcpStream;

use harness::live::PATIENCE;
use tungstenite::WebSocket;
use tungstenite::client::IntoClientRequest as _;

/// A page's socket, or the status it was refused with.
pub(crate) fn connect(url: &str, origin: Option<&str>) -> Result<WebSocket<TcpStream>, u16> {
    let address = url.replace("http://", "ws://").replace("/?", "/ws?");
    let mut request = address.into_client_request().expect("a request");
    if let Some(origin) = origin {
        request.headers_mut().insert("Origin", origin.parse().expect("a header"));
    }
    let (host, _) = url["http://".len()..].split_once('/').expect("an address");
    let stream = TcpStream::connect(host).expect("it listens");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
            Err(answer.status().as_u16())
        }
        Err(e) => panic!("{e}"),
    }
}
