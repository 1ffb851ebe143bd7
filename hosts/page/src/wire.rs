//! The binary messages of a WebSocket, and the layout. [`control`](crate::control) has the messages in text.
//! All numbers are little-endian.
//!
//! From the server, to a page: a view. It is the length of its head in bytes (u32), the head in JSON, zeros
//! up to a multiple of four, and the new samples of every scope (f32). The head is
//! `{"view": View without scopes, "scopes": [[first, count], ...]}`. `first` counts the samples of that scope
//! since its layout, so that a page sees gaps.
//!
//! To the server (f64):
//! - `[0, count]`: the number of views it has got,
//! - `[1, sent, (time, x, y, pressure, stroke) ...]`: the hand; browser times in ms, places in mm,
//! - `[2]`: lets the hand go.

use std::time::Duration;

use asperity_live::view::{Layout, View};
use serde::Serialize;

/// Most bytes of a message to the server.
pub const MESSAGE: usize = 16 * 1024;
/// Most views on the way to a page: half a second.
pub const AHEAD: u64 = 30;
/// Longest wait for a page to acknowledge a view, or to take a message.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// Most samples of a hand in one message.
const BATCH: usize = 256;
/// Most new samples of one scope in a view; older ones are left out.
const SCOPE: usize = 8192;
/// Greatest distance from the middle of the surface in mm.
pub(crate) const REACH_MM: f64 = 10_000.0;

/// One sample of the hand, as the page sends it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stroke {
    /// Time of the browser's clock in ms.
    pub(crate) at_ms: f64,
    pub(crate) x_mm: f64,
    pub(crate) y_mm: f64,
    /// 0 to 1; 0 off the surface.
    pub(crate) pressure: f64,
    pub(crate) number: u32,
}

#[derive(Debug, PartialEq)]
pub(crate) enum Told {
    /// The number of views it has got.
    Got(u64),
    /// Browser time of the message in ms, and samples of the hand.
    Hand(f64, Vec<Stroke>),
    Free,
}

/// Reads a binary message. `None` for anything that the page would not send.
pub(crate) fn told(bytes: &[u8]) -> Option<Told> {
    let (eights, rest) = bytes.as_chunks::<8>();
    let numbers: Vec<f64> = eights.iter().map(|x| f64::from_le_bytes(*x)).collect();
    if !rest.is_empty() || !numbers.iter().all(|x| x.is_finite()) {
        return None;
    }
    match numbers.as_slice() {
        [0.0, view] => Some(Told::Got(whole(*view, 2f64.powi(53))? as u64)),
        [1.0, sent, strokes @ ..] => {
            let (strokes, rest) = strokes.as_chunks::<5>();
            let fits = rest.is_empty() && (1..=BATCH).contains(&strokes.len());
            let strokes = strokes.iter().map(stroke).collect::<Option<Vec<_>>>()?;
            fits.then_some(Told::Hand(*sent, strokes))
        }
        [2.0] => Some(Told::Free),
        _ => None,
    }
}

fn stroke(&[at_ms, x_mm, y_mm, pressure, number]: &[f64; 5]) -> Option<Stroke> {
    let there = x_mm.abs() <= REACH_MM && y_mm.abs() <= REACH_MM && (0.0..=1.0).contains(&pressure);
    let number = whole(number, f64::from(u32::MAX))? as u32;
    there.then_some(Stroke { at_ms, x_mm, y_mm, pressure, number })
}

fn whole(x: f64, most: f64) -> Option<f64> {
    (x.fract() == 0.0 && (0.0..=most).contains(&x)).then_some(x)
}

/// A layout as a message; `hand` says whether the graph has a pointer, `map` counts its maps.
pub(crate) fn layout(layout: &Layout, hand: bool, map: u64) -> String {
    #[derive(Serialize)]
    struct Message<'a> {
        layout: (&'a Layout, bool, u64),
    }
    serde_json::to_string(&Message { layout: (layout, hand, map) }).unwrap_or_default()
}

