//! What formats that describe robots have in common: XML with places, a tree of bodies, and the mechanism that has a
//! model's equations.

pub(super) mod mechanism;
pub(super) mod tree;
pub(super) mod xml;
