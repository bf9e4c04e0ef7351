use std::fmt;
use std::str::FromStr;

use burn::tensor::Device;

use super::TrainError;

/// The device of tensor operations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backend {
    /// The processor: Burn's backend on the crate `ndarray`.
    #[default]
    NdArray,
    /// An NVIDIA graphics card. Pays off only for very large batches.
    #[cfg(feature = "cuda")]
    Cuda,
}

impl Backend {
    /// Every backend in this build.
    pub const ALL: &[Self] = &[
        Self::NdArray,
        #[cfg(feature = "cuda")]
        Self::Cuda,
    ];

    /// Its name in settings and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::NdArray => "ndarray",
            #[cfg(feature = "cuda")]
            Self::Cuda => "cuda",
        }
    }

    /// The device, with gradients switched on.
    pub fn device(self) -> Device {
        let device = match self {
            // Deprecated upstream in favour of burn-flex, which doubles the build time and trains no faster: the
            // fused loss does the work on either.
            #[allow(deprecated)]
            Self::NdArray => Device::ndarray(),
            #[cfg(feature = "cuda")]
            Self::Cuda => Device::cuda(burn::tensor::DeviceIndex::Default),
        };
        device.autodiff()
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Backend {
    type Err = TrainError;

    fn from_str(name: &str) -> Result<Self, TrainError> {
        let found = Self::ALL.iter().find(|backend| backend.name() == name);
        found.copied().ok_or_else(|| TrainError::Device {
            name: name.to_owned(),
            known: Self::ALL
                .iter()
                .map(|b| b.name())
                .collect::<Vec<_>>()
                .join(", "),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Backend;

    #[test]
    fn names_are_read_back_and_others_refused() {
        for backend in Backend::ALL {
            assert_eq!(backend.name().parse::<Backend>().unwrap(), *backend);
        }
        let message = "gpu".parse::<Backend>().unwrap_err().to_string();
        assert!(
            message.starts_with("no device `gpu`; this build has ndarray"),
            "{message}"
        );
    }
}
