//! Shared by the robot description formats: XML elements, the tree of bodies, and the mechanism with a model's
//! equations.

pub(super) mod edit;
pub(super) mod element;
pub(super) mod mechanism;
pub(super) mod powertrain;
mod servo;
pub(super) mod tree;
pub(super) mod write_back;

use residyn_core::model::Parameter;

/// The value of the parameter with this name.
fn value(parameters: &[Parameter], name: &str) -> Option<f64> {
    let mut parameters = parameters.iter();
    let own = parameters.find(|parameter| parameter.name == name);
    own.map(|parameter| parameter.value)
}
