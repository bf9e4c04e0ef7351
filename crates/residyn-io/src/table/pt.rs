//! PyTorch's `.pt`: a dictionary of tensors as `torch.save` writes it, in the names that PACE, legged_gym and Isaac Lab
//! give them. It is a pickle, and loading one runs what it names: `pytorch-reader` runs nothing and builds only
//! dictionaries, lists, numbers, texts and tensors.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use pytorch_reader::{DType, PickleValue, PytorchError, PytorchReader, Tensor};

use super::archive;
use super::arrays::Unpacked;
use super::channels::{Channels, JOINTS, is_channel};
use super::npy::Array;
use crate::files;
use residyn_core::data::{Arrays, LogError};

/// The file in the archive that describes the tensors.
pub(super) const DESCRIPTION: &str = "data.pkl";

/// Memory that a byte of the description may become: one that stands for an object \[bytes\].
const OBJECT: u64 = 128;

/// # Errors
/// A file that cannot be read, one that holds other objects than tensors, and tensors that are not of numbers.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    let packed = files::size(path).map_err(LogError::open(path))?;
    table(path, packed).map_err(|fault| LogError::form(path, fault))
}

fn table(path: &Path, packed: u64) -> Result<Arrays, String> {
    let mut unpacked = Unpacked::of(packed);
    let description = archive::size_of(path, DESCRIPTION).unwrap_or(0);
    unpacked.take(description.saturating_mul(OBJECT))?;
    let entries = PytorchReader::read_pickle_data(path, None).map_err(broken)?;
    let PickleValue::Dict(entries) = entries else {
        return Err("holds no dictionary; save one of tensors, `torch.save({\"time\": time, \"dof_pos\": q, ..}, path)`".to_owned());
    };
    unpacked.table.notes.extend(left_out(&entries)?);
    unpacked.table.values = values(&entries);
    let mut tensors: Vec<Tensor> = PytorchReader::new(path)
        .map_err(broken)?
        .into_tensors()
        .into_values()
        .collect();
    tensors.sort_by(|a, b| a.name.cmp(&b.name));
    let channels = Channels {
        names: tensors.iter().map(|tensor| tensor.name.clone()).collect(),
        joints: joints(&entries),
    };
    for tensor in tensors {
        add(&mut unpacked, &channels, &tensor)?;
    }
    unpacked.table.notes.extend(channels.note());
    Ok(unpacked.table.on_one_clock())
}

/// The columns of a tensor of numbers.
fn add(unpacked: &mut Unpacked, channels: &Channels, tensor: &Tensor) -> Result<(), String> {
    let (name, shape) = (&tensor.name, tensor.shape());
    if !channels.takes(name, shape)? {
        return Ok(());
    }
    unpacked.take(tensor.byte_len() as u64)?;
    let numbers = tensor.read().map_err(|why| damaged(&why))?;
    let array = Array {
        kind: kind(tensor.dtype()).to_owned(),
        by_columns: false,
        shape: shape.to_vec(),
        numbers: Cursor::new(numbers),
    };
    channels.add(unpacked, name, array)
}

/// The entries that are plain numbers.
#[allow(clippy::cast_precision_loss)] // whole numbers beyond 2^53 are no values of parameters
fn values(entries: &HashMap<String, PickleValue>) -> Vec<(String, f64)> {
    let number = |(name, value): (&String, &PickleValue)| match value {
        PickleValue::Int(value) => Some((name.clone(), *value as f64)),
        PickleValue::Float(value) => Some((name.clone(), *value)),
        _ => None,
    };
    let mut values: Vec<(String, f64)> = entries.iter().filter_map(number).collect();
    values.sort_by(|a, b| a.0.cmp(&b.0));
    values
}

/// The names of the joints; none if the file gives none.
fn joints(entries: &HashMap<String, PickleValue>) -> Vec<String> {
    let names = JOINTS.iter().find_map(|name| match entries.get(*name) {
        Some(PickleValue::List(names)) => Some(names.as_slice()),
        _ => None,
    });
    let text = |name: &PickleValue| match name {
        PickleValue::String(name) => Some(name.clone()),
        _ => None,
    };
    let names: Option<Vec<String>> = names.unwrap_or_default().iter().map(text).collect();
    names.unwrap_or_default()
}

/// Notes on numbers of NumPy, which are not read.
///
/// # Errors
/// A channel that is one of these, and any other object: only its name is known, since to build it is to run code.
fn left_out(entries: &HashMap<String, PickleValue>) -> Result<Vec<String>, String> {
    let mut found: Vec<(&String, &str)> = entries
        .iter()
        .filter_map(|(name, value)| Some((name, foreign(value)?)))
        .collect();
    found.sort_unstable();
    let note = |(name, kind): (&String, &str)| match kind.starts_with("numpy.") && !is_channel(name)
    {
        true => Ok(format!(
            "{name:?} is left out: it is not a tensor, but {kind}"
        )),
        false => Err(format!(
            "entry {name:?} holds a pickled object, {kind}, which is never built, since that can run any code; save \
                 tensors, such as torch.as_tensor(values)"
        )),
    };
    found.into_iter().map(note).collect()
}

/// The Python type of an object in a value that is neither plain data nor PyTorch's own.
fn foreign(value: &PickleValue) -> Option<&str> {
    match value {
        PickleValue::Unsupported(kind) => {
            Some(kind.as_str()).filter(|kind| !kind.starts_with("torch.") && *kind != "int")
        }
        PickleValue::List(values) => values.iter().find_map(foreign),
        PickleValue::Dict(values) => values.values().find_map(foreign),
        _ => None,
    }
}

/// The name that NumPy gives to numbers of this kind.
fn kind(numbers: DType) -> &'static str {
    match numbers {
        DType::F64 => "<f8",
        DType::F32 => "<f4",
        DType::F16 => "<f2",
        DType::BF16 => "bfloat16",
        DType::I64 => "<i8",
        DType::I32 => "<i4",
        DType::I16 => "<i2",
        DType::I8 => "|i1",
        DType::U64 => "<u8",
        DType::U32 => "<u4",
        DType::U16 => "<u2",
        DType::U8 => "|u1",
        DType::Bool => "|b1",
    }
}

fn broken(why: PytorchError) -> String {
    damaged(&why)
}

fn damaged(why: &dyn std::fmt::Display) -> String {
    format!("is not a dictionary of tensors as torch.save writes it: {why}; write it again")
}
