//! Messages besides the answer, how much of the answer is printed, and colours (only on a terminal, and not if
//! `NO_COLOR` is set).

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;
use std::time::Instant;

use anstyle::{AnsiColor, Style};
use anyhow::{Context, Result};
use clap::Args;
use serde::Serialize;

/// How much is said.
#[derive(Debug, Clone, Copy, Default, Args)]
pub(super) struct Verbosity {
    /// Print only the headline of the answer, and errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Say on standard error what is done, and how long it took
    #[arg(short, long, global = true)]
    verbose: bool,
}

/// Set once, before anything is said.
static VERBOSITY: OnceLock<Verbosity> = OnceLock::new();

/// Words that a line begins with, and their colours.
const LABELS: [(&str, Style); 5] = [
    ("error", AnsiColor::Red.on_default().bold()),
    ("serious", AnsiColor::Red.on_default().bold()),
    ("interrupted", AnsiColor::Yellow.on_default().bold()),
    ("warning", AnsiColor::Yellow.on_default().bold()),
    ("note", AnsiColor::Cyan.on_default()),
];

impl Verbosity {
    /// Set how much is said on standard error from now on.
    pub fn begin(self) {
        VERBOSITY.get_or_init(|| self);
    }

    fn now() -> Self {
        VERBOSITY.get().copied().unwrap_or_default()
    }
}

/// Print an answer on standard output, or its headline alone; a pipe that was closed is not an error.
pub(super) fn answer(headline: impl Display, whole: &str) -> Result<()> {
    match is_quiet() {
        true => print(&format!("{headline}\n")),
        false => print(whole),
    }
}

/// Print to standard output; a pipe that was closed is not an error.
pub(super) fn print(text: &str) -> Result<()> {
    match anstream::stdout()
        .lock()
        .write_all(coloured(text).as_bytes())
    {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to standard output")
        }
        _ => Ok(()),
    }
}

/// Print a value as JSON on standard output.
pub(super) fn json(value: &impl Serialize) -> Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Whether standard output is a terminal that shows UTF-8, according to its locale.
pub(super) fn shows_curves() -> bool {
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].map(|name| std::env::var(name).unwrap_or_default());
    let locale = locale.into_iter().find(|value| !value.is_empty());
    let is_utf8 = locale.is_some_and(|value| {
        let value = value.to_lowercase();
        value.contains("utf-8") || value.contains("utf8")
    });
    is_utf8 && io::stdout().is_terminal()
}

/// Whether nothing but headlines and errors is asked for.
pub(super) fn is_quiet() -> bool {
    Verbosity::now().quiet
}

/// A line on standard error that a quiet run omits.
pub(super) fn say(line: impl Display) {
    if !is_quiet() {
        tell(line);
    }
}

/// A line on standard error that is always printed.
pub(super) fn tell(line: impl Display) {
    // If nobody reads standard error any more, there is nobody to report to.
    let _ = anstream::stderr()
        .lock()
        .write_all(coloured(&format!("{line}\n")).as_bytes());
}

/// Do some work; a verbose run says what, and how long it took.
pub(super) fn stage<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let done = work();
    took(what, begun);
    done
}

/// In a verbose run, how long something took.
pub(super) fn took(what: &str, begun: Instant) {
    if Verbosity::now().verbose {
        tell(format!("{:>8.2} s  {what}", begun.elapsed().as_secs_f64()));
    }
}

/// The text with colours on the labels of its lines.
fn coloured(text: &str) -> String {
    text.split_inclusive('\n').map(labelled).collect()
}

fn labelled(line: &str) -> String {
    let is_label = |label: &str| {
        let rest = line.strip_prefix(label);
        rest.is_some_and(|rest| rest.starts_with([':', ' ']))
    };
    match LABELS.iter().find(|(label, _)| is_label(label)) {
        Some((label, style)) => format!("{style}{label}{style:#}{}", &line[label.len()..]),
        None => line.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::coloured;

    #[test]
    fn labels_have_colours_and_other_words_none() {
        let plain = "erroneous\n  error: no\nno error\n";
        assert_eq!(coloured(plain), plain);
        let labelled = coloured("one\nerror: two\nwarning  three\n");
        let plain = anstream::adapter::strip_str(&labelled).to_string();
        assert_eq!(plain, "one\nerror: two\nwarning  three\n");
        assert_eq!(labelled.matches("\u{1b}[").count() % 2, 0);
        assert!(
            labelled.contains("\u{1b}[1m\u{1b}[31merror\u{1b}[0m: two"),
            "{labelled:?}"
        );
    }
}
