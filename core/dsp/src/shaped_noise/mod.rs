//! A texture without phase retrieval: noise, bumps and ridges through a filter that follows the magnitudes.
//!
//! A network answers expected magnitudes, which many signals have. Phase retrieval finds the signal
//! that fits them best, and at constant speed that signal repeats. This kernel draws a random one
//! instead, from an excitation and a filter, as speech is synthesised:
//!
//! * *Noise*, white and indexed by sample, is filtered at minimum phase with the newest frame as
//!   magnitude response (see [`Designer`]). A change of the frame is heard in the samples of its tick.
//! * *Bumps* replace the noise where the texture has some and the hand's position is known: white
//!   pulses at positions along the stroke. Their regularity decides how the envelope varies, their
//!   spacing how high they are.
//! * *Ridges* repeat with position: harmonic h of a wave k has the phase `2 pi h k . (x, y)`, so that
//!   it stops, turns and starts again with the hand.
//!
//! A harmonic takes the frame's power from half a pitch below it to half a pitch above it, so that the
//! level is kept where lines are closer than bins. The wave's weights divide it among neighbouring
//! harmonics, because a network blurs the gaps. The phase is that of the minimum-phase response of
//! these powers (as the vocoder STRAIGHT smooths over a pitch; H. Kawahara, I. Masuda-Katsuse, A. de
//! Cheveigne, Speech Communication 27, 1999), plus the ridge's own. For a hand that moves backwards the
//! phase is conjugated, since the response does not run backwards. Of two waves the one with the lower
//! ridge rate has less of the power: along its ridges only the other is felt.
//!
//! Taps and amplitudes change linearly within one tick and then stay for at least 4 ms, because finding
//! them costs most.

mod events;
mod pattern;
mod place;
mod response;
mod unblurred;

pub use pattern::{Events, HARMONICS, PATTERN_LEN, Pattern, WAVES, Wave};

use crate::float::keep_wide;
use crate::magnitude::{largest_of, take};
use crate::random::normal;
use crate::tape::Tape;
use crate::{Complex, Float, Framing, Refused};
use asperity_numbers::Elementary as _;
use asperity_numbers::unit_circle;
use asperity_state::State;
use events::{Bumps, at_ridges};
use place::Place;
use response::Designer;
use unblurred::Unblurred;

/// Most harmonics of a wave that are played: 8 Hz apart they reach 1000 Hz.
const MOST_LINES: usize = 128;
/// Time in seconds for which taps and lines stay. Faster changes are not heard.
const STAYS_S: f64 = 0.004;
/// Taps are updated this many times for one update of a wave's phases; the two waves take turns. A
/// pitch that changes by more than [`PITCH_CHANGES`] updates them sooner.
const PHASES_EVERY: u64 = 4;
/// Relative change of a pitch that updates its phases.
const PITCH_CHANGES: f64 = 0.03;
/// Lowest pitch with lines \[Hz\]. Below it the hand rests or moves along the ridges, and the part that
/// repeats fades out.
const LEAST_PITCH_HZ: f64 = 2.0;
/// Upper limit of frame and sample numbers in a restored state.
const LAST: u64 = 1 << 48;
/// Samples of lines computed at once.
const AT_ONCE: usize = 8;
/// Lanes of a sum.
const LANES: usize = 16;

/// Turns a stream of magnitude frames into samples.
#[derive(Debug)]
pub struct ShapedNoise<T> {
    framing: Framing,
    seed: u64,
    designer: Designer<T>,
    /// Root mean square magnitudes of the newest frame.
    magnitudes: Vec<T>,
    /// Buffer for the next frame's.
    came: Vec<T>,
    /// Number of the newest frame.
    newest: Option<u64>,
    /// Whether taps and lines follow the newest frame.
    followed: bool,
    /// Samples for which taps and lines stay, and the number of the period in which they were found.
    stays: u64,
    found_in: Option<u64>,
    pattern: Pattern,
    /// Waves to play once the lines of those in `pattern` have faded.
    coming: Option<[Option<Wave>; WAVES]>,
    place: Place,
    bumps: Bumps,
    /// Taps before and after the tick, newest sample last.
    taps: [Vec<T>; 2],
    /// The newest excitation.
    excitation: Tape<T>,
    /// Number of the sample behind it, if there is any.
    next: Option<u64>,
    waves: [Lines; WAVES],
    unblurred: Unblurred,
    /// Power density of the newest frame from 0 Hz to Nyquist's frequency, in squares of its unit per Hz.
    density: Vec<f64>,
    /// Integral of the density up to each of these frequencies.
    sums: Vec<f64>,
    /// Density of the part without lines.
    squares: Vec<f64>,
    /// Density of a wave's lines, smoothed over a pitch.
    smooth: Vec<f64>,
    /// Power of each harmonic of a wave, from the fundamental on.
    powers: Vec<f64>,
    /// Length of the way since samples were last made, and its start, in mm.
    way_mm: f64,
    from_mm: [f64; 2],
    silent: bool,
}

