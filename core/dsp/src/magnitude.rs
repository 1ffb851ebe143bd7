//! What the kernels that take magnitudes have in common.

use crate::Float;

/// How loud a spectrum is made that phases alone cannot make consistent.
///
/// A method that pays no regard to how frames overlap loses energy when they are added up: what
/// interferes destructively is gone. Where the loss follows from the layout alone it can be made good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The spectrum has the magnitudes that came in, as the method is published. The signal is too quiet.
    Plain,
    /// The spectrum is scaled up so that the signal of steady magnitudes has, on average, their energy.
    Keep,
}

/// The largest value that both widths hold.
pub(crate) fn largest_of<P: Float, T: Float>() -> f64 {
    P::MAX.f64().min(T::MAX.f64())
}

/// Copies magnitudes; what is NaN, infinite or negative becomes 0 and is counted. Bins missing in `from`
/// are 0. None is left above `most`.
pub(crate) fn take<P: Float, T: Float>(from: &[P], most: f64, to: &mut [T]) -> usize {
    let most = P::of(most);
    let mut bad = 0;
    for (to, &from) in to.iter_mut().zip(from) {
        let good = from >= P::zero() && from <= P::MAX;
        *to = if !good {
            T::zero()
        } else if from > most {
            most.to()
        } else {
            from.to()
        };
        bad += usize::from(!good);
    }
    if let Some(rest) = to.get_mut(from.len()..) {
        rest.fill(T::zero());
    }
    bad
}
