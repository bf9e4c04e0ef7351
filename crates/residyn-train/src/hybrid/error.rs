use residyn_core::model::NetworkError;

/// Why a model cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HybridError {
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error(
        "the model of `{system}` has a motor behind a transmission, which would not know of an acceleration that a \
         residual network adds to its link; train the equations alone"
    )]
    Transmission { system: String },
    #[error(
        "parameter `{name}` has value {value}, scale {scale}, bounds {bounds:?}: training needs a \
         finite value, a finite scale above zero and the value within the bounds"
    )]
    Parameter {
        name: String,
        value: f64,
        scale: f64,
        bounds: [f64; 2],
    },
    #[error(
        "{found} parameters or networks of another shape were given to a model of `{system}`, which \
         has {expected} parameters"
    )]
    Weights {
        system: String,
        expected: usize,
        found: usize,
    },
}