/// The lines of a wave.
#[derive(Clone, Debug)]
struct Lines {
    /// Amplitude and phase of each line, before and after the tick.
    at: [Vec<Complex<f64>>; 2],
    count: [usize; 2],
    /// Minimum-phase phases, and the pitch for which they were found; 0 if none were.
    units: Vec<Complex<f64>>,
    units_hz: f64,
}

impl<T: Float> ShapedNoise<T> {
    /// Allocates buffers and plans transforms. Positions come every `tick_s` seconds. All random numbers are
    /// a function of `seed` and the sample number.
    pub fn new(framing: Framing, tick_s: f64, seed: u64) -> Result<Self, Refused> {
        framing.check()?;
        let n = framing.fft_len;
        let longest = (f64::from(framing.rate_hz) * tick_s).ceil() as usize + 2;
        let lines = Lines {
            at: [0, 1].map(|_| vec![Complex::default(); MOST_LINES]),
            count: [0; 2],
            units: vec![Complex::default(); MOST_LINES],
            units_hz: 0.0,
        };
        Ok(Self {
            framing,
            seed,
            designer: Designer::new(n),
            magnitudes: vec![T::zero(); framing.bins],
            came: vec![T::zero(); framing.bins],
            newest: None,
            followed: false,
            stays: ((f64::from(framing.rate_hz) * STAYS_S) as u64).max(1),
            found_in: None,
            pattern: Pattern::default(),
            coming: None,
            place: Place::new(tick_s),
            bumps: Bumps::new(seed),
            taps: [0, 1].map(|_| vec![T::zero(); n]),
            excitation: Tape::new(2 * n + longest),
            next: None,
            waves: std::array::from_fn(|_| lines.clone()),
            unblurred: Unblurred::new(framing.bins),
            density: vec![0.0; n + 1],
            sums: vec![0.0; n + 1],
            squares: vec![0.0; n + 1],
            smooth: vec![0.0; n + 1],
            powers: Vec::with_capacity(MOST_LINES),
            way_mm: 0.0,
            from_mm: [0.0; 2],
            silent: true,
        })
    }

    /// Layout of the frames.
    pub fn framing(&self) -> Framing {
        self.framing
    }

    /// Whether the output is silent until a frame comes.
    pub fn is_silent(&self) -> bool {
        self.silent
    }

    /// Whether no frame is held.
    pub fn is_fresh(&self) -> bool {
        self.newest.is_none()
    }

    /// Forgets everything but the pattern.
    pub fn reset(&mut self) {
        self.magnitudes.fill(T::zero());
        (self.newest, self.next, self.followed) = (None, None, false);
        self.found_in = None;
        self.taps.iter_mut().for_each(|taps| taps.fill(T::zero()));
        for wave in &mut self.waves {
            (wave.count, wave.units_hz) = ([0; 2], 0.0);
            wave.units.fill(Complex::default());
            wave.at.iter_mut().for_each(|at| at.fill(Complex::default()));
        }
        self.silent = true;
        self.begin();
    }

    /// Forgets the hand's position and its distance from ridges and bumps.
    fn begin(&mut self) {
        self.place.reset();
        self.bumps.reset();
        (self.way_mm, self.from_mm, self.next) = (0.0, [0.0; 2], None);
    }

