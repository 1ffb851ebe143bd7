//! The server: a thread of its own, bound to the loopback address unless the user names another.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;
use std::time::Duration;

use asperity_live::{RunControl, SampleWriter};
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, State, WebSocketUpgrade};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Router, middleware};
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use parking_lot::Mutex;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::time::timeout;

use crate::door::{Door, Visitor};
use crate::feed::Feed;
use crate::hand::Hand;
use crate::map::{Around, Map};
use crate::renders::{Numbered, Rendered, Renders};
use crate::{client, door, pictures, stroke, wire};

/// Most pages at a time. One more gets 503.
pub const PAGES: usize = 16;
/// Most connections with the token at a time, beside those of the pages. One more gets 503.
///
/// As many may be open without the token. One more closes the oldest of these.
pub const CONNECTIONS: usize = 64;
/// Longest time for a request to arrive, and to be answered.
const REQUEST: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(10)];
/// Most bytes of a request with its headers.
const HEADERS: usize = 16 * 1024;
/// Most bytes that wait to be written to a page: more than the layout of any graph.
const WAITING: usize = 16 * 1024 * 1024;
/// Longest wait for pages to hear that the run has ended.
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
}

pub(crate) struct Shared {
    port: u16,
    pub(crate) token: String,
    pub(crate) feed: Arc<Feed>,
    pub(crate) run_control: RunControl,
    pub(crate) hand: Hand,
    renders: Mutex<Renders>,
    came: AtomicU64,
    pub(crate) stop: watch::Sender<bool>,
    places: Arc<Semaphore>,
}

