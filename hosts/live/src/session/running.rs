//! The driver of a session.

use std::sync::Arc;

use crate::Player;
use crate::driver::{Callback, Clock, Controls, TickThread};

/// Who runs the ticks now.
pub(super) enum Driver {
    Callback(Callback<Player>),
    Thread(Clock, TickThread<Player>),
    /// Nobody, until the period of the device is known.
    Waiting(Box<Player>),
    /// Nobody any more: a tick never ended, or the system gave no thread.
    Gone,
}

/// The driver of a run. Dropping it ramps the output down; the device must be closed after that.
pub(super) struct Running(pub(super) Driver);

impl Running {
    /// Stops the driver, output down, and takes the player. `None` if a tick does not end.
    pub(super) fn take(&mut self) -> Option<Player> {
        match std::mem::replace(&mut self.0, Driver::Gone) {
            Driver::Callback(driver) => driver.stop(),
            Driver::Thread(_, driver) => driver.stop(),
            Driver::Waiting(player) => Some(*player),
            Driver::Gone => None,
        }
    }

    /// Takes the player from a lost device, without a ramp that nobody hears.
    pub(super) fn take_from_lost(&mut self) -> Option<Player> {
        match std::mem::replace(&mut self.0, Driver::Gone) {
            Driver::Callback(driver) => driver.take(),
            other => Self(other).take(),
        }
    }

    /// The clock of the ticks; `None` while nobody runs them.
    pub(super) fn clock(&self) -> Option<Clock> {
        match &self.0 {
            Driver::Callback(_) => Some(Clock::Callback),
            Driver::Thread(clock, _) => Some(*clock),
            Driver::Waiting(_) | Driver::Gone => None,
        }
    }

    /// Requests to the driver, and its state; `None` while nobody runs the ticks.
    pub(super) fn controls(&self) -> Option<&Arc<Controls>> {
        match &self.0 {
            Driver::Callback(driver) => Some(driver.controls()),
            Driver::Thread(_, driver) => Some(driver.controls()),
            Driver::Waiting(_) | Driver::Gone => None,
        }
    }

    /// Whether there is nobody left to run the ticks.
    pub(super) fn gone(&self) -> bool {
        matches!(self.0, Driver::Gone)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.take());
    }
}
