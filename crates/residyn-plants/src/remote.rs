use std::collections::VecDeque;
use std::path::Path;
use std::time::{Duration, Instant};

use residyn_control::control::{DriveError, Driven, Held};
use residyn_core::data::Log;

use super::address::Address;
use super::description::{Clock, Description};
use super::error::RemoteError;
use super::guard::Guard;
use super::message::{FromPlant, LONGEST_LINE, PROTOCOL, Row, ToPlant};
use super::recorder::Recorder;
use super::wire::{MOST_WAITING, Wire};

/// What the plant is told of who asks.
const PROGRAM: &str = concat!("residyn ", env!("CARGO_PKG_VERSION"));
/// A plant may have to load much before it says hello.
const GREETING: Duration = Duration::from_secs(60);
/// A rig may have to swing out before an episode.
const RESETTING: Duration = Duration::from_secs(300);
/// A step of a slow simulator.
const STEPPING: Duration = Duration::from_secs(30);
/// Bytes of a number, with what separates it from the next.
const LONGEST_NUMBER: usize = 32;
/// Commands that are remembered until rows say when they acted.
const REMEMBERED: usize = 4096;

/// A plant in another process, from its hello on.
pub struct Remote {
    wire: Wire,
    description: Description,
    episode: Option<Episode>,
    /// Time of the last row of the episode before.
    ended_s: Option<f64>,
    lateness: Lateness,
}

/// How late commands came on the wall clock.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lateness {
    /// Periods that passed before a command was ready, over all commands.
    pub late: usize,
    /// Of each command that acted, the periods from the row that it answers until it did.
    latencies: Vec<usize>,
}

impl Lateness {
    /// Periods until a command acts, as a rule: the median. On the wall clock, where a command acts at the next period at the
    /// earliest, 1 before any has.
    pub fn latency(&self) -> usize {
        let mut latencies = self.latencies.clone();
        latencies.sort_unstable();
        latencies.get(latencies.len() / 2).copied().unwrap_or(1)
    }
}

struct Sent {
    id: u64,
    /// For each period in which nothing newer arrives; the last is held.
    commands: Vec<Vec<f64>>,
    /// The period of the row that it answers.
    answers: usize,
    has_acted: bool,
    /// Periods of it that plans know of.
    told: usize,
}

struct Episode {
    guard: Guard,
    row: Row,
    /// Positions, then velocities.
    state: Vec<f64>,
    safe: Vec<f64>,
    /// Commands that may still be in force.
    sent: VecDeque<Sent>,
    id: u64,
    /// Messages with rows so far.
    periods: usize,
    begun: Instant,
    step_s: f64,
    patience: usize,
    /// Periods that plans expect until a command acts.
    expected: usize,
    recorder: Option<Recorder>,
}

impl Remote {
    /// Start a plant or connect to it, and exchange hellos.
    ///
    /// # Errors
    /// A plant that cannot be reached, or whose hello is wrong.
    pub fn open(address: &Address) -> Result<Self, RemoteError> {
        let mut wire = Wire::open(address)?;
        wire.send(&ToPlant::Hello {
            protocol: PROTOCOL,
            program: PROGRAM,
        })?;
        let hello = match wire.receive(GREETING)? {
            FromPlant::Hello(hello) => *hello,
            _ => return Err(refused(&wire, "the first message is a hello".into())),
        };
        if hello.protocol != PROTOCOL {
            let fault = format!("it speaks protocol {}, not {PROTOCOL}", hello.protocol);
            return Err(refused(&wire, fault));
        }
        if let Some(fault) = hello.description.fault() {
            return Err(refused(&wire, fault));
        }
        Ok(Self {
            wire,
            description: hello.description,
            episode: None,
            ended_s: None,
            lateness: Lateness::default(),
        })
    }

    /// What the plant says of itself.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Begin an episode from `start` (positions, then velocities) or from where the plant likes, and keep its rows in
    /// the log at `path`.
    ///
    /// # Errors
    /// A plant that refuses, is silent or breaks the protocol; a file that cannot be made.
    pub fn begin(
        &mut self,
        seed: u64,
        start: Option<&[f64]>,
        path: Option<&Path>,
    ) -> Result<(), RemoteError> {
        self.end()?;
        self.wire.send(&ToPlant::Reset { seed, start })?;
        let joints = self.description.joints.len();
        // Rows of the episode before, whose time goes on, may still be on their way from a plant on the wall clock.
        let ended_s = self.ended_s;
        let is_before = |row: &Row| ended_s.is_some_and(|ended_s| row.time > ended_s);
        let row = loop {
            let rows = self.rows(RESETTING)?;
            if let Some(row) = rows.into_iter().next().filter(|row| !is_before(row)) {
                break row;
            }
        };
        if let Some(fault) = row.fault(joints, None) {
            return Err(refused(&self.wire, fault));
        }
        let recorder = path.map(|path| Recorder::create(path, &self.description));
        let mut episode = Episode {
            guard: Guard::new(&self.description, &row.q),
            state: Vec::new(),
            safe: self.description.safe.clone(),
            sent: VecDeque::new(),
            id: 0,
            periods: 0,
            begun: Instant::now(),
            step_s: self.description.step_s,
            patience: self.description.patience,
            expected: self.lateness.latency(),
            recorder: recorder.transpose()?,
            row: Row {
                time: f64::NEG_INFINITY,
                ..row.clone()
            },
        };
        episode.take(row)?;
        self.episode = Some(episode);
        self.lateness = Lateness::default();
        Ok(())
    }

