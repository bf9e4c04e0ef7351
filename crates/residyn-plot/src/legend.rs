//! The key to a figure, in rows above its frames.

use svg::node::element::{Group, Rectangle};

use super::PlotError;
use super::canvas::{Anchor, Canvas, TO_BASELINE, curves, dots, filled, marker, text, text_width};
use super::style::{INK, MARGIN, START_MARK_PX, Stroke, TEXT_SIZE, WIDTH};

const SAMPLE_PX: f64 = 30.0;
const ROW_PX: f64 = 21.0;
const ENTRY_GAP_PX: f64 = 26.0;

/// The sample drawn next to a name.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Sample {
    Line(Stroke),
    /// A faint point of a colour.
    Point(&'static str),
    /// A filled bar of a colour.
    Bar(&'static str),
    /// A dot with a rim, of a colour.
    Dot(&'static str),
    /// The mark at the start of a piece of a curve.
    Start,
    /// A line in its band.
    Band(Stroke),
}

/// An entry of a legend.
#[derive(Clone, PartialEq)]
pub(crate) struct Entry {
    pub sample: Sample,
    pub label: String,
}

impl Entry {
    pub fn new(sample: Sample, label: &str) -> Self {
        let label = label.to_owned();
        Self { sample, label }
    }
}

/// Begins a figure of some panels as [`with_key`] does.
///
/// # Errors
/// No panel.
pub(crate) fn begin<P>(
    title: &str,
    panels: &[P],
    entries: impl Fn(&[P]) -> Vec<Entry>,
) -> Result<(Canvas, f64), PlotError> {
    if panels.is_empty() {
        return Err(PlotError {
            title: title.to_owned(),
        });
    }
    Ok(with_key(title, entries(panels)))
}

/// A canvas with a title and a key, each entry once, and where these end.
pub(crate) fn with_key(title: &str, entries: Vec<Entry>) -> (Canvas, f64) {
    let mut once: Vec<Entry> = Vec::new();
    for entry in entries {
        if !once.contains(&entry) {
            once.push(entry);
        }
    }
    let mut canvas = Canvas::new(title);
    let (key, end) = legend(&once, canvas.top);
    canvas.add(key);
    (canvas, end)
}

/// Draws the entries from `top` down, and returns where they end.
fn legend(entries: &[Entry], top: f64) -> (Group, f64) {
    let mut drawn = Group::new();
    let (mut x, mut middle) = (MARGIN, top + ROW_PX / 2.0);
    for entry in entries {
        let width = SAMPLE_PX + 8.0 + text_width(&entry.label, TEXT_SIZE);
        if x > MARGIN && x + width > WIDTH - MARGIN {
            (x, middle) = (MARGIN, middle + ROW_PX);
        }
        let label = text(
            &entry.label,
            x + SAMPLE_PX + 8.0,
            middle + TO_BASELINE,
            Anchor::Start,
            TEXT_SIZE,
        );
        drawn = drawn.add(sample(entry.sample, x, middle)).add(label);
        x += width + ENTRY_GAP_PX;
    }
    (drawn, middle + ROW_PX / 2.0 + 4.0)
}

fn sample(sample: Sample, x: f64, y: f64) -> Group {
    let centre = (x + SAMPLE_PX / 2.0, y);
    let group = Group::new();
    match sample {
        Sample::Line(stroke) => group.add(curves([&[(x, y), (x + SAMPLE_PX, y)][..]], &stroke)),
        Sample::Point(colour) => group.add(dots([centre], 7.0, colour).set("opacity", 0.6)),
        Sample::Bar(colour) => group.add(
            Rectangle::new()
                .set("x", x)
                .set("y", y - 5.5)
                .set("width", SAMPLE_PX)
                .set("height", 11)
                .set("fill", colour),
        ),
        Sample::Dot(colour) => group.add(marker(centre, 5.0, colour)),
        Sample::Start => group.add(marker(centre, START_MARK_PX, INK)),
        Sample::Band(stroke) => {
            let (right, low, high) = (x + SAMPLE_PX, y + 6.0, y - 6.0);
            let outline = [(x, low), (right, low), (right, high), (x, high)];
            group
                .add(filled(&outline, stroke.colour).set("opacity", 0.25))
                .add(curves([&[(x, y), (right, y)][..]], &stroke))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::begin;

    #[test]
    fn a_figure_of_nothing_is_an_error() {
        let Err(error) = begin::<()>("none", &[], |_| Vec::new()) else {
            panic!("a figure without a panel");
        };
        let message = error.to_string();
        assert!(message.contains("\"none\"") && message.contains("at least one panel"));
    }
}
