//! The transient of a contact.

use asperity_dsp::filter::Sample;
use asperity_numbers::Elementary as _;
use asperity_state::State;

use crate::effects::bounds::{check, check_list, counted};

/// Most sinusoids of a transient.
const MAX_SINUSOIDS: usize = 8;
/// Taps that sound at a time at full level.
const FULL: usize = 8;
/// Places for taps: those, and some that fade.
const VOICES: usize = FULL + 4;
/// Recent strikes that are remembered, of one slot each.
const STRIKES: usize = 12;
/// Fade of a tap that makes room \[s\]. It is shorter than the least time between two taps of a slot.
const FADE_S: f64 = 1e-3;
/// Longest duration of a tap \[s\].
const LONGEST_S: f64 = 60.0;
/// Most samples of a recording.
const MAX_RECORDED: usize = 1 << 22;

/// One part of a transient: `gain v e^(-t / decay) sin(2 pi f t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DecayingSinusoid {
    pub frequency_hz: f64,
    pub decay_ms: f64,
    /// Acceleration per speed of approach \[(m/s^2)/(m/s)\].
    pub gain: f64,
}

/// An acceleration that was recorded in one tap.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Recording {
    /// In m/s^2.
    pub samples: Vec<f32>,
    pub rate_hz: f64,
    /// Speed of approach at which it was recorded.
    pub speed_mm_s: f64,
}

/// Sound of a tap.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Transient {
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
pub(crate) struct TapSettings {
    /// A slower contact does not sound.
    pub min_speed_mm_s: f64,
    /// A faster contact sounds no louder.
    pub max_speed_mm_s: f64,
    /// Least time from one tap to the next, 2 or more.
    pub debounce_ms: f64,
    /// Level of the envelope below which a tap is over.
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

/// The sound of a slot's taps at an audio rate.
#[derive(Clone, Debug)]
pub(crate) struct Sound {
    settings: TapSettings,
    partials: Vec<Partial>,
    recorded: Option<Recorded>,
    debounce: f64,
    longest: u64,
}

impl Sound {
    /// Taps at `rate_hz` samples a second. There are 1 to 8 sinusoids, of up to 0.45 of the rate, or 2
    /// samples or more.
    pub(crate) fn new(transient: &Transient, settings: TapSettings, rate_hz: u32) -> Result<Self, String> {
        let rate = f64::from(rate_hz);
        let (partials, recorded) = match transient {
            Transient::Sinusoids(all) => {
                check_list("sinusoids", all.iter().map(|s| s.gain), (1, MAX_SINUSOIDS))?;
                (all.iter().map(|s| Partial::new(s, rate)).collect::<Result<_, _>>()?, None)
            }
            Transient::Recorded(recording) => (Vec::new(), Some(Recorded::new(recording, rate)?)),
        };
        let debounce = 1e-3 * settings.debounce_ms * rate;
        Ok(Self { settings, partials, recorded, debounce, longest: (LONGEST_S * rate) as u64 })
    }

    /// Samples of the longest tap, that of the highest speed.
    pub(crate) fn longest(&self) -> u64 {
        self.length(1e-3 * self.settings.max_speed_mm_s).unwrap_or(0)
    }

    /// Upper bound of a tap of 1 m/s from this age on, in samples.
    fn bound(&self, age: f64) -> f64 {
        match &self.recorded {
            Some(r) => r.gain * f64::from(r.ahead.get((age * r.step) as usize).copied().unwrap_or(0.0)),
            None => self.partials.iter().map(|p| p.gain.abs() * (-p.decay * age).exp_e()).sum(),
        }
    }

    /// Samples until a tap of this speed is over; `None` where it is from the start.
    fn length(&self, speed_m_s: f64) -> Option<u64> {
        let over = |age: u64| self.bound(age as f64) * speed_m_s < self.settings.floor_m_s2;
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
        let age = voice.age();
        for (phasor, p) in voice.phasors.iter_mut().zip(&self.partials) {
            let size = (-p.decay * age).exp_e();
            // Without the whole turns, of which there are many.
            let (sin, cos) = ((p.turns * age).fract() * std::f64::consts::TAU).sine_cosine();
            *phasor = [size * cos, size * sin];
        }
    }

    /// The next sample of a tap of 1 m/s.
    #[inline(always)]
    fn sample(&self, voice: &mut Voice) -> f64 {
        if let Some(r) = &self.recorded {
            return r.gain * r.at(voice.age() * r.step);
        }
        let mut x = 0.0;
        for (z, p) in voice.phasors.iter_mut().zip(&self.partials) {
            x += p.gain * z[1];
            *z = [z[0] * p.turn[0] - z[1] * p.turn[1], z[0] * p.turn[1] + z[1] * p.turn[0]];
        }
        x
    }
}

/// A tap that sounds.
#[derive(Clone, Copy, Debug, Default)]
struct Voice {
    slot: usize,
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

