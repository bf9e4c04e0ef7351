//! The command line: parse the arguments, call the library, print the results.

mod audit;
mod bench;
mod call;
mod check;
mod closeloop;
mod control;
mod defect;
mod effect_setting;
mod elsewhere;
mod evaluate;
mod excitation;
mod excite;
mod experiment;
mod export;
mod fitting;
mod gains;
mod import;
mod inputs;
mod interrupt;
mod investigate;
mod list;
mod mbrl;
mod merge;
mod monitor;
mod new;
mod notes;
mod progress;
mod record;
mod remedy;
mod report;
mod shard;
mod shell;
mod simulate;
mod status;
mod sweep;
mod terminal;
mod train;
mod tune;

use std::ffi::OsString;
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::OnceLock;

use anyhow::Result;
use clap::{Args, Parser, Subcommand};
use serde::Serialize;

pub use self::defect::tell_of_panics;
use residyn_train::Backend;

/// From a rig's log to the physical effect that its model lacks.
#[derive(Debug, Parser)]
#[command(
    name = "residyn",
    version,
    propagate_version = true,
    arg_required_else_help = true
)]
struct Cli {
    #[command(flatten)]
    verbosity: terminal::Verbosity,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Closeloop(closeloop::Arguments),
    Report(report::Arguments),
    Audit(audit::Arguments),
    Check(check::Arguments),
    Train(train::Arguments),
    Tune(tune::Arguments),
    Sweep(sweep::Arguments),
    Evaluate(evaluate::Arguments),
    Excite(excite::Arguments),
    Investigate(investigate::Arguments),
    Control(control::Arguments),
    Monitor(monitor::Arguments),
    Mbrl(mbrl::Arguments),
    Experiment(experiment::Arguments),
    Simulate(simulate::Arguments),
    Export(export::Arguments),
    Import(import::Arguments),
    New(new::Arguments),
    List(list::Arguments),
    Bench(bench::Arguments),
    Merge(merge::Arguments),
    Completions(shell::Completions),
    Man(shell::Man),
}

/// Arguments of every command.
#[derive(Debug, Clone, Args)]
pub(crate) struct Common {
    /// Print the result as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Seed of everything random; the same seed gives the same result on the same machine
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Backend of tensor operations: ndarray, or cuda in a build that has it
    #[arg(long, default_value_t)]
    device: Backend,
}

/// The answer of a command that could run.
enum Answer {
    Yes,
    No,
}

impl Answer {
    fn of(yes: bool) -> Self {
        match yes {
            true => Self::Yes,
            false => Self::No,
        }
    }
}

impl Common {
    /// Print a result as JSON if that is asked for, else as text, or only its headline in a quiet run.
    fn answer<T: Serialize>(
        &self,
        value: impl FnOnce() -> T,
        headline: impl Display,
        text: &str,
    ) -> Result<()> {
        match self.json {
            true => terminal::json(&value()),
            false => terminal::answer(headline, text),
        }
    }
}

/// The command line that the program runs on.
static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// The file that holds the program's code, if that is not the executable of the process.
static LIBRARY: OnceLock<PathBuf> = OnceLock::new();

/// [`run`], by another program that has loaded this one as the library `file`.
pub fn run_from(file: PathBuf, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    LIBRARY.get_or_init(|| file);
    run(arguments)
}

/// Run the program on a command line, the name of the program first: exit status 0 if done, 1 if it ran and the answer
/// is no, 2 if it could not run. Only once per process.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments = ARGUMENTS.get_or_init(|| arguments.into_iter().collect());
    let Cli { verbosity, command } = Cli::parse_from(arguments);
    verbosity.begin();
    tell_of_panics();
    let result = match command {
        Command::Closeloop(arguments) => closeloop::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Audit(arguments) => audit::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Train(arguments) => train::run(&arguments),
        Command::Tune(arguments) => tune::run(&arguments),
        Command::Sweep(arguments) => sweep::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Excite(arguments) => excite::run(&arguments),
        Command::Investigate(arguments) => investigate::run(&arguments),
        Command::Control(arguments) => control::run(&arguments),
        Command::Monitor(arguments) => monitor::run(&arguments),
        Command::Mbrl(arguments) => mbrl::run(&arguments),
        Command::Experiment(arguments) => experiment::run(&arguments),
        Command::Simulate(arguments) => simulate::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::New(arguments) => new::run(&arguments),
        Command::List(arguments) => list::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Completions(arguments) => shell::completions(&arguments),
        Command::Man(arguments) => shell::man(&arguments),
    };
    match result {
        Ok(Answer::Yes) => 0,
        Ok(Answer::No) => 1,
        Err(error) => {
            terminal::tell(format!("error: {}", message(&error)));
            status::status(&error)
        }
    }
}

/// The command line, as a shell takes it.
fn command_line() -> String {
    let words = ARGUMENTS.get().into_iter().flatten().skip(1);
    let words = words.map(|word| quoted(&word.to_string_lossy()));
    let all: Vec<String> = std::iter::once("residyn".to_owned()).chain(words).collect();
    all.join(" ")
}

/// A word for a shell.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=,:@+%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// An error, its causes and what to do. A cause that the message before it contains is not repeated.
fn message(error: &anyhow::Error) -> String {
    let mut message = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if !message.contains(&cause) {
            message += if message.is_empty() { "" } else { ": " };
            message += &cause;
        }
    }
    if let Some(remedy) = error.chain().find_map(remedy::remedy) {
        message += "; ";
        message += remedy;
    }
    message
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_shell_takes_a_quoted_word_as_it_is() {
        for (word, expected) in [
            ("--seed", "--seed"),
            ("a b.toml", "'a b.toml'"),
            ("it's", r"'it'\''s'"),
            ("", "''"),
            ("$HOME", "'$HOME'"),
        ] {
            assert_eq!(quoted(word), expected);
        }
    }
}
