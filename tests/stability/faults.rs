//! Faults around a graph, and in it: a process that is killed, a disk that is full, a plugin that
//! does not come back, nodes that fail by chance.

mod chance;
mod disk;
mod full;
mod killed;
mod spin;
mod writers;
