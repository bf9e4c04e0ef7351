//! HDF5, as h5py, recorders of demonstrations and MATLAB's version 7.3 write it: arrays of numbers in groups. An array goes
//! by the last part of its path, and a path such as `run.hdf5#demo_3` by the groups that it is read from.

use std::collections::HashSet;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use hdf5_reader::group::Group;
use hdf5_reader::{Attribute, Dataset, Datatype, Hdf5File, OpenOptions};

use super::arrays::Unpacked;
use super::channels::{Channels, JOINTS, is_channel};
use super::npy::Array;
use crate::files;
use residyn_core::data::{Arrays, LogError};
use residyn_core::limits::{LOG_COLUMNS, unpacked_bytes};

/// How these files begin, as they are and with what MATLAB writes before them.
pub(super) const BEGIN: [&[u8]; 2] = [b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3"];

/// Groups that are named when several hold the same array.
const NAMED: usize = 3;

/// A file, and the groups in it that a path names.
pub(super) struct Part {
    file: PathBuf,
    /// Parts of the paths that the arrays are below.
    groups: Vec<String>,
}

impl Part {
    /// `FILE#GROUP`; `None` for any other path.
    pub fn of(path: &Path) -> Option<Self> {
        let (file, groups) = path.file_name()?.to_str()?.split_once('#')?;
        let file = path.with_file_name(file);
        let is_part = !path.exists() && file.is_file();
        is_part.then(|| Self {
            file,
            groups: groups.split('#').map(str::to_owned).collect(),
        })
    }

    /// The arrays in the groups.
    ///
    /// # Errors
    /// As [`read`], and groups that the file does not have.
    pub fn read(&self) -> Result<Arrays, LogError> {
        table(&self.file, &self.groups).map_err(|fault| LogError::form(&self.file, fault))
    }
}

/// # Errors
/// A file that cannot be read, that has the same channel in several groups, and arrays that cannot be columns.
pub(super) fn read(path: &Path) -> Result<Arrays, LogError> {
    table(path, &[]).map_err(|fault| LogError::form(path, fault))
}

fn table(path: &Path, groups: &[String]) -> Result<Arrays, String> {
    let packed = files::size(path).map_err(damaged)?;
    let largest = usize::try_from(unpacked_bytes(packed)).unwrap_or(usize::MAX);
    let options = OpenOptions::default()
        .with_chunk_cache_bytes(0)
        .with_max_chunk_bytes(largest)
        .with_max_read_bytes(largest);
    let file = Hdf5File::open_with_options(path, options).map_err(damaged)?;
    let root = file.root_group().map_err(damaged)?;
    let values = values(&root)?;
    let mut found = Found::in_group(root)?;
    found.keep(groups)?;
    if let Some(several) = found.several(path, groups) {
        return Err(several);
    }
    let channels = found.channels()?;
    let mut unpacked = Unpacked::of(packed);
    unpacked.table.values = values;
    for (name, array) in channels.names.iter().zip(&found.arrays) {
        add(&mut unpacked, &channels, name, &array.dataset)?;
    }
    unpacked.table.notes.extend(channels.note());
    Ok(unpacked.table.on_one_clock())
}

/// The attributes of the file that are single numbers.
fn values(root: &Group) -> Result<Vec<(String, f64)>, String> {
    let attributes = root.attributes().map_err(damaged)?;
    let number = |attribute: &Attribute| {
        let is_single = attribute.num_elements().ok()? == 1;
        let value = attribute.read_as_f64().ok().filter(|_| is_single)?;
        Some((attribute.name.clone(), value))
    };
    Ok(attributes.iter().filter_map(number).collect())
}

/// An array in a file.
struct Stored {
    /// Its names: those of the groups, and its own.
    path: Vec<String>,
    dataset: Dataset,
}

impl Stored {
    fn name(&self) -> &str {
        self.path.last().map_or("", String::as_str)
    }
}

/// What a file holds.
struct Found {
    arrays: Vec<Stored>,
    /// Names of the joints, as an attribute of the root.
    joints: Vec<String>,
}

impl Found {
    /// Every array below a group, each group once: links may form circles.
    fn in_group(root: Group) -> Result<Self, String> {
        let attribute = |name: &&str| root.attribute(name).ok()?.read_strings().ok();
        let joints = JOINTS.iter().find_map(attribute).unwrap_or_default();
        let mut arrays = Vec::new();
        let mut seen = HashSet::from([root.address()]);
        let mut left = vec![(Vec::new(), root)];
        while let Some((path, group)) = left.pop() {
            let below = |name: &str| [path.as_slice(), &[name.to_owned()]].concat();
            let (groups, datasets) = group.members().map_err(damaged)?;
            // MATLAB keeps what its cells refer to in `#refs#`.
            let groups = (groups.into_iter()).filter(|group| !group.name().starts_with('#'));
            left.extend(
                groups
                    .filter(|group| seen.insert(group.address()))
                    .map(|group| (below(group.name()), group)),
            );
            arrays.extend(datasets.into_iter().map(|dataset| Stored {
                path: below(dataset.name()),
                dataset,
            }));
        }
        arrays.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(Self { arrays, joints })
    }

    /// Drops the arrays that are not in all of these groups.
    ///
    /// # Errors
    /// No array is left.
    fn keep(&mut self, groups: &[String]) -> Result<(), String> {
        let is_below = |array: &Stored| groups.iter().all(|group| array.path.contains(group));
        self.arrays.retain(is_below);
        match self.arrays.is_empty() {
            false => Ok(()),
            true if groups.is_empty() => Err("holds no arrays".to_owned()),
            true => Err(format!("has no arrays in {:?}", groups.join("#"))),
        }
    }

    /// What to do about a channel that is in several groups.
    fn several(&self, path: &Path, groups: &[String]) -> Option<String> {
        let (first, name) = self.arrays.iter().find_map(|array| {
            let name = array.name();
            let is_other = |other: &&Stored| other.name() == name && other.path != array.path;
            let other = self.arrays.iter().find(is_other)?;
            let mut pairs = array.path.iter().zip(&other.path);
            let at = pairs.position(|(one, other)| one != other)?;
            is_channel(name).then_some((at, name))
        })?;
        let of_channel = self.arrays.iter().filter(|array| array.name() == name);
        let mut parts: Vec<&str> = of_channel
            .filter_map(|array| array.path.get(first).map(String::as_str))
            .collect();
        parts.dedup();
        let shown = parts[..parts.len().min(NAMED)].join(", ");
        let more = match parts.len() > NAMED {
            true => format!(" and {} more", parts.len() - NAMED),
            false => String::new(),
        };
        let chosen = [
            &[path.display().to_string()],
            groups,
            &[parts[0].to_owned()],
        ]
        .concat();
        Some(format!(
            "has several arrays {name:?}, in {shown}{more}; name one: {:?}",
            chosen.join("#")
        ))
    }

    /// The names of the arrays and the joints: an array goes by the last part of its path if no other does.
    fn channels(&self) -> Result<Channels, String> {
        let is_alone = |name: &str| self.arrays.iter().filter(|a| a.name() == name).count() == 1;
        let name = |array: &Stored| match is_alone(array.name()) {
            true => array.name().to_owned(),
            false => array.path.join("/"),
        };
        let mut joints = self.joints.clone();
        let listed = |name: &&str| self.arrays.iter().find(|array| array.name() == *name);
        if let Some(array) = JOINTS.iter().find_map(listed) {
            let count = array.dataset.num_elements().map_err(damaged)?;
            if count <= LOG_COLUMNS as u64 {
                joints = array.dataset.read_strings().map_err(damaged)?;
            }
        }
        Ok(Channels {
            names: self.arrays.iter().map(name).collect(),
            joints,
        })
    }
}

/// The columns of an array of numbers. MATLAB has no vectors, and writes its matrices by columns, with their sizes in
/// reverse.
fn add(
    unpacked: &mut Unpacked,
    channels: &Channels,
    name: &str,
    dataset: &Dataset,
) -> Result<(), String> {
    let class = dataset.attribute("MATLAB_class").ok();
    let class = class.and_then(|class| class.read_string().ok());
    let is_empty = class.is_some() && dataset.attribute("MATLAB_empty").is_ok();
    let is_left_out = is_empty || class.as_deref() == Some("char");
    let Some(kind) = kind(dataset.dtype()).filter(|_| !is_left_out) else {
        return Ok(());
    };
    let shape: Option<Vec<usize>> = (dataset.shape().iter())
        .map(|size| usize::try_from(*size).ok())
        .collect();
    let mut shape = shape.ok_or("is damaged: an array is larger than any memory")?;
    if class.is_some() {
        shape.reverse();
        if let [1, length] | [length, 1] = *shape.as_slice() {
            shape = vec![length];
        }
    }
    if !channels.takes(name, &shape)? {
        return Ok(());
    }
    unpacked.take(dataset.raw_byte_len().map_err(damaged)? as u64)?;
    let numbers = dataset.read_native_bytes().map_err(damaged)?;
    let array = Array {
        kind: kind.to_owned(),
        by_columns: class.is_some(),
        shape,
        numbers: Cursor::new(numbers),
    };
    channels.add(unpacked, name, array)
}

/// The name that NumPy gives to numbers of this kind; `None` if they are no numbers.
fn kind(stored: &Datatype) -> Option<&'static str> {
    Some(match stored {
        Datatype::FloatingPoint { size: 8, .. } => "<f8",
        Datatype::FloatingPoint { size: 4, .. } => "<f4",
        Datatype::FloatingPoint { .. } => "float16",
        Datatype::FixedPoint { size, signed, .. } => match (size, signed) {
            (1, true) => "|i1",
            (1, false) => "|u1",
            (2, true) => "<i2",
            (2, false) => "<u2",
            (4, true) => "<i4",
            (4, false) => "<u4",
            (8, true) => "<i8",
            (8, false) => "<u8",
            _ => return None,
        },
        // As h5py keeps truth values.
        Datatype::Enum { base, .. } => return kind(base),
        _ => return None,
    })
}

fn damaged(why: impl std::fmt::Display) -> String {
    format!("is not a complete HDF5 file: {why}; write it again")
}
