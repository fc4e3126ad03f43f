//! The fingerprint that links a modelDescription.xml to its binary and resources.

/// A GUID with braces: a hash of the text.
pub fn of(text: &str) -> String {
    let hash = format!("{:032x}", fnv1a_128(text.as_bytes()));
    let part = |range: std::ops::Range<usize>| &hash[range];
    format!(
        "{{{}-{}-{}-{}-{}}}",
        part(0..8),
        part(8..12),
        part(12..16),
        part(16..20),
        part(20..32)
    )
}

/// FNV-1a with 128 bits (G. Fowler, L. C. Noll, K.-P. Vo): a fingerprint against mix-ups, not against attacks.
fn fnv1a_128(bytes: &[u8]) -> u128 {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    bytes.iter().fold(OFFSET, |hash, &byte| {
        (hash ^ u128::from(byte)).wrapping_mul(PRIME)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_vectors() {
        // From the authors' test suite: the empty string and "foobar".
        assert_eq!(fnv1a_128(b""), 0x6c62272e07bb014262b821756295c58d);
        assert_eq!(fnv1a_128(b"foobar"), 0x343e1662793c64bf6f0d3597ba446f18);
    }
}
