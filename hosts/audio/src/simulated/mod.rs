//! A sound card that is not there: for tests, and for users who have none.
//!
//! The host `simulated` has every device that can be described:
//! `simulated:frames=97,rate=48000,channels=4,format=i16` is one (see [`Params`]). It calls in real time
//! and plays to nobody, or to a plant of the program's ([`set_plants`]). A test makes a [`Simulated`] of a
//! name, opens it as `simulated:NAME`, calls it by hand if it likes, reads back what was played, and lets
//! things go wrong.

mod card;
mod device;
mod params;

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use card::{Card, State};
pub use params::Params;
use parking_lot::Mutex;

/// A simulated part of the world between an output and an input channel: given every sample of the output,
/// it answers the input's.
pub type Response = Box<dyn FnMut(f32) -> f32 + Send>;

/// Makes the plant that the `plant` words of a device's text describe, at a rate \[Hz\]; the error says
/// what is wrong with them.
pub type Plants = fn(&[(String, String)], f64) -> Result<Response, String>;

static PLANTS: OnceLock<Plants> = OnceLock::new();

/// Says who makes plants: this crate knows none. Only the first call counts.
pub fn set_plants(plants: Plants) {
    // Set twice is set: a program says it once.
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
    cpal::platform::CustomDevice::from_device(device::Device(card)).into()
}

/// The devices that have a name and are plugged in.
pub(crate) fn devices() -> Vec<cpal::Device> {
    let cards: Vec<_> = NAMED.lock().values().filter_map(Weak::upgrade).collect();
    cards.into_iter().filter(|card| !card.lock().unplugged).map(as_device).collect()
}

/// A device that is described by its id; the error says what is wrong with the description.
pub(crate) fn described(id: &str) -> Result<cpal::Device, String> {
    let params: Params = id.parse()?;
    if params.speed == 0.0 {
        return Err("`speed=0`: nobody would ever call it; 1 is real time".to_owned());
    }
    // What is wrong with a plant is said before the device is opened.
    plant_of(&params, f64::from(params.rate_hz.unwrap_or(48_000)))?;
    Ok(as_device(Arc::new(Card::new(id.to_owned(), params))))
}

/// Whether the device of that id is called by hand, so that the time between its calls says nothing.
pub(crate) fn is_by_hand(id: &str) -> bool {
    NAMED.lock().get(id).and_then(Weak::upgrade).is_some_and(|card| card.params.speed == 0.0)
}

/// A device that a test has in hand. It is there until this is dropped.
pub struct Simulated {
    name: String,
    card: Arc<Card>,
}

impl Simulated {
    /// Plugs in a device of that name. An error where the name is taken or holds a `=`, or the parameters
    /// make no sense.
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
        Ok(Self { name: name.to_owned(), card })
    }

    /// What a user types to open it: `simulated:NAME`.
    pub fn id(&self) -> String {
        format!("simulated:{}", self.name)
    }

    /// Calls the streams that play, once, with so many frames: the output first, then the input. On this
    /// thread.
    pub fn step(&self, frames: usize) {
        self.card.step(frames);
    }

    /// All that was played since the device was made, if its parameters say `keep`: interleaved, all
    /// channels of the device, full scale 1, exactly what stood in the device's memory.
    pub fn played(&self) -> Vec<f64> {
        self.card.played()
    }

    /// Puts a plant between two channels (from 1): it is given every sample of the output and answers the
    /// input's.
    pub fn plant(&self, output: u16, input: u16, respond: impl FnMut(f32) -> f32 + Send + 'static) {
        let index = |channel: u16| usize::from(channel.max(1)) - 1;
        self.card.plant(index(output), index(input), Box::new(respond));
    }

    /// Whether a stream has it open.
    pub fn in_use(&self) -> bool {
        let state = self.card.lock();
        state.output.is_some() || state.input.is_some()
    }

    /// Reports an underrun to the streams.
    pub fn xrun(&self) {
        report(&mut self.card.lock(), &cpal::Error::new(cpal::ErrorKind::Xrun));
    }

    /// Reports an error that means nothing in particular.
    pub fn error(&self) {
        report(&mut self.card.lock(), &flooding());
    }

    /// Reports errors without end, as fast as it can, until nobody has the device open; like ALSA over a
    /// Pulse server that was killed. No more calls.
    pub fn flood(&self) {
        self.card.lock().stopped = true;
        let card = self.card.clone();
        std::thread::spawn(move || {
            loop {
                let mut state = card.lock();
                if state.output.is_none() && state.input.is_none() {
                    return;
                }
                report(&mut state, &flooding());
                drop(state);
                std::thread::yield_now();
            }
        });
    }

    /// Does not call for this long, and then goes on. Only where the device keeps time itself.
    pub fn gap(&self, lasts: Duration) {
        self.card.lock().gap = lasts;
    }

    /// Does not call any more, and says nothing; like a Pulse server that was stopped.
    pub fn stop(&self) {
        self.card.lock().stopped = true;
    }

    /// Calls again after [`Simulated::stop`] or [`Simulated::flood`].
    pub fn resume(&self) {
        self.card.lock().stopped = false;
    }

    /// Pulls the plug: streams hear that the device is gone, nobody finds it.
    pub fn unplug(&self) {
        let mut state = self.card.lock();
        state.unplugged = true;
        report(&mut state, &cpal::Error::new(cpal::ErrorKind::DeviceNotAvailable));
    }

    /// Plugs it in again. What was open stays lost.
    pub fn plug(&self) {
        self.card.lock().unplugged = false;
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.card.lock().unplugged = true;
        NAMED.lock().remove(&self.name);
    }
}

fn flooding() -> cpal::Error {
    cpal::Error::with_message(cpal::ErrorKind::BackendError, "simulated error")
}

fn report(state: &mut State, error: &cpal::Error) {
    for line in [&mut state.output, &mut state.input].into_iter().flatten() {
        (line.error)(error.clone());
    }
}
