//! Learnable numbers as a safetensors file: `parameters.NAME` (f64, in the parameter's unit),
//! `layers.K.weight` (f32, `[output, input]`) and `layers.K.bias` of the residual, the same under `prior.`
//! for a prior that is a network. PyTorch's linear layers have these names and this layout.

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use super::saved::{SavedModelError, SavedNetwork};
use super::{LayerWeights, MlpWeights, ModelShape, ModelWeights, to_f32};

/// A tensor on its way into a file.
pub(crate) struct Entry {
    name: String,
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Entry {
    /// A tensor of f32.
    pub(crate) fn of_f32(name: String, shape: Vec<usize>, values: &[f32]) -> Self {
        Self {
            name,
            dtype: Dtype::F32,
            shape,
            bytes: values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }
}

/// The bytes of the file.
pub fn to_bytes(shape: &ModelShape, weights: &ModelWeights) -> Vec<u8> {
    let mut entries: Vec<Entry> = (shape.parameters.iter().zip(&weights.parameters))
        .map(|(parameter, value)| Entry {
            name: format!("parameters.{}", parameter.name),
            dtype: Dtype::F64,
            shape: vec![1],
            bytes: value.to_le_bytes().to_vec(),
        })
        .collect();
    for (prefix, network) in [("prior.", &weights.prior), ("", &weights.residual)] {
        for (k, layer) in network.iter().flat_map(|n| n.layers.iter()).enumerate() {
            entries.extend(layer_entries(prefix, k, layer));
        }
    }
    serialize(shape, &entries)
}

/// The bytes of a file with these tensors.
pub(crate) fn serialize(shape: &ModelShape, entries: &[Entry]) -> Vec<u8> {
    let views = entries.iter().map(|entry| {
        let view = TensorView::new(entry.dtype, entry.shape.clone(), &entry.bytes)
            .expect("bytes are written for the shape");
        (entry.name.as_str(), view)
    });
    let about = HashMap::from([("system".to_owned(), shape.system.clone())]);
    safetensors::serialize(views, Some(about)).expect("names and shapes are plain")
}

/// In the precision of training.
fn layer_entries(prefix: &str, k: usize, layer: &LayerWeights) -> [Entry; 2] {
    let name = |part| format!("{prefix}layers.{k}.{part}");
    let weights = vec![layer.outputs, layer.inputs];
    [
        Entry::of_f32(name("weight"), weights, &to_f32(&layer.weight)),
        Entry::of_f32(name("bias"), vec![layer.outputs], &to_f32(&layer.bias)),
    ]
}

/// Read the file back; `shape` says what must be in it.
pub fn from_bytes(
    shape: &ModelShape,
    bytes: &[u8],
    file: &str,
    dir: &Path,
) -> Result<ModelWeights, SavedModelError> {
    let reader = Reader::new(bytes, file, dir)?;
    let parameters = (shape.parameters.iter())
        .map(|p| Ok(reader.read(&format!("parameters.{}", p.name), Dtype::F64, &[1])?[0]))
        .collect::<Result<_, SavedModelError>>()?;
    let network = |prefix: &str, saved: &Option<SavedNetwork>| {
        let saved = saved.as_ref();
        saved.map(|saved| reader.network(prefix, saved)).transpose()
    };
    Ok(ModelWeights {
        parameters,
        prior: network("prior.", &shape.prior)?,
        residual: network("", &shape.residual)?,
    })
}

/// A file of tensors, and its name for messages.
pub(crate) struct Reader<'a> {
    tensors: SafeTensors<'a>,
    file: &'a str,
    dir: &'a Path,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(
        bytes: &'a [u8],
        file: &'a str,
        dir: &'a Path,
    ) -> Result<Self, SavedModelError> {
        let tensors =
            SafeTensors::deserialize(bytes).map_err(|error| SavedModelError::Corrupt {
                file: file.to_owned(),
                reason: error.to_string(),
                dir: dir.to_owned(),
            })?;
        Ok(Self { tensors, file, dir })
    }

    fn network(&self, prefix: &str, saved: &SavedNetwork) -> Result<MlpWeights, SavedModelError> {
        let pairs = saved.widths.windows(2).enumerate();
        let layers = pairs.map(|(k, pair)| {
            let (inputs, outputs) = (pair[0], pair[1]);
            let name = |part| format!("{prefix}layers.{k}.{part}");
            Ok(LayerWeights {
                inputs,
                outputs,
                weight: self.read(&name("weight"), Dtype::F32, &[outputs, inputs])?,
                bias: self.read(&name("bias"), Dtype::F32, &[outputs])?,
            })
        });
        Ok(MlpWeights {
            angles: saved.angles,
            on: saved.on,
            scaling: saved.scaling.clone(),
            layers: layers.collect::<Result<_, SavedModelError>>()?,
        })
    }

    pub(crate) fn read(
        &self,
        name: &str,
        dtype: Dtype,
        shape: &[usize],
    ) -> Result<Vec<f64>, SavedModelError> {
        let corrupt = |reason| SavedModelError::Corrupt {
            file: self.file.to_owned(),
            reason,
            dir: self.dir.to_owned(),
        };
        let tensor = (self.tensors.tensor(name))
            .map_err(|_| corrupt(format!("there is no tensor `{name}`")))?;
        if tensor.dtype() != dtype {
            let found = tensor.dtype();
            return Err(corrupt(format!(
                "`{name}` is of type {found:?}, not {dtype:?}"
            )));
        }
        if tensor.shape() != shape {
            return Err(SavedModelError::Shape {
                tensor: name.to_owned(),
                file: self.file.to_owned(),
                expected: shape.to_vec(),
                found: tensor.shape().to_vec(),
                dir: self.dir.to_owned(),
            });
        }
        let values: Vec<f64> = match dtype {
            Dtype::F64 => chunks(tensor.data()).map(f64::from_le_bytes).collect(),
            _ => (chunks(tensor.data()).map(f32::from_le_bytes))
                .map(f64::from)
                .collect(),
        };
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(corrupt(format!("`{name}` holds {value}"))),
            None => Ok(values),
        }
    }
}

/// The bytes in groups of `N`; safetensors has checked that they come out even.
fn chunks<const N: usize>(bytes: &[u8]) -> impl Iterator<Item = [u8; N]> {
    bytes.as_chunks::<N>().0.iter().copied()
}
