//! What the stylus meets: `virtual_floor`, and the gate over what it feels there: `speed_gate`.

mod speed_gate;
mod virtual_floor;

pub use speed_gate::SpeedGate;
pub use virtual_floor::VirtualFloor;
