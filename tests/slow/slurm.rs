//! `scripts/slurm` on Slurm's own daemons, started here on one node: whatever is killed, the results are those of one
//! machine.

#![cfg(unix)]

use std::fs::{self, File};
use std::io::Write;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::in_folder::json;
use crate::support::paths::{config, ours};
use crate::support::run_folders::ended_alike;
use crate::support::text;

const SHARDS: usize = 8;
/// Tasks that the node runs at a time.
const AT_A_TIME: usize = 4;

/// A cluster of one node, this machine, with all its files in one folder.
struct Slurm {
    folder: tempfile::TempDir,
    munged: Child,
    controller: Child,
    node: Child,
}

/// Whether Slurm is installed; without it, say so loudly. CI must have it.
fn is_installed() -> bool {
    let has = |program: &str| {
        ["/usr/bin", "/usr/sbin"]
            .iter()
            .any(|at| Path::new(at).join(program).exists())
    };
    if ["munged", "slurmctld", "slurmd", "sbatch"]
        .into_iter()
        .all(has)
    {
        return true;
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "CI needs slurmctld, slurmd, slurm-client and munge"
    );
    let note =
        "SKIPPED scripts/slurm: slurmctld, slurmd, slurm-client and munge are not installed\n";
    // Not eprintln!, which the test harness swallows.
    let _ = std::io::stderr().write_all(note.as_bytes());
    false
}

/// The output of a command that must succeed.
fn printed(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().unwrap();
    let errors = String::from_utf8_lossy(&stderr);
    assert!(status.success(), "{command:?}: {errors}");
    String::from_utf8(stdout).unwrap().trim().to_owned()
}

/// Wait for a condition, for at most five minutes.
#[track_caller]
fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(
            begun.elapsed() < Duration::from_secs(300),
            "waited too long until {what}"
        );
        sleep(Duration::from_millis(50));
    }
}

fn signal(name: &str, pids: &[u32]) {
    let pids = pids.iter().map(u32::to_string);
    printed(Command::new("kill").arg(format!("-{name}")).args(pids));
}

/// The configuration of a cluster with its files in the folder `at`. A requeued task waits for as long as a credential
/// lasts.
fn configuration(at: &str) -> String {
    let host = printed(Command::new("uname").arg("-n"));
    let user = printed(Command::new("id").arg("-un"));
    // Both sockets stay open until both ports are known, so that the ports differ.
    let ports = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let [controller, node] = ports.map(|port| port.local_addr().unwrap().port());
    format!(
        "ClusterName=test\n\
         SlurmctldHost={host}(127.0.0.1)\n\
         SlurmctldPort={controller}\n\
         SlurmUser={user}\n\
         SlurmdUser={user}\n\
         AuthInfo=socket={at}/munge.socket,cred_expire=5\n\
         StateSaveLocation={at}/state\n\
         SlurmdSpoolDir={at}/spool\n\
         SlurmctldPidFile={at}/slurmctld.pid\n\
         SlurmdPidFile={at}/slurmd.pid\n\
         ProctrackType=proctrack/linuxproc\n\
         TaskPlugin=task/none\n\
         SelectType=select/cons_tres\n\
         SelectTypeParameters=CR_CPU\n\
         SlurmdParameters=config_overrides\n\
         NodeName=node NodeHostName={host} NodeAddr=127.0.0.1 Port={node} CPUs={AT_A_TIME}\n\
         PartitionName=all Nodes=node Default=YES\n"
    )
}

/// The daemon that signs the others' messages, with a key that nobody else has.
fn munged(at: &Path) -> Command {
    let key: Vec<u8> = (0..128).map(|_| rand::random()).collect();
    fs::write(at.join("munge.key"), key).unwrap();
    printed(Command::new("chmod").arg("600").arg(at.join("munge.key")));
    let mut munged = Command::new("munged");
    munged.args(["--foreground", "--force"]);
    munged.arg(format!("--socket={}", text(&at.join("munge.socket"))));
    let file = |name: &str| format!("--{name}-file={}", text(&at.join(format!("munge.{name}"))));
    munged.args(["key", "pid", "log", "seed"].map(file));
    munged
}

fn slurmctld(at: &Path) -> Command {
    let mut slurmctld = Command::new("slurmctld");
    slurmctld.arg("-D").env("SLURM_CONF", at.join("slurm.conf"));
    slurmctld
}

fn slurmd(at: &Path) -> Command {
    let mut slurmd = Command::new("slurmd");
    slurmd
        .args(["-D", "-N", "node"])
        .env("SLURM_CONF", at.join("slurm.conf"));
    slurmd
}

/// Start a daemon that writes to the common log.
fn begin(at: &Path, mut daemon: Command) -> Child {
    let path = at.join("daemons.log");
    let log = || {
        let opened = File::options().create(true).append(true).open(&path);
        opened.unwrap()
    };
    // Daemons are not on every user's path.
    let programs = format!("{}:/usr/sbin", std::env::var("PATH").unwrap());
    let daemon = daemon.env("PATH", programs).stdout(log()).stderr(log());
    daemon.spawn().unwrap()
}

