//! The `[[effect]]` entries of a model file.

use super::dynamics::PerLogValue;
use super::effect::Effect;
use super::fitted::FittedEffect;
use super::reader::{FileError, Section};
use super::sections;
use super::tables::{PerLogTable, ValueTable};
use super::values::{Limits, Named, OrTable};
use crate::data::Joint;

/// A value and its 95 % interval.
type Estimate = (f64, Option<[f64; 2]>);

pub(super) fn read(
    sections: &[Section<'_>],
    joints: usize,
    library: &[Effect],
) -> Result<Vec<FittedEffect>, FileError> {
    sections
        .iter()
        .map(|section| fitted(section, joints, library))
        .collect()
}

fn fitted(
    section: &Section<'_>,
    joints: usize,
    library: &[Effect],
) -> Result<FittedEffect, FileError> {
    let name: String = section.read("name")?;
    let effect = Effect::find(library, &name);
    let effect = effect.map_err(|unknown| section.error_at("name", unknown.to_string()))?;
    let (key, joint) = match effect.is_coupling() {
        true => ("joints", pair(section, joints)?),
        false => (
            "joint",
            sections::joint(section, section.read("joint")?, joints)?,
        ),
    };
    let mut known = vec!["name", key, "fixed", "status"];
    known.extend(effect.names());
    section.only(&known)?;
    let fixed: bool = section.read("fixed")?;
    let (mut values, mut own) = (Vec::new(), Vec::new());
    for (k, parameter) in effect.parameters.iter().enumerate() {
        let (value, of_logs) = per_log(section.read(&parameter.name)?, k);
        if !(of_logs.is_empty() || parameter.per_log || fixed) {
            let name = &parameter.name;
            let message = format!(
                "`{name}` has one value in all logs; values that you know for some of them need `fixed = true`"
            );
            return Err(section.error_at(name, message));
        }
        values.push(value);
        own.extend(of_logs);
    }
    Ok(FittedEffect {
        effect: effect.clone(),
        joint,
        values,
        own,
        fixed,
        status: section.read("status")?,
    })
}

/// The first of `joints = [5, 6]`, two joints in a row.
fn pair(section: &Section<'_>, joints: usize) -> Result<Joint, FileError> {
    let given: Vec<usize> = section.read("joints")?;
    let is_it = |joint: &Joint| given == [joint.number(), joint.next().number()];
    let mut pairs = Joint::all(joints.saturating_sub(1));
    pairs.find(is_it).ok_or_else(|| {
        let message = format!(
            "`joints` must be two consecutive joints, [1, 2] to [{}, {joints}]",
            joints - 1
        );
        section.error_at("joints", message)
    })
}

/// `F_c = 0.16` or `F_c = { value = 0.16, ci95 = [0.15, 0.17] }`.
fn estimate(given: &OrTable<f64, ValueTable<'_>>) -> Estimate {
    match given {
        OrTable::Plain(value) => (*value, None),
        OrTable::Table(ValueTable { value, ci95, .. }) => {
            (*value, ci95.as_ref().map(|Limits(ends)| *ends))
        }
    }
}

/// `q_z = { value = 0, logs = { "run1.csv" = { value = 0.012, ci95 = [0.011, 0.013] } } }`: the value of the `k`-th
/// parameter, and its per-log values.
fn per_log(given: OrTable<f64, PerLogTable<'_>>, k: usize) -> (Estimate, Vec<PerLogValue>) {
    let table = match given {
        OrTable::Plain(value) => return ((value, None), Vec::new()),
        OrTable::Table(table) => table,
    };
    let Named(logs) = &table.logs;
    let own = logs.iter().map(|(log, given)| of_one_log(log, given, k));
    let value = (table.value, table.ci95.map(|Limits(ends)| ends));
    (value, own.collect())
}

/// The value of the `k`-th parameter in a log: `"run1.csv" = { value = 0.012, ci95 = [0.011, 0.013] }`.
pub(super) fn of_one_log(log: &str, given: &OrTable<f64, ValueTable<'_>>, k: usize) -> PerLogValue {
    let (value, ci95) = estimate(given);
    PerLogValue {
        log: log.to_owned(),
        parameter: k,
        value,
        ci95,
    }
}
