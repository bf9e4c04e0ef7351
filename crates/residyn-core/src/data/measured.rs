//! Measured columns beside those of the joints: a supply voltage, a temperature, a current.

use super::error::{LogError, Place};
use super::log::Log;
use crate::expr::listed;

/// What their names begin with, in logs and in formulas.
pub const MEASURED_PREFIX: &str = "u_";

/// What such a column reads where no log says it, in its unit: a matrix is looked at in some state, an effect is compared
/// with its mirror image.
pub(crate) const NOMINAL: f64 = 1.0;

/// Whether a name is that of such a column.
pub fn is_measured(name: &str) -> bool {
    name.len() > MEASURED_PREFIX.len() && name.starts_with(MEASURED_PREFIX)
}

/// The values of such a column, each held from its row to the next.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// `u_volts`
    pub name: String,
    /// In the unit that the model file declares.
    pub values: Vec<f64>,
}

impl Measured {
    /// The values of the columns of these names, in their order.
    ///
    /// # Panics
    /// If one is missing: [`Log::check_measured`] tells.
    pub(crate) fn named<'m, 'n>(
        all: &'m [Self],
        names: impl IntoIterator<Item = &'n str>,
    ) -> Vec<&'m Vec<f64>> {
        let find = |name| {
            let found = all.iter().find(|measured| measured.name == name);
            &found
                .expect("logs have the measured columns of the model")
                .values
        };
        names.into_iter().map(find).collect()
    }
}

impl Log {
    /// Whether the log has the measured columns of these names, for a log that was not read with the columns of the
    /// model that needs them.
    ///
    /// # Errors
    /// The first one that it lacks.
    pub fn check_measured<'n>(
        &self,
        names: impl IntoIterator<Item = &'n str>,
    ) -> Result<(), LogError> {
        let has = |name: &str| self.measured.iter().any(|measured| measured.name == name);
        match names.into_iter().find(|name| !has(name)) {
            None => Ok(()),
            Some(name) => Err(self.lacks(name)),
        }
    }

    /// Its measured columns, without rows.
    pub(crate) fn empty_measured(&self) -> Vec<Measured> {
        let empty = |measured: &Measured| Measured {
            name: measured.name.clone(),
            values: Vec::new(),
        };
        self.measured.iter().map(empty).collect()
    }

    /// What its measured columns read at a row.
    pub(crate) fn measured_at(&self, row: usize) -> Vec<f64> {
        let measured = self.measured.iter();
        measured.map(|measured| measured.values[row]).collect()
    }

    fn lacks(&self, name: &str) -> LogError {
        let own = self.measured.iter().map(|measured| measured.name.as_str());
        let own: Vec<&str> = own.collect();
        let has = match own.as_slice() {
            [] => "it has no column u_NAME".to_owned(),
            _ => format!("it has {}", listed(own)),
        };
        LogError::MissingColumn {
            path: self.path.clone(),
            place: Place::Arrays,
            column: name.to_owned(),
            remedy: format!(
                "{has}. Record it, or remove it from [measured] and the formulas of the model file"
            ),
        }
    }
}
