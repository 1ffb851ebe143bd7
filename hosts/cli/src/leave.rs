//! How the program ends: on its own terms, also while plugins run, and when the user asks.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed, Ordering::SeqCst};
use std::sync::{Arc, OnceLock};

use crate::failure::{complain, warn};

/// Exit code of an interrupted command, as a shell would have it.
pub const INTERRUPTED: u8 = 130;

static MEANT: AtomicBool = AtomicBool::new(false);

/// From here on, an end that the program did not choose has exit code 1: a plugin that calls `exit` does
/// not make a run look complete. Call it after parsing the command line, which may end the program too.
pub fn on_purpose_only() -> Staying {
    #[cfg(unix)]
    {
        extern "C" fn ending() {
            if !MEANT.load(SeqCst) {
                complain("error: foreign code, such as a plugin, called exit(): the run is not complete\n");
                // SAFETY: it ends the process at once, and runs nothing more of it.
                unsafe { libc::_exit(1) }
            }
        }
        // SAFETY: the function lives as long as the program, and does not unwind.
        let _ = unsafe { libc::atexit(ending) };
    }
    Staying
}

/// Makes a file beyond the shell's size limit an error like a full disk, instead of a signal.
pub fn not_for_a_long_file() {
    #[cfg(unix)]
    // SAFETY: it runs no code of this program; writing returns an error from here on.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// While this lives, an end is not meant. `main` drops it as it returns or unwinds.
pub struct Staying;

impl Drop for Staying {
    fn drop(&mut self) {
        MEANT.store(true, SeqCst);
    }
}

/// Lets this process end in any way: its parent looks at how it did.
pub fn as_it_likes() {
    MEANT.store(true, SeqCst);
}

pub fn now(code: u8) -> ! {
    MEANT.store(true, SeqCst);
    std::process::exit(code.into())
}

/// The program's one flag that the user asks to stop. The third time, the program ends at once.
pub fn stop_flag() -> Arc<AtomicBool> {
    static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();
    let make = || {
        let stop = Arc::new(AtomicBool::new(false));
        let set = stop.clone();
        let mut asked = 0;
        let heard = move || {
            set.store(true, Relaxed);
            asked += 1;
            match asked {
                1 => {}
                2 => complain("it is about to end; once more, and it ends at once and keeps no output\n"),
                _ => now(INTERRUPTED),
            }
        };
        if let Err(e) = ctrlc::set_handler(heard) {
            warn(&format!("Ctrl-C will not be caught: {e}"));
        }
        stop
    };
    STOP.get_or_init(make).clone()
}
