//! A server on a thread of its own, bound to the loopback address unless the user names another.

use std::future::Future;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::pin::Pin;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use axum::http::{StatusCode, header};
use axum::routing::get;
use axum::{Router, middleware};
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::door::{self, Door, Visitor};

/// Longest time for a request to arrive, and to be answered.
const REQUEST: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(10)];
/// Most bytes of a request with its headers.
const HEADERS: usize = 16 * 1024;
/// Longest wait for pages to hear of the end, and for answers to go out.
const FAREWELL: Duration = Duration::from_millis(500);

/// Options of a server.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The port; 0 for any free one.
    pub port: u16,
    /// The address to bind; `0.0.0.0` or `::` for every one of this machine. `None` for 127.0.0.1.
    pub bind: Option<IpAddr>,
    /// Secret in the address: letters, digits, `-` and `_`. `None` makes a random one of 128 bits.
    pub token: Option<String>,
    /// Who is served.
    pub serves: Serves,
}

/// Who is served by a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Serves {
    /// Browsers.
    #[default]
    Page,
    /// Other programs, by WebSocket and by OSC: at the UDP port of the same number, or at a free one.
    Control,
    /// Both.
    Both,
}

/// Listens at a UDP port beside the server, for senders who know the token.
pub(crate) type Beside =
    Box<dyn FnOnce(tokio::net::UdpSocket, Arc<str>) -> Pin<Box<dyn Future<Output = ()> + Send>> + Send>;

/// A file of a page: path, content type, text.
pub(crate) type File = (&'static str, &'static str, &'static str);

pub(crate) const HTML: &str = "text/html; charset=utf-8";
pub(crate) const STYLE: &str = "text/css; charset=utf-8";
pub(crate) const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Files of several pages.
pub(crate) const ICON: File = ("/icon.svg", "image/svg+xml", include_str!("../static/icon.svg"));
pub(crate) const COLOURS: File = ("/colours.css", STYLE, include_str!("../static/colours.css"));
pub(crate) const AWAKE: File = ("/awake.js", SCRIPT, include_str!("../static/awake.js"));
pub(crate) const LINK: File = ("/link.js", SCRIPT, include_str!("../static/link.js"));
pub(crate) const POINTER: File = ("/pointer.js", SCRIPT, include_str!("../static/pointer.js"));
pub(crate) const DRAW: File = ("/draw.js", SCRIPT, include_str!("../static/draw.js"));

/// A running server. A drop stops it.
pub(crate) struct Site {
    urls: Vec<String>,
    token: Arc<str>,
    udp: Option<SocketAddr>,
    stop: watch::Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Site {
    /// Serves the router and the files to programs that know the token. The end waits for a moment until
    /// nobody is subscribed to `stop` any more.
    ///
    /// # Errors
    ///
    /// The port is taken. The address is not of this machine. The token has characters that an address may
    /// not hold. The system gives no random numbers, or no thread.
    pub(crate) fn open(
        options: Options,
        router: Router,
        files: &[File],
        stop: watch::Sender<bool>,
        beside: Option<Beside>,
    ) -> io::Result<Self> {
        let token = options.token.map_or_else(random, Ok)?;
        if token.is_empty() || !token.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_".contains(&b)) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "a token may hold letters, digits, - and _ only",
            ));
        }
        let bind = options.bind.unwrap_or(Ipv4Addr::LOCALHOST.into());
        let listener = std::net::TcpListener::bind((bind, options.port))?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let udp = beside.map(|beside| Ok::<_, io::Error>((udp(bind, port)?, beside))).transpose()?;
        let udp_at = udp.as_ref().map(|(socket, _)| socket.local_addr()).transpose()?;
        let token: Arc<str> = token.into();
        let url = |at: IpAddr| format!("http://{}/?token={token}", SocketAddr::new(at, port));
        let urls = reached_at(bind).into_iter().map(url).collect();
        let router = guarded(router, files, &token);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
        let (held, shown) = (stop.clone(), token.clone());
        let thread = std::thread::Builder::new().name("asperity-page".to_owned()).spawn(move || {
            runtime.block_on(async {
                let talk = async {
                    if let Some((socket, beside)) = udp
                        && let Ok(socket) = tokio::net::UdpSocket::from_std(socket)
                    {
                        beside(socket, shown).await;
                    }
                };
                let accept = async {
                    // This fails only on a runtime without I/O.
                    if let Ok(listener) = TcpListener::from_std(listener) {
                        accept(listener, router, held).await;
                    }
                };
                tokio::join!(talk, accept);
            });
        })?;
        Ok(Self { urls, token, udp: udp_at, stop, thread: Some(thread) })
    }

    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// Where it listens beside the server.
    pub(crate) fn udp(&self) -> Option<SocketAddr> {
        self.udp
    }

    /// Every address to open, with its token. Those of other machines come first.
    pub(crate) fn urls(&self) -> &[String] {
        &self.urls
    }
}