impl Slurm {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        for name in ["state", "spool"] {
            fs::create_dir(at.join(name)).unwrap();
        }
        fs::write(at.join("slurm.conf"), configuration(text(at))).unwrap();
        let munged = begin(at, munged(at));
        until("munged listens", || at.join("munge.socket").exists());
        let slurm = Self {
            munged,
            controller: begin(at, slurmctld(at)),
            node: begin(at, slurmd(at)),
            folder,
        };
        until("the node is there", || slurm.is_idle());
        slurm
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A client of the cluster.
    fn client(&self, program: impl AsRef<std::ffi::OsStr>, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments);
        command.env("SLURM_CONF", self.path("slurm.conf"));
        command
    }

    fn is_idle(&self) -> bool {
        let output = self.client("sinfo", &["-h", "-o", "%T"]).output().unwrap();
        output.stdout == b"idle\n"
    }

    /// The names of jobs in one of these states; for array jobs, the names of their tasks.
    fn jobs(&self, states: &str) -> Vec<String> {
        let listed = printed(&mut self.client("squeue", &["-h", "-r", "-o", "%i", "-t", states]));
        listed.lines().map(str::to_owned).collect()
    }

    /// Wait until the controller has written its current state to disk.
    fn save(&self, job: &str, mark: &str) {
        let comment = format!("Comment={mark}");
        printed(&mut self.client("scontrol", &["update", &format!("JobId={job}"), &comment]));
        let is_in = |bytes: Vec<u8>| {
            bytes
                .windows(mark.len())
                .any(|part| part == mark.as_bytes())
        };
        until("the controller has saved its state", || {
            fs::read(self.path("state/job_state")).is_ok_and(is_in)
        });
    }

    /// Kill both daemons; tasks go on.
    fn kill(&mut self) {
        for daemon in [&mut self.controller, &mut self.node] {
            daemon.kill().unwrap();
            daemon.wait().unwrap();
        }
    }

    /// Start both daemons after [`Slurm::kill`].
    fn start_again(&mut self) {
        let at = self.folder.path();
        self.controller = begin(at, slurmctld(at));
        self.node = begin(at, slurmd(at));
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let said = fs::read_to_string(self.path("daemons.log"));
            eprintln!("{}", said.unwrap_or_default());
            let _ = self.client("scancel", &["--name=residyn"]).status();
        }
        for daemon in [&mut self.node, &mut self.controller, &mut self.munged] {
            let _ = daemon.kill();
            let _ = daemon.wait();
        }
    }
}

/// The running tasks: number of the shard and process.
fn working(parts: &Path) -> Vec<(usize, u32)> {
    let task = |k: usize| {
        let pid = fs::read_to_string(parts.join(format!(".{k}.lock"))).ok()?;
        let command = fs::read_to_string(format!("/proc/{pid}/cmdline")).ok()?;
        let is_it = command.contains(&format!("\0{k}/{SHARDS}\0"));
        is_it.then(|| Some((k, pid.parse().ok()?)))?
    };
    (1..=SHARDS).filter_map(task).collect()
}

/// The small experiment, with enough work for tasks to be killed in the middle.
fn experiment(at: &Path) -> PathBuf {
    let mut small = fs::read_to_string(config("smoke/physics-prior-pendulum.toml")).unwrap();
    for (from, to) in [
        ("seeds = 2", "seeds = 4"),
        ("rounds = 4", "rounds = 40"),
        ("rounds = 3\n", "rounds = 40\n"),
        ("epochs = 300", "epochs = 3000"),
    ] {
        assert!(small.contains(from), "{from}");
        small = small.replace(from, to);
    }
    let path = at.join("experiment.toml");
    fs::write(&path, small).unwrap();
    path
}

#[test]
fn an_array_job_whose_tasks_and_daemons_are_killed_ends_with_the_bytes_of_one_machine() {
    if !is_installed() {
        return;
    }
    let mut slurm = Slurm::start();
    let (config, out, parts) = (
        experiment(slurm.folder.path()),
        slurm.path("merged"),
        slurm.path("merged.parts"),
    );
    let command = ["experiment", "physics-prior", "--config", text(&config)];
    let submit = ours("scripts/slurm/submit");
    let shards = SHARDS.to_string();
    let array = [&[shards.as_str(), text(&out)], &command[..]].concat();
    let mut submit = slurm.client(submit, &array);
    let merge = printed(submit.env("RESIDYN", env!("CARGO_BIN_EXE_residyn")));

    // A task is killed, and the scheduler puts one back: others take their places.
    let is_full = || working(&parts).len() == AT_A_TIME;
    until("the node is full", is_full);
    let tasks = working(&parts);
    let [(killed, process), (requeued, _), ..] = tasks[..] else {
        panic!("the node was full")
    };
    signal("KILL", &[process]);
    let task = |k: usize| {
        let mut running = slurm.jobs("RUNNING").into_iter();
        running.find(|job| job.ends_with(&format!("_{k}"))).unwrap()
    };
    printed(&mut slurm.client("scontrol", &["requeue", &task(requeued)]));

    // Both daemons are killed, and a task ends before they are back. The tasks are stopped until the controller has
    // written its state to disk: unsaved state is lost when it is killed.
    until("the node is full again", || {
        let others = |&(k, _): &(usize, u32)| ![killed, requeued].contains(&k);
        is_full() && working(&parts).iter().all(others)
    });
    let processes: Vec<u32> = working(&parts).into_iter().map(|task| task.1).collect();
    signal("STOP", &processes);
    slurm.save(&merge, "all-tasks-stand-still");
    slurm.kill();
    signal("CONT", &processes);
    until("a task has ended", || working(&parts).len() < AT_A_TIME);
    slurm.start_again();

    until("the results are there", || {
        out.join("results.json").exists()
    });
    until("no job is left", || {
        slurm.jobs("RUNNING,COMPLETING").is_empty()
    });
    let said = |k: usize| fs::read_to_string(parts.join(format!("{k}.log"))).unwrap();
    assert!(said(killed).contains("Killed"), "{}", said(killed));
    assert!(
        said(requeued).contains("DUE TO JOB REQUEUE"),
        "{}",
        said(requeued)
    );
    let whole = slurm.path("whole");
    json(
        slurm.folder.path(),
        &[&command[..], &["--out", text(&whole)]].concat(),
    );
    ended_alike(&out, &whole);
}
