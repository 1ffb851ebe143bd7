//! A simulated sound card, for tests and for users who have none.
//!
//! The host `simulated` has every device that can be described:
//! `simulated:frames=97,rate=48000,channels=4,format=i16` is one (see [`Params`]). It calls in real time
//! and plays to nobody, or to a plant of the program ([`set_plants`]). A test makes a named [`Simulated`],
//! opens it as `simulated:NAME`, calls it by hand if needed, reads back its output, and causes faults.

mod card;
mod params;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use card::Card;
use cpal::{Error, ErrorKind};
pub use params::Params;
use parking_lot::Mutex;

/// Plant between an output and an input channel: maps every output sample to an input sample.
pub type Response = Box<dyn FnMut(f32) -> f32 + Send>;

/// Makes the plant of a device's `plant` words, at a rate \[Hz\]; the error names the wrong one.
pub type Plants = fn(&[(String, String)], f64) -> Result<Response, String>;

static PLANTS: OnceLock<Plants> = OnceLock::new();

/// Sets the maker of plants; this crate has none. Only the first call counts.
pub fn set_plants(plants: Plants) {
    // A program sets it once.
    let _ = PLANTS.set(plants);
}

/// The plant of a device, if it has one.
fn plant_of(params: &Params, rate_hz: f64) -> Result<Option<Response>, String> {
    match (params.plant.as_slice(), PLANTS.get()) {
        ([], _) => Ok(None),
        (_, None) => Err("this program knows no plants".to_owned()),
        (words, Some(make)) => make(words, rate_hz).map(Some),
    }
}

static NAMED: Mutex<BTreeMap<String, Weak<Card>>> = Mutex::new(BTreeMap::new());

fn as_device(card: Arc<Card>) -> cpal::Device {
    cpal::platform::CustomDevice::from_device(card::Device(card)).into()
}

/// Named devices that are plugged in.
pub(crate) fn devices() -> Vec<cpal::Device> {
    let cards: Vec<_> = NAMED.lock().values().filter_map(Weak::upgrade).collect();
    cards.into_iter().filter(|card| !card.lock().unplugged).map(as_device).collect()
}

/// A device described by its id; the error names the wrong part.
pub(crate) fn described(id: &str) -> Result<cpal::Device, String> {
    let params: Params = id.parse()?;
    if params.speed == 0.0 {
        return Err("`speed=0`: nobody would ever call it; 1 is real time".to_owned());
    }
    // Errors of a plant come before the device is opened.
    plant_of(&params, f64::from(params.rate_hz.unwrap_or(48_000)))?;
    Ok(as_device(Arc::new(Card::new(id.to_owned(), params))))
}

/// Whether that device is called by hand, so that the time between its calls has no meaning.
pub(crate) fn is_by_hand(id: &str) -> bool {
    NAMED.lock().get(id).and_then(Weak::upgrade).is_some_and(|card| card.params.speed == 0.0)
}

/// A device of a test. It exists until this is dropped.
pub struct Simulated(Arc<Card>);

impl Simulated {
    /// Plugs in a device. An error if the name is taken or contains `=`, or a parameter is invalid.
    pub fn new(name: &str, params: Params) -> Result<Self, String> {
        params.check()?;
        if name.is_empty() || name.contains('=') {
            return Err(format!("`{name}` is no name for a simulated device"));
        }
        let mut all = NAMED.lock();
        if all.get(name).is_some_and(|card| card.strong_count() > 0) {
            return Err(format!("there is a simulated device `{name}` already"));
        }
        let card = Arc::new(Card::new(name.to_owned(), params));
        all.insert(name.to_owned(), Arc::downgrade(&card));
        Ok(Self(card))
    }

    /// Id to open it: `simulated:NAME`.
    pub fn id(&self) -> String {
        format!("simulated:{}", self.0.id)
    }

    /// Calls the playing streams once with this many frames, on this thread: the output first, then the
    /// input.
    pub fn step(&self, frames: usize) {
        self.0.step(frames);
    }

    /// Everything played since the device was made, if its parameters say `keep`: interleaved, all
    /// channels, full scale 1, exactly as in the device's memory.
    pub fn played(&self) -> Vec<f64> {
        self.0.lock().played.clone()
    }

    /// Sets a plant between two channels (from 1): it maps every output sample to an input sample.
    pub fn plant(&self, output: u16, input: u16, respond: impl FnMut(f32) -> f32 + Send + 'static) {
        let index = |channel: u16| usize::from(channel.max(1)) - 1;
        self.0.lock().plants.push((index(output), index(input), Box::new(respond)));
    }

    /// Whether a stream has it open.
    pub fn in_use(&self) -> bool {
        self.0.lock().lines().next().is_some()
    }

    /// Reports an underrun to the streams.
    pub fn xrun(&self) {
        self.report(&Error::new(ErrorKind::Xrun));
    }

    /// Reports an unspecific error.
    pub fn error(&self) {
        self.report(&Error::with_message(ErrorKind::BackendError, "simulated error"));
    }

    fn report(&self, error: &Error) {
        self.0.lock().lines().for_each(|line| (line.error)(error.clone()));
    }

    /// Pauses its calls for this long. Only for a device that keeps time itself.
    pub fn gap(&self, lasts: Duration) {
        self.0.lock().gap = lasts;
    }

    /// Stops calling without notice, like a stopped Pulse server.
    pub fn stop(&self) {
        self.0.lock().stopped = true;
    }

    /// Calls again after [`Simulated::stop`].
    pub fn resume(&self) {
        self.0.lock().stopped = false;
    }

    /// Unplugs the device: streams get an error, and nobody finds it.
    pub fn unplug(&self) {
        self.0.lock().unplugged = true;
        self.report(&Error::new(ErrorKind::DeviceNotAvailable));
    }

    /// Plugs it in again. Lost streams stay lost.
    pub fn plug(&self) {
        self.0.lock().unplugged = false;
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.0.lock().unplugged = true;
        NAMED.lock().remove(&self.0.id);
    }
}
