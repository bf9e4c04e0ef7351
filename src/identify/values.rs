use crate::model::Parameter;

use crate::sim::Window;

/// The value that a parameter has in one log alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Own {
    /// Index of the log.
    pub log: usize,
    /// Index into the model's parameters.
    pub parameter: usize,
    pub value: f64,
}

/// Values of all parameters of a model: those that hold in every log, and those that one log has of its own.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    /// One value a parameter, in the model's order; of a parameter with a value per log, what holds in a log
    /// that has none of its own.
    pub common: Vec<f64>,
    pub own: Vec<Own>,
}

impl From<&[f64]> for Values {
    fn from(common: &[f64]) -> Self {
        Self {
            common: common.to_vec(),
            own: Vec::new(),
        }
    }
}

impl From<&Vec<f64>> for Values {
    fn from(common: &Vec<f64>) -> Self {
        common.as_slice().into()
    }
}

impl Values {
    /// All parameters as they are in a log.
    pub fn of_log(&self, log: usize) -> Vec<f64> {
        let mut values = self.common.clone();
        for own in self.own.iter().filter(|own| own.log == log) {
            values[own.parameter] = own.value;
        }
        values
    }

    pub(super) fn get(&self, column: Column) -> f64 {
        value_of(&self.common, &self.own, column)
    }

    pub(super) fn set(&mut self, column: Column, value: f64) {
        let Some(log) = column.log else {
            self.common[column.parameter] = value;
            return;
        };
        let parameter = column.parameter;
        let mut own = self.own.iter_mut();
        match own.find(|own| own.log == log && own.parameter == parameter) {
            Some(own) => own.value = value,
            None => self.own.push(Own {
                log,
                parameter,
                value,
            }),
        }
    }
}

pub(super) fn value_of(common: &[f64], own: &[Own], column: Column) -> f64 {
    let is_it = |own: &&Own| Some(own.log) == column.log && own.parameter == column.parameter;
    own.iter()
        .find(is_it)
        .map_or(common[column.parameter], |own| own.value)
}

/// One free value of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Index into the model's parameters.
    pub parameter: usize,
    /// The log in which it holds; `None` for all.
    pub log: Option<usize>,
}

/// The free values of a fit, and where those of each window stand among them.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub columns: Vec<Column>,
    /// `[log][k]`: the column of the k-th active parameter in that log.
    places: Vec<Vec<usize>>,
}

impl Layout {
    /// One column for each active parameter, or one for each log that has windows where it differs by log.
    pub fn new(parameters: &[Parameter], active: &[usize], windows: &[Window]) -> Self {
        let mut logs: Vec<usize> = windows.iter().map(|window| window.log).collect();
        logs.sort_unstable();
        logs.dedup();
        let mut columns = Vec::new();
        let mut places = vec![Vec::new(); logs.last().map_or(0, |last| last + 1)];
        for &parameter in active {
            let per_log = parameters[parameter].per_log;
            if !per_log {
                columns.push(Column {
                    parameter,
                    log: None,
                });
            }
            for &log in &logs {
                if per_log {
                    let log = Some(log);
                    columns.push(Column { parameter, log });
                }
                places[log].push(columns.len() - 1);
            }
        }
        Self { columns, places }
    }

    /// The columns of a window's active parameters.
    pub fn places(&self, window: &Window) -> &[usize] {
        &self.places[window.log]
    }
}
