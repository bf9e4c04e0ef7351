//! What some logs could show: how often the search names an effect where there is none, and how small an effect
//! it would name.

mod limit;
mod null;
#[cfg(test)]
mod tests;

pub use limit::Size;

use rand::Rng;

use self::limit::limits;
use self::null::Null;
use super::find::{Found, find};
use super::study::{Fitted, Study, StudyError};
use crate::data::Log;
use crate::data::statistics::wilson;
use crate::model::{FittedEffect, Library, System};

/// What the search makes of logs simulated from the accepted model, with the torques and the noise of the user's.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// What was named in each simulation of the accepted model: every one a false alarm.
    pub named: Vec<Vec<FittedEffect>>,
    /// In how many of them something was left that nothing explains.
    pub unexplained: usize,
    pub limits: Vec<Limit>,
    /// Of each joint in the training logs.
    pub top_torque: Vec<f64>,
}

/// The smallest size of an effect, and what the search named where that was hidden in simulated logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// The effect, absent.
    pub effect: FittedEffect,
    pub smallest: Size,
    /// What was named with the effect at [`HIDDEN`] times that size; `None` where it was not tried.
    pub named: Option<Vec<FittedEffect>>,
}

/// Effects are hidden at this multiple of their smallest size.
pub const HIDDEN: f64 = 1.5;
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

impl Limit {
    /// The effect to hide, if it is one of those that are.
    fn hidden(&self) -> Option<FittedEffect> {
        let Size::Named { switch, values } = &self.smallest else {
            return None;
        };
        let mut hidden = self.effect.clone();
        hidden.values = values.iter().map(|value| (*value, None)).collect();
        hidden.values[*switch].0 *= HIDDEN;
        COMMON
            .contains(&hidden.effect.name.as_str())
            .then_some(hidden)
    }

    /// Whether the hidden effect was named; `None` where it was not tried.
    pub fn verified(&self) -> Option<bool> {
        let is_this = |named: &FittedEffect| named.label() == self.effect.label();
        self.named.as_ref().map(|named| named.iter().any(is_this))
    }
}

/// Where the work stands, for a progress display.
#[derive(Debug, Clone, Copy)]
pub struct Step<'s> {
    pub number: usize,
    pub of: usize,
    pub text: &'s str,
}

/// Simulate `runs` sets of training logs from a model that [`find`] accepted, and sets with common effects hidden
/// in them, and search each as the user's own.
///
/// # Errors
/// As [`Study::fit_declared`].
pub fn calibrate(
    study: &Study<'_>,
    accepted: &Fitted,
    library: &Library,
    runs: usize,
    rng: &mut impl Rng,
    progress: &mut dyn FnMut(Step<'_>),
) -> Result<Calibration, StudyError> {
    let null = Null::new(study, accepted)?;
    let mut limits = limits(study, accepted, library.effects())?;
    let hidden = limits.iter().filter(|limit| limit.hidden().is_some());
    let mut repeat = Repeat {
        study,
        library,
        declared: declared(study.system, accepted),
        done: 0,
        of: runs + hidden.count(),
        progress,
    };
    let (mut named, mut unexplained) = (Vec::new(), 0);
    for run in 1..=runs {
        let logs = null
            .draw(&[], rng)
            .expect("the accepted model was fitted to these windows");
        let found = repeat.find(
            &logs,
            rng,
            &format!("simulation {run} of the accepted model"),
        )?;
        unexplained += usize::from(found.unexplained.is_significant());
        named.push(repeat.named(&found));
    }
    for limit in &mut limits {
        if let Some(effect) = limit.hidden()
            && let Some(logs) = null.draw(&[effect], rng)
        {
            let text = format!("simulation with {}", limit.effect.label());
            let found = repeat.find(&logs, rng, &text)?;
            limit.named = Some(repeat.named(&found));
        }
    }
    Ok(Calibration {
        named,
        unexplained,
        limits,
        top_torque: study.top_torque.clone(),
    })
}

/// The accepted model as a declared one: whatever is named beyond it is a false alarm.
fn declared(system: &System, accepted: &Fitted) -> System {
    let mut declared = system.clone();
    for (parameter, value) in declared.parameters.iter_mut().zip(&accepted.declared) {
        parameter.value = *value;
    }
    declared.effects.clone_from(&accepted.effects);
    declared
}

/// The whole search, once again and again.
struct Repeat<'a> {
    study: &'a Study<'a>,
    library: &'a Library,
    declared: System,
    done: usize,
    of: usize,
    progress: &'a mut dyn FnMut(Step<'_>),
}

impl Repeat<'_> {
    fn find(&mut self, logs: &[Log], rng: &mut impl Rng, text: &str) -> Result<Found, StudyError> {
        let mut study = Study {
            system: &self.declared,
            ..self.study.on(logs)
        };
        let (number, of) = (self.done, self.of);
        let found = find(&mut study, self.library, rng, &mut |stage| {
            let text = format!("{text}: {}", stage.text);
            (self.progress)(Step {
                number,
                of,
                text: &text,
            });
        });
        self.done += 1;
        found
    }

    fn named(&self, found: &Found) -> Vec<FittedEffect> {
        found.after.effects[self.declared.effects.len()..].to_vec()
    }
}
