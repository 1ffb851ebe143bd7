//! Write a node for Asperity, and export it as a plugin with one line.
//!
//! A node is written like a built-in one. Its kind implements [`Node`]; its instance, which runs,
//! implements [`Processor`]. In a crate of type `cdylib`:
//!
//! ```
//! use asperity_sdk::*;
//!
//! struct Twice;
//!
//! impl Node for Twice {
//!     fn descriptor() -> Descriptor {
//!         Descriptor::new("twice", "Doubles a force.")
//!             .input(Input::new("in", ShapeSpec::Control(1), Unit::NEWTON).doc("a force"))
//!             .output(Output::new("out", ShapeSpec::Control(1), Unit::NEWTON).doc("twice that"))
//!     }
//!     fn prepare(_setup: &Setup<'_>) -> Result<Prepared, Diagnostic> {
//!         Ok(Prepared::new(Self))
//!     }
//! }
//!
//! impl Processor for Twice {
//!     fn process(&mut self, tick: &mut Tick<'_>) -> Status {
//!         let force = tick.inputs.value(0);
//!         tick.outputs.set(0, 2.0 * force);
//!         Status::Continue
//!     }
//!     fn reset(&mut self) {}
//! }
//!
//! asperity_sdk::export!(Twice);
//! ```
//!
//! Every call from the host is wrapped: a panic is caught on this side, silently, and answered as a
//! fault. Buffers are copied between the host's memory and the node's view, so that no Rust type crosses
//! the boundary.

#[cfg(panic = "abort")]
compile_error!("a node that panics is contained by unwinding: build with panic = \"unwind\"");

mod buffers;
mod describe;
mod effect;
mod facts;
mod instance;
mod panics;
mod setup;
mod text;

pub use asperity_abi as abi;
pub use asperity_node::*;

/// Internals of [`export!`]; do not use them directly.
#[doc(hidden)]
pub mod export {
    pub use crate::describe::{Kinds, open};
}

/// Exports node types as the kinds of this plugin. Once in a crate of type `cdylib`.
#[macro_export]
macro_rules! export {
    ($($node:ty),+ $(,)?) => {
        /// The symbol that the host looks for.
        #[allow(non_upper_case_globals, missing_docs)]
        #[unsafe(no_mangle)]
        pub static asperity_entry: $crate::abi::AsperityEntry = {
            unsafe extern "C" fn open(
                _host: *const $crate::abi::AsperityHost,
            ) -> *const $crate::abi::AsperityPlugin {
                $crate::export::open(
                    concat!(env!("CARGO_PKG_NAME"), "\0"),
                    concat!(env!("CARGO_PKG_VERSION"), "\0"),
                    |kinds| { $(kinds.add::<$node>();)+ },
                )
            }
            $crate::abi::AsperityEntry {
                magic: $crate::abi::ASPERITY_MAGIC,
                size: ::core::mem::size_of::<$crate::abi::AsperityEntry>() as u32,
                major: $crate::abi::ASPERITY_MAJOR,
                minor: $crate::abi::ASPERITY_MINOR,
                open: Some(open),
            }
        };
    };
}
