//! The force that a model leaves unexplained, against the state of the joint.

use svg::node::element::SVG;

use super::axes::{Axis, FOOT, Frame, HEAD, heading, no_data, remark};
use super::binned::{Bin, binned_mean};
use super::canvas::{Area, Canvas, clipped, curves, dots, marker, rule};
use super::legend::{Entry, Sample, legend};
use super::scale::Range;
use super::style::{INK, MARGIN, MEAN_MARK_PX, Role, Stroke, WIDTH};
use super::{JointKind, PlotError};

/// Enough to show the cloud; a mean over all points stands in front of it.
const MAX_CLOUD_POINTS: usize = 1500;
const BINS: usize = 16;
const PANEL_HEIGHT: f64 = 230.0;
const PANEL_GAP: f64 = 32.0;
/// Points beyond these quantiles do not stretch an axis.
const QUANTILES: (f64, f64) = (0.01, 0.99);

/// The residual force of one window, with the mean state in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapeSample {
    /// Position of the joint.
    pub q: f64,
    /// Velocity of the joint.
    pub qd: f64,
    /// Commanded generalised force on the joint.
    pub tau: f64,
    /// Generalised force that the model lacks.
    pub residual: f64,
}

/// The residual forces of one joint.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapePanel {
    /// Number of the joint, from 1.
    pub joint: usize,
    /// How the joint moves.
    pub kind: JointKind,
    /// Left by the declared model.
    pub before: Vec<ShapeSample>,
    /// Left by the model with the effects; empty where there is none.
    pub after: Vec<ShapeSample>,
}

type Cloud = Vec<(f64, f64)>;

/// What a panel of a row has along its lower side.
struct Column {
    quantity: String,
    unit: &'static str,
    value: fn(&ShapeSample) -> f64,
}

/// Draws one row a joint: residual force against position, velocity and torque.
///
/// The axes cover the middle 98 % of the values; a remark counts the points outside. Large clouds are thinned
/// evenly, the means are over all points.
pub fn residual_shape(panels: &[ShapePanel], title: &str) -> Result<String, PlotError> {
    if panels.is_empty() {
        return Err(PlotError::Empty {
            title: title.to_owned(),
        });
    }
    let mut canvas = Canvas::new(title);
    let (key, mut top) = legend(&entries(panels), canvas.top);
    canvas.add(key);
    for panel in panels {
        draw_row(&mut canvas, panel, top + HEAD);
        top += HEAD + PANEL_HEIGHT + FOOT;
    }
    Ok(canvas.finish(top + 6.0))
}

fn entries(panels: &[ShapePanel]) -> Vec<Entry> {
    let mut entries = vec![Entry::new(Sample::Point(Role::Before), "before")];
    if panels.iter().any(|panel| !panel.after.is_empty()) {
        entries.push(Entry::new(Sample::Point(Role::After), "after"));
    }
    entries.push(Entry::new(Sample::Interval, "mean of a bin, 95 % interval"));
    entries
}

fn columns(panel: &ShapePanel) -> [Column; 3] {
    let ShapePanel { joint, kind, .. } = panel;
    [
        Column {
            quantity: format!("position q{joint}"),
            unit: kind.position_unit(),
            value: |sample| sample.q,
        },
        Column {
            quantity: format!("velocity qd{joint}"),
            unit: kind.velocity_unit(),
            value: |sample| sample.qd,
        },
        Column {
            quantity: format!("{} tau{joint}", kind.force_name()),
            unit: kind.force_unit(),
            value: |sample| sample.tau,
        },
    ]
}

fn draw_row(canvas: &mut Canvas, panel: &ShapePanel, top: f64) {
    let residual = format!("residual {}", panel.kind.force_name());
    let range = force_range(panel);
    let y = Axis::vertical(range, PANEL_HEIGHT, &residual, panel.kind.force_unit());
    let left = MARGIN + y.gutter();
    let width = (WIDTH - MARGIN - left - 2.0 * PANEL_GAP) / 3.0;
    let mut area = Area {
        x: left,
        y: top,
        width,
        height: PANEL_HEIGHT,
    };
    canvas.add(heading(area, &format!("Joint {}", panel.joint)));
    for column in columns(panel) {
        let clouds = [(Role::Before, &panel.before), (Role::After, &panel.after)]
            .map(|(role, samples)| (role, cloud(samples, column.value)));
        let range = state_range(&clouds);
        let x = Axis::horizontal(range, width, &column.quantity, column.unit);
        let frame = Frame { area, x: &x, y: &y };
        draw_panel(canvas, &frame, &clouds);
        if area.x == left {
            canvas.add(frame.y_numbers());
            canvas.add(frame.y_label());
        }
        area.x += width + PANEL_GAP;
    }
}

