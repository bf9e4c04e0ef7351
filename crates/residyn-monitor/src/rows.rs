use super::MonitorError;
use residyn_core::data::{Log, Quantity};

/// Rows of a running machine, as columns. Velocities are not among them: most machines filter or delay theirs, and
/// positions hold them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rows {
    /// s, increasing.
    pub time: Vec<f64>,
    /// Angles (rad, or m), `[joint][row]`.
    pub q: Vec<Vec<f64>>,
    /// Torques (N m, or N) or the commands of the drives, whichever drives the model, `[joint][row]`.
    pub driven: Vec<Vec<f64>>,
    /// The further measured columns of the model, in its order, `[column][row]`.
    pub measured: Vec<Vec<f64>>,
}

impl Rows {
    /// No row yet, of a model with this many joints and further measured columns.
    pub fn none(joints: usize, measured: usize) -> Self {
        Self {
            time: Vec::new(),
            q: vec![Vec::new(); joints],
            driven: vec![Vec::new(); joints],
            measured: vec![Vec::new(); measured],
        }
    }

    /// The rows of a log; `measured` are the names of the model's further measured columns.
    ///
    /// # Errors
    /// A measured column that the log lacks.
    pub fn of_log<'n>(
        log: &Log,
        measured: impl IntoIterator<Item = &'n str>,
    ) -> Result<Self, MonitorError> {
        let column = |name: &str| {
            let found = log.measured.iter().find(|measured| measured.name == name);
            found.map(|measured| measured.values.clone())
        };
        let names: Vec<&str> = measured.into_iter().collect();
        let columns: Vec<Vec<f64>> = names.iter().filter_map(|name| column(name)).collect();
        if columns.len() < names.len() {
            return Err(MonitorError::Columns {
                what: "further measurements",
                found: columns.len(),
                wanted: names.join(", "),
            });
        }
        Ok(Self {
            time: log.time.clone(),
            q: log.q.clone(),
            driven: log.tau.clone(),
            measured: columns,
        })
    }

    /// Checks shapes and numbers. `before` rows and a last time came earlier.
    pub(crate) fn check(&self, expected: &Expected, before: &Seen) -> Result<(), MonitorError> {
        let stem = expected.driven_by.key();
        let joints = format!("{} joint(s)", expected.joints);
        let groups = [
            ("angles", &self.q, expected.joints, joints.clone()),
            (stem, &self.driven, expected.joints, joints),
            (
                "further measurements",
                &self.measured,
                expected.measured.len(),
                format!("{} column(s) of the model", expected.measured.len()),
            ),
        ];
        for (what, columns, wanted, said) in groups {
            if columns.len() != wanted {
                return Err(MonitorError::Columns {
                    what,
                    found: columns.len(),
                    wanted: said,
                });
            }
        }
        let named = |stem: &'static str| move |joint: usize| format!("{stem}{}", joint + 1);
        let of = |columns: &[Vec<f64>], name: &dyn Fn(usize) -> String| {
            let mut columns = columns.iter().enumerate();
            columns.try_for_each(|(at, column)| self.check_column(column, &name(at), before.rows))
        };
        self.check_column(&self.time, "time", before.rows)?;
        of(&self.q, &named("q"))?;
        of(&self.driven, &named(stem))?;
        of(&self.measured, &|at| expected.measured[at].clone())?;
        self.check_order(before)
    }

    fn check_column(&self, column: &[f64], name: &str, before: usize) -> Result<(), MonitorError> {
        let rows = self.time.len();
        if column.len() != rows {
            let shorter = column.len().min(rows);
            return Err(MonitorError::Length {
                row: before + shorter + 1,
                column: name.to_owned(),
                rows: column.len(),
            });
        }
        match column.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(row) => Err(MonitorError::NotFinite {
                row: before + row + 1,
                column: name.to_owned(),
                value: column[row],
            }),
        }
    }

    fn check_order(&self, before: &Seen) -> Result<(), MonitorError> {
        let mut last = before.time;
        for (row, time) in self.time.iter().enumerate() {
            if *time <= last {
                return Err(MonitorError::Order {
                    row: before.rows + row + 1,
                    time: *time,
                    before: last,
                });
            }
            last = *time;
        }
        Ok(())
    }
}

/// What rows have to hold.
#[derive(Debug, Clone)]
pub(crate) struct Expected {
    pub joints: usize,
    pub driven_by: Quantity,
    pub measured: Vec<String>,
}

/// How many rows came so far, and the time of the last (s).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    pub rows: usize,
    pub time: f64,
}
