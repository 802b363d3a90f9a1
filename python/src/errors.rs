//! Errors of the library as exceptions of `splatblur._errors`, work that Ctrl-C ends, and the guard against `fork`.

use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict as _, PyDict};
use splatblur::compare::CompareError;
use splatblur::fields::{Location, OptionError, Place};
use splatblur::reference::ReferenceError;
use splatblur::{BackendError, ImageError, Invalid, ModelError, SceneError, Stop};

/// An exception of this class of `splatblur._errors`, with its attributes.
pub(crate) fn exception(py: Python<'_>, class: &str, message: &str, fields: &Bound<'_, PyDict>) -> PyErr {
    let made = py
        .import("splatblur._errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call((message,), Some(fields)));
    match made {
        Ok(made) => PyErr::from_value(made),
        Err(error) => error,
    }
}

/// An error with all its causes, in one line.
pub(crate) fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(why) = cause {
        let why_text = why.to_string();
        if !text.ends_with(&why_text) {
            text = format!("{text}: {why_text}");
        }
        cause = why.source();
    }
    text
}

/// What a value is, and what it should be.
pub(crate) fn invalid(py: Python<'_>, field: &str, found: &str, expected: &str) -> PyErr {
    let message = format!("`{field}` is {found}, expected {expected}");
    fields(py, "InvalidValue", &message, &[("field", field), ("found", found), ("expected", expected)])
}

/// A text that means nothing, by what is wrong with it.
pub(crate) fn refused(py: Python<'_>, field: &str, text: &str, why: &OptionError) -> PyErr {
    use OptionError as E;
    let (found, expected) = match why {
        E::Word { known, .. } | E::Mode { known, .. } => (format!("`{text}`"), format!("one of: {known}")),
        E::Value { expected, .. } => (format!("`{text}`"), expected.clone()),
        _ => (format!("`{text}`, where {why}"), "another".to_owned()),
    };
    invalid(py, field, &found, &expected)
}

fn fields(py: Python<'_>, class: &str, message: &str, fields: &[(&str, &str)]) -> PyErr {
    match fields.iter().copied().into_py_dict(py) {
        Ok(fields) => exception(py, class, message, &fields),
        Err(error) => error,
    }
}

/// An error of the library that becomes an exception.
pub(crate) trait Raise {
    fn raise(&self, py: Python<'_>) -> PyErr;
}

impl Raise for Invalid {
    fn raise(&self, py: Python<'_>) -> PyErr {
        // Vectors by their numbers alone.
        let found = self.found.replace("DVec3(", "(").replace("Vec3(", "(");
        invalid(py, &self.field, &found, &self.expected)
    }
}

/// Where, what was found and what was expected, as far as an error says it.
fn details(error: &SceneError) -> (Option<&Location>, Option<&str>, Option<&str>) {
    use SceneError as E;
    match error {
        E::Encoding { at, found, expected } => (Some(at), Some(found), Some(expected)),
        E::Syntax { at, found, expected } | E::BadValue { at, found, expected, .. } => {
            (Some(at), Some(found), Some(expected))
        }
        E::UnexpectedText { at, found, expected, .. } => (Some(at), Some(found), Some(expected)),
        E::UnknownElement { at, found, known, .. }
        | E::UnknownAttribute { at, found, known, .. }
        | E::Inapplicable { at, found, known, .. } => (Some(at), Some(found), Some(known)),
        E::MissingAttribute { at, expected, .. } => (Some(at), None, Some(expected)),
        E::MissingElement { at, expected, .. } | E::RepeatedElement { at, expected, .. } => {
            (Some(at), None, Some(expected))
        }
        E::MissingFile { at, found, tried } => (Some(at), Some(found), Some(tried)),
        E::Restricted { at, found, .. } => (Some(at), Some(found), None),
        E::Model { at, .. } | E::Environment { at, .. } | E::Animation { at, .. } => (Some(at), None, None),
        _ => (None, None, None),
    }
}

impl Raise for SceneError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        if let Self::Invalid(invalid) = self {
            return invalid.raise(py);
        }
        if let Self::Alone(model) = self {
            return model.raise(py);
        }
        let (at, found, expected) = details(self);
        let made = (|| {
            let fields = PyDict::new(py);
            if let Some(Location { file, line, column }) = at {
                fields.set_item("file", &**file)?;
                fields.set_item("line", line)?;
                fields.set_item("column", column)?;
            }
            fields.set_item("found", found)?;
            fields.set_item("expected", expected)?;
            PyResult::Ok(exception(py, "SceneError", &chain(self), &fields))
        })();
        made.unwrap_or_else(|error| error)
    }
}

impl Raise for ModelError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        use ModelError as E;
        if let E::Column(invalid) = self {
            return invalid.raise(py);
        }
        let file: Option<&Path> = match self {
            E::Read { path, .. }
            | E::Write { path, .. }
            | E::NotAFile { path, .. }
            | E::EmptyFile { path }
            | E::UnknownFormat { path }
            | E::Invalid { path, .. }
            | E::NoPointsIn { path, .. }
            | E::Gap { path, .. } => Some(path),
            _ => None,
        };
        let made = (|| {
            let fields = PyDict::new(py);
            fields.set_item("file", file)?;
            if let E::Invalid { why, .. } = self {
                if let Place::Line(line) = why.at {
                    fields.set_item("line", line)?;
                }
                fields.set_item("found", &why.found)?;
                fields.set_item("expected", &why.expected)?;
            }
            PyResult::Ok(exception(py, "ModelError", &chain(self), &fields))
        })();
        made.unwrap_or_else(|error| error)
    }
}