    /// Sets ridges and bumps. Lines that are playing fade within a tick, then the new ones start.
    pub fn set_pattern(&mut self, pattern: Pattern) {
        self.pattern.events = pattern.events;
        let same = pattern.waves == self.pattern.waves;
        self.coming = (!same).then_some(pattern.waves);
        self.followed &= same;
        if self.waves.iter().all(|lines| lines.count == [0; 2]) {
            self.change_waves();
        }
    }

    /// Starts the coming waves.
    fn change_waves(&mut self) {
        if let Some(waves) = self.coming.take() {
            (self.pattern.waves, self.followed) = (waves, false);
            self.waves.iter_mut().for_each(|lines| lines.units_hz = 0.0);
        }
    }

    /// Takes frame number `index`. `magnitudes` are amplitudes: `ratio`, 0.1 to 1, times the root mean
    /// square. Those that are NaN, infinite or negative count as 0, as missing ones do; their number is
    /// returned.
    pub fn push<P: Float>(&mut self, index: u64, magnitudes: &[P], ratio: f64) -> usize {
        // Sums over all bins stay finite, and so do sums of squares in double precision.
        let most = (largest_of::<P, T>() / (64.0 * (self.framing.fft_len + 1) as f64)).min(1e150);
        let bad = take(magnitudes, most, &mut self.came);
        let level = T::of(ratio.clamp(0.1, 1.0).recip());
        self.came.iter_mut().for_each(|m| *m *= level);
        // An equal frame needs no new filter; lines follow the hand in any case.
        let same = self.came == self.magnitudes && self.pattern.waves == [None; WAVES];
        std::mem::swap(&mut self.came, &mut self.magnitudes);
        (self.newest, self.followed) = (Some(index), self.followed && same);
        bad
    }

    /// Computes one tick: `place` is the hand's position in mm, if known, and `out` gets the samples
    /// from `start` on. Samples beyond two windows and a tick are 0.
    pub fn emit<P: Float>(&mut self, start: u64, place: Option<[f64; 2]>, out: &mut [P]) {
        if let Some(place) = place {
            match self.place.step(place) {
                Some(way) => self.way_mm += way[0].hypotenuse(way[1]),
                None => self.from_mm = self.place.at(),
            }
        }
        if out.is_empty() {
            return;
        }
        // A missing frame is silence.
        let late = self.newest.is_some_and(|newest| start > self.framing.start(newest.saturating_add(1)));
        if late {
            self.magnitudes.fill(T::zero());
            (self.newest, self.followed) = (None, false);
        }
        let period = start / self.stays;
        let changes = !self.followed && (self.silent || self.found_in != Some(period));
        if changes {
            self.found_in = Some(period);
            self.follow(place.is_some());
        }
        if self.silent {
            out.fill(P::zero());
            // Same result as if the kernel had slept, so that calls during silence change nothing after
            // it. A hand at rest on ridges is silent too, but is not forgotten.
            if self.magnitudes.iter().all(|m| *m == T::zero()) {
                self.begin();
            } else {
                (self.way_mm, self.from_mm) = (0.0, self.place.at());
            }
            self.next = None;
            return;
        }
        let room = self.excitation.len() - self.framing.fft_len;
        let (out, beyond) = out.split_at_mut(out.len().min(room));
        beyond.fill(P::zero());
        let from = self.excite(start, place.is_some(), out.len());
        let [before, after] = &self.taps;
        let n = self.framing.fft_len;
        let part = 1.0 / out.len() as f64;
        for (i, out) in out.iter_mut().enumerate() {
            let past = &self.excitation[from + i + 1 - n..from + i + 1];
            let new = dot(after, past);
            let x = if changes {
                let old = dot(before, past);
                old + (new - old) * T::of((i + 1) as f64 * part)
            } else {
                new
            };
            *out = x.to();
        }
        if place.is_some() {
            self.play(out);
        }
        (self.way_mm, self.from_mm) = (0.0, self.place.at());
        if changes {
            self.settle();
        }
    }

    /// Bumps with a spacing of their own, and the way in spacings since samples were last made.
    fn spacings(&self) -> Option<(Events, f64)> {
        let events = self.pattern.events?;
        Some((events, self.way_mm / events.spacing_at(self.place.velocity())?))
    }

