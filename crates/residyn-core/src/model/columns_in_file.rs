//! The table `[columns]` of a model file: which columns of a log hold what, and in which units.

use super::reader::{FileError, NameOrTable, Section};
use crate::data::{Column, Columns, Quantity};

const KEYS: &[&str] = &["column", "unit", "factor", "wrapped", "late"];

pub(super) fn columns(
    section: Option<Section<'_>>,
    joints: usize,
    driven_by: Quantity,
    joint_names: &[String],
) -> Result<Columns, FileError> {
    let mut columns = Columns {
        joint_names: joint_names.to_vec(),
        ..Columns::standard(joints, driven_by)
    };
    let Some(section) = section else {
        return Ok(columns);
    };
    let [time, q, qd, driven] = [
        Quantity::Time,
        Quantity::Angle,
        Quantity::Velocity,
        driven_by,
    ]
    .map(Quantity::key);
    section.only(&["topic", time, q, qd, driven])?;
    columns.topic = section.text("topic")?.map(|topic| topic.value);
    if let Some(time) = section.name_or_table("time")? {
        columns.time = column(time, Quantity::Time)?;
    }
    if let Some(q) = list(&section, Quantity::Angle, joints)? {
        columns.q = q;
    }
    if let Some(tau) = list(&section, driven_by, joints)? {
        columns.tau = tau;
    }
    // An empty list says that no column holds velocities.
    if section.is_empty_list("qd") {
        columns.qd = None;
    } else if let Some(qd) = list(&section, Quantity::Velocity, joints)? {
        columns.qd = Some(qd);
    }
    Ok(columns)
}

/// One column per joint.
fn list(
    section: &Section<'_>,
    quantity: Quantity,
    joints: usize,
) -> Result<Option<Vec<Column>>, FileError> {
    let key = quantity.key();
    let Some(given) = section.names_or_tables(key)? else {
        return Ok(None);
    };
    if given.len() != joints {
        let message = format!(
            "`{key}` needs one column per joint: {joints}, found {}",
            given.len()
        );
        return Err(section.error_at(key, message));
    }
    let columns = given.into_iter().map(|entry| column(entry, quantity));
    columns.collect::<Result<_, _>>().map(Some)
}

/// `"position"`, or `{ column = "position", unit = "deg", factor = -1, wrapped = true, late = 0.004 }`.
fn column(entry: NameOrTable<'_>, quantity: Quantity) -> Result<Column, FileError> {
    let table = match entry {
        NameOrTable::Name(name) => return Ok(Column::named(name.value)),
        NameOrTable::Table(table) => table,
    };
    table.only(KEYS)?;
    let wrapped = table.flag("wrapped")?;
    if wrapped && quantity != Quantity::Angle {
        return Err(table.error_at("wrapped", "`wrapped` is for columns of `q`"));
    }
    let factor = table.number("factor")?.unwrap_or(1.0);
    if factor == 0.0 || !factor.is_finite() || (factor < 0.0 && quantity == Quantity::Time) {
        return Err(table.error_at("factor", format!("`factor` cannot be {factor} here")));
    }
    let late_s = table.number("late")?.unwrap_or(0.0);
    if !late_s.is_finite() || (late_s != 0.0 && quantity == Quantity::Time) {
        let message = "`late` must be a time in s, for columns other than `time`";
        return Err(table.error_at("late", message));
    }
    Ok(Column {
        name: table.required_text("column")?.value,
        unit: unit(&table, quantity)?,
        factor,
        wrapped,
        late_s,
    })
}

fn unit(table: &Section<'_>, quantity: Quantity) -> Result<Option<&'static str>, FileError> {
    let Some(given) = table.text("unit")? else {
        return Ok(None);
    };
    let names: Vec<&'static str> = quantity.units().iter().map(|(name, _)| *name).collect();
    match names.iter().find(|name| **name == given.value) {
        Some(name) => Ok(Some(name)),
        None => {
            let known = names.join(", ");
            let message = format!(
                "unknown unit {:?}; known are {known}; give another as `factor`",
                given.value
            );
            Err(table.error_at("unit", message))
        }
    }
}
