use thiserror::Error;

/// Why a machine cannot be watched, or rows cannot be read. Rows count from 1 over all that were given.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MonitorError {
    #[error("{setting} is {value}; {wanted}")]
    Setting {
        setting: &'static str,
        value: f64,
        wanted: &'static str,
    },
    #[error(
        "the effect {effect} of {model} has states of its own, which a monitor does not follow; monitor the model without it"
    )]
    InternalStates { model: String, effect: String },
    #[error(
        "{model} has no free parameter, so nothing can be named; free what may wear in the model file"
    )]
    NothingFree { model: String },
    #[error("{found} column(s) of {what} for {wanted}; give one for each")]
    Columns {
        what: &'static str,
        found: usize,
        wanted: String,
    },
    #[error(
        "row {row}: column \"{column}\" ends at row {rows} of the batch; give every column as many rows as the time"
    )]
    Length {
        row: usize,
        column: String,
        rows: usize,
    },
    #[error(
        "row {row}, column \"{column}\": {value} is not a number; leave the row out, the gap is counted"
    )]
    NotFinite {
        row: usize,
        column: String,
        value: f64,
    },
    #[error(
        "row {row}, column \"time\": {time} s does not come after {before} s; send rows in the order of their times"
    )]
    Order { row: usize, time: f64, before: f64 },
    #[error("up to {time} s: {fault}")]
    Healthy { time: f64, fault: String },
}
