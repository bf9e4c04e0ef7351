//! The whole model as two files: a JSON description with the equations as a list of operations, and all learnable
//! numbers as safetensors. Enough to rebuild the model elsewhere, or here.

mod client;
mod description;
mod import;

use std::path::Path;

pub use description::Description;
pub use import::{ImportError, Imported};

use super::verify::Client;
use super::{ExportError, ExportModel, File, Format};
use residyn_core::model::ModelShape;
use residyn_core::model::weights::to_bytes;

pub(super) const JSON: Format = Format {
    name: "json",
    about: "the whole model as a description, with its weights next to it as safetensors",
    extension: DESCRIPTION,
    not_carried: |_| Vec::new(),
    files: |model, path| pair(model, path, &path.with_extension(WEIGHTS)),
    client: Client::Own(client::predict),
    tolerance: 1e-12,
    robots: None,
};

pub(super) const SAFETENSORS: Format = Format {
    name: "safetensors",
    about: "weights, with the description of the whole model next to them as JSON",
    extension: WEIGHTS,
    files: |model, path| pair(model, &path.with_extension(DESCRIPTION), path),
    client: Client::Own(|path, samples| {
        client::predict(&path.with_extension(DESCRIPTION), samples)
    }),
    ..JSON
};

const DESCRIPTION: &str = "json";
const WEIGHTS: &str = "safetensors";

fn pair(model: &ExportModel, description: &Path, weights: &Path) -> Result<Vec<File>, ExportError> {
    if description == weights {
        let reason = format!(
            "both would be {}; choose a file name that ends in .{DESCRIPTION} or .{WEIGHTS}",
            description.display()
        );
        return Err(model.refused("a pair of files", reason));
    }
    let numbers = model.weights();
    let shape = ModelShape::of(
        model.name(),
        model.joints(),
        &model.equations.parameters,
        &numbers,
    );
    let bytes = to_bytes(&shape, &numbers);
    let name = weights.file_name().unwrap_or_default();
    let text = Description::of(model, shape, name.into());
    let mut json = serde_json::to_vec_pretty(&text).expect("a description is numbers and text");
    json.push(b'\n');
    Ok(vec![
        File::new(description, json, "description of the whole model"),
        File::new(weights, bytes, "parameters and weights"),
    ])
}
