//! The transient of a contact.

use asperity_dsp::filter::Sample;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::{EffectError, counted};

/// Most sinusoids of a transient.
const MAX_SINUSOIDS: usize = 8;
/// Taps that sound at a time.
const VOICES: usize = 4;
/// One more, that fades.
const SLOTS: usize = VOICES + 1;
/// Fade of a tap that makes room \[s\]. It is shorter than the least time between two taps.
const FADE_S: f64 = 1e-3;
/// Longest duration of a tap \[s\].
const LONGEST_S: f64 = 60.0;
/// Most samples of a recording.
const MAX_RECORDED: usize = 1 << 22;

/// One part of a transient: `gain v e^(-t / decay) sin(2 pi f t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecayingSinusoid {
    /// Frequency f \[Hz\], 1 to 0.45 of the audio rate.
    pub frequency_hz: f64,
    /// Time in which it falls to 1/e \[ms\], 0.1 to 100 000.
    pub decay_ms: f64,
    /// Acceleration per speed of approach \[(m/s^2)/(m/s)\], -10^5 to 10^5.
    pub gain: f64,
}

/// An acceleration that was recorded in one tap.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Samples \[m/s^2\].
    pub samples: Vec<f32>,
    /// Samples a second, 100 to 10^6.
    pub rate_hz: f64,
    /// Speed of approach at which it was recorded \[mm/s\], 0.1 to 10^4.
    pub speed_mm_s: f64,
}

/// Sound of a tap.
#[derive(Clone, Debug, PartialEq)]
pub enum Transient {
    /// Sinusoids that decay, added up: 1 to 8 (A. M. Okamura, J. T. Dennerlein, R. D. Howe, "Vibration
    /// feedback models for virtual environments", IEEE International Conference on Robotics and Automation,
    /// 1998).
    Sinusoids(Vec<DecayingSinusoid>),
    /// A recording, louder and softer in proportion to the speed (K. J. Kuchenbecker, J. Fiene, G. Niemeyer,
    /// "Improving contact realism through event-based haptic feedback", IEEE Transactions on Visualization
    /// and Computer Graphics 12, 2006). It is read between its samples along a Catmull-Rom cubic. Where it
    /// does not begin at 0, its first half millisecond is faded in. Its last two are faded out.
    Recorded(Recording),
}

/// Conditions under which a tap sounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TapSettings {
    /// Speed below which a contact does not sound \[mm/s\], 0 to 1000.
    pub min_speed_mm_s: f64,
    /// Speed above which a contact sounds no louder \[mm/s\], 1 to 10 000.
    pub max_speed_mm_s: f64,
    /// Least time from one tap to the next \[ms\], 2 to 1000.
    pub debounce_ms: f64,
    /// Level of the envelope below which a tap is over \[m/s^2\], 10^-6 to 1.
    pub floor_m_s2: f64,
}

impl Default for TapSettings {
    fn default() -> Self {
        Self { min_speed_mm_s: 2.0, max_speed_mm_s: 1000.0, debounce_ms: 20.0, floor_m_s2: 1e-3 }
    }
}

/// A sinusoid by its turn from one sample to the next.
#[derive(Clone, Copy, Debug, Default)]
struct Partial {
    /// e^(-1 / decay + j w), per sample.
    turn: [f64; 2],
    /// 1 / decay and w, per sample.
    decay: f64,
    turns: f64,
    gain: f64,
}

/// A recording as it is read.
#[derive(Clone, Debug, Default)]
struct Recorded {
    samples: Vec<f32>,
    /// The largest sample from here on.
    ahead: Vec<f32>,
    /// Its samples per audio sample.
    step: f64,
    /// Factor of 1 m/s.
    gain: f64,
}

/// A tap that sounds.
#[derive(Clone, Copy, Debug, Default)]
struct Voice {
    /// Sample in whose time it began, and how far in it, 0 to below 1.
    from: u64,
    part: f64,
    /// The next sample, and the one at which it is over.
    next: u64,
    end: u64,
    speed_m_s: f64,
    /// Samples of its fade that are left; 0 for none.
    fade: u32,
    /// Where its sinusoids are: e^((-1 / decay + j w) age).
    phasors: [[f64; 2]; MAX_SINUSOIDS],
}

impl Voice {
    fn sounds(&self) -> bool {
        self.next < self.end
    }

    /// Fades out over so many samples.
    fn release(&mut self, fade: u32) {
        self.fade = fade;
        self.end = self.end.min(self.next.saturating_add(u64::from(fade)));
    }

    fn age(&self, sample: u64) -> f64 {
        sample.saturating_sub(self.from) as f64 - self.part
    }
}

