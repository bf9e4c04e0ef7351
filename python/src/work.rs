//! Runs long work while Python keeps handling signals.

use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How long Ctrl-C may go unheard.
const LISTEN_EVERY: Duration = Duration::from_millis(50);

/// How far work may run ahead of what Python has heard of it: if the callback ends a training at some epoch, the
/// training ends there and not long after.
const AHEAD: usize = 16;

/// How long to wait for work that is to stop, so that Ctrl-C has its effect within a second.
const GRACE: Duration = Duration::from_millis(800);

/// Receives the progress of long work.
#[derive(Clone)]
pub struct Listener<M> {
    messages: SyncSender<M>,
    stopped: Arc<AtomicBool>,
}

/// Unwinds the thread of work that nobody waits for any more. No message is printed.
struct Stopped;

impl<M> Listener<M> {
    /// Report progress; does not return if the work is to stop.
    pub fn tell(&self, message: M) {
        if self.tell_or_stop(message).is_break() {
            resume_unwind(Box::new(Stopped));
        }
    }

    /// Report progress, and hear whether to go on; waits if Python is far behind.
    pub fn tell_or_stop(&self, message: M) -> ControlFlow<()> {
        match !self.stopped.load(Ordering::Relaxed) && self.messages.send(message).is_ok() {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        }
    }
}

/// Work on a separate thread without the interpreter's lock; `heard` receives its messages, with the lock.
///
/// On a signal (Ctrl-C), or if `heard` raises, the work ends at its next message, and this returns then, or without
/// waiting for it if that takes long.
pub fn interruptible<T, M>(
    py: Python<'_>,
    work: impl FnOnce(&Listener<M>) -> T + Send + 'static,
    mut heard: impl FnMut(M) -> PyResult<()>,
) -> PyResult<T>
where
    T: Send + 'static,
    M: Send + 'static,
{
    let (messages, mut inbox) = sync_channel(AHEAD);
    let stopped = Arc::new(AtomicBool::new(false));
    let listener = Listener {
        messages,
        stopped: Arc::clone(&stopped),
    };
    let worker = thread::spawn(move || work(&listener));
    let mut listen = || -> PyResult<bool> {
        // A receiver may move to where there is no lock, but not be shared with it.
        let inbox = &mut inbox;
        let next = py.detach(move || inbox.recv_timeout(LISTEN_EVERY));
        py.check_signals()?;
        match next {
            Ok(message) => heard(message).map(|()| true),
            Err(why) => Ok(why == RecvTimeoutError::Timeout),
        }
    };
    let listened = loop {
        match listen() {
            Ok(true) => {}
            Ok(false) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    // Work that waits to be heard goes on.
    drop(inbox);
    listened.inspect_err(|_| stop(py, &stopped, &worker))?;
    let ended = py.detach(|| worker.join());
    Ok(ended.unwrap_or_else(|panic| resume_unwind(panic)))
}

/// Tell the work to stop, and give it a moment to do so in order.
fn stop<T>(py: Python<'_>, stopped: &AtomicBool, worker: &JoinHandle<T>) {
    stopped.store(true, Ordering::Relaxed);
    let end = Instant::now() + GRACE;
    py.detach(|| {
        while !worker.is_finished() && Instant::now() < end {
            thread::sleep(Duration::from_millis(5));
        }
    });
}
