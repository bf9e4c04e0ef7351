//! The figure of what planning gains as its model learns.

use svg::node::element::SVG;

use super::axes::{Axis, FOOT, Frame, HEAD, Quantity, heading, no_data, remark};
use super::canvas::{Area, Canvas, clipped, curves, dots, filled};
use super::legend::{Entry, Sample, with_key};
use super::scale::{Range, Scale};
use super::style::{BLACK, BLUE, GREEN, MARGIN, OTHERS, Stroke, VERMILION, WIDTH};

const HEIGHT: f64 = 380.0;
const DOT_PX: f64 = 5.5;
/// Dots closer than about this would run into one another.
const MAX_DOTS: usize = 40;
/// A band without a width still shows as a line of this width.
const BAND_EDGE_PX: f64 = 0.8;

/// Dashes of the further methods.
const OTHER_DASHES: [&str; 4] = ["8 3 2 3", "3 3", "12 4", "8 3 2 3 2 3"];

/// How the model that a planner uses came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Method {
    /// The declared equations, without learning.
    Prior,
    /// A network alone.
    DataDriven,
    /// The declared equations and a network for what they lack.
    Hybrid,
    /// The simulated plant itself.
    Perfect,
    /// A further method, counted from 0.
    Other(usize),
}

impl Method {
    /// The prior and the hybrid have the colours of their roles; dashes distinguish the others as well.
    fn stroke(self) -> Stroke {
        let (colour, width, dash) = match self {
            Self::Prior => (VERMILION, 1.9, "6 3.5"),
            Self::DataDriven => (BLUE, 1.9, "10 3 2 3"),
            Self::Hybrid => (GREEN, 2.4, "none"),
            Self::Perfect => (BLACK, 1.9, "2 3"),
            Self::Other(k) => {
                let k = k % OTHERS.len();
                (OTHERS[k], 1.9, OTHER_DASHES[k])
            }
        };
        Stroke {
            colour,
            width,
            dash,
        }
    }
}

/// One quantity over repetitions of an experiment, such as seeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

/// How a result depends on the amount of data.
#[derive(Debug, Clone, PartialEq)]
pub enum Course {
    /// The result at each amount of data, in increasing order.
    Over(Vec<(f64, Spread)>),
    /// The same at every amount: nothing is learned.
    Level(Spread),
}

/// The result of one method.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodCurve {
    pub method: Method,
    /// Its name in the key.
    pub label: String,
    pub course: Course,
}

/// The methods on one task.
#[derive(Debug, Clone, PartialEq)]
pub struct LearningPanel {
    /// The heading above it.
    pub title: String,
    /// The amount of data.
    pub x: Quantity,
    pub x_scale: Scale,
    /// The result.
    pub y: Quantity,
    /// The methods, in any order.
    pub curves: Vec<MethodCurve>,
}

/// Draws for each method a line through the means, in a band of one standard deviation to either side.
///
/// Axes cover all bands. Points that are not finite leave a gap, as do points at zero and below on a logarithmic axis;
/// a remark counts them.
pub fn learning_curves(panel: &LearningPanel, title: &str) -> String {
    let (mut canvas, top) = with_key(title, entries(panel));
    let whole = Area {
        x: MARGIN,
        y: top + HEAD,
        width: WIDTH - 2.0 * MARGIN,
        height: HEIGHT,
    };
    draw_panel(&mut canvas, panel, whole);
    canvas.finish(whole.bottom() + FOOT + 6.0)
}

fn entries(panel: &LearningPanel) -> Vec<Entry> {
    let mut methods: Vec<&MethodCurve> = panel.curves.iter().collect();
    methods.sort_by_key(|curve| curve.method);
    let band = |curve: &MethodCurve| Entry::new(Sample::Band(curve.method.stroke()), &curve.label);
    methods.into_iter().map(band).collect()
}

/// Draws a panel with its numbers and labels into an area.
fn draw_panel(canvas: &mut Canvas, panel: &LearningPanel, whole: Area) {
    let y = Axis::vertical(y_range(panel), whole.height, &panel.y);
    let area = Area {
        x: whole.x + y.gutter(),
        width: whole.width - y.gutter(),
        ..whole
    };
    let x = Axis::horizontal_on(panel.x_scale, x_range(panel), area.width, &panel.x);
    let frame = Frame { area, x: &x, y: &y };
    canvas.add(frame.grid());
    canvas.add(frame.x_labels());
    canvas.add(frame.y_labels());
    canvas.add(heading(area, &panel.title));
    canvas.add(drawn_curves(&frame, panel));
    add_remark(canvas, &frame, panel);
}