impl Drop for Site {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A UDP port of this number, or a free one.
fn udp(bind: IpAddr, port: u16) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind((bind, port)).or_else(|_| UdpSocket::bind((bind, 0)))?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// Addresses at which a server is reached that is bound to this one: itself, or those of this machine.
fn reached_at(bind: IpAddr) -> Vec<IpAddr> {
    if !bind.is_unspecified() {
        return vec![bind];
    }
    // A browser cannot name the interface that a link-local address of IPv6 needs.
    let reached = |ip: &IpAddr| match ip {
        IpAddr::V4(_) => !ip.is_loopback(),
        IpAddr::V6(v6) => bind.is_ipv6() && !ip.is_loopback() && !v6.is_unicast_link_local(),
    };
    // Without a list of interfaces, this machine still reaches itself.
    let all = if_addrs::get_if_addrs().unwrap_or_default();
    let mut all: Vec<IpAddr> = all.iter().map(if_addrs::Interface::ip).filter(reached).collect();
    // First the address by which this machine reaches others: the one of a phone's network, most likely.
    let away = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0)).and_then(|socket| {
        // Nothing is sent; 192.0.2.1 is an address for documentation (RFC 5737).
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9))?;
        Ok(socket.local_addr()?.ip())
    });
    let away = away.ok();
    all.sort_by_key(|ip| (Some(*ip) != away, *ip));
    all.dedup();
    all.push(if bind.is_ipv6() { Ipv6Addr::LOCALHOST.into() } else { Ipv4Addr::LOCALHOST.into() });
    all
}

/// 128 random bits in hexadecimal.
fn random() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

async fn accept(listener: TcpListener, router: Router, stop: watch::Sender<bool>) {
    let door = Arc::new(Door::default());
    let mut stopped = stop.subscribe();
    loop {
        let accepted = tokio::select! {
            _ = stopped.wait_for(|stop| *stop) => break,
            accepted = listener.accept() => accepted,
        };
        match accepted {
            Ok((stream, _)) => {
                let router = router.clone();
                if let Ok(at) = stream.local_addr() {
                    let at = SocketAddr::new(at.ip().to_canonical(), at.port());
                    door.enter(at, |visitor| answer(stream, router, visitor));
                }
                // Lets a request that has arrived be read before the next connection.
                tokio::task::yield_now().await;
            }
            // Too many open files, or a connection that has gone again.
            Err(_) => tokio::time::sleep(Duration::from_millis(20)).await,
        }
    }
    drop((listener, stopped));
    let gone = async {
        stop.closed().await;
        door.left().await;
    };
    let _ = timeout(FAREWELL, gone).await;
}

/// Answers one request. A WebSocket continues by itself.
async fn answer(stream: TcpStream, router: Router, visitor: Visitor) {
    let _ = stream.set_nodelay(true);
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(REQUEST[0]).max_buf_size(HEADERS);
    let (router, visitor) = (TowerToHyperService::new(router), Arc::new(visitor));
    let service = service_fn(|mut request: hyper::Request<hyper::body::Incoming>| {
        request.extensions_mut().insert(visitor.clone());
        router.call(request)
    });
    let served = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
    let _ = timeout(REQUEST[1], served).await;
}

/// Adds files to a router, and the guard to all of it. Links between files get the token, since every request
/// needs it.
fn guarded(mut router: Router, files: &[File], token: &str) -> Router {
    for (path, kind, text) in files {
        let linked = files.iter().filter(|(path, ..)| path.len() > 1);
        let body = linked.fold((*text).to_owned(), |text, (path, ..)| {
            text.replace(&format!("\".{path}\""), &format!("\".{path}?token={token}\""))
        });
        let kind = *kind;
        router = router.route(path, get(async move || ([(header::CONTENT_TYPE, kind)], body)));
    }
    let token: Arc<str> = token.into();
    router
        .fallback(async || (StatusCode::NOT_FOUND, "no such page\n"))
        .layer(middleware::from_fn_with_state(token, door::guard))
}
