//! A panic is a defect of the program, whatever the input was.

use std::fmt::Display;
use std::panic::set_hook;

use super::{ARGUMENTS, command_line, voice};

/// From now on a panic says what it is, and what to report.
pub fn tell_of_panics() {
    set_hook(Box::new(|panic| voice::tell(told(panic))));
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
    use super::told;

    #[test]
    fn a_panic_is_told_with_version_and_place() {
        let told = told("panicked at defect.rs:1:2:\nas it must");
        let version = env!("CARGO_PKG_VERSION");
        for part in [version, "defect.rs:", "as it must", "your program"] {
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