fn x_range(panel: &LearningPanel) -> Range {
    let shown = panel.curves.iter().flat_map(points).map(|point| point.0);
    let range = Range::spanning(shown.filter(|x| panel.x_scale.shows(*x)))
        .unwrap_or(Range { lo: 1.0, hi: 10.0 })
        .drawable();
    panel.x_scale.widened(range, 0.04)
}

fn y_range(panel: &LearningPanel) -> Range {
    let spreads = panel.curves.iter().flat_map(|curve| match &curve.course {
        Course::Over(points) => points.iter().map(|point| point.1).collect(),
        Course::Level(spread) => vec![*spread],
    });
    let ends = spreads.flat_map(|Spread { mean, std }| [mean - std, mean + std]);
    Range::spanning(ends)
        .unwrap_or(Range { lo: -1.0, hi: 1.0 })
        .drawable()
        .widened(0.06)
}

fn points(curve: &MethodCurve) -> &[(f64, Spread)] {
    match &curve.course {
        Course::Over(points) => points,
        Course::Level(_) => &[],
    }
}

/// All bands, and all lines in front of them.
fn drawn_curves(frame: &Frame, panel: &LearningPanel) -> SVG {
    let mut sorted: Vec<&MethodCurve> = panel.curves.iter().collect();
    // The first methods come last and so stand in front.
    sorted.sort_by_key(|curve| std::cmp::Reverse(curve.method));
    let pieces: Vec<_> = sorted
        .iter()
        .map(|curve| (curve, pieces(frame, curve)))
        .collect();
    let mut inner = clipped(frame.area);
    for (curve, pieces) in &pieces {
        for piece in pieces {
            inner = inner.add(band(frame, piece, curve.method.stroke().colour));
        }
    }
    for (curve, pieces) in &pieces {
        inner = with_lines(inner, frame, pieces, curve.method.stroke());
        if (1..=MAX_DOTS).contains(&points(curve).len()) {
            let means = pieces.iter().flatten().map(|(x, spread)| (*x, spread.mean));
            let means = means.map(|point| frame.point_px(point));
            inner = inner.add(dots(means, DOT_PX, curve.method.stroke().colour));
        }
    }
    inner
}

/// The parts of a curve that can be drawn; a level runs over the whole frame.
fn pieces(frame: &Frame, curve: &MethodCurve) -> Vec<Vec<(f64, Spread)>> {
    let all = match &curve.course {
        Course::Over(points) => points.clone(),
        Course::Level(spread) => [frame.x.range.lo, frame.x.range.hi]
            .map(|x| (x, *spread))
            .to_vec(),
    };
    all.split(|point| !is_drawable(frame, *point))
        .filter(|piece| !piece.is_empty())
        .map(<[_]>::to_vec)
        .collect()
}

fn is_drawable(frame: &Frame, (x, spread): (f64, Spread)) -> bool {
    frame.x.range.contains(x) && spread.mean.is_finite() && spread.std.is_finite()
}

fn band(frame: &Frame, piece: &[(f64, Spread)], colour: &str) -> svg::node::element::Path {
    let side = |sign: f64| {
        let ends = piece.iter().map(move |(x, s)| (*x, s.mean + sign * s.std));
        ends.map(|point| frame.point_px(point))
    };
    let outline: Vec<(f64, f64)> = side(-1.0).chain(side(1.0).rev()).collect();
    filled(&outline, colour)
        .set("stroke", colour)
        .set("stroke-width", BAND_EDGE_PX)
        .set("opacity", 0.18)
}

fn with_lines(inner: SVG, frame: &Frame, pieces: &[Vec<(f64, Spread)>], stroke: Stroke) -> SVG {
    let lines: Vec<Vec<(f64, f64)>> = pieces
        .iter()
        .map(|piece| {
            let means = piece.iter().map(|(x, spread)| (*x, spread.mean));
            means.map(|point| frame.point_px(point)).collect()
        })
        .collect();
    inner.add(curves(lines.iter().map(Vec::as_slice), &stroke))
}

/// Counts what the frame does not show.
fn add_remark(canvas: &mut Canvas, frame: &Frame, panel: &LearningPanel) {
    if panel.curves.is_empty() {
        canvas.add(no_data(frame.area));
    }
    let all = || panel.curves.iter().flat_map(points);
    let total = all().count();
    let missing = all().filter(|point| !is_drawable(frame, **point)).count();
    if missing > 0 {
        let remarked = format!("{missing} of {total} points cannot be drawn");
        canvas.add(remark(frame.area, &remarked));
    }
}

