//! Counts the allocations of a plugin.
//!
//! A plugin has an allocator of its own language, which the program's allocator does not see. All of them end
//! in the C library's `malloc` and its kin. Every loaded library finds these through a table of addresses,
//! which the system's loader fills in. On 64-bit Linux with glibc the process of the cases replaces the
//! addresses by those of functions that count and forward to the C library. No other process has them. On
//! other systems nothing is counted.
//!
//! Not counted: memory that a plugin maps itself (`mmap`), or takes from an allocator that is linked into it.

use asperity_checks::{Heap, Touched};

/// Counts the calls of this thread to the C library's allocator.
#[derive(Debug)]
pub struct Counter;

impl Counter {
    /// A counter, if one sees an allocation on this system. The plugin is loaded before.
    pub fn find() -> Option<Self> {
        Counter.begin();
        drop(std::hint::black_box(Box::new([0_u8; 64])));
        (Counter.end() == Touched { taken: 1, freed: 1 }).then_some(Counter)
    }
}

#[cfg(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64"))]
mod redirected {
    use std::cell::Cell;
    use std::ffi::{CStr, c_char, c_int, c_void};
    use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};

    use libc::{Elf64_Phdr, Elf64_Rela, Elf64_Sym, dl_phdr_info};

    use super::{Counter, Heap, Touched};

    thread_local! {
        // Neither needs memory when it is first touched.
        static COUNTING: Cell<bool> = const { Cell::new(false) };
        static TOUCHED: Cell<Touched> = const { Cell::new(Touched { taken: 0, freed: 0 }) };
    }

    impl Heap for Counter {
        fn begin(&self) {
            redirect_all();
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

    // The C library's own functions under names that no table is searched for.
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
        valloc(size) = __libc_valloc;
        pvalloc(size) = __libc_pvalloc;
    }

    unsafe extern "C" fn realloc(at: *mut c_void, size: usize) -> *mut c_void {
        let frees = !at.is_null() && size == 0;
        count(!frees, frees);
        // SAFETY: as in `takes`.
        unsafe { __libc_realloc(at, size) }
    }

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

    unsafe extern "C" fn free(at: *mut c_void) {
        count(false, !at.is_null());
        // SAFETY: as in `takes`.
        unsafe { __libc_free(at) };
    }

    /// The function that counts in place of the one with this name.
    fn counting(name: &CStr) -> Option<*mut c_void> {
        Some(match name.to_bytes() {
            b"malloc" => malloc as *mut c_void,
            b"calloc" => calloc as *mut c_void,
            b"memalign" | b"aligned_alloc" => memalign as *mut c_void,
            b"valloc" => valloc as *mut c_void,
            b"pvalloc" => pvalloc as *mut c_void,
            b"realloc" => realloc as *mut c_void,
            b"posix_memalign" => posix_memalign as *mut c_void,
            b"free" => free as *mut c_void,
            _ => return None,
        })
    }

    /// Number of libraries that were loaded when all of them were last redirected.
    static LOADED: AtomicU64 = AtomicU64::new(0);

    /// Redirects all libraries that are loaded now, unless none came since the last time.
    fn redirect_all() {
        let mut loaded = 0_u64;
        // SAFETY: the loader calls `redirect` with a description of each library while it holds its lock.
        unsafe { libc::dl_iterate_phdr(Some(redirect), (&raw mut loaded).cast()) };
        LOADED.store(loaded, Ordering::Relaxed);
    }

    // Of the ELF format, where `libc` does not have them.
    const DT_PLTRELSZ: usize = 2;
    const DT_STRTAB: usize = 5;
    const DT_SYMTAB: usize = 6;
    const DT_RELA: usize = 7;
    const DT_RELASZ: usize = 8;
    const DT_JMPREL: usize = 23;

    /// Replaces the addresses in the tables of one library; `loaded` gets the number of all.
    unsafe extern "C" fn redirect(info: *mut dl_phdr_info, _: usize, loaded: *mut c_void) -> c_int {
        // SAFETY: `redirect_all` passes the loader's description and a u64.
        let (info, loaded) = unsafe { (&*info, &mut *loaded.cast::<u64>()) };
        *loaded = info.dlpi_adds;
        if *loaded == LOADED.load(Ordering::Relaxed) {
            return 1;
        }
        let base = info.dlpi_addr as usize;
        // SAFETY: the loader describes headers of a library that is mapped.
        let headers: &[Elf64_Phdr] =
            unsafe { std::slice::from_raw_parts(info.dlpi_phdr, info.dlpi_phnum.into()) };
        let Some(dynamic) = headers.iter().find(|h| h.p_type == libc::PT_DYNAMIC) else { return 0 };
        let mut entries = [0_usize; 24];
        let mut at = (base + dynamic.p_vaddr as usize) as *const [usize; 2];
        // SAFETY: the section is mapped, and an entry with the tag 0 ends it.
        while let [tag, value] = unsafe { *at }
            && tag != 0
        {
            if let Some(entry) = entries.get_mut(tag) {
                *entry = value;
            }
            // SAFETY: as above.
            at = unsafe { at.add(1) };
        }
        // The loader has made addresses of these, but for the kernel's own library.
        let address = |tag: usize| if entries[tag] < base { base + entries[tag] } else { entries[tag] };
        let (symbols, names) = (address(DT_SYMTAB) as *const Elf64_Sym, address(DT_STRTAB) as *const c_char);
        for (table, bytes) in [(DT_RELA, DT_RELASZ), (DT_JMPREL, DT_PLTRELSZ)] {
            let count = entries[bytes] / size_of::<Elf64_Rela>();
            for i in 0..count {
                // SAFETY: the library's own tables of relocations, symbols and names, which stay mapped.
                let (entry, name) = unsafe {
                    let entry = &*(address(table) as *const Elf64_Rela).add(i);
                    let symbol = &*symbols.add((entry.r_info >> 32) as usize);
                    (entry, CStr::from_ptr(names.add(symbol.st_name as usize)))
                };
                if let Some(function) = counting(name) {
                    // SAFETY: the place is the library's slot for the address of a function of this contract.
                    unsafe { write((base + entry.r_offset as usize) as *mut c_void, function) };
                }
            }
        }
        0
    }

    /// Writes an address to a slot, whose page the loader may have made read-only.
    unsafe fn write(slot: *mut c_void, function: *mut c_void) {
        // SAFETY: it takes a number and answers one.
        let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) } as usize;
        let start = (slot as usize / page * page) as *mut c_void;
        // SAFETY: the caller passes a slot that is mapped. An aligned slot lies in one page.
        unsafe {
            if libc::mprotect(start, page, libc::PROT_READ | libc::PROT_WRITE) == 0 {
                (*slot.cast::<AtomicPtr<c_void>>()).store(function, Ordering::Relaxed);
            }
        }
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu", target_pointer_width = "64")))]
impl Heap for Counter {
    fn begin(&self) {}

    fn end(&self) -> Touched {
        Touched::default()
    }
}
