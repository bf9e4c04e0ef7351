//! What is taken at most of what a user gives: depths, sizes and counts. An error about one of them names its number.

/// Parentheses, calls, signs and powers of a formula within each other.
pub const FORMULA_NESTING: usize = 200;
/// Operations of a formula in a row, each on the result of the one before, such as the terms of a sum.
pub const FORMULA_CHAIN: usize = 1000;
/// Numbers, names and operations in all formulas of a model.
pub const MODEL_TERMS: usize = 20_000;
/// Parameters of a model, its intermediates, or its effects.
pub const MODEL_NAMES: usize = 1000;
/// Free parameters of a model that closing the loop fits at once: the time of a fit grows with the cube of their number.
pub const FITTED_PARAMETERS: usize = 500;
/// Joints of a model: enough for every serial arm, and a limit that catches slips such as `joints = 100`.
pub const JOINTS: usize = 12;
/// Elements of a robot description within each other, and joints behind each other.
pub const XML_DEPTH: usize = 200;
/// Attributes of an element of a robot description, and names of namespaces of all of it.
pub const XML_ATTRIBUTES: usize = 200;
/// Elements of which one has its defaults in a robot description.
pub const XML_DEFAULTS: usize = 200;

/// A text that people write: a model, an effect, a recipe, a robot description \[bytes\].
pub const TEXT_BYTES: u64 = 4 << 20;
/// Values, keys, tables and lines of a text in TOML: each takes hundreds of bytes when it is read.
pub const TOML_PARTS: usize = 150_000;
/// Arrays and tables of such a text within each other; its parser's own limit.
pub const TOML_NESTING: usize = 80;
/// A file that the program wrote itself: weights, a description of a model, a report \[bytes\].
pub const SAVED_BYTES: u64 = 1 << 30;
/// A message of a recording that is decoded \[bytes\].
pub const MESSAGE_BYTES: usize = 1 << 20;
/// A message of a recording, or a part of one that is packed as a whole \[bytes\].
pub const RECORD_BYTES: usize = 1 << 28;
/// What a packed file may hold, however small it is \[bytes\].
pub const UNPACKED_BYTES: u64 = 16 << 20;
/// What it may hold beyond that, for each of its own bytes.
pub const UNPACKED_RATIO: u64 = 20;

/// The largest reading of a log, in its unit: its fourth power is far from the largest number there is.
pub const READING: f64 = 1e30;
/// The largest time of a log either way \[s\]: 30 000 years, and a clock in milliseconds that counts from 1970 is beyond it.
pub const LOG_TIME: f64 = 1e12;
/// Time from the first row of a log to the last, in its median steps: so many,
pub const LOG_STEPS: f64 = 2e7;
/// or this many times its rows.
pub const PAUSED_STEPS: f64 = 10.0;
/// Joints of a log that is read without a model.
pub const LOG_JOINTS: usize = 100;
/// Columns of a log.
pub const LOG_COLUMNS: usize = 4096;
/// Rows of a log that is simulated or, unlike text, may take less than a byte a row.
pub const LOG_ROWS: usize = 10_000_000;
/// Time that a log of a simulated rig, or one of a bench, lasts \[s\].
pub const SIMULATED_S: f64 = 1e5;
/// Steps of all trajectories that are sampled for a training.
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
/// Epochs of a training.
pub const EPOCHS: usize = 100_000_000;
/// Logs, models, episodes or simulations that one command makes.
pub const RUNS: usize = 100_000;
/// Cells of a bench.
pub const CELLS: usize = 20_000;

/// How many median steps a log of so many rows may last.
pub fn log_steps(rows: usize) -> f64 {
    LOG_STEPS.max(PAUSED_STEPS * rows as f64)
}

/// Whether a sensor can read this: false for what is no finite number.
pub fn is_reading(value: f64) -> bool {
    value.abs() <= READING
}

/// Refuse numbers, called `name`, of which one is more than a sensor reads.
///
/// # Errors
/// The number, and what is taken at most.
pub fn check_readings(name: &str, numbers: impl IntoIterator<Item = f64>) -> Result<(), String> {
    let mut numbers = numbers.into_iter();
    match numbers.find(|number| !is_reading(*number)) {
        Some(number) => Err(format!(
            "`{name}` has {number:e}; numbers up to {READING:e} are taken"
        )),
        None => Ok(()),
    }
}

/// What is wrong with a file that holds more than that.
pub fn too_large() -> String {
    format!(
        "it holds more than {} MB and {UNPACKED_RATIO} times its size when it is unpacked; unpack it first",
        UNPACKED_BYTES >> 20
    )
}

/// What a file of so many bytes may hold when it is unpacked \[bytes\].
pub fn unpacked_bytes(packed: u64) -> u64 {
    UNPACKED_BYTES.saturating_add(UNPACKED_RATIO.saturating_mul(packed))
}
