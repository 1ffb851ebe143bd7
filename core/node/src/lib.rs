//! Node types and the interface between nodes and the engine.
//!
//! A node author writes a [`Node`]: a [`Descriptor`] (kind, ports, parameters) and a `prepare` that
//! allocates; and a [`Processor`]: a `process` that does not. [`Registry`] holds the kinds that a host
//! offers. The types of a graph are here too: [`PortType`], [`Unit`], [`FrameLayout`], and exact time
//! in [`time`].

mod buffer;
mod check;
mod descriptor;
mod effect;
mod fact;
mod guard;
mod kind;
mod param;
mod port;
mod registry;
pub mod time;

pub use asperity_diagnostics::{Diagnostic, Place, Source, Span};
pub use asperity_numbers::random;
pub use asperity_state::{Keep, State};
pub use buffer::{Buffer, Frame, InputRef, Inputs, Outputs};
pub use descriptor::{Descriptor, Resume, Retrieval, Role};
pub use effect::{Acts, Direction, Effect, Form, Law, Settings};
pub use fact::{Fact, FactValue};
pub use guard::{Coil, Guard};
pub use kind::{Config, Fault, Node, NodeKind, Ports, Prepared, Processor, Setup, Status, Tick, Wiring};
pub use num_complex::Complex;
pub use param::{Param, ParamKind, ParamValue, Params};
pub use port::{
    FrameLayout, Input, LayoutSpec, Output, PortType, RateSpec, Shape, ShapeSpec, Unit, UnitSpec, Var,
};
pub use registry::Registry;
pub use time::{FrameClock, FrameRate, Latency};
