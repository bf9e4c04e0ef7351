use serde::{Deserialize, Serialize};

use super::{ClientError, Samples};

/// A client's predictions at [`Samples`](super::Samples). Those that a format does not offer are left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Predictions {
    /// `[point][2n]`: the state after one step from each point.
    pub next: Option<Vec<Vec<f64>>>,
    /// `[point][2n]`: ds/dt at each point while its torque acts.
    pub derivative: Option<Vec<Vec<f64>>>,
    /// `[step][2n]`: the state after each step of the rollout.
    pub rollout: Option<Vec<Vec<f64>>>,
}

/// The largest differences between two clients, for each state relative to its largest magnitude.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub derivative: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rollout: Option<f64>,
}

impl Predictions {
    /// Refuse steps and derivatives that are not finite: nothing could be compared with them.
    ///
    /// # Errors
    /// The first one that is not finite.
    pub fn check_finite(&self, samples: &Samples) -> Result<(), ClientError> {
        let step = format!("a step of {:?} s", samples.step_s);
        for (rows, what) in [
            (&self.derivative, "the derivative"),
            (&self.next, step.as_str()),
        ] {
            let mut rows = rows.iter().flatten();
            if let Some(k) = rows.position(|row| !is_finite(row)) {
                return Err(ClientError::NotFinite(format!(
                    "the model itself is not finite in {what} from the state {:?} under {:?}",
                    samples.states[k], samples.torques[k]
                )));
            }
        }
        Ok(())
    }

    /// The predictions without a rollout that ceases to be finite, and the step in which it does.
    pub fn without_lost_rollout(mut self) -> (Self, Option<usize>) {
        let lost = (self.rollout.iter().flatten()).position(|row| !is_finite(row));
        if lost.is_some() {
            self.rollout = None;
        }
        (self, lost)
    }

    /// How far `other` is from these predictions; infinite if it has another number of rows, or a NaN.
    pub fn difference(&self, other: &Self) -> Difference {
        let between = |mine: &Option<Vec<Vec<f64>>>, theirs: &Option<Vec<Vec<f64>>>| {
            Some(difference(mine.as_ref()?, theirs.as_ref()?))
        };
        Difference {
            next: between(&self.next, &other.next),
            derivative: between(&self.derivative, &other.derivative),
            rollout: between(&self.rollout, &other.rollout),
        }
    }
}

fn is_finite(row: &[f64]) -> bool {
    row.iter().all(|number| number.is_finite())
}

impl Difference {
    /// The larger of the step and derivative differences, which no rollout amplifies.
    pub fn pointwise(&self) -> f64 {
        let both = [self.next, self.derivative].into_iter().flatten();
        both.fold(0.0, f64::max)
    }
}

/// The largest difference between rows, for each column relative to its largest magnitude in `mine`.
pub(super) fn difference(mine: &[Vec<f64>], theirs: &[Vec<f64>]) -> f64 {
    let same_shape =
        mine.len() == theirs.len() && mine.iter().zip(theirs).all(|(a, b)| a.len() == b.len());
    if !same_shape {
        return f64::INFINITY;
    }
    let columns = mine.first().map_or(0, Vec::len);
    let of_column = |k: usize| {
        let scale = mine.iter().map(|row| row[k].abs()).fold(0.0, f64::max);
        let rows = mine.iter().zip(theirs);
        let gap = rows.map(|(a, b)| gap(a[k], b[k])).fold(0.0, f64::max);
        // A state that is always zero is compared in its own unit.
        gap / if scale > 0.0 { scale } else { 1.0 }
    };
    (0..columns).map(of_column).fold(0.0, f64::max)
}

/// Infinite for NaN, which a maximum would skip.
fn gap(a: f64, b: f64) -> f64 {
    let gap = (a - b).abs();
    if gap.is_nan() { f64::INFINITY } else { gap }
}

#[cfg(test)]
mod tests {
    use super::Predictions;

    fn predictions(rows: &[[f64; 2]]) -> Predictions {
        Predictions {
            next: Some(rows.iter().map(|row| row.to_vec()).collect()),
            ..Predictions::default()
        }
    }

    #[test]
    fn differences_are_relative_to_each_states_own_magnitude() {
        let mine = predictions(&[[100.0, 0.1], [-50.0, 0.2]]);
        let theirs = predictions(&[[100.0, 0.1], [-49.0, 0.19]]);
        let difference = mine.difference(&theirs);
        assert!((difference.pointwise() - 0.05).abs() < 1e-12);
        assert_eq!((difference.derivative, difference.rollout), (None, None));
    }

    #[test]
    fn nan_and_missing_rows_are_infinitely_far() {
        let mine = predictions(&[[1.0, 1.0], [2.0, 2.0]]);
        for theirs in [
            predictions(&[[1.0, f64::NAN], [2.0, 2.0]]),
            predictions(&[[1.0, 1.0]]),
        ] {
            assert_eq!(mine.difference(&theirs).next, Some(f64::INFINITY));
        }
    }
}
