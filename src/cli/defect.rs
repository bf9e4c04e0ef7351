//! Messages of panics: a panic is a defect of the program, whatever the input was.

use std::fmt::Display;
use std::panic::set_hook;

use super::{ARGUMENTS, command_line, terminal};

/// From now on a panic says what it is, and what to report.
pub fn tell_of_panics() {
    set_hook(Box::new(|panic| terminal::tell(message(panic))));
}

fn message(panic: impl Display) -> String {
    let with = match ARGUMENTS.get() {
        Some(_) => format!("the files that this command reads:\n  {}", command_line()),
        None => "the calls of your program and the files that it reads".to_owned(),
    };
    format!(
        "error: a defect in residyn {}, not in your input: {panic}\nplease report it, with {with}",
        env!("CARGO_PKG_VERSION"),
    )
}

#[cfg(test)]
mod tests {
    use super::message;

    #[test]
    fn a_panic_is_reported_with_version_and_place() {
        let message = message("panicked at defect.rs:1:2:\nas it must");
        let version = env!("CARGO_PKG_VERSION");
        for part in [version, "defect.rs:", "as it must", "your program"] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}
