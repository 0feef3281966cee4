//! Work on a separate thread, so that Ctrl-C works and other Python threads run meanwhile.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use mimu_recording::error::Error;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::raised;

/// Interval between checks for signals.
const LOOK: Duration = Duration::from_millis(50);

/// Stack size as of the main thread: matrices of fixed size are on the stack.
const STACK: usize = 8 << 20;

/// Runs `work` on a separate thread and waits for it.
///
/// After Ctrl-C, `KeyboardInterrupt` is raised at once. The thread cannot be stopped from outside: it finishes its computation and drops the result.
/// It writes only to temporary files, so that nothing is left half done.
pub(crate) fn done<T, E>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
    exception: impl FnOnce(Python<'_>, &E) -> PyErr,
) -> PyResult<T>
where
    T: Send + 'static,
    E: Send + 'static,
{
    let (sender, receiver) = sync_channel(1);
    let body = move || {
        let outcome = catch_unwind(AssertUnwindSafe(work));
        // After Ctrl-C nobody waits for it.
        let _ = sender.send(outcome);
    };
    thread::Builder::new()
        .name("mimu".into())
        .stack_size(STACK)
        .spawn(body)
        .map_err(|error| PyRuntimeError::new_err(format!("cannot start a thread: {error}")))?;
    let receiver = std::sync::Mutex::new(receiver);
    loop {
        let next = py.detach(|| match receiver.lock() {
            Ok(receiver) => receiver.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        match next {
            Ok(Ok(outcome)) => return outcome.map_err(|error| exception(py, &error)),
            // A panic is shown as it would be without the thread.
            Ok(Err(panic)) => resume_unwind(panic),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("the work ended without a result"));
            }
        }
    }
}

/// [`done`] with an error of the library.
pub(crate) fn computed<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    done(py, work, raised)
}

/// JSON of a result, as the command writes it except for its line breaks.
pub(crate) fn json(result: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(result)
        .map_err(|error| PyRuntimeError::new_err(format!("the result cannot be written: {error}")))
}

/// JSON as Python objects.
pub(crate) fn loaded<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}