/// A running server. A drop stops it and tells the pages that the run has ended.
pub struct Page {
    urls: Vec<String>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

/// Serves the page on a thread of its own, until the [`Page`] is dropped.
///
/// Pages show `feed`. Every page holds `run_control`: mute and stop act at once. Other requests are checked
/// against the layout and wait in `run_control`; when these are full, the page must try again.
///
/// `pointer` takes the samples of the hand: x to the right and y away from the person, in mm from the
/// middle of the surface, pressure from 0 to 1 as force. z is the height of the scene there, else 0. It is
/// `None` while the graph has no pointer.
///
/// # Errors
///
/// The port is taken. The address is not of this machine. The token has characters that an address may not
/// hold. The system gives no random numbers, or no thread.
pub fn serve(
    options: Options,
    feed: Arc<Feed>,
    run_control: RunControl,
    pointer: Option<SampleWriter>,
) -> io::Result<Page> {
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
    let url = |at: IpAddr| format!("http://{}/?token={token}", SocketAddr::new(at, port));
    let urls = reached_at(bind).into_iter().map(url).collect();
    let shared = Arc::new(Shared {
        port,
        token,
        feed,
        run_control,
        hand: Hand::new(pointer),
        renders: Mutex::default(),
        came: AtomicU64::new(0),
        stop: watch::Sender::new(false),
        places: Arc::new(Semaphore::new(PAGES)),
    });
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let ours = shared.clone();
    let thread = std::thread::Builder::new().name("asperity-page".to_owned()).spawn(move || {
        runtime.block_on(async {
            // This fails only on a runtime without I/O.
            if let Ok(listener) = TcpListener::from_std(listener) {
                accept(listener, ours).await;
            }
        });
    })?;
    Ok(Page { urls, shared, thread: Some(thread) })
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

impl Page {
    /// The first address to open, with its token.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.urls[0]
    }

    /// Every address to open, with its token. Those of other machines come first.
    #[must_use]
    pub fn urls(&self) -> &[String] {
        &self.urls
    }

    /// Shows the scene of the run, or that it has none. Pages hear of it with the next layout.
    pub fn set_scene(&self, map: Option<Arc<Map>>) {
        self.shared.hand.set_map(map);
    }

    /// The stroke that a page wants rendered, as CSV, once. [`rendered`](Self::rendered) must follow.
    pub fn wants_rendered(&self) -> Option<String> {
        self.shared.renders.lock().take()
    }

    /// Answers a page with the render of its stroke, or why there is none.
    pub fn rendered(&self, result: Result<Rendered, String>) {
        self.shared.renders.lock().finish(result);
    }

    /// Gives the hand another writer, as after a change of the graph; `None` where the graph has no pointer.
    /// A stroke continues with its number. The old writer is dropped. With the next layout, pages hear
    /// whether there is something to stroke.
    pub fn set_pointer(&self, to: Option<SampleWriter>) {
        self.shared.hand.set_writer(to);
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.shared.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl std::fmt::Debug for Page {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Page").field("port", &self.shared.port).finish_non_exhaustive()
    }
}

impl Shared {
    fn watching(&self) -> usize {
        PAGES - self.places.available_permits()
    }
}

/// 128 random bits in hexadecimal.
fn random() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

async fn accept(listener: TcpListener, shared: Arc<Shared>) {
    let router = router(&shared);
    let door = Arc::new(Door::default());
    let mut stop = shared.stop.subscribe();
    loop {
        let accepted = tokio::select! {
            _ = stop.wait_for(|stop| *stop) => break,
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
    drop(listener);
    let gone = shared.places.acquire_many(PAGES as u32);
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

fn router(shared: &Arc<Shared>) -> Router {
    let mut router = Router::new()
        .route("/ws", get(watch))
        .route("/places", get(places))
        .route("/map", get(map))
        .route("/stroke.csv", post(stroke_csv))
        .route("/render", get(render_state).post(render))
        .route("/render.wav", get(render_wav))
        .route("/materials", get(pictures::materials))
        .route("/picture/{node}/{name}", get(pictures::picture));
    for (path, kind, text) in FILES {
        let body = with_token(text, &shared.token);
        let answer = move || async move { ([(header::CONTENT_TYPE, *kind)], body) };
        router = router.route(path, get(answer));
    }
    router
        .fallback(async || (StatusCode::NOT_FOUND, "no such page\n"))
        .layer(DefaultBodyLimit::max(stroke::BYTES))
        .layer(middleware::from_fn_with_state(shared.clone(), door::guard))
        .with_state(shared.clone())
}

/// Number of pages, and the most there may be: a browser does not tell a page why its WebSocket failed.
async fn places(State(shared): State<Arc<Shared>>) -> Response {
    json(&serde_json::json!({ "pages": shared.watching(), "most": PAGES }))
}

/// The part of the scene around a place; 404 where there is no scene.
async fn map(State(shared): State<Arc<Shared>>, Query(around): Query<Around>) -> Response {
    match shared.hand.map() {
        Some(map) => json(&map.around([around.x, around.y])),
        None => (StatusCode::NOT_FOUND, "no scene\n").into_response(),
    }
}

/// A stroke as CSV, or the answer to one that is refused.
fn csv(shared: &Shared, bytes: &[u8], tilt: bool) -> Result<String, Response> {
    let Some(pointer) = shared.feed.layout().pointer else {
        return Err((StatusCode::CONFLICT, "The graph has no pointer.").into_response());
    };
    let map = shared.hand.map();
    stroke::csv(bytes, &pointer, map.as_deref(), tilt)
        .map_err(|why| (StatusCode::BAD_REQUEST, why).into_response())
}

/// Writes a stroke of a page as the CSV that `--input` reads.
async fn stroke_csv(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    match csv(&shared, &body, true) {
        Ok(csv) => ([(header::CONTENT_TYPE, "text/csv")], csv).into_response(),
        Err(refused) => refused,
    }
}

/// Begins a render of a stroke, unless one is under way.
async fn render(State(shared): State<Arc<Shared>>, body: Bytes) -> Response {
    let csv = match csv(&shared, &body, false) {
        Ok(csv) => csv,
        Err(refused) => return refused,
    };
    match shared.renders.lock().begin(csv) {
        Some(number) => json(&serde_json::json!({ "number": number })),
        None => (StatusCode::CONFLICT, "Another stroke is being rendered. Try again.").into_response(),
    }
}

async fn render_state(State(shared): State<Arc<Shared>>) -> Response {
    json(&shared.renders.lock().state())
}

/// The last render, if its number is the one that is asked for.
async fn render_wav(State(shared): State<Arc<Shared>>, Query(of): Query<Numbered>) -> Response {
    match shared.renders.lock().wav(of.number) {
        Some(wav) => ([(header::CONTENT_TYPE, "audio/wav")], wav).into_response(),
        None => (StatusCode::NOT_FOUND, "no such render\n").into_response(),
    }
}

fn json(value: &serde_json::Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

async fn watch(State(shared): State<Arc<Shared>>, socket: WebSocketUpgrade) -> Response {
    let Ok(place) = shared.places.clone().try_acquire_owned() else {
        let why = format!("{PAGES} pages show this run already; close one\n");
        return (StatusCode::SERVICE_UNAVAILABLE, why).into_response();
    };
    let page = shared.came.fetch_add(1, Relaxed);
    socket
        .max_message_size(wire::MESSAGE)
        .max_frame_size(wire::MESSAGE)
        .write_buffer_size(0)
        .max_write_buffer_size(WAITING)
        .on_upgrade(async move |socket| {
            client::attend(socket, page, shared).await;
            drop(place);
        })
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The files of the page: path, content type, text.
const FILES: &[(&str, &str, &str)] = &[
    ("/", "text/html; charset=utf-8", include_str!("../static/index.html")),
    ("/page.css", "text/css; charset=utf-8", include_str!("../static/page.css")),
    ("/scene.css", "text/css; charset=utf-8", include_str!("../static/scene.css")),
    ("/icon.svg", "image/svg+xml", include_str!("../static/icon.svg")),
    ("/main.js", SCRIPT, include_str!("../static/main.js")),
    ("/tabs.js", SCRIPT, include_str!("../static/tabs.js")),
    ("/gallery.js", SCRIPT, include_str!("../static/gallery.js")),
    ("/quilt.js", SCRIPT, include_str!("../static/quilt.js")),
    ("/setting.js", SCRIPT, include_str!("../static/setting.js")),
    ("/levels.js", SCRIPT, include_str!("../static/levels.js")),
    ("/listen.js", SCRIPT, include_str!("../static/listen.js")),
    ("/record.js", SCRIPT, include_str!("../static/record.js")),
    ("/wav.js", SCRIPT, include_str!("../static/wav.js")),
    ("/drive.js", SCRIPT, include_str!("../static/drive.js")),
    ("/link.js", SCRIPT, include_str!("../static/link.js")),
    ("/hand.js", SCRIPT, include_str!("../static/hand.js")),
    ("/awake.js", SCRIPT, include_str!("../static/awake.js")),
    ("/map.js", SCRIPT, include_str!("../static/map.js")),
    ("/strokes.js", SCRIPT, include_str!("../static/strokes.js")),
    ("/graph.js", SCRIPT, include_str!("../static/graph.js")),
    ("/layers.js", SCRIPT, include_str!("../static/layers.js")),
    ("/scope.js", SCRIPT, include_str!("../static/scope.js")),
    ("/spectrum.js", SCRIPT, include_str!("../static/spectrum.js")),
    ("/timing.js", SCRIPT, include_str!("../static/timing.js")),
    ("/health.js", SCRIPT, include_str!("../static/health.js")),
    ("/controls.js", SCRIPT, include_str!("../static/controls.js")),
    ("/draw.js", SCRIPT, include_str!("../static/draw.js")),
];

/// Adds the token to a file's imports and links: every request needs it.
fn with_token(text: &str, token: &str) -> String {
    let mut text = text.to_owned();
    for (path, ..) in FILES.iter().filter(|(path, ..)| path.len() > 1) {
        let link = format!("\".{path}");
        text = text.replace(&format!("{link}\""), &format!("{link}?token={token}\""));
    }
    text
}
