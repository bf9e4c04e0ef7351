//! Colours, line styles and sizes, the same in every figure.

/// What a curve, a cloud of points or a bar shows.
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

pub(super) const BLACK: &str = "#2b2b2b";
pub(crate) const VERMILION: &str = "#d55e00";
pub(crate) const BLUE: &str = "#0072b2";
pub(crate) const GREEN: &str = "#009e73";

/// The rest of the same palette.
pub(crate) const OTHERS: [&str; 4] = ["#cc79a7", "#56b4e9", "#e69f00", "#999999"];

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stroke {
    pub colour: &'static str,
    pub width: f64,
    /// SVG `stroke-dasharray`; `none` for a full line.
    pub dash: &'static str,
}

impl Role {
    /// Colours of Okabe and Ito (2008), which colour-blind readers can distinguish; their vermilion in place of their
    /// orange, which is too pale for a thin line on white.
    pub(crate) fn colour(self) -> &'static str {
        match self {
            Self::Measured => BLACK,
            Self::Before => VERMILION,
            Self::After => BLUE,
            Self::Hybrid => GREEN,
            Self::Against(k) => OTHERS[k % OTHERS.len()],
        }
    }

    /// Dashes differ as well, for print without colour. The log is a broad grey band that good predictions run on, so
    /// that neither hides the other; the hybrid is dotted, to show the line that it mostly lies on.
    pub(crate) fn stroke(self) -> Stroke {
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

pub(crate) const WIDTH: f64 = 900.0;
pub(crate) const MARGIN: f64 = 18.0;
pub(crate) const TITLE_SIZE: f64 = 17.0;
pub(crate) const TEXT_SIZE: f64 = 13.0;
pub(crate) const SMALL_SIZE: f64 = 11.5;

/// Radius of the mark at the start of a piece of a curve.
pub(crate) const START_MARK_PX: f64 = 3.4;

pub(crate) const INK: &str = BLACK;
pub(crate) const FAINT_INK: &str = "#666666";
pub(crate) const GRID: &str = "#e4e4e4";
pub(crate) const SPINE: &str = "#8a8a8a";
