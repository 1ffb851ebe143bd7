//! Phase retrieval that commits to samples, not to frames: iterative, causal, with no latency of its own.
//!
//! The signal is kept around `t`, the first sample that is not emitted. Samples before `t` were emitted
//! and are frozen. Samples from `t` to the end of the newest frame are free, and keep the result of
//! earlier passes. When a frame comes, passes are made over the free samples, then a hop is emitted. An
//! emitted sample depends on no later frame. A pass does this:
//!
//! 1. Take some of the frames that reach beyond `t`, and window the signal at their positions.
//! 2. Give each bin of the transform the magnitude of the frame; bins that are not carried get 0.
//! 3. Transform back, and move the free samples to `(sum w y + e z) / (sum w^2 + e)`. This is the
//!    least-squares estimate of D. Griffin, J. Lim (IEEE Trans. ASSP 32(2), 1984, eq. 6) from the
//!    frames `y`. It falls back on the last value `z` where the windows `w` almost vanish.
//! 4. Start the next pass from a point further in the same direction, as in fast Griffin-Lim (N. Perraudin,
//!    P. Balazs, P. Sondergaard, WASPAA 2013). The free samples keep this momentum from frame to frame.
//!
//! Choices, and the figures behind them:
//!
//! * A pass uses the newest frame, and others spread over all that reach beyond `t`, at positions that
//!   differ from pass to pass. Fixed positions leave a tone's error at -50 dB instead of -80. The newest
//!   frames alone diverge for two tones and for smooth magnitudes.
//! * Momentum that ends with each frame costs 2 dB on noise and 5 dB on taps (3 passes).
//! * The newest hop starts from 0. Where the signal is still silent, phases are those of a sweep through the
//!   middle half of the window: from random ones two tones may take a second to find their beat.
//! * One angle that rotates all bins above 0 shows only in the magnitudes of the lowest three or four, so it
//!   converges slowly. Passes rotate the bins by the slope of the error over this angle: 40 bursts of 220 Hz
//!   a second come to -40.1 dB between 1.5 and 2.7 s (-37.9 without).
//! * Of 1, 3, 10, 30 and 100 thousandths for `e`, 3 does well at all emissions.
//!
//! `emission` says which samples are emitted when a frame comes: at 0 those from its start on, at -20 those
//! 20 hops later. An early sample is covered by fewer frames, so quality falls, while the output answers
//! sooner: a step from 1 to 2 in the magnitudes of a noise has shown by half after 55 ms at 0, 16 at -20 and
//! 10 at -25. At -20, the default, noise is 12 dB better than with `spsi`, and level and spectrum of smooth
//! magnitudes are within 0.5 and 1 dB. At -25 the texture has two stable results, depending on the seed; use
//! 5 x 6 with momentum 0.85. At -30 quality breaks down. 3 passes are as good as 5 for noise; 5 are better
//! for signals that start and stop. A network's magnitudes belong to no signal: for these 2 x 2 does as well
//! and follows a change sooner (`docs/tradeoff/REPORT.md`). Figures by setting are in
//! `docs/explanation/accuracy.md`. In f32 on one AVX-512 core (AMD EPYC) 5 x 5 takes 9 us a frame at N = 250
//! and 180 us at 4800.
//!
//! A stream fades in over a tenth of a window (longer where its first frame's window begins). A missing frame
//! is silence, so the signal fades out as the windows do.

mod drift;
mod history;
mod project;

use crate::float::phasor;
use crate::lanes::LANES;
use crate::magnitude::largest_of;
use crate::overlap_add::{TOO_EARLY, TOO_LATE};
use crate::random::uniform;
use crate::tape::Tape;
use crate::{Complex, Float, Framing, Refused, refuse};
use asperity_numbers::Elementary as _;
use asperity_state::State;
use drift::Drift;
use history::{History, largest, usable};
pub(crate) use project::Project;
use project::{Call, Projector};

/// Weight of a sample's last value relative to the squared windows, where those are small.
const INERTIA: f64 = 3e-3;

/// The same over the first window of a stream, where the few frames do not agree yet.
const FIRST_INERTIA: f64 = 0.1;

