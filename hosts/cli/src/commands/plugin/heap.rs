//! Counts the allocations of a plugin.
//!
//! A plugin has an allocator of its own language, which the program's allocator does not see. All of them end
//! in the C library's `malloc` and its kin. On 64-bit Linux with glibc the program defines these functions
//! itself: every library that it loads finds them first. They count and forward to the C library. On other
//! systems nothing is counted.
//!
//! Not counted: memory that a plugin maps itself (`mmap`), or takes from an allocator that is linked into it.

use std::cell::Cell;

use asperity_checks::{Heap, Touched};

thread_local! {
    // Neither needs memory when it is first touched.
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static TOUCHED: Cell<Touched> = const { Cell::new(Touched { taken: 0, freed: 0 }) };
}

/// Counts the calls of this thread to the C library's allocator.
#[derive(Debug)]
pub struct Counter;

impl Counter {
    /// A counter, if one sees an allocation on this system.
    pub fn find() -> Option<Self> {
        Counter.begin();
        drop(std::hint::black_box(Box::new([0_u8; 64])));
        (Counter.end() == Touched { taken: 1, freed: 1 }).then_some(Counter)
    }
}

impl Heap for Counter {
    fn begin(&self) {
        TOUCHED.set(Touched::default());
        COUNTING.set(true);
    }

    fn end(&self) -> Touched {
        COUNTING.set(false);
        TOUCHED.get()
    }
}

#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
mod defined {
    use std::ffi::{c_int, c_void};

    use super::{COUNTING, TOUCHED, Touched};

    fn count(taken: bool, freed: bool) {
        if COUNTING.get() {
            let before = TOUCHED.get();
            TOUCHED.set(Touched {
                taken: before.taken + u64::from(taken),
                freed: before.freed + u64::from(freed),
            });
        }
    }

    // The C library's own functions under their other names.
    unsafe extern "C" {
        fn __libc_malloc(size: usize) -> *mut c_void;
        fn __libc_calloc(count: usize, size: usize) -> *mut c_void;
        fn __libc_realloc(at: *mut c_void, size: usize) -> *mut c_void;
        fn __libc_memalign(alignment: usize, size: usize) -> *mut c_void;
        fn __libc_valloc(size: usize) -> *mut c_void;
        fn __libc_pvalloc(size: usize) -> *mut c_void;
        fn __libc_free(at: *mut c_void);
    }

    /// Defines functions that take memory, by the names to which they forward.
    macro_rules! takes {
        ($($name:ident($($arg:ident),*) = $to:ident;)*) => { $(
            // SAFETY: it takes the place of the C library's function, of the same contract.
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($arg: usize),*) -> *mut c_void {
                count(true, false);
                // SAFETY: the C library's own function of the same contract, with the same arguments.
                unsafe { $to($($arg),*) }
            }
        )* };
    }

    takes! {
        malloc(size) = __libc_malloc;
        calloc(number, size) = __libc_calloc;
        memalign(alignment, size) = __libc_memalign;
        aligned_alloc(alignment, size) = __libc_memalign;
        valloc(size) = __libc_valloc;
        pvalloc(size) = __libc_pvalloc;
    }

    // SAFETY: as in `takes`.
    #[unsafe(no_mangle)]
    unsafe extern "C" fn realloc(at: *mut c_void, size: usize) -> *mut c_void {
        let frees = !at.is_null() && size == 0;
        count(!frees, frees);
        // SAFETY: as in `takes`.
        unsafe { __libc_realloc(at, size) }
    }

    // SAFETY: as in `takes`.
    #[unsafe(no_mangle)]
    unsafe extern "C" fn posix_memalign(at: *mut *mut c_void, alignment: usize, size: usize) -> c_int {
        if !alignment.is_power_of_two() || alignment < size_of::<usize>() {
            return libc::EINVAL;
        }
        count(true, false);
        // SAFETY: as in `takes`.
        let found = unsafe { __libc_memalign(alignment, size) };
        if found.is_null() {
            return libc::ENOMEM;
        }
        // SAFETY: the caller passes a place for a pointer.
        unsafe { *at = found };
        0
    }

    // SAFETY: as in `takes`.
    #[unsafe(no_mangle)]
    unsafe extern "C" fn free(at: *mut c_void) {
        count(false, !at.is_null());
        // SAFETY: as in `takes`.
        unsafe { __libc_free(at) };
    }
}
