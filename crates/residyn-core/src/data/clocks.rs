//! Commands on another clock than the angles: a table with each message in a row of its own, or with commands in some of its
//! rows only, has empty cells in between.

use super::column::Quantity;
use super::table::Numeric;

/// A table of rows with angles and rows between them.
pub(super) struct Merged {
    with: Vec<usize>,
    between: Vec<usize>,
    /// Rows with angles, from where all that is held is known.
    pub rows: Vec<usize>,
    /// A sentence about it.
    pub note: String,
}

impl Merged {
    /// `None` if the table has one clock. The columns are the time, the angles and velocities, and what holds until its next
    /// value: commands or torques, and further measured columns. A row with only some of the angles is on no clock.
    pub fn of(
        time: &Numeric,
        states: &[Numeric],
        held: &[Numeric],
        driven_by: Quantity,
    ) -> Option<Self> {
        let is_whole = |column: &Numeric| column.gap.is_none() && column.fault.is_none();
        if !is_whole(time) || states.iter().chain(held).all(is_whole) {
            return None;
        }
        let (with, between) = apart(states, time.values.len())?;
        let held = held
            .iter()
            .filter(|column| is_held(column, &with, &between));
        let held: Vec<&Numeric> = held.collect();
        let first = |column: &&Numeric| column.values.iter().position(|value| !value.is_nan());
        let known = held.iter().filter_map(first).max()?;
        // A single angle that is missing is no clock.
        let is_apart = |column: &&Numeric| with.iter().any(|row| column.is_empty_at(*row));
        if !held.iter().any(is_apart) && between.len() <= with.len() {
            return None;
        }
        let rows = with[with.partition_point(|row| *row < known)..].to_vec();
        let longest_s = |column: &&Numeric| {
            let since = |(row, held): (&usize, usize)| time.values[*row] - time.values[held];
            let holds = rows.iter().zip(last_rows(column, &rows)).map(since);
            holds.fold(0.0, f64::max)
        };
        let longest_s = held.iter().map(longest_s).fold(0.0, f64::max);
        let note = format!(
            "columns of `{}` are on another clock than the angles: each value holds until the next, for {longest_s:.3} s at \
             most",
            driven_by.key()
        );
        Some(Self {
            with,
            between,
            rows,
            note,
        })
    }

    /// A column at the rows with angles; one that cannot be read, or is on no clock, with its fault alone.
    pub fn column(&self, column: Numeric) -> Numeric {
        let is_state = self.with.iter().all(|row| !column.is_empty_at(*row));
        if column.fault.is_some() || !is_state && !is_held(&column, &self.with, &self.between) {
            return Numeric {
                values: Vec::new(),
                ..column.without_gaps()
            };
        }
        let values = last_rows(&column, &self.rows).map(|row| column.values[row]);
        Numeric {
            values: values.collect(),
            ..Numeric::default()
        }
    }
}

/// The rows in which all states have values, and those in which none has; `None` if some have some.
fn apart(states: &[Numeric], rows: usize) -> Option<(Vec<usize>, Vec<usize>)> {
    if states.iter().any(|column| column.fault.is_some()) {
        return None;
    }
    let is_between = |row: &usize| states.iter().all(|column| column.is_empty_at(*row));
    let is_whole = |row: &usize| !states.iter().any(|column| column.is_empty_at(*row));
    let (between, with): (Vec<usize>, Vec<usize>) = (0..rows).partition(is_between);
    with.iter().all(is_whole).then_some((with, between))
}

/// Whether a column has a value in every row with angles, or values between these rows, or at less than half of them: a
/// clock of its own, and not a reading that is missing.
fn is_held(column: &Numeric, with: &[usize], between: &[usize]) -> bool {
    let count = |rows: &[usize]| {
        let rows = rows.iter();
        rows.filter(|row| !column.is_empty_at(**row)).count()
    };
    let (at, between) = (count(with), count(between));
    let is_slow = between > 0 || 2 * at < with.len();
    column.fault.is_none() && (at == with.len() || is_slow && at + between > 1)
}

/// For each of these rows, in ascending order, the last row up to it in which a column has a value, which there is.
fn last_rows(column: &Numeric, rows: &[usize]) -> impl Iterator<Item = usize> {
    let (mut next, mut last) = (0, 0);
    rows.iter().map(move |row| {
        while next <= *row {
            if !column.is_empty_at(next) {
                last = next;
            }
            next += 1;
        }
        last
    })
}