    /// How late the commands of the newest episode came.
    pub fn lateness(&self) -> &Lateness {
        &self.lateness
    }

    /// End the episode; the plant stays as it is until it begins another or is closed.
    ///
    /// # Errors
    /// A log that cannot be written.
    pub fn end(&mut self) -> Result<(), RemoteError> {
        let Some(mut episode) = self.episode.take() else {
            return Ok(());
        };
        self.ended_s = Some(episode.row.time);
        if let Some(recorder) = &mut episode.recorder {
            recorder.end(&self.description.safe)?;
        }
        Ok(())
    }

    fn send_step(&mut self, command: &[f64], next: &[Vec<f64>]) -> Result<Held, RemoteError> {
        self.refuse_infinite(command, next)?;
        let answers = self.episode.as_ref().expect("it has begun").periods;
        self.catch_up()?;
        // A line has room for them.
        let most = (self.description.next).min(LONGEST_LINE / (LONGEST_NUMBER * command.len()) / 2);
        let episode = self.episode.as_mut().expect("it has begun");
        let late = episode.periods - answers;
        // The plan counts on what acts now, and goes on after the periods that passed without it.
        let next = next.get(late..).unwrap_or_default();
        let commands = episode.admit(command, &next[..next.len().min(most)], late);
        let [sent, next @ ..] = commands.as_slice() else {
            unreachable!("a command and those after it")
        };
        episode.id += 1;
        let id = episode.id;
        self.wire.send(&ToPlant::Step {
            id,
            command: sent,
            next,
        })?;
        let held = Held {
            sent: sent.clone(),
            steps: episode.sent_late(commands, answers, late),
        };
        self.await_rows(id)?;
        self.lateness.late += late;
        Ok(held)
    }

    /// What is not a number is not sent, nor is anything else any more.
    fn refuse_infinite(&mut self, command: &[f64], next: &[Vec<f64>]) -> Result<(), RemoteError> {
        let joints = command.len();
        let mut values = command.iter().chain(next.iter().flatten()).enumerate();
        let Some((place, value)) = values.find(|(_, value)| !value.is_finite()) else {
            return Ok(());
        };
        self.wire.close();
        Err(RemoteError::Command {
            joint: place % joints + 1,
            value: *value,
        })
    }

    /// Rows that came while the command was computed: the plant did not wait.
    fn catch_up(&mut self) -> Result<(), RemoteError> {
        while let Some(message) = self.wire.waiting()? {
            if self.description.clock == Clock::Simulated {
                let fault = "nothing was asked since its last answer".to_owned();
                return Err(refused(&self.wire, fault));
            }
            let rows = self.rows_in(message)?;
            self.take(rows)?;
        }
        Ok(())
    }

    fn await_rows(&mut self, id: u64) -> Result<(), RemoteError> {
        let rows = self.rows(STEPPING)?;
        let acted = rows.last().map(|row| row.command);
        if self.description.clock == Clock::Simulated && acted != Some(id) {
            let fault = format!("the answer to step {id} ends with a row of command {acted:?}");
            return Err(refused(&self.wire, fault));
        }
        self.take(rows)
    }

    fn take(&mut self, rows: Vec<Row>) -> Result<(), RemoteError> {
        let joints = self.description.joints.len();
        let episode = self.episode.as_mut().expect("it has begun");
        episode.periods += 1;
        if let Some(fault) = episode.flood(self.description.clock) {
            return Err(refused(&self.wire, fault));
        }
        for row in rows {
            let fault = row.fault(joints, Some(episode.row.time));
            let fault = fault.or_else(|| episode.fault_of_command(&row));
            if let Some(fault) = fault {
                return Err(refused(&self.wire, fault));
            }
            self.lateness.latencies.extend(episode.take(row)?);
        }
        Ok(())
    }

    fn rows(&mut self, patience: Duration) -> Result<Vec<Row>, RemoteError> {
        let message = self.wire.receive(patience)?;
        self.rows_in(message)
    }

    fn rows_in(&self, message: FromPlant) -> Result<Vec<Row>, RemoteError> {
        match message {
            FromPlant::Rows { rows } if !rows.is_empty() => Ok(rows),
            FromPlant::Rows { .. } => Err(refused(&self.wire, "`rows` is empty".into())),
            _ => Err(refused(&self.wire, "rows were expected".into())),
        }
    }
}

impl Sent {
    /// What acts after so many periods in which nothing newer arrived.
    fn after(&self, periods: usize) -> &[f64] {
        &self.commands[periods.min(self.commands.len() - 1)]
    }
}