#[cfg(test)]
mod tests {
    use super::{Course, LearningPanel, MethodCurve, Quantity, Spread, learning_curves};
    use crate::{Method, Scale};

    fn panel(x_scale: Scale, curves: Vec<MethodCurve>) -> LearningPanel {
        LearningPanel {
            title: "Pendulum".into(),
            x: Quantity::new("real transitions", ""),
            x_scale,
            y: Quantity::new("return", ""),
            curves,
        }
    }

    fn learned(method: Method, points: &[(f64, f64, f64)]) -> MethodCurve {
        let points = points.iter();
        MethodCurve {
            method,
            label: format!("{method:?}"),
            course: Course::Over(
                points
                    .map(|(x, mean, std)| {
                        let (mean, std) = (*mean, *std);
                        (*x, Spread { mean, std })
                    })
                    .collect(),
            ),
        }
    }

    fn level(method: Method, mean: f64, std: f64) -> MethodCurve {
        MethodCurve {
            method,
            label: format!("{method:?}"),
            course: Course::Level(Spread { mean, std }),
        }
    }

    fn drawn(panel: LearningPanel) -> String {
        learning_curves(&panel, "learning")
    }

    #[test]
    fn degenerate_data_are_drawn() {
        let nan = f64::NAN;
        for scale in [Scale::Linear, Scale::Logarithmic] {
            for points in [
                vec![],
                vec![(0.0, 1.0, 0.0)],
                vec![(25.0, nan, nan), (50.0, 1.0, f64::INFINITY)],
                vec![(-1.0, 1.0, 0.1), (nan, 1.0, 0.1), (5.0, 1.0, 0.1)],
                vec![(1.0, -1e308, 1e308), (1e300, 1e308, 1e308)],
            ] {
                let figure = drawn(panel(scale, vec![learned(Method::Hybrid, &points)]));
                assert!(
                    !figure.contains("NaN") && !figure.contains("inf"),
                    "{figure}"
                );
            }
        }
    }

    #[test]
    fn a_plain_number_has_no_unit_on_its_axis() {
        let figure = drawn(panel(
            Scale::Linear,
            vec![level(Method::Perfect, -1.0, 0.1)],
        ));
        assert!(figure.contains("\nreturn\n"), "{figure}");
        assert!(!figure.contains("()"));
    }

    #[test]
    fn transitions_on_a_logarithmic_axis_are_marked_by_ratio() {
        let points = [(25.0, 0.0, 0.1), (400.0, 1.0, 0.1), (10_000.0, 2.0, 0.1)];
        let curves = vec![learned(Method::Hybrid, &points)];
        let marked = |scale| drawn(panel(scale, curves.clone())).contains("\n100\n");
        assert!(marked(Scale::Logarithmic) && !marked(Scale::Linear));
    }

    #[test]
    fn what_cannot_be_drawn_is_counted_and_leaves_a_gap() {
        let points = [
            (0.0, 1.0, 0.1),
            (25.0, 1.0, 0.1),
            (50.0, f64::NAN, 0.1),
            (100.0, 1.0, 0.1),
        ];
        let figure = drawn(panel(
            Scale::Logarithmic,
            vec![learned(Method::Hybrid, &points)],
        ));
        assert!(figure.contains("2 of 4 points cannot be drawn"), "{figure}");
        assert_eq!(
            figure.matches("Z\"").count(),
            3,
            "two bands, one sample in the key"
        );
    }

    #[test]
    fn the_key_names_each_method_once_in_order() {
        let figure = drawn(panel(
            Scale::Linear,
            vec![
                level(Method::Perfect, 2.0, 0.1),
                learned(Method::Hybrid, &[(1.0, 1.0, 0.1)]),
            ],
        ));
        assert_eq!(figure.matches("Perfect").count(), 1);
        assert!(figure.find("Hybrid") < figure.find("Perfect"));
    }

    #[test]
    fn methods_differ_by_colour_and_by_dash() {
        let named = [
            Method::Prior,
            Method::DataDriven,
            Method::Hybrid,
            Method::Perfect,
        ];
        let strokes: Vec<_> = named
            .into_iter()
            .chain((0..4).map(Method::Other))
            .map(Method::stroke)
            .collect();
        for (k, one) in strokes.iter().enumerate() {
            for other in &strokes[..k] {
                assert!(one.colour != other.colour && one.dash != other.dash);
            }
        }
    }
}
