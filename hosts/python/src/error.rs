//! Errors and warnings as Python has them, and the end by Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use asperity_offline::failure::Failure;
use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyUserWarning};
use pyo3::prelude::*;
use pyo3::{create_exception, intern};

create_exception!(asperity, Error, PyException, "Why something was not done: file, line, column, help.");
create_exception!(asperity, AsperityWarning, PyUserWarning, "Something that is probably a mistake.");

/// The exception for an error. Its text is that of the program, without the word `error:` before it.
pub fn raise(failure: &Failure) -> PyErr {
    let text = failure.text();
    let text = text.trim_end();
    Error::new_err(text.strip_prefix("error: ").unwrap_or(text).to_owned())
}

/// A warning for Python's own module of that name.
pub fn warn(message: &str) {
    Python::attach(|py| {
        let warned = || {
            let warnings = py.import(intern!(py, "warnings"))?;
            warnings.call_method1(intern!(py, "warn"), (message, py.get_type::<AsperityWarning>(), 2))
        };
        // A user may turn warnings into errors, and nobody here can raise one.
        if let Err(e) = warned() {
            e.print(py);
        }
    });
}

/// Whether Python code that a node runs was interrupted.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Notes that a node's Python code was interrupted: whoever runs the graph ends.
pub fn interrupted() {
    INTERRUPTED.store(true, Relaxed);
}

/// Whether a node's Python code was interrupted, and nobody has raised that yet.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Relaxed)
}

/// Raises the interruption of a node's Python code.
///
/// # Errors
/// Ctrl-C.
pub fn raise_interrupt() -> PyResult<()> {
    if INTERRUPTED.swap(false, Relaxed) { Err(PyKeyboardInterrupt::new_err(())) } else { Ok(()) }
}

/// Watches a long call without the GIL: lets Ctrl-C end it, and shows how far it is.
pub struct Watch {
    progress: Option<Py<PyAny>>,
    looked: Instant,
}

/// Time between two looks.
const EVERY: Duration = Duration::from_millis(50);

impl Watch {
    /// `progress` is called with the steps that are done and those there are.
    pub fn new(progress: Option<Py<PyAny>>) -> Self {
        INTERRUPTED.store(false, Relaxed);
        Self { progress, looked: Instant::now() }
    }

    /// Looks, if it is time.
    ///
    /// # Errors
    /// Ctrl-C, and an exception of `progress`.
    pub fn look(&mut self, done: u64, of: u64) -> PyResult<()> {
        if self.looked.elapsed() < EVERY && done < of {
            return Ok(());
        }
        self.looked = Instant::now();
        Python::attach(|py| {
            raise_interrupt()?;
            py.check_signals()?;
            self.progress.as_ref().map_or(Ok(()), |call| call.call1(py, (done, of)).map(drop))
        })
    }
}