/// Passes within which each frame is used once on average, up to which any momentum is allowed. Beyond,
/// momentum is limited to the square of their ratio: 2 frames of 50 a pass allow 0.36.
const ROUND: f64 = 15.0;

/// Limit of emitted samples on the internal scale, where frames are near 1. The square of a sum of them
/// still fits into f32.
const LOUD: f64 = (1u64 << 40) as f64;

/// Limit of sample positions: millions of years at any rate.
const FAR: i64 = 1 << 61;

/// Amount of work and time of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Frames of a pass, 1 or more: the newest, and others spread over those that reach past the last sample.
    pub frames: usize,
    /// Passes for each new frame, 1 or more.
    pub passes: usize,
    /// Extrapolation of a pass in the direction of the one before, in [0, 1).
    pub momentum: f64,
    /// Time of emission in frames. 0: at the start of the newest frame. Negative: inside it (-25 is its
    /// centre at 50 frames a window). Positive: before its start.
    pub emission: i32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { frames: 5, passes: 5, momentum: 0.9, emission: -20 }
    }
}

/// Most frames in a pass, and most passes for a frame.
pub const MAX_WORK: usize = 100;

impl Settings {
    /// Checks the settings that do not depend on the framing.
    fn check(&self) -> Result<(), Refused> {
        if [self.frames, self.passes].iter().any(|&n| n == 0 || n > MAX_WORK) {
            return refuse(format!("frames and passes are 1 to {MAX_WORK}"));
        }
        if !(0.0..1.0).contains(&self.momentum) {
            return refuse("the momentum is not in [0, 1)");
        }
        Ok(())
    }
    /// `floor(emission * hop)` in samples, rounded towards 0. Emission is refused after the end of the newest
    /// frame, and more than ten windows before its start.
    pub fn delay(&self, framing: &Framing) -> Result<i64, Refused> {
        let samples = framing.start(u64::from(self.emission.unsigned_abs()));
        let samples = i64::try_from(samples).unwrap_or(i64::MAX);
        let n = framing.fft_len as i64;
        let delay = if self.emission < 0 { -samples } else { samples };
        if delay <= -n || delay > 10 * n {
            return refuse("samples can be emitted from the end of a window to ten windows before it");
        }
        Ok(delay)
    }
}

/// Turns a stream of magnitude frames into samples.
#[derive(Debug)]
pub struct SampleCommit<T> {
    framing: Framing,
    settings: Settings,
    seed: u64,
    /// Delay of the output in samples; negative is early.
    delay: i64,
    history: History<T>,
    projector: Projector<T>,
    drift: Drift<T>,
    /// Shortest hop in samples; the longest is at most one longer.
    hop: usize,
    /// Ages of the frames of a pass.
    chosen: Vec<u64>,
    /// The signal over `[next - fft_len, ..)`: itself, and extrapolated by momentum.
    x: Tape<T>,
    z: Tape<T>,
    /// Sums over the same samples, for one pass.
    sum: Vec<T>,
    weight: Vec<T>,
    /// Expected weight there for as many frames as a pass uses.
    expected: Vec<T>,
    /// Sum of squared windows a hop apart, from each position on.
    cover: Vec<T>,
    /// First sample that is not emitted, on the input's time axis.
    next: i64,
    /// Magnitudes and samples are stored divided by this power of two.
    scale: f64,
    /// End of the last frame that was not silent.
    sounds_until: i64,
    /// Start of the first frame. Samples from here to `fade_from` were never emitted.
    unheard_from: i64,
    /// First audible sample of the stream, and its fade-in.
    fade_from: i64,
    fade: Vec<T>,
    /// Additional fade-in from the first frame's start, where its window has little weight.
    rise: Vec<T>,
}

