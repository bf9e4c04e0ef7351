//! The figure of how far predictions are off, model by model.

use std::f64::consts::TAU;

use svg::node::element::Rectangle;

use super::axes::{Axis, FOOT, Frame, HEAD, Quantity, heading};
use super::canvas::{Anchor, Area, Canvas, TO_BASELINE, curves, px, text};
use super::legend::{Entry, Sample, begin};
use super::scale::{Range, three_digits};
use super::style::{MARGIN, Role, Stroke, TEXT_SIZE, WIDTH};
use super::{JointKind, PlotError};

const BAR_PX: f64 = 15.0;
const BAR_PITCH_PX: f64 = 18.0;
const GROUP_GAP_PX: f64 = 14.0;
/// An axis ends here at the latest: an error beyond a turn only says that the prediction is lost.
const LONGEST_BAR: f64 = TAU;
/// Room for the horizons, left of the bars.
const LEFT_PX: f64 = 92.0;
/// Room for the number at the end of the longest bar.
const NUMBER_PX: f64 = 104.0;
const MIDDLE_PX: f64 = BAR_PX / 2.0 + TO_BASELINE;

/// Position errors of one joint, or of a rig, at one horizon.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorRow {
    /// What is predicted, for people: `Joint 2 (elbow)`, or the name of a rig.
    pub of: String,
    /// How it moves.
    pub kind: JointKind,
    /// How far ahead the models predict.
    pub horizon_s: f64,
    /// One per model, from the top.
    pub bars: Vec<Bar>,
}

/// The error of one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    pub role: Role,
    /// Its name in the key.
    pub label: String,
    pub error: f64,
}

/// Draws one panel per joint or rig, in the order of the rows: for each horizon one bar per model, with its number at
/// the end.
///
/// Each has its own axis: the models are compared, not the joints, and one joint's error can be many times another's.
/// An error that is not finite is written out as diverged.
pub fn error_bars(rows: &[ErrorRow], title: &str) -> Result<String, PlotError> {
    let (mut canvas, mut top) = begin(title, rows, entries)?;
    for panel in rows.chunk_by(|a, b| a.of == b.of) {
        top = draw_panel(&mut canvas, panel, top + HEAD) + FOOT;
    }
    Ok(canvas.finish(top + 6.0))
}

fn entries(rows: &[ErrorRow]) -> Vec<Entry> {
    let bars = rows.iter().flat_map(|row| &row.bars);
    bars.map(|bar| Entry::new(Sample::Bar(bar.role.colour()), &bar.label))
        .collect()
}

/// Draws the rows of one panel from `top` down, and returns where their frame ends.
fn draw_panel(canvas: &mut Canvas, rows: &[ErrorRow], top: f64) -> f64 {
    let Some(ErrorRow { of, kind, .. }) = rows.first() else {
        return top;
    };
    let bars: usize = rows.iter().map(|row| row.bars.len()).sum();
    let area = Area {
        x: MARGIN + LEFT_PX,
        y: top,
        width: WIDTH - 2.0 * MARGIN - LEFT_PX - NUMBER_PX,
        height: GROUP_GAP_PX * (rows.len() + 1) as f64 + BAR_PITCH_PX * bars as f64,
    };
    let errors = rows.iter().flat_map(|row| &row.bars);
    let longest = Range::spanning(errors.map(|bar| bar.error)).map_or(0.0, |range| range.hi);
    let longest = if longest > 0.0 {
        longest.min(LONGEST_BAR)
    } else {
        1.0
    };
    let (factor, unit) = readable(longest, kind.position_unit());
    let x = Axis::horizontal(
        Range {
            lo: 0.0,
            hi: factor * longest,
        },
        area.width,
        &Quantity::new("position error, RMS", unit),
    );
    let y = Axis::unmarked(Range { lo: 0.0, hi: 1.0 });
    let frame = Frame { area, x: &x, y: &y };
    canvas.add(frame.grid());
    canvas.add(frame.x_labels());
    canvas.add(heading(area, of));
    let mut next = top + GROUP_GAP_PX;
    for row in rows {
        next = draw_group(canvas, &frame, row, factor, next) + GROUP_GAP_PX;
    }
    area.bottom()
}

