//! What the kernels that take magnitudes have in common.

use crate::Float;

/// How loud a spectrum is made that phases alone cannot make consistent.
///
/// A method that pays no regard to how frames overlap loses energy when they are added up: what interferes destructively is
/// gone. Where the loss follows from the layout alone it can be made good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The spectrum has the magnitudes that came in, as the method is published. The signal is too quiet.
    Plain,
    /// The spectrum is scaled up so that the signal of steady magnitudes has, on average, their energy.
    Keep,
}

/// Copies magnitudes; what is NaN, infinite or negative becomes 0 and is counted. Bins missing in `from` are 0. None is left
/// above `most`.
pub(crate) fn take<T: Float>(from: &[T], most: T, to: &mut [T]) -> usize {
    let mut bad = 0;
    for (to, &from) in to.iter_mut().zip(from) {
        let good = from >= T::zero() && from <= T::MAX;
        *to = if !good {
            T::zero()
        } else if from > most {
            most
        } else {
            from
        };
        bad += usize::from(!good);
    }
    if let Some(rest) = to.get_mut(from.len()..) {
        rest.fill(T::zero());
    }
    bad
}
