//! Limits of connections, checks of requests, and the security headers of answers.
//!
//! Connections with the token are counted apart: those without it cannot take their places.

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::{Arc, OnceLock};

use axum::extract::{Extension, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use parking_lot::Mutex;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;

use crate::server::{CONNECTIONS, Shared};

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

/// Lets a request with the right host, origin and token through. Adds the security headers to every answer.
pub(crate) async fn guard(
    State(shared): State<Arc<Shared>>,
    Extension(visitor): Extension<Arc<Visitor>>,
    request: Request,
    next: Next,
) -> Response {
    let query = request.uri().query().unwrap_or_default();
    let refused = match refused(request.headers(), query, shared.port, &shared.token) {
        Some(why) => Some((StatusCode::FORBIDDEN, why)),
        None if !visitor.admit() => Some((StatusCode::SERVICE_UNAVAILABLE, "too many connections\n")),
        None => None,
    };
    let mut response = match refused {
        None => next.run(request).await,
        Some(refused) => refused.into_response(),
    };
    shut(response.headers_mut(), shared.port);
    // One request, one connection: an idle connection would take the place of another.
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Why a request is refused, if it is.
///
/// A request may lack an origin: browsers leave it out when they open a page, and always send it with a
/// WebSocket. A WebSocket without one comes from a program on this machine that knows the token.
fn refused(headers: &HeaderMap, query: &str, port: u16, token: &str) -> Option<&'static str> {
    let Some(host) = only(headers, header::HOST) else { return Some("a request needs exactly one Host\n") };
    if host != format!("127.0.0.1:{port}") && host != format!("localhost:{port}") {
        return Some("the Host of this request is not this machine\n");
    }
    let foreign = headers.contains_key(header::ORIGIN)
        && only(headers, header::ORIGIN).is_none_or(|origin| origin.strip_prefix("http://") != Some(host));
    if foreign {
        return Some("this request comes from another page\n");
    }
    let mut tokens = query.split('&').filter_map(|part| part.strip_prefix("token="));
    match (tokens.next(), tokens.next()) {
        (Some(told), None) if same(told, token) => None,
        _ => Some("the address needs the token that the program printed\n"),
    }
}

fn only(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut all = headers.get_all(name).iter();
    match (all.next(), all.next()) {
        (Some(one), None) => one.to_str().ok(),
        _ => None,
    }
}

/// Whether two texts are equal. The time taken does not depend on where they differ.
fn same(a: &str, b: &str) -> bool {
    let differ = a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| std::hint::black_box(differ | (a ^ b)));
    a.len() == b.len() && differ == 0
}

/// Forbids everything that the page does not need. WebSockets are named, since `'self'` means HTTP alone in
/// older browsers.
fn shut(headers: &mut HeaderMap, port: u16) {
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; \
         connect-src 'self' ws://127.0.0.1:{port} ws://localhost:{port}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    );
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    let fixed = [
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
        (header::HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
        (header::HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
    ];
    for (name, value) in fixed {
        headers.insert(name, HeaderValue::from_static(value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn same_compares_whole_texts() {
        assert!(same("abc", "abc"));
        for other in ["", "ab", "abcd", "abd", "bbc"] {
            assert!(!same("abc", other) && !same(other, "abc"), "{other}");
        }
    }
}
