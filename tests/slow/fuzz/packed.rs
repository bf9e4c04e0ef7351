//! Inputs within containers: the contents are edited, and the lengths and checksums around them are corrected.

use std::fs;
use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::seeds;
use crate::support::exported_models::CHECKPOINT;
use crate::support::paths::ours;

pub fn as_it_is(input: Vec<u8>, _: &mut ChaCha8Rng) -> Vec<u8> {
    input
}

/// With gzip, now and then repeated so often that it unpacks to a very large file.
pub fn gzip(input: Vec<u8>, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    for _ in 0..times(rng) {
        packer.write_all(&input).unwrap();
    }
    packer.finish().unwrap()
}

/// A NumPy array as the angles, next to a column of time.
pub fn npz(input: Vec<u8>, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let time = seeds::npy().swap_remove(2);
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: &str, array: &[u8], times: usize| {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        (0..times).for_each(|_| archive.write_all(array).unwrap());
    };
    add("time.npy", &time, 1);
    add("q.npy", &input, times(rng));
    archive.finish().unwrap().into_inner()
}

/// A description of tensors, beside numbers that rise whether they are read as whole or as broken ones, in 4 bytes or in 8:
/// those of positive numbers are in their order. Times must rise.
pub fn pt(input: Vec<u8>, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: &str, contents: &[u8], times: usize| {
        archive
            .start_file(name, SimpleFileOptions::default())
            .unwrap();
        (0..times).for_each(|_| archive.write_all(contents).unwrap());
    };
    add("run/data.pkl", &input, times(rng));
    let numbers: Vec<u8> = (0..400_u16)
        .flat_map(|k| (0.004 * f32::from(k)).to_le_bytes())
        .collect();
    for storage in ["run/data/0", "run/data/1", "run/data/2", "run/data/3"] {
        add(storage, &numbers, 1);
    }
    archive.finish().unwrap().into_inner()
}

/// A MATLAB file, each element packed as long as elements can be told apart.
pub fn mat(input: Vec<u8>, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let Some((header, mut rest)) = input.split_at_checked(128) else {
        return input;
    };
    let mut packed = header.to_vec();
    while let Some(&[_, _, _, _, ref length @ ..]) = rest.first_chunk::<8>() {
        let length = 8 + u32::from_le_bytes(*length) as usize;
        let (element, behind) = rest.split_at(length.min(rest.len()));
        let mut packer = ZlibEncoder::new(Vec::new(), Compression::fast());
        for _ in 0..times(rng) {
            packer.write_all(element).unwrap();
        }
        let element = packer.finish().unwrap();
        packed.extend([15, element.len() as u32].map(u32::to_le_bytes).concat());
        packed.extend(element);
        rest = behind;
    }
    packed
}

/// The description of tensors, before the numbers of a checkpoint.
pub fn tensors(input: Vec<u8>, _: &mut ChaCha8Rng) -> Vec<u8> {
    let file = fs::read(ours(CHECKPOINT).join("weights.safetensors")).unwrap();
    let numbers = &file[8 + seeds::tensors()[0].len()..];
    [
        &(input.len() as u64).to_le_bytes(),
        input.as_slice(),
        numbers,
    ]
    .concat()
}

/// A recording whose chunks have no checksums, so that damaged chunks are read.
pub fn mcap(mut input: Vec<u8>, _: &mut ChaCha8Rng) -> Vec<u8> {
    const MAGIC: usize = 8;
    const CHUNK: u8 = 6;
    let mut at = MAGIC;
    while let Some((&[kind, ref length @ ..], _)) =
        input.get(at..).and_then(<[u8]>::split_first_chunk::<9>)
    {
        let length = u64::from_le_bytes(*length);
        if kind == CHUNK
            && let Some(checksum) = input.get_mut(at + 33..at + 37)
        {
            checksum.fill(0);
        }
        at = usize::try_from(length)
            .ok()
            .and_then(|length| at.checked_add(9)?.checked_add(length))
            .unwrap_or(usize::MAX);
    }
    input
}

/// How often the contents are packed, one after the other.
fn times(rng: &mut ChaCha8Rng) -> usize {
    match rng.random_range(0..500) {
        0 => rng.random_range(1..1000),
        _ => 1,
    }
}