    fn age(&self) -> f64 {
        self.next.saturating_sub(self.from) as f64 - self.part
    }
}

/// Contact transients of several slots, each scaled by the speed of its approach; they overlap, at most 8 at
/// full level.
///
/// A tap begins from 0 at the given time, also between two samples. Its sinusoids turn by a recurrence in
/// f64, which stays within 1e-9 of the closed form over 10 s. The samples do not depend on how they are cut
/// into ticks. A tap ends exactly at the sample from which on its envelope stays below the floor. That sample
/// is known when it begins. Where more taps would sound, the quietest is faded out in a millisecond; of
/// equals, the oldest.
#[derive(Clone, Debug)]
pub(crate) struct Taps {
    /// The sounds of all slots.
    pub sounds: Vec<Sound>,
    /// Samples of a fade.
    fade: u32,
    voices: [Voice; VOICES],
    /// The last strikes: the slot, the sample, and how far in it.
    strikes: [Option<(usize, (u64, f64))>; STRIKES],
    /// Number of taps that had to make room for another.
    pub cut_short: u64,
}

impl Taps {
    /// Taps of these sounds, which were made for the same rate.
    pub(crate) fn new(sounds: Vec<Sound>, rate_hz: u32) -> Self {
        let fade = (FADE_S * f64::from(rate_hz)).max(1.0) as u32;
        Self { sounds, fade, voices: [Voice::default(); VOICES], strikes: [None; STRIKES], cut_short: 0 }
    }

    /// Strikes a contact of a slot in sample `sample`, `part` of it (0 to below 1) after its beginning, at a
    /// speed of approach in mm/s. Returns whether it sounds. It does not if the speed is too low or not a
    /// number, or if the contact is too soon after the slot's last one or earlier than that. A contact that
    /// comes too late begins with the first sample that is still to be made.
    pub(crate) fn strike(&mut self, slot: usize, sample: u64, part: f64, speed_mm_s: f64) -> bool {
        let Some(sound) = self.sounds.get(slot) else { return false };
        let part = counted(part).clamp(0.0, 1.0 - f64::EPSILON);
        let settings = &sound.settings;
        if !(speed_mm_s.is_finite() && speed_mm_s > 0.0 && speed_mm_s >= settings.min_speed_mm_s) {
            return false;
        }
        let known = self.strikes.iter().position(|s| s.is_some_and(|(of, _)| of == slot));
        if let Some((_, (last, last_part))) = known.and_then(|i| self.strikes[i]) {
            let since = sample.saturating_sub(last) as f64 + part - last_part;
            if sample < last || since < sound.debounce {
                return false;
            }
        }
        let speed_m_s = 1e-3 * speed_mm_s.min(settings.max_speed_mm_s);
        let Some(length) = sound.length(speed_m_s) else { return false };
        let Some(free) = self.voices.iter().position(|v| !v.sounds()) else { return false };
        let (next, end) = (sample.saturating_add(u64::from(part > 0.0)), sample.saturating_add(length));
        let mut voice = Voice { slot, from: sample, part, next, end, speed_m_s, ..Voice::default() };
        sound.place(&mut voice);
        self.make_room();
        self.voices[free] = voice;
        // The oldest strike is forgotten.
        let oldest = (0..STRIKES).min_by_key(|i| self.strikes[*i].map(|(_, (at, _))| at));
        if let Some(place) = known.or(oldest) {
            self.strikes[place] = Some((slot, (sample, part)));
        }
        true
    }

    /// Lets the quietest tap fade if as many sound as may.
    fn make_room(&mut self) {
        let envelope = |v: &Voice| {
            self.sounds.get(v.slot).map_or(0.0, |sound| sound.bound(v.age().max(0.0)) * v.speed_m_s)
        };
        let full = || (0..VOICES).filter(|i| self.voices[*i].sounds() && self.voices[*i].fade == 0);
        let quieter = |a: &usize, b: &usize| {
            let [a, b] = [a, b].map(|i| &self.voices[*i]);
            envelope(a).total_cmp(&envelope(b)).then(a.from.cmp(&b.from))
        };
        if full().count() >= FULL
            && let Some(quietest) = full().min_by(quieter)
        {
            let voice = &mut self.voices[quietest];
            voice.fade = self.fade;
            voice.end = voice.end.min(voice.next.saturating_add(u64::from(self.fade)));
            self.cut_short += 1;
        }
    }

