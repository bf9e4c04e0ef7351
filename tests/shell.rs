//! Shell completions and manual pages from the definitions of the commands.

use std::process::Command;

use crate::support::{Scratch, says};

#[test]
fn a_shell_reads_the_completions() {
    let scratch = Scratch::new();
    scratch.file("residyn.bash", scratch.succeeds("completions bash"));
    // Complete the third word of `residyn closeloop --tr`.
    let ask = "source ./residyn.bash; COMP_WORDS=(residyn closeloop --tr); COMP_CWORD=2; \
               _residyn residyn --tr closeloop; echo \"${COMPREPLY[@]}\"";
    let mut shell = Command::new("bash");
    let shell = shell.args(["-c", ask]).current_dir(scratch.folder());
    let completed = shell.output().unwrap().stdout;
    assert_eq!(String::from_utf8_lossy(&completed).trim(), "--train");
}

#[test]
fn every_command_has_a_manual_page() {
    let scratch = Scratch::new();
    scratch.succeeds("man share/man1");
    for command in [
        "residyn",
        "residyn-closeloop",
        "residyn-report",
        "residyn-bench-effects",
    ] {
        let page = scratch.read(&format!("share/man1/{command}.1"));
        says(&page, &[".SH SYNOPSIS"]);
    }
}
