use serde::{Deserialize, Serialize};

/// What a reader of the model predicts at [`Samples`](super::Samples): rows of positions, then velocities. What a format
/// does not answer is left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Answers {
    /// The state after one step from each point.
    pub next: Option<Vec<Vec<f64>>>,
    /// ds/dt at each point, its torque acting.
    pub derivative: Option<Vec<Vec<f64>>>,
    /// The state after each step of the rollout.
    pub rollout: Option<Vec<Vec<f64>>>,
}

/// The largest difference between two readers, for each state relative to the largest magnitude that it has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Difference {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub derivative: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rollout: Option<f64>,
}

impl Answers {
    /// How far `other` is from these; infinite where it has another number of rows, or what is no number.
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

impl Difference {
    /// The larger of a step and of the derivative: what no rollout has amplified.
    pub fn pointwise(&self) -> f64 {
        let both = [self.next, self.derivative].into_iter().flatten();
        both.fold(0.0, f64::max)
    }
}

/// The largest difference between rows, for each column relative to its largest magnitude in the first.
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
        // A state that never leaves zero is compared as it is.
        gap / if scale > 0.0 { scale } else { 1.0 }
    };
    (0..columns).map(of_column).fold(0.0, f64::max)
}

/// Infinite where one of them is no number, which a maximum would pass over.
fn gap(a: f64, b: f64) -> f64 {
    let gap = (a - b).abs();
    if gap.is_nan() { f64::INFINITY } else { gap }
}

#[cfg(test)]
mod tests {
    use super::Answers;

    fn answers(rows: &[[f64; 2]]) -> Answers {
        Answers {
            next: Some(rows.iter().map(|row| row.to_vec()).collect()),
            ..Answers::default()
        }
    }

    #[test]
    fn differences_are_relative_to_each_states_own_magnitude() {
        let mine = answers(&[[100.0, 0.1], [-50.0, 0.2]]);
        let theirs = answers(&[[100.0, 0.1], [-49.0, 0.19]]);
        let difference = mine.difference(&theirs);
        assert!((difference.pointwise() - 0.05).abs() < 1e-12);
        assert_eq!((difference.derivative, difference.rollout), (None, None));
    }

    #[test]
    fn what_is_no_number_or_missing_is_infinitely_far() {
        let mine = answers(&[[1.0, 1.0], [2.0, 2.0]]);
        for theirs in [
            answers(&[[1.0, f64::NAN], [2.0, 2.0]]),
            answers(&[[1.0, 1.0]]),
        ] {
            assert_eq!(mine.difference(&theirs).next, Some(f64::INFINITY));
        }
    }
}
