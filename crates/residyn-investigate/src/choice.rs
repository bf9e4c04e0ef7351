use residyn_core::closeloop::Outcome;
use residyn_core::data::Joint;
use residyn_core::model::{FittedEffect, Library, Model};
use residyn_excite::{Design, Designer, ExciteError, Limits, Settings, design};
use serde::{Deserialize, Serialize};

use super::round::{Named, open_alternatives};

/// How much slower a slow motion is: dry friction shows in it, and so does what a fast one hides behind inertia.
const SLOWER: f64 = 4.0;
/// Twice the expected logarithm of the likelihood ratio above which a motion is worth playing: five standard deviations, if noise
/// were white, and some where it is not.
const TELLING: f64 = 25.0;
/// Friction that most rigs have: a first motion determines it as well.
const USUAL: [&str; 2] = ["viscous_friction", "coulomb_friction"];

/// What a motion is for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Purpose {
    /// To determine parameters, with the speeds that the limits allow.
    Fast,
    /// To determine parameters, at a quarter of these speeds.
    Slow,
    /// To tell the present explanation from these.
    Tell { from: Vec<Named> },
    /// None: drawn at random within the limits.
    Random,
}

/// A motion and its purpose.
pub struct Choice {
    pub purpose: Purpose,
    pub design: Design,
    /// Whether something is open that no motion within the limits is expected to tell.
    pub is_helpless: bool,
}

/// What is known when a motion is chosen.
pub struct Known<'a> {
    pub model: &'a Model,
    pub library: &'a Library,
    pub limits: &'a Limits,
    pub run_s: f64,
    /// Runs so far.
    pub runs: usize,
    /// After the runs so far.
    pub outcome: Option<&'a Outcome>,
    pub seed: u64,
}

/// Chooses motions.
pub trait Choose: Sync {
    /// The next motion.
    ///
    /// # Errors
    /// As [`design`].
    fn choose(&self, known: &Known<'_>) -> Result<Choice, ExciteError>;
}

/// The motion that tells most of what is open.
pub struct Designed;

/// A motion at random within the limits, which it reaches: what designed ones are compared with.
pub struct Random;

impl Choose for Random {
    fn choose(&self, known: &Known<'_>) -> Result<Choice, ExciteError> {
        let settings = Settings::default();
        let designer = Designer::new(known.model, &[], known.limits, known.run_s, &settings)?;
        Ok(Choice {
            purpose: Purpose::Random,
            design: designer.random(known.seed)?,
            is_helpless: false,
        })
    }
}

impl Choose for Designed {
    fn choose(&self, known: &Known<'_>) -> Result<Choice, ExciteError> {
        let model = known.present();
        let rivals = known.rivals();
        let is_helpless = !rivals.is_empty();
        if is_helpless && known.runs >= 2 {
            let models: Vec<Model> = rivals.iter().map(|(_, rival)| rival.clone()).collect();
            if let Some(design) = drivable(known.design(&model, &models, known.limits))? {
                let told: Vec<Named> = (rivals.into_iter().zip(&design.evidence))
                    .filter(|(_, evidence)| **evidence >= TELLING)
                    .map(|((named, _), _)| named)
                    .collect();
                if !told.is_empty() {
                    return Ok(Choice {
                        purpose: Purpose::Tell { from: told },
                        design,
                        is_helpless: false,
                    });
                }
            }
        }
        let (purpose, limits) = match known.runs % 2 {
            0 => (Purpose::Fast, known.limits.clone()),
            _ => (Purpose::Slow, slower(known.limits)),
        };
        let design = match drivable(known.design(&model, &[], &limits))? {
            Some(design) => design,
            None => known.design(&known.with_usual_friction(), &[], &limits)?,
        };
        Ok(Choice {
            purpose,
            design,
            is_helpless,
        })
    }
}

/// A design, or `None` where no command drives the model, as within a dead zone that the first runs suggest.
fn drivable(design: Result<Design, ExciteError>) -> Result<Option<Design>, ExciteError> {
    match design {
        Err(ExciteError::NotFinite) => Ok(None),
        other => other.map(Some),
    }
}

impl Known<'_> {
    fn design(
        &self,
        model: &Model,
        rivals: &[Model],
        limits: &Limits,
    ) -> Result<Design, ExciteError> {
        let settings = Settings::default();
        design(
            model,
            rivals,
            limits,
            self.run_s,
            &settings,
            self.seed,
            &|_| (),
        )
    }

    /// The best model so far, with the usual friction at first; effects with states of their own are left out.
    fn present(&self) -> Model {
        match self.outcome {
            Some(outcome) => {
                let model = outcome.models.after.model.absorbed();
                let effects = model
                    .effects
                    .iter()
                    .filter(|effect| effect.effect.states.is_empty());
                let effects = effects.cloned().collect();
                model.with_effects(effects)
            }
            None => self.with_usual_friction(),
        }
    }

    fn with_usual_friction(&self) -> Model {
        let mut effects = self.model.effects.clone();
        for joint in Joint::all(self.model.joints) {
            for name in USUAL {
                let Ok(effect) = self.library.effect(name) else {
                    continue;
                };
                let new = FittedEffect::typical(effect, joint);
                if self.model.check_effect(&new, &effects).is_ok() {
                    effects.push(new);
                }
            }
        }
        self.model.with_effects(effects)
    }

    /// What is open: other explanations and, where an effect is not established, the model without it. Each has what its
    /// difference is called.
    fn rivals(&self) -> Vec<(Named, Model)> {
        let Some(outcome) = self.outcome else {
            return Vec::new();
        };
        let model = outcome.models.after.model.absorbed();
        let others = open_alternatives(outcome).map(|alternative| {
            let rival = outcome
                .models
                .after
                .model
                .with_effects(alternative.effects.clone());
            (Named::of(&alternative.effect), rival.absorbed())
        });
        let without = outcome.effects.supported.iter().map(|finding| {
            let left = model
                .effects
                .iter()
                .filter(|effect| !effect.is_same(&finding.effect));
            (
                Named::of(&finding.effect),
                model.with_effects(left.cloned().collect()),
            )
        });
        others.chain(without).collect()
    }
}

/// Limits of a slow motion: accelerations fall with the square of speed.
fn slower(limits: &Limits) -> Limits {
    let mut slow = limits.clone();
    for joint in &mut slow.joints {
        joint.speed /= SLOWER;
        joint.acceleration /= SLOWER * SLOWER;
    }
    slow
}
