//! Counts the allocations of a plugin.
//!
//! A plugin has an allocator of its own language, which the program's allocator does not see. All of them end
//! in the C library's `malloc`. On Linux with glibc the program therefore defines `malloc` and its kin
//! itself: the system's loader binds the calls of every library to them. They count while a [`Counter`] asks
//! for it, and forward to the names that glibc keeps for this. On other systems nothing is counted.
//!
//! Not counted: memory that a plugin maps itself (`mmap`), or takes from an allocator that is linked into it.

use asperity_checks::{Heap, Touched};

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

#[cfg(all(target_os = "linux", target_env = "gnu", not(target_feature = "crt-static")))]
mod interposed {
    use std::cell::Cell;
    use std::ffi::{c_int, c_void};

    use super::{Counter, Heap, Touched};

    thread_local! {
        // Neither needs memory when it is first touched.
        static COUNTING: Cell<bool> = const { Cell::new(false) };
        static TOUCHED: Cell<Touched> = const { Cell::new(Touched { taken: 0, freed: 0 }) };
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

    fn count(taken: bool, freed: bool) {
        if COUNTING.get() {
            let before = TOUCHED.get();
            TOUCHED.set(Touched {
                taken: before.taken + u64::from(taken),
                freed: before.freed + u64::from(freed),
            });
        }
    }

    unsafe extern "C" {
        fn __libc_malloc(size: usize) -> *mut c_void;
        fn __libc_calloc(count: usize, size: usize) -> *mut c_void;
        fn __libc_realloc(at: *mut c_void, size: usize) -> *mut c_void;
        fn __libc_memalign(alignment: usize, size: usize) -> *mut c_void;
        fn __libc_valloc(size: usize) -> *mut c_void;
        fn __libc_pvalloc(size: usize) -> *mut c_void;
        fn __libc_free(at: *mut c_void);
    }

    /// Defines functions of the C library that take memory, by the names to which they forward.
    macro_rules! takes {
        ($($name:ident($($arg:ident),*) = $to:ident;)*) => { $(
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

    #[unsafe(no_mangle)]
    unsafe extern "C" fn realloc(at: *mut c_void, size: usize) -> *mut c_void {
        let frees = !at.is_null() && size == 0;
        count(!frees, frees);
        // SAFETY: as in `takes`.
        unsafe { __libc_realloc(at, size) }
    }

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

    #[unsafe(no_mangle)]
    unsafe extern "C" fn free(at: *mut c_void) {
        count(false, !at.is_null());
        // SAFETY: as in `takes`.
        unsafe { __libc_free(at) };
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu", not(target_feature = "crt-static"))))]
impl Heap for Counter {
    fn begin(&self) {}

    fn end(&self) -> Touched {
        Touched::default()
    }
}