impl<T: Float> SampleCommit<T> {
    /// Plans transforms and allocates the frames in use. All random numbers are a function of `seed` and the
    /// frame number.
    ///
    /// # Errors
    /// A layout or settings that are refused.
    pub fn new(framing: Framing, settings: Settings, seed: u64) -> Result<Self, Refused> {
        framing.check()?;
        settings.check()?;
        let n = framing.fft_len;
        let delay = settings.delay(&framing)?;
        let (period, frames) = framing.period();
        let hop = usize::try_from(period / frames).unwrap_or(n).max(1);
        let ahead = usize::try_from(delay).unwrap_or(0) + 2 * (hop + 1);
        // Starts of the frames in use lie in an interval of this length.
        let reach = (n + ahead) as u64;
        let slots = usize::try_from(reach * frames / period + 2).unwrap_or(n);
        let len = 2 * n + ahead;
        let projector = Projector::new(&framing, seed);
        let mut cover: Vec<T> = projector.square().to_vec();
        for i in (0..n.saturating_sub(hop)).rev() {
            let next = cover[i + hop];
            cover[i] += next;
        }
        let mut new = Self {
            history: History::new(framing, slots),
            projector,
            drift: Drift::new(n, hop),
            cover,
            hop,
            chosen: Vec::with_capacity(slots),
            x: Tape::new(len),
            z: Tape::new(len),
            sum: vec![T::zero(); len],
            weight: vec![T::zero(); len],
            expected: vec![T::zero(); len],
            fade: fade(n.div_ceil(10)),
            rise: fade(n.div_ceil(4)),
            next: 0,
            scale: 1.0,
            sounds_until: i64::MIN,
            unheard_from: i64::MIN,
            fade_from: i64::MIN,
            framing,
            settings,
            seed,
            delay,
        };
        new.reset(0);
        Ok(new)
    }

    /// Layout of the frames.
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// Delay of the output in samples relative to an overlap-add: `floor(emission * hop)`; early if negative.
    pub fn delay(&self) -> i64 {
        self.delay
    }

    /// The settings.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Changes frames, passes and momentum from the next frame on. The emission stays. Bad settings change
    /// nothing.
    pub fn set_work(&mut self, settings: Settings) -> Result<(), Refused> {
        settings.check()?;
        self.settings = Settings { emission: self.settings.emission, ..settings };
        Ok(())
    }

    /// Whether the output is zero until the next frame.
    pub fn is_silent(&self) -> bool {
        self.next >= self.sounds_until
    }

    /// Whether no frame is held, as after a [`reset`](Self::reset).
    pub fn is_fresh(&self) -> bool {
        self.history.expected().is_none()
    }

    /// Forgets all frames; the next sample to be emitted is `start`.
    pub fn reset(&mut self, start: u64) {
        self.history.clear();
        self.drift.clear();
        self.x.clear();
        self.z.clear();
        self.next = self.content(start);
        self.scale = 1.0;
        (self.sounds_until, self.unheard_from, self.fade_from) = (i64::MIN, i64::MIN, i64::MIN);
    }

    fn content(&self, start: u64) -> i64 {
        i64::try_from(start).unwrap_or(i64::MAX).saturating_sub(self.delay)
    }

    /// Takes frame number `index`, which covers `fft_len` samples from `framing.start(index)` on, and
    /// refines the samples not emitted yet.
    ///
    /// `magnitudes` are amplitudes `2 |sum w x| / sum w` from bin 0. Those that are NaN, infinite or negative
    /// count as 0, as missing ones do; their number is returned. Frames skipped since the last are silent.
    ///
    /// # Errors
    /// A frame out of reach or out of order is not used.
    pub fn push<P: Float>(&mut self, index: u64, magnitudes: &[P]) -> Result<usize, Refused> {
        let n = self.framing.fft_len as i64;
        let start = i64::try_from(self.framing.start(index)).unwrap_or(i64::MAX);
        if start.saturating_add(n) <= self.next || self.history.expected().is_some_and(|next| index < next) {
            return refuse(TOO_LATE);
        }
        if start.saturating_sub(self.next) > self.sum.len() as i64 - 2 * n {
            return refuse(TOO_EARLY);
        }
        let magnitudes = magnitudes.get(..self.framing.bins).unwrap_or(magnitudes);
        let bad = magnitudes.iter().filter(|&&m| !usable(m)).count();
        // The sum over all bins stays finite.
        let most = P::of(largest_of::<P, T>() / (8 * (self.framing.bins + 1)) as f64);
        let peak = largest(magnitudes);
        let peak = if peak > most { most } else { peak };
        if self.is_fresh() {
            self.fade_from = self.next.max(start);
            self.unheard_from = start;
        } else {
            self.history.miss_until(index);
        }
        self.set_scale(peak.f64());
        // See `Projector::project` for the quarter.
        self.history.add_at(index, magnitudes, most, T::of(0.25 / self.scale));
        if peak > P::zero() {
            self.sounds_until = start + n;
        }
        self.refine();
        Ok(bad)
    }