impl Episode {
    /// What may be sent, `late` periods after the one that is answered.
    fn admit(&mut self, command: &[f64], next: &[Vec<f64>], late: usize) -> Vec<Vec<f64>> {
        if late > 0 {
            let applied = self.in_silence(late);
            self.guard.applied(applied);
        }
        let (q, qd) = self.state.split_at(command.len());
        let sent = self.guard.admit(command, q, qd);
        let next = self.guard.continued(next);
        [vec![sent], next].concat()
    }

    /// Remember what is sent. Returns a command for each period that passed, in the order in which they act: those of before for as
    /// many periods as are later than plans expect, then the new ones.
    fn sent_late(&mut self, commands: Vec<Vec<f64>>, answers: usize, late: usize) -> Vec<Vec<f64>> {
        let before = late.saturating_sub(self.expected.saturating_sub(1));
        let mut steps = self.tell(before);
        self.sent.push_back(Sent {
            id: self.id,
            commands,
            answers,
            has_acted: false,
            told: 0,
        });
        if self.sent.len() > REMEMBERED {
            self.sent.pop_front();
        }
        steps.extend(self.tell(1 + late - before));
        steps
    }

    /// The newest command's next so many periods.
    fn tell(&mut self, periods: usize) -> Vec<Vec<f64>> {
        let told = self.sent.back().map_or(0, |sent| sent.told);
        if let Some(sent) = self.sent.back_mut() {
            sent.told += periods;
        }
        (told..told + periods)
            .map(|period| self.in_silence(period))
            .collect()
    }

    /// What acts so many periods after the newest command began to act, if nothing newer arrives.
    fn in_silence(&self, periods: usize) -> Vec<f64> {
        let newest = self.sent.back().filter(|_| periods < self.patience);
        newest
            .map_or(self.safe.as_slice(), |sent| sent.after(periods))
            .to_vec()
    }

    fn fault_of_command(&self, row: &Row) -> Option<String> {
        let id = row.command;
        let sent = self.sent.iter().find(|sent| sent.id == id);
        let next = match sent {
            None if id == 0 => 0,
            None => return Some(format!("command {id} was not sent")),
            Some(sent) => sent.commands.len() - 1,
        };
        (row.ahead > next).then(|| format!("command {id} has {next} next ones, not {}", row.ahead))
    }

    /// Rows in more messages than a clock allows: what is read for ever is never answered.
    fn flood(&self, clock: Clock) -> Option<String> {
        let elapsed_s = self.begun.elapsed().as_secs_f64();
        let most = MOST_WAITING as f64 + 2.0 * elapsed_s / self.step_s;
        (clock == Clock::Wall && self.periods as f64 > most).then(|| {
            format!(
                "{} messages with rows came within {elapsed_s:.1} s, but a step takes {} s",
                self.periods, self.step_s
            )
        })
    }

    /// A row that is right. Returns the latency of the command that acted up to it, if it is the first such row.
    fn take(&mut self, mut row: Row) -> Result<Option<usize>, RemoteError> {
        let speeds = row.qd.get_or_insert_with(|| {
            let (apart_s, moved) = (row.time - self.row.time, row.q.iter().zip(&self.row.q));
            moved.map(|(now, then)| (now - then) / apart_s).collect()
        });
        self.state = [row.q.as_slice(), speeds].concat();
        // Ids grow: what was sent before the command that acted is over.
        let is_over = |sent: &Sent| sent.id < row.command;
        while row.command > 0 && self.sent.front().is_some_and(is_over) {
            self.sent.pop_front();
        }
        let acted = self.sent.front_mut();
        let mut acted = acted.filter(|sent| sent.id == row.command);
        let first = acted.as_mut().filter(|sent| !sent.has_acted);
        // It acted from the row before on.
        let latency = first.map(|sent| {
            sent.has_acted = true;
            self.periods.saturating_sub(sent.answers + 1)
        });
        if let Some(recorder) = &mut self.recorder {
            let command = acted.map_or(self.safe.as_slice(), |sent| sent.after(row.ahead));
            recorder.row(&row, command)?;
        }
        self.row = row;
        Ok(latency)
    }
}

impl Driven for Remote {
    fn empty_log(&self) -> Log {
        Log {
            driven_by: self.description.command.quantity(),
            ..Log::empty(self.description.joints.len())
        }
    }

    fn time_s(&self) -> f64 {
        self.episode
            .as_ref()
            .map_or(0.0, |episode| episode.row.time)
    }

    fn measure(&mut self) -> Vec<f64> {
        self.state().to_vec()
    }

    fn state(&self) -> &[f64] {
        let episode = self.episode.as_ref();
        &episode.expect("a plant is driven in an episode").state
    }

    fn safe(&self) -> Vec<f64> {
        self.description.safe.clone()
    }

    fn step(&mut self, command: &[f64], next: &[Vec<f64>]) -> Result<Held, DriveError> {
        Ok(self.send_step(command, next)?)
    }
}

fn refused(wire: &Wire, fault: String) -> RemoteError {
    RemoteError::Refused {
        line: wire.line(),
        fault,
    }
}

#[cfg(test)]
mod tests;
