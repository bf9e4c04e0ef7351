//! Limits on what a user gives: depths, sizes and counts. An error about a limit names its number.

/// Nested parentheses, calls, signs and powers in a formula.
pub const FORMULA_NESTING: usize = 200;
/// Chained operations in a formula, each on the result of the one before, such as the terms of a sum.
pub const FORMULA_CHAIN: usize = 1000;
/// Numbers, names and operations in all formulas of a model.
pub const MODEL_TERMS: usize = 20_000;
/// Parameters, intermediates or effects of a model.
pub const MODEL_NAMES: usize = 1000;
/// Free parameters of a model that closing the loop fits at once: the time of a fit grows with the cube of their number.
pub const FITTED_PARAMETERS: usize = 500;
/// Joints of a model: enough for a humanoid with hands, and a limit that catches slips such as `joints = 100`.
pub const JOINTS: usize = 40;
/// Nested elements of a robot description, and joints in series.
pub const XML_DEPTH: usize = 200;
/// Attributes of one element of a robot description, and namespaces in all of it.
pub const XML_ATTRIBUTES: usize = 200;
/// Elements in a default class of a robot description.
pub const XML_DEFAULTS: usize = 200;

/// A text that people write: a model, an effect, a recipe, a robot description \[bytes\].
pub const TEXT_BYTES: u64 = 4 << 20;
/// Values, keys, tables and lines of a TOML text: each takes hundreds of bytes when read.
pub const TOML_PARTS: usize = 150_000;
/// Nested arrays and tables in such a text; the limit of its parser.
pub const TOML_NESTING: usize = 80;
/// A file that the program wrote itself: weights, a description of a model, a report \[bytes\].
pub const SAVED_BYTES: u64 = 1 << 30;
/// A decoded message of a recording \[bytes\].
pub const MESSAGE_BYTES: usize = 1 << 20;
/// A message of a recording, or a part of a recording that is packed as a whole \[bytes\].
pub const RECORD_BYTES: usize = 1 << 28;
/// Unpacked size that any packed file may have, however small it is \[bytes\].
pub const UNPACKED_BYTES: u64 = 16 << 20;
/// Unpacked bytes beyond that, for each byte of the packed file.
pub const UNPACKED_RATIO: u64 = 20;

/// The largest reading of a log, in its unit: its fourth power is far below the largest representable number.
pub const READING: f64 = 1e30;
/// The largest absolute time of a log \[s\]: 30 000 years; a clock in milliseconds since 1970 is beyond it.
pub const LOG_TIME: f64 = 1e12;
/// Time from a log's first row to its last, in median steps: at most this number,
pub const LOG_STEPS: f64 = 2e7;
/// or this multiple of its rows, whichever is more.
pub const PAUSED_STEPS: f64 = 10.0;
/// Joints of a log that is read without a model.
pub const LOG_JOINTS: usize = 100;
/// Columns of a log.
pub const LOG_COLUMNS: usize = 4096;
/// Rows of a log that is simulated, or in a format that, unlike text, may take less than a byte per row.
pub const LOG_ROWS: usize = 10_000_000;
/// Duration of a log of a simulated rig, or of a bench \[s\].
pub const SIMULATED_S: f64 = 1e5;
/// Steps of all trajectories sampled for training.
pub const SAMPLED_STEPS: usize = 10_000_000;
/// Neurons of a layer.
pub const LAYER_WIDTH: usize = 4096;
/// Weights and biases of a network.
pub const NETWORK_NUMBERS: usize = 20_000_000;
/// Substeps of an integrator's step.
pub const SUBSTEPS: u32 = 1000;
/// Steps over which an exported model remembers commands.
pub const DELAY_STEPS: usize = 10_000;
/// Sines that excite a plant.
pub const TONES: usize = 1000;
/// Candidates of a planner.
pub const CANDIDATES: usize = 100_000;
/// Steps that a planner looks ahead.
pub const HORIZON: usize = 2000;
/// Iterations of a planner.
pub const ITERATIONS: usize = 10_000;
/// Training epochs.
pub const EPOCHS: usize = 100_000_000;
/// Logs, models, episodes or simulations that one command makes.
pub const RUNS: usize = 100_000;
/// Cells of a bench.
pub const CELLS: usize = 20_000;

/// How many median steps a log with `rows` rows may last.
pub fn log_steps(rows: usize) -> f64 {
    LOG_STEPS.max(PAUSED_STEPS * rows as f64)
}

/// Whether a sensor can read this value: false if it is not finite.
pub fn is_reading(value: f64) -> bool {
    value.abs() <= READING
}

/// Refuse numbers, called `name`, if one of them exceeds what a sensor reads.
///
/// # Errors
/// The number, and the limit.
pub fn check_readings(name: &str, numbers: impl IntoIterator<Item = f64>) -> Result<(), String> {
    let mut numbers = numbers.into_iter();
    match numbers.find(|number| !is_reading(*number)) {
        Some(number) => Err(format!(
            "`{name}` has {number:e}; only numbers up to {READING:e} are accepted"
        )),
        None => Ok(()),
    }
}

/// The message for a file that holds more than that.
pub fn too_large() -> String {
    format!(
        "unpacked, it holds more than {} MB and {UNPACKED_RATIO} times its size; unpack it first",
        UNPACKED_BYTES >> 20
    )
}

/// Size that a file of `packed` bytes may have when unpacked \[bytes\].
pub fn unpacked_bytes(packed: u64) -> u64 {
    UNPACKED_BYTES.saturating_add(UNPACKED_RATIO.saturating_mul(packed))
}