/// Contact transients, each scaled by the speed of its approach; they overlap, at most 4 at full level.
///
/// A tap begins from 0 at the given time, also between two samples. Its sinusoids turn by a recurrence in
/// f64, which stays within 1e-9 of the closed form over 10 s. The samples do not depend on how they are cut
/// into ticks. A tap ends exactly at the sample from which on its envelope stays below the floor. That sample
/// is known when it begins. Where more taps would sound, the quietest is faded out in a millisecond; of
/// equals, the oldest.
///
/// 96 samples of a tap of three sinusoids take 0.7 us on a virtual AMD EPYC core, of four such taps 2.1 us,
/// of none 6 ns; a strike takes 0.9 us.
#[derive(Clone, Debug)]
pub struct Taps {
    settings: TapSettings,
    partials: [Partial; MAX_SINUSOIDS],
    count: usize,
    recorded: Option<Recorded>,
    debounce: f64,
    fade: u32,
    longest: u64,
    slots: [Voice; SLOTS],
    last: Option<(u64, f64)>,
}

impl Taps {
    /// Taps at `rate_hz` samples a second.
    ///
    /// # Errors
    /// A value out of its range, no sinusoid or too many, a recording of fewer than 2 samples or with one
    /// that is not finite.
    pub fn new(transient: &Transient, settings: TapSettings, rate_hz: u32) -> Result<Self, EffectError> {
        let rate = EffectError::check("a rate", f64::from(rate_hz), (100.0, 1e6), "Hz")?;
        let s = &settings;
        EffectError::check("a least speed", s.min_speed_mm_s, (0.0, 1000.0), "mm/s")?;
        EffectError::check("a greatest speed", s.max_speed_mm_s, (1.0, 1e4), "mm/s")?;
        EffectError::check("a time between taps", s.debounce_ms, (2.0, 1000.0), "ms")?;
        EffectError::check("a floor", s.floor_m_s2, (1e-6, 1.0), "m/s^2")?;
        let mut tap = Self {
            settings,
            partials: [Partial::default(); MAX_SINUSOIDS],
            count: 0,
            recorded: None,
            debounce: 1e-3 * settings.debounce_ms * rate,
            fade: (FADE_S * rate).max(1.0) as u32,
            longest: (LONGEST_S * rate) as u64,
            slots: [Voice::default(); SLOTS],
            last: None,
        };
        match transient {
            Transient::Sinusoids(all) => {
                let gains = all.iter().map(|s| s.gain);
                EffectError::check_list("sinusoids", gains, (1, MAX_SINUSOIDS))?;
                for (partial, s) in tap.partials.iter_mut().zip(all) {
                    *partial = Partial::new(s, rate)?;
                }
                tap.count = all.len();
            }
            Transient::Recorded(recording) => tap.recorded = Some(Recorded::new(recording, rate)?),
        }
        Ok(tap)
    }

    /// Strikes a contact in sample `sample`, `part` of it (0 to below 1) after its beginning, at a speed of
    /// approach in mm/s. Returns whether it sounds. It does not if the speed is too low or not a number, or
    /// if the contact is too soon after the one before or earlier than that. A contact that comes too late
    /// begins with the first sample that is still to be made.
    pub fn strike(&mut self, sample: u64, part: f64, speed_mm_s: f64) -> bool {
        let part = counted(part).clamp(0.0, 1.0 - f64::EPSILON);
        if !(speed_mm_s.is_finite() && speed_mm_s > 0.0 && speed_mm_s >= self.settings.min_speed_mm_s) {
            return false;
        }
        if let Some((last, last_part)) = self.last {
            let since = sample.saturating_sub(last) as f64 + part - last_part;
            if sample < last || since < self.debounce {
                return false;
            }
        }
        let speed_m_s = 1e-3 * speed_mm_s.min(self.settings.max_speed_mm_s);
        let Some(length) = self.length(speed_m_s) else { return false };
        let Some(slot) = self.free_slot() else { return false };
        self.last = Some((sample, part));
        let (next, end) = (sample.saturating_add(u64::from(part > 0.0)), sample.saturating_add(length));
        let mut voice = Voice { from: sample, part, next, end, speed_m_s, ..Voice::default() };
        self.place(&mut voice);
        if let Some(slot) = self.slots.get_mut(slot) {
            *slot = voice;
        }
        true
    }

    /// Writes the samples in m/s^2 from number `first` on. Returns whether a tap continues after them.
    pub fn process<T: Sample>(&mut self, first: u64, out: &mut [T]) -> bool {
        let mut first = first;
        if !self.sounds() {
            out.fill(T::narrow(0.0));
            return false;
        }
        for out in out.chunks_mut(64) {
            let mut sum = [0.0; 64];
            for slot in 0..SLOTS {
                self.render(slot, first, &mut sum[..out.len()]);
            }
            for (out, x) in out.iter_mut().zip(sum) {
                *out = T::narrow(x);
            }
            first = first.saturating_add(out.len() as u64);
        }
        self.sounds()
    }

