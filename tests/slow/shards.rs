//! Runs in shards: merged, they equal the run of one machine.

use std::collections::BTreeMap;
use std::fs;
use std::time::Duration;

use crate::support::in_folder::kill_after;
use crate::support::run_folders::{ended_alike, files, read};
use crate::support::{Scratch, measured, says};

/// Run a command in shards, one after the other, merge them in `merged`, and do the remaining work; then run it in one
/// go, in `whole`.
fn in_shards_and_whole(scratch: &Scratch, line: &str, of: usize) {
    for k in 1..=of {
        scratch.succeeds(&format!("{line} --shard {k}/{of} --out part-{k}"));
    }
    merge(scratch, of);
    for out in ["merged", "whole"] {
        scratch.succeeds(&format!("{line} --out {out}"));
    }
}

fn merge(scratch: &Scratch, parts: usize) {
    let parts: String = (1..=parts).map(|k| format!(" part-{k}")).collect();
    let message = scratch.json(&format!("merge --out merged{parts}"));
    assert_eq!(message["missing"], serde_json::json!([]));
}

#[test]
fn a_bench_in_shards_has_the_summary_of_one_machine() {
    let scratch = Scratch::new();
    let line = "bench effects --grid $REPO/configs/bench/smoke.toml";
    in_shards_and_whole(&scratch, line, 2);
    let summary = |out: &str| {
        let mut summary = read(&scratch.path(out).join("summary.json"), &["/seconds"]);
        for part in summary["parts"].as_array_mut().unwrap() {
            assert_ne!(part["seconds"].take(), serde_json::Value::Null);
        }
        summary
    };
    assert_eq!(summary("merged"), summary("whole"));
    let cells = scratch.read("merged/cells.jsonl");
    assert_eq!(cells.lines().count(), 3, "nothing was done twice");
}

#[test]
#[cfg(unix)]
fn measured_rigs_in_shards_have_the_results_of_one_machine() {
    let Some(logs) = measured("dfki_simple_pendulum") else {
        return;
    };
    let scratch = Scratch::new();
    std::os::unix::fs::symlink(logs.parent().unwrap(), scratch.path("data")).unwrap();
    let rigs = "--rigs $REPO/configs/bench/rigs.toml --data data";
    let line = format!("bench rigs {rigs} --only simple/as_they simple/plain");
    in_shards_and_whole(&scratch, &line, 3);
    let [merged, whole] = ["merged", "whole"].map(|out| {
        let mut found = files(&scratch.path(out));
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
    let scratch = Scratch::new();
    let line = "sweep --config $REPO/configs/smoke/train-pendulum.toml --seeds 5";
    in_shards_and_whole(&scratch, line, 3);
    let clock = [
        "/totals/wall_s",
        "/totals/models_per_s",
        "/config/command_line",
    ];
    let swept = |out: &str| read(&scratch.path(out).join("sweep.json"), &clock);
    assert_eq!(swept("merged"), swept("whole"));
    // A sweep with another seed is another sweep.
    scratch.succeeds(&format!("{line} --seed 4 --shard 3/3 --out other"));
    let mixed = scratch.refuses("merge part-1 other --out mixed");
    says(&mixed, &["its `seed` is 4, here it is 0; leave it out"]);
    assert!(!scratch.has("mixed"));
    let none = scratch.refuses(&format!("{line} --shard 4/3 --out none"));
    says(&none, &["K is 4 and N is 3"]);
    let lacking = scratch.ends_without("merge part-1 part-3 --out lacking");
    says(&lacking, &["shard 2/3 is not among the parts"]);
    #[cfg(unix)]
    {
        let few_files = "ulimit -n 5; exec \"$0\" merge part-* --out few";
        let mut shell = std::process::Command::new("bash");
        let shell = shell.args(["-c", few_files, env!("CARGO_BIN_EXE_residyn")]);
        let message = shell.current_dir(scratch.folder()).output().unwrap();
        assert_eq!(message.status.code(), Some(2));
        let message = String::from_utf8(message.stderr).unwrap();
        says(&message, &["raise the limit with `ulimit -n`"]);
    }
}

#[test]
fn killed_shards_of_an_experiment_end_with_the_bytes_of_one_machine() {
    let scratch = Scratch::new();
    let config = "--config $REPO/configs/smoke/physics-prior-pendulum.toml";
    let line = format!("experiment physics-prior {config}");
    let shard = |k: usize| format!("{line} --shard {k}/8 --out part-{k}");
    // The first two runs are the hybrid and the network alone with the first seed.
    for (k, done) in [(1, "hybrid-00"), (2, "data_driven-00")] {
        let rounds = scratch.path(&format!("part-{k}/runs/{done}/rounds.jsonl"));
        kill_after(&mut scratch.command(&shard(k)), &rounds, Duration::ZERO);
    }
    let cut = scratch.ends_without("merge part-1 part-2 --out merged");
    says(&cut, &["part-1: shard 1/8 is not finished"]);
    fs::remove_dir_all(scratch.path("merged")).unwrap();
    for k in 1..=8 {
        scratch.succeeds(&shard(k));
    }
    merge(&scratch, 8);
    let runs = |out: &str| files(&scratch.path(out).join("runs"));
    let found = runs("merged");
    for out in ["merged", "whole"] {
        scratch.succeeds(&format!("{line} --out {out}"));
    }
    assert!(found == runs("merged"), "the shards had done all work");
    ended_alike(&scratch.path("merged"), &scratch.path("whole"));
}

/// Evaluation after learning is work for the shards, too.
#[test]
fn receding_horizons_in_shards_are_those_of_one_machine() {
    let scratch = Scratch::new();
    let config = "--config $REPO/configs/smoke/receding-horizon-pendulum.toml";
    let line = format!("experiment receding-horizon {config}");
    in_shards_and_whole(&scratch, &line, 3);
    let scores = files(&scratch.path("merged/runs"));
    let scores = scores.keys().filter(|name| name.contains("/score-"));
    // Two horizons for two methods that learn and two that do not, with two seeds.
    assert_eq!(scores.count(), 16);
    ended_alike(&scratch.path("merged"), &scratch.path("whole"));
}
