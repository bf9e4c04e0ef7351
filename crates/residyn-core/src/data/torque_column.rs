use std::borrow::Cow;

use super::log::Log;

/// What a logged torque (or command) is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TorqueColumn {
    /// A command: the torque of a row acts from its time to that of the next row.
    #[default]
    Held,
    /// A sensor's reading at the time of the row.
    Sampled,
    /// The mean since the row before.
    Mean,
}

impl TorqueColumn {
    pub const ALL: [Self; 3] = [Self::Held, Self::Sampled, Self::Mean];

    /// The word for it in a model file.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Held => "held",
            Self::Sampled => "sampled",
            Self::Mean => "mean",
        }
    }

    /// The kind with which least is `left` unexplained, in the order of [`TorqueColumn::ALL`], if that is less than this
    /// `share` of what held torques leave; else these.
    pub fn clearest(left: &[Option<f64>], share: f64) -> Self {
        match share_of_held(left) {
            Some((least, place)) if least < share => Self::ALL[place],
            _ => Self::Held,
        }
    }
}

/// The least that is left, as a share of what held torques leave, and the place of its kind.
pub(crate) fn share_of_held(left: &[Option<f64>]) -> Option<(f64, usize)> {
    let held = (*left.first()?)?;
    let shares = left.iter().enumerate();
    let shares = shares.filter_map(|(place, left)| Some(((*left)? / held, place)));
    shares.min_by(|a, b| a.0.total_cmp(&b.0))
}

impl Log {
    /// The same log with torques of this kind.
    #[must_use]
    pub fn with_torques(self, column: TorqueColumn) -> Log {
        Log {
            torque: column,
            ..self
        }
    }

    /// The mean torque of a joint from a row to the next, N m (or N); what it is after the last row is unknown, and taken as
    /// constant.
    pub fn held(&self, joint: usize, row: usize) -> f64 {
        let tau = &self.tau[joint];
        let next = || tau[(row + 1).min(tau.len() - 1)];
        match self.torque {
            TorqueColumn::Held => tau[row],
            TorqueColumn::Sampled => 0.5 * (tau[row] + next()),
            TorqueColumn::Mean => next(),
        }
    }

    /// The same for all rows.
    pub fn held_torques(&self, joint: usize) -> Cow<'_, [f64]> {
        let held = |row: usize| self.held(joint, row);
        match self.torque {
            TorqueColumn::Held => Cow::Borrowed(&self.tau[joint]),
            _ => Cow::Owned((0..self.rows()).map(held).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Log, TorqueColumn};

    #[test]
    fn torques_are_means_from_row_to_row() {
        let held = |column| {
            let log = Log {
                time: vec![0.0, 0.1, 0.2],
                tau: vec![vec![1.0, 3.0, 7.0]],
                ..Log::empty(1)
            };
            log.with_torques(column).held_torques(0).into_owned()
        };
        assert_eq!(held(TorqueColumn::Held), [1.0, 3.0, 7.0]);
        assert_eq!(held(TorqueColumn::Sampled), [2.0, 5.0, 7.0]);
        assert_eq!(held(TorqueColumn::Mean), [3.0, 7.0, 7.0]);
    }
}
