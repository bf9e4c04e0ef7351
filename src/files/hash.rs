/// A 64-bit hash of contents (FNV-1a), the same on every machine and in every version. It tells changed contents from
/// unchanged ones; it does not protect against forgery.
pub fn content_hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// [`content_hash`] as files record it: 16 hexadecimal digits.
pub fn content_id(bytes: &[u8]) -> String {
    format!("{:016x}", content_hash(bytes))
}

#[cfg(test)]
mod tests {
    use super::{content_hash, content_id};

    #[test]
    fn hashes_are_the_published_ones() {
        assert_eq!(content_hash(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(content_hash(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(content_id(b"foobar"), "85944171f73967e8");
    }
}
