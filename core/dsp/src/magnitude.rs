//! Helpers of all kernels that take magnitudes.

use crate::Float;

/// Level of a signal whose phases do not agree from frame to frame. Overlap-add loses energy there; where the
/// loss follows from the layout alone, it can be compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The spectrum has the input's magnitudes, as the method is published. The signal is too quiet.
    Plain,
    /// The spectrum is scaled up. The signal of steady magnitudes then has their energy on average.
    Keep,
}

/// Copies magnitudes, limited to `most`. NaN, infinite and negative values become 0; their number is
/// returned. Bins missing in `from` are 0.
pub(crate) fn take<P: Float, T: Float>(from: &[P], most: f64, to: &mut [T]) -> usize {
    let most = P::of(most);
    let mut bad = 0;
    for (to, &from) in to.iter_mut().zip(from) {
        let good = from >= P::zero() && from <= P::MAX;
        *to = if good { from.limited(most).to() } else { T::zero() };
        bad += usize::from(!good);
    }
    if let Some(rest) = to.get_mut(from.len()..) {
        rest.fill(T::zero());
    }
    bad
}

/// Largest value that both types hold.
pub(crate) fn largest_of<P: Float, T: Float>() -> f64 {
    P::MAX.f64().min(T::MAX.f64())
}
