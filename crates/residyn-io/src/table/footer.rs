//! What the footer of a Parquet file claims, checked before the file's reader takes memory for it.
//!
//! The reader makes room for as many children as a group of the schema claims to have: up to 2^31 of 8 bytes each, for a
//! file of any size. It also counts through lists of booleans, which take no bytes. The rest it checks against the bytes
//! that are there.

#![warn(clippy::indexing_slicing)]

use std::fs::File;
use std::io::{self, Error, Read, Seek, SeekFrom};

/// The file's last bytes: the length of the description before them, and four letters.
const TAIL: u64 = 8;

/// Nested structures and lists.
const DEPTH: u8 = 64;
/// Booleans of a list; Parquet itself has no such list there.
const BOOLEANS: u64 = 1000;

/// The list of the schema's elements in the description, and the number of children in each element.
const SCHEMA: i64 = 2;
const CHILDREN: i64 = 5;

/// Types of Thrift's compact protocol.
const INTEGER: u8 = 5;
const LIST: u8 = 9;
const STRUCTURE: u8 = 12;

/// Leaves the file at its beginning. A file without a footer is for its reader to report.
///
/// # Errors
/// A description that is cut off or damaged, or whose groups have more children than there are elements.
pub(super) fn check(mut file: &File) -> io::Result<()> {
    if let Some(description) = description(file)? {
        Description(&description).check()?;
    }
    file.seek(SeekFrom::Start(0)).map(drop)
}

fn description(mut file: &File) -> io::Result<Option<Vec<u8>>> {
    let Some(tail) = file.metadata()?.len().checked_sub(TAIL) else {
        return Ok(None);
    };
    let mut length = [0; 4];
    file.seek(SeekFrom::Start(tail))?;
    file.read_exact(&mut length)?;
    let length = u32::from_le_bytes(length).into();
    let Some(start) = tail.checked_sub(length) else {
        return Ok(None);
    };
    let mut description = Vec::new();
    file.seek(SeekFrom::Start(start))?;
    file.take(length).read_to_end(&mut description)?;
    Ok(Some(description))
}

/// The bytes that are still to be read.
struct Description<'a>(&'a [u8]);

