//! Saving and restoring.

use super::SampleCommit;
use crate::Float;
use crate::float::keep_wide;
use asperity_state::State;

/// No sample has a place beyond this one: millions of years at any rate.
const FAR: i64 = 1 << 61;

impl<T: Float> SampleCommit<T> {
    /// What is remembered: frames in use, the samples they reach, and where they lie. Refused where it is
    /// of frames of another layout or of another emission, or cannot be.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut delay = self.delay;
        self.history.state(state);
        self.drift.state(state);
        keep_wide(&mut self.x, state);
        keep_wide(&mut self.z, state);
        state.keep(&mut self.head).keep(&mut self.next);
        state.keep(&mut self.scale).keep(&mut self.sounds_until).keep(&mut self.unheard_from);
        state.keep(&mut self.fade_from).keep(&mut delay);
        let len = self.sum.len();
        let ahead = (len - 2 * self.framing.fft_len) as i64;
        let places = self.head.checked_add(len).is_some_and(|end| end <= self.x.len())
            && (-delay.max(0)..FAR).contains(&self.next)
            && self.history.get(0).is_none_or(|(newest, _)| newest.start <= self.next + ahead);
        // As far out as no addition to them runs over.
        let far = |t: i64| t != i64::MIN && !(-FAR..FAR).contains(&t);
        let places = places && ![self.sounds_until, self.unheard_from, self.fade_from].into_iter().any(far);
        let finite = self.x.iter().chain(&self.z).all(|&x| x >= -T::MAX && x <= T::MAX)
            && (2f64.powi(-100)..=2f64.powi(100)).contains(&self.scale);
        if state.restores() && !(delay == self.delay && places && finite && !state.failed()) {
            self.reset(0);
            state.refuse();
        }
    }
}
