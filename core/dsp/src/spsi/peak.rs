//! The peaks of a frame and the bins that belong to each.

use crate::Float;
use num_complex::Complex;

/// A sinusoid seen in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Peak<T> {
    /// The bin of the maximum.
    pub(crate) bin: usize,
    /// One past the last bin of its region; the region starts where the last one ends.
    pub(super) end: usize,
    /// Distance from the bin to the sinusoid in bins, in [-0.5, 0.5].
    pub(crate) offset: f64,
    /// Bin 0 or Nyquist: only a phase of 0 or half a turn is possible.
    pub(crate) real: bool,
    /// Phase at the window's centre, in turns.
    pub(super) turns: f64,
    /// The phase as a point on the unit circle.
    pub(super) unit: Complex<T>,
    mag: T,
    /// The Hann window's lobe at -2, -1, 0, 1, 2 bins from `bin`, relative to 0, signed.
    lobe: [T; 5],
}

/// Lobe of a Hann window `m` bins from a bin, relative to that bin, for a sinusoid at distance `d`: `sin(pi
/// v) / (v (1 - v^2))` at `v = m - d` over that at `v = -d`, which is rational in `d`.
fn lobe_ratio(m: f64, d: f64, odd: bool) -> f64 {
    let v = m - d;
    let r = d * (1.0 - d * d) / (v * (1.0 - v * v));
    if odd { r } else { -r }
}

impl<T: Float> Peak<T> {
    /// Frequency in bins.
    pub(crate) fn freq(&self) -> f64 {
        self.bin as f64 + self.offset
    }

    fn new(bin: usize, mag: T, offset: f64, real: bool) -> Self {
        let d = offset;
        let lobe = [
            d * (d - 1.0) / ((2.0 + d) * (3.0 + d)),
            (1.0 - d) / (2.0 + d),
            1.0,
            (1.0 + d) / (2.0 - d),
            d * (1.0 + d) / ((2.0 - d) * (3.0 - d)),
        ];
        Self { bin, end: 0, offset, real, turns: 0.0, unit: Complex::default(), mag, lobe: lobe.map(T::of) }
    }

    /// Contribution of this sinusoid to bin `k`, with sign, at most two bins from its own.
    #[inline]
    fn near(&self, k: usize) -> Option<T> {
        self.lobe.get((k + 2).wrapping_sub(self.bin)).map(|&r| r * self.mag)
    }

    /// The same farther away: a side lobe.
    #[inline]
    fn far(&self, k: usize) -> T {
        let m = k as f64 - self.bin as f64;
        self.mag * T::of(lobe_ratio(m, self.offset, k.abs_diff(self.bin) % 2 == 1))
    }

    /// Phase at the window's centre of bin `k` of this peak's region (not its own bin), of magnitude `mag >
    /// 0`,
    #[inline]
    pub(super) fn phase_at(&self, k: usize, mag: T, other: Option<&Self>) -> Complex<T> {
        // Largest ratio of a bin to the window's own side lobe.
        const SIDE: f64 = 1.5;
        let side = T::of(SIDE);
        let alike = |own: T| if own.abs() * side > mag { own } else { mag };
        let own = match self.near(k) {
            Some(own) if k.abs_diff(self.bin) < 2 => own,
            Some(own) => alike(own),
            None => alike(self.far(k)),
        };
        let mine = if own < T::zero() { -self.unit } else { self.unit };
        let Some(other) = other else { return mine };
        let theirs = match other.near(k) {
            Some(theirs) => theirs,
            // Side lobes of a Hann window stay under 1/37 of its main lobe.
            None if other.mag * T::of(0.27) > mag => other.far(k),
            None => return mine,
        };
        let most = T::of(1e6);
        let weight = theirs / own.abs();
        let weight = if weight.abs() < most { weight } else { most };
        let sum = mine + other.unit * weight;
        let square = sum.re * sum.re + sum.im * sum.im;
        // Two lobes that cancel give no phase.
        if square > T::of(1e-6) { sum * (T::one() / square.root()) } else { mine }
    }
}

/// Finds all maxima. A run of equal bins above both its sides is one maximum, at its middle.
pub(crate) fn find<T: Float>(mags: &[T], last_is_nyquist: bool, peaks: &mut Vec<Peak<T>>) {
    peaks.clear();
    let mut rising = true;
    let mut from = 0;
    let mut valley = 0;
    let mut valley_mag = T::zero();
    for (k, &mag) in mags.iter().enumerate() {
        let next = mags.get(k + 1).copied();
        if rising {
            match next {
                Some(next) if next > mag => from = k + 1,
                Some(next) if next == mag => {}
                _ if mag > T::zero() => {
                    let peak = interpolate(mags, from + (k - from) / 2, last_is_nyquist);
                    if let Some(before) = peaks.last_mut() {
                        // The bin in the valley goes to the weaker side, which has less to lose by it.
                        before.end = if before.mag < peak.mag { valley + 1 } else { valley };
                    }
                    if peaks.len() < peaks.capacity() {
                        peaks.push(peak);
                    }
                    rising = false;
                    (valley, valley_mag) = (k, mag);
                }
                _ => from = k + 1,
            }
        }
        if !rising {
            if mag < valley_mag {
                (valley, valley_mag) = (k, mag);
            }
            if next.is_some_and(|next| next > mag) {
                rising = true;
                from = k + 1;
            }
        }
    }
    if let Some(last) = peaks.last_mut() {
        last.end = mags.len();
    }
}

fn interpolate<T: Float>(mags: &[T], bin: usize, last_is_nyquist: bool) -> Peak<T> {
    let at = |k: usize| mags.get(k).map(|m| m.f64());
    let mag = mags.get(bin).copied().unwrap_or_default();
    let b = mag.f64();
    let left = bin.checked_sub(1).and_then(at);
    let (offset, real) = match (left, at(bin + 1)) {
        // A real signal's spectrum is even about 0 and about half the rate.
        (None, _) => (0.0, true),
        (_, None) if last_is_nyquist => (0.0, true),
        (Some(a), Some(c)) => (2.0 * (c - a) / (a + 2.0 * b + c), false),
        (Some(a), None) => {
            // One side only: Hann lobes give a / b = (1 - d) / (2 + d), from 0.2 (d = 0.5) up. Less is no
            // lobe of this window.
            let r = a / b;
            (if r < 0.2 { 0.0 } else { (1.0 - 2.0 * r) / (1.0 + r) }, false)
        }
    };
    Peak::new(bin, mag, if offset.is_finite() { offset.clamp(-0.5, 0.5) } else { 0.0 }, real)
}
