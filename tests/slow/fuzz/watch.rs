//! Watches for inputs whose reading never ends, which the reading thread cannot notice.

use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use super::tell;

/// The time after which an input is given up, on a busy machine.
const MOST: Duration = Duration::from_secs(60);

/// The input that a target is reading, and since when.
pub struct Watch(Arc<Mutex<(u64, Instant)>>);

impl Watch {
    /// Ends the process if the target reads one input for too long.
    pub fn of(target: &'static str) -> Self {
        let input = Arc::new(Mutex::new((0, Instant::now())));
        let watched = Arc::downgrade(&input);
        thread::spawn(move || {
            while let Some(input) = watched.upgrade() {
                let (number, since) = *input.lock().unwrap();
                if since.elapsed() > MOST {
                    tell(&format!("{target} {number} does not end"));
                    std::process::abort();
                }
                drop(input);
                thread::sleep(Duration::from_millis(100));
            }
        });
        Self(input)
    }

    pub fn begin(&self, number: u64) {
        *self.0.lock().unwrap() = (number, Instant::now());
    }
}
