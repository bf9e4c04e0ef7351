use std::process::Command;

use crate::ClientError;

/// The C compiler: `$CC`, which may contain arguments, else `cc`.
pub(crate) fn compiler() -> Command {
    let named = std::env::var("CC").unwrap_or_default();
    let mut words = named.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or("cc"));
    command.args(words);
    command
}

/// Run a compiler.
///
/// # Errors
/// No compiler, or the compiler's own message.
pub(crate) fn compile(mut command: Command) -> Result<(), ClientError> {
    let name = command.get_program().to_string_lossy().into_owned();
    let run = command.output().map_err(|error| {
        ClientError::Unavailable(format!(
            "{name} does not start ({error}); name a C compiler in CC"
        ))
    })?;
    match run.status.success() {
        true => Ok(()),
        false => Err(ClientError::Failed(format!(
            "{name}: {}",
            String::from_utf8_lossy(&run.stderr)
        ))),
    }
}