    /// Start and end of the hand's way since samples were last made, in turns of wave `w`.
    fn turned(&self, w: usize) -> Option<(f64, f64)> {
        let wave = self.pattern.waves[w]?;
        let turns = |[x, y]: [f64; 2]| wave.per_mm[0] * x + wave.per_mm[1] * y;
        Some((turns(self.from_mm), turns(self.place.at())))
    }

    /// Starts the next tick with the taps and lines with which this one ends.
    fn settle(&mut self) {
        let [before, after] = &mut self.taps;
        before.copy_from_slice(after);
        for wave in &mut self.waves {
            let [before, after] = &mut wave.at;
            before.copy_from_slice(after);
            wave.count[0] = wave.count[1];
        }
        let lines = self.waves.iter().any(|wave| wave.count[0] > 0);
        self.followed = true;
        self.silent = !lines && self.magnitudes.iter().all(|m| *m == T::zero());
        self.change_waves();
    }
    /// Computes taps and lines for the newest frame.
    fn follow(&mut self, placed: bool) {
        self.spread();
        self.squares.copy_from_slice(&self.density);
        let sounds = self.density.iter().any(|power| *power > 0.0);
        if placed && self.pattern.waves != [None; WAVES] {
            integrate(&self.density, self.step_hz(), &mut self.sums);
        }
        for w in 0..WAVES {
            let wave = self.pattern.waves[w].filter(|_| placed && sounds && self.coming.is_none());
            self.waves[w].count[1] = wave.map_or(0, |wave| self.ridges(w, &wave));
            let count = self.waves[w].count[1];
            self.waves[w].at[1][count..].fill(Complex::default());
        }
        // White noise of variance 1 through the taps has the magnitudes sqrt(6 / N) of the response.
        let square = 0.5 * f64::from(self.framing.rate_hz);
        self.squares.iter_mut().for_each(|s| *s *= square);
        self.designer.design(&self.squares);
        self.designer.taps(&mut self.taps[1]);
        let sounds = |taps: &[T]| taps.iter().any(|t| *t != T::zero());
        let lines = self.waves.iter().any(|wave| wave.count != [0; 2]);
        self.silent = !(sounds(&self.taps[0]) || sounds(&self.taps[1]) || lines);
    }

    /// Computes the power density of the newest frame.
    fn spread(&mut self) {
        // Factor from a squared amplitude to a power per bin.
        let bin_hz = f64::from(self.framing.rate_hz) / self.framing.fft_len as f64;
        self.unblurred.find(&self.magnitudes, 1.0 / (3.0 * bin_hz), &mut self.density);
    }

    /// Minimum-phase phases that ridges get from the newest frame, as complex numbers of size 1: one for each
    /// harmonic of a pitch, for a hand that moves forwards, without the wave's own phases.
    pub fn ridge_phases(&mut self, pitch_hz: f64, weights: &[f64; HARMONICS], phases: &mut [Complex<f64>]) {
        phases.fill(Complex::new(1.0, 0.0));
        if self.divided(pitch_hz, weights) {
            self.respond(pitch_hz);
            for (h, phase) in phases.iter_mut().enumerate() {
                *phase = self.unit_at((h + 1) as f64 * pitch_hz);
            }
        }
    }

    /// Powers that the harmonics of a pitch get from the newest frame if all weights are 1.
    pub fn ridge_powers(&mut self, pitch_hz: f64, powers: &mut [f64]) {
        powers.fill(0.0);
        if self.divided(pitch_hz, &[1.0; HARMONICS]) {
            powers.iter_mut().zip(&self.powers).for_each(|(to, power)| *to = *power);
        }
    }

    /// Divides the newest frame's power among the harmonics of a pitch, unless that is too low.
    fn divided(&mut self, pitch_hz: f64, weights: &[f64; HARMONICS]) -> bool {
        let played = pitch_hz >= LEAST_PITCH_HZ;
        if played {
            self.spread();
            integrate(&self.density, self.step_hz(), &mut self.sums);
            self.divide(pitch_hz, weights);
        }
        played
    }

