use super::folds::Folds;
use super::losses::{left_out_sums, of_torques};
use super::trial::{Trial, differences};
use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::problem::Problem;
use crate::closeloop::settings::SelectSettings;
use crate::data::statistics::{mean, standard_error};
use crate::identify::{Values, Window};
use crate::model::Dynamics;
use crate::sim::metric::{errors_in, windows};

/// The error of a set of effects, as reported, on blocks left out of the fit: squares of the open-loop motion in rad^2
/// (or m^2), summed over the rows and joints of each block, or of the torques over their noise, summed over the rows of
/// each block and joint. Fits compare models by a robust loss, for motion over windows with free start states; this
/// error is what the user sees.
pub struct OpenLoopCheck {
    squares: Vec<f64>,
}

impl OpenLoopCheck {
    pub fn of(problem: &Problem<'_>, trial: &Trial) -> Self {
        let folds = Folds::of(problem);
        let squares = match problem.error_model {
            ErrorModel::OutputError => of_motion(problem, &folds, trial),
            ErrorModel::InverseDynamics => of_torques(problem, &folds, &trial.fitted, |r| r * r),
        };
        Self { squares }
    }

    /// Whether this error exceeds another by more than chance and rounding.
    pub fn is_worse_than(&self, other: &Self, settings: &SelectSettings) -> bool {
        let chance = settings.worse_standard_errors;
        is_worse(&self.squares, &other.squares, chance, settings.worse_share)
    }
}

/// Whether sums of squares of errors exceed others by more than `chance`, in standard errors, and by more than the share
/// `rounding`.
pub fn is_worse(squares: &[f64], others: &[f64], chance: f64, rounding: f64) -> bool {
    let rises = differences(squares, others);
    let rise = rises.iter().sum::<f64>() / others.iter().sum::<f64>();
    mean(&rises) > chance * standard_error(&rises) && rise > rounding
}

/// Squares of the open-loop error in each block, with the values that a fit without the block's group gives.
fn of_motion(problem: &Problem<'_>, folds: &Folds, trial: &Trial) -> Vec<f64> {
    let blocks = |log| blocks_of(problem, folds, log);
    let logs: Vec<Vec<(Window, usize)>> = (0..problem.logs.len()).map(blocks).collect();
    let of_group = |group: usize, dynamics: &Dynamics, values: &Values| {
        let model = values.put_into(dynamics, problem.logs);
        let of_log = |(log, all): (usize, &Vec<(Window, usize)>)| {
            let own = all.iter().filter(|(_, s)| folds.groups[*s] == group);
            let (own, blocks): (Vec<Window>, Vec<usize>) = own.copied().unzip();
            if own.is_empty() {
                return Vec::new();
            }
            let errors = errors_in(
                &model,
                &problem.logs[log..=log],
                &own,
                problem.shooting.steps(),
            );
            let squares = errors.iter().map(|error| error.position.iter().sum());
            blocks.into_iter().zip(squares).collect()
        };
        logs.iter().enumerate().flat_map(of_log).collect()
    };
    left_out_sums(problem, folds, &trial.fitted, 1, of_group)
}

/// The windows over which the open-loop error of a log is taken, as if it were the only log, and the block in which
/// each window starts.
fn blocks_of(problem: &Problem<'_>, folds: &Folds, log: usize) -> Vec<(Window, usize)> {
    let fitted = &problem.shooting.windows;
    let begin = fitted.partition_point(|window| window.log < log);
    let end = fitted.partition_point(|window| window.log <= log);
    let all = windows(0, &problem.logs[log], problem.settings.score.middle_s());
    let block = |window: Window| {
        let after = fitted[begin..end].partition_point(|of| of.first <= window.first);
        let before = after.checked_sub(1)?;
        Some((window, folds.blocks[begin + before]))
    };
    all.into_iter().filter_map(block).collect()
}
