//! The guide: its commands print what its pages say, and every link in the documents leads somewhere.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use crate::support::clients::plants_in;
use crate::support::measured;
use crate::support::paths::ours;

/// The Markdown files of a folder.
fn markdown(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(ours(folder)).unwrap();
    let files = entries.map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension() == Some("md".as_ref()))
        .collect()
}

/// A fenced block of a page: its first line, language and text.
struct Block<'a> {
    line: usize,
    language: &'a str,
    text: &'a str,
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut line = 1;
    let mut blocks = Vec::new();
    for (k, part) in page.split("```").enumerate() {
        if let (1, Some((language, text))) = (k % 2, part.split_once('\n')) {
            blocks.push(Block {
                line: line + 1,
                language,
                text,
            });
        }
        line += part.matches('\n').count();
    }
    blocks
}

/// Run commands as a reader would, and return their output; `None` if they need measured logs that are missing.
fn run(commands: &str, folder: &Path) -> Result<Option<String>, String> {
    let mut shell = Command::new("bash");
    if commands.contains("$RESIDYN_DATA") {
        let Some(set) = measured("dfki_simple_pendulum") else {
            return Ok(None);
        };
        shell.env("RESIDYN_DATA", set.parent().unwrap());
    }
    let program = Path::new(env!("CARGO_BIN_EXE_residyn")).parent().unwrap();
    let mut path = std::env::var("PATH").unwrap();
    if commands.contains("residyn.plants") {
        let Some([(name, package), (_, programs)]) = plants_in(folder) else {
            return Ok(None);
        };
        shell.env(name, package);
        path = programs.into_string().unwrap();
    }
    let output = shell
        .args(["-euo", "pipefail", "-c"])
        .arg(format!("exec 2>&1\n{commands}"))
        .env("PATH", format!("{}:{path}", program.display()))
        .env("REPO", env!("CARGO_MANIFEST_DIR"))
        .current_dir(folder)
        .output()
        .unwrap();
    let printed = String::from_utf8(output.stdout).unwrap();
    if output.status.success() {
        Ok(Some(printed))
    } else {
        Err(format!("{}\n{printed}", output.status))
    }
}

/// Run a block, or compare it with the output of the block before it.
fn try_block(block: &Block, folder: &Path, printed: &mut Option<String>) -> Result<(), String> {
    match (block.language, printed.as_deref()) {
        ("sh", _) => *printed = run(block.text, folder)?,
        ("text", Some(printed)) => {
            compare(block.text, printed).map_err(|what| format!("{what}\n{printed}"))?;
        }
        ("text", None) => {}
        (other, _) => return Err(format!("a block of {other:?}")),
    }
    Ok(())
}

/// Try the blocks of a page in an empty folder, one after the other.
fn try_page(page: &Path) -> Result<(), String> {
    let text = fs::read_to_string(page).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut printed = Some(String::new());
    for block in blocks(&text) {
        try_block(&block, folder.path(), &mut printed)
            .map_err(|what| format!("{}, line {}: {what}", page.display(), block.line))?;
    }
    Ok(())
}

/// The difference between the output that a page shows and the actual output: `...` stands for any text, alone on a
/// line for any lines.
fn compare(shown: &str, printed: &str) -> Result<(), String> {
    let mut printed = printed.lines().filter(|line| !is_progress(line));
    let mut is_gap = false;
    for line in shown.lines() {
        if line == "..." {
            is_gap = true;
            continue;
        }
        let is_there = if is_gap {
            printed.any(|other| is_alike(line, other))
        } else {
            printed.next().is_some_and(|other| is_alike(line, other))
        };
        if !is_there {
            return Err(format!("not printed there: {line}"));
        }
        is_gap = false;
    }
    match printed.next() {
        Some(line) if !is_gap => Err(format!("not shown: {line}")),
        _ => Ok(()),
    }
}

/// Whether a line is a progress line, which long work writes every ten seconds.
fn is_progress(line: &str) -> bool {
    let share = line.split_once(" %: ").map(|(share, _)| share);
    line.starts_with("stage ") || share.is_some_and(|share| share.parse::<u8>().is_ok())
}

/// Whether the words of two lines are the same, where `...` stands for any text.
fn is_alike(shown: &str, printed: &str) -> bool {
    let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let (shown, printed) = (words(shown), words(printed));
    let Some((start, others)) = shown.split_once("...") else {
        return shown == printed;
    };
    let (middle, end) = others.rsplit_once("...").unwrap_or(("", others));
    let Some(mut rest) = printed.strip_prefix(start) else {
        return false;
    };
    for part in middle.split("...") {
        match rest.split_once(part) {
            Some((_, after)) => rest = after,
            None => return false,
        }
    }
    rest.ends_with(end)
}

#[test]
fn every_command_prints_what_its_page_says() {
    let mut pages = markdown("docs/guide");
    pages.push(ours("docs/guide.md"));
    assert!(pages.len() >= 12, "{pages:?}");
    let failures: Vec<String> = thread::scope(|scope| {
        let runs: Vec<_> = pages
            .iter()
            .map(|page| scope.spawn(move || try_page(page)))
            .collect();
        let ends = runs.into_iter().map(|run| run.join().unwrap());
        ends.filter_map(Result::err).collect()
    });
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn a_page_that_says_something_else_is_noticed() {
    let printed = "1 log\n34 %: 3 of 9 epochs\nF_c1 = 0.2010 N m (0.1993 to 0.2027)\n\ndone\n";
    for right in [
        "1 log\nF_c1 = 0.20... N m (0.19... to ...)\n\ndone",
        "...\ndone",
        "1 log\n...",
        "1   log\n...\n\ndone",
    ] {
        assert_eq!(compare(right, printed), Ok(()), "{right}");
    }
    for wrong in [
        "1 log\ndone",
        "1 log",
        "...\nF_c1 = 0.21... N m (0.19... to ...)\n...",
        "...\nF_c1 = 0.20... N m (0.19... to ...",
        "done\n...\n1 log\n...",
        "...\ndone\ndone",
    ] {
        assert!(compare(wrong, printed).is_err(), "{wrong}");
    }
}

/// The text of a page without its blocks of code.
fn prose(page: &str) -> String {
    page.split("```").step_by(2).collect()
}

/// The anchor of a heading, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let text = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = text
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().replace(' ', "-")
}

/// Whether a page has a heading with this anchor.
fn has_anchor(page: &Path, wanted: &str) -> bool {
    let text = prose(&fs::read_to_string(page).unwrap());
    let mut headings = text.lines().filter(|line| line.starts_with('#'));
    headings.any(|heading| anchor(heading) == wanted)
}

#[test]
fn every_link_between_documents_leads_somewhere() {
    let folders = ["", "docs", "docs/guide", "docs/results", "python"];
    let mut count = 0;
    for page in folders.into_iter().flat_map(markdown) {
        let text = prose(&fs::read_to_string(&page).unwrap());
        let links = text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next());
        for link in links.filter(|link| !link.starts_with("http")) {
            let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => page.clone(),
                file => page.parent().unwrap().join(file),
            };
            assert!(target.exists(), "{}: {link}", page.display());
            let is_there = anchor.is_empty() || has_anchor(&target, anchor);
            assert!(is_there, "{}: {link}", page.display());
            count += 1;
        }
    }
    assert!(count > 100, "{count} links");
}
