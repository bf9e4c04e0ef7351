//! Adam's moments as a safetensors file: `prior.first`, `prior.second`, `residual.first` and `residual.second`,
//! f32 each.

use std::path::Path;

use safetensors::Dtype;

use super::manifest::Manifest;
use super::optimizer::Moments;
use crate::model::weights::{Entry, Reader, serialize};
use crate::model::{ModelWeights, SavedModelError};

const PARTS: [&str; 2] = ["prior", "residual"];

/// The bytes of the file.
pub(super) fn to_bytes(manifest: &Manifest, moments: &[Moments; 2]) -> Vec<u8> {
    let taken = (PARTS.iter().zip(moments)).filter(|(_, moments)| moments.steps > 0);
    let entries = taken.map(|(part, moments)| {
        let each = [("first", &moments.first), ("second", &moments.second)];
        each.map(|(which, values)| {
            Entry::of_f32(format!("{part}.{which}"), vec![values.len()], values)
        })
    });
    serialize(&manifest.shape, &entries.flatten().collect::<Vec<_>>())
}

/// Reads the file back; `manifest` says which moments it has, and `weights` their lengths.
pub(super) fn from_bytes(
    manifest: &Manifest,
    weights: &ModelWeights,
    bytes: &[u8],
    file: &str,
    dir: &Path,
) -> Result<[Moments; 2], SavedModelError> {
    let reader = Reader::new(bytes, file, dir)?;
    let of_prior = weights.prior.as_ref();
    let lengths = [
        of_prior.map_or(weights.parameters.len(), |prior| prior.flat().len()),
        weights.residual.as_ref().map_or(0, |r| r.flat().len()),
    ];
    let read = |k: usize| -> Result<Moments, SavedModelError> {
        let steps = manifest.optimizer_steps[k];
        #[allow(clippy::cast_possible_truncation)] // f32 in the file, widened by the reader
        let moment = |which: &str| -> Result<Vec<f32>, SavedModelError> {
            let name = format!("{}.{which}", PARTS[k]);
            let values = reader.read(&name, Dtype::F32, &[lengths[k]])?;
            Ok(values.into_iter().map(|value| value as f32).collect())
        };
        if steps == 0 {
            return Ok(Moments::default());
        }
        Ok(Moments {
            steps,
            first: moment("first")?,
            second: moment("second")?,
        })
    };
    Ok([read(0)?, read(1)?])
}
