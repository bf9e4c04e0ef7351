use crate::closeloop::error_model::ErrorModel;
use crate::closeloop::problem::Problem;
use crate::data::Log;
use crate::identify::start_deviations;
use crate::model::Dynamics;
use crate::sim::Window;
use crate::sim::metric::{error_of_starts, windows};

/// The open-loop error over `horizon_s` on logs, root mean square with all joints together (rad or m), that the noise of
/// the position sensors accounts for by itself: in the rows that are compared, and in the states from which predictions
/// start, carried through the horizon by the model. `None` if torques are compared, whose noise is not known apart from
/// what a model leaves, and without windows.
pub(in crate::closeloop) fn noise_floor(
    problem: &Problem<'_>,
    dynamics: &Dynamics,
    logs: &[Log],
    horizon_s: f64,
) -> Option<f64> {
    if problem.error_model == ErrorModel::InverseDynamics {
        return None;
    }
    let noise = &problem.shooting.noise;
    let of_log = |(k, log): (usize, &Log)| windows(k, log, horizon_s);
    let all = logs.iter().enumerate().flat_map(of_log);
    let deviations = |window: &Window| start_deviations(&logs[window.log], window.first, noise);
    let (windows, deviations): (Vec<Window>, Vec<Vec<f64>>) = all
        .filter_map(|window| Some((window, deviations(&window)?)))
        .unzip();
    if windows.is_empty() {
        return None;
    }
    let of_starts = error_of_starts(
        dynamics,
        logs,
        &windows,
        &deviations,
        problem.shooting.steps(),
    );
    let of_rows: f64 = noise.iter().map(|noise| noise.powi(2)).sum();
    Some((of_starts.powi(2) + of_rows).sqrt())
}
