//! A tick of `rtpghi` does not touch the allocator.

#[path = "common/allocations.rs"]
mod allocations;
mod common;

#[test]
fn no_tick_of_rtpghi_allocates() {
    allocations::no_tick_allocates::<rtpghi::Rtpghi>(1.0);
}
