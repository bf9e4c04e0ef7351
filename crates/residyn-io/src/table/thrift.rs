//! Thrift's compact protocol, just enough to skip a Parquet file's metadata before its reader parses it: the reader
//! takes one step for each boolean of a list, for as many as the list claims, although they occupy no bytes.

use std::io::{self, Error, Read};

/// Nested structures and lists.
const DEPTH: u8 = 64;
/// Booleans of a list; Parquet itself has no such list where this looks.
const BOOLEANS: u64 = 1000;

/// Skips a structure.
///
/// # Errors
/// A structure that is cut off, too deep, or has too many booleans, and bytes that are not a structure.
pub(super) fn pass(bytes: &mut impl Read) -> io::Result<()> {
    value(bytes, 12, DEPTH)
}

fn value(bytes: &mut impl Read, kind: u8, depth: u8) -> io::Result<()> {
    let depth = depth.checked_sub(1).ok_or_else(|| damaged("too deep"))?;
    match kind {
        // A boolean's value is in its kind.
        1 | 2 => Ok(()),
        3 => skip(bytes, 1),
        4..=6 => whole(bytes).map(drop),
        7 => skip(bytes, 8),
        8 => {
            let length = whole(bytes)?;
            skip(bytes, length)
        }
        // Lists and sets.
        9 | 10 => {
            let head = byte(bytes)?;
            let size = match head >> 4 {
                15 => whole(bytes)?,
                size => size.into(),
            };
            values(bytes, size, &[head & 15], depth)
        }
        11 => match whole(bytes)? {
            0 => Ok(()),
            size => {
                let kinds = byte(bytes)?;
                values(bytes, size, &[kinds >> 4, kinds & 15], depth)
            }
        },
        12 => structure(bytes, depth),
        13 => skip(bytes, 16),
        _ => Err(damaged("of an unknown kind")),
    }
}

fn structure(bytes: &mut impl Read, depth: u8) -> io::Result<()> {
    loop {
        let head = byte(bytes)?;
        if head == 0 {
            return Ok(());
        }
        // The number of the field, if it is far from the one before.
        if head >> 4 == 0 {
            whole(bytes)?;
        }
        value(bytes, head & 15, depth)?;
    }
}

fn values(bytes: &mut impl Read, size: u64, kinds: &[u8], depth: u8) -> io::Result<()> {
    let has_bytes = kinds.iter().any(|kind| !matches!(kind, 1 | 2));
    if !has_bytes && size > BOOLEANS {
        return Err(damaged("a list of too many booleans"));
    }
    for _ in 0..size {
        for kind in kinds {
            value(bytes, *kind, depth)?;
        }
    }
    Ok(())
}

fn byte(bytes: &mut impl Read) -> io::Result<u8> {
    let mut byte = [0];
    bytes.read_exact(&mut byte)?;
    Ok(byte[0])
}

/// A whole number, seven bits per byte, the lowest first.
fn whole(bytes: &mut impl Read) -> io::Result<u64> {
    let mut number = 0;
    for place in 0..10 {
        let byte = byte(bytes)?;
        number |= u64::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            return Ok(number);
        }
    }
    Err(damaged("a number that does not end"))
}

fn skip(bytes: &mut impl Read, count: u64) -> io::Result<()> {
    match io::copy(&mut bytes.by_ref().take(count), &mut io::sink())? == count {
        true => Ok(()),
        false => Err(damaged("cut off")),
    }
}

fn damaged(why: &str) -> Error {
    Error::other(format!("its description is damaged: {why}"))
}

#[cfg(test)]
mod tests {
    use super::pass;

    #[test]
    fn what_claims_more_than_it_has_is_refused() {
        // Fields 1 (a whole number), 2 (a text) and 20 (a list of two booleans).
        let whole = [0x15, 0x80, 0x01, 0x18, 2, b'a', b'b', 0x09, 40, 0x21, 0];
        pass(&mut whole.as_slice()).unwrap();
        let refused = |bytes: &[u8]| pass(&mut &*bytes).unwrap_err().to_string();
        refused(&whole[..5]);
        let many = [0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert!(refused(&many).contains("too many booleans"));
        let of_both = [0x1b, 0xff, 0xff, 0xff, 0x07, 0x12, 0];
        assert!(refused(&of_both).contains("too many booleans"));
        assert!(refused(&[0x1c; 100]).contains("too deep"));
        assert!(refused(&[0x15; 1]).contains("fill whole buffer"));
        assert!(refused(&[0x1f, 0]).contains("unknown kind"));
        assert!(refused(&[[0x15].as_slice(), &[0xff; 11]].concat()).contains("does not end"));
    }
}