impl Raise for BackendError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Invalid(invalid) => invalid.raise(py),
            Self::Model(model) => model.raise(py),
            _ => fields(py, "RenderError", &in_python(&chain(self)), &[]),
        }
    }
}

/// A message of the library in the words of this package.
fn in_python(message: &str) -> String {
    let words = [
        ("RenderOptions::memory", "Renderer(memory=...), bytes:"),
        ("ErrorTarget::samples_max", "`samples-max` of the mode"),
        ("Device::Cpu", "device=\"cpu\""),
        ("Recipe::flow = false", "flow=False"),
    ];
    words.into_iter().fold(message.to_owned(), |text, (rust, python)| text.replace(rust, python))
}

impl Raise for ReferenceError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        match self {
            Self::Invalid(invalid) => invalid.raise(py),
            Self::Model(model) => model.raise(py),
            _ => fields(py, "RenderError", &in_python(&chain(self)), &[]),
        }
    }
}

impl Raise for CompareError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        fields(py, "InvalidValue", &self.to_string(), &[])
    }
}

impl Raise for ImageError {
    fn raise(&self, py: Python<'_>) -> PyErr {
        fields(py, "ImageError", &chain(self), &[])
    }
}

/// The result, with its error as an exception.
pub(crate) trait OrRaise<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T, E: Raise> OrRaise<T> for Result<T, E> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| error.raise(py))
    }
}

/// The process that threads were started in; 0 before that.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Refuses work in a child of `fork`: the threads of the pool are not there, and whoever waits for them waits for ever.
pub(crate) fn guard(py: Python<'_>) -> PyResult<()> {
    let now = std::process::id();
    let before = PROCESS.compare_exchange(0, now, Ordering::Relaxed, Ordering::Relaxed).unwrap_or_else(|before| before);
    if before == 0 || before == now {
        return Ok(());
    }
    let message = "splatblur was used in the parent process before this one was forked from it, and its threads are \
                   not here. Start workers by spawn: multiprocessing.get_context(\"spawn\"), or \
                   DataLoader(..., multiprocessing_context=\"spawn\")";
    Err(fields(py, "ForkError", message, &[]))
}

/// Was this process forked from one that had used splatblur?
#[pyfunction]
pub(crate) fn is_forked() -> bool {
    let before = PROCESS.load(Ordering::Relaxed);
    before != 0 && before != std::process::id()
}

/// As [`guard`], for the Python layer.
#[pyfunction]
pub(crate) fn check_fork(py: Python<'_>) -> PyResult<()> {
    guard(py)
}

/// How often signals are looked for.
const PAUSE: Duration = Duration::from_millis(50);

/// Does `work` in another thread without the interpreter's lock. This thread looks for signals meanwhile and calls
/// `tell`; where one of them raises, it sets `stop`, waits for the work to end, and hands the exception on.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    stop: &Stop,
    tell: impl Fn(Python<'_>) -> PyResult<()> + Sync + Send,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    py.detach(|| {
        thread::scope(|scope| {
            let (sender, done) = mpsc::channel::<()>();
            let worker = scope.spawn(move || {
                // Dropped when the work is done, or has panicked.
                let _sender = sender;
                work()
            });
            let mut raised = None;
            while let Err(RecvTimeoutError::Timeout) = done.recv_timeout(PAUSE) {
                if raised.is_none() {
                    raised = Python::attach(|py| py.check_signals().and_then(|()| tell(py))).err();
                }
                if raised.is_some() {
                    stop.set();
                }
            }
            match (worker.join(), raised) {
                (_, Some(error)) => Err(error),
                (Ok(made), None) => Ok(made),
                (Err(panic), None) => Err(panicked(&*panic)),
            }
        })
    })
}

/// Does `work`, which nothing can stop, in another thread without the interpreter's lock. Where Ctrl-C is pressed, this
/// thread goes on at once; the work ends in its own time, and what it made is dropped.
pub(crate) fn patient<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    py.detach(|| {
        let (sender, done) = mpsc::channel::<T>();
        let worker = thread::spawn(move || drop(sender.send(work())));
        loop {
            match done.recv_timeout(PAUSE) {
                Ok(made) => return Ok(made),
                Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals())?,
                Err(RecvTimeoutError::Disconnected) => {
                    let panic = worker.join().err();
                    return Err(panic.map_or_else(|| PyRuntimeError::new_err("no result"), |panic| panicked(&*panic)));
                }
            }
        }
    })
}

/// A fault of splatblur itself.
fn panicked(panic: &(dyn std::any::Any + Send)) -> PyErr {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    PyRuntimeError::new_err(format!("a fault in splatblur, please report it: {}", text.unwrap_or("unknown")))
}
