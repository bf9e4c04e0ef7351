//! A part of the logs, spread over all of them, where the whole would say the same in many times the time.

use super::problem::Problem;
use crate::sim::Window;

/// Fewest windows that are kept: a rig that is logged fast has many rows in each.
const WINDOWS: usize = 24;

impl Problem<'_> {
    /// The same problem over windows with no more than this many rows of the logs in all.
    #[must_use]
    pub(super) fn spread_over(&self, rows: usize) -> Self {
        let windows = &self.shooting.windows;
        let kept = spread(windows, rows);
        match kept.len() < windows.len() {
            true => self.over(self.shooting.over(kept)),
            false => self.clone(),
        }
    }
}

fn spread(windows: &[Window], rows: usize) -> Vec<Window> {
    let all = windows.len();
    let of_all: usize = windows.iter().map(Window::rows).sum();
    let kept = (all * rows / of_all.max(1)).max(WINDOWS).min(all);
    (0..kept).map(|k| windows[k * all / kept]).collect()
}

#[cfg(test)]
mod tests {
    use super::{WINDOWS, spread};
    use crate::sim::Window;

    #[test]
    fn windows_are_kept_from_all_logs_evenly() {
        let window = |k: usize| Window {
            log: k / 50,
            first: 100 * (k % 50),
            last: 100 * (k % 50) + 99,
        };
        let windows: Vec<Window> = (0..100).map(window).collect();
        let kept = spread(&windows, 4000);
        assert_eq!(kept.iter().map(Window::rows).sum::<usize>(), 4000);
        assert_eq!(kept.iter().filter(|kept| kept.log == 0).count(), 20);
        assert_eq!(spread(&windows, 10_000), windows);
        assert_eq!(spread(&windows, 10).len(), WINDOWS);
        assert_eq!(spread(&windows[..5], 10).len(), 5);
    }
}
