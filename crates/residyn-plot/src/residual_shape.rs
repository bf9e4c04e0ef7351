//! The force that a model leaves unexplained, against the state of the joint.

use svg::node::element::SVG;

use super::axes::{Axis, FOOT, Frame, HEAD, Quantity, heading};
use super::canvas::{Area, Canvas, clipped, curves, dots, filled, rule};
use super::legend::{Entry, Sample, begin};
use super::scale::Range;
use super::style::{INK, MARGIN, Role, WIDTH};
use super::{JointKind, PlotError};
use residyn_core::data::Joint;

/// Enough to show the cloud; a curve stands in front of it.
const MAX_CLOUD_POINTS: usize = 1500;
const PANEL_GAP: f64 = 16.0;
/// Room for the heading of a row above the remarks on its panels, which are too narrow for both.
const HEADING: f64 = 18.0;
/// Points beyond these quantiles do not stretch an axis.
const QUANTILES: (f64, f64) = (0.01, 0.99);

/// The residual force of one window, with the mean state in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSample {
    /// Position and velocity of the joint, commanded generalised force on it, time.
    pub values: [f64; 4],
    /// Generalised force that the model lacks.
    pub residual: f64,
}

/// The share of one variable in the residual force, with a band.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeCurve {
    pub x: Vec<f64>,
    pub force: Vec<f64>,
    pub low: Vec<f64>,
    pub high: Vec<f64>,
}

/// What one model leaves unexplained of the force on a joint.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeModel {
    /// Which model.
    pub role: Role,
    /// Name in the legend.
    pub label: String,
    /// One point per window.
    pub samples: Vec<ShapeSample>,
    /// In the order of the samples' values; none for a variable that stays the same.
    pub curves: [Option<ShapeCurve>; 4],
}

/// The residual forces of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapePanel {
    pub joint: Joint,
    /// The joint for people, as in `2 (elbow)`.
    pub label: String,
    /// How the joint moves.
    pub kind: JointKind,
    /// The models, from the back to the front.
    pub models: Vec<ShapeModel>,
}

/// What one panel shows of one model.
struct Shown<'a> {
    role: Role,
    cloud: Vec<(f64, f64)>,
    curve: Option<&'a ShapeCurve>,
}

/// Draws one row per joint: residual force against position, velocity, torque and time.
///
/// The axes cover the middle 98 % of the values; a remark counts the points outside. Large scatters are thinned
/// evenly.
pub fn residual_shape(panels: &[ShapePanel], title: &str) -> Result<String, PlotError> {
    let (mut canvas, mut top) = begin(title, panels, entries)?;
    let height = match panels.len() {
        0..=3 => 230.0,
        _ => 150.0,
    };
    for panel in panels {
        top += HEADING + HEAD;
        draw_row(&mut canvas, panel, top, height);
        top += height + FOOT;
    }
    Ok(canvas.finish(top + 6.0))
}

fn entries(panels: &[ShapePanel]) -> Vec<Entry> {
    let models = panels.iter().flat_map(|panel| &panel.models);
    let points = models.map(|m| Entry::new(Sample::Point(m.role.colour()), &m.label));
    let band = Sample::Band(Role::After.stroke());
    let band = Entry::new(band, "fit over this variable alone, 95 % confidence band");
    points.chain([band]).collect()
}

/// What the panels of a row show along their lower sides.
fn columns(&ShapePanel { joint, kind, .. }: &ShapePanel) -> [Quantity; 4] {
    let time = Quantity::new("time t", "s");
    [
        kind.position(joint),
        kind.velocity(joint),
        kind.force(joint),
        time,
    ]
}

fn draw_row(canvas: &mut Canvas, panel: &ShapePanel, top: f64, height: f64) {
    let residual = format!("residual {}", panel.kind.force_name());
    let residual = Quantity::new(residual, panel.kind.force_unit());
    let y = Axis::vertical(force_range(panel), height, &residual);
    let left = MARGIN + y.gutter();
    let width = (WIDTH - MARGIN - left - 3.0 * PANEL_GAP) / 4.0;
    let mut area = Area {
        x: left,
        y: top,
        width,
        height,
    };
    let above = Area {
        y: top - HEADING,
        ..area
    };
    canvas.add(heading(above, &format!("Joint {}", panel.label)));
    for (k, column) in columns(panel).into_iter().enumerate() {
        let shown = panel.models.iter().map(|model| Shown {
            role: model.role,
            cloud: (model.samples.iter())
                .map(|s| (s.values[k], s.residual))
                .collect(),
            curve: model.curves[k].as_ref(),
        });
        let shown: Vec<Shown> = shown.collect();
        let x = Axis::horizontal(state_range(&shown), width, &column);
        let frame = Frame { area, x: &x, y: &y };
        draw_panel(canvas, &frame, &shown);
        if area.x == left {
            canvas.add(frame.y_labels());
        }
        area.x += width + PANEL_GAP;
    }
}

