//! An actuator and an accelerometer for the simulated sound card, from its first output to its first input:
//! `simulated:plant=hapcoil_one,plant_handle_g=60`. Commands that need both can be tried without them.

use std::fmt::Display;
use std::str::FromStr;

use asperity_actuator::{ActuatorProfile, Drive, Dynamics, Plant};
use asperity_audio::simulated::{Response, set_plants};
use asperity_diagnostics::one_of;
use asperity_node::random::uniform;

/// Steps of the plant in a sample, with linear interpolation: close enough to a card's converters.
const OVERSAMPLING: u32 = 8;

const WORDS: [&str; 8] = [
    "plant",
    "plant_handle_g",
    "plant_amps",
    "plant_volts",
    "plant_full_scale",
    "plant_noise",
    "plant_seed",
    "plant_invert",
];

/// Registers plants with the simulated sound card.
pub fn register() {
    set_plants(|words, rate_hz| {
        let name = words.iter().find(|(word, _)| word == "plant").map(|(_, name)| name);
        let name = name.ok_or("what a plant is like needs a plant, such as `plant=hapcoil_one`")?;
        let profile = ActuatorProfile::find(name, "".as_ref()).map_err(|d| d.to_string())?;
        let mut actuator = Actuator::new(profile);
        words.iter().try_for_each(|(word, value)| actuator.set(word, value))?;
        actuator.at(rate_hz)
    });
}

/// An actuator on a handle with an accelerometer, from the card's output to its input.
#[derive(Clone, Debug)]
pub struct Actuator {
    pub profile: ActuatorProfile,
    pub handle_g: f64,
    pub drive: Drive,
    /// Drive at the card's full scale \[A or V\].
    pub at_full_scale: f64,
    /// Acceleration at which the input is at full scale, where it clips \[m/s^2\].
    pub full_scale: f64,
    /// White noise of the accelerometer \[m/s^2 rms\].
    pub noise: f64,
    pub seed: u64,
    /// Whether the accelerometer points the other way.
    pub invert: bool,
}

impl Actuator {
    /// An actuator on 100 g, 1 A at full scale; an accelerometer of 100 m/s^2 at full scale without noise.
    pub fn new(profile: ActuatorProfile) -> Self {
        Self {
            profile,
            handle_g: 100.0,
            drive: Drive::Current,
            at_full_scale: 1.0,
            full_scale: 100.0,
            noise: 0.0,
            seed: 1,
            invert: false,
        }
    }

    /// Its response to samples at this rate, from rest on.
    pub fn at(&self, rate_hz: f64) -> Result<Response, String> {
        let dynamics = Dynamics::new(&self.profile, self.handle_g).map_err(|e| e.to_string())?;
        let mut plant = Plant::new(&dynamics, self.drive, rate_hz * f64::from(OVERSAMPLING));
        let sign = if self.invert { -1.0 } else { 1.0 };
        let Self { at_full_scale, full_scale, noise, seed, .. } = *self;
        let (mut before, mut samples) = (0.0, 0);
        Ok(Box::new(move |x| {
            let now = f64::from(x) * at_full_scale;
            let mut acceleration = 0.0;
            for i in 1..=OVERSAMPLING {
                let part = f64::from(i) / f64::from(OVERSAMPLING);
                acceleration = plant.step(before + (now - before) * part).acceleration;
            }
            before = now;
            // Of variance 1: the sum of twelve uniform ones.
            let normal: f64 = (0..12).map(|k| uniform(seed, 12 * samples + k) - 0.5).sum();
            samples += 1;
            let heard = sign * acceleration + noise * normal;
            (heard / full_scale).clamp(-1.0, 1.0) as f32
        }))
    }

    fn set(&mut self, word: &str, value: &str) -> Result<(), String> {
        fn number<T: FromStr + PartialOrd + Display>(word: &str, value: &str, least: T) -> Result<T, String> {
            let number = value.parse().ok().filter(|x| *x >= least);
            number.ok_or_else(|| format!("`{word}={value}`: a number of at least {least} is wanted"))
        }
        match word {
            "plant" => {}
            "plant_handle_g" => self.handle_g = number(word, value, 1.0)?,
            "plant_amps" => (self.drive, self.at_full_scale) = (Drive::Current, number(word, value, 1e-6)?),
            "plant_volts" => (self.drive, self.at_full_scale) = (Drive::Voltage, number(word, value, 1e-6)?),
            "plant_full_scale" => self.full_scale = number(word, value, 1e-6)?,
            "plant_noise" => self.noise = number(word, value, 0.0)?,
            "plant_seed" => self.seed = number(word, value, 0)?,
            "plant_invert" => self.invert = number::<u8>(word, value, 0)? != 0,
            _ => return Err(format!("a plant has no `{word}`: {}", one_of(word, WORDS))),
        }
        Ok(())
    }
}
