//! The few marks that the figures are made of, on top of SVG elements.

use std::fmt::Write;

use svg::Document;
use svg::node::element::{Circle, Group, Line, Path, Rectangle, SVG, Text, Title};

use super::style::{INK, MARGIN, Stroke, TEXT_SIZE, TITLE_SIZE, WIDTH};

/// Renderers clip what lies outside, but not all of them tolerate coordinates of any size.
const FARTHEST_PX: f64 = 1e4;

/// Bold letters are wider by about this factor.
const BOLD: f64 = 1.15;

/// A rectangle in pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Area {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Area {
    pub fn right(self) -> f64 {
        self.x + self.width
    }

    pub fn bottom(self) -> f64 {
        self.y + self.height
    }
}

/// The point of a text that its position refers to.
#[derive(Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A figure under construction: a white sheet with a title.
pub(crate) struct Canvas {
    title: String,
    marks: Group,
    /// Where the part below the title begins.
    pub top: f64,
}

impl Canvas {
    pub fn new(title: &str) -> Self {
        let mut marks = Group::new()
            .set("font-family", "sans-serif")
            .set("fill", INK);
        let mut baseline = MARGIN;
        for line in wrapped(title, WIDTH - 2.0 * MARGIN, BOLD * TITLE_SIZE) {
            baseline += TITLE_SIZE;
            let text = text(&line, MARGIN, baseline, Anchor::Start, TITLE_SIZE);
            marks = marks.add(text.set("font-weight", "bold"));
            baseline += 5.0;
        }
        Self {
            title: title.to_owned(),
            marks,
            top: baseline + 6.0,
        }
    }

    pub fn add(&mut self, mark: impl Into<Box<dyn svg::Node>>) {
        svg::Node::append(&mut self.marks, mark);
    }

    /// The whole document, cut off at `height`.
    pub fn finish(self, height: f64) -> String {
        let height = height.ceil();
        let sheet = Rectangle::new()
            .set("width", WIDTH)
            .set("height", height)
            .set("fill", "white");
        Document::new()
            .set("width", WIDTH)
            .set("height", height)
            .set("viewBox", (0, 0, WIDTH, height))
            .set("role", "img")
            .add(Title::new(self.title))
            .add(sheet)
            .add(self.marks)
            .to_string()
    }
}

/// An inner drawing that hides what lies outside of `area`; its origin is the area's upper left corner.
/// A nested `svg` rather than a `clipPath`: that needs an identifier, and these collide between figures in a page.
pub(crate) fn clipped(area: Area) -> SVG {
    SVG::new()
        .set("x", px(area.x))
        .set("y", px(area.y))
        .set("width", px(area.width))
        .set("height", px(area.height))
        .set("overflow", "hidden")
}

pub(crate) fn text(content: &str, x: f64, y: f64, anchor: Anchor, size: f64) -> Text {
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    Text::new(content)
        .set("x", px(x))
        .set("y", px(y))
        .set("text-anchor", anchor)
        .set("font-size", size)
}

pub(crate) fn rule(from: (f64, f64), to: (f64, f64), colour: &str) -> Line {
    Line::new()
        .set("x1", px(from.0))
        .set("y1", px(from.1))
        .set("x2", px(to.0))
        .set("y2", px(to.1))
        .set("stroke", colour)
}

/// Path data of an open line.
fn line_data(points: &[(f64, f64)]) -> String {
    let mut data = String::new();
    for (index, point) in points.iter().enumerate() {
        push(&mut data, if index == 0 { 'M' } else { 'L' }, *point);
    }
    data
}

/// Open curves in one style.
pub(crate) fn curves<'a>(
    lines: impl IntoIterator<Item = &'a [(f64, f64)]>,
    stroke: &Stroke,
) -> Path {
    let data: String = lines.into_iter().map(line_data).collect();
    Path::new()
        .set("d", data)
        .set("fill", "none")
        .set("stroke", stroke.colour)
        .set("stroke-width", stroke.width)
        .set("stroke-dasharray", stroke.dash)
        .set("stroke-linejoin", "round")
}

/// The area within an outline.
pub(crate) fn filled(outline: &[(f64, f64)], colour: &str) -> Path {
    let data = line_data(outline) + "Z";
    Path::new().set("d", data).set("fill", colour)
}

/// Round dots as one path of zero-length strokes with round caps: a fifth of the text of as many circles.
pub(crate) fn dots(
    points: impl IntoIterator<Item = (f64, f64)>,
    diameter: f64,
    colour: &str,
) -> Path {
    let mut data = String::new();
    for point in points {
        push(&mut data, 'M', point);
        data.push_str("h0");
    }
    Path::new()
        .set("d", data)
        .set("fill", "none")
        .set("stroke", colour)
        .set("stroke-width", diameter)
        .set("stroke-linecap", "round")
}

/// A dot with a white rim, to stand out from the lines around it.
pub(crate) fn marker((x, y): (f64, f64), radius: f64, colour: &str) -> Circle {
    Circle::new()
        .set("cx", px(x))
        .set("cy", px(y))
        .set("r", radius)
        .set("fill", colour)
        .set("stroke", "white")
}

/// Approximate width of a text in a wide sans-serif font, where digits are wider than letters on average.
pub(crate) fn text_width(content: &str, size: f64) -> f64 {
    let share = |letter: char| {
        if letter.is_alphabetic() || letter == ' ' {
            0.52
        } else {
            0.64
        }
    };
    size * content.chars().map(share).sum::<f64>()
}

/// Vertical distance from the middle of a line of text to its baseline.
pub(crate) const TO_BASELINE: f64 = 0.35 * TEXT_SIZE;

fn wrapped(content: &str, width: f64, size: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in content.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line, size) + text_width(word, size) < width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn push(data: &mut String, command: char, (x, y): (f64, f64)) {
    // Writing to a String cannot fail.
    let _ = write!(data, "{command}{} {}", px(x), px(y));
}

/// Tenths of a pixel: finer cannot be seen, and only makes the file longer.
pub(crate) fn px(value: f64) -> f64 {
    (value.clamp(-FARTHEST_PX, FARTHEST_PX) * 10.0).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::{Canvas, wrapped};

    #[test]
    fn long_titles_wrap_and_markup_is_escaped() {
        let title = "a < b & c ".repeat(30);
        assert!(wrapped(&title, 864.0, 17.0).len() > 2);
        let document = Canvas::new(&title).finish(100.0);
        assert!(document.contains("a &lt; b &amp; c") && !document.contains("a < b"));
    }
}
