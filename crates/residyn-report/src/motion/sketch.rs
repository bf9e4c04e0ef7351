//! Moving lines, as text that a page puts into its picture.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Tracks;

/// lines in the picture's own units, as SVG gives points
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
pub(crate) struct PictureEntry {
    /// what it shows
    pub about: String,
    /// as SVG gives it
    pub view_box: String,
    /// a line that stands still
    pub ground: String,
    /// the line that moves, for each frame
    pub measured: Vec<String>,
    /// prediction of the declared model, fitted; empty where it is far outside the picture or not finite
    pub before: Vec<String>,
    /// prediction of the model with the effects
    pub after: Vec<String>,
}

/// A point of a picture: to the right and upwards.
pub(super) type Point = [f64; 2];

/// A line that depends on the joints' positions.
pub(super) struct Sketch<F> {
    pub about: String,
    /// Least and largest coordinates of what is to be seen.
    pub low: Point,
    pub high: Point,
    pub ground: Vec<Point>,
    pub line: F,
}

/// The longer side of a picture, in its units: whole numbers are fine enough.
const SIDE: f64 = 1000.0;
/// Room around, as a share of the longer side.
const ROOM: f64 = 0.08;
/// Points farther away than this multiple of the longer side are not drawn.
const FAR: f64 = 10.0;

impl<F: Fn(&[f64]) -> Vec<Point>> Sketch<F> {
    pub fn moved(&self, tracks: &Tracks) -> PictureEntry {
        let [measured, before, after] = tracks.each_ref().map(|frames| {
            let lines = frames.iter().map(|q| self.text(&(self.line)(q)));
            lines.collect()
        });
        PictureEntry {
            about: self.about.clone(),
            view_box: self.view_box(),
            ground: self.text(&self.ground),
            measured,
            before,
            after,
        }
    }

    fn side(&self) -> f64 {
        (self.high[0] - self.low[0]).max(self.high[1] - self.low[1])
    }

    fn units(&self, length: f64) -> f64 {
        SIDE * length / self.side()
    }

    fn view_box(&self) -> String {
        let room = ROOM * SIDE;
        let corner = [self.low[0], -self.high[1]].map(|at| (self.units(at) - room).round());
        let size = [0, 1].map(|k| (self.units(self.high[k] - self.low[k]) + 2.0 * room).round());
        format!("{} {} {} {}", corner[0], corner[1], size[0], size[1])
    }

    /// Whole numbers; a point that is repeated in a row appears once.
    fn text(&self, line: &[Point]) -> String {
        let seen = line.iter().map(|[x, y]| [self.units(*x), -self.units(*y)]);
        let seen: Vec<Point> = seen.collect();
        if !seen.iter().flatten().all(|at| at.abs() < FAR * SIDE) {
            return String::new();
        }
        // A zero has no sign.
        let whole = seen.iter().map(|[x, y]| [x.round() + 0.0, y.round() + 0.0]);
        let mut texts: Vec<String> = whole.map(|[x, y]| format!("{x},{y}")).collect();
        texts.dedup();
        texts.join(" ")
    }
}
