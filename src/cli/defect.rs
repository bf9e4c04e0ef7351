//! A panic is a defect of the program, whatever the input was.

use std::fmt::Display;
use std::panic::set_hook;

use super::{ARGUMENTS, command_line, voice};
use crate::guarded::is_guarded;

/// From now on a panic says what it is, and what to report; one that is caught, below a reader of damaged files, says nothing.
pub fn tell_of_panics() {
    set_hook(Box::new(|panic| {
        if !is_guarded() {
            voice::tell(told(panic));
        }
    }));
}

fn told(panic: impl Display) -> String {
    let with = match ARGUMENTS.get() {
        Some(_) => format!("the files that this command reads:\n  {}", command_line()),
        None => "the calls of your program and the files that it reads".to_owned(),
    };
    format!(
        "error: a defect of residyn {}, not of your input: {panic}\nplease report it, with {with}",
        env!("CARGO_PKG_VERSION"),
    )
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::{is_guarded, told};
    use crate::guarded::guarded;

    #[test]
    fn a_panic_is_told_with_version_and_place() {
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
        for part in [version, "defect.rs:", "as it must", "your program"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