    /// Frequency step of the density in Hz.
    fn step_hz(&self) -> f64 {
        0.5 * f64::from(self.framing.rate_hz) / self.framing.fft_len as f64
    }
    /// Divides the frame's power, whose integral is in `sums`, among the harmonics of a pitch. Each
    /// gets its weight times the power around it; then all are scaled to the total power around them.
    fn divide(&mut self, pitch_hz: f64, weights: &[f64; HARMONICS]) {
        let step_hz = self.step_hz();
        let count = ((self.top_hz() / pitch_hz) as usize).min(MOST_LINES);
        let below = |h: usize| below(&self.density, &self.sums, step_hz, (h as f64 + 0.5) * pitch_hz);
        let (mut up_to, mut given, mut all) = (below(0), 0.0, 0.0);
        self.powers.clear();
        for h in 1..=count {
            let next = below(h);
            let around = (next - up_to).max(0.0);
            up_to = next;
            let power = weights.get(h - 1).copied().unwrap_or(1.0) * around;
            self.powers.push(power);
            (given, all) = (given + power, all + around);
        }
        if given > 0.0 {
            self.powers.iter_mut().for_each(|power| *power *= all / given);
        }
    }

    /// Computes the minimum-phase response of the powers of a pitch, which are interpolated linearly
    /// between harmonics.
    fn respond(&mut self, pitch_hz: f64) {
        let step_hz = self.step_hz();
        let last = self.powers.last().copied().unwrap_or(0.0);
        let power = |h: usize| self.powers.get(h).copied().unwrap_or(last);
        // Up to the first harmonic, then from each to the next.
        let end = self.smooth.len();
        let reach = |h: usize| ((h as f64 * pitch_hz / step_hz) as usize + 1).min(end);
        let mut from = reach(1);
        self.smooth[..from].fill(power(0));
        for h in 1..self.powers.len() {
            let (to, below, slope) = (reach(h + 1), power(h - 1), power(h) - power(h - 1));
            for (j, smooth) in self.smooth[from..to].iter_mut().enumerate() {
                *smooth = below + ((from + j) as f64 * step_hz / pitch_hz - h as f64) * slope;
            }
            from = to;
        }
        self.smooth[from..].fill(last);
        self.designer.design(&self.smooth);
    }

    /// End of the band in Hz.
    fn top_hz(&self) -> f64 {
        self.step_hz() * 2.0 * (self.framing.bins as f64 - 0.5)
    }

    /// Updates the phases of a wave's lines when they are due: they change little, and cost most.
    fn find_phases(&mut self, w: usize, pitch_hz: f64) {
        let turn = self.found_in.is_some_and(|n| n % PHASES_EVERY == w as u64 * PHASES_EVERY / WAVES as u64);
        let known = self.waves[w].units_hz;
        if turn || (pitch_hz - known).abs() > PITCH_CHANGES * known {
            self.respond(pitch_hz);
            for h in 1..=self.powers.len() {
                self.waves[w].units[h - 1] = self.unit_at(h as f64 * pitch_hz);
            }
            self.waves[w].units_hz = pitch_hz;
        }
    }

    /// Phase of the response at a frequency.
    fn unit_at(&self, hz: f64) -> Complex<f64> {
        let at = (hz / self.step_hz()).min((self.sums.len() - 1) as f64);
        let at = (at + 0.5) as usize;
        let response = self.designer.response()[at];
        let response = Complex::new(response.re.f64(), response.im.f64());
        if asperity_numbers::size(response) > 0.0 {
            response / asperity_numbers::size(response)
        } else {
            Complex::new(1.0, 0.0)
        }
    }

    /// Ridge rate of each wave in Hz; negative for a hand that moves backwards.
    fn pitches(&self) -> [f64; WAVES] {
        let velocity = self.place.velocity();
        self.pattern
            .waves
            .map(|wave| wave.map_or(0.0, |w| w.per_mm[0] * velocity[0] + w.per_mm[1] * velocity[1]))
    }

    /// Share of the power around a wave's harmonic that belongs to the wave. Shares apply to a hand that
    /// crosses all waves at one rate. A wave's contribution at one frequency is taken to grow with the
    /// square of its pitch: along its ridges only the other wave is felt.
    fn part(&self, w: usize, h: usize, pitches: &[f64; WAVES]) -> f64 {
        let hz = h as f64 * pitches[w].abs();
        let fastest = pitches.iter().fold(0.0, |most: f64, hz| most.max(hz.abs()));
        let (mut own, mut all, mut random) = (0.0, 0.0, 1.0);
        for (v, wave) in self.pattern.waves.iter().enumerate() {
            let Some(wave) = wave else { continue };
            let harmonic = if v == w { h } else { (hz / pitches[v].abs()).round() as usize };
            let share = wave.shares[harmonic.clamp(1, HARMONICS) - 1];
            let felt = if fastest > 0.0 { share * (pitches[v] / fastest).powi(2) } else { share };
            (all, random) = (all + felt, random - share);
            if v == w {
                own = felt;
            }
        }
        if own > 0.0 { own / (all + random.max(0.0)) } else { 0.0 }
    }