    /// Whether a tap still sounds.
    pub fn sounds(&self) -> bool {
        self.slots.iter().any(Voice::sounds)
    }

    /// Samples of the longest tap, that of the highest speed.
    pub fn longest(&self) -> u64 {
        self.length(1e-3 * self.settings.max_speed_mm_s).unwrap_or(0)
    }

    /// Fades out all taps in a millisecond.
    pub fn release(&mut self) {
        let fade = self.fade;
        for voice in self.slots.iter_mut().filter(|v| v.sounds() && v.fade == 0) {
            voice.release(fade);
        }
    }

    /// Ends all taps at once, and forgets the time of the last one.
    pub fn reset(&mut self) {
        self.slots = [Voice::default(); SLOTS];
        self.last = None;
    }

    /// Taps that sound. Taps of another transient continue from them with their own sinusoids.
    pub fn state(&mut self, state: &mut State<'_>) {
        for v in &mut self.slots {
            state.keep(&mut v.from).keep(&mut v.part).keep(&mut v.next).keep(&mut v.end);
            state.keep(&mut v.speed_m_s).keep(&mut v.fade).keep(&mut v.phasors);
        }
        state.keep(&mut self.last);
        if state.restores() {
            let sound = self.slots.iter().all(|v| {
                (0.0..1.0).contains(&v.part)
                    && (0.0..=1e4).contains(&v.speed_m_s)
                    && v.end.saturating_sub(v.from) <= self.longest
                    && v.fade <= self.fade
                    && v.phasors.iter().flatten().all(|p| p.abs() <= 2.0)
            });
            if !sound {
                self.reset();
            }
            state.require(sound);
        }
    }

    /// A place for a new tap. Where all are full, the quietest begins to fade. `None` where another still
    /// fades.
    fn free_slot(&mut self) -> Option<usize> {
        let free = self.slots.iter().position(|v| !v.sounds())?;
        let full = |v: &Voice| v.sounds() && v.fade == 0;
        if self.slots.iter().filter(|v| full(v)).count() >= VOICES {
            let louder = |a: &Voice, b: &Voice| {
                self.envelope(a).total_cmp(&self.envelope(b)).then(a.from.cmp(&b.from))
            };
            let all = self.slots.iter().enumerate().filter(|(_, v)| full(v));
            let quietest = all.min_by(|(_, a), (_, b)| louder(a, b)).map(|(i, _)| i)?;
            let fade = self.fade;
            self.slots.get_mut(quietest)?.release(fade);
        }
        Some(free)
    }

    /// Upper bound of a voice from now on \[m/s^2\].
    fn envelope(&self, voice: &Voice) -> f64 {
        self.bound(voice.age(voice.next).max(0.0)) * voice.speed_m_s
    }

    /// Upper bound of a tap of 1 m/s from this age on, in samples.
    fn bound(&self, age: f64) -> f64 {
        match &self.recorded {
            Some(r) => r.gain * f64::from(r.ahead.get((age * r.step) as usize).copied().unwrap_or(0.0)),
            None => {
                let partials = self.partials.iter().take(self.count);
                partials.map(|p| p.gain.abs() * (-p.decay * age).exp_e()).sum()
            }
        }
    }

    /// Samples until a tap of this speed is over; `None` where it is from the start.
    fn length(&self, speed_m_s: f64) -> Option<u64> {
        let floor = self.settings.floor_m_s2;
        let over = |age: u64| self.bound(age as f64) * speed_m_s < floor;
        if over(0) {
            return None;
        }
        let (mut sounds, mut silent) = (0, self.longest);
        while silent - sounds > 1 {
            let middle = sounds + (silent - sounds) / 2;
            if over(middle) { silent = middle } else { sounds = middle }
        }
        Some(silent)
    }

    /// Puts a voice's sinusoids where they are at its next sample.
    fn place(&self, voice: &mut Voice) {
        let age = voice.age(voice.next);
        for (phasor, p) in voice.phasors.iter_mut().zip(&self.partials) {
            let size = (-p.decay * age).exp_e();
            // Without the whole turns, of which there are many.
            let (sin, cos) = ((p.turns * age).fract() * std::f64::consts::TAU).sine_cosine();
            *phasor = [size * cos, size * sin];
        }
    }

