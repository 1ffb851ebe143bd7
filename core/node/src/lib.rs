//! Node types and the interface between nodes and the engine.
//!
//! A node author writes a [`Node`]: a [`Descriptor`] (kind, ports, parameters) and a `prepare` that
//! allocates; and a [`Processor`]: a `process` that does not. [`Registry`] holds the kinds that a host
//! offers. The types of a graph are here too: [`PortType`], [`Unit`], [`FrameLayout`], and exact time
//! in [`time`].
//!
//! All of a node:
//!
//! ```rust
//! use asperity_node::*;
//!
//! /// Dry friction: mu times the normal force, against the motion.
//! struct Friction(f64);
//!
//! impl Node for Friction {
//!     fn descriptor() -> Descriptor {
//!         Descriptor::new("friction", "Coulomb friction from normal force and speed.")
//!             .input(Input::new("force", ShapeSpec::Control(1), Unit::NEWTON).doc("normal force"))
//!             .input(Input::new("speed", ShapeSpec::Control(1), Unit::MILLIMETRE_PER_SECOND))
//!             .output(Output::new("friction", ShapeSpec::Control(1), Unit::NEWTON).doc("against motion"))
//!             .param(Param::number("mu", 0.3, 0.0..=2.0, "Coefficient of friction."))
//!     }
//!     fn prepare(setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
//!         Ok(Prepared::new(Self(setup.params.number("mu"))))
//!     }
//! }
//!
//! impl Processor for Friction {
//!     fn process(&mut self, tick: &mut Tick<'_>) -> Status {
//!         let force = if tick.inputs.value(1) > 0.0 { tick.inputs.value(0) } else { 0.0 };
//!         tick.outputs.set(0, self.0 * force);
//!         Status::Continue
//!     }
//!     fn reset(&mut self) {}
//! }
//! ```
//!
//! `prepare` allocates. `process` must not; neither may it lock, log or panic. If it panics or writes a NaN,
//! the engine fades or holds its output, counts the fault and goes on. A node that remembers something
//! gives it in `state`, and goes on from there when the graph is changed. A parameter that is `.live()`
//! may change while the node runs. A host adds the node by [`Registry::with`]; the plugin SDK exports the
//! same type as a plugin.

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
