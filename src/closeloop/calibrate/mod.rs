//! Stage 10: what some logs can show: how often the search names an effect where there is none, and how small an effect
//! it would name.

mod detection_limit;
mod simulated_logs;
#[cfg(test)]
mod tests;

pub use self::detection_limit::{DetectionLimit, Smallest};

use rand::Rng;

use self::detection_limit::detection_limits;
use self::simulated_logs::SimulatedLogs;
use super::error::StudyError;
use super::find::{Found, find};
use super::fitted::Fitted;
use super::space::Space;
use super::study::Study;
use crate::data::Log;
use crate::data::statistics::wilson;
use crate::model::{FittedEffect, Library, Model, Status};

/// The results of the search on logs simulated from the accepted model, with the torques and the noise of the user's.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// What was named in each simulation of the accepted model: every one a false alarm.
    pub named: Vec<Vec<FittedEffect>>,
    /// Number of them with a significant unexplained remainder.
    pub unexplained: usize,
    pub limits: Vec<DetectionLimit>,
    /// Effects were hidden at this multiple of their smallest size.
    pub hidden: f64,
    /// Of each joint in the training logs.
    pub top_torque: Vec<f64>,
}

/// Effects that are hidden: those that most rigs have.
const COMMON: [&str; 4] = [
    "viscous_friction",
    "coulomb_friction",
    "constant_torque",
    "actuator_gain",
];

impl Calibration {
    /// Simulations in which something was named.
    pub fn alarms(&self) -> usize {
        self.named.iter().filter(|named| !named.is_empty()).count()
    }

    /// Their share.
    #[allow(clippy::cast_precision_loss)] // few runs
    pub fn rate(&self) -> f64 {
        self.alarms() as f64 / self.named.len().max(1) as f64
    }

    /// 95 % interval of that share.
    pub fn rate_ci95(&self) -> [f64; 2] {
        wilson(self.alarms(), self.named.len())
    }
}

/// The effect to hide, if it is one of those that are.
fn hidden(limit: &DetectionLimit, multiple: f64) -> Option<FittedEffect> {
    let Smallest::Detectable { switch, values } = &limit.smallest else {
        return None;
    };
    let mut hidden = limit.effect.clone();
    hidden.values = values.iter().map(|value| (*value, None)).collect();
    hidden.values[*switch].0 *= multiple;
    COMMON
        .contains(&hidden.effect.name.as_str())
        .then_some(hidden)
}

/// Progress of the work, for a display.
#[derive(Debug, Clone, Copy)]
pub struct Repetition<'s> {
    pub number: usize,
    pub of: usize,
    pub text: &'s str,
}

/// Simulate `runs` sets of training logs from a model that [`find`] accepted, and sets with common effects hidden
/// in them, and search each as the user's own.
///
/// # Errors
/// A study of torques; and as [`Study::fit_declared`].
pub fn calibrate(
    study: &Study<'_>,
    accepted: &Fitted,
    library: &Library,
    runs: usize,
    rng: &mut impl Rng,
    progress: &mut (dyn FnMut(Repetition<'_>) + Send),
) -> Result<Calibration, StudyError> {
    if study.space == Space::Torque {
        return Err(StudyError::NotOfMotion);
    }
    let simulated = SimulatedLogs::new(study, accepted)?;
    let mut limits = detection_limits(study, accepted, library.effects())?;
    let multiple = study.settings.calibrate.hidden;
    let tried = limits
        .iter()
        .filter(|limit| hidden(limit, multiple).is_some());
    let mut repeat = Repeat {
        study,
        library,
        // Whatever is named beyond the accepted model is a false alarm.
        declared: accepted.model.clone(),
        done: 0,
        of: runs + tried.count(),
        progress,
    };
    let (mut named, mut unexplained) = (Vec::new(), 0);
    for run in 1..=runs {
        let logs = simulated
            .draw(&[], rng)
            .expect("the accepted model was fitted to these windows");
        let found = repeat.find(
            &logs,
            rng,
            &format!("simulation {run} of the accepted model"),
        )?;
        unexplained += usize::from(found.unexplained.is_significant());
        named.push(Repeat::named(&found));
    }
    for limit in &mut limits {
        if let Some(effect) = hidden(limit, multiple)
            && let Some(logs) = simulated.draw(&[effect], rng)
        {
            let text = format!("simulation with {}", limit.effect.label());
            let found = repeat.find(&logs, rng, &text)?;
            limit.named = Some(Repeat::named(&found));
        }
    }
    Ok(Calibration {
        named,
        unexplained,
        limits,
        hidden: multiple,
        top_torque: study.top_torque.clone(),
    })
}

/// Repeats the whole search.
struct Repeat<'a> {
    study: &'a Study<'a>,
    library: &'a Library,
    declared: Model,
    done: usize,
    of: usize,
    progress: &'a mut (dyn FnMut(Repetition<'_>) + Send),
}

impl Repeat<'_> {
    fn find(&mut self, logs: &[Log], rng: &mut impl Rng, text: &str) -> Result<Found, StudyError> {
        let mut study = Study {
            declared: &self.declared,
            ..self.study.on(logs)
        };
        let (number, of) = (self.done, self.of);
        let found = find(&mut study, &[], self.library, rng, &mut |within| {
            let text = format!("{text}: {}", within.text);
            (self.progress)(Repetition {
                number,
                of,
                text: &text,
            });
        });
        self.done += 1;
        found
    }

    fn named(found: &Found) -> Vec<FittedEffect> {
        let established = found.chosen.standings.iter();
        let established = established.filter(|s| s.status == Status::Established);
        established.map(|s| s.effect.clone()).collect()
    }
}
