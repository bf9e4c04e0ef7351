use residyn_core::closeloop::{Outcome, Progress, Request, Settings, Split, close_loop};
use residyn_core::data::{Log, Quantity};
use residyn_core::model::{Library, Model};
use residyn_core::sim::metric::assess;
use residyn_core::streams::{Purpose as Draws, stream};
use residyn_excite::Limits;
use residyn_io::runs::RunFolder;
use residyn_plants::{Controlled, plant_seed};
use serde::{Deserialize, Serialize};

use super::choice::{Choice, Choose, Known};
use super::error::InvestigateError;
use super::follow::Follow;
use super::kept::Kept;
use super::play::play;
use super::region::Region;
use super::round::Round;
use super::tracking::Tracking;

/// Runs before anything is taken for certain: with three, one log is set apart.
const LEAST_RUNS: usize = 3;
/// Rounds with the same answer after which further motion that is expected to tell nothing is not played.
const STANDSTILL: usize = 3;
/// Length of the predictions by which a model is judged, s.
const AHEAD_S: f64 = 0.5;

/// What is investigated, and how.
pub struct Investigation<'a> {
    /// The declared model.
    pub model: &'a Model,
    pub library: &'a Library,
    pub plant: &'a Controlled,
    /// Within which the plant moves.
    pub limits: &'a Limits,
    /// Most motion in all, s.
    pub motion_s: f64,
    /// Of one run, s.
    pub run_s: f64,
    pub choose: &'a dyn Choose,
    pub seed: u64,
}

/// Why an investigation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// Every name is established, nothing significant is left, and the last run, which was new, changed no name.
    Settled,
    /// Something is open, the last runs changed nothing, and no motion within the limits is expected to tell more.
    NothingTells,
    /// Something is open, and the motion that was allowed is used up.
    OutOfMotion,
}

/// The result of an investigation.
pub struct Investigated {
    pub ended: Ended,
    pub rounds: Vec<Round>,
    /// Of all runs.
    pub outcome: Outcome,
    /// Where the model was tested.
    pub region: Region,
}

/// Follows an investigation.
pub trait Watch: Sync {
    /// A motion is about to be played as this run.
    fn plays(&self, run: usize, choice: &Choice);

    /// A round ended, or was found in the folder.
    fn ended(&self, round: &Round);

    /// What closing the loop is doing; each time begins with the audit.
    fn closes(&self, progress: &Progress<'_>);

    /// Whether the present search for effects is to end as it stands: the round is not settled then.
    fn has_to_end(&self) -> bool {
        false
    }
}

/// Passes progress on.
struct Closing<'w>(&'w dyn Watch);

impl residyn_core::closeloop::Watch for Closing<'_> {
    fn see(&self, progress: Progress<'_>) {
        self.0.closes(&progress);
    }

    fn has_to_end(&self) -> bool {
        self.0.has_to_end()
    }
}

