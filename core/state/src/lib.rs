//! State of a node as bytes, which another instance can take over.
//!
//! A type lists its state in one function. The same function measures, saves and restores it, so that
//! the three cannot disagree. Nothing here allocates: the caller owns the bytes, and restored values
//! have their size already.
//!
//! ```
//! use asperity_state::State;
//!
//! struct Filter { gain: f64, memory: Vec<f64>, started: bool }
//!
//! impl Filter {
//!     fn state(&mut self, state: &mut State<'_>) {
//!         state.keep(&mut self.memory).keep(&mut self.started); // not `gain`: that is a parameter
//!     }
//! }
//!
//! let mut old = Filter { gain: 1.0, memory: vec![3.0, 4.0], started: true };
//! let mut new = Filter { gain: 2.0, memory: vec![0.0, 0.0], started: false };
//! let mut bytes = vec![0; State::measure(|s| old.state(s))];
//! State::save(&mut bytes, |s| old.state(s)).unwrap();
//! assert!(State::restore(&bytes, |s| new.state(s)));
//! assert_eq!((new.gain, new.memory, new.started), (2.0, vec![3.0, 4.0], true));
//! ```

use num_complex::Complex;

/// A pass over the state of a node: measuring, saving or restoring.
#[derive(Debug)]
pub struct State<'a> {
    pass: Pass<'a>,
    /// Bytes passed so far.
    at: usize,
    /// Whether something did not fit.
    failed: bool,
}

#[derive(Debug)]
enum Pass<'a> {
    Measure,
    Save(&'a mut [u8]),
    Restore(&'a [u8]),
}

impl<'a> State<'a> {
    fn new(pass: Pass<'a>) -> Self {
        Self { pass, at: 0, failed: false }
    }

    /// Number of bytes that a state needs.
    pub fn measure(visit: impl FnOnce(&mut State<'_>)) -> usize {
        let mut state = State::new(Pass::Measure);
        visit(&mut state);
        state.at
    }

    /// Writes a state to the front of `bytes` and returns its length; `None` if `bytes` is too short.
    pub fn save(bytes: &'a mut [u8], visit: impl FnOnce(&mut State<'_>)) -> Option<usize> {
        let mut state = State::new(Pass::Save(bytes));
        visit(&mut state);
        (!state.failed).then_some(state.at)
    }

    /// Reads a state. Returns false if the bytes do not belong to this type with these sizes. Values
    /// read until then stay, so the caller resets.
    #[must_use]
    pub fn restore(bytes: &'a [u8], visit: impl FnOnce(&mut State<'_>)) -> bool {
        let mut state = State::new(Pass::Restore(bytes));
        visit(&mut state);
        !state.failed && state.at == bytes.len()
    }

    /// Passes a part of the state: a number, a flag, an `Option`, or a slice, array or `Vec` of these
    /// with a fixed length.
    pub fn keep<T: Keep + ?Sized>(&mut self, part: &mut T) -> &mut Self {
        part.keep(self);
        self
    }

    /// Passes a list whose length changes within its capacity.
    pub fn keep_list<T: Keep + Default + Clone>(&mut self, list: &mut Vec<T>) -> &mut Self {
        let mut len = list.len();
        len.keep(self);
        if self.restores() && len != list.len() {
            if len > list.capacity() {
                self.failed = true;
                return self;
            }
            list.resize(len, T::default());
        }
        list.iter_mut().for_each(|part| part.keep(self));
        // Measures the full capacity, so that the size holds for any length.
        if matches!(self.pass, Pass::Measure) {
            let spare = list.capacity() - list.len();
            let mut one = T::default();
            let before = self.at;
            one.keep(self);
            self.at = before + (self.at - before) * spare;
        }
        self
    }

    /// Passes the rest of the state as bytes that only their owner reads. `size` answers the most bytes;
    /// `save` writes to the front and answers the length; `restore` answers whether it took them all.
    pub fn opaque(
        &mut self,
        size: impl FnOnce() -> usize,
        save: impl FnOnce(&mut [u8]) -> Option<usize>,
        restore: impl FnOnce(&[u8]) -> bool,
    ) {
        let at = self.at;
        match &mut self.pass {
            Pass::Measure => self.at += size(),
            Pass::Save(bytes) => match bytes.get_mut(at..).and_then(save) {
                Some(len) if len <= bytes.len() - at => self.at += len,
                _ => self.failed = true,
            },
            Pass::Restore(bytes) => {
                self.failed = self.failed || !bytes.get(at..).is_some_and(restore);
                self.at = bytes.len();
            }
        }
    }

    /// Whether this pass writes to the parts.
    pub fn restores(&self) -> bool {
        matches!(self.pass, Pass::Restore(_))
    }

    /// Marks the restored state as invalid.
    pub fn refuse(&mut self) {
        self.failed = true;
    }

    /// Refuses the restored state unless it `fits`. Does nothing in other passes.
    pub fn require(&mut self, fits: bool) {
        self.failed |= self.restores() && !fits;
    }

    /// Whether something did not fit or was refused. Later parts then stay unchanged.
    pub fn failed(&self) -> bool {
        self.failed
    }
}

