//! The maker's library, loaded at run time: names, types and constants of its C interface.
//!
//! These are facts of the published interface (OpenHaptics Toolkit, API Reference Manual, Device Library,
//! version 3.4).

use std::ffi::{CStr, c_char, c_int, c_uint, c_ulong, c_ushort, c_void};

use asperity_node::Diagnostic;
use libloading::Library;

use crate::error;

/// Position in mm.
pub(super) const CURRENT_POSITION: c_uint = 0x2050;
/// Force to render, in N.
pub(super) const CURRENT_FORCE: c_uint = 0x2700;
/// Largest stiffness that the maker recommends, in N/mm.
pub(super) const NOMINAL_MAX_STIFFNESS: c_uint = 0x2602;
/// Largest force in N.
pub(super) const NOMINAL_MAX_FORCE: c_uint = 0x2603;
/// The capability to push.
pub(super) const FORCE_OUTPUT: c_uint = 0x4000;
pub(super) const INVALID_HANDLE: c_uint = 0xFFFF_FFFF;
/// Results of a callback.
pub(super) const DONE: c_uint = 0;
pub(super) const CONTINUE: c_uint = 1;
/// The middle of the priorities 0 to 65535.
pub(super) const DEFAULT_PRIORITY: c_ushort = 32_767;

/// One error of the library's stack.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct ErrorInfo {
    pub(super) code: c_uint,
    pub(super) internal: c_int,
    pub(super) device: c_uint,
}

pub(super) type Callback = unsafe extern "system" fn(*mut c_void) -> c_uint;

fn names() -> &'static [&'static str] {
    if cfg!(windows) {
        &["hd.dll"]
    } else if cfg!(target_os = "macos") {
        &["libHD.dylib", "/Library/Frameworks/HD.framework/HD"]
    } else {
        &["libHD.so", "libHD.so.3.4", "libHD.so.3.4.0", "libHD.so.3"]
    }
}

const INSTALL: &str = "install 3D Systems' OpenHaptics and the driver of the device (Touch Device Driver), \
    run the driver's setup once, or give the path of the library";

/// Declares [`Hd`] and finds its functions in a library.
macro_rules! functions {
    ($($name:ident = $symbol:literal: fn($($argument:ty),*) $(-> $answer:ty)?;)*) => {
        /// The library's functions: plain pointers, valid because the library is never unloaded.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct Hd {
            $(pub(super) $name: unsafe extern "system" fn($($argument),*) $(-> $answer)?,)*
        }

        impl Hd {
            /// Error: the first function that the library lacks.
            fn find(library: &'static Library) -> Result<Self, &'static str> {
                // SAFETY: the types are those of the published interface.
                Ok(Self { $($name: *unsafe { library.get($symbol) }.map_err(|_| $symbol)?,)* })
            }
        }
    };
}

functions! {
    init_device = "hdInitDevice": fn(*const c_char) -> c_uint;
    disable_device = "hdDisableDevice": fn(c_uint);
    make_current = "hdMakeCurrentDevice": fn(c_uint);
    begin_frame = "hdBeginFrame": fn(c_uint);
    end_frame = "hdEndFrame": fn(c_uint);
    get_doubles = "hdGetDoublev": fn(c_uint, *mut f64);
    set_doubles = "hdSetDoublev": fn(c_uint, *const f64);
    enable = "hdEnable": fn(c_uint);
    get_error = "hdGetError": fn() -> ErrorInfo;
    error_string = "hdGetErrorString": fn(c_uint) -> *const c_char;
    set_rate = "hdSetSchedulerRate": fn(c_ulong);
    start_scheduler = "hdStartScheduler": fn();
    stop_scheduler = "hdStopScheduler": fn();
    schedule = "hdScheduleAsynchronous": fn(Callback, *mut c_void, c_ushort) -> c_ulong;
    unschedule = "hdUnschedule": fn(c_ulong);
}

impl Hd {
    /// Loads the library at `path`, or else the first default name that the system's loader finds.
    /// Error: not found, with the names tried; or found, but a function is missing.
    pub(super) fn load(path: Option<&str>) -> Result<Self, Diagnostic> {
        let mut said = Vec::new();
        for name in path.as_ref().map_or(names(), std::slice::from_ref) {
            // SAFETY: loading runs the library's initialisers. The user asked for this library by naming
            // the device; it is the maker's, and there is no other way to the device.
            match unsafe { Library::new(*name) } {
                // The maker's library has its own threads and is not made to be unloaded.
                Ok(library) => {
                    return Self::find(Box::leak(Box::new(library))).map_err(|symbol| {
                        let why = "it is not OpenHaptics' libHD, or too old";
                        error(format!("{name} has no function {symbol}: {why}"), INSTALL)
                    });
                }
                Err(e) => said.push(format!("{name} ({})", reason(&e))),
            }
        }
        let tried = said.join(", ");
        Err(error(format!("OpenHaptics' libHD cannot be loaded; looked for {tried}"), INSTALL))
    }

    /// Takes all errors off the stack; returns the newest.
    pub(super) fn errors(&self) -> Option<c_uint> {
        let mut newest = None;
        for _ in 0..ERRORS {
            // SAFETY: takes nothing, answers a plain struct; may be called at any time.
            let info = unsafe { (self.get_error)() };
            if info.code == 0 {
                break;
            }
            newest = newest.or(Some(info.code));
        }
        newest
    }

    /// Text of an error code. Not for the servo thread.
    pub(super) fn name(&self, code: c_uint) -> String {
        // SAFETY: answers a constant text or null for any code.
        let text = unsafe { (self.error_string)(code) };
        let said = if text.is_null() {
            String::new()
        } else {
            // SAFETY: a text that ends in 0 and lives as long as the library.
            unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
        };
        format!("{} (error 0x{code:04x})", said.trim()).trim_start().to_owned()
    }
}

/// Most errors taken at once, so that a broken library cannot block the servo.
const ERRORS: usize = 32;

/// Whether this error means a lost device.
pub(super) fn fatal(code: c_uint) -> bool {
    matches!(code, 0x0300..=0x0304 | 0x0104)
}

/// Whether the device switched its motors off itself.
pub(super) fn force_off(code: c_uint) -> bool {
    matches!(code, 0x0200..=0x0204)
}

/// The loader's own words, without its type's.
fn reason(e: &libloading::Error) -> String {
    let source = std::error::Error::source(e);
    source.map_or_else(|| e.to_string(), ToString::to_string)
}
