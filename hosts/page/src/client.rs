//! One page or other program with a WebSocket: figures out, commands and strokes in.

use std::sync::Arc;
use std::time::Duration;

use asperity_live::view::By;
use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use parking_lot::Mutex;
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, sleep_until, timeout};

use crate::control::{Answer, Subscriptions, obey, read};
use crate::hand::{Pen, whose};
use crate::server::Shared;
use crate::wire::{self, AHEAD, PATIENCE, Told};

/// Most messages of a page in a second, and at once. A pen of 1 kHz sends 1000 a second.
pub(crate) const MESSAGES: [f64; 2] = [4000.0, 8000.0];
/// Most commands of a client in a second, and at once. A slider sends one a frame.
pub(crate) const ASKS: [f64; 2] = [250.0, 500.0];
/// Most answers that wait for a client: all values of a graph fit in.
const ANSWERS: usize = 512;
/// Longest wait for a page to hear why it is disconnected.
const FAREWELL: Duration = Duration::from_secs(1);

/// Why a page is disconnected: WebSocket close code and reason.
type Leave = (u16, &'static str);

const SLOW: Leave = (close_code::POLICY, "too slow: views were not acknowledged");
const GONE: Leave = (close_code::NORMAL, "");

/// Serves a client until it leaves, breaks a rule, or the server stops. `watches`: it is a page, and is sent
/// layouts and views.
pub(crate) async fn attend(socket: WebSocket, watches: bool, shared: Arc<Shared>) {
    let (mut to, mut from) = socket.split();
    let (tell_got, got) = watch::channel(0);
    let (answers, mut waiting) = mpsc::channel(ANSWERS);
    let mut stop = shared.stop.subscribe();
    let client = shared.next_number();
    let name = format!("{} {client}", if watches { "page" } else { "program" });
    let late = answers.clone();
    shared.enter(client, Box::new(move |answer| drop(late.try_send(answer))));
    let by = By { name, client };
    let subscriptions = Mutex::default();
    let show = Show {
        to: &mut to,
        page: client,
        watches,
        shared: &shared,
        subscriptions: &subscriptions,
        got,
        sent: 0,
        since: Instant::now(),
        layouts: 0,
        seen: 0,
    };
    let (code, reason) = tokio::select! {
        leave = listen(&mut from, &by, &shared, &subscriptions, tell_got, answers) => leave,
        leave = show.run(&mut waiting) => leave,
        _ = stop.wait_for(|stop| *stop) => (close_code::AWAY, "the run has ended"),
    };
    shared.leave(client);
    shared.hand.free(client);
    let close = Message::Close(Some(CloseFrame { code, reason: reason.into() }));
    // A socket that closes with unread data also loses its last message: the reason.
    let farewell = async {
        if to.send(close).await.is_ok() {
            while let Some(Ok(_)) = from.next().await {}
        }
    };
    let _ = timeout(FAREWELL, farewell).await;
}

/// Reads the messages of a client.
async fn listen(
    from: &mut SplitStream<WebSocket>,
    by: &By,
    shared: &Shared,
    subscriptions: &Mutex<Subscriptions>,
    got: watch::Sender<u64>,
    answers: mpsc::Sender<Answer>,
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
                if !asks.take() {
                    return (close_code::POLICY, "too many commands");
                }
                let told = match read(&text) {
                    Ok(command) => obey(command, by, shared, subscriptions),
                    Err(wrong) => vec![wrong],
                };
                // A client that does not read its answers loses them.
                told.into_iter().for_each(|answer| drop(answers.try_send(answer)));
            }
            Message::Binary(bytes) => match wire::told(&bytes) {
                None => return (close_code::INVALID, "not a valid binary message"),
                Some(Told::Got(count)) => {
                    got.send_if_modified(|got| std::mem::replace(got, count.max(*got)) < count);
                }
                Some(Told::Hand(sent, strokes)) => {
                    shared.hand.moved(by.client, &mut pen, sent, &strokes);
                }
                Some(Told::Free) => shared.hand.free(by.client),
            },
            Message::Ping(_) | Message::Pong(_) => {}
            Message::Close(_) => return GONE,
        }
    }
    GONE
}

/// Shows the run to a client.
struct Show<'a> {
    to: &'a mut SplitSink<WebSocket, Message>,
    page: u64,
    watches: bool,
    shared: &'a Shared,
    subscriptions: &'a Mutex<Subscriptions>,
    /// Views that the page has acknowledged, and that it was sent.
    got: watch::Receiver<u64>,
    sent: u64,
    /// Start of the wait for an acknowledgement.
    since: Instant,
    layouts: u64,
    seen: u64,
}

impl Show<'_> {
    async fn run(mut self, waiting: &mut mpsc::Receiver<Answer>) -> Leave {
        let mut news = self.shared.feed.news();
        let mut holder = self.shared.hand.holder();
        holder.mark_changed();
        loop {
            news.mark_unchanged();
            // The answer to a subscription comes before its first message.
            while let Ok(answer) = waiting.try_recv() {
                if let Err(leave) = self.send(Message::Text(answer.json().into())).await {
                    return leave;
                }
            }
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
                Ok(has) = changed, if self.watches => Some(whose(has, self.page).to_owned()),
                Some(answer) = waiting.recv() => Some(answer.json()),
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
        let (figures, now) = (self.shared.feed.figures(), std::time::Instant::now());
        let due = self.subscriptions.lock().due(now, &figures, &self.shared.run_control);
        for answer in due {
            self.send(Message::Text(answer.json().into())).await?;
        }
        if !self.watches {
            return Ok(());
        }
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
