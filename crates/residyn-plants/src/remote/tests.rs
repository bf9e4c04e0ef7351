//! A host and a plant that moves by itself, which these tests play on the other side of a connection.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::{self, JoinHandle};

use serde_json::{Value, json};

use super::*;

/// A joint that moves by itself, of 0.01 s a step, with a rate of 1 N m a step.
fn hello() -> Value {
    json!({
        "type": "hello", "protocol": 1, "name": "joint", "joints": ["joint"], "step_s": 0.01, "command": "torque",
        "clock": "wall", "limits": {"command": [[-3.0, 3.0]], "rate": [100.0]}, "safe": [0.25], "patience": 3, "next": 2,
    })
}

fn row(time: f64, command: u64, ahead: usize) -> Value {
    json!({"time": time, "q": [0.0], "qd": [0.0], "command": command, "ahead": ahead})
}

fn rows(rows: &[Value]) -> Value {
    json!({"type": "rows", "rows": rows})
}

/// The plant's side of a connection.
struct Side {
    lines: BufReader<TcpStream>,
    out: TcpStream,
}

impl Side {
    fn hears(&mut self) -> Value {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap()
    }

    fn says(&mut self, message: &Value) {
        writeln!(self.out, "{message}").unwrap();
    }
}

/// A host and what it hears, after the greeting with `hello` and the first row.
fn between<T: Send + 'static>(
    hello: Value,
    act: impl FnOnce(Side) -> T + Send + 'static,
) -> (Remote, JoinHandle<T>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = Address::Tcp(listener.local_addr().unwrap());
    let plant = thread::spawn(move || {
        let out = listener.accept().unwrap().0;
        let lines = BufReader::new(out.try_clone().unwrap());
        let mut side = Side { lines, out };
        assert_eq!(side.hears()["type"], "hello");
        side.says(&hello);
        assert_eq!(side.hears()["type"], "reset");
        side.says(&rows(&[row(0.0, 0, 0)]));
        act(side)
    });
    (Remote::open(&address).unwrap(), plant)
}

#[test]
fn a_step_carries_as_much_of_the_plan_as_the_plant_takes_within_its_limits() {
    let sent = |hello: Value| {
        let (mut remote, plant) = between(hello, |mut side| {
            let step = side.hears();
            side.says(&rows(&[row(0.01, 0, 0)]));
            step
        });
        remote.begin(1, None, None).unwrap();
        let plan = [vec![9.0], vec![-9.0], vec![1.0]];
        let held = remote.step(&[0.5], &plan).unwrap();
        assert_eq!((held.sent, held.steps), (vec![0.5], vec![vec![0.5]]));
        plant.join().unwrap()
    };
    let step = sent(hello());
    assert_eq!(step["command"], json!([0.5]));
    assert_eq!(step["next"], json!([[1.5], [0.5]]));
    let mut takes_none = hello();
    takes_none.as_object_mut().unwrap().remove("next");
    let step = sent(takes_none);
    assert_eq!(step["command"], json!([0.5]));
    assert!(step.get("next").is_none(), "{step}");
}

#[test]
fn the_log_holds_what_acted_whether_the_host_was_in_time_or_not() {
    let (mut remote, plant) = between(hello(), |mut side| {
        side.hears();
        // The command of a row is known from the next.
        let silent = [(0, 0), (1, 0), (1, 1), (1, 2), (0, 0), (0, 0)];
        let silent = (1..).zip(silent);
        let silent: Vec<Value> = silent
            .map(|(period, (id, ahead))| row(0.01 * f64::from(period), id, ahead))
            .collect();
        side.says(&rows(&silent));
    });
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("acted.csv");
    remote.begin(1, None, Some(&log)).unwrap();
    remote.step(&[0.5], &[vec![0.6], vec![0.7]]).unwrap();
    remote.end().unwrap();
    plant.join().unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let torques: Vec<&str> = text
        .lines()
        .skip(1)
        .map(|line| &line[line.rfind(',').unwrap() + 1..])
        .collect();
    assert_eq!(
        torques,
        ["0.25", "0.5", "0.6", "0.7", "0.25", "0.25", "0.25"]
    );
}

