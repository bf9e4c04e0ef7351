//! Directions of motion at even rows, before they are filtered like the torques: what is to become of dry friction.

use std::f64::consts::LN_2;

use super::torque_column::TorqueColumn;

/// The signs of velocities, which reverse over `width`, as a torque column holds them. Readings are of the rows' times.
/// Held torques and means are those over a step: a reversal within it counts by its time, and the signs at the rows
/// would be off by up to half a step, which looks like friction that is larger near standstill.
pub(super) fn directions(speeds: &[f64], width: f64, torque: TorqueColumn) -> Vec<f64> {
    let scaled: Vec<f64> = speeds.iter().map(|speed| speed / width).collect();
    if torque == TorqueColumn::Sampled || scaled.len() < 2 {
        return scaled.into_iter().map(f64::tanh).collect();
    }
    let steps = scaled.windows(2).map(|ends| mean_tanh(ends[0], ends[1]));
    let steps: Vec<f64> = steps.collect();
    // Torques are resampled from the middles of the steps.
    let inner: Vec<f64> = steps
        .windows(2)
        .map(|pair| 0.5 * (pair[0] + pair[1]))
        .collect();
    [&steps[..1], &inner, &steps[steps.len() - 1..]].concat()
}

/// The same at the middles of steps, as means over them; speeds are those in the middles, too.
pub(super) fn directions_over_steps(speeds: &[f64], width: f64) -> Vec<f64> {
    let last = speeds.len().saturating_sub(1);
    let mean = |k: usize| {
        let [before, after] = [speeds[k.saturating_sub(1)], speeds[(k + 1).min(last)]];
        let ends = [before, after].map(|beside| 0.5 * (speeds[k] + beside) / width);
        mean_tanh(ends[0], ends[1])
    };
    (0..speeds.len()).map(mean).collect()
}

/// The mean of tanh between two values.
fn mean_tanh(from: f64, to: f64) -> f64 {
    let ln_cosh = |x: f64| x.abs() + (-2.0 * x.abs()).exp().ln_1p() - LN_2;
    match (to - from).abs() > 1e-6 {
        true => (ln_cosh(to) - ln_cosh(from)) / (to - from),
        false => (0.5 * (from + to)).tanh(),
    }
}

#[cfg(test)]
mod tests {
    use super::directions;
    use crate::data::TorqueColumn;

    #[test]
    fn a_reversal_within_a_step_counts_by_its_time() {
        for reversal in [10.0, 10.2, 10.5, 10.9] {
            let speeds: Vec<f64> = (0..=20).map(|row| f64::from(row) - reversal).collect();
            let sum = |torque| directions(&speeds, 1e-3, torque)[1..20].iter().sum::<f64>();
            // As long backwards as forwards but for twice the time by which the reversal is late.
            let late = 2.0 * (10.0 - reversal);
            for torque in [TorqueColumn::Held, TorqueColumn::Mean] {
                let found = sum(torque);
                assert!(
                    (found - late).abs() < 0.01,
                    "{reversal}: {found}, not {late}"
                );
            }
        }
    }

    #[test]
    fn readings_have_the_directions_of_their_rows() {
        let found = directions(&[-1.0, -0.3, 0.7], 1e-3, TorqueColumn::Sampled);
        assert_eq!(found, [-1.0, -1.0, 1.0]);
    }
}
