//! Parquet: a column of numbers is a column; one of lists of numbers is as many as a list is long, `name1`, `name2` ..

use std::path::Path;
use std::sync::Arc;

use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::record::reader::RowIter;
use parquet::schema::types::Type;

use super::arrays::Arrays;
use super::unpack::too_large;
use crate::data::error::LogError;
use crate::files;
use crate::limits::unpacked_bytes;

/// # Errors
/// A file that is damaged, or whose lists are of different lengths.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    let mut table = Arrays::default();
    for List {
        name,
        is_list,
        rows,
    } in lists(path, |_| true)?
    {
        for (number, column) in (1..).zip(columns(&rows, &name, path)?) {
            match is_list {
                true => table.add(format!("{name}{number}"), column),
                false => table.add(&name, column),
            }
        }
    }
    Ok(table)
}

/// A column, of which each row has a list of numbers, or one of them.
pub(super) struct List {
    pub name: String,
    pub is_list: bool,
    pub rows: Vec<Vec<f64>>,
}

/// The columns that the rows of a list make.
///
/// # Errors
/// A list of another length than the first.
pub(super) fn columns(
    rows: &[Vec<f64>],
    name: &str,
    path: &Path,
) -> Result<Vec<Vec<f64>>, LogError> {
    let width = rows.first().map_or(0, Vec::len);
    if let Some(row) = rows.iter().position(|row| row.len() != width) {
        let found = rows[row].len();
        return Err(LogError::Form {
            path: path.to_owned(),
            fault: format!(
                "row {} of {name:?} has {found} number(s) where the first has {width}; write as many in all",
                row + 1
            ),
        });
    }
    let column = |k: usize| rows.iter().map(|row| row[k]).collect();
    Ok((0..width).map(column).collect())
}

/// The columns of numbers whose names are wanted.
///
/// # Errors
/// A file that is damaged.
pub(super) fn lists(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<List>, LogError> {
    let damaged = |why: String| LogError::Form {
        path: path.to_owned(),
        fault: format!("is no whole Parquet file: {why}; write it again"),
    };
    read_lists(path, is_wanted).map_err(|why| damaged(why.to_string()))
}

fn read_lists(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<List>, ParquetError> {
    let file = files::open(path)?;
    let most = unpacked_bytes(file.metadata()?.len());
    let reader = SerializedFileReader::new(file)?;
    let described = reader.metadata().file_metadata();
    let schema = described.schema().clone();
    let cells = described
        .num_rows()
        .saturating_mul(schema.get_fields().len() as i64);
    if cells.saturating_mul(8).cast_unsigned() > most {
        return Err(too_large().into());
    }
    let fields = schema.get_fields().iter();
    let wanted: Vec<Arc<Type>> = fields
        .filter(|field| is_wanted(field.name()))
        .cloned()
        .collect();
    let schema = Type::group_type_builder(schema.name())
        .with_fields(wanted)
        .build()?;
    let mut lists: Vec<List> = Vec::new();
    for row in RowIter::from_file_into(Box::new(reader)).project(Some(schema))? {
        let row = row?;
        for (index, (name, field)) in row.get_column_iter().enumerate() {
            if lists.len() == index {
                lists.push(List {
                    name: name.clone(),
                    is_list: matches!(field, Field::ListInternal(_)),
                    rows: Vec::new(),
                });
            }
            lists[index].rows.push(numbers(field));
        }
    }
    Ok(lists)
}

/// The numbers of a cell; none where it holds something else.
fn numbers(field: &Field) -> Vec<f64> {
    match field {
        Field::ListInternal(list) => list.elements().iter().flat_map(numbers).collect(),
        field => number(field).into_iter().collect(),
    }
}

#[allow(clippy::cast_precision_loss)] // integers of loggers are far below 2^53
fn number(field: &Field) -> Option<f64> {
    match *field {
        Field::Null => Some(f64::NAN),
        Field::Bool(is) => Some(f64::from(u8::from(is))),
        Field::Byte(number) => Some(number.into()),
        Field::Short(number) => Some(number.into()),
        Field::Int(number) => Some(number.into()),
        Field::Long(number) | Field::TimestampMillis(number) | Field::TimestampMicros(number) => {
            Some(number as f64)
        }
        Field::UByte(number) => Some(number.into()),
        Field::UShort(number) => Some(number.into()),
        Field::UInt(number) => Some(number.into()),
        Field::ULong(number) => Some(number as f64),
        Field::Float16(number) => Some(number.into()),
        Field::Float(number) => Some(number.into()),
        Field::Double(number) => Some(number),
        _ => None,
    }
}
