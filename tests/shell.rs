//! Shell completions and manual pages from the definitions of the commands.

use std::fs;
use std::process::Command;

use crate::support::{succeeds, text};

#[test]
fn a_shell_reads_the_completions() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("residyn.bash");
    fs::write(&file, succeeds(&["completions", "bash"])).unwrap();
    // Complete the third word of `residyn closeloop --tr`.
    let ask = format!(
        "source {}; COMP_WORDS=(residyn closeloop --tr); COMP_CWORD=2; _residyn residyn --tr closeloop; echo \"${{COMPREPLY[@]}}\"",
        text(&file)
    );
    let shell = Command::new("bash").args(["-c", &ask]).output().unwrap();
    assert_eq!(String::from_utf8_lossy(&shell.stdout).trim(), "--train");
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let manual = folder.path().join("share/man1");
    succeeds(&["man", text(&manual)]);
    for command in [
        "residyn",
        "residyn-closeloop",
        "residyn-report",
        "residyn-bench-effects",
    ] {
        let page = fs::read_to_string(manual.join(format!("{command}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{command}");
    }
}
