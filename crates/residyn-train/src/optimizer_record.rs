//! The state of an optimiser, as a Burn record (`optimizer.bpk`).

use std::collections::HashMap;

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::{ModuleOptimizer, OptimizerRecord};
use burn::tensor::{Bytes, Tensor};
use burn_pack::{Reader, Writer};

use super::packed::Packed;
use residyn_io::guarded;

/// The bytes of the record. Its tensors are sorted by name: an optimiser keeps them in an order that changes from run
/// to run, and the same run must give the same file.
pub(super) fn to_bytes(optimizer: &ModuleOptimizer) -> Vec<u8> {
    let ordered = || -> Result<Bytes, burn_pack::Error> {
        let bytes = optimizer.into_bytes();
        let reader = Reader::from_bytes(bytes.expect("a record in memory is written"))?;
        let (scalars, paths) = (reader.scalars().clone(), reader.metadata().clone());
        let mut writer = Writer::new(reader.into_tensors()?);
        for (name, value) in scalars {
            writer = writer.with_scalar(&name, value);
        }
        for (name, path) in paths {
            writer = writer.with_metadata(&name, &path);
        }
        writer.into_bytes()
    };
    ordered().expect("a record in memory is read back").to_vec()
}

/// The optimiser with the state recorded in a run with these numbers.
///
/// # Errors
/// What is wrong with bytes that are not such a record.
pub(super) fn from_bytes(
    optimizer: ModuleOptimizer,
    bytes: &[u8],
    numbers: &Packed,
) -> Result<ModuleOptimizer, String> {
    check(bytes, numbers)?;
    // Burn assumes that a record belongs to the optimiser.
    let read = || {
        let record = OptimizerRecord::from_bytes(Bytes::from_bytes_vec(bytes.to_vec()));
        record.map(|record| optimizer.load_record(record))
    };
    match guarded(read) {
        Some(read) => read.map_err(|error| error.to_string()),
        None => Err("it is of another optimiser".to_owned()),
    }
}

/// Check that every tensor of a record has the shape of the tensor that it belongs to.
fn check(bytes: &[u8], numbers: &Packed) -> Result<(), String> {
    let mut shapes = Shapes::default();
    numbers.visit(&mut shapes);
    let reader = Reader::from_bytes(Bytes::from_bytes_vec(bytes.to_vec()));
    let tensors = reader.and_then(Reader::into_tensors);
    for tensor in tensors.map_err(|error| error.to_string())? {
        let (name, _, shape, id, _) = tensor.into_parts().map_err(|error| error.to_string())?;
        let known = id.and_then(|id| shapes.0.get(&id));
        if known.is_none_or(|known| **known != *shape) {
            return Err(format!("its tensor `{name}` is of another model"));
        }
    }
    Ok(())
}

/// The shape of each tensor, by its identifier.
#[derive(Default)]
struct Shapes(HashMap<u64, Vec<usize>>);

impl ModuleVisitor for Shapes {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        self.0.insert(param.id.val(), param.dims().to_vec());
    }
}
