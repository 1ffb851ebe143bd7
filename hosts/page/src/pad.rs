//! The pad of a participant's screen: strokes come in, and each page hears whose hand it is.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use asperity_live::SampleWriter;
use axum::extract::ws::{Message, WebSocket};
use axum::extract::{State, WebSocketUpgrade};
use axum::response::Response;
use tokio::sync::watch;

use crate::client::{Bucket, MESSAGES};
use crate::hand::{Hand, Pen, whose};
use crate::wire::{self, Told};

pub(crate) struct Pad {
    hand: Hand,
    came: AtomicU64,
    stop: watch::Sender<bool>,
}

impl Pad {
    pub(crate) fn new(to: SampleWriter, stop: watch::Sender<bool>) -> Self {
        Self { hand: Hand::new(Some(to)), came: AtomicU64::new(0), stop }
    }
}

pub(crate) async fn stroke(State(pad): State<Arc<Pad>>, socket: WebSocketUpgrade) -> Response {
    let page = pad.came.fetch_add(1, Relaxed);
    let socket = socket.max_message_size(wire::MESSAGE).max_frame_size(wire::MESSAGE);
    socket.on_upgrade(async move |socket| {
        attend(socket, page, &pad).await;
        pad.hand.free(page);
    })
}

/// Serves a page until it leaves, breaks a rule, or the server stops.
async fn attend(mut socket: WebSocket, page: u64, pad: &Pad) {
    let (mut stop, mut holder) = (pad.stop.subscribe(), pad.hand.holder());
    let (mut messages, mut pen) = (Bucket::new(MESSAGES), Pen::default());
    holder.mark_changed();
    loop {
        let changed = async { holder.changed().await.map(|()| *holder.borrow_and_update()) };
        let (told, message) = tokio::select! {
            _ = stop.wait_for(|stop| *stop) => return,
            Ok(has) = changed => (Some(whose(has, page)), None),
            message = socket.recv() => (None, message),
        };
        if let Some(told) = told {
            if socket.send(Message::Text(told.into())).await.is_err() {
                return;
            }
            continue;
        }
        let Some(Ok(message)) = message else { return };
        if !messages.take() {
            return;
        }
        let Message::Binary(bytes) = message else { continue };
        match wire::told(&bytes) {
            Some(Told::Hand(sent, strokes)) => pad.hand.moved(page, &mut pen, sent, &strokes),
            Some(Told::Free) => pad.hand.free(page),
            Some(Told::Got(_)) | None => return,
        }
    }
}