    /// Computes the lines of a wave at the hand's velocity, and takes their power from `squares`.
    /// Returns the number of lines.
    fn ridges(&mut self, w: usize, wave: &Wave) -> usize {
        let pitches = self.pitches();
        let pitch_hz = pitches[w].abs();
        let step_hz = self.step_hz();
        if pitch_hz < LEAST_PITCH_HZ {
            let left = 1.0 - self.part(w, 1, &pitches) * (1.0 - pitch_hz / LEAST_PITCH_HZ);
            self.squares.iter_mut().for_each(|square| *square *= left);
        }
        if !(LEAST_PITCH_HZ..=self.top_hz()).contains(&pitch_hz) {
            return 0;
        }
        self.divide(pitch_hz, &wave.weights);
        let count = self.powers.len();
        self.find_phases(w, pitch_hz);
        let backwards = pitches[w] < 0.0;
        // Lines replace noise up to half a pitch from each harmonic.
        let end =
            |h: usize| (((h as f64 + 0.5) * pitch_hz / step_hz).ceil() as usize).min(self.density.len());
        let mut from = end(0);
        for h in 1..=count {
            let part = self.part(w, h, &pitches);
            let unit = self.waves[w].units[h - 1];
            let unit = if backwards { unit.conj() } else { unit };
            let amplitude = (2.0 * part * self.powers[h - 1]).sqrt();
            self.waves[w].at[1][h - 1] = unit * wave.turns[h.min(HARMONICS) - 1] * amplitude;
            let to = end(h);
            let around = self.squares[from..to].iter_mut().zip(&self.density[from..to]);
            around.for_each(|(square, density)| *square = (*square - part * density).max(0.0));
            from = to;
        }
        count
    }

    /// Appends the excitation of `count` samples. Returns their first index in `excitation`.
    fn excite(&mut self, start: u64, placed: bool, count: usize) -> usize {
        let n = self.framing.fft_len;
        let events = self.pattern.events.filter(|_| placed);
        let spacings = self.spacings().filter(|_| placed);
        // Of two waves the hand meets the ridges of the one that it crosses faster.
        let crossed = |(from, to): &(f64, f64)| (to - from).abs();
        let turned = (0..WAVES).filter_map(|w| self.turned(w));
        let turned = turned.max_by(|a, b| crossed(a).total_cmp(&crossed(b)));
        if self.next != Some(start) {
            // Before that there was noise, and no bump.
            let past = self.excitation.len() - n;
            for (i, x) in self.excitation[past..].iter_mut().enumerate() {
                let sample = (start + i as u64).checked_sub(n as u64).filter(|_| events.is_none());
                *x = sample.map_or(T::zero(), |sample| T::of(normal(self.seed, sample)));
            }
        }
        self.excitation.advance(count);
        let from = self.excitation.len() - count;
        let new = &mut self.excitation[from..];
        let rate_hz = f64::from(self.framing.rate_hz);
        if let Some((events, way)) = spacings {
            self.bumps.fill(start, rate_hz, way, &events, new);
        } else {
            for (i, x) in new.iter_mut().enumerate() {
                *x = T::of(normal(self.seed, start + i as u64));
            }
            if let Some((events, turned)) = events.zip(turned) {
                at_ridges(self.seed, rate_hz, turned, &events, new);
            }
        }
        self.next = Some(start + count as u64);
        from
    }

