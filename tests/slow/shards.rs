//! Runs in shards: merged, they equal the run of one machine.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::support::in_folder::{json, kill_after, refused, residyn, run};
use crate::support::paths::config;
use crate::support::run_folders::{ended_alike, files, read};
use crate::support::{measured, text};

/// Run `command` in shards, one after the other, merge them in `merged`, and do the remaining work.
fn in_shards(dir: &Path, command: &[&str], of: usize) {
    let shards: Vec<String> = (1..=of).map(|k| format!("{k}/{of}")).collect();
    let parts: Vec<String> = (1..=of).map(|k| format!("part-{k}")).collect();
    for (shard, part) in shards.iter().zip(&parts) {
        json(dir, &[command, &["--shard", shard, "--out", part]].concat());
    }
    merge(dir, &parts);
    json(dir, &[command, &["--out", "merged"]].concat());
}

fn merge(dir: &Path, parts: &[String]) {
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let message = json(dir, &[&["merge", "--out", "merged"], &parts[..]].concat());
    assert_eq!(message["missing"], serde_json::json!([]));
}

#[test]
fn a_bench_in_shards_has_the_summary_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let grid = config("bench/smoke.toml");
    let command = ["bench", "effects", "--grid", &grid];
    in_shards(dir, &command, 2);
    json(dir, &[&command[..], &["--out", "whole"]].concat());
    let summary = |out: &str| read(&dir.join(out).join("summary.json"), &["/seconds"]);
    assert_eq!(summary("merged"), summary("whole"));
    let cells = fs::read_to_string(dir.join("merged/cells.jsonl")).unwrap();
    assert_eq!(cells.lines().count(), 3, "nothing was done twice");
}

#[test]
fn measured_rigs_in_shards_have_the_results_of_one_machine() {
    let Some(logs) = measured("dfki_simple_pendulum") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let (rigs, data) = (config("bench/rigs.toml"), text(logs.parent().unwrap()));
    let only = ["--only", "simple pendulum/as_they", "simple pendulum/plain"];
    let from = ["bench", "rigs", "--rigs", &rigs, "--data", data];
    let command = [&from[..], &only].concat();
    in_shards(dir, &command, 3);
    json(dir, &[&command[..], &["--out", "whole"]].concat());
    let [merged, whole] = ["merged", "whole"].map(|out| {
        let mut found = files(&dir.join(out));
        // It states when it was made.
        found.remove("report.html").unwrap();
        let timeless = found
            .into_iter()
            .map(|(name, bytes)| (name, timeless(&bytes)));
        timeless.collect::<BTreeMap<String, String>>()
    });
    assert_eq!(merged, whole);
    // Two methods on five folds, and two summaries.
    assert_eq!(merged.len(), 12, "{:?}", merged.keys());
}

/// A file without the lines that give durations.
fn timeless(bytes: &[u8]) -> String {
    let lines = str::from_utf8(bytes).unwrap().lines();
    let others = lines.filter(|line| !line.contains("\"seconds\""));
    others.collect::<Vec<_>>().join("\n")
}

#[test]
fn a_sweep_in_shards_has_the_models_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let recipe = config("smoke/train-pendulum.toml");
    let command = ["sweep", "--config", &recipe, "--seeds", "5"];
    in_shards(dir, &command, 3);
    json(dir, &[&command[..], &["--out", "whole"]].concat());
    let clock = [
        "/totals/wall_s",
        "/totals/models_per_s",
        "/config/command_line",
    ];
    let swept = |out: &str| read(&dir.join(out).join("sweep.json"), &clock);
    assert_eq!(swept("merged"), swept("whole"));
    // A sweep with another seed is another sweep.
    let other = ["--seed", "4", "--shard", "3/3", "--out", "other"];
    json(dir, &[&command[..], &other].concat());
    let message = refused(dir, &["merge", "part-1", "other", "--out", "mixed"]);
    assert!(
        message.contains("its `seed` is 4, here it is 0; leave it out"),
        "{message}"
    );
    assert!(!dir.join("mixed").exists());
    let none = refused(
        dir,
        &[&command[..], &["--shard", "4/3", "--out", "none"]].concat(),
    );
    assert!(none.contains("K is 4 and N is 3"), "{none}");
    let lacking = run(dir, &["merge", "part-1", "part-3", "--out", "lacking"]);
    let message = String::from_utf8(lacking.stderr).unwrap();
    assert_eq!(lacking.status.code(), Some(1), "{message}");
    assert!(
        message.contains("shard 2/3 is not among the parts"),
        "{message}"
    );
    #[cfg(unix)]
    {
        let few_files = "ulimit -n 5; exec \"$0\" merge part-* --out few";
        let mut shell = std::process::Command::new("bash");
        let shell = shell.args(["-c", few_files, env!("CARGO_BIN_EXE_residyn")]);
        let message = shell.current_dir(dir).output().unwrap();
        assert_eq!(message.status.code(), Some(2));
        let message = String::from_utf8(message.stderr).unwrap();
        assert!(
            message.contains("raise the limit with `ulimit -n`"),
            "{message}"
        );
    }
}

#[test]
fn killed_shards_of_an_experiment_end_with_the_bytes_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let config = config("smoke/physics-prior-pendulum.toml");
    let command = ["experiment", "physics-prior", "--config", &config];
    let shard = |k: usize| {
        let (shard, part) = (format!("{k}/8"), format!("part-{k}"));
        let mut command = residyn(dir, &command);
        command.args(["--shard", &shard, "--out", &part]);
        command
    };
    // The first two runs are the hybrid and the network alone with the first seed.
    for (k, done) in [(1, "hybrid-00"), (2, "data_driven-00")] {
        let rounds = dir.join(format!("part-{k}/runs/{done}/rounds.jsonl"));
        kill_after(&mut shard(k), &rounds, Duration::ZERO);
    }
    let cut = run(dir, &["merge", "part-1", "part-2", "--out", "merged"]);
    let message = String::from_utf8(cut.stderr).unwrap();
    assert_eq!(cut.status.code(), Some(1), "{message}");
    assert!(
        message.contains("part-1: shard 1/8 is not finished"),
        "{message}"
    );
    fs::remove_dir_all(dir.join("merged")).unwrap();
    for k in 1..=8 {
        assert!(shard(k).output().unwrap().status.success());
    }
    let parts: Vec<String> = (1..=8).map(|k| format!("part-{k}")).collect();
    merge(dir, &parts);
    let runs = |out: &str| files(&dir.join(out).join("runs"));
    let found = runs("merged");
    for out in ["merged", "whole"] {
        json(dir, &[&command[..], &["--out", out]].concat());
    }
    assert!(found == runs("merged"), "the shards had done all work");
    ended_alike(&dir.join("merged"), &dir.join("whole"));
}

/// Evaluation after learning is work for the shards, too.
#[test]
fn receding_horizons_in_shards_are_those_of_one_machine() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let config = config("smoke/receding-horizon-pendulum.toml");
    let command = ["experiment", "receding-horizon", "--config", &config];
    in_shards(dir, &command, 3);
    let scores = files(&dir.join("merged/runs"));
    let scores = scores.keys().filter(|name| name.contains("/score-"));
    // Two horizons for two methods that learn and two that do not, with two seeds.
    assert_eq!(scores.count(), 16);
    json(dir, &[&command[..], &["--out", "whole"]].concat());
    ended_alike(&dir.join("merged"), &dir.join("whole"));
}
