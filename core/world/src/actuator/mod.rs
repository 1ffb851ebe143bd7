//! actuator.