/// A view as a message. `seen` counts the samples of every scope so far, and is updated.
pub(crate) fn view(mut view: View, seen: &mut Vec<u64>) -> Vec<u8> {
    #[derive(Serialize)]
    struct Head<'a> {
        view: &'a View,
        scopes: Vec<(u64, usize)>,
    }
    let scopes = std::mem::take(&mut view.scopes);
    seen.resize(scopes.len(), 0);
    let newest: Vec<&[f32]> = scopes.iter().map(|x| &x[x.len().saturating_sub(SCOPE)..]).collect();
    let mut places = Vec::with_capacity(scopes.len());
    for ((all, new), seen) in scopes.iter().zip(&newest).zip(seen.iter_mut()) {
        *seen += all.len() as u64;
        places.push((*seen - new.len() as u64, new.len()));
    }
    let mut bytes = vec![0; 4];
    // This cannot fail: all keys are strings.
    let _ = serde_json::to_writer(&mut bytes, &Head { view: &view, scopes: places });
    let head = (bytes.len() - 4) as u32;
    bytes[..4].copy_from_slice(&head.to_le_bytes());
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let mut rest = bytes.len();
    bytes.resize(rest + 4 * newest.iter().map(|x| x.len()).sum::<usize>(), 0);
    for samples in newest {
        let (fours, _) = bytes[rest..].as_chunks_mut::<4>();
        fours.iter_mut().zip(samples).for_each(|(bytes, x)| *bytes = x.to_le_bytes());
        rest += 4 * samples.len();
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(numbers: &[f64]) -> Vec<u8> {
        numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
    }

    #[test]
    fn view_counts_the_samples_of_its_scopes() {
        let mut seen = Vec::new();
        let of = |scopes: &[usize]| View {
            number: 7,
            scopes: scopes.iter().map(|&n| (0..n).map(|i| i as f32).collect()).collect(),
            ..View::default()
        };
        view(of(&[3, 0]), &mut seen);
        let message = view(of(&[SCOPE + 5, 2]), &mut seen);
        let head_len = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
        let head: serde_json::Value = serde_json::from_slice(&message[4..4 + head_len]).unwrap();
        assert_eq!(head["view"]["number"], 7);
        assert_eq!(head["scopes"], serde_json::json!([[3 + 5, SCOPE], [0, 2]]));
        let samples = &message[(4 + head_len).next_multiple_of(4)..];
        assert_eq!(samples.len(), 4 * (SCOPE + 2));
        assert_eq!(samples[..4], 5f32.to_le_bytes());
        assert_eq!(samples[4 * SCOPE + 4..], 1f32.to_le_bytes());
    }

    #[test]
    fn hand_message_is_read() {
        let read = told(&bytes(&[1.0, 10.5, 10.25, -3.0, 4.0, 0.5, 2.0])).unwrap();
        let stroke = Stroke { at_ms: 10.25, x_mm: -3.0, y_mm: 4.0, pressure: 0.5, number: 2 };
        assert_eq!(read, Told::Hand(10.5, vec![stroke]));
        assert_eq!(told(&bytes(&[0.0, 77.0])), Some(Told::Got(77)));
        assert_eq!(told(&bytes(&[2.0])), Some(Told::Free));
    }

    #[test]
    fn invalid_binary_messages_are_refused() {
        let good = [1.0, 0.0, 0.0, 1.0, 1.0, 0.5, 1.0];
        let but = |place: usize, value: f64| {
            let mut bad = good;
            bad[place] = value;
            told(&bytes(&bad))
        };
        assert!(told(&bytes(&good)).is_some());
        for (place, value) in
            [(0, 3.0), (1, f64::NAN), (3, 1e9), (3, f64::INFINITY), (5, 1.5), (5, -0.1), (6, 0.5)]
        {
            assert_eq!(but(place, value), None, "{place} {value}");
        }
        assert_eq!(told(&[]), None);
        assert_eq!(told(&bytes(&good)[..55]), None);
        assert_eq!(told(&bytes(&good[..6])), None);
        assert_eq!(told(&bytes(&[1.0, 0.0])), None);
        let long = [&good[..2], &good[2..].repeat(BATCH + 1)].concat();
        assert_eq!(told(&bytes(&long)), None);
        assert_eq!(told(&bytes(&[0.0, -1.0])), None);
    }
}