    /// Keeps squares within single precision: divides everything by a power of two near the largest
    /// magnitude.
    fn set_scale(&mut self, peak: f64) {
        let held = self.history.peak().f64() * 4.0 * self.scale;
        let most = peak.max(held);
        if most <= 0.0 || (self.scale * 2f64.powi(-16)..=self.scale * 2f64.powi(16)).contains(&most) {
            return;
        }
        // Limited so that the inverse is a normal number too.
        let exponent = ((most.to_bits() >> 52) as i32 - 1023).clamp(-100, 100);
        let scale = 2f64.powi(exponent);
        let factor = self.scale / scale;
        self.scale = scale;
        self.history.rescale(factor);
        for v in [&mut self.x, &mut self.z] {
            v.iter_mut().for_each(|x| *x = rescaled(*x, factor));
        }
    }

    /// Makes the passes over the samples not emitted yet.
    fn refine(&mut self) {
        if self.is_silent() {
            return;
        }
        let origin = self.next - self.framing.fft_len as i64;
        let candidates = self.history.starting_after(origin);
        let Some((newest, _)) = self.history.get(0) else { return };
        // Within the buffers: a frame that starts too early was refused. A frame entirely behind them
        // has no effect any more.
        let Ok(at) = usize::try_from(newest.start.saturating_sub(origin)) else { return };
        let end = at.saturating_add(self.framing.fft_len);
        if end > self.sum.len() {
            return;
        }
        let share = (self.settings.frames as f64 / candidates.max(1) as f64).min(1.0);
        self.expect(candidates, share, at, end);
        let momentum = self.settings.momentum.min((ROUND * share).powi(2));
        let turn = self.turn(candidates, origin);
        for pass in 0..self.settings.passes {
            self.choose(candidates, pass);
            self.pass(origin, end, momentum, turn);
        }
    }

    /// Rotation of the bins in a pass, from a frame in the middle of those in use.
    fn turn(&mut self, candidates: u64, origin: i64) -> Complex<T> {
        let n = self.framing.fft_len as i64;
        let due = self.history.expected().is_some_and(|next| next.is_multiple_of(drift::EVERY));
        if let Some((slot, mags)) = self.history.get(candidates / 2)
            && due
            && slot.start >= origin.max(self.unheard_from.saturating_add(2 * n))
        {
            let at = (slot.start - origin) as usize;
            self.drift.hear(&self.x[at..at + self.framing.fft_len], mags, self.scale);
        }
        phasor(self.drift.turns())
    }

    /// Average weight of the frames of a pass: that of all, times the `share` that a pass uses. The newest
    /// starts at `at`.
    fn expect(&mut self, candidates: u64, share: f64, at: usize, end: usize) {
        let n = self.framing.fft_len;
        let share = T::of(share);
        let from = if self.unheard_from < self.next { 0 } else { n };
        let middle = at.clamp(from, end);
        self.expected[from..middle].fill(self.cover[0] * share);
        for (to, &cover) in self.expected[middle..end].iter_mut().zip(&self.cover[middle - at..]) {
            *to = cover * share;
        }
        // At a stream's start there are no frames before the first.
        let missing = usize::try_from(candidates).unwrap_or(n).saturating_mul(self.hop);
        for i in from..(at + n).saturating_sub(missing).min(end) {
            self.expected[i] -= self.cover[(i + missing).saturating_sub(at)] * share;
        }
    }

