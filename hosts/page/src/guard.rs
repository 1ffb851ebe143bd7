//! Checks of requests, and the security headers of answers.

use std::sync::Arc;

use axum::extract::{Extension, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use crate::door::Visitor;
use crate::server::Shared;

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