/// Draws the bars of one horizon from `top` down, and returns where they end. The axis counts errors times `factor`.
fn draw_group(canvas: &mut Canvas, frame: &Frame, row: &ErrorRow, factor: f64, top: f64) -> f64 {
    let left = frame.area.x;
    let mut next = top;
    for &Bar { role, error, .. } in &row.bars {
        let length = frame.x_px(factor * drawable(error));
        let end = if error > LONGEST_BAR {
            length + 10.0
        } else {
            length + 6.0
        };
        let number = text(
            &written(error, row.kind),
            left + end,
            next + MIDDLE_PX,
            Anchor::Start,
            TEXT_SIZE,
        );
        canvas.add(bar(left, next, length).set("fill", role.colour()));
        canvas.add(number);
        if error.is_finite() && error > LONGEST_BAR {
            canvas.add(break_mark(left + length - 14.0, next));
        }
        next += BAR_PITCH_PX;
    }
    let middle = (top + next) / 2.0 + TO_BASELINE - (BAR_PITCH_PX - BAR_PX) / 2.0;
    canvas.add(text(
        &format!("{} s ahead", row.horizon_s),
        left - 10.0,
        middle,
        Anchor::End,
        TEXT_SIZE,
    ));
    next
}

fn bar(x: f64, y: f64, length: f64) -> Rectangle {
    Rectangle::new()
        .set("x", x)
        .set("y", y)
        .set("width", px(length))
        .set("height", BAR_PX)
}

/// A slanted gap in a bar that is longer than the axis.
fn break_mark(x: f64, y: f64) -> svg::node::element::Path {
    let gap = Stroke {
        colour: "white",
        width: 3.0,
        dash: "none",
    };
    curves([&[(x, y + BAR_PX + 1.0), (x + 6.0, y - 1.0)][..]], &gap)
}

/// The part of an error that a bar can show.
fn drawable(error: f64) -> f64 {
    if error.is_finite() {
        error.clamp(0.0, LONGEST_BAR)
    } else {
        0.0
    }
}

pub(crate) fn written(error: f64, kind: JointKind) -> String {
    if !error.is_finite() {
        return "diverged".to_owned();
    }
    let (factor, unit) = readable(error, kind.position_unit());
    format!("{} {unit}", three_digits(factor * error))
}

/// The factor and the unit's name: errors below one are in thousandths.
pub(crate) fn readable(error: f64, unit: &str) -> (f64, String) {
    if error < 1.0 {
        (1e3, format!("m{unit}"))
    } else {
        (1.0, unit.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::{Bar, ErrorRow, error_bars};
    use crate::{JointKind, Role};

    fn row(before: f64, after: Option<f64>) -> ErrorRow {
        let bar = |role, label: &str, error| Bar {
            role,
            label: label.into(),
            error,
        };
        let before = bar(Role::Before, "before", before);
        ErrorRow {
            of: "Joint 1".into(),
            kind: JointKind::Revolute,
            horizon_s: 0.5,
            bars: std::iter::once(before)
                .chain(after.map(|error| bar(Role::After, "after", error)))
                .collect(),
        }
    }

    #[test]
    fn numbers_stand_at_the_bars() {
        let figure = error_bars(&[row(2.104, Some(0.0213))], "errors").unwrap();
        assert!(figure.contains("2.10 rad") && figure.contains("21.3 mrad"));
        assert!(figure.contains("0.5 s"));
    }

    #[test]
    fn the_key_names_each_model_once() {
        let figure = error_bars(&[row(2.0, Some(1.0)), row(3.0, None)], "key").unwrap();
        assert_eq!(figure.matches("before").count(), 1);
        assert_eq!(figure.matches("after").count(), 1);
    }

    #[test]
    fn a_lost_prediction_is_named_and_leaves_room_for_the_others() {
        for (lost, name) in [
            (f64::INFINITY, "diverged"),
            (f64::NAN, "diverged"),
            (1e9, "1.00·10⁹ rad"),
        ] {
            let figure = error_bars(&[row(lost, Some(0.5))], "lost").unwrap();
            assert!(
                figure.contains(name) && figure.contains("500 mrad"),
                "{figure}"
            );
        }
    }

    #[test]
    fn zero_errors_are_drawn() {
        let figure = error_bars(&[row(0.0, None)], "zero").unwrap();
        assert!(figure.contains("0 mrad") && !figure.contains("NaN"));
    }
}
