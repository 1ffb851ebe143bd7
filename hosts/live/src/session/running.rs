//! Who runs the ticks of a session, and how they are taken from there.

use crate::Player;
use crate::driver::{Callback, Paced, Timer};

/// Who runs the ticks now.
pub(super) enum Driver {
    Callback(Callback<Player>),
    Paced(Paced<Player>),
    Timer(Timer<Player>),
    /// Nobody, while the device's period is being found out.
    Waiting(Box<Player>),
    /// A tick never ended, or a thread could not be had: there is nothing left to run.
    Gone,
}

/// The driver of a run. Dropped, the output ramps down before the device, which is dropped after it, is closed.
pub(super) struct Running(pub(super) Driver);

impl Running {
    /// Takes the player from whoever runs it, its output down. `None` where a tick does not end.
    pub(super) fn take(&mut self) -> Option<Player> {
        match std::mem::replace(&mut self.0, Driver::Gone) {
            Driver::Callback(driver) => driver.stop(),
            Driver::Paced(driver) => driver.stop(),
            Driver::Timer(driver) => driver.stop(),
            Driver::Waiting(player) => Some(*player),
            Driver::Gone => None,
        }
    }

    /// Takes the player from a device that is lost: nobody hears a ramp.
    pub(super) fn take_from_lost(&mut self) -> Option<Player> {
        match std::mem::replace(&mut self.0, Driver::Gone) {
            Driver::Callback(driver) => driver.take(),
            other => Self(other).take(),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.take());
    }
}
