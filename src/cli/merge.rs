use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::json;

use super::{Answer, terminal};
use residyn_io::runs::{Lacking, RunFolder, merge};

/// Merge the parts of a run that --shard did separately, on several machines say
///
/// Parts with other settings or from another build of the program are refused. Afterwards the command of the parts,
/// without --shard and with this --out, finds the work done and writes its results, the same as those of a run on one
/// machine; it would do any missing work itself. The exit status is 1 if a part is missing or not finished.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  \
        residyn bench effects --shard 1/2 --out part-1\n  \
        residyn bench effects --shard 2/2 --out part-2\n  \
        residyn merge part-1 part-2 --out bench-effects\n  \
        residyn bench effects --out bench-effects")]
pub(super) struct Arguments {
    /// Folders of the parts
    #[arg(required = true, value_name = "DIR")]
    parts: Vec<PathBuf>,
    /// Folder of the run; what it holds already is kept
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print the result as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// "No" if the run is not complete.
pub(super) fn run(arguments: &Arguments) -> Result<Answer> {
    let Arguments { parts, out, json } = arguments;
    let lacking = merge(parts, &RunFolder::open(out)?)?;
    for line in message(&lacking) {
        terminal::tell(format!("warning: {line}"));
    }
    if *json {
        let missing: Vec<String> = lacking.missing.iter().map(ToString::to_string).collect();
        let unfinished: Vec<_> = lacking.unfinished.iter().map(|(_, path)| path).collect();
        let value = json!({"schema": 1, "out": out, "parts": parts.len(), "missing": missing, "unfinished": unfinished});
        terminal::json(&value)?;
    } else {
        let text = format!("{} parts are merged in {}\n", parts.len(), out.display());
        terminal::answer(out.display(), &text)?;
    }
    Ok(Answer::of(lacking == Lacking::default()))
}

fn message(lacking: &Lacking) -> Vec<String> {
    let rest = "merge again when it is, or let the command without --shard do the rest";
    let missing = lacking
        .missing
        .iter()
        .map(|shard| format!("shard {shard} is not among the parts; {rest}"));
    let unfinished = lacking
        .unfinished
        .iter()
        .map(|(shard, path)| format!("{}: shard {shard} is not finished; {rest}", path.display()));
    missing.chain(unfinished).collect()
}
