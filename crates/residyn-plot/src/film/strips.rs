//! Quantities over time below the motion, with a cursor that runs along.

use svg::node::element::{AnimateTransform, Group};

use crate::Quantity;
use crate::axes::{Axis, FOOT, Frame};
use crate::canvas::{Area, Canvas, clipped, curves, dots, px, rule};
use crate::decimate::{decimate, drawable_pieces};
use crate::legend::{Entry, Sample};
use crate::scale::Range;
use crate::style::{BLUE, GREEN, INK, OTHERS, SPINE, Stroke, VERMILION};

pub(super) const STRIP_HEIGHT: f64 = 126.0;
const STRIP_GAP: f64 = 14.0;
/// About two for each column of pixels: more cannot be seen.
const MAX_STRIP_POINTS: usize = 2000;

/// A quantity over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Strip {
    pub quantity: Quantity,
    /// One or more; more than one are named in the key.
    pub lines: Vec<StripLine>,
}

/// One line of a strip.
#[derive(Debug, Clone, PartialEq)]
pub struct StripLine {
    /// Its name in the key.
    pub label: String,
    /// One per step of the animation, the first at time 0.
    pub values: Vec<f64>,
}

/// The key: lines of strips that have more than one.
pub(super) fn entries(strips: &[Strip]) -> Vec<Entry> {
    let several = strips.iter().filter(|strip| strip.lines.len() > 1);
    let lines = several.flat_map(|strip| strip.lines.iter().enumerate());
    lines
        .map(|(k, line)| Entry::new(Sample::Line(numbered(k)), &line.label))
        .collect()
}

pub(super) fn strip_axis(strip: &Strip) -> Axis {
    let values = strip.lines.iter().flat_map(|line| &line.values).copied();
    let range = Range::spanning(values)
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .drawable()
        .widened(0.08);
    let Quantity { name, unit } = &strip.quantity;
    Axis::vertical(range, STRIP_HEIGHT, name, unit)
}

/// Draws the strips from an area down over a common time axis, and returns where they end.
pub(super) fn draw_strips(
    canvas: &mut Canvas,
    strips: &[Strip],
    step_s: f64,
    axes: &[Axis],
    duration_s: f64,
    first: Area,
) -> f64 {
    let lines = strips.iter().flat_map(|strip| &strip.lines);
    let times = lines.map(|line| step_s * line.values.len() as f64 - step_s);
    let range = Range {
        lo: 0.0,
        hi: times.fold(duration_s, f64::max),
    };
    let time = Axis::horizontal(range.drawable(), first.width, "time", "s");
    let mut area = first;
    for (k, (strip, y)) in strips.iter().zip(axes).enumerate() {
        let frame = Frame { area, x: &time, y };
        draw_strip(canvas, &frame, strip, step_s);
        if k + 1 < strips.len() {
            area.y += STRIP_HEIGHT + STRIP_GAP;
        } else {
            canvas.add(frame.x_labels());
            canvas.add(cursor(&frame, first.y, duration_s));
        }
    }
    if strips.is_empty() {
        first.y
    } else {
        area.bottom() + FOOT
    }
}

fn draw_strip(canvas: &mut Canvas, frame: &Frame, strip: &Strip, step_s: f64) {
    canvas.add(frame.grid());
    canvas.add(frame.y_numbers());
    canvas.add(frame.y_label());
    let mut inner = clipped(frame.area);
    for (k, line) in strip.lines.iter().enumerate() {
        let values = line.values.iter().enumerate();
        let points: Vec<(f64, f64)> = values.map(|(i, v)| (step_s * i as f64, *v)).collect();
        let pieces: Vec<Vec<(f64, f64)>> = drawable_pieces(&points)
            .map(|piece| {
                let kept = decimate(piece, MAX_STRIP_POINTS);
                kept.into_iter()
                    .map(|point| frame.point_px(point))
                    .collect()
            })
            .collect();
        inner = inner.add(curves(pieces.iter().map(Vec::as_slice), &numbered(k)));
    }
    canvas.add(inner);
}

/// A line across all strips that runs along with the motion.
fn cursor(last: &Frame, top: f64, duration_s: f64) -> Group {
    let [start, end] = [0.0, duration_s].map(|time| last.area.x + last.x_px(time));
    let run = AnimateTransform::new()
        .set("attributeName", "transform")
        .set("type", "translate")
        .set("from", px(start))
        .set("to", px(end))
        .set("dur", clock_value(duration_s))
        .set("repeatCount", "indefinite");
    Group::new()
        .set("transform", format!("translate({} 0)", px(end)))
        .add(rule((0.0, top), (0.0, last.area.bottom()), INK).set("stroke-width", 1.5))
        .add(dots([(0.0, top)], 7.0, SPINE))
        .add(run)
}

/// A duration as SVG animations expect it.
pub(super) fn clock_value(duration_s: f64) -> String {
    format!("{duration_s:.3}s")
}

/// The line of the k-th of several things of one kind, such as joints, from 0.
pub(super) fn numbered(k: usize) -> Stroke {
    let colours = [BLUE, VERMILION, GREEN, OTHERS[0]];
    Stroke {
        colour: colours[k % colours.len()],
        width: 1.6,
        dash: "none",
    }
}
