//! The end of the program, which is the program's own: a plugin that calls `exit` does not make a run that
//! wrote nothing look like one that did.

use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

/// Whether the program ends because it wants to.
static MEANT: AtomicBool = AtomicBool::new(false);

/// From here on an end that was not meant has exit code 1. After the command line has been read, which may
/// end the program too.
pub fn on_purpose_only() -> Staying {
    #[cfg(unix)]
    {
        extern "C" fn ending() {
            if !MEANT.load(SeqCst) {
                crate::failure::complain(
                    "error: foreign code, such as a plugin, called exit(): the run is not complete\n",
                );
                // SAFETY: it ends the process at once, and runs nothing more of it.
                unsafe { libc::_exit(1) }
            }
        }
        // SAFETY: the function lives as long as the program, and does not unwind.
        let _ = unsafe { libc::atexit(ending) };
    }
    Staying
}

/// A file that grows beyond the shell's limit is an error like a full disk, and no signal that ends the program.
pub fn not_for_a_long_file() {
    #[cfg(unix)]
    // SAFETY: no code of this program is run by it; writing answers with an error from here on.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Until this is dropped, an end is not meant: dropped as `main` returns or unwinds.
pub struct Staying;

impl Drop for Staying {
    fn drop(&mut self) {
        MEANT.store(true, SeqCst);
    }
}

/// This process may end in any way: another one looks at how it did.
pub fn as_it_likes() {
    MEANT.store(true, SeqCst);
}

/// The program ends now, with this code.
pub fn now(code: u8) -> ! {
    MEANT.store(true, SeqCst);
    std::process::exit(code.into())
}