    /// Chooses the newest frame, and one from each of equal spans of time over the others, at positions that
    /// differ from pass to pass. A pass of one frame uses the newest in every second pass on average.
    fn choose(&mut self, candidates: u64, pass: usize) {
        self.chosen.clear();
        self.chosen.push(0);
        let (others, frames) = (candidates.saturating_sub(1), self.settings.frames as u64 - 1);
        if others <= frames {
            self.chosen.extend(1..candidates);
            return;
        }
        let shift = uniform(self.seed, self.history.expected().unwrap_or(0), pass as u64);
        if frames == 0 {
            if shift >= 0.5 {
                self.chosen[0] = 1 + ((2.0 * shift - 1.0) * others as f64) as u64;
            }
            return;
        }
        let span = others as f64 / frames as f64;
        self.chosen.extend((0..frames).map(|j| 1 + ((j as f64 + shift) * span) as u64));
    }

    /// Projects the chosen frames, rotated by `turn`, and moves the free samples to their weighted mean.
    fn pass(&mut self, origin: i64, end: usize, momentum: f64, turn: Complex<T>) {
        let n = self.framing.fft_len;
        let unheard = self.unheard(origin);
        let from = unheard.clone().map_or(n, |r| r.start);
        let (sum, weight) = (&mut self.sum[..end], &mut self.weight[..end]);
        sum[from..].fill(T::zero());
        weight[from..].fill(T::zero());
        let z = &mut self.z[..end];
        for some in self.chosen.chunks(LANES) {
            let mut sounding: [(usize, &[T]); LANES] = [(0, &[]); LANES];
            let mut count = 0;
            for &age in some {
                let Some((slot, mags)) = self.history.get(age) else { continue };
                let at = (slot.start - origin) as usize;
                // Free samples of the frame.
                let free = from.max(at)..at + n;
                let skip = free.start - at;
                add(&mut weight[free], &self.projector.square()[skip..]);
                if slot.peak > T::zero() {
                    sounding[count] = (at, mags);
                    count += 1;
                }
            }
            self.projector.project(Call { z, frames: &sounding[..count], from, sum, turn });
        }
        let x = &mut self.x[..end];
        let momentum = T::of(momentum);
        let inertia = T::of(if self.unheard_from > origin { FIRST_INERTIA } else { INERTIA });
        for range in [unheard.unwrap_or(0..0), n..end] {
            let (sum, weight) = (&sum[range.clone()], &weight[range.clone()]);
            let expected = &self.expected[range.clone()];
            step(&mut x[range.clone()], &mut z[range], [sum, weight, expected], momentum, inertia);
        }
    }

    /// Samples in view that have frames but were never emitted, because the first frame came too late.
    fn unheard(&self, origin: i64) -> Option<std::ops::Range<usize>> {
        let n = self.framing.fft_len as i64;
        let place = |sample: i64| sample.saturating_sub(origin).clamp(0, n);
        let range = place(self.unheard_from)..place(self.fade_from);
        (range.start < range.end).then_some(range.start as usize..range.end as usize)
    }

    /// Moves to `start` as the next sample. An earlier position, or one more than a window later, starts
    /// anew.
    pub fn seek(&mut self, start: u64) {
        let gap = self.content(start).saturating_sub(self.next);
        match usize::try_from(gap) {
            Ok(gap) if gap <= self.framing.fft_len => self.advance(gap),
            _ => self.reset(start),
        }
    }

    /// Takes out the samples `start .. start + out.len()`, in order (else see [`seek`](Self::seek)), after
    /// the frames that start among them. A missing frame is silence.
    pub fn emit<P: Float>(&mut self, start: u64, out: &mut [P]) {
        self.seek(start);
        let view = self.framing.fft_len;
        let mut end = start;
        // One hop at a time, so that no missing frame is out of reach.
        for block in out.chunks_mut(self.hop + 1) {
            end = end.saturating_add(block.len() as u64);
            self.miss(end);
            let scale = T::of(self.scale);
            let most = T::of(largest_of::<P, T>());
            for (i, (to, &x)) in block.iter_mut().zip(&self.x[view..]).enumerate() {
                *to = ((x * scale).limited(most) * self.fade_at(self.next + i as i64)).to();
            }
            self.advance(block.len());
        }
    }

