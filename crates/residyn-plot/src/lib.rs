//! The report's figures, as SVG text.
//!
//! What a model predicts against what was measured ([`predictions`]), the force it leaves unexplained
//! ([`residual_shape`]), how far off it is ([`error_bars`], [`error_dots`] for many joints), and what a planner gains
//! with it as it learns ([`learning_curves`]). They take plain numbers and return a complete SVG document; the caller writes it. A
//! [`Role`] or a [`Method`] has the same colour and line in every figure.
//!
//! The documents carry no identifiers and no style sheets, so that several can stand in one HTML page, and name
//! only the generic font `sans-serif`.

mod axes;
mod canvas;
mod decimate;
mod error_bars;
mod error_dots;
mod learning;
mod legend;
mod predictions;
mod residual_shape;
mod scale;
mod style;

pub use axes::Quantity;
pub use decimate::bends;
pub use error_bars::{Bar, ErrorRow, error_bars};
pub use error_dots::error_dots;
pub use learning::{Course, LearningPanel, Method, MethodCurve, Spread, learning_curves};
pub use predictions::{Panel, Track, predictions};
pub use residual_shape::{ShapeCurve, ShapeModel, ShapePanel, ShapeSample, residual_shape};
pub use scale::Scale;
pub use style::Role;

use residyn_core::data::Joint;

/// A figure that was asked for without a single panel or row.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("figure {title:?} has nothing to show; give it at least one panel or row")]
pub struct PlotError {
    /// The title that the figure would have had.
    pub title: String,
}

/// How a joint moves: fixes the units on the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Turns: rad, rad/s, N m.
    Revolute,
    /// Slides: m, m/s, N.
    Prismatic,
}

impl JointKind {
    /// The kind of a joint that slides, or of one that turns.
    pub fn of(slides: bool) -> Self {
        match slides {
            true => Self::Prismatic,
            false => Self::Revolute,
        }
    }

    /// Unit of the joint's position.
    pub fn position_unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
        }
    }

    /// Unit of the joint's velocity.
    pub fn velocity_unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad/s",
            Self::Prismatic => "m/s",
        }
    }

    /// What the generalised force on the joint is called.
    pub fn force_name(self) -> &'static str {
        match self {
            Self::Revolute => "torque",
            Self::Prismatic => "force",
        }
    }

    /// Unit of the generalised force on the joint.
    pub fn force_unit(self) -> &'static str {
        match self {
            Self::Revolute => "N m",
            Self::Prismatic => "N",
        }
    }

    /// A joint's position along an axis.
    pub fn position(self, joint: Joint) -> Quantity {
        Quantity::new(format!("position q{joint}"), self.position_unit())
    }

    /// A joint's velocity along an axis.
    pub fn velocity(self, joint: Joint) -> Quantity {
        Quantity::new(format!("velocity qd{joint}"), self.velocity_unit())
    }

    /// The generalised force on a joint along an axis.
    pub fn force(self, joint: Joint) -> Quantity {
        let name = format!("{} tau{joint}", self.force_name());
        Quantity::new(name, self.force_unit())
    }
}

/// A relative frequency with its 95 % interval.
pub struct Share {
    pub what: String,
    pub share: f64,
    pub interval: [f64; 2],
}
