//! The table `[columns]` of a model file: which columns of a log hold what, and in which units.

use super::measured_in_file::MeasuredQuantity;
use super::reader::{FileError, Section};
use super::tables::ColumnTable;
use super::values::{ColumnName, OrTable};
use crate::data::{Column, Columns, MeasuredColumn, Quantity};
use crate::expr::Unit;

/// `"position"`, or `{ column = "position", unit = "deg", factor = -1, wrapped = true, late = 0.004 }`.
type Entry<'a> = OrTable<ColumnName, ColumnTable<'a>>;

pub(super) fn columns(
    section: Option<Section<'_>>,
    joints: usize,
    driven_by: Quantity,
    joint_names: &[String],
    quantities: &[MeasuredQuantity],
) -> Result<Columns, FileError> {
    let standard = Columns {
        joint_names: joint_names.to_vec(),
        measured: quantities.iter().map(standard_column).collect(),
        ..Columns::standard(joints, driven_by)
    };
    let Some(section) = section else {
        return Ok(standard);
    };
    let of_joints = [Quantity::Angle, Quantity::Velocity, driven_by];
    let [q, qd, driven] = of_joints.map(Quantity::key);
    let own = quantities.iter().map(|quantity| quantity.name.as_str());
    let known: Vec<&str> = ["topic", "time", q, qd, driven]
        .into_iter()
        .chain(own)
        .collect();
    section.only(&known)?;
    let time = section.read::<Option<Entry<'_>>>("time")?;
    let time = time
        .map(|entry| column(entry, Quantity::Time))
        .transpose()?;
    let [q, qd, tau] = of_joints.map(|quantity| list(&section, quantity, joints));
    let measured = quantities.iter().map(|own| measured(&section, own));
    Ok(Columns {
        topic: section.read("topic")?,
        time: time.unwrap_or(standard.time),
        q: q?.unwrap_or(standard.q),
        // An empty list says that no column holds velocities.
        qd: qd?.or(standard.qd).filter(|columns| !columns.is_empty()),
        tau: tau?.unwrap_or(standard.tau),
        measured: measured.collect::<Result<_, _>>()?,
        ..standard
    })
}

/// The column of the quantity's own name, in its unit.
fn standard_column(quantity: &MeasuredQuantity) -> MeasuredColumn {
    MeasuredColumn {
        name: quantity.name.clone(),
        column: Column::named(quantity.name.as_str()),
    }
}

/// The column of a measured quantity; one in another unit is of the same kind.
fn measured(
    section: &Section<'_>,
    quantity: &MeasuredQuantity,
) -> Result<MeasuredColumn, FileError> {
    let MeasuredQuantity { name, unit } = quantity;
    let Some(entry) = section.read::<Option<Entry<'_>>>(name)? else {
        return Ok(standard_column(quantity));
    };
    let column = column(entry, Quantity::Measured)?;
    let wrong = |message: String| Err(section.error_at(name, message));
    if column.is_none() {
        return wrong(format!(
            "`{name}` has a column without a name; give its name or its number"
        ));
    }
    match column.unit {
        Some(given) if Unit::parse(own_unit(given)) != Unit::parse(unit) => wrong(format!(
            "a column in {given} does not hold `{name}`, which is in `{unit}` under [measured]; give another unit, or a \
             `factor`"
        )),
        _ => Ok(MeasuredColumn {
            name: name.clone(),
            column,
        }),
    }
}

/// The SI unit of which one of [`Quantity::Measured`]'s is a multiple.
fn own_unit(unit: &str) -> &str {
    match unit {
        "%" => "1",
        other => other.trim_start_matches('m'),
    }
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