/// Types that [`State::keep`] takes.
pub trait Keep {
    /// Passes every byte of this through `state`.
    fn keep(&mut self, state: &mut State<'_>);

    /// Passes many of these through `state`, one after another.
    fn keep_each(all: &mut [Self], state: &mut State<'_>)
    where
        Self: Sized,
    {
        all.iter_mut().for_each(|one| one.keep(state));
    }
}

macro_rules! keep_number {
    ($($t:ty),*) => {$(
        impl Keep for $t {
            fn keep(&mut self, state: &mut State<'_>) {
                Self::keep_each(std::slice::from_mut(self), state);
            }

            // A delay of seconds has hundreds of thousands of values, so bounds are checked once for
            // all.
            fn keep_each(all: &mut [Self], state: &mut State<'_>) {
                const SIZE: usize = size_of::<$t>();
                let (start, end) = (state.at, state.at + SIZE * all.len());
                state.at = end;
                match &mut state.pass {
                    Pass::Measure => {}
                    Pass::Save(bytes) => match bytes.get_mut(start..end) {
                        Some(to) => {
                            for (to, from) in to.chunks_exact_mut(SIZE).zip(all) {
                                to.copy_from_slice(&from.to_le_bytes());
                            }
                        }
                        None => state.failed = true,
                    },
                    Pass::Restore(bytes) => match bytes.get(start..end) {
                        Some(from) if !state.failed => {
                            for (to, from) in all.iter_mut().zip(from.chunks_exact(SIZE)) {
                                *to = Self::from_le_bytes(from.try_into().unwrap_or_default());
                            }
                        }
                        Some(_) => {}
                        None => state.failed = true,
                    },
                }
            }
        }
    )*};
}

keep_number!(u8, u16, u32, u64, i32, i64, f32, f64);

impl Keep for usize {
    fn keep(&mut self, state: &mut State<'_>) {
        let mut wide = *self as u64;
        wide.keep(state);
        match usize::try_from(wide) {
            Ok(it) => *self = it,
            Err(_) => state.failed = true,
        }
    }
}

impl Keep for bool {
    fn keep(&mut self, state: &mut State<'_>) {
        let mut byte = u8::from(*self);
        byte.keep(state);
        *self = byte != 0;
    }
}

impl<T: Keep> Keep for Complex<T> {
    fn keep(&mut self, state: &mut State<'_>) {
        self.re.keep(state);
        self.im.keep(state);
    }
}

/// One byte, and space for the value in any case, so that the size is fixed.
impl<T: Keep + Default> Keep for Option<T> {
    fn keep(&mut self, state: &mut State<'_>) {
        let mut there = self.is_some();
        there.keep(state);
        let mut value = self.take().unwrap_or_default();
        value.keep(state);
        *self = there.then_some(value);
    }
}

impl<T: Keep> Keep for [T] {
    fn keep(&mut self, state: &mut State<'_>) {
        let mut len = self.len();
        len.keep(state);
        if len != self.len() {
            state.failed = true;
            return;
        }
        T::keep_each(self, state);
    }
}

macro_rules! keep_as_slice {
    ($($t:ty $(, $n:ident)?;)*) => {$(
        impl<T: Keep $(, const $n: usize)?> Keep for $t {
            fn keep(&mut self, state: &mut State<'_>) {
                self[..].keep(state);
            }
        }
    )*};
}

keep_as_slice!([T; N], N; Vec<T>; Box<[T]>;);

impl<A: Keep, B: Keep> Keep for (A, B) {
    fn keep(&mut self, state: &mut State<'_>) {
        self.0.keep(state);
        self.1.keep(state);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, Default, PartialEq)]
    struct All {
        a: u8,
        b: i64,
        c: f32,
        d: Option<u64>,
        e: Vec<f64>,
        f: [bool; 3],
        g: Complex<f32>,
        h: Vec<(u32, f32)>,
        i: usize,
    }

    impl All {
        fn state(&mut self, state: &mut State<'_>) {
            state.keep(&mut self.a).keep(&mut self.b).keep(&mut self.c).keep(&mut self.d);
            state.keep(&mut self.e).keep(&mut self.f).keep(&mut self.g).keep(&mut self.i);
            state.keep_list(&mut self.h);
        }
    }

    fn some() -> All {
        let mut h = Vec::with_capacity(4);
        h.extend([(7, 1.5), (9, -2.5)]);
        let (e, f, g) = (vec![0.1, f64::NAN.signum(), -3.0], [true, false, true], Complex::new(1.0, -2.0));
        All { a: 200, b: -5, c: 1e-30, d: Some(u64::MAX), e, f, g, h, i: 77 }
    }

    fn none() -> All {
        All { e: vec![0.0; 3], h: Vec::with_capacity(4), ..All::default() }
    }

    fn saved(all: &mut All) -> Vec<u8> {
        let mut bytes = vec![0; State::measure(|s| all.state(s))];
        let len = State::save(&mut bytes, |s| all.state(s)).unwrap();
        bytes.truncate(len);
        bytes
    }

    #[test]
    fn saved_state_is_restored() {
        let bytes = saved(&mut some());
        let mut other = none();
        assert!(State::restore(&bytes, |s| other.state(s)));
        assert_eq!(format!("{other:?}"), format!("{:?}", some()));
        let mut back = some();
        assert!(State::restore(&saved(&mut none()), |s| back.state(s)));
        assert_eq!(back, none());
    }

    #[test]
    fn opaque_bytes_come_last_and_must_fit() {
        /// A number, and bytes of an owner that says it wrote `len` of 3.
        fn visit(state: &mut State<'_>, number: &mut u8, bytes: &mut Vec<u8>, len: usize) {
            state.keep(number);
            let kept = std::cell::RefCell::new(bytes);
            let save = |to: &mut [u8]| {
                to.get_mut(..3)?.copy_from_slice(&kept.borrow()[..3]);
                Some(len)
            };
            let restore = |from: &[u8]| {
                **kept.borrow_mut() = from.to_vec();
                from.len() == 3
            };
            state.opaque(|| 3, save, restore);
        }
        let mut room = vec![0; State::measure(|s| visit(s, &mut 7, &mut vec![1, 2, 3], 3))];
        assert_eq!(State::save(&mut room, |s| visit(s, &mut 7, &mut vec![1, 2, 3], 3)), Some(4));
        assert_eq!(room, [7, 1, 2, 3]);
        let (mut number, mut bytes) = (0, Vec::new());
        assert!(State::restore(&room, |s| visit(s, &mut number, &mut bytes, 3)));
        assert_eq!((number, bytes), (7, vec![1, 2, 3]));
        assert!(!State::restore(&room[..3], |s| visit(s, &mut 0, &mut Vec::new(), 3)));
        assert!(State::save(&mut room[..3], |s| visit(s, &mut 7, &mut vec![1, 2, 3], 3)).is_none());
        assert!(State::save(&mut room, |s| visit(s, &mut 7, &mut vec![1, 2, 3], 4)).is_none());
    }

    #[test]
    fn measured_size_holds_every_state() {
        let mut it = none();
        let size = State::measure(|s| it.state(s));
        it.h.extend([(1, 1.0); 4]);
        assert_eq!(State::save(&mut vec![0; size], |s| it.state(s)), Some(size));
    }

    #[test]
    fn bytes_of_another_size_are_refused() {
        let bytes = saved(&mut some());
        for len in 0..bytes.len() {
            assert!(!State::restore(&bytes[..len], |s| none().state(s)), "{len}");
            assert!(State::save(&mut vec![0; len], |s| some().state(s)).is_none());
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(!State::restore(&longer, |s| none().state(s)));
        assert!(!State::restore(&bytes, |s| All { e: vec![0.0; 4], ..none() }.state(s)));
        assert!(!State::restore(&bytes, |s| All { h: Vec::with_capacity(1), ..none() }.state(s)));
    }
}
