//! Drivers by the library's own interface: what they ask of the machine.

mod locked_memory;
mod no_alloc;