impl Investigation<'_> {
    /// Carry it out in a folder, or the rest of one that was interrupted.
    ///
    /// # Errors
    /// A model of another plant, a plant that fails, logs on which the loop cannot be closed.
    pub fn carry_out(
        &self,
        folder: &RunFolder,
        watch: &dyn Watch,
    ) -> Result<Investigated, InvestigateError> {
        self.check()?;
        let mut kept = Kept::open(folder, self.plant)?;
        for round in &kept.rounds {
            watch.ended(round);
        }
        let mut outcome = match kept.logs.is_empty() {
            true => None,
            false => Some(self.close(&kept.logs, watch)?),
        };
        let ended = loop {
            if is_settled(&kept.rounds) {
                break Ended::Settled;
            }
            let moved_s = kept.rounds.last().map_or(0.0, |round| round.motion_s);
            if moved_s + self.run_s > self.motion_s * (1.0 + 1e-9) {
                break Ended::OutOfMotion;
            }
            let choice = self.choice(kept.logs.len(), outcome.as_ref())?;
            if choice.is_helpless && is_at_a_standstill(&kept.rounds) {
                break Ended::NothingTells;
            }
            let run = kept.logs.len() + 1;
            watch.plays(run, &choice);
            let log = self.play(&choice, run, &kept)?;
            kept.keep_log(&log)?;
            let newest = &kept.logs[run - 1..];
            let before = outcome.as_ref().map(|outcome| error_on(newest, outcome));
            let now = self.close(&kept.logs, watch)?;
            let errors = (before, error_on(newest, &now));
            let motion_s = moved_s + newest[0].duration();
            let round = Round::new(run, choice.purpose, motion_s, &now, errors);
            watch.ended(&round);
            kept.keep(round)?;
            outcome = Some(now);
        };
        Ok(Investigated {
            ended,
            region: Region::of(&kept.logs),
            rounds: kept.rounds,
            outcome: outcome.expect("`check` leaves motion for a run"),
        })
    }

    fn check(&self) -> Result<(), InvestigateError> {
        let Self {
            model,
            plant,
            motion_s,
            run_s,
            ..
        } = self;
        if model.joints != plant.joints() {
            return Err(InvestigateError::Joints {
                model: model.name.clone(),
                found: model.joints,
                plant: plant.name().to_owned(),
                joints: plant.joints(),
            });
        }
        let taken = plant.driven_by();
        if taken != model.driven_by() {
            return Err(InvestigateError::Driven {
                model: model.name.clone(),
                found: words(model.driven_by()),
                plant: plant.name().to_owned(),
                taken: words(taken),
            });
        }
        match motion_s >= run_s {
            true => Ok(()),
            false => Err(InvestigateError::TooShort {
                motion_s: *motion_s,
                run_s: *run_s,
            }),
        }
    }

    fn choice(&self, runs: usize, outcome: Option<&Outcome>) -> Result<Choice, InvestigateError> {
        let known = Known {
            model: self.model,
            library: self.library,
            limits: self.limits,
            run_s: self.run_s,
            runs,
            outcome,
            seed: plant_seed(&stream(self.seed, Draws::Other(runs))),
        };
        Ok(self.choose.choose(&known)?)
    }

    fn play(&self, choice: &Choice, run: usize, kept: &Kept) -> Result<Log, InvestigateError> {
        let design = &choice.design;
        let start: Vec<f64> = design.q.iter().map(|q| q[0]).collect();
        let tracking = match self.plant.driven_by() {
            Quantity::Command => Tracking::Plant,
            _ => Tracking::of(self.model, &start)?,
        };
        let mut follow = Follow::new(design, tracking, self.limits);
        let noise = stream(self.seed, Draws::Gather(run));
        let seed = plant_seed(&stream(self.seed, Draws::Start(run)));
        let how = (start.as_slice(), design.duration_s, design.step_s);
        let log = play(self.plant, &mut follow, how, (seed, noise), &kept.log(run))?;
        match follow.runaway() {
            Some(runaway) => Err(InvestigateError::RanAway { run, runaway }),
            None => Ok(log),
        }
    }

    fn close(&self, logs: &[Log], watch: &dyn Watch) -> Result<Outcome, InvestigateError> {
        let run = logs.len();
        let split = Split::of(logs.to_vec(), &Settings::default().split);
        let model = self.model.for_sent_torques();
        let request = Request::new(&model, self.library, split);
        let mut rng = stream(self.seed, Draws::Other(1_000_000 + run));
        let closed = close_loop(request, &mut rng, &Closing(watch));
        closed.map_err(|source| InvestigateError::Study { run, source })
    }
}

/// Whether the last two rounds left nothing open and have the same names, the last on a run that the one before had not seen.
fn is_settled(rounds: &[Round]) -> bool {
    match rounds {
        [.., before, last] if rounds.len() >= LEAST_RUNS => {
            last.is_settled() && last.agrees(before)
        }
        _ => false,
    }
}

/// Whether the last runs changed nothing of what is established and what is open.
fn is_at_a_standstill(rounds: &[Round]) -> bool {
    let last = &rounds[rounds.len().saturating_sub(STANDSTILL)..];
    last.len() == STANDSTILL && last.windows(2).all(|pair| pair[0].says_as(&pair[1]))
}

/// The open-loop error of an outcome's model on logs.
fn error_on(logs: &[Log], outcome: &Outcome) -> f64 {
    let dynamics = outcome.models.after.model.dynamics();
    assess(&dynamics, logs, &[AHEAD_S]).position_rms()
}

fn words(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Command => "commanded positions",
        _ => "torques",
    }
}
