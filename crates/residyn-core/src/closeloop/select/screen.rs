use super::candidate::{beside, best_by_cost};
use super::on_sample::{cost_on_sample, fitted_on_sample};
use super::screening::Screening;
use super::sets::best_predicted;
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::Joint;
use crate::model::FittedEffect;

/// The sets of effects with the largest predicted fall of a fitted model's loss, the best first, each beyond the
/// declared effects. All candidates, each of which some value switches off, are linearised at once, and sets are compared
/// without a fit.
pub fn screen(
    problem: &Problem<'_>,
    fitted: &Fitted,
    candidates: &[FittedEffect],
) -> Vec<Vec<FittedEffect>> {
    let Some(screening) = Screening::of(problem, fitted, candidates) else {
        return Vec::new();
    };
    let predicted = best_predicted(&screening, problem);
    predicted.iter().map(|set| screening.effects(set)).collect()
}

/// The effects of a fitted model with one more that no value switches off, of which these are the starts, if it is worth a
/// fit. Play is a spring that is soft in its middle: where no spring helps, it is not tried.
pub fn with_one_more(
    problem: &Problem<'_>,
    fitted: &Fitted,
    more: Vec<Vec<FittedEffect>>,
) -> Vec<Vec<FittedEffect>> {
    let Some(beside) = OneMore::beside(problem, fitted) else {
        return Vec::new();
    };
    let has_play = |starts: &Vec<FittedEffect>| starts.iter().any(|start| start.effect.has_play());
    let (plays, springs): (Vec<_>, Vec<_>) = more.into_iter().partition(has_play);
    let joint = |starts: &Vec<FittedEffect>| starts.first().map(|start| start.joint);
    let springs = springs.into_iter();
    let springs = springs.map(|spring| (joint(&spring), beside.with(spring)));
    let springs: Vec<_> = springs.collect();
    let is_stiff = |at: Option<Joint>| {
        springs
            .iter()
            .any(|(joint, set)| *joint == at && set.is_none())
    };
    let plays = plays.into_iter().filter(|play| !is_stiff(joint(play)));
    let plays: Vec<_> = plays.filter_map(|play| beside.with(play)).collect();
    let springs = springs.into_iter().filter_map(|(_, set)| set);
    springs.chain(plays).collect()
}

/// A fitted model that one effect more, which no value switches off, is added to.
struct OneMore<'a, 'p> {
    problem: &'a Problem<'p>,
    fitted: &'a Fitted,
    /// With it, the sample of windows has to cost less than this for a fit to all of them to be worth its time.
    enough: f64,
}

impl<'a, 'p> OneMore<'a, 'p> {
    fn beside(problem: &'a Problem<'p>, fitted: &'a Fitted) -> Option<Self> {
        let cost = cost_on_sample(problem, fitted)?;
        Some(Self {
            problem,
            fitted,
            enough: cost * (1.0 - problem.of_whole(problem.settings.select.sampled_gain)),
        })
    }

    /// The effects beyond the declared ones, with one more that has these starts; `None` if it is not worth a fit.
    fn with(&self, starts: Vec<FittedEffect>) -> Option<Vec<FittedEffect>> {
        let beside = beside(self.problem, self.fitted, starts.first()?)?;
        let with = match self.problem.error_model {
            ErrorModel::OutputError => {
                fitted_on_sample(self.problem, &beside, starts, self.enough)?
            }
            ErrorModel::InverseDynamics => {
                let best = best_by_cost(self.problem, &beside, starts)?;
                beside.model.with_effects(beside.effects_and(&[best]))
            }
        };
        Some(with.effects[self.problem.declared.effects.len()..].to_vec())
    }
}
