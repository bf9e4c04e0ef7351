//! Guards calls to crates that panic on damaged files.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// The result of `work`; `None` if it panics, without printing anything.
pub fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    static SILENT: Once = Once::new();
    SILENT.call_once(be_silent);
    let before = GUARDED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(before);
    done.ok()
}

/// From now on, panics that are caught here do not reach the program's hook.
fn be_silent() {
    let message = take_hook();
    set_hook(Box::new(move |panic| {
        if !GUARDED.get() {
            message(panic);
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::guarded;

    #[test]
    fn a_panic_is_caught_and_others_after_it_are_not() {
        assert_eq!(guarded(|| 1), Some(1));
        assert!(guarded(|| panic!("as it must")).is_none());
        assert!(std::panic::catch_unwind(|| panic!("as it must")).is_err());
        assert_eq!(
            guarded(|| guarded(|| panic!("as it must")).is_none()),
            Some(true)
        );
    }
}
