//! Finds rows by their times.
//!
//! Time stamps are rounded: to decimals when they are written, and to doubles when they are read, which lie a quarter
//! of a microsecond apart in Unix time. Times that are meant to be equal count as equal, so that it does not matter
//! when a clock was set to zero.

/// Times nearer to each other than this are the same \[s\]: above any rounding error, and a twentieth of the step of
/// the fastest rig.
pub const SAME_S: f64 = 1e-6;

/// Steps fit a whole number of times into a length if they fall short of it by at most this share of a step.
pub(super) const ROUNDING: f64 = 1e-3;

/// The first row at or after a time \[s\], in ascending times; the number of times if there is none.
pub fn row_from(time: &[f64], at_s: f64) -> usize {
    time.partition_point(|t| *t < at_s - SAME_S)
}

/// The first row after a time \[s\], in ascending times; the number of times if there is none.
pub fn row_after(time: &[f64], at_s: f64) -> usize {
    time.partition_point(|t| *t <= at_s + SAME_S)
}

#[cfg(test)]
mod tests {
    use super::{row_after, row_from};

    #[test]
    fn a_row_is_found_whenever_the_clock_was_set() {
        for zero in [0.0, -5.0, 3600.0, 1.7e9] {
            let time: Vec<f64> = (0..100).map(|k| zero + 0.01 * f64::from(k)).collect();
            for k in 0..90 {
                let at = time[k] + 0.1;
                assert_eq!(
                    (row_from(&time, at), row_after(&time, at)),
                    (k + 10, k + 11)
                );
            }
            assert_eq!(
                (row_from(&time, zero + 2.0), row_after(&time, zero - 1.0)),
                (100, 0)
            );
        }
    }
}
