//! What the stylus meets: `virtual_floor`, or the surfaces of a scene, `contact`; and the gate over what it feels there: `speed_gate`.

#[allow(clippy::module_inception)]
mod contact;
mod speed_gate;
mod virtual_floor;

pub use contact::Contact;
pub use speed_gate::SpeedGate;
pub use virtual_floor::VirtualFloor;
