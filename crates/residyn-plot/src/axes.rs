//! A pair of axes with grid, numbers and labels.

use svg::node::element::{Group, Text};

use super::canvas::{Anchor, Area, TO_BASELINE, rule, text, text_width};
use super::scale::{Range, Scale, Ticks, scaled_unit};
use super::style::{FAINT_INK, GRID, INK, SMALL_SIZE, SPINE, TEXT_SIZE};

/// Room below a frame for numbers and label.
pub(crate) const FOOT: f64 = 46.0;
/// Room above a frame for its heading.
pub(crate) const HEAD: f64 = 24.0;

const X_TICK_PX: f64 = 60.0;
const Y_TICK_PX: f64 = 42.0;
const LABEL_GAP_PX: f64 = 14.0;

/// What an axis measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// What it is called.
    pub name: String,
    /// Empty for a plain number.
    pub unit: String,
}

impl Quantity {
    /// A quantity with its unit, which is empty for a plain number.
    pub fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
        }
    }
}

/// A quantity along one side of a frame.
pub(crate) struct Axis {
    pub range: Range,
    scale: Scale,
    ticks: Ticks,
    label: String,
}

impl Axis {
    /// An axis of the given length in pixels from left to right, its numbers clear of one another.
    pub fn horizontal(range: Range, pixels: f64, quantity: &Quantity) -> Self {
        Self::horizontal_on(Scale::Linear, range, pixels, quantity)
    }

    /// A horizontal axis on a scale of choice.
    pub fn horizontal_on(scale: Scale, range: Range, pixels: f64, quantity: &Quantity) -> Self {
        let mut wanted = (pixels / X_TICK_PX).max(2.0) as usize;
        let mut ticks = scale.ticks(range, wanted);
        while wanted > 2
            && widest(&ticks) + LABEL_GAP_PX > pixels / ticks.values.len().max(1) as f64
        {
            wanted -= 1;
            ticks = scale.ticks(range, wanted);
        }
        Self::labelled(scale, range, ticks, quantity)
    }

    /// An axis of the given length in pixels from bottom to top.
    pub fn vertical(range: Range, pixels: f64, quantity: &Quantity) -> Self {
        let ticks = Ticks::new(range, (pixels / Y_TICK_PX).max(2.0) as usize);
        Self::labelled(Scale::Linear, range, ticks, quantity)
    }

    /// An axis along which things are lined up rather than measured.
    pub fn unmarked(range: Range) -> Self {
        let ticks = Ticks {
            values: vec![],
            labels: vec![],
            exponent: 0,
        };
        Self {
            range,
            scale: Scale::Linear,
            ticks,
            label: String::new(),
        }
    }

    fn labelled(
        scale: Scale,
        range: Range,
        ticks: Ticks,
        Quantity { name, unit }: &Quantity,
    ) -> Self {
        let label = match scaled_unit(unit, ticks.exponent).trim() {
            "" => name.clone(),
            unit => format!("{name} ({unit})"),
        };
        Self {
            range,
            scale,
            ticks,
            label,
        }
    }

    /// How far along the axis a value lies, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        let Range { lo, hi } = self.scale.stretched(self.range);
        (self.scale.forward(value) - lo) / (hi - lo)
    }

    /// Room that numbers and label take at the left of a frame.
    pub fn gutter(&self) -> f64 {
        widest(&self.ticks) + 8.0 + 2.2 * TEXT_SIZE
    }
}

fn widest(ticks: &Ticks) -> f64 {
    let widths = ticks
        .labels
        .iter()
        .map(|label| text_width(label, TEXT_SIZE));
    widths.fold(0.0, f64::max)
}

/// An area with an axis along two sides.
pub(crate) struct Frame<'a> {
    pub area: Area,
    pub x: &'a Axis,
    pub y: &'a Axis,
}

