//! Stage 9: measure every model on the test logs.

mod bootstrap;
mod contradicted;
mod contribution;
mod errors;
mod noise_floor;
mod predictions;
mod test_log;

pub use self::contradicted::Contradicted;
pub(super) use self::contradicted::contradicted;
pub use self::contribution::Finding;
pub(super) use self::contribution::findings;
pub use self::errors::{Errors, TorqueErrors};
pub(super) use self::errors::{Scored, Scorer};
pub use self::predictions::{Needed, Predicted, Predictions};
pub use self::test_log::TestLog;

use rand::Rng;

use super::by_log::OfLog;
use super::fitted::Fitted;
use super::judge::Found;
use super::learn::Learned;
use super::prepare::Prepared;
use super::refine::Refined;
use super::stage::{Stage, Watch};
use super::verdict::{Verdict, verdict};

/// How well the models predict, and what follows.
pub struct Scores {
    pub errors: Errors,
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub reason: String,
    /// Every effect that was added.
    pub findings: Vec<Finding>,
    /// The chosen model fitted to each training log alone.
    pub by_log: Vec<OfLog>,
    /// What the models predict for the test logs.
    pub predictions: Predictions,
}

/// Score the models on the test logs, and say what follows. Besides the refined models these are the declared model
/// with the usual friction and the model with the residual network, if there are any.
pub fn score(
    prepared: &Prepared<'_>,
    found: &Found<'_>,
    refined: &Refined<'_>,
    (with_friction, learned): (Option<&Fitted>, Option<&Learned>),
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Scores {
    watch.see(Stage::Score.into());
    let problem = found.problem.knowing(refined.identifiability.clone());
    let scorer = Scorer {
        test: &prepared.test.logs,
        settings: &prepared.settings.score,
    };
    let without_network = refined.after.model.absorbed().dynamics();
    let models = Scored {
        problem: &problem,
        declared: &prepared.model,
        before: &refined.before,
        with_friction: with_friction.filter(|model| !problem.added(&model.model).is_empty()),
        after: &refined.after,
        hybrid: learned.map(|learned| learned.hybrid().unwrap_or(&without_network)),
        against: &prepared.against,
    };
    let errors = scorer.errors(models, rng);
    let (verdict, reason) = verdict(found, refined, &errors);
    Scores {
        findings: findings(&problem, &found.chosen, refined, &scorer),
        by_log: problem.by_log(&found.chosen.after, watch),
        predictions: scorer.predictions(models, learned.and_then(Learned::hybrid)),
        errors,
        verdict,
        reason,
    }
}