    /// Adds a voice's samples from `first` on.
    fn render(&mut self, slot: usize, first: u64, sum: &mut [f64]) {
        let Some(mut voice) = self.slots.get(slot).copied() else { return };
        if !voice.sounds() {
            return;
        }
        if voice.next < first {
            self.catch_up(&mut voice, first);
        }
        let skip = usize::try_from(voice.next - first).unwrap_or(usize::MAX);
        let left = usize::try_from(voice.end.saturating_sub(voice.next)).unwrap_or(usize::MAX);
        let Some(sum) = sum.get_mut(skip..) else { return };
        let len = sum.len().min(left);
        for sum in &mut sum[..len] {
            let x = voice.speed_m_s * self.next_sample(&mut voice);
            let level = if voice.fade > 0 {
                voice.fade -= 1;
                f64::from(voice.fade + 1) / f64::from(self.fade)
            } else {
                1.0
            };
            *sum += level * x;
            voice.next += 1;
        }
        if let Some(slot) = self.slots.get_mut(slot) {
            *slot = voice;
        }
    }

    /// A sample of a tap of 1 m/s.
    #[inline(always)]
    fn next_sample(&self, voice: &mut Voice) -> f64 {
        if let Some(r) = &self.recorded {
            return r.gain * r.at(voice.age(voice.next) * r.step);
        }
        let mut x = 0.0;
        for (z, p) in voice.phasors.iter_mut().zip(&self.partials).take(self.count) {
            x += p.gain * z[1];
            *z = [z[0] * p.turn[0] - z[1] * p.turn[1], z[0] * p.turn[1] + z[1] * p.turn[0]];
        }
        x
    }

    /// Catches up a voice whose next sample has been passed over. One that has not begun begins now; another
    /// goes on later.
    fn catch_up(&self, voice: &mut Voice, first: u64) {
        let begun = voice.next > voice.from.saturating_add(u64::from(voice.part > 0.0));
        if begun {
            let passed = first - voice.next;
            voice.next = first;
            if voice.fade > 0 {
                voice.fade = u32::try_from(u64::from(voice.fade).saturating_sub(passed)).unwrap_or(0);
            }
        } else {
            voice.end = first.saturating_add(voice.end - voice.from);
            (voice.from, voice.part, voice.next) = (first, 0.0, first);
        }
        self.place(voice);
    }
}

impl Partial {
    fn new(s: &DecayingSinusoid, rate: f64) -> Result<Self, EffectError> {
        let frequency = EffectError::check("a tap's frequency", s.frequency_hz, (1.0, 0.45 * rate), "Hz")?;
        let decay_ms = EffectError::check("a tap's decay", s.decay_ms, (0.1, 1e5), "ms")?;
        let gain = EffectError::check("a tap's gain", s.gain, (-1e5, 1e5), "1/s")?;
        let (decay, turns) = (1e3 / (decay_ms * rate), frequency / rate);
        let (sin, cos) = (std::f64::consts::TAU * turns).sine_cosine();
        let size = (-decay).exp_e();
        Ok(Self { turn: [size * cos, size * sin], decay, turns, gain })
    }
}

impl Recorded {
    fn new(recording: &Recording, rate: f64) -> Result<Self, EffectError> {
        let all = &recording.samples;
        EffectError::check_list(
            "samples of a recording",
            all.iter().map(|x| f64::from(*x)),
            (2, MAX_RECORDED),
        )?;
        let own = EffectError::check("a recording's rate", recording.rate_hz, (100.0, 1e6), "Hz")?;
        let speed = EffectError::check("a recording's speed", recording.speed_mm_s, (0.1, 1e4), "mm/s")?;
        let mut samples = all.clone();
        let fade_in = if samples[0] == 0.0 { 0.0 } else { (5e-4 * own).max(1.0) };
        let fade_out = (2e-3 * own).max(1.0);
        let last = samples.len() - 1;
        for (n, x) in samples.iter_mut().enumerate() {
            let up = if (n as f64) < fade_in { n as f64 / fade_in } else { 1.0 };
            let down = ((last - n) as f64 / fade_out).min(1.0);
            *x *= (up * down) as f32;
        }
        // The cubic between two samples goes beyond them by less than their neighbours.
        let mut most = 0.0_f32;
        let mut ahead = vec![0.0; samples.len()];
        for n in (0..samples.len()).rev() {
            let near = samples.iter().skip(n.saturating_sub(1)).take(4);
            most = near.fold(most, |m, x| m.max(1.25 * x.abs()));
            ahead[n] = most;
        }
        Ok(Self { samples, ahead, step: own / rate, gain: 1e3 / speed })
    }

    /// The recording at a place between its samples.
    fn at(&self, place: f64) -> f64 {
        let (whole, t) = (place.floor(), place - place.floor());
        let at = |by: i64| {
            let index = usize::try_from(whole as i64 + by).ok();
            index.and_then(|i| self.samples.get(i)).map_or(0.0, |x| f64::from(*x))
        };
        // Before its first sample, the recording counts as a straight line.
        let a = if whole < 1.0 { 2.0 * at(0) - at(1) } else { at(-1) };
        let (b, c, d) = (at(0), at(1), at(2));
        b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)))
    }
}

#[cfg(test)]
#[path = "transient_tests.rs"]
mod tests;