/// Quantiles are taken per set, so that a large set does not push a small one off the axis; zero is always on it.
fn force_range(panel: &ShapePanel) -> Range {
    let ranges = panel.models.iter().filter_map(|model| {
        let forces = model.samples.iter().map(|sample| sample.residual);
        Range::between_quantiles(forces, QUANTILES.0, QUANTILES.1)
    });
    let zero = Range { lo: 0.0, hi: 0.0 };
    ranges.fold(zero, Range::union).drawable().widened(0.08)
}

fn state_range(shown: &[Shown<'_>]) -> Range {
    let values = shown
        .iter()
        .flat_map(|shown| &shown.cloud)
        .map(|point| point.0);
    let range = Range::between_quantiles(values, QUANTILES.0, QUANTILES.1);
    range
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .widened(0.04)
        .drawable()
}

fn draw_panel(canvas: &mut Canvas, frame: &Frame, shown: &[Shown<'_>]) {
    canvas.add(frame.grid());
    canvas.add(frame.x_labels());
    let zero = frame.y_px(0.0);
    let mut inner = clipped(frame.area).add(rule((0.0, zero), (frame.area.width, zero), INK));
    for Shown { role, cloud, .. } in shown {
        let step = cloud.len().div_ceil(MAX_CLOUD_POINTS).max(1);
        let held = cloud
            .iter()
            .step_by(step)
            .filter(|point| frame.holds(**point));
        let points = held.map(|point| frame.point_px(*point));
        inner = inner.add(dots(points, 3.0, role.colour()).set("opacity", 0.28));
    }
    for Shown { role, curve, .. } in shown {
        if let Some(curve) = curve {
            inner = with_curve(inner, frame, *role, curve);
        }
    }
    canvas.add(inner);
    let points = shown.iter().flat_map(|shown| &shown.cloud).copied();
    if let Some(remark) = frame.hidden(points, "outside") {
        canvas.add(remark);
    }
}

/// A line in its band.
fn with_curve(inner: SVG, frame: &Frame, role: Role, curve: &ShapeCurve) -> SVG {
    let line = |forces: &[f64]| -> Vec<(f64, f64)> {
        let points = curve.x.iter().zip(forces);
        points
            .map(|(x, force)| frame.point_px((*x, *force)))
            .collect()
    };
    let (low, mut high) = (line(&curve.low), line(&curve.high));
    high.reverse();
    let outline = [low, high].concat();
    let middle = line(&curve.force);
    inner
        .add(filled(&outline, role.colour()).set("opacity", 0.25))
        .add(curves([middle.as_slice()], &role.stroke()))
}

#[cfg(test)]
mod tests {
    use super::{ShapeCurve, ShapeModel, ShapePanel, ShapeSample, residual_shape};
    use crate::{JointKind, Role};
    use residyn_core::data::Joint;

    fn panel(samples: Vec<ShapeSample>) -> ShapePanel {
        ShapePanel {
            joint: Joint::at(0),
            label: "1".into(),
            kind: JointKind::Revolute,
            models: vec![ShapeModel {
                role: Role::Before,
                label: "fitted".into(),
                samples,
                curves: [const { None }; 4],
            }],
        }
    }

    fn sample(residual: f64) -> ShapeSample {
        ShapeSample {
            values: [1.0, residual, 0.0, 0.0],
            residual,
        }
    }

    #[test]
    fn degenerate_data_are_drawn() {
        for residuals in [
            vec![],
            vec![0.0; 50],
            vec![f64::NAN; 9],
            vec![0.3],
            vec![-1e308, 1e308],
        ] {
            let samples = residuals.into_iter().map(sample).collect();
            let figure = residual_shape(&[panel(samples)], "odd").unwrap();
            assert!(!figure.contains("NaN"), "{figure}");
        }
    }

    #[test]
    fn outliers_are_counted_and_do_not_squeeze() {
        let mut samples: Vec<_> = (0..500).map(|i| sample(f64::from(i) / 500.0)).collect();
        samples.push(sample(1e4));
        let figure = residual_shape(&[panel(samples)], "outlier").unwrap();
        assert!(figure.contains("of 501 outside"));
        assert!(!figure.contains(">10000<"));
    }

    #[test]
    fn a_curve_is_drawn_in_its_band() {
        let mut panel = panel((0..20).map(|i| sample(f64::from(i) - 10.0)).collect());
        let without = residual_shape(std::slice::from_ref(&panel), "curve").unwrap();
        panel.models[0].curves[1] = Some(ShapeCurve {
            x: vec![-9.0, 9.0],
            force: vec![-5.0, 5.0],
            low: vec![-6.0, 4.0],
            high: vec![-4.0, 6.0],
        });
        let figure = residual_shape(&[panel], "curve").unwrap();
        assert!(
            figure.len() > without.len() && figure.contains("Z\""),
            "{figure}"
        );
    }
}
