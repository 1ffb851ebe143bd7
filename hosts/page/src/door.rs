//! Limits of connections, checks of requests, and the security headers of answers.
//!
//! A request must name the address that its connection came to. So the server may be bound to every address
//! of the machine, and a foreign name that resolves to one of them is still refused.
//!
//! Connections with the token are counted apart: those without it cannot take their places.

use std::collections::BTreeMap;
use std::future::Future;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, OnceLock};

use axum::extract::{Extension, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use parking_lot::Mutex;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;

/// Most connections with the token at a time, beside those of pages over WebSocket. One more gets 503.
///
/// As many may be open without the token. One more closes the oldest of these.
pub const CONNECTIONS: usize = 64;

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
    /// The address of ours that it came to.
    at: SocketAddr,
    /// Its place among the connections with the token.
    place: OnceLock<OwnedSemaphorePermit>,
}

impl Default for Door {
    fn default() -> Self {
        Self { strangers: Mutex::default(), places: Arc::new(Semaphore::new(CONNECTIONS)) }
    }
}

impl Door {
    /// Spawns the task of a new connection to this address of ours. Where there are many, the oldest stranger
    /// is closed for it.
    pub(crate) fn enter<F>(self: &Arc<Self>, at: SocketAddr, attend: impl FnOnce(Visitor) -> F)
    where
        F: Future<Output = ()> + Send + 'static,
    {
        let mut strangers = self.strangers.lock();
        let full = strangers.here.len() >= CONNECTIONS;
        let oldest = if full { strangers.here.pop_first() } else { None };
        strangers.came += 1;
        let number = strangers.came;
        let visitor = Visitor { door: self.clone(), number, at, place: OnceLock::new() };
        let task = tokio::spawn(attend(visitor));
        strangers.here.insert(number, task.abort_handle());
        drop(strangers);
        if let Some((_, oldest)) = oldest {
            oldest.abort();
        }
    }

    /// Returns once no connection with the token is left.
    pub(crate) async fn left(&self) {
        let _ = self.places.acquire_many(CONNECTIONS as u32).await;
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
    State(token): State<Arc<str>>,
    Extension(visitor): Extension<Arc<Visitor>>,
    request: Request,
    next: Next,
) -> Response {
    let query = request.uri().query().unwrap_or_default();
    let checked = checked(request.headers(), query, visitor.at, &token).map(str::to_owned);
    let mut response = match &checked {
        Err(why) => (StatusCode::FORBIDDEN, *why).into_response(),
        Ok(_) if !visitor.admit() => {
            (StatusCode::SERVICE_UNAVAILABLE, "too many connections\n").into_response()
        }
        Ok(_) => next.run(request).await,
    };
    shut(response.headers_mut(), checked.ok().as_deref());
    // One request, one connection: an idle connection would take the place of another.
    if response.status() != StatusCode::SWITCHING_PROTOCOLS {
        response.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}

/// Answers the host that a request names, or why the request is refused.
///
/// A request may lack an origin: browsers leave it out when they open a page, and always send it with a
/// WebSocket. A WebSocket without one comes from a program that knows the token.
fn checked<'h>(
    headers: &'h HeaderMap,
    query: &str,
    at: SocketAddr,
    token: &str,
) -> Result<&'h str, &'static str> {
    let host = only(headers, header::HOST).ok_or("a request needs exactly one Host\n")?;
    if !is_ours(host, at) {
        return Err("the Host of this request is not this machine\n");
    }
    let foreign = headers.contains_key(header::ORIGIN)
        && only(headers, header::ORIGIN).is_none_or(|origin| origin.strip_prefix("http://") != Some(host));
    if foreign {
        return Err("this request comes from another page\n");
    }
    let mut tokens = query.split('&').filter_map(|part| part.strip_prefix("token="));
    match (tokens.next(), tokens.next()) {
        (Some(told), None) if same(told, token) => Ok(host),
        _ => Err("the address needs the token that the program printed\n"),
    }
}

/// Whether a host is the address that its connection came to, or the loopback address, with our port.
fn is_ours(host: &str, at: SocketAddr) -> bool {
    let port = at.port();
    let ours = [at, (Ipv4Addr::LOCALHOST, port).into(), (Ipv6Addr::LOCALHOST, port).into()];
    ours.iter().any(|ours| host == ours.to_string()) || host == format!("localhost:{port}")
}

fn only(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut all = headers.get_all(name).iter();
    match (all.next(), all.next()) {
        (Some(one), None) => one.to_str().ok(),
        _ => None,
    }
}

/// Whether two texts are equal. The time taken does not depend on where they differ.
pub(crate) fn same(a: &str, b: &str) -> bool {
    let differ = a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| std::hint::black_box(differ | (a ^ b)));
    a.len() == b.len() && differ == 0
}

/// Forbids everything that the page does not need. WebSockets are named, since `'self'` means HTTP alone in
/// older browsers.
fn shut(headers: &mut HeaderMap, host: Option<&str>) {
    let socket = host.map(|host| format!(" ws://{host}")).unwrap_or_default();
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; media-src 'self'; \
         connect-src 'self'{socket}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
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

    #[test]
    fn hosts_of_the_connection_and_loopback_are_ours() {
        let at = |at: &str| at.parse::<SocketAddr>().unwrap();
        let (v4, v6) = (at("192.168.1.5:8080"), at("[2001:db8::5]:8080"));
        for loopback in ["127.0.0.1:8080", "[::1]:8080", "localhost:8080"] {
            assert!(is_ours(loopback, v4) && is_ours(loopback, v6), "{loopback}");
        }
        assert!(is_ours("192.168.1.5:8080", v4) && is_ours("[2001:db8::5]:8080", v6));
        for other in ["192.168.1.5", "192.168.1.5:80", "192.168.1.6:8080", "2001:db8::5:8080", "pc:8080", ""]
        {
            assert!(!is_ours(other, v4) && !is_ours(other, v6), "{other}");
        }
        assert!(!is_ours("192.168.1.5:8080", v6));
    }
}