    fn fade_at(&self, sample: i64) -> T {
        let gain = |from: i64, ramp: &[T]| {
            let past = usize::try_from(sample.saturating_sub(from));
            past.map_or(T::zero(), |i| ramp.get(i).copied().unwrap_or_else(T::one))
        };
        gain(self.fade_from, &self.fade) * gain(self.unheard_from, &self.rise)
    }

    /// Treats frames that should have come before sample `end` as silence.
    fn miss(&mut self, end: u64) {
        let Some(expected) = self.history.expected() else { return };
        if self.framing.start(expected) >= end {
            return;
        }
        if self.is_silent() {
            let next = self.next;
            self.reset(0);
            self.next = next;
            return;
        }
        let mut index = expected;
        while self.framing.start(index) < end {
            index += 1;
        }
        self.history.miss_until(index);
        self.refine();
    }

    /// Freezes samples, at most a window of them.
    fn advance(&mut self, count: usize) {
        let emitted = self.framing.fft_len..self.framing.fft_len + count;
        self.z[emitted.clone()].copy_from_slice(&self.x[emitted]);
        self.next += count as i64;
        self.x.advance(count);
        self.z.advance(count);
    }

    /// Saves or restores the frames in use, their samples and positions, for one layout and emission.
    pub fn state(&mut self, state: &mut State<'_>) {
        let mut delay = self.delay;
        self.history.state(state);
        self.drift.state(state);
        self.x.state(state);
        self.z.state(state);
        state.keep(&mut self.next);
        state.keep(&mut self.scale).keep(&mut self.sounds_until).keep(&mut self.unheard_from);
        state.keep(&mut self.fade_from).keep(&mut delay);
        let len = self.sum.len();
        let ahead = (len - 2 * self.framing.fft_len) as i64;
        let places = (-delay.max(0)..FAR).contains(&self.next)
            && self.history.get(0).is_none_or(|(newest, _)| newest.start <= self.next + ahead);
        // Positions to which additions do not overflow.
        let far = |t: i64| t != i64::MIN && !(-FAR..FAR).contains(&t);
        let places = places && ![self.sounds_until, self.unheard_from, self.fade_from].into_iter().any(far);
        let scale = (2f64.powi(-100)..=2f64.powi(100)).contains(&self.scale);
        if state.restores() && !(delay == self.delay && places && scale && !state.failed()) {
            self.reset(0);
            state.refuse();
        }
    }
}

/// Changes the scale, in double precision, since the factor may exceed single precision. Samples emitted long
/// ago may be far louder than any frame still held, so they are limited to [`LOUD`].
fn rescaled<T: Float>(x: T, factor: f64) -> T {
    T::of((x.f64() * factor).clamp(-LOUD, LOUD))
}

/// Half a raised cosine.
fn fade<T: Float>(len: usize) -> Vec<T> {
    let step = std::f64::consts::FRAC_PI_2 / len as f64;
    (0..len).map(|i| T::of(((i as f64 + 0.5) * step).sine().powi(2))).collect()
}

fn add<T: Float>(to: &mut [T], from: &[T]) {
    for (to, &x) in to.iter_mut().zip(from) {
        *to += x;
    }
}

/// Moves to the weighted mean of the frames and the last value, then extrapolates in the same direction. The
/// last value has the weight that the frames lack of the expected one, and at least `inertia`.
fn step<T: Float>(x: &mut [T], z: &mut [T], [sum, weight, expected]: [&[T]; 3], momentum: T, inertia: T) {
    let frames = sum.iter().zip(weight).zip(expected);
    for ((x, z), ((&sum, &weight), &expected)) in x.iter_mut().zip(z).zip(frames) {
        let least = weight + inertia;
        let all = if least > expected { least } else { expected };
        let new = *z + (sum - weight * *z) / all;
        *z = new + momentum * (new - *x);
        *x = new;
    }
}

#[cfg(test)]
mod tests;
