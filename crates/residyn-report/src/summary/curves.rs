//! Small curves of block characters.

use super::paragraph;
use crate::plot_data::SeriesEntry;
use crate::schema::Report;
use crate::wording::small;

/// From nothing to the largest value.
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Width of a curve \[characters\].
const COLUMNS: usize = 60;

/// The errors of the fitted declared model and of the model with effects along a part of a test log, for the joint on
/// which the former errs most relative to the joint's motion. Empty if the report shows no curves.
pub fn curves(report: &Report) -> Vec<String> {
    let Some(segment) = report.plots.segments.first() else {
        return Vec::new();
    };
    let joints = segment.joints.iter().map(Errors::of);
    let Some(errors) = joints.max_by(|a, b| a.share.total_cmp(&b.share)) else {
        return Vec::new();
    };
    let top = largest(&errors.before).max(largest(&errors.after));
    if !(top > 0.0) {
        return Vec::new();
    }
    let [start, end] =
        [segment.time.first(), segment.time.last()].map(|t| t.copied().unwrap_or(0.0));
    let title = format!(
        "error up to {} of {}, {start:.1} to {end:.1} s of {}:",
        small(top),
        errors.quantity,
        segment.log
    );
    let mut lines = paragraph("  ", &title);
    lines.push(format!("  {:<14}{}", "fitted", curve(&errors.before, top)));
    lines.push(format!(
        "  {:<14}{}",
        "with effects",
        curve(&errors.after, top)
    ));
    lines
}

/// Distances of predictions from the measurement, where there are any.
struct Errors<'r> {
    quantity: &'r str,
    before: Vec<Option<f64>>,
    after: Vec<Option<f64>>,
    /// Largest error before over the largest value measured.
    share: f64,
}

impl<'r> Errors<'r> {
    fn of(tracks: &'r SeriesEntry) -> Self {
        let error = |predicted: &[Option<f64>]| -> Vec<Option<f64>> {
            let both = tracks.measured.iter().zip(predicted);
            both.map(|(m, p)| Some(((*m)? - (*p)?).abs())).collect()
        };
        let before = error(&tracks.before);
        Self {
            quantity: &tracks.quantity,
            share: largest(&before) / largest(&tracks.measured).max(f64::MIN_POSITIVE),
            after: error(&tracks.after),
            before,
        }
    }
}

fn largest(values: &[Option<f64>]) -> f64 {
    let values = values.iter().flatten();
    values.map(|value| value.abs()).fold(0.0, f64::max)
}

/// The largest value of each column; a space where there is none.
fn curve(values: &[Option<f64>], top: f64) -> String {
    let columns = COLUMNS.min(values.len());
    let column = |k: usize| {
        let part = &values[k * values.len() / columns..(k + 1) * values.len() / columns];
        match part.iter().any(Option::is_some) {
            true => level(largest(part) / top),
            false => ' ',
        }
    };
    (0..columns).map(column).collect()
}

fn level(share: f64) -> char {
    let highest = LEVELS.len() - 1;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to 7
    LEVELS[(share.clamp(0.0, 1.0) * highest as f64).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::{COLUMNS, curve};

    #[test]
    fn a_curve_has_the_largest_value_of_each_column() {
        let values = [Some(0.0), Some(7.0), None, Some(3.5)];
        assert_eq!(curve(&values, 7.0), "▁█ ▅");
        let ramp: Vec<Option<f64>> = (0..601).map(|k| Some(f64::from(k))).collect();
        let drawn = curve(&ramp, 600.0);
        assert_eq!(drawn.chars().count(), COLUMNS);
        assert!(drawn.starts_with('▁') && drawn.ends_with('█'));
        let mut levels: Vec<char> = drawn.chars().collect();
        levels.dedup();
        assert_eq!(levels.len(), 8);
    }
}
