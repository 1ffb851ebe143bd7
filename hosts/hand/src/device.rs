//! A hand device, as hosts see it before it is open.

use std::net::SocketAddr;

use asperity_live::{ForceReader, SampleWriter};
use asperity_node::{Params, Registry};

use crate::{HandError, Handle};

/// Opens a device that was configured. Without the reader of force models its motors stay off.
pub type Open = Box<dyn FnOnce(SampleWriter, Option<ForceReader>) -> Result<Handle, HandError> + Send>;

/// A kind of hand devices: a module of this crate, and an entry of [`DEVICES`](crate::DEVICES).
pub trait HandDevice: Sync {
    /// Kind of the node with the motion of the hand.
    fn input(&self) -> &'static str;

    /// Kind of the node that pushes back, if the device can.
    fn force(&self) -> Option<&'static str> {
        None
    }

    /// Adds its node kinds to a registry.
    fn register(&self, registry: Registry) -> Registry;

    /// Checks the parameters of its input node, without touching the device. `max_force_n`: largest force of
    /// its force node \[N\].
    ///
    /// # Errors
    /// An invalid parameter.
    fn configure(&self, params: &Params, max_force_n: f64) -> Result<Open, HandError>;

    /// Whether `open`, a source of this kind, must be closed before a source with `params` is opened.
    /// `address`: where `open` listens.
    fn excludes(&self, params: &Params, open: &Params, address: Option<SocketAddr>) -> bool;

    /// Effective servo rate \[Hz\] for [`passivity`](crate::servo::passivity::passivity): 1 / (T + 2 d) with
    /// the period T and the delay d of its loop. For a device that pushes back.
    fn servo_hz(&self) -> f64 {
        0.0
    }

    /// Message for the start of a run: what the user does next.
    fn invitation(&self, _params: &Params) -> Option<String> {
        None
    }
}

/// A text parameter, trimmed; `None` if it is empty.
pub(crate) fn text(params: &Params, name: &str) -> Option<String> {
    Some(params.text(name).trim().to_owned()).filter(|text| !text.is_empty())
}
