use thiserror::Error;

use crate::data::Joint;

/// Why a model cannot be put together as asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// No effect has this name.
    #[error("unknown effect `{name}`{near}; `residyn list effects` shows all")]
    UnknownEffect {
        name: String,
        /// A similar known name, as the end of a sentence; empty without one.
        near: String,
    },
    /// No drive has this name.
    #[error("unknown drive `{name}`{near}; `residyn list drives` shows all")]
    UnknownDrive {
        name: String,
        /// A similar known name, as the end of a sentence; empty without one.
        near: String,
    },
    /// The effect acts only on a joint on the base that turns.
    #[error("`{effect}` acts on a joint on the base only, which must be revolute")]
    FirstJointOnly { effect: String },
    /// The effect repeats with each turn of its joint.
    #[error("`{effect}` acts on joints that turn only: it repeats with each turn")]
    TurningJointsOnly { effect: String },
    /// The effect acts only on the last joint of a limb of a tree of bodies.
    #[error("`{effect}` acts only on the last joint of a limb, in a model made of bodies")]
    LastJointOnly { effect: String },
    /// The effect acts only on two neighbouring joints of one kind.
    #[error("`{effect}` acts on two consecutive joints that are both revolute or both prismatic")]
    NeighboursOfOneKind { effect: String },
    /// The effect is part of the inertia, which the model does not give.
    #[error("`{effect}` needs a model that gives `mass` and `bias`; {model} gives accelerations")]
    NeedsMass { effect: String, model: String },
    /// The effect depends on a measured column that the model does not declare.
    #[error(
        "`{effect}` uses the measured column `{column}`, which the model file does not declare; add the table [measured] \
         with {column} = \"UNIT\", such as \"V\" or \"K\""
    )]
    NotMeasured { effect: String, column: String },
    /// Something that has no log runs a model that reads a measured column.
    #[error(
        "{model} reads the measured column `{column}` of logs, and {what} has no such column; put a parameter with its usual \
         value in its place, `fixed = true`, and remove it from [measured]"
    )]
    ReadsMeasured {
        model: String,
        column: String,
        what: &'static str,
    },
    /// Something that has no internal states runs a model with an effect that has some.
    #[error(
        "{effect} of {model} has states of its own, which {what} cannot have yet; put an effect without states in its place: \
         `residyn list effects` shows them"
    )]
    HasInternalStates {
        model: String,
        /// `presliding on joint 1`
        effect: String,
        what: &'static str,
    },
    /// The model already has this effect, or one that excludes it, on the joint.
    #[error("`{effect}` already acts on joint {joint}")]
    Twice { effect: String, joint: Joint },
    /// A parameter has a value outside its bounds.
    #[error("`{effect}`: {parameter} = {value} is outside {low} to {high}")]
    OutOfBounds {
        effect: String,
        parameter: String,
        value: f64,
        low: f64,
        high: f64,
    },
}
