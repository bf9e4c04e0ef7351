//! What can be wrong with a log file, worded so that its owner can fix it.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::limits::{LOG_TIME, READING};

/// Where in a file something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Line of a text, from 1 as an editor counts.
    Line(usize),
    /// Row of a table without lines, from 1.
    Row(usize),
    /// The names of a file's arrays.
    Arrays,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Row(row) => write!(f, "row {row}"),
            Self::Arrays => f.write_str("arrays"),
        }
    }
}

/// Why a log could not be read.
///
/// Each has the file, and the place in it of the header, row or cell. Each message is complete in itself: file, line
/// (from 1, as an editor counts), column name, what is wrong and what to do. None has a source to print with it.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file cannot be opened or read.
    #[error("{path}: cannot be read: {why}; check the path and its permissions")]
    Open {
        path: PathBuf,
        /// What the operating system says.
        why: io::Error,
    },
    /// The bytes are not UTF-8 text.
    #[error("{path}, line {line}: not UTF-8 text; save the log as CSV in UTF-8")]
    NotUtf8 {
        path: PathBuf,
        /// Line of the first byte that is not text.
        line: usize,
    },
    /// The file is not of the form that its beginning suggests.
    #[error("{path}: {fault}")]
    Form {
        path: PathBuf,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// There is nothing in the file.
    #[error("{path}: is empty; a log begins with a header such as time,q1,qd1,tau1")]
    Empty { path: PathBuf },
    /// The first line holds numbers.
    #[error(
        "{path}, {place}: has numbers where the header should be; put column names such as time,q1,qd1,tau1 above them, \
         or give the number of every column, from 1, under [columns] in the model file: time = 1, q = [2], qd = [3], \
         tau = [4] (qd = [] takes velocities from the angles)"
    )]
    NoHeader {
        path: PathBuf,
        /// Where the header was expected.
        place: Place,
    },
    /// There are too few rows below the header.
    #[error("{path}: has {rows} row(s) of numbers below its header; a log needs at least two")]
    TooFewRows {
        path: PathBuf,
        /// How many there are: none or one.
        rows: usize,
    },
    /// A column that the model needs is not in the header.
    #[error("{path}, {place}: there is no column {column:?}; {remedy}")]
    MissingColumn {
        path: PathBuf,
        place: Place,
        /// The name looked for.
        column: String,
        /// The nearest name, or all names, and how to map them.
        remedy: String,
    },
    /// A column that the model needs is in the header more than once.
    #[error("{path}, {place}: column {column:?} occurs more than once; rename or delete one")]
    DuplicateColumn {
        path: PathBuf,
        place: Place,
        column: String,
    },
    /// The log and the model have different numbers of joints.
    #[error(
        "{path}, {place}: the header has {header} joint(s) (q1 to q{header}) but the model has \
         {model}; use the model of this rig, or choose columns under [columns] in the model file"
    )]
    JointCount {
        path: PathBuf,
        place: Place,
        /// Joints in the header.
        header: usize,
        /// Joints of the model.
        model: usize,
    },
    /// The model file maps another number of columns than the model has joints.
    #[error(
        "[columns] in the model file names {named} column(s) for `{list}` but the model has {joints} \
         joint(s); name one for each (reading {path})"
    )]
    Mapping {
        /// The log that was to be read.
        path: PathBuf,
        /// `q`, `qd` or `tau`.
        list: &'static str,
        /// Columns named.
        named: usize,
        /// Joints of the model.
        joints: usize,
    },
    /// A row has more or fewer cells than the header.
    #[error(
        "{path}, {place}: has {found} cell(s) where the header has {expected}; give every row one \
         cell for each column (with decimal points, not commas)"
    )]
    Width {
        path: PathBuf,
        place: Place,
        /// Cells in the row.
        found: usize,
        /// Cells in the header.
        expected: usize,
    },
    /// A cell does not hold a usable number.
    #[error("{path}, {place}, column {column:?}: {fault}")]
    Cell {
        path: PathBuf,
        place: Place,
        /// The cell's column, as the header names it.
        column: String,
        /// What is wrong with it.
        fault: CellFault,
    },
}

impl LogError {
    /// A file that cannot be opened or read.
    pub fn open(path: &Path) -> impl Fn(io::Error) -> Self {
        move |why| Self::Open {
            path: path.to_owned(),
            why,
        }
    }

    /// A file that is not of the form that its beginning suggests: what is wrong, and what to do.
    pub fn form(path: &Path, fault: impl Into<String>) -> Self {
        Self::Form {
            path: path.to_owned(),
            fault: fault.into(),
        }
    }
}

/// What is wrong with one cell.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CellFault {
    /// Nothing in it.
    #[error("is empty; write a number or delete the row")]
    Empty,
    /// Text that is not a number; long text is cut.
    #[error("{0:?} is not a number; write a decimal number such as 0.25")]
    NotANumber(String),
    /// NaN, infinity, or a number too large to hold.
    #[error("{0:?} is not a finite number; delete the row, or cut the log there")]
    NotFinite(String),
    /// More than any sensor reads.
    #[error(
        "{0:e} is beyond {READING:e}, more than any sensor reads; delete the row, or cut the log there"
    )]
    TooLarge(f64),
    /// A time beyond any clock that counts in seconds.
    #[error(
        "{0:e} s is beyond {LOG_TIME:e} s; name the unit of the clock in the model file, such as \
         [columns] time = {{ column = \"time\", unit = \"ns\" }}"
    )]
    TooLate(f64),
    /// A pause of very many steps.
    #[error(
        "time jumps by {pause_s:.1e} s from {previous_place}, with a row every {step_s:.1e} s elsewhere; cut the file \
         there into one log per run"
    )]
    Pause {
        pause_s: f64,
        /// The median step \[s\].
        step_s: f64,
        /// Where the row before is.
        previous_place: Place,
    },
    /// A time that is not later than the one before.
    #[error(
        "time {time} s does not come after {previous} s in {previous_place}; sort the rows, drop repeated ones, or cut \
         the file into one log per run"
    )]
    NotLater {
        /// This row's time \[s\].
        time: f64,
        /// The previous row's time \[s\].
        previous: f64,
        /// Where the previous row is.
        previous_place: Place,
    },
}

impl CellFault {
    /// Whether a cell has no value: a table of several clocks has such cells.
    pub(super) fn is_gap(&self) -> bool {
        match self {
            Self::Empty => true,
            Self::NotFinite(text) => text.parse::<f64>().is_ok_and(f64::is_nan),
            _ => false,
        }
    }

    /// What is wrong with a number that is not a valid reading.
    pub fn of_number(number: f64) -> Self {
        match number.is_finite() {
            true => Self::TooLarge(number),
            false => Self::NotFinite(number.to_string()),
        }
    }
}
