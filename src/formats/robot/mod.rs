//! Shared by the formats of robot descriptions: XML with positions in the file, the tree of bodies, and the mechanism
//! with a model's equations.

pub(super) mod mechanism;
pub(super) mod tree;
pub(super) mod xml;