fn cloud(samples: &[ShapeSample], value: fn(&ShapeSample) -> f64) -> Cloud {
    samples
        .iter()
        .map(|sample| (value(sample), sample.residual))
        .collect()
}

/// Of each set on its own, so that a large one does not push a small one off the axis; zero is always on it.
fn force_range(panel: &ShapePanel) -> Range {
    let ranges = [&panel.before, &panel.after]
        .into_iter()
        .filter_map(|samples| {
            let forces = samples.iter().map(|sample| sample.residual);
            Range::between_quantiles(forces, QUANTILES.0, QUANTILES.1)
        });
    let zero = Range { lo: 0.0, hi: 0.0 };
    ranges.fold(zero, Range::union).drawable().widened(0.08)
}

fn state_range(clouds: &[(Role, Cloud)]) -> Range {
    let values = clouds
        .iter()
        .flat_map(|(_, cloud)| cloud)
        .map(|point| point.0);
    let range = Range::between_quantiles(values, QUANTILES.0, QUANTILES.1);
    range
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .widened(0.04)
        .drawable()
}

fn draw_panel(canvas: &mut Canvas, frame: &Frame, clouds: &[(Role, Cloud)]) {
    canvas.add(frame.grid());
    canvas.add(frame.x_labels());
    let zero = frame.y_px(0.0);
    let mut inner = clipped(frame.area).add(rule((0.0, zero), (frame.area.width, zero), INK));
    for (role, cloud) in clouds {
        let step = cloud.len().div_ceil(MAX_CLOUD_POINTS).max(1);
        let shown = cloud
            .iter()
            .step_by(step)
            .filter(|point| frame.holds(**point));
        let points = shown.map(|point| frame.point_px(*point));
        inner = inner.add(dots(points, 3.0, role.colour()).set("opacity", 0.28));
    }
    for (role, cloud) in clouds {
        inner = with_means(inner, frame, *role, &binned_mean(cloud, BINS));
    }
    canvas.add(inner);
    let total: usize = clouds.iter().map(|(_, cloud)| cloud.len()).sum();
    let inside = |cloud: &Cloud| cloud.iter().filter(|point| frame.holds(**point)).count();
    let outside = total - clouds.iter().map(|(_, cloud)| inside(cloud)).sum::<usize>();
    if total == 0 {
        canvas.add(no_data(frame.area));
    } else if outside > 0 {
        canvas.add(remark(
            frame.area,
            &format!("{outside} of {total} points outside"),
        ));
    }
}

fn with_means(mut inner: SVG, frame: &Frame, role: Role, bins: &[Bin]) -> SVG {
    let colour = role.colour();
    let means: Cloud = bins
        .iter()
        .map(|bin| frame.point_px((bin.x, bin.mean)))
        .collect();
    let thin = Stroke {
        width: 1.2,
        ..role.stroke()
    };
    inner = inner.add(curves([means.as_slice()], &thin));
    for (bin, centre) in bins.iter().zip(&means) {
        let [low, high] = [-1.0, 1.0].map(|sign| frame.y_px(bin.mean + sign * bin.half_width));
        inner = inner
            .add(rule((centre.0, low), (centre.0, high), colour).set("stroke-width", 1.6))
            .add(marker(*centre, MEAN_MARK_PX, colour));
    }
    inner
}

#[cfg(test)]
mod tests {
    use super::{ShapePanel, ShapeSample, residual_shape};
    use crate::report::plot::{JointKind, PlotError};

    fn panel(before: Vec<ShapeSample>) -> ShapePanel {
        let kind = JointKind::Revolute;
        ShapePanel {
            joint: 1,
            kind,
            before,
            after: vec![],
        }
    }

    fn sample(residual: f64) -> ShapeSample {
        ShapeSample {
            q: 1.0,
            qd: residual,
            tau: 0.0,
            residual,
        }
    }

    #[test]
    fn odd_data_is_drawn() {
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
        assert!(figure.contains("of 501 points outside"));
        assert!(!figure.contains(">10000<"));
    }

    #[test]
    fn no_panel_is_an_error() {
        let error = residual_shape(&[], "none").unwrap_err();
        assert_eq!(
            error,
            PlotError::Empty {
                title: "none".to_owned()
            }
        );
    }
}
