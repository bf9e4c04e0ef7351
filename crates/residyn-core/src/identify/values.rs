use nalgebra::DVector;

use crate::data::Log;
use crate::model::{Dynamics, InLog, Parameter, PerLogValue};
use crate::sim::Window;

/// The value that a parameter has in one log only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Own {
    /// Index of the log.
    pub log: usize,
    /// Index into the model's parameters.
    pub parameter: usize,
    pub value: f64,
    /// The first of the logs that share the value in a fit: the log itself unless the value is that of a group. `None`
    /// if the model file gives the value, or holds it.
    pub shared: Option<usize>,
}

impl Own {
    fn is_of(&self, column: Column) -> bool {
        self.shared.is_some() && self.shared == column.log && self.parameter == column.parameter
    }
}

/// Values of all parameters of a model as a fit to a list of logs moves them: those that hold in every log, and those
/// of a single log, by its place in that list.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Values {
    /// One value per parameter, in the model's order. For a parameter with a value per log, the one that holds in logs
    /// without their own value.
    pub common: Vec<f64>,
    pub own: Vec<Own>,
}

impl Values {
    /// The values of a model on these logs.
    pub fn of(dynamics: &Dynamics, logs: &[Log]) -> Self {
        let parameters = &dynamics.parameters;
        let groups = dynamics.groups(logs);
        let in_log = |(index, log): (usize, &Log)| {
            let known: Vec<InLog> = dynamics.values_in(log).collect();
            let is_known = |k: usize| known.iter().any(|known| known.parameter == k);
            // A group shares a value from the start.
            let new = parameters.iter().enumerate().map(|(parameter, p)| InLog {
                parameter,
                value: p.value,
                is_given: p.fixed,
            });
            let new =
                new.filter(|new| parameters[new.parameter].per_group && !is_known(new.parameter));
            let own = |found: &InLog| Own {
                log: index,
                parameter: found.parameter,
                value: found.value,
                shared: match &parameters[found.parameter] {
                    p if found.is_given || p.fixed => None,
                    p if p.per_group => Some(groups[index]),
                    _ => Some(index),
                },
            };
            let all: Vec<InLog> = known.iter().copied().chain(new).collect();
            all.iter().map(own).collect::<Vec<_>>()
        };
        Self {
            common: dynamics.values(),
            own: logs.iter().enumerate().flat_map(in_log).collect(),
        }
    }

    /// The model with these values; values in other logs are kept.
    pub fn put_into(&self, dynamics: &Dynamics, logs: &[Log]) -> Dynamics {
        let mut found = dynamics.clone().with_values(self.common.iter().copied());
        let is_fitted = |own: &PerLogValue| {
            let is_given = dynamics.parameters[own.parameter].fixed;
            !is_given && logs.iter().any(|log| log.is_called(&own.log))
        };
        found.own.retain(|own| !is_fitted(own));
        let fitted = self.own.iter().filter(|own| own.shared.is_some());
        found.own.extend(fitted.map(|own| PerLogValue {
            log: logs[own.log].path.display().to_string(),
            parameter: own.parameter,
            value: own.value,
            ci95: None,
        }));
        found
    }

    /// The values of all parameters in a log.
    pub fn of_log(&self, log: usize) -> Vec<f64> {
        let mut values = self.common.clone();
        for own in self.own.iter().filter(|own| own.log == log) {
            values[own.parameter] = own.value;
        }
        values
    }

    /// Call `set(parameter, lane, value)` for every value of one log, for each lane of windows of that log.
    pub(super) fn by_lane(&self, logs: &[usize], mut set: impl FnMut(usize, usize, f64)) {
        for own in &self.own {
            for lane in (0..logs.len()).filter(|&lane| logs[lane] == own.log) {
                set(own.parameter, lane, own.value);
            }
        }
    }

    /// The value of a free value of a fit.
    pub fn get(&self, column: Column) -> f64 {
        let own = self.own.iter().find(|own| own.is_of(column));
        own.map_or(self.common[column.parameter], |own| own.value)
    }

    /// These values after a step of a fit's free ones, each within its bounds.
    pub(crate) fn moved(
        &self,
        dynamics: &Dynamics,
        columns: &[Column],
        step: &DVector<f64>,
    ) -> Self {
        let mut moved = self.clone();
        for (column, step) in columns.iter().zip(step) {
            let [low, high] = dynamics.parameters[column.parameter].bounds;
            moved.set(*column, (self.get(*column) + step).clamp(low, high));
        }
        moved
    }

    fn set(&mut self, column: Column, value: f64) {
        let Some(log) = column.log else {
            self.common[column.parameter] = value;
            return;
        };
        let mut is_new = true;
        for own in self.own.iter_mut().filter(|own| own.is_of(column)) {
            own.value = value;
            is_new = false;
        }
        if is_new {
            self.own.push(Own {
                log,
                parameter: column.parameter,
                value,
                shared: Some(log),
            });
        }
    }

    /// The first of the logs that share a parameter's value in a log.
    fn first_of(&self, parameter: usize, log: usize) -> usize {
        let mut own = self.own.iter();
        let own = own.find(|own| own.log == log && own.parameter == parameter);
        own.and_then(|own| own.shared).unwrap_or(log)
    }

    /// Parameters whose values in a log the model file gives.
    pub(super) fn given_in(&self, log: usize) -> impl Iterator<Item = usize> {
        let given = move |own: &&Own| own.log == log && own.shared.is_none();
        self.own.iter().filter(given).map(|own| own.parameter)
    }
}

/// The parameters of a model that its file does not fix.
pub(crate) fn free_parameters(dynamics: &Dynamics) -> Vec<usize> {
    let parameters = &dynamics.parameters;
    (0..parameters.len())
        .filter(|&k| !parameters[k].fixed)
        .collect()
}

/// One free value of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Index into the model's parameters.
    pub parameter: usize,
    /// The log in which it holds, or the first one of the group in which it holds; `None` for all.
    pub log: Option<usize>,
}

/// The columns of a fit, and which of them enter each window.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub columns: Vec<Column>,
    /// `[log][k]`: the column of the k-th active parameter in that log.
    places: Vec<Vec<usize>>,
}

impl Layout {
    /// One column for each active parameter or, if it differs by log, one for each log or group that has windows.
    pub fn new(
        parameters: &[Parameter],
        active: &[usize],
        windows: &[Window],
        values: &Values,
    ) -> Self {
        let mut logs: Vec<usize> = windows.iter().map(|window| window.log).collect();
        logs.sort_unstable();
        logs.dedup();
        let mut columns: Vec<Column> = Vec::new();
        let mut places = vec![Vec::new(); logs.last().map_or(0, |last| last + 1)];
        for &parameter in active {
            let per_log = parameters[parameter].per_log;
            let first = columns.len();
            for &log in &logs {
                let first_log = per_log.then(|| values.first_of(parameter, log));
                let column = Column {
                    parameter,
                    log: first_log,
                };
                let known = columns[first..].iter().position(|known| *known == column);
                let place = known.map_or(columns.len(), |place| first + place);
                if known.is_none() {
                    columns.push(column);
                }
                places[log].push(place);
            }
        }
        Self { columns, places }
    }

    /// The columns of a window's active parameters.
    pub fn places(&self, window: &Window) -> &[usize] {
        &self.places[window.log]
    }
}