    /// Writes the samples in m/s^2 from number `first` on. Returns whether a tap continues after them.
    pub(crate) fn process<T: Sample>(&mut self, first: u64, out: &mut [T]) -> bool {
        let mut first = first;
        for out in out.chunks_mut(64) {
            let mut sum = [0.0; 64];
            for voice in self.voices.iter_mut().filter(|v| v.sounds()) {
                if let Some(sound) = self.sounds.get(voice.slot) {
                    render(sound, voice, self.fade, first, &mut sum[..out.len()]);
                }
            }
            out.iter_mut().zip(sum).for_each(|(out, x)| *out = T::narrow(x));
            first = first.saturating_add(out.len() as u64);
        }
        self.sounds()
    }

    /// Whether a tap still sounds.
    pub(crate) fn sounds(&self) -> bool {
        self.voices.iter().any(Voice::sounds)
    }

    /// Ends all taps at once, and forgets the last strikes.
    pub(crate) fn reset(&mut self) {
        self.voices = [Voice::default(); VOICES];
        self.strikes = [None; STRIKES];
    }

    /// Taps that sound. Taps of another transient continue from them with their own sinusoids. A slot that is
    /// no longer there falls silent.
    pub(crate) fn state(&mut self, state: &mut State<'_>) {
        for v in &mut self.voices {
            state.keep(&mut v.slot).keep(&mut v.from).keep(&mut v.part).keep(&mut v.next).keep(&mut v.end);
            state.keep(&mut v.speed_m_s).keep(&mut v.fade).keep(&mut v.phasors);
        }
        state.keep(&mut self.strikes);
        for voice in self.voices.iter_mut().filter(|v| v.slot >= self.sounds.len()) {
            *voice = Voice::default();
        }
        let longest = self.sounds.iter().map(|sound| sound.longest).max().unwrap_or(0);
        state.require(self.voices.iter().all(|v| {
            (0.0..1.0).contains(&v.part)
                && (0.0..=1e4).contains(&v.speed_m_s)
                && v.end.saturating_sub(v.from) <= longest
                && v.fade <= self.fade
                && v.phasors.iter().flatten().all(|p| p.abs() <= 2.0)
        }));
    }
}

/// Adds a voice's samples from `first` on.
fn render(sound: &Sound, voice: &mut Voice, fade: u32, first: u64, sum: &mut [f64]) {
    if voice.next < first {
        catch_up(sound, voice, first);
    }
    let skip = usize::try_from(voice.next - first).unwrap_or(usize::MAX);
    let left = usize::try_from(voice.end.saturating_sub(voice.next)).unwrap_or(usize::MAX);
    for sum in sum.iter_mut().skip(skip).take(left) {
        let x = voice.speed_m_s * sound.sample(voice);
        let level = if voice.fade > 0 {
            voice.fade -= 1;
            f64::from(voice.fade + 1) / f64::from(fade)
        } else {
            1.0
        };
        *sum += level * x;
        voice.next += 1;
    }
}

/// Catches up a voice whose next sample has been passed over. One that has not begun begins now; another goes
/// on later.
fn catch_up(sound: &Sound, voice: &mut Voice, first: u64) {
    let begun = voice.next > voice.from.saturating_add(u64::from(voice.part > 0.0));
    if begun {
        let passed = first - voice.next;
        voice.next = first;
        voice.fade = u32::try_from(u64::from(voice.fade).saturating_sub(passed)).unwrap_or(0);
    } else {
        voice.end = first.saturating_add(voice.end - voice.from);
        (voice.from, voice.part, voice.next) = (first, 0.0, first);
    }
    sound.place(voice);
}

impl Partial {
    fn new(s: &DecayingSinusoid, rate: f64) -> Result<Self, String> {
        let frequency = check("a tap's frequency", s.frequency_hz, (1.0, 0.45 * rate), "Hz")?;
        let (decay, turns) = (1e3 / (s.decay_ms * rate), frequency / rate);
        let (sin, cos) = (std::f64::consts::TAU * turns).sine_cosine();
        let size = (-decay).exp_e();
        Ok(Self { turn: [size * cos, size * sin], decay, turns, gain: s.gain })
    }
}

impl Recorded {
    fn new(recording: &Recording, rate: f64) -> Result<Self, String> {
        let all = &recording.samples;
        check_list("samples of a recording", all.iter().map(|x| f64::from(*x)), (2, MAX_RECORDED))?;
        let own = check("a recording's rate", recording.rate_hz, (100.0, 1e6), "Hz")?;
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
        Ok(Self { samples, ahead, step: own / rate, gain: 1e3 / recording.speed_mm_s })
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
