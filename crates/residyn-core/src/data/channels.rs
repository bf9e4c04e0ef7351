use super::column::Quantity;
use super::columns::Columns;
use super::error::LogError;
use super::log::Log;

/// The channels of one trajectory in memory, as held by a program that recorded them itself: `[joint][row]`.
///
/// ```
/// use residyn_core::data::{Channels, Quantity};
///
/// let time: Vec<f64> = (0..200).map(|row| 0.01 * f64::from(row)).collect();
/// let angle: Vec<f64> = time.iter().map(|t| t.cos()).collect();
/// let torque = vec![0.0; time.len()];
/// let channels = Channels {
///     time,
///     q: vec![angle],
///     qd: None, // from the angles
///     driven: Some((Quantity::Torque, vec![torque])),
/// };
/// let log = channels.log("swing")?;
/// assert_eq!((log.name(), log.joints(), log.rows()), ("swing".to_owned(), 1, 200));
/// # Ok::<(), residyn_core::data::LogError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Channels {
    /// s
    pub time: Vec<f64>,
    /// rad (or m)
    pub q: Vec<Vec<f64>>,
    /// rad/s (or m/s); without them, velocities come from the angles.
    pub qd: Option<Vec<Vec<f64>>>,
    /// Torques in N m (or N), or commands of the drives, and which of the two; without them, the rig is passive.
    pub driven: Option<(Quantity, Vec<Vec<f64>>)>,
}

impl Channels {
    /// The log that a file with these columns would give; `name` is for messages and the report.
    ///
    /// # Errors
    /// As [`Log::of_table`].
    pub fn log(self, name: &str) -> Result<Log, LogError> {
        let joints = self.q.len();
        let driven_by = (self.driven.as_ref()).map_or(Quantity::Torque, |(quantity, _)| *quantity);
        let driven = self.driven.map(|(_, driven)| driven);
        let channels = [
            ("q", Some(self.q)),
            ("qd", self.qd),
            (driven_by.key(), driven),
        ];
        let named = channels.into_iter().flat_map(|(stem, channel)| {
            let numbered = (1..).zip(channel.into_iter().flatten());
            numbered.map(move |(number, column)| (format!("{stem}{number}"), column))
        });
        let time = std::iter::once(("time".to_owned(), self.time));
        let rig = (joints, &Columns::standard(joints, driven_by));
        Log::from_columns(name, time.chain(named), Some(rig))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channels() -> Channels {
        let time: Vec<f64> = (0..50).map(|row| 0.01 * f64::from(row)).collect();
        Channels {
            q: vec![time.iter().map(|t| 3.0 * t * t).collect(); 2],
            time,
            ..Channels::default()
        }
    }

    #[test]
    fn what_is_not_given_is_as_in_a_file_without_it() {
        let log = channels().log("swing").unwrap();
        assert_eq!((log.joints(), log.rows()), (2, 50));
        assert!((log.qd[1][20] - 6.0 * 0.2).abs() < 1e-9);
        assert!(log.tau[0].iter().all(|tau| *tau == 0.0) && log.notes.len() == 2);
    }

    #[test]
    fn commands_are_commands() {
        let mut channels = channels();
        channels.driven = Some((Quantity::Command, channels.q.clone()));
        let log = channels.log("servo").unwrap();
        assert_eq!((log.driven_by, &log.tau), (Quantity::Command, &log.q));
    }

    #[test]
    fn faults_are_placed() {
        let mut short = channels();
        short.q[1].truncate(48);
        let said = |channels: Channels| channels.log("swing").unwrap_err().to_string();
        assert!(said(short).contains("swing, row 49, column \"q2\": is empty"));
        let mut other = channels();
        other.driven = Some((Quantity::Torque, other.q[..1].to_vec()));
        assert!(said(other).contains("no column \"tau2\""));
    }
}
