//! The lag of one channel behind another.

use std::ops::RangeInclusive;

use super::projection::{dot, free_of, orthonormal};

/// The lag of one series behind another, and their correlation at that lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lag {
    /// In samples of the two series, with a fraction; positive when the effect trails the cause.
    pub samples: f64,
    /// Correlation at that lag, -1 to 1, after the part that the basis explains is removed from both.
    pub correlation: f64,
    /// Whether the correlation still rises at the end of the lags searched. The true lag is then
    /// longer, or there is none.
    pub at_edge: bool,
}

/// Finds the lag, among `lags` in samples, at which `effect` follows `cause` best; at negative lags the effect comes
/// first. The lags have to include 0.
///
/// All series are sampled alike and equally long. At each lag, the part that the `basis` explains (a constant at least)
/// is removed from both series before they are correlated; the peak is refined by a parabola through its neighbours.
/// `None` for series that are too short, or that the basis explains entirely.
pub(super) fn lag(
    cause: &[f64],
    effect: &[f64],
    basis: &[Vec<f64>],
    lags: RangeInclusive<isize>,
) -> Option<Lag> {
    let (lead, trail) = (lags.start().unsigned_abs(), lags.end().unsigned_abs());
    // Twice the rows that the lags and the basis use up, for a meaningful correlation.
    if cause.len() < 2 * (lead + trail) + 4 * basis.len() + 8 {
        return None;
    }
    // The rows that have a partner at every lag, so that all lags are judged on the same rows.
    let inner = trail..cause.len() - lead;
    let basis = orthonormal(basis.iter().map(|column| column[inner.clone()].to_vec()));
    let effect = free_of(&basis, &effect[inner.clone()])?;
    let at = |lag: isize| {
        let start = trail.wrapping_add_signed(-lag);
        correlation(&basis, &effect, &cause[start..start + inner.len()])
    };
    let all: Vec<f64> = lags.clone().map(at).collect();
    let peak = (0..all.len()).max_by(|&a, &b| all[a].total_cmp(&all[b]))?;
    let at_edge = peak == 0 || peak + 1 == all.len();
    let fraction = if at_edge {
        0.0
    } else {
        parabola_peak([all[peak - 1], all[peak], all[peak + 1]])
    };
    Some(Lag {
        samples: peak as f64 + *lags.start() as f64 + fraction,
        correlation: all[peak],
        at_edge,
    })
}

/// Position of the vertex of a parabola through three equally spaced values, relative to the middle one (-0.5
/// to 0.5, as the middle value is the largest).
fn parabola_peak([before, middle, after]: [f64; 3]) -> f64 {
    let bend = before - 2.0 * middle + after;
    if bend < 0.0 {
        0.5 * (before - after) / bend
    } else {
        0.0
    }
}

/// Correlation of a series with an `effect` that is already free of the basis and of unit length. The series itself
/// need not be freed: only the length of the part that would remain is needed.
fn correlation(basis: &[Vec<f64>], effect: &[f64], series: &[f64]) -> f64 {
    let whole = dot(series, series);
    let explained: f64 = basis.iter().map(|column| dot(column, series).powi(2)).sum();
    let rest = whole - explained;
    if rest <= 1e-9 * whole {
        return 0.0;
    }
    dot(effect, series) / rest.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(t: f64) -> f64 {
        (0.05 * t).sin() + 0.6 * (0.131 * t + 1.0).cos() + 0.3 * (0.37 * t).sin()
    }

    fn series(count: usize, shift: f64) -> Vec<f64> {
        (0..count).map(|i| wave(i as f64 - shift)).collect()
    }

    #[test]
    fn whole_and_fractional_lags_are_found_with_their_sign() {
        let ones = [vec![1.0; 1000]];
        for shift in [-7.0, -0.4, 0.0, 0.5, 3.3] {
            let found = lag(&series(1000, 0.0), &series(1000, shift), &ones, -12..=12).unwrap();
            assert!((found.samples - shift).abs() < 0.02, "{shift}: {found:?}");
            assert!(found.correlation > 0.99 && !found.at_edge);
        }
    }

    #[test]
    fn a_lag_beyond_the_reach_is_marked() {
        let ones = [vec![1.0; 1000]];
        let found = lag(&series(1000, 0.0), &series(1000, 9.0), &ones, -4..=4).unwrap();
        assert!(found.at_edge);
    }

    #[test]
    fn what_the_basis_explains_does_not_count() {
        // The effect is the cause two samples late plus twenty times a disturbance in the basis.
        let disturbance: Vec<f64> = (0..1000).map(|i| (0.02 * i as f64).cos()).collect();
        let rows = series(1000, 2.0).into_iter().zip(&disturbance);
        let effect: Vec<f64> = rows.map(|(e, d)| e + 20.0 * d).collect();
        let basis = [vec![1.0; 1000], disturbance];
        let found = lag(&series(1000, 0.0), &effect, &basis, -2..=12).unwrap();
        assert!((found.samples - 2.0).abs() < 0.05, "{found:?}");
        assert!(found.correlation > 0.99, "{found:?}");
    }

    #[test]
    fn constant_and_short_series_have_no_lag() {
        let ones = [vec![1.0; 1000]];
        assert_eq!(lag(&series(1000, 0.0), &[3.0; 1000], &ones, -12..=12), None);
        assert_eq!(lag(&[1.0, 2.0], &[1.0, 2.0], &[vec![1.0; 2]], -2..=2), None);
    }
}
