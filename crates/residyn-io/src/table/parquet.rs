//! Parquet: a column of numbers becomes one column; a column of lists becomes one column per list entry, `name1`,
//! `name2` ..

use std::path::Path;
use std::sync::Arc;

use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use parquet::record::reader::RowIter;
use parquet::schema::types::Type;

use super::budget::too_large;
use super::ending::Ending;
use super::footer;
use crate::files;
use residyn_core::data::Arrays;
use residyn_core::data::LogError;
use residyn_core::limits::{LOG_COLUMNS, unpacked_bytes};

/// # Errors
/// A file that is damaged, or whose lists are of different lengths.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    let packed = files::size(path).map_err(LogError::open(path))?;
    let mut table = Arrays::of(packed);
    for list in lists(path, |_| true)? {
        let (name, is_list) = (list.name.clone(), list.is_list);
        for (number, column) in (1..).zip(list.columns(path)?) {
            match is_list {
                true => table.add(format!("{name}{number}"), column),
                false => table.add(&name, column),
            }
        }
    }
    Ok(table)
}

/// A column in which each row has a list of numbers, or a single number.
pub(super) struct List {
    pub name: String,
    pub is_list: bool,
    rows: usize,
    /// One for each number of the first row.
    columns: Vec<Vec<f64>>,
    /// The first row with a different count, and that count. Nothing is kept from there on.
    ragged: Option<(usize, usize)>,
}

impl List {
    /// A column without rows yet, whose first will be `first`.
    ///
    /// # Errors
    /// More numbers than a log has columns.
    fn of(name: &str, first: &Field) -> Result<Self, ParquetError> {
        let mut row = Vec::new();
        add_numbers(first, &mut row);
        if row.len() > LOG_COLUMNS {
            let message = format!(
                "{name:?} has {} numbers per row, but at most {LOG_COLUMNS} columns are read",
                row.len()
            );
            return Err(ParquetError::General(message));
        }
        Ok(Self {
            name: name.to_owned(),
            is_list: matches!(first, Field::ListInternal(_)),
            rows: 0,
            columns: vec![Vec::new(); row.len()],
            ragged: None,
        })
    }

    /// The columns that the rows make.
    ///
    /// # Errors
    /// A row of another length than the first.
    pub fn columns(self, path: &Path) -> Result<Vec<Vec<f64>>, LogError> {
        let width = self.columns.len();
        match self.ragged {
            None => Ok(self.columns),
            Some((row, length)) => Err(LogError::form(
                path,
                format!(
                    "row {} of {:?} has {length} number(s) but the first has {width}; write the same number in every row",
                    row + 1,
                    self.name,
                ),
            )),
        }
    }

    /// The numbers of a column that has one in each row.
    pub fn numbers(&self) -> &[f64] {
        self.columns.first().map_or(&[], Vec::as_slice)
    }

    /// Adds the rows of another file.
    pub fn extend(&mut self, other: &Self) {
        let as_wide = self.columns.len() == other.columns.len();
        let other_width = (!as_wide).then_some((0, other.columns.len()));
        let ragged = other_width.or(other.ragged);
        let ragged = ragged.map(|(row, length)| (self.rows + row, length));
        self.ragged = self.ragged.or(ragged);
        for (column, other) in self.columns.iter_mut().zip(&other.columns) {
            column.extend(other);
        }
        self.rows += other.rows;
    }

    /// Keeps the rows for which `is_kept` is true, in their order.
    pub fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        for column in &mut self.columns {
            let mut row = 0..;
            column.retain(|_| row.next().is_some_and(&is_kept));
        }
    }

    /// Adds a row; `numbers` is a buffer for its numbers.
    fn push(&mut self, field: &Field, numbers: &mut Vec<f64>) {
        numbers.clear();
        add_numbers(field, numbers);
        if numbers.len() != self.columns.len() {
            self.ragged.get_or_insert((self.rows, numbers.len()));
        }
        if self.ragged.is_none() {
            for (column, number) in self.columns.iter_mut().zip(numbers) {
                column.push(*number);
            }
        }
        self.rows += 1;
    }
}

/// The columns of numbers whose names are wanted.
///
/// # Errors
/// A file that is damaged.
pub(super) fn lists(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<List>, LogError> {
    read_lists(path, is_wanted).map_err(|why| {
        let fault = format!("is not a complete Parquet file: {why}; write it again");
        LogError::form(path, fault)
    })
}

fn read_lists(path: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<List>, ParquetError> {
    let file = files::open(path)?;
    let most = unpacked_bytes(file.metadata()?.len());
    footer::check(&file)?;
    let reader = SerializedFileReader::new(Ending(file))?;
    check_size(&reader, most)?;
    let schema = reader.metadata().file_metadata().schema().clone();
    let fields = schema.get_fields().iter();
    let wanted: Vec<Arc<Type>> = fields
        .filter(|field| is_wanted(field.name()))
        .cloned()
        .collect();
    let schema = Type::group_type_builder(schema.name())
        .with_fields(wanted)
        .build()?;
    let (mut lists, mut numbers) = (Vec::<List>::new(), Vec::new());
    for row in RowIter::from_file_into(Box::new(reader)).project(Some(schema))? {
        let row = row?;
        for (index, (name, field)) in row.get_column_iter().enumerate() {
            if lists.len() == index {
                lists.push(List::of(name, field)?);
            }
            lists[index].push(field, &mut numbers);
        }
    }
    Ok(lists)
}

/// Check that the cells of all columns take at most `most` bytes, counted in the pages, since a packed page may hold
/// any number of cells, whatever the description of the file says; and that there are no more columns than a log has,
/// since the reader takes memory for each.
fn check_size(reader: &SerializedFileReader<Ending>, most: u64) -> Result<(), ParquetError> {
    let described = reader.metadata().file_metadata();
    let columns = described.schema_descr().num_columns();
    if columns > LOG_COLUMNS {
        let message = format!("has {columns} columns; at most {LOG_COLUMNS} are read");
        return Err(ParquetError::General(message));
    }
    let groups = reader.metadata().row_groups().iter();
    let rows = groups.map(|group| group.num_rows().cast_unsigned());
    let rows = rows.fold(0, u64::saturating_add);
    let rows = rows.max(described.num_rows().cast_unsigned());
    check_cells(rows.saturating_mul(columns.max(1) as u64), most)?;
    let mut of_pages = 0_u64;
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        for column in 0..group.num_columns() {
            let mut pages = group.get_column_page_reader(column)?;
            while let Some(page) = pages.peek_next_page()? {
                of_pages = of_pages.saturating_add(page.num_levels.unwrap_or(0) as u64);
                check_cells(of_pages, most)?;
                pages.skip_next_page()?;
            }
        }
    }
    Ok(())
}

fn check_cells(cells: u64, most: u64) -> Result<(), ParquetError> {
    // 8 bytes each, twice as many while a column grows.
    match cells.saturating_mul(16) <= most {
        true => Ok(()),
        false => Err(too_large().into()),
    }
}

/// The numbers of a cell; none if it holds something else.
fn add_numbers(field: &Field, numbers: &mut Vec<f64>) {
    match field {
        Field::ListInternal(list) => {
            let elements = list.elements().iter();
            elements.for_each(|element| add_numbers(element, numbers));
        }
        field => numbers.extend(number(field)),
    }
}

#[allow(clippy::cast_precision_loss)] // logged integers are far below 2^53
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