#[test]
fn a_row_of_a_command_that_was_not_sent_is_refused() {
    for (id, ahead, words) in [
        (2, 0, "command 2 was not sent"),
        (1, 3, "command 1 has 2 next ones, not 3"),
    ] {
        let (mut remote, plant) = between(hello(), move |mut side| {
            side.hears();
            side.says(&rows(&[row(0.01, id, ahead)]));
        });
        remote.begin(1, None, None).unwrap();
        let refused = remote.step(&[0.5], &[vec![0.6], vec![0.7]]).unwrap_err();
        assert!(refused.to_string().contains(words), "{refused}");
        plant.join().unwrap();
    }
}

#[test]
fn a_command_of_the_plan_that_is_not_a_number_is_not_sent() {
    let (mut remote, plant) = between(hello(), |mut side| side.hears());
    remote.begin(1, None, None).unwrap();
    let refused = remote
        .step(&[0.5], &[vec![0.6], vec![f64::NAN]])
        .unwrap_err();
    assert!(
        refused.to_string().contains("joint 1 is not a number"),
        "{refused}"
    );
    assert_eq!(plant.join().unwrap()["type"], "stop");
}

#[test]
fn a_flood_of_rows_is_not_read_for_ever() {
    let (mut remote, plant) = between(hello(), |mut side| {
        let mut periods = 1..;
        let mut flood = |_| {
            let row = row(0.01 * f64::from(periods.next()?), 0, 0);
            writeln!(side.out, "{}", rows(&[row])).ok()
        };
        // Until the host hangs up.
        while flood(()).is_some() {}
    });
    remote.begin(1, None, None).unwrap();
    let refused = loop {
        if let Err(error) = remote.step(&[0.5], &[]) {
            break error;
        }
    };
    assert!(
        refused
            .to_string()
            .contains("messages with rows came within"),
        "{refused}"
    );
    drop(remote);
    plant.join().unwrap();
}

#[test]
fn a_plant_that_ends_within_a_row_is_not_waited_for() {
    // It ends in the middle of a row.
    let (mut remote, plant) = between(hello(), |mut side| {
        side.hears();
        write!(side.out, "{{\"type\":\"rows\",\"rows\":[").unwrap();
    });
    remote.begin(1, None, None).unwrap();
    let ended = remote.step(&[0.5], &[]).unwrap_err();
    assert!(
        ended.to_string().contains("ended without a word"),
        "{ended}"
    );
    plant.join().unwrap();
}

/// An episode whose plans count on commands that act so many periods later.
fn episode(expected: usize) -> Episode {
    let description: Description = serde_json::from_value(hello()).unwrap();
    Episode {
        guard: Guard::new(&description, &[0.0]),
        row: serde_json::from_value(row(0.0, 0, 0)).unwrap(),
        state: vec![0.0, 0.0],
        safe: description.safe.clone(),
        sent: VecDeque::new(),
        id: 0,
        periods: 0,
        begun: Instant::now(),
        step_s: description.step_s,
        patience: description.patience,
        expected,
        recorder: None,
    }
}

/// A command and its next ones, sent so late. Returns what a planner is told of the periods that passed.
fn sent(episode: &mut Episode, command: f64, next: &[f64], late: usize) -> Vec<f64> {
    let next: Vec<Vec<f64>> = next.iter().map(|next| vec![*next]).collect();
    let commands = episode.admit(&[command], &next, late);
    episode.id += 1;
    episode.sent_late(commands, 0, late).concat()
}

#[test]
fn a_planner_is_told_what_acted_while_its_answer_was_late() {
    let mut episode = episode(1);
    assert_eq!(sent(&mut episode, 0.5, &[0.6, 0.7], 0), [0.5]);
    assert_eq!(sent(&mut episode, 1.0, &[1.1, 1.2], 2), [0.6, 0.7, 1.0]);
    // The watchdog: the safe command after 3 periods of silence. The rate counts from there.
    assert_eq!(
        sent(&mut episode, 2.0, &[], 4),
        [1.1, 1.2, 0.25, 0.25, 1.25]
    );
    // A command without next ones is held.
    assert_eq!(sent(&mut episode, 1.0, &[], 1), [1.25, 1.0]);
}

#[test]
fn lateness_that_plans_expect_puts_no_command_of_before_in_the_place_of_a_new_one() {
    // Every plan takes two periods, and acts two periods after the row that it answers.
    let mut episode = episode(2);
    assert_eq!(sent(&mut episode, 0.5, &[0.6, 0.7], 1), [0.5, 0.6]);
    assert_eq!(sent(&mut episode, 1.0, &[1.1], 1), [1.0, 1.1]);
    // Once it takes one more.
    assert_eq!(sent(&mut episode, 0.8, &[0.9], 2), [1.1, 0.8, 0.9]);
}