    /// Adds the lines of the waves.
    fn play<P: Float>(&mut self, out: &mut [P]) {
        let part = 1.0 / out.len() as f64;
        for w in 0..WAVES {
            let Some((from, to)) = self.turned(w) else { continue };
            let (way, lines) = (to - from, &self.waves[w]);
            let count = lines.count[0].max(lines.count[1]);
            let [before, after] = &lines.at;
            if count == 0 {
                continue;
            }
            for (chunk, out) in out.chunks_mut(AT_ONCE).enumerate() {
                let reached: [f64; AT_ONCE] =
                    std::array::from_fn(|i| (chunk * AT_ONCE + i + 1) as f64 * part);
                // As `fract`, without a call. An `i64` holds far more turns than occur.
                let first =
                    reached.map(|reached| from + way * reached).map(|turns| turns - turns as i64 as f64);
                let first = first.map(unit_circle);
                let (mut turned, mut sums) = (first, [0.0; AT_ONCE]);
                for (a, b) in before.iter().zip(after).take(count) {
                    let step = b - a;
                    // All samples at once, since each rotation depends on the one before.
                    for i in 0..AT_ONCE {
                        let (re, im) = (a.re + step.re * reached[i], a.im + step.im * reached[i]);
                        let ((cos, sin), (by_cos, by_sin)) = (turned[i], first[i]);
                        sums[i] += re * cos - im * sin;
                        turned[i] = (cos * by_cos - sin * by_sin, cos * by_sin + sin * by_cos);
                    }
                }
                out.iter_mut().zip(sums).for_each(|(out, sum)| *out += P::of(sum));
            }
        }
    }

    /// Saves or restores the newest frame, taps, lines, excitation, pattern and position.
    pub fn state(&mut self, state: &mut State<'_>) {
        keep_wide(&mut self.magnitudes, state);
        self.taps.iter_mut().for_each(|taps| keep_wide(taps, state));
        self.excitation.state(state);
        state.keep(&mut self.newest).keep(&mut self.followed).keep(&mut self.found_in);
        state.keep(&mut self.next).keep(&mut self.way_mm).keep(&mut self.from_mm).keep(&mut self.silent);
        for lines in &mut self.waves {
            state.keep(&mut lines.count).keep(&mut lines.units_hz);
            for line in lines.units.iter_mut().chain(lines.at.iter_mut().flatten()) {
                state.keep(line);
            }
        }
        state.keep(&mut self.pattern).keep(&mut self.coming);
        self.place.state(state);
        self.bumps.state(state);
        let finite = |values: &[T]| values.iter().all(|x| x.finite());
        let lines = self.waves.iter().all(|lines| {
            let mut all = lines.units.iter().chain(lines.at.iter().flatten());
            all.all(|c| c.re.is_finite() && c.im.is_finite())
                && lines.units_hz.is_finite()
                && lines.count.iter().all(|n| *n <= MOST_LINES)
        });
        let fine = self.way_mm.is_finite()
            && self.from_mm.iter().all(|x| x.abs() < 1e12)
            && [self.newest, self.next].into_iter().flatten().all(|number| number < LAST)
            && [&self.magnitudes, &self.taps[0], &self.taps[1]].into_iter().all(|v| finite(v))
            && lines;
        if state.restores() && (!fine || state.failed()) {
            self.reset();
            (self.pattern, self.coming) = (Pattern::default(), None);
            state.refuse();
        }
    }
}

/// Sum of products, in lanes.
fn dot<T: Float>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::zero(); LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest = rest.fold(T::zero(), |sum, (&a, &b)| sum + a * b);
    for (a, b) in a.zip(b) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.into_iter().fold(rest, |sum, x| sum + x)
}

/// Integral of a density that is linear between frequencies `step_hz` apart, up to each of them.
fn integrate(density: &[f64], step_hz: f64, sums: &mut [f64]) {
    let (mut sum, mut last) = (0.0, None);
    for (to, &density) in sums.iter_mut().zip(density) {
        sum += last.map_or(0.0, |last: f64| 0.5 * (last + density) * step_hz);
        (*to, last) = (sum, Some(density));
    }
}

/// The same integral up to any frequency from 0 on.
fn below(density: &[f64], sums: &[f64], step_hz: f64, hz: f64) -> f64 {
    let place = (hz / step_hz).min((sums.len() - 1) as f64);
    let at = (place as usize).min(sums.len() - 2);
    let part = place - at as f64;
    sums[at] + step_hz * part * (density[at] + 0.5 * part * (density[at + 1] - density[at]))
}

#[cfg(test)]
mod tests;
