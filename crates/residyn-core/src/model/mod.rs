//! Dynamics models: the file format, the library of effects, and the assembly of equations and effects into one program.

mod assemble;
mod bodies;
mod call;
pub mod check;
mod columns_in_file;
mod configuration;
mod drive;
mod dynamics;
mod effect;
mod effect_file;
mod effects_in_file;
mod error;
mod fade;
mod file;
mod filter;
mod fitted;
mod input_layout;
mod internal_state;
mod inverse_dynamics;
mod library;
mod like;
mod like_in_file;
mod limb;
mod logs_in_file;
mod measured_in_file;
mod network;
mod reader;
mod ready_drive;
mod residual;
mod saved;
mod sections;
mod shift;
mod system;
mod tables;
pub mod tree;
mod tree_in_file;
mod typeset;
mod values;
pub mod weights;
mod written;

#[cfg(test)]
pub(crate) use assemble::{elastic, loose, viscous};
pub use call::{Call, InputFile};
pub use configuration::{Configuration, InLog};
pub use dynamics::{Dynamics, Parameter, PerLogValue};
pub use effect::{
    ActsOn, AlikeOn, EFFECT_NAMES, Effect, EffectParameter, Entry, Hold, Logged, Measure, ShowsIn,
    Side,
};
pub use error::ModelError;
pub use filter::{CommandFilter, Filter};
pub use fitted::{FittedEffect, Status};
pub use input_layout::InputLayout;
pub use internal_state::{Dependence, InternalState, InternalStates};
pub use inverse_dynamics::InverseDynamics;
pub use library::Library;
pub use measured_in_file::MeasuredQuantity;
pub use network::to_f32;
pub use network::{
    Angles, InputScaling, LastLayer, LayerWeights, MlpSettings, MlpWeights, NetworkError,
    ResidualOn,
};
pub use reader::{FileError, FileRemedy};
pub use ready_drive::ReadyDrive;
pub use residual::nothing_but;
pub use residual::with_residual;
pub use saved::{ModelShape, ModelWeights, Origin, SavedModelError, SavedNetwork, SavedParameter};
pub use system::Model;
