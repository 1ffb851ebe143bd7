//! One page: figures out, requests and strokes in.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use asperity_live::view::{Layout, Request};
use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use tokio::time::{Instant, sleep_until, timeout};

use crate::hand::Pen;
use crate::server::Shared;
use crate::wire::{self, AHEAD, Ask, PATIENCE, Told};

/// Most messages of a page in a second, and at once. A pen of 1 kHz sends 1000 a second.
const MESSAGES: [f64; 2] = [4000.0, 8000.0];
/// Most requests of a page in a second, and at once. A slider sends one a frame.
const ASKS: [f64; 2] = [250.0, 500.0];
/// Longest wait for a page to hear why it is disconnected.
const FAREWELL: Duration = Duration::from_secs(1);

/// Why a page is disconnected: WebSocket close code and reason.
type Leave = (u16, &'static str);

const SLOW: Leave = (close_code::POLICY, "too slow: views were not acknowledged");
const GONE: Leave = (close_code::NORMAL, "");

/// Serves a page until it leaves, breaks a rule, or the server stops.
pub(crate) async fn attend(socket: WebSocket, page: u64, shared: Arc<Shared>) {
    let mut stop = shared.stop.subscribe();
    let mut client = Client {
        socket,
        page,
        shared: &shared,
        pen: Pen::default(),
        messages: Bucket::new(MESSAGES),
        asks: Bucket::new(ASKS),
        got: 0,
        sent: 0,
        since: Instant::now(),
        layouts: 0,
        seen: 0,
    };
    let (code, reason) = tokio::select! {
        Err(leave) = client.run() => leave,
        _ = stop.wait_for(|stop| *stop) => (close_code::AWAY, "the run has ended"),
    };
    shared.hand.free(page);
    let close = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
    // A socket that closes with unread data also loses its last message: the reason.
    let farewell = async {
        if client.socket.send(close).await.is_ok() {
            while let Some(Ok(_)) = client.socket.recv().await {}
        }
    };
    let _ = timeout(FAREWELL, farewell).await;
}

/// Carries a request out, or passes it on if it fits the graph. An error is shown on the page.
fn pass(ask: Ask, shared: &Shared) -> Result<(), String> {
    let request = match ask {
        Ask::Mute(mute) => {
            shared.run_control.mute(mute);
            return Ok(());
        }
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

/// A page and what it was told.
struct Client<'a> {
    socket: WebSocket,
    page: u64,
    shared: &'a Shared,
    pen: Pen,
    messages: Bucket,
    asks: Bucket,
    /// Views that the page has acknowledged, and that it was sent.
    got: u64,
    sent: u64,
    /// Start of the wait for an acknowledgement.
    since: Instant,
    layouts: u64,
    seen: u64,
}

impl Client<'_> {
    async fn run(&mut self) -> Result<Infallible, Leave> {
        let mut news = self.shared.feed.news();
        let mut holder = self.shared.hand.holder();
        holder.mark_changed();
        loop {
            news.mark_unchanged();
            self.catch_up().await?;
            let owes = self.sent > self.got;
            tokio::select! {
                _ = news.changed() => {}
                message = self.socket.recv() => match message {
                    None => return Err(GONE),
                    // Too long, or not a WebSocket message.
                    Some(Err(_)) => return Err((close_code::PROTOCOL, "not a valid message")),
                    Some(Ok(message)) => self.hear(message).await?,
                },
                Ok(()) = holder.changed() => {
                    let has = *holder.borrow_and_update();
                    let whose = has.map_or("free", |page| if page == self.page { "yours" } else { "theirs" });
                    self.tell(&serde_json::json!({ "hand": whose })).await?;
                }
                () = sleep_until(self.since + PATIENCE), if owes => return Err(SLOW),
            }
        }
    }

    async fn hear(&mut self, message: Message) -> Result<(), Leave> {
        if !self.messages.take() {
            return Err((close_code::POLICY, "too many messages"));
        }
        match message {
            Message::Text(text) => {
                let ask =
                    serde_json::from_str(&text).map_err(|_| (close_code::INVALID, "unknown request"))?;
                if !self.asks.take() {
                    return Err((close_code::POLICY, "too many requests"));
                }
                if let Err(why) = pass(ask, self.shared) {
                    self.tell(&serde_json::json!({ "refused": why })).await?;
                }
            }
            Message::Binary(bytes) => match wire::told(&bytes) {
                None => return Err((close_code::INVALID, "not a valid binary message")),
                Some(Told::Got(count)) if count > self.sent => {
                    return Err((close_code::INVALID, "acknowledged more views than were sent"));
                }
                Some(Told::Got(count)) if count > self.got => {
                    (self.got, self.since) = (count, Instant::now());
                }
                Some(Told::Got(_)) => {}
                Some(Told::Hand(sent, strokes)) => {
                    self.shared.hand.moved(self.page, &mut self.pen, sent, &strokes);
                }
                Some(Told::Free) => self.shared.hand.free(self.page),
            },
            Message::Ping(_) | Message::Pong(_) => {}
            Message::Close(_) => return Err(GONE),
        }
        Ok(())
    }

    /// Sends what is new, as far as the page keeps up.
    async fn catch_up(&mut self) -> Result<(), Leave> {
        let news = self.shared.feed.after(self.layouts, self.seen);
        if let Some((layout, count)) = news.layout {
            self.layouts = count;
            let text = wire::layout(&layout, self.shared.hand.is_there());
            self.send(Message::Text(text.into())).await?;
        }
        let room = usize::try_from(AHEAD.saturating_sub(self.sent - self.got)).unwrap_or(0);
        if room == 0 || news.views.is_empty() {
            return Ok(());
        }
        self.seen = news.newest;
        for view in &news.views[news.views.len().saturating_sub(room)..] {
            if self.sent == self.got {
                self.since = Instant::now();
            }
            self.sent += 1;
            self.send(Message::Binary(view.clone())).await?;
        }
        Ok(())
    }

    async fn tell(&mut self, what: &serde_json::Value) -> Result<(), Leave> {
        self.send(Message::Text(what.to_string().into())).await
    }

    async fn send(&mut self, message: Message) -> Result<(), Leave> {
        match timeout(PATIENCE, self.socket.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(GONE),
            Err(_) => Err(SLOW),
        }
    }
}

/// A rate limit: so many a second, and so many at once.
struct Bucket {
    a_second: f64,
    most: f64,
    left: f64,
    at: Instant,
}

impl Bucket {
    fn new([a_second, most]: [f64; 2]) -> Self {
        Self { a_second, most, left: most, at: Instant::now() }
    }

    fn take(&mut self) -> bool {
        let now = Instant::now();
        self.left = (self.left + self.a_second * (now - self.at).as_secs_f64()).min(self.most);
        self.at = now;
        let there = self.left >= 1.0;
        self.left -= f64::from(u8::from(there));
        there
    }
}
