//! A small cache of recent values.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Mutex, PoisonError};

/// The most recent values by key.
#[derive(Debug)]
pub struct Recent<K, V> {
    most: usize,
    /// The newest last.
    entries: Mutex<Vec<(K, V)>>,
}

impl<K: PartialEq, V: Clone> Recent<K, V> {
    /// Makes an empty cache of at most `most` values.
    pub const fn new(most: usize) -> Self {
        Self { most, entries: Mutex::new(Vec::new()) }
    }

    /// Returns the value of a key, and makes it if it is missing. Two threads that ask at once may both make
    /// it. Failures are not kept. Error: the errors of `make`.
    pub fn of<E>(&self, key: K, make: impl FnOnce(&K) -> Result<V, E>) -> Result<V, E> {
        let known = || self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let mut entries = known();
        if let Some(at) = entries.iter().position(|(k, _)| *k == key) {
            let entry = entries.remove(at);
            let value = entry.1.clone();
            entries.push(entry);
            return Ok(value);
        }
        drop(entries);
        let value = make(&key)?;
        let mut entries = known();
        if self.most > 0 {
            if entries.len() >= self.most {
                entries.remove(0);
            }
            entries.push((key, value.clone()));
        }
        Ok(value)
    }
}

/// Length and hash of some bytes, valid in this process only.
pub fn fingerprint(bytes: &[u8]) -> (usize, u64) {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    (bytes.len(), hasher.finish())
}

/// Hash of some bytes, the same on every machine: FNV-1a of 64 bits (Fowler, Noll, Vo). Not for
/// security.
pub fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recent_value_is_made_once() {
        let recent = Recent::new(2);
        let made = std::cell::RefCell::new(Vec::new());
        let ask = |key: u32| {
            recent.of(key, |&key| {
                made.borrow_mut().push(key);
                if key == 9 { Err("no") } else { Ok(10 * key) }
            })
        };
        assert_eq!([1, 2, 1, 3, 1, 2].map(&ask), [10, 20, 10, 30, 10, 20].map(Ok));
        assert_eq!((ask(9), ask(9)), (Err("no"), Err("no")));
        assert_eq!(*made.borrow(), [1, 2, 3, 2, 9, 9]);
        assert_ne!(fingerprint(b"a"), fingerprint(b"b"));
    }

    #[test]
    fn fingerprint_is_equal_on_every_machine() {
        // FNV-1a of "a", as its authors publish it.
        assert_eq!(fnv(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv(b""), 0xcbf2_9ce4_8422_2325);
    }
}
