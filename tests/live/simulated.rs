//! The engine over cpal's custom host: what a card plays is what the graph gives, sample by sample, whatever
//! the card is like and whatever goes wrong with it.

mod exact;
mod faults;
mod inputs;
mod swaps;

use asperity_audio::Request;
use asperity_audio::simulated::Simulated;
use asperity_live::SessionOptions;
use asperity_live::driver::Clock;

/// A run on these channels of a card, at once at full level.
pub(crate) fn on_channels(card: &Simulated, channels: &[u16], rate_hz: u32) -> SessionOptions {
    let options = harness::stage::options(card, Clock::Callback);
    let device = options.device.map(|device| Request { channels: channels.to_vec(), rate_hz, ..device });
    SessionOptions { device, ..options }
}
