//! Powers of ten, made by the compiler.

/// Least and largest power of ten that a number is multiplied by.
pub(super) const FIRST_POWER: i32 = -293;
const LAST_POWER: i32 = 324;

/// The leading 128 bits of the powers of ten, rounded up.
pub(super) static POWERS: [u128; (LAST_POWER - FIRST_POWER + 1) as usize] = powers();

/// Words of 64 bits for the largest of them.
const WORDS: usize = 13;

const fn powers() -> [u128; (LAST_POWER - FIRST_POWER + 1) as usize] {
    // Powers of five have the same leading bits. They are exact; their inverses times 2^832 are rounded
    // down, which their leading bits do not show.
    let mut powers = [0; (LAST_POWER - FIRST_POWER + 1) as usize];
    let mut power = [0_u64; WORDS];
    power[0] = 1;
    let mut k = 0;
    while k <= LAST_POWER {
        let (leading, is_exact) = leading_bits(&power);
        powers[(k - FIRST_POWER) as usize] = leading + !is_exact as u128;
        let (mut i, mut carry) = (0, 0);
        while i < WORDS {
            let product = power[i] as u128 * 5 + carry;
            (power[i], carry) = (product as u64, product >> 64);
            i += 1;
        }
        k += 1;
    }
    // 2^832 - 1 gives the same quotients as 2^832, which no power of five divides.
    let mut inverse = [u64::MAX; WORDS];
    let mut k = -1;
    while k >= FIRST_POWER {
        let (mut i, mut remainder) = (WORDS, 0);
        while i > 0 {
            i -= 1;
            let dividend = remainder << 64 | inverse[i] as u128;
            (inverse[i], remainder) = ((dividend / 5) as u64, dividend % 5);
        }
        powers[(k - FIRST_POWER) as usize] = leading_bits(&inverse).0 + 1;
        k -= 1;
    }
    powers
}

/// The leading 128 bits of a number, lowest words first, and whether there are no others.
const fn leading_bits(words: &[u64; WORDS]) -> (u128, bool) {
    let mut top = WORDS - 1;
    while words[top] == 0 {
        top -= 1;
    }
    // Three words hold them; the missing ones of a small number are zero.
    let mut leading = [0; 3];
    let mut is_exact = true;
    let mut i = 0;
    while i <= top {
        match i {
            0..=2 => leading[i] = words[top - i] as u128,
            _ => is_exact &= words[top - i] == 0,
        }
        i += 1;
    }
    let zeros = words[top].leading_zeros();
    let [first, second, third] = leading;
    let third = third << zeros;
    let bits = ((first << 64 | second) << zeros) | third >> 64;
    (bits, is_exact && third as u64 == 0)
}
