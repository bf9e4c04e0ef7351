use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::comparison::{Comparison, Trial, explanation, rival_explanation};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::select::Rival;
use crate::closeloop::settings::DiscriminateSettings;
use crate::data::Joint;

/// How far two explanations differ in the experiment that distinguishes them best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Separation {
    /// What to do; `None` if no simulated experiment distinguishes them.
    pub experiment: Option<String>,
    /// The joint on which the difference shows most.
    pub joint: Joint,
    /// Root mean square position difference over half a second ahead, after one explanation has been refitted to the
    /// motion of the other, in rad (or m).
    #[schemars(range(min = 0))]
    pub difference_rad: f64,
    /// Root mean square position difference in the present logs, in rad (or m).
    #[schemars(range(min = 0))]
    pub present_difference_rad: f64,
    /// Standard deviation of the position that the model does not explain in the present logs, in rad (or m).
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub noise_rad: f64,
    /// Sufficient length in s of the experiment's logs.
    pub seconds: Option<f64>,
    #[serde(skip)]
    slides: bool,
}

/// The experiment that would distinguish a rival from the chosen model, by T-optimality (Atkinson and Fedorov 1975):
/// each experiment of the menu is simulated with one of the two, the other is refitted to it and to the present logs
/// together, with all parameters and start states free, and the remaining difference is compared with the noise. A
/// rival that contains the chosen effect is the one simulated, at its fitted size: refitted, it could follow the other
/// anywhere. `None` if not even the present motion can be simulated.
pub(super) fn separation(
    problem: &Problem<'_>,
    fitted: &Fitted,
    rival: &Rival,
) -> Option<Separation> {
    let settings = &problem.settings.discriminate;
    let chosen = explanation(problem, &fitted.model);
    let other = rival_explanation(problem, fitted, rival);
    let comparison = if rival.contains_chosen() {
        Comparison::new(problem, fitted, other, chosen)
    } else {
        Comparison::new(problem, fitted, chosen, other)
    }?;
    let mut joints = vec![rival.effect.joint, rival.instead_of.joint];
    joints.dedup();
    let trials: Vec<Trial> = comparison.trials(fitted, &joints);
    let telling = trials.iter().filter(|trial| trial.tells(settings));
    let best = telling.min_by(|a, b| a.worth(settings).total_cmp(&b.worth(settings)));
    let widest = (trials.iter()).max_by(|a, b| a.deviation().total_cmp(&b.deviation()))?;
    let shown = best.unwrap_or(widest);
    Some(Separation {
        experiment: best.map(|trial| trial.text.clone()),
        joint: shown.joint,
        difference_rad: shown.difference,
        present_difference_rad: shown.present,
        noise_rad: shown.noise,
        seconds: best.map(|trial| trial.worth(settings).ceil()),
        slides: problem.declared.prismatic[shown.joint],
    })
}

impl Separation {
    /// The separation in a sentence.
    pub fn text(&self) -> String {
        let milli = |x: f64| {
            let x = 1e3 * x;
            let digits = if x < 0.995 { 2 } else { 1 };
            format!("{x:.digits$}")
        };
        let unit = if self.slides { "mm" } else { "mrad" };
        let (difference, noise) = (milli(self.difference_rad), milli(self.noise_rad));
        match (&self.experiment, self.seconds) {
            (Some(experiment), Some(seconds)) => format!(
                "{experiment}; the two then differ by {difference} {unit} on joint {} (rms over half a second, after \
                 refitting; in these logs {}, noise {noise}), and {seconds:.0} s of data suffice",
                self.joint,
                milli(self.present_difference_rad)
            ),
            _ => format!(
                "no simulated change of torque, speed, load or duration separates them (largest difference \
                 {difference} {unit}, noise {noise}): on this rig they are equivalent; determine one by an independent \
                 measurement"
            ),
        }
    }
}

impl Trial {
    /// Length in s by which experiments are ranked: short experiments rank equal.
    fn worth(&self, settings: &DiscriminateSettings) -> f64 {
        self.seconds.max(settings.equally_short_s)
    }

    fn tells(&self, settings: &DiscriminateSettings) -> bool {
        self.seconds < settings.longest_s && self.deviation() > settings.visible_share
    }

    fn deviation(&self) -> f64 {
        self.difference / self.noise
    }
}
