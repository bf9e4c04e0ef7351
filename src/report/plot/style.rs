//! Colours, line styles and sizes, the same in every figure.

/// What a curve, a cloud of points or a bar stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The log.
    Measured,
    /// The declared model, fitted.
    Before,
    /// The model with the effects that were found.
    After,
    /// The model with a network for what is left.
    Hybrid,
    /// Another model as it is, counted from 0.
    Against(usize),
}

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
    /// A further one, counted from 0.
    Other(usize),
}

const BLACK: &str = "#2b2b2b";
const VERMILION: &str = "#d55e00";
const BLUE: &str = "#0072b2";
const GREEN: &str = "#009e73";

/// What is left of the same palette.
const OTHERS: [&str; 4] = ["#cc79a7", "#56b4e9", "#e69f00", "#999999"];

/// Dashes beside those that carry a name.
const OTHER_DASHES: [&str; 4] = ["8 3 2 3", "3 3", "12 4", "8 3 2 3 2 3"];

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stroke {
    pub colour: &'static str,
    pub width: f64,
    /// SVG `stroke-dasharray`; `none` for a full line.
    pub dash: &'static str,
}

impl Role {
    /// Colours of Okabe and Ito (2008), told apart by colour-blind readers; their vermilion in place of their
    /// orange, which is too pale for a thin line on white.
    pub(super) fn colour(self) -> &'static str {
        match self {
            Self::Measured => BLACK,
            Self::Before => VERMILION,
            Self::After => BLUE,
            Self::Hybrid => GREEN,
            Self::Against(k) => OTHERS[k % OTHERS.len()],
        }
    }

    /// Dashes too differ, for print without colour. The log is a broad grey band that good predictions run on, so
    /// that neither hides the other; the hybrid is dotted, to show the line that it mostly lies on.
    pub(super) fn stroke(self) -> Stroke {
        let (colour, width, dash) = match self {
            Self::Measured => ("#8c8c8c", 4.5, "none"),
            Self::Before => (self.colour(), 1.9, "6 3.5"),
            Self::After => (self.colour(), 1.9, "none"),
            Self::Hybrid => (self.colour(), 2.4, "2.5 5"),
            Self::Against(_) => (self.colour(), 1.9, "8 3 2 3"),
        };
        Stroke {
            colour,
            width,
            dash,
        }
    }
}

impl Method {
    /// The prior and the hybrid have the colours of their roles; the others are told apart by dashes too.
    pub(super) fn stroke(self) -> Stroke {
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

/// Things of one kind, such as joints, counted from 0.
pub(super) fn numbered(k: usize) -> Stroke {
    let colours = [BLUE, VERMILION, GREEN, OTHERS[0]];
    Stroke {
        colour: colours[k % colours.len()],
        width: 1.6,
        dash: "none",
    }
}

pub(super) const WIDTH: f64 = 900.0;
pub(super) const MARGIN: f64 = 18.0;
pub(super) const TITLE_SIZE: f64 = 17.0;
pub(super) const TEXT_SIZE: f64 = 13.0;
pub(super) const SMALL_SIZE: f64 = 11.5;

/// Radius of the mark at the start of a piece of a curve.
pub(super) const START_MARK_PX: f64 = 3.4;

pub(super) const INK: &str = BLACK;
pub(super) const FAINT_INK: &str = "#666666";
pub(super) const GRID: &str = "#e4e4e4";
pub(super) const SPINE: &str = "#8a8a8a";
