//! One page: figures out, requests and strokes in.

use std::sync::Arc;
use std::time::Duration;

use asperity_live::view::{Layout, Request};
use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, sleep_until, timeout};

use crate::hand::{Pen, whose};
use crate::server::Shared;
use crate::wire::{self, AHEAD, Ask, PATIENCE, Told};

/// Most messages of a page in a second, and at once. A pen of 1 kHz sends 1000 a second.
pub(crate) const MESSAGES: [f64; 2] = [4000.0, 8000.0];
/// Most requests of a page in a second, and at once. A slider sends one a frame.
const ASKS: [f64; 2] = [250.0, 500.0];
/// Most answers that wait for a page.
const ANSWERS: usize = 16;
/// Longest wait for a page to hear why it is disconnected.
const FAREWELL: Duration = Duration::from_secs(1);

/// Why a page is disconnected: WebSocket close code and reason.
type Leave = (u16, &'static str);

const SLOW: Leave = (close_code::POLICY, "too slow: views were not acknowledged");
const GONE: Leave = (close_code::NORMAL, "");

/// Serves a page until it leaves, breaks a rule, or the server stops.
pub(crate) async fn attend(socket: WebSocket, page: u64, shared: Arc<Shared>) {
    let (mut to, mut from) = socket.split();
    let (tell_got, got) = watch::channel(0);
    let (answers, mut waiting) = mpsc::channel(ANSWERS);
    let mut stop = shared.stop.subscribe();
    let since = Instant::now();
    let show = Show { to: &mut to, page, shared: &shared, got, sent: 0, since, layouts: 0, seen: 0 };
    let (code, reason) = tokio::select! {
        leave = listen(&mut from, page, &shared, tell_got, answers) => leave,
        leave = show.run(&mut waiting) => leave,
        _ = stop.wait_for(|stop| *stop) => (close_code::AWAY, "the run has ended"),
    };
    shared.hand.free(page);
    let close = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
    // A socket that closes with unread data also loses its last message: the reason.
    let farewell = async {
        if to.send(close).await.is_ok() {
            while let Some(Ok(_)) = from.next().await {}
        }
    };
    let _ = timeout(FAREWELL, farewell).await;
}

/// Reads the messages of a page.
async fn listen(
    from: &mut SplitStream<WebSocket>,
    page: u64,
    shared: &Shared,
    got: watch::Sender<u64>,
    answers: mpsc::Sender<String>,
) -> Leave {
    let (mut messages, mut asks) = (Bucket::new(MESSAGES), Bucket::new(ASKS));
    let mut pen = Pen::default();
    while let Some(message) = from.next().await {
        // Too long, or not a WebSocket message.
        let Ok(message) = message else { return (close_code::PROTOCOL, "not a valid message") };
        if !messages.take() {
            return (close_code::POLICY, "too many messages");
        }
        match message {
            Message::Text(text) => {
                let Ok(ask) = serde_json::from_str(&text) else {
                    return (close_code::INVALID, "unknown request");
                };
                if !asks.take() {
                    return (close_code::POLICY, "too many requests");
                }
                let answer = match ask {
                    Ask::Echo(ms) => Some(serde_json::json!({ "echo": ms })),
                    ask => pass(ask, shared).err().map(|why| serde_json::json!({ "refused": why })),
                };
                if let Some(answer) = answer {
                    // A page that does not read its answers loses them.
                    let _ = answers.try_send(answer.to_string());
                }
            }
            Message::Binary(bytes) => match wire::told(&bytes) {
                None => return (close_code::INVALID, "not a valid binary message"),
                Some(Told::Got(count)) => {
                    got.send_if_modified(|got| std::mem::replace(got, count.max(*got)) < count);
                }
                Some(Told::Hand(sent, strokes)) => {
                    shared.hand.moved(page, &mut pen, sent, &strokes);
                }
                Some(Told::Free) => shared.hand.free(page),
            },
            Message::Ping(_) | Message::Pong(_) => {}
            Message::Close(_) => return GONE,
        }
    }
    GONE
}

/// Carries a request out, or passes it on if it fits the graph. An error is shown on the page.
fn pass(ask: Ask, shared: &Shared) -> Result<(), String> {
    let request = match ask {
        Ask::Mute(mute) => {
            shared.run_control.mute(mute);
            return Ok(());
        }
        Ask::Strength(strength) => {
            shared.run_control.set_strength(strength);
            return Ok(());
        }
        Ask::Echo(_) => return Ok(()),
        Ask::Stop => {
            shared.run_control.stop();
            return Ok(());
        }
        Ask::Set { node, param, value } => set(node, param, value, &shared.feed.layout())?,
        Ask::Material { node, name } => material(node, name, &shared.feed.layout())?,
    };
    shared.run_control.ask(request).map_err(|unheard| unheard.to_string())
}

fn set(node: String, param: String, value: f64, layout: &Layout) -> Result<Request, String> {
    let live = layout.nodes.iter().find(|x| x.id == node).map_or(&[][..], |x| &x.live);
    let Some(live) = live.iter().find(|x| x.name == param) else {
        return Err(format!("{node} has no parameter {param} that can change while it runs."));
    };
    let fits = (live.least..=live.most).contains(&value) && !(live.whole && value.fract() != 0.0);
    if !fits {
        return Err(format!("{param} of {node} takes {} to {} {}.", live.least, live.most, live.unit));
    }
    Ok(Request::Set { node, param, value })
}

fn material(node: String, name: String, layout: &Layout) -> Result<Request, String> {
    let known = layout.materials.iter().any(|x| x.node == node && x.names.contains(&name));
    if !known {
        return Err(format!("{node} has no material {name}."));
    }
    Ok(Request::Material { node, name })
}

/// Shows the run to a page.
struct Show<'a> {
    to: &'a mut SplitSink<WebSocket, Message>,
    page: u64,
    shared: &'a Shared,
    /// Views that the page has acknowledged, and that it was sent.
    got: watch::Receiver<u64>,
    sent: u64,
    /// Start of the wait for an acknowledgement.
    since: Instant,
    layouts: u64,
    seen: u64,
}

