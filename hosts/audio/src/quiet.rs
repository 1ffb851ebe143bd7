//! Silences ALSA's library, which prints its errors to stderr, even for a mere query. Errors come back as
//! values too.

/// Silences ALSA's library on the calling thread from now on. Does not allocate or wait.
pub(crate) fn hush_alsa() {
    #[cfg(target_os = "linux")]
    {
        use std::ffi::{c_char, c_int};
        unsafe extern "C" fn nothing(
            _file: *const c_char,
            _line: c_int,
            _function: *const c_char,
            _error: c_int,
            _format: *const c_char,
            _arguments: *mut alsa_sys::__va_list_tag,
        ) {
        }
        // SAFETY: the handler has the type ALSA asks for, touches none of its arguments and lives as long
        // as the program. It is set for this thread only. (The handler for all threads is variadic, which
        // stable Rust cannot write.)
        unsafe { alsa_sys::snd_lib_error_set_local(Some(nothing)) };
    }
}
