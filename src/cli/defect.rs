//! A panic is a defect of the program, whatever the input was.

use std::fmt::Display;
use std::panic::set_hook;

use super::{command_line, voice};
use crate::guarded::is_guarded;

/// From now on a panic says what it is, and what to report.
pub(super) fn tell_of_panics() {
    set_hook(Box::new(|panic| {
        if !is_guarded() {
            voice::tell(told(panic));
        }
    }));
}

fn told(panic: impl Display) -> String {
    format!(
        "error: a defect of residyn {}, not of your input: {panic}\n\
         please report it, with the files that this command reads:\n  {}",
        env!("CARGO_PKG_VERSION"),
        command_line()
    )
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::{is_guarded, told};
    use crate::guarded::guarded;

    #[test]
    fn a_panic_is_told_with_version_place_and_command() {
        let (send, told_of) = channel();
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let _ = send.send((is_guarded(), told(panic)));
        }));
        assert!(guarded(|| panic!("as it must")).is_none());
        std::panic::set_hook(before);
        let (expected, told) = told_of.recv().unwrap();
        assert!(expected && !is_guarded());
        let version = env!("CARGO_PKG_VERSION");
        for part in [version, "defect.rs:", "as it must", "\n  residyn"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
