use std::io;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::open;

/// A 64-bit hash of contents (FNV-1a), the same on every machine and in every version. It distinguishes changed from
/// unchanged contents; it does not protect against forgery.
pub fn content_hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// [`content_hash`] as files record it: 16 hexadecimal digits.
pub fn content_id(bytes: &[u8]) -> String {
    format!("{:016x}", content_hash(bytes))
}

/// The SHA-256 of contents in hexadecimal digits, as `sha256sum` prints it, so that others can find the file that was
/// read.
pub fn sha256(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}

/// [`sha256`] of a file, however large it is.
///
/// # Errors
/// A file that cannot be read.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    io::copy(&mut open(path)?, &mut hash)?;
    Ok(format!("{:x}", hash.finalize()))
}

#[cfg(test)]
mod tests {
    use super::{content_hash, content_id, sha256};

    #[test]
    fn hashes_are_the_published_ones() {
        assert_eq!(content_hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(content_hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(content_id(b"foobar"), "85944171f73967e8");
        assert_eq!(
            sha256(b"abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
