//! Learning from episodes ([`mbrl`]), and the published experiments ([`experiment`]).

pub mod experiment;
pub mod mbrl;