impl Show<'_> {
    async fn run(mut self, waiting: &mut mpsc::Receiver<String>) -> Leave {
        let mut news = self.shared.feed.news();
        let mut holder = self.shared.hand.holder();
        holder.mark_changed();
        loop {
            news.mark_unchanged();
            if let Err(leave) = self.catch_up().await {
                return leave;
            }
            let owes = self.sent > *self.got.borrow();
            let changed = async { holder.changed().await.map(|()| *holder.borrow_and_update()) };
            let text = tokio::select! {
                // In this order: an acknowledgement that came during a send counts before the wait is over.
                biased;
                _ = news.changed() => None,
                got = self.got.changed() => {
                    self.since = Instant::now();
                    if got.is_err() { return GONE }
                    if *self.got.borrow_and_update() > self.sent {
                        return (close_code::INVALID, "acknowledged more views than were sent");
                    }
                    None
                }
                Ok(has) = changed => Some(whose(has, self.page).to_owned()),
                Some(answer) = waiting.recv() => Some(answer),
                () = sleep_until(self.since + PATIENCE), if owes => return SLOW,
            };
            if let Some(text) = text
                && let Err(leave) = self.send(Message::Text(text.into())).await
            {
                return leave;
            }
        }
    }

    /// Sends new values, as far as the page keeps up.
    async fn catch_up(&mut self) -> Result<(), Leave> {
        let news = self.shared.feed.after(self.layouts, self.seen);
        if let Some((layout, count)) = news.layout {
            self.layouts = count;
            let text = wire::layout(&layout, self.shared.hand.is_there(), self.shared.hand.maps());
            self.send(Message::Text(text.into())).await?;
        }
        let owed = self.sent.saturating_sub(*self.got.borrow());
        let room = usize::try_from(AHEAD.saturating_sub(owed)).unwrap_or(0);
        if room == 0 || news.views.is_empty() {
            return Ok(());
        }
        let views = &news.views[news.views.len().saturating_sub(room)..];
        self.seen = news.newest;
        for view in views {
            if self.sent == *self.got.borrow() {
                self.since = Instant::now();
            }
            self.sent += 1;
            self.send(Message::Binary(view.clone())).await?;
        }
        Ok(())
    }

    async fn send(&mut self, message: Message) -> Result<(), Leave> {
        match timeout(PATIENCE, self.to.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(GONE),
            Err(_) => Err(SLOW),
        }
    }
}

/// A rate limit: so many a second, and so many at once.
pub(crate) struct Bucket {
    a_second: f64,
    most: f64,
    left: f64,
    at: Instant,
}

impl Bucket {
    pub(crate) fn new([a_second, most]: [f64; 2]) -> Self {
        Self { a_second, most, left: most, at: Instant::now() }
    }

    pub(crate) fn take(&mut self) -> bool {
        let now = Instant::now();
        self.left = (self.left + self.a_second * (now - self.at).as_secs_f64()).min(self.most);
        self.at = now;
        let there = self.left >= 1.0;
        self.left -= f64::from(u8::from(there));
        there
    }
}
