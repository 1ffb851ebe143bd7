//! The server of a run: the live page, and control by other programs.

use std::collections::HashMap;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

use asperity_live::view::{By, Change, Request};
use asperity_live::{RunControl, SampleWriter};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Query, State, WebSocketUpgrade};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use parking_lot::Mutex;
use tokio::sync::{Semaphore, watch};

use crate::control::{Answer, name_of, osc};
use crate::feed::Feed;
use crate::hand::Hand;
use crate::map::{Around, Map};
use crate::renders::{Numbered, Rendered, Renders};
use crate::site::{
    AWAKE, Beside, COLOURS, DRAW, File, HTML, ICON, LINK, Options, POINTER, SCRIPT, STYLE, Serves, Site,
};
use crate::{client, pictures, stroke, wire};

/// Most pages and other programs with a WebSocket at a time. One more gets 503.
pub const PAGES: usize = 16;
/// Most bytes that wait to be written to a page: more than the layout of any graph.
const WAITING: usize = 16 * 1024 * 1024;

pub(crate) struct Shared {
    pub(crate) feed: Arc<Feed>,
    pub(crate) run_control: RunControl,
    pub(crate) hand: Hand,
    renders: Mutex<Renders>,
    /// Number of clients that came so far: pages, and programs by WebSocket or OSC.
    came: AtomicU64,
    /// Those that are here, by number: how each gets a late answer.
    clients: Mutex<HashMap<u64, Line>>,
    pub(crate) stop: watch::Sender<bool>,
    places: Arc<Semaphore>,
}

/// Way of a late answer to a client.
pub(crate) type Line = Box<dyn Fn(Answer) + Send + Sync>;

/// A running server. A drop stops it and tells the pages that the run has ended.
pub struct Page {
    site: Site,
    shared: Arc<Shared>,
}

/// Serves pages and other programs on a thread of its own, until the [`Page`] is dropped.
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
    let shared = Arc::new(Shared {
        feed,
        run_control,
        hand: Hand::new(pointer),
        renders: Mutex::default(),
        came: AtomicU64::new(0),
        clients: Mutex::default(),
        stop: watch::Sender::new(false),
        places: Arc::new(Semaphore::new(PAGES)),
    });
    let files = if options.serves == Serves::Control { &[] } else { FILES };
    let talks = shared.clone();
    let by_osc: Beside = Box::new(move |socket, token| Box::pin(osc::talk(socket, token, talks)));
    let beside = (options.serves != Serves::Page).then_some(by_osc);
    let site = Site::open(options, router(&shared), files, shared.stop.clone(), beside)?;
    Ok(Page { site, shared })
}

impl Page {
    /// The first address to open, with its token.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.urls()[0]
    }

    /// Every address to open, with its token. Those of other machines come first.
    #[must_use]
    pub fn urls(&self) -> &[String] {
        self.site.urls()
    }

    /// The token in the addresses.
    #[must_use]
    pub fn token(&self) -> &str {
        self.site.token()
    }

    /// Where the server listens for OSC, if it does.
    #[must_use]
    pub fn osc(&self) -> Option<SocketAddr> {
        self.site.udp()
    }

    /// Tells a client that the change for which it asked was carried out.
    pub fn done(&self, by: &By, change: &Change) {
        self.shared.answer(by, Answer::done(&change.what, change.at_s));
    }

    /// Tells a client that its request was refused, with the reason and help.
    pub fn refused(&self, by: &By, request: &Request, message: &str, help: &str) {
        self.shared.answer(by, Answer::error(name_of(request), message, help));
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

impl std::fmt::Debug for Page {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Page").field("pages", &self.shared.watching()).finish_non_exhaustive()
    }
}

impl Shared {
    fn watching(&self) -> usize {
        PAGES - self.places.available_permits()
    }

    /// The number of a client that has just come.
    pub(crate) fn next_number(&self) -> u64 {
        1 + self.came.fetch_add(1, Relaxed)
    }

    /// A client can be answered from now on.
    pub(crate) fn enter(&self, number: u64, line: Line) {
        self.clients.lock().insert(number, line);
    }

    pub(crate) fn leave(&self, number: u64) {
        self.clients.lock().remove(&number);
    }

    fn answer(&self, by: &By, answer: Answer) {
        if let Some(line) = self.clients.lock().get(&by.client) {
            line(answer);
        }
    }
}

type Of = State<Arc<Shared>>;

fn router(shared: &Arc<Shared>) -> Router {
    Router::new()
        .route("/ws", get(async |state: Of, socket: WebSocketUpgrade| attend(state, socket, true).await))
        .route(
            "/control",
            get(async |state: Of, socket: WebSocketUpgrade| attend(state, socket, false).await),
        )
        .route("/places", get(places))
        .route("/map", get(map))
        .route("/stroke.csv", post(stroke_csv))
        .route("/render", get(render_state).post(render))
        .route("/render.wav", get(render_wav))
        .route("/materials", get(pictures::materials))
        .route("/picture/{node}/{name}", get(pictures::picture))
        .layer(DefaultBodyLimit::max(stroke::BYTES))
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

/// Lets a program talk. `watches`: it is a page, and is sent views.
async fn attend(State(shared): Of, socket: WebSocketUpgrade, watches: bool) -> Response {
    let Ok(place) = shared.places.clone().try_acquire_owned() else {
        let why = format!("{PAGES} pages show this run already; close one\n");
        return (StatusCode::SERVICE_UNAVAILABLE, why).into_response();
    };
    socket
        .max_message_size(wire::MESSAGE)
        .max_frame_size(wire::MESSAGE)
        .write_buffer_size(0)
        .max_write_buffer_size(WAITING)
        .on_upgrade(async move |socket| {
            client::attend(socket, watches, shared).await;
            drop(place);
        })
}

/// The files of the page: path, content type, text.
const FILES: &[File] = &[
    ("/", HTML, include_str!("../static/index.html")),
    ("/page.css", STYLE, include_str!("../static/page.css")),
    ("/scene.css", STYLE, include_str!("../static/scene.css")),
    ICON,
    COLOURS,
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
    LINK,
    POINTER,
    ("/hand.js", SCRIPT, include_str!("../static/hand.js")),
    AWAKE,
    ("/map.js", SCRIPT, include_str!("../static/map.js")),
    ("/strokes.js", SCRIPT, include_str!("../static/strokes.js")),
    ("/graph.js", SCRIPT, include_str!("../static/graph.js")),
    ("/layers.js", SCRIPT, include_str!("../static/layers.js")),
    ("/scope.js", SCRIPT, include_str!("../static/scope.js")),
    ("/spectrum.js", SCRIPT, include_str!("../static/spectrum.js")),
    ("/timing.js", SCRIPT, include_str!("../static/timing.js")),
    ("/health.js", SCRIPT, include_str!("../static/health.js")),
    ("/controls.js", SCRIPT, include_str!("../static/controls.js")),
    DRAW,
];