impl Description<'_> {
    fn check(&mut self) -> io::Result<()> {
        let (mut elements, mut children) = (0_u64, 0_u64);
        self.fields(|rest, field, kind| {
            if (field, kind) != (SCHEMA, LIST) {
                return rest.skip(kind, DEPTH);
            }
            let (size, kind) = rest.list()?;
            for _ in 0..size {
                elements += 1;
                let own = rest.children(kind)?;
                children = children.saturating_add(own);
            }
            Ok(())
        })?;
        // Every element but the first is the child of one other.
        match children >= elements.max(1) {
            true => Err(damaged(&format!(
                "its schema claims {children} columns and groups, and describes {elements}"
            ))),
            false => Ok(()),
        }
    }

    /// The number of children that an element of the schema claims.
    fn children(&mut self, kind: u8) -> io::Result<u64> {
        if kind != STRUCTURE {
            return self.skip(kind, DEPTH).map(|()| 0);
        }
        let mut children = 0;
        self.fields(|rest, field, kind| {
            if (field, kind) != (CHILDREN, INTEGER) {
                return rest.skip(kind, DEPTH);
            }
            // The reader refuses numbers below zero.
            children = u64::try_from(rest.signed()?).unwrap_or(0);
            Ok(())
        })?;
        Ok(children)
    }

    /// Reads a structure: `read` takes the value of each field, given its number and type.
    fn fields(
        &mut self,
        mut read: impl FnMut(&mut Self, i64, u8) -> io::Result<()>,
    ) -> io::Result<()> {
        let mut field = 0_i64;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            field = match head >> 4 {
                0 => self.signed()?,
                further => field.saturating_add(further.into()),
            };
            read(self, field, head & 15)?;
        }
    }

    fn skip(&mut self, kind: u8, depth: u8) -> io::Result<()> {
        let depth = depth.checked_sub(1).ok_or_else(|| damaged("too deep"))?;
        match kind {
            // A boolean's value is in its type.
            1 | 2 => Ok(()),
            3 => self.bytes(1),
            4..=6 => self.number().map(drop),
            7 => self.bytes(8),
            8 => {
                let length = self.number()?;
                self.bytes(length)
            }
            LIST | 10 => {
                let (size, kind) = self.list()?;
                self.values(size, &[kind], depth)
            }
            11 => match self.number()? {
                0 => Ok(()),
                size => {
                    let kinds = self.byte()?;
                    self.values(size, &[kinds >> 4, kinds & 15], depth)
                }
            },
            STRUCTURE => self.fields(|rest, _, kind| rest.skip(kind, depth)),
            13 => self.bytes(16),
            _ => Err(damaged("a value of an unknown type")),
        }
    }

    fn values(&mut self, size: u64, kinds: &[u8], depth: u8) -> io::Result<()> {
        let has_bytes = kinds.iter().any(|kind| !matches!(kind, 1 | 2));
        if !has_bytes && size > BOOLEANS {
            return Err(damaged("a list of too many booleans"));
        }
        for _ in 0..size {
            for kind in kinds {
                self.skip(*kind, depth)?;
            }
        }
        Ok(())
    }

    /// Length and type of a list.
    fn list(&mut self) -> io::Result<(u64, u8)> {
        let head = self.byte()?;
        let size = match head >> 4 {
            15 => self.number()?,
            size => size.into(),
        };
        Ok((size, head & 15))
    }

    fn byte(&mut self) -> io::Result<u8> {
        let (first, rest) = self.0.split_first().ok_or_else(cut_off)?;
        self.0 = rest;
        Ok(*first)
    }

    fn bytes(&mut self, count: u64) -> io::Result<()> {
        let count = usize::try_from(count).map_err(|_| cut_off())?;
        self.0 = self.0.get(count..).ok_or_else(cut_off)?;
        Ok(())
    }

    /// A whole number, seven bits per byte, the lowest first.
    fn number(&mut self) -> io::Result<u64> {
        let mut number = 0;
        for place in 0..10 {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(damaged("a number without an end"))
    }

    /// A number whose last bit is its sign.
    fn signed(&mut self) -> io::Result<i64> {
        let number = self.number()?;
        Ok((number >> 1).cast_signed() ^ -(number & 1).cast_signed())
    }
}

fn cut_off() -> Error {
    damaged("cut off")
}

fn damaged(why: &str) -> Error {
    Error::other(format!("its description is damaged: {why}"))
}

#[cfg(test)]
mod tests {
    use super::Description;

    /// Version 1, a schema of a group with `children` and one column, no rows and no groups of rows.
    fn description(children: &[u8]) -> Vec<u8> {
        let group = [&[0x48, 1, b'r', 0x15], children, &[0]].concat();
        let column = [0x15, 10, 0x38, 1, b'q', 0];
        let rest = [0x16, 0, 0x19, 0x0c, 0];
        [&[0x15, 2, 0x19, 0x2c], &group[..], &column, &rest].concat()
    }

    fn refused(bytes: &[u8]) -> String {
        Description(bytes).check().unwrap_err().to_string()
    }

    #[test]
    fn a_schema_with_more_children_than_elements_is_refused() {
        Description(&description(&[2])).check().unwrap();
        let said = refused(&description(&[0xfe, 0xff, 0xff, 0xff, 0x0f]));
        assert!(said.contains("claims 2147483647 columns and groups, and describes 2"));
        assert!(refused(&description(&[4])).contains("claims 2 columns"));
    }

    #[test]
    fn a_description_that_claims_more_than_it_has_is_refused() {
        let whole = description(&[2]);
        for length in 0..whole.len() {
            assert!(
                refused(whole.get(..length).unwrap()).contains("cut off"),
                "{length}"
            );
        }
        let many = [0x19, 0xfc, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert!(refused(&many).contains("cut off"));
        let many_booleans = [0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 0x07, 0];
        assert!(refused(&many_booleans).contains("too many booleans"));
        assert!(refused(&[0x1c; 100]).contains("too deep"));
        assert!(refused(&[0x1f, 0]).contains("unknown type"));
        assert!(refused(&[[0x15].as_slice(), &[0xff; 11]].concat()).contains("without an end"));
    }
}
