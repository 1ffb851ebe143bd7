//! A tick of `gsrtisi_la` does not touch the allocator.

#[path = "../../rtpghi/tests/common/allocations.rs"]
mod allocations;
#[path = "../../rtpghi/tests/common/mod.rs"]
mod common;

#[test]
fn no_tick_of_gsrtisi_la_allocates() {
    allocations::no_tick_allocates::<gsrtisi_la::GsrtisiLa>(4.0);
}
