//! Limits of connections.
//!
//! Connections with the token are counted apart: those without it cannot take their places.

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::{Arc, OnceLock};

use parking_lot::Mutex;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;

use crate::server::CONNECTIONS;

pub(crate) struct Door {
    strangers: Mutex<Strangers>,
    places: Arc<Semaphore>,
}

/// Connections that have not shown the token, by their number: the oldest first.
#[derive(Default)]
struct Strangers {
    came: u64,
    here: BTreeMap<u64, AbortHandle>,
}

/// One connection. A drop frees its place.
pub(crate) struct Visitor {
    door: Arc<Door>,
    number: u64,
    /// Its place among the connections with the token.
    place: OnceLock<OwnedSemaphorePermit>,
}

impl Default for Door {
    fn default() -> Self {
        Self { strangers: Mutex::default(), places: Arc::new(Semaphore::new(CONNECTIONS)) }
    }
}

impl Door {
    /// Spawns the task of a new connection. Where there are many, the oldest stranger is closed for it.
    pub(crate) fn enter<F>(self: &Arc<Self>, attend: impl FnOnce(Visitor) -> F)
    where
        F: Future<Output = ()> + Send + 'static,
    {
        let mut strangers = self.strangers.lock();
        let full = strangers.here.len() >= CONNECTIONS;
        let oldest = if full { strangers.here.pop_first() } else { None };
        strangers.came += 1;
        let number = strangers.came;
        let visitor = Visitor { door: self.clone(), number, place: OnceLock::new() };
        let task = tokio::spawn(attend(visitor));
        strangers.here.insert(number, task.abort_handle());
        drop(strangers);
        if let Some((_, oldest)) = oldest {
            oldest.abort();
        }
    }
}

impl Visitor {
    /// Takes a place among the connections with the token. Returns whether there was one.
    pub(crate) fn admit(&self) -> bool {
        if self.place.get().is_some() {
            return true;
        }
        let Ok(place) = self.door.places.clone().try_acquire_owned() else { return false };
        self.door.strangers.lock().here.remove(&self.number);
        self.place.set(place).is_ok()
    }
}

impl Drop for Visitor {
    fn drop(&mut self) {
        self.door.strangers.lock().here.remove(&self.number);
    }
}
