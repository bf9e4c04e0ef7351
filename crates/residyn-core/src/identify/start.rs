use crate::data::{LocalCubic, Log, half_width_s, local_cubic, rows_around};

/// A log's estimate of the state at one of its rows: angles, then velocities.
pub(super) struct Start {
    pub state: Vec<f64>,
    /// 1 / standard deviation of each; 0 if the log does not determine it.
    pub weight: Vec<f64>,
}

/// The estimate shares rows with the window that it begins, and encoders err in steps: it counts as if it had this many
/// times the standard deviation of white noise.
const CAUTION: f64 = 2.0;
/// There must be at least this many rows on either side of the row: beyond the end of its points a cubic errs much
/// more.
const FEWEST_ROWS: usize = 2;

impl Start {
    /// The state at a row, by the cubics over `half_width` s on either side that open-loop errors start from; `noise`
    /// is the standard deviation of each joint's position. A window's free start state is held near it, so that a wrong
    /// model cannot compensate with a start state that the rig never had.
    pub fn of(log: &Log, row: usize, half_width: f64, noise: &[f64]) -> Self {
        let around = rows_around(&log.time, row, half_width);
        let is_between = row - around.start >= FEWEST_ROWS && around.end - row > FEWEST_ROWS;
        let rows = around.len() as f64;
        let gains = [
            LocalCubic::value_noise_gain(rows),
            LocalCubic::slope_noise_gain(half_width, rows),
        ];
        let of_joint = |(q, noise): (&Vec<f64>, &f64)| {
            let found = local_cubic(&log.time, q, row, half_width).filter(|_| is_between);
            found.map_or([(0.0, 0.0); 2], |found| {
                // The part of the cubic's residuals that noise does not explain is motion that a cubic does not follow.
                let beyond = (found.rms.powi(2) - (CAUTION * noise).powi(2))
                    .max(0.0)
                    .sqrt();
                let weight = |k: usize| {
                    let unit = [1.0, 1.0 / half_width][k];
                    let truncation = LocalCubic::TRUNCATION[k] * unit * beyond;
                    1.0 / (CAUTION * gains[k] * noise + truncation)
                };
                [(found.value, weight(0)), (found.slope, weight(1))]
            })
        };
        let joints: Vec<[(f64, f64); 2]> = log.q.iter().zip(noise).map(of_joint).collect();
        let both = |part: usize| joints.iter().map(move |of| of[part]);
        let (state, weight) = both(0).chain(both(1)).unzip();
        Self { state, weight }
    }
}

/// Standard deviation of each value of the state that a prediction starts from at a row: positions, then velocities.
/// `noise` is that of each joint's position. `None` if the rows do not determine it.
pub fn start_deviations(log: &Log, row: usize, noise: &[f64]) -> Option<Vec<f64>> {
    let start = Start::of(log, row, half_width_s(log.median_step()), noise);
    let deviation = |weight: &f64| (*weight > 0.0).then(|| 1.0 / weight);
    start.weight.iter().map(deviation).collect()
}

#[cfg(test)]
mod tests {
    use super::Start;
    use crate::data::Log;

    #[test]
    fn the_state_is_reported_with_its_uncertainty_where_rows_are_on_both_sides() {
        let time: Vec<f64> = (0..100).map(|row| 0.002 * f64::from(row)).collect();
        let mut log = Log::empty(1);
        log.q = vec![time.iter().map(|t| 0.3 + 2.0 * t).collect()];
        log.qd = vec![vec![2.0; 100]];
        log.tau = vec![vec![0.0; 100]];
        log.time = time;
        let start = Start::of(&log, 50, 0.016, &[1e-3]);
        assert!((start.state[0] - 0.5).abs() < 1e-9 && (start.state[1] - 2.0).abs() < 1e-9);
        // 17 rows: twice 1 mrad * sqrt(2.25 / 17), and twice that of a slope.
        assert!((1.0 / start.weight[0] - 0.73e-3).abs() < 0.01e-3);
        assert!((1.0 / start.weight[1] - 0.131).abs() < 0.001);
        log.time.iter_mut().skip(50).for_each(|t| *t += 1.0);
        assert_eq!(Start::of(&log, 50, 0.016, &[1e-3]).weight, [0.0, 0.0]);
    }
}
