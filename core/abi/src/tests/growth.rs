//! Structs that grow: a reader of one minor version and a maker of another understand each other.

use crate::{Grows, read_grown};

/// A struct as it might be in 1.1: `added` was not there in 1.0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
struct Later {
    size: u32,
    old: u32,
    added: u64,
}

// SAFETY: repr(C), begins with its size, and is made of numbers.
unsafe impl Grows for Later {
    const SIZE_1_0: usize = 8;
}

/// Memory in which a struct lies, with other things behind it.
#[repr(C, align(8))]
struct Memory([u32; 16]);

fn memory(size: u32) -> Memory {
    let mut words = [0xffff_ffff; 16];
    (words[0], words[1]) = (size, 7);
    (words[2], words[3]) = (5, 0);
    Memory(words)
}

#[test]
fn fields_unknown_to_an_older_maker_read_as_zero() {
    // SAFETY: more bytes are there than the struct says.
    let read = |size| unsafe { read_grown::<Later>(memory(size).0.as_ptr().cast()) };
    assert_eq!(read(8), Some(Later { size: 8, old: 7, added: 0 }));
    assert_eq!(read(16), Some(Later { size: 16, old: 7, added: 5 }));
}

#[test]
fn added_fields_of_a_newer_maker_stay_untouched() {
    // SAFETY: as many bytes are there as the struct says.
    let read = |size| unsafe { read_grown::<Later>(memory(size).0.as_ptr().cast()) };
    assert_eq!(read(24), Some(Later { size: 24, old: 7, added: 5 }));
}

#[test]
fn impossible_size_is_refused() {
    for size in [0, 4, 7, 9, 13, 5000, u32::MAX] {
        // SAFETY: nothing beyond the size is read where it cannot be.
        assert_eq!(unsafe { read_grown::<Later>(memory(size).0.as_ptr().cast()) }, None, "{size}");
    }
    let m = memory(16);
    // SAFETY: NULL and places where no struct can be are not read.
    unsafe {
        assert_eq!(read_grown::<Later>(std::ptr::null()), None);
        assert_eq!(read_grown::<Later>(m.0.as_ptr().byte_add(4).cast()), None);
    }
}
