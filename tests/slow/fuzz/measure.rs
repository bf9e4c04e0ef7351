//! The time and memory that a reader takes for one input, and whether they are too much.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use cpu_time::ThreadTime;

/// The time that an input of up to a megabyte may take, and each megabyte of a longer one \[s\].
const MOST_S: f64 = 1.0;
/// The memory that an input may take, plus `MOST_RATIO` for each of its bytes \[bytes\].
const MOST_BYTES: u64 = 64 << 20;
const MOST_RATIO: u64 = 20;

/// The cost of reading an input: time of the thread, and its peak memory.
#[derive(Clone, Copy, Default)]
pub struct Cost {
    pub seconds: f64,
    pub bytes: u64,
    /// Whether the input was read, not refused.
    pub accepted: bool,
}

/// Reads an input of `length` bytes.
///
/// # Errors
/// A panic, or a cost that is too large for the input.
pub fn cost(length: usize, read: impl FnOnce() -> bool) -> Result<Cost, String> {
    let mut result = Ok(false);
    let begun = ThreadTime::now();
    let memory = allocation_counter::measure(|| result = catch_unwind(AssertUnwindSafe(read)));
    let cost = Cost {
        seconds: begun.elapsed().as_secs_f64(),
        bytes: memory.bytes_max,
        accepted: result.map_err(|panic| format!("panics: {}", message(&*panic)))?,
    };
    let megabytes = length as f64 / f64::from(1 << 20);
    if cost.seconds > MOST_S * megabytes.max(1.0) {
        return Err(format!("takes {:.1} s", cost.seconds));
    }
    if cost.bytes > MOST_BYTES + MOST_RATIO * length as u64 {
        return Err(format!("takes {} MB", cost.bytes >> 20));
    }
    Ok(cost)
}

fn message(panic: &dyn Any) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or(panic.downcast_ref::<&str>().copied())
        .unwrap_or("of no text")
}
