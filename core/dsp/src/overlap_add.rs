//! Weighted overlap-add: from spectra to a signal, with unit gain at any hop.
//!
//! Every frame is transformed back, weighted by a Hann window and added at its position. The sum is
//! divided by the sum of `analysis window x synthesis window` over all frames that cover a sample (D.
//! Griffin, J. Lim, "Signal Estimation from Modified Short-Time Fourier Transform", IEEE Trans. ASSP
//! 32(2), 1984, eq. 6). Frames at fractional hops start at whole samples, so that sum is not constant.
//! It is periodic, and one period is kept.

use crate::magnitude::largest_of;
use crate::tape::Tape;
use crate::window::hann;
use crate::{Complex, Float, Framing, Refused, refuse};
use asperity_fft::Transform;
use asperity_state::State;

/// Turns a stream of spectra into samples by weighted overlap-add.
///
/// The divisor is that of an endless stream of frames. So a signal fades in over the first `fft_len` samples,
/// and a missing frame is silence of the frame's weight. Where no frame has weight there is silence.
#[derive(Debug)]
pub struct OverlapAdd<T> {
    framing: Framing,
    transform: Transform<T>,
    /// The synthesis window, times the scale of the inverse transform and of the bins.
    window: Vec<T>,
    /// One over the sum of windows, over one period of sample indices.
    gain: Vec<T>,
    /// Bins are limited to the largest number over this, so that sums over bins and frames stay finite.
    summed: f64,
    /// Sums of frames from the sample `next` on.
    sums: Tape<T>,
    /// First sample that is not emitted yet.
    next: u64,
}

impl<T: Float> OverlapAdd<T> {
    /// Plans the transform and computes the divisor.
    pub fn new(framing: Framing) -> Result<Self, Refused> {
        framing.check()?;
        let n = framing.fft_len;
        let scale = framing.bin_scale() / n as f64;
        let (period, frames) = framing.period();
        let hop = period / frames + 1;
        let overlapping = (n as u64 * frames).div_ceil(period).max(1);
        Ok(Self {
            transform: Transform::new(n),
            window: hann::<f64>(n).into_iter().map(|w| T::of(w * scale)).collect(),
            gain: gain(&framing).into_iter().map(T::of).collect(),
            summed: (8 * framing.bins as u64 * overlapping) as f64,
            sums: Tape::new(n + 2 * usize::try_from(hop).unwrap_or(n)),
            next: 0,
            framing,
        })
    }

    /// Layout of the frames.
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// First sample that is not emitted yet.
    pub fn position(&self) -> u64 {
        self.next
    }

    /// Forgets all frames; the next sample to be emitted is `start`.
    pub fn reset(&mut self, start: u64) {
        self.sums.clear();
        self.next = start;
    }

    /// Saves or restores the pending sums of frames and their position, for one length and hop.
    pub fn state(&mut self, state: &mut State<'_>) {
        self.sums.state(state);
        state.keep(&mut self.next);
        if state.restores() && state.failed() {
            self.reset(self.next);
        }
    }

    /// Adds the frame that covers samples `start .. start + fft_len`.
    ///
    /// `spectrum` holds amplitudes `2 sum(w x e^-i..) / sum(w)` from bin 0, with phases counted from
    /// the frame's first sample. Missing bins are 0; bins beyond `framing.bins` are ignored. Values too
    /// large for a finite sum are limited. Of bin 0 and Nyquist only the real part is used. Samples
    /// that were already emitted do not change.
    ///
    /// # Errors
    /// A frame that starts more than two hops ahead, whose samples have been emitted, or with a bin that is
    /// not finite.
    pub fn add_frame<P: Float>(&mut self, start: u64, spectrum: &[Complex<P>]) -> Result<(), Refused> {
        let n = self.framing.fft_len;
        let skip = usize::try_from(self.next.saturating_sub(start)).unwrap_or(usize::MAX);
        if skip >= n {
            return refuse(TOO_LATE);
        }
        let ahead = usize::try_from(start.saturating_sub(self.next)).unwrap_or(usize::MAX);
        if ahead > self.sums.len() - n {
            return refuse(TOO_EARLY);
        }
        if !spectrum.iter().take(self.framing.bins).all(|x| x.re.finite() && x.im.finite()) {
            return refuse("a bin is not a finite number");
        }
        self.transform(spectrum);
        let (frame, window) = (&self.transform.time[skip..], &self.window[skip..]);
        for ((to, &x), &w) in self.sums[ahead..].iter_mut().zip(frame).zip(window) {
            *to += x * w;
        }
        Ok(())
    }

    fn transform<P: Float>(&mut self, spectrum: &[Complex<P>]) {
        let bins = spectrum.len().min(self.framing.bins);
        let most = P::of(largest_of::<P, T>() / self.summed);
        for (to, from) in self.transform.bins.iter_mut().zip(&spectrum[..bins]) {
            *to = Complex::new(from.re.limited(most).to(), from.im.limited(most).to());
        }
        self.transform.bins[bins..].fill(Complex::default());
        self.transform.inverse();
    }

    /// Takes out the samples `start .. start + out.len()`, in order. A later `start` drops the samples in
    /// between; an earlier one starts anew there, with silence.
    pub fn emit<P: Float>(&mut self, start: u64, out: &mut [P]) {
        if start < self.next {
            self.reset(start);
        }
        self.advance(start - self.next);
        let period = self.gain.len() as u64;
        // A period is at most MAX_PERIOD, so this fits.
        let mut phase = (start % period) as usize;
        for block in out.chunks_mut(self.sums.len()) {
            for (to, &from) in block.iter_mut().zip(self.sums.iter()) {
                *to = (from * self.gain[phase]).to();
                phase += 1;
                if phase == self.gain.len() {
                    phase = 0;
                }
            }
            self.advance(block.len() as u64);
        }
    }

    fn advance(&mut self, count: u64) {
        self.sums.advance(usize::try_from(count).unwrap_or(usize::MAX));
        self.next = self.next.saturating_add(count);
    }
}

pub(crate) const TOO_EARLY: &str = "the frame starts more than two hops ahead";
pub(crate) const TOO_LATE: &str = "the frame's samples have been emitted already";

/// One over the sum of squared windows at each sample of a period, and 0 where that sum all but vanishes.
fn gain(framing: &Framing) -> Vec<f64> {
    let (period, frames) = framing.period();
    let len = usize::try_from(period).unwrap_or(0);
    let window = hann::<f64>(framing.fft_len);
    let mut sum = vec![0.0; len];
    for n in 0..frames {
        // Below one period, which is at most MAX_PERIOD.
        let mut at = framing.start(n) as usize % len;
        for w in &window {
            sum[at] += w * w;
            at += 1;
            if at == len {
                at = 0;
            }
        }
    }
    let floor = 1e-6 * sum.iter().fold(0.0, |a: f64, &b| a.max(b));
    sum.into_iter().map(|s| if s > floor { 1.0 / s } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests;