impl Frame<'_> {
    /// Pixels from the left side of the area.
    pub fn x_px(&self, value: f64) -> f64 {
        self.x.share(value) * self.area.width
    }

    /// Pixels from the upper side of the area.
    pub fn y_px(&self, value: f64) -> f64 {
        (1.0 - self.y.share(value)) * self.area.height
    }

    /// Pixels from the upper left corner of the area.
    pub fn point_px(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x_px(x), self.y_px(y))
    }

    /// Whether a point lies inside.
    pub fn holds(&self, (x, y): (f64, f64)) -> bool {
        self.x.range.contains(x) && self.y.range.contains(y)
    }

    /// Grid lines and the two sides that the axes run along.
    pub fn grid(&self) -> Group {
        let Area { x, y, .. } = self.area;
        let (right, bottom) = (self.area.right(), self.area.bottom());
        let mut grid = Group::new();
        for value in &self.x.ticks.values {
            let at = x + self.x_px(*value);
            grid = grid.add(rule((at, y), (at, bottom), GRID));
        }
        for value in &self.y.ticks.values {
            let at = y + self.y_px(*value);
            grid = grid.add(rule((x, at), (right, at), GRID));
        }
        grid.add(rule((x, y), (x, bottom), SPINE))
            .add(rule((x, bottom), (right, bottom), SPINE))
    }

    /// Numbers and label of the lower side.
    pub fn x_labels(&self) -> Group {
        let bottom = self.area.bottom();
        let mut labels = Group::new();
        for (value, label) in self.x.ticks.values.iter().zip(&self.x.ticks.labels) {
            let at = self.area.x + self.x_px(*value);
            labels = labels
                .add(rule((at, bottom), (at, bottom + 4.0), SPINE))
                .add(text(label, at, bottom + 18.0, Anchor::Middle, TEXT_SIZE));
        }
        let middle = self.area.x + self.area.width / 2.0;
        labels.add(text(
            &self.x.label,
            middle,
            bottom + 38.0,
            Anchor::Middle,
            TEXT_SIZE,
        ))
    }

    /// Numbers of the left side, and its label upright along them.
    pub fn y_labels(&self) -> Group {
        let x = self.area.x;
        let mut labels = Group::new();
        for (value, label) in self.y.ticks.values.iter().zip(&self.y.ticks.labels) {
            let at = self.area.y + self.y_px(*value);
            labels = labels.add(rule((x - 4.0, at), (x, at), SPINE)).add(text(
                label,
                x - 8.0,
                at + TO_BASELINE,
                Anchor::End,
                TEXT_SIZE,
            ));
        }
        let edge = x - self.y.gutter() + TEXT_SIZE;
        let middle = self.area.y + self.area.height / 2.0;
        let turned = format!("translate({edge:.1} {middle:.1}) rotate(-90)");
        let label = text(&self.y.label, 0.0, 0.0, Anchor::Middle, TEXT_SIZE);
        labels.add(label.set("transform", turned))
    }

    /// A remark that some points lie outside, or that there are none.
    pub fn hidden(&self, points: impl Iterator<Item = (f64, f64)>, how: &str) -> Option<Text> {
        let inside: Vec<bool> = points.map(|point| self.holds(point)).collect();
        let outside = inside.iter().filter(|is_inside| !**is_inside).count();
        match (inside.len(), outside) {
            (0, _) => Some(no_data(self.area)),
            (_, 0) => None,
            (total, _) => Some(remark(self.area, &format!("{outside} of {total} {how}"))),
        }
    }
}

/// What a frame shows, above its left corner.
pub(crate) fn heading(area: Area, content: &str) -> Text {
    text(content, area.x, area.y - 8.0, Anchor::Start, TEXT_SIZE)
        .set("font-weight", "bold")
        .set("fill", INK)
}

/// A remark above a frame's right corner.
pub(crate) fn remark(area: Area, content: &str) -> Text {
    text(content, area.right(), area.y - 8.0, Anchor::End, SMALL_SIZE).set("fill", FAINT_INK)
}

/// The text in a frame without data.
pub(crate) fn no_data(area: Area) -> Text {
    let (x, y) = (area.x + area.width / 2.0, area.y + area.height / 3.0);
    text("no data", x, y, Anchor::Middle, TEXT_SIZE).set("fill", FAINT_INK)
}
