//! Contact of the stylus with a plane (`virtual_floor`) or with the surfaces of a scene (`contact`), and the
//! gate for the vibration felt there (`speed_gate`).

#[allow(clippy::module_inception)]
mod contact;
mod speed_gate;
mod virtual_floor;

pub use contact::Contact;
pub use speed_gate::SpeedGate;
pub use virtual_floor::VirtualFloor;
