use thiserror::Error;

/// Why no rig can be drawn by the rules of a grid.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum DrawError {
    /// A number is a multiple of an unknown scale.
    #[error("no scale `{0}`")]
    NoScale(String),
    /// A number of an effect cannot be drawn.
    #[error("`{effect}`: `{parameter}`: {why}")]
    Number {
        effect: String,
        parameter: String,
        why: Box<DrawError>,
    },
    #[error("the rules leave no effect to draw")]
    NothingLeft,
    #[error("`filter_s` needs a number")]
    NoFilter,
    #[error("the true value of `{0}` is not known")]
    NoTrueValue(String),
}
