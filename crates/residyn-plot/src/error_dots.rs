//! The figure of how far predictions are off on a rig of many joints: a row per joint, all on one axis.

use super::axes::{Axis, FOOT, Frame, Quantity};
use super::canvas::{Anchor, Area, Canvas, TO_BASELINE, marker, rule, text, text_width};
use super::error_bars::{ErrorRow, readable, written};
use super::legend::{Entry, Sample, begin};
use super::scale::{Range, Scale};
use super::style::{GRID, MARGIN, SPINE, TEXT_SIZE, WIDTH};
use super::{JointKind, PlotError};

const ROW_PX: f64 = 21.0;
const RADIUS_PX: f64 = 5.0;
/// Room for the numbers at the right, and at most for the names at the left.
const NUMBERS_PX: f64 = 190.0;
const NAMES_PX: f64 = 260.0;

/// Draws one row per joint, in the order of the rows, with a dot per model: the models' names are in the key, the numbers of the
/// first two stand at the end.
///
/// All share a logarithmic axis, since errors of joints differ by factors. A row has no dot for an error that is zero or not
/// finite; the number says so.
pub fn error_dots(rows: &[ErrorRow], title: &str) -> Result<String, PlotError> {
    let (mut canvas, top) = begin(title, rows, entries)?;
    let names = rows.iter().map(|row| text_width(&row.of, TEXT_SIZE));
    let left = names.fold(0.0, f64::max).min(NAMES_PX) + 10.0;
    let area = Area {
        x: MARGIN + left,
        y: top + 8.0,
        width: WIDTH - 2.0 * MARGIN - left - NUMBERS_PX,
        height: ROW_PX * rows.len() as f64,
    };
    let errors = rows.iter().flat_map(|row| &row.bars).map(|bar| bar.error);
    let shown = errors.filter(|error| has_dot(*error));
    let range = Range::spanning(shown).unwrap_or(Range { lo: 1.0, hi: 1.0 });
    let (factor, unit) = readable(range.hi, unit(rows));
    let range = Range {
        lo: 0.8 * factor * range.lo,
        hi: 1.25 * factor * range.hi,
    };
    let quantity = Quantity::new("position error, RMS", unit);
    let x = Axis::horizontal_on(Scale::Logarithmic, range, area.width, &quantity);
    let y = Axis::unmarked(Range { lo: 0.0, hi: 1.0 });
    let frame = Frame { area, x: &x, y: &y };
    canvas.add(frame.grid());
    canvas.add(frame.x_labels());
    for (row, k) in rows.iter().zip(0..) {
        draw_row(
            &mut canvas,
            &frame,
            row,
            factor,
            area.y + ROW_PX * (f64::from(k) + 0.5),
        );
    }
    Ok(canvas.finish(area.bottom() + FOOT + 6.0))
}

fn entries(rows: &[ErrorRow]) -> Vec<Entry> {
    let bars = rows.iter().flat_map(|row| &row.bars);
    bars.map(|bar| Entry::new(Sample::Dot(bar.role.colour()), &bar.label))
        .collect()
}

fn has_dot(error: f64) -> bool {
    error.is_finite() && error > 0.0
}

/// Of joints that all turn or all slide, or both.
fn unit(rows: &[ErrorRow]) -> &'static str {
    let has = |kind: JointKind| rows.iter().any(|row| row.kind == kind);
    match (has(JointKind::Revolute), has(JointKind::Prismatic)) {
        (true, true) => "rad or m",
        (_, true) => JointKind::Prismatic.position_unit(),
        _ => JointKind::Revolute.position_unit(),
    }
}

/// Draws a row around the height `y`.
fn draw_row(canvas: &mut Canvas, frame: &Frame, row: &ErrorRow, factor: f64, y: f64) {
    let area = frame.area;
    let at = |error: f64| area.x + frame.x_px(factor * error);
    canvas.add(rule((area.x, y), (area.right(), y), GRID));
    let dots = row.bars.iter().filter(|bar| has_dot(bar.error));
    let span = Range::spanning(dots.clone().map(|bar| at(bar.error)));
    if let Some(Range { lo, hi }) = span {
        canvas.add(rule((lo, y), (hi, y), SPINE));
    }
    // The first model lies on top.
    for bar in dots.rev() {
        canvas.add(marker((at(bar.error), y), RADIUS_PX, bar.role.colour()));
    }
    let words = |content: &str, x: f64, anchor: Anchor| {
        text(content, x, y + TO_BASELINE, anchor, TEXT_SIZE)
    };
    canvas.add(words(&row.of, area.x - 10.0, Anchor::End));
    let numbers = row
        .bars
        .iter()
        .take(2)
        .map(|bar| written(bar.error, row.kind));
    let numbers = numbers.collect::<Vec<_>>().join(" \u{2192} ");
    canvas.add(words(&numbers, area.right() + 12.0, Anchor::Start));
}

#[cfg(test)]
mod tests {
    use super::error_dots;
    use crate::{Bar, ErrorRow, JointKind, Role};

    fn row(of: &str, errors: [f64; 2]) -> ErrorRow {
        let bar = |(role, label, error): (Role, &str, f64)| Bar {
            role,
            label: label.to_owned(),
            error,
        };
        let [before, after] = errors;
        ErrorRow {
            of: of.to_owned(),
            kind: JointKind::Revolute,
            horizon_s: 0.5,
            bars: [
                (Role::Before, "before", before),
                (Role::After, "after", after),
            ]
            .map(bar)
            .into(),
        }
    }

    /// The number of dots, and the height of the figure.
    fn size(figure: &str) -> (usize, f64) {
        let height = figure.split("height=\"").nth(1).unwrap();
        let height = height.split('"').next().unwrap().parse().unwrap();
        (figure.matches("<circle").count(), height)
    }

    #[test]
    fn many_joints_fit_a_screen() {
        let rows: Vec<ErrorRow> = (1..=12)
            .map(|k| row(&format!("{k} FL_hip"), [0.0213, 0.0034]))
            .collect();
        let figure = error_dots(&rows, "errors").unwrap();
        let (dots, height) = size(&figure);
        // Two more are in the key.
        assert!(dots == 26 && height < 420.0, "{dots} {height}");
        assert_eq!(figure.matches("21.3 mrad \u{2192} 3.40 mrad").count(), 12);
        assert_eq!(figure.matches("before").count(), 1);
    }

    #[test]
    fn an_error_without_a_place_on_the_axis_is_written_out() {
        let rows = [row("a", [f64::NAN, 0.0]), row("b", [f64::INFINITY, 0.02])];
        let figure = error_dots(&rows, "lost").unwrap();
        assert_eq!(size(&figure).0, 1 + 2);
        assert!(figure.contains("diverged \u{2192} 0 mrad") && !figure.contains("NaN"));
        assert!(error_dots(&rows[..1], "none").is_ok());
    }
}
