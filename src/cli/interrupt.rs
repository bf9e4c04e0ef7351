//! Ctrl-C: says what is kept and how to continue, and ends the program. Runs save as they go, so they can be ended at
//! any time.

use std::io::{self, IsTerminal};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};
use std::thread;

use indicatif::ProgressBar;

use super::{command_line, terminal};
use residyn_io::runs::RunFolder;

/// As shells report a program that Ctrl-C ended.
const STATUS: i32 = 130;

/// What a run says, and the folder that it leaves.
struct Run {
    folder: RunFolder,
    says: Box<dyn Fn() -> String + Send>,
}

/// The run to interrupt; locked while something is written that must be complete.
static RUN: Mutex<Option<Run>> = Mutex::new(None);
static HANDLER: Once = Once::new();
static HIT: AtomicBool = AtomicBool::new(false);

/// While it exists, Ctrl-C ends the run in a folder in an orderly way. Afterwards Ctrl-C does what it did before.
pub(super) struct Orderly {
    before: Option<Run>,
}

/// From now on Ctrl-C prints what `says` returns and ends the program; a second one ends it at once.
pub(super) fn orderly(folder: &RunFolder, says: impl Fn() -> String + Send + 'static) -> Orderly {
    let before = run().replace(Run {
        folder: folder.clone(),
        says: Box::new(says),
    });
    // Without a handler Ctrl-C ends the program all the same, and says nothing.
    HANDLER.call_once(|| _ = ctrlc::set_handler(hit));
    Orderly { before }
}

impl Drop for Orderly {
    fn drop(&mut self) {
        *run() = self.before.take();
    }
}

/// As above, in a folder that keeps whatever a bar counts, `rounds` say.
pub(super) fn counted(folder: &RunFolder, bar: &ProgressBar, what: &'static str) -> Orderly {
    let (path, bar) = (folder.path().display().to_string(), bar.clone());
    orderly(folder, move || {
        let (done, of) = (bar.position(), bar.length().unwrap_or(0));
        format!("{path} keeps {done} of {of} {what}; {}", go_on())
    })
}

/// How to resume a run.
pub(super) fn go_on() -> String {
    format!("to resume from there, run again\n  {}", command_line())
}

/// Do work that Ctrl-C has to wait for.
pub(super) fn whole<T>(work: impl FnOnce() -> T) -> T {
    let _run = run();
    work()
}

/// Ctrl-C was typed.
fn hit() {
    if HIT.swap(true, Ordering::SeqCst) {
        process::exit(STATUS);
    }
    thread::spawn(end);
}

fn end() {
    let run = run();
    if let Some(Run { folder, says }) = &*run {
        if io::stderr().is_terminal() {
            // Below the bar.
            terminal::tell("");
        }
        terminal::tell(format!("interrupted: {}", says()));
        folder.leave();
    }
    process::exit(STATUS);
}

fn run() -> MutexGuard<'static, Option<Run>> {
    RUN.lock().unwrap_or_else(PoisonError::into_inner)
}
