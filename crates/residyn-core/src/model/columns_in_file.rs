//! The table `[columns]` of a model file: which columns of a log hold what, and in which units.

use super::reader::{FileError, Section};
use super::tables::ColumnTable;
use super::values::{ColumnName, OrTable};
use crate::data::{Column, Columns, Quantity};

/// `"position"`, or `{ column = "position", unit = "deg", factor = -1, wrapped = true, late = 0.004 }`.
type Entry<'a> = OrTable<ColumnName, ColumnTable<'a>>;

pub(super) fn columns(
    section: Option<Section<'_>>,
    joints: usize,
    driven_by: Quantity,
    joint_names: &[String],
) -> Result<Columns, FileError> {
    let standard = Columns {
        joint_names: joint_names.to_vec(),
        ..Columns::standard(joints, driven_by)
    };
    let Some(section) = section else {
        return Ok(standard);
    };
    let quantities = [Quantity::Angle, Quantity::Velocity, driven_by];
    let [q, qd, driven] = quantities.map(Quantity::key);
    section.only(&["topic", "time", q, qd, driven])?;
    let time = section.read::<Option<Entry<'_>>>("time")?;
    let time = time
        .map(|entry| column(entry, Quantity::Time))
        .transpose()?;
    let [q, qd, tau] = quantities.map(|quantity| list(&section, quantity, joints));
    Ok(Columns {
        topic: section.read("topic")?,
        time: time.unwrap_or(standard.time),
        q: q?.unwrap_or(standard.q),
        // An empty list says that no column holds velocities.
        qd: qd?.or(standard.qd).filter(|columns| !columns.is_empty()),
        tau: tau?.unwrap_or(standard.tau),
        ..standard
    })
}

/// One column per joint, or none for velocities.
fn list(
    section: &Section<'_>,
    quantity: Quantity,
    joints: usize,
) -> Result<Option<Vec<Column>>, FileError> {
    let key = quantity.key();
    let Some(entries) = section.read::<Option<Vec<Entry<'_>>>>(key)? else {
        return Ok(None);
    };
    let found = entries.len();
    if found != joints && !(found == 0 && quantity == Quantity::Velocity) {
        let message = format!("`{key}` needs one column per joint: {joints}, found {found}");
        return Err(section.error_at(key, message));
    }
    let columns = entries.into_iter().map(|entry| column(entry, quantity));
    let columns = columns.collect::<Result<Vec<_>, _>>()?;
    let may_lack = matches!(quantity, Quantity::Torque | Quantity::Command);
    if !may_lack && columns.iter().any(Column::is_none) {
        let message = format!(
            "`{key}` has a column without a name; give its name or its number: only a joint without a drive has none, under \
             `tau`"
        );
        return Err(section.error_at(key, message));
    }
    Ok(Some(columns))
}

fn column(entry: Entry<'_>, quantity: Quantity) -> Result<Column, FileError> {
    let table = match entry {
        OrTable::Plain(ColumnName(name)) => return Ok(Column::named(name)),
        OrTable::Table(table) => table,
    };
    let wrong = |key: &str, message: &str| Err(table.section.error_at(key, message));
    if table.wrapped && quantity != Quantity::Angle {
        return wrong("wrapped", "`wrapped` is for columns of `q`");
    }
    let factor = table.factor.unwrap_or(1.0);
    if factor == 0.0 || (factor < 0.0 && quantity == Quantity::Time) {
        return wrong("factor", &format!("`factor` cannot be {factor} here"));
    }
    let late_s = table.late.unwrap_or(0.0);
    if late_s != 0.0 && quantity == Quantity::Time {
        let message = "`late` must be a time in s, for columns other than `time`";
        return wrong("late", message);
    }
    Ok(Column {
        unit: unit(&table, quantity)?,
        name: table.column.0,
        factor,
        wrapped: table.wrapped,
        late_s,
    })
}

fn unit(table: &ColumnTable<'_>, quantity: Quantity) -> Result<Option<&'static str>, FileError> {
    let Some(given) = &table.unit else {
        return Ok(None);
    };
    let names = quantity.units().iter().map(|(name, _)| *name);
    if let Some(name) = names.clone().find(|name| name == given) {
        return Ok(Some(name));
    }
    let known = names.collect::<Vec<_>>().join(", ");
    let message = format!("unknown unit {given:?}; known are {known}; give another as `factor`");
    Err(table.section.error_at("unit", message))
}
