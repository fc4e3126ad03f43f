//! The shortest decimals that read back as the same `f64`, and of these the closest.
//!
//! Writing results takes longer than stepping fast FMUs, and most numbers in results have 16 or 17 digits.
//! Several numbers go through each part of the work together, and digits are made in registers and not read
//! back from where they were written, so that the processor need not end one number before the next.

mod powers;
#[cfg(test)]
mod tests;

use self::powers::{FIRST_POWER, POWERS};
use std::hint::select_unpredictable;

/// Bytes that a number and what follows it take at most: `-1.2345678901234567e-300,`.
pub(super) const LONGEST: usize = 25;

/// Bytes behind the last number that are written to and do not count.
pub(super) const SLACK: usize = 40;

/// Numbers that are worked on together.
const TOGETHER: usize = 8;

/// Writes rows of so many numbers, with commas between them and line ends behind each row; how long that is.
/// Whole numbers are without a point, numbers below 1e-5 and from 1e16 on have an exponent; then there are
/// `NaN`, `inf` and `-inf`.
///
/// # Panics
/// If there are not [`LONGEST`] bytes for each number and [`SLACK`] more.
pub(super) fn put_rows(room: &mut [u8], numbers: &[f64], columns: usize) -> usize {
    let (mut at, mut left) = (0, columns);
    for numbers in numbers.chunks(TOGETHER) {
        let mut decimals = [Decimal::default(); TOGETHER];
        for (decimal, &number) in decimals.iter_mut().zip(numbers) {
            *decimal = Decimal::of(number);
        }
        let texts = texts(&decimals);
        for ((text, decimal), &number) in texts.iter().zip(&decimals).zip(numbers) {
            let room = &mut room[at..at + SLACK];
            let end = put(room, number, decimal, *text);
            left -= 1;
            room[end] = if left == 0 { b'\n' } else { b',' };
            left = if left == 0 { columns } else { left };
            at += end + 1;
        }
    }
    at
}

#[inline(always)]
fn put(room: &mut [u8], number: f64, decimal: &Decimal, text: u128) -> usize {
    if decimal.first == 0 {
        return put_special(room, number);
    }
    let sign = usize::from(number.is_sign_negative());
    room[0] = b'-';
    sign + put_digits(&mut room[sign..], decimal.first, text, decimal.power)
}

#[cold]
fn put_special(room: &mut [u8], number: f64) -> usize {
    let word: &[u8] = match number {
        f64::INFINITY => b"inf",
        f64::NEG_INFINITY => b"-inf",
        _ if number.is_nan() => b"NaN",
        _ if number.is_sign_negative() => b"-0",
        _ => b"0",
    };
    room[..word.len()].copy_from_slice(word);
    word.len()
}

/// A magnitude of seventeen digits, zeros at their end included.
#[derive(Clone, Copy, Default)]
struct Decimal {
    /// The first digit; 0 of what has none. Its power of ten.
    first: u8,
    power: i32,
    /// Eight digits each.
    rest: [u32; 2],
}

impl Decimal {
    #[inline(always)]
    fn of(number: f64) -> Self {
        let bits = number.to_bits();
        let (exponent, fraction) = ((bits >> 52) as i32 & 0x7ff, bits & (HIDDEN - 1));
        // Zero, subnormal numbers, powers of two, infinity, what is not a number.
        if fraction == 0 || exponent == 0 || exponent == 0x7ff {
            return Self::of_rare(exponent, fraction);
        }
        let (c, q) = (fraction | HIDDEN, exponent - 1075);
        let (digits, k, is_open) = quickly(c, q);
        match is_open {
            false => Self::normalized(digits, k),
            true => Self::exactly(c, q, false),
        }
    }

    #[cold]
    #[inline(never)]
    fn of_rare(exponent: i32, fraction: u64) -> Self {
        match (exponent, fraction) {
            (0x7ff, _) | (0, 0) => Self::default(),
            (0, _) => Self::exactly(fraction, -1074, false),
            _ => Self::exactly(
                fraction | HIDDEN,
                exponent - 1075,
                fraction == 0 && exponent > 1,
            ),
        }
    }

    #[cold]
    #[inline(never)]
    fn exactly(c: u64, q: i32, is_at_power: bool) -> Self {
        let (mut digits, mut k) = shortest(c, q, is_at_power);
        // Subnormal numbers have fewer digits.
        while digits < 10_u64.pow(15) {
            (digits, k) = (10 * digits, k - 1);
        }
        Self::normalized(digits, k)
    }

    /// Of `digits 10^k` with sixteen or seventeen digits.
    #[inline(always)]
    fn normalized(digits: u64, k: i32) -> Self {
        const SIXTEEN: u64 = 10_u64.pow(16);
        const EIGHT: u64 = 10_u64.pow(8);
        let is_short = digits < SIXTEEN;
        let digits = select_unpredictable(is_short, 10 * digits, digits);
        let rest = digits % SIXTEEN;
        Self {
            first: (digits / SIXTEEN) as u8,
            power: k + 16 - i32::from(is_short),
            rest: [(rest / EIGHT) as u32, (rest % EIGHT) as u32],
        }
    }
}

/// The leading bit of a normal number's significand, which is not stored.
const HIDDEN: u64 = 1 << 52;

/// As [`shortest`] of a number that is no power of two, unless 64 bits behind the point leave it open.
///
/// The power of ten is chosen so that `c 2^q` in its unit is a whole number of 15 or 16 digits and a
/// fraction, and half of the distance to the next `f64` is between 0.05 and 0.5 of the unit. If a whole
/// number is that near, it is the shortest; else one digit more is, and the closest is near enough. The last
/// of what is returned tells whether it is left open.
#[inline(always)]
fn quickly(c: u64, q: i32) -> (u64, i32, bool) {
    let k = log10_of_power_of_2(q);
    let power = POWERS[(-k - 1 - FIRST_POWER) as usize];
    // 2^q in that unit is the power's leading bits, as a fraction, halved 0 to 3 times.
    let halvings = (-1 - q - log2_of_power_of_10(-k - 1)) as u32;
    let product = wide_product(power, c << (4 - halvings));
    let whole = (product >> 68) as u64;
    let fraction = (product >> 4) as u64;
    let half = (power >> 64) as u64 >> (1 + halvings);
    // Fraction and half are too small by less than 1, or too large by less than a tenth, since the power is
    // rounded up.
    let (above, is_up) = fraction.overflowing_add(half);
    let is_down = fraction < half;
    let tenths = u128::from(fraction) * 10 + (1 << 63);
    let (digit, rest) = ((tenths >> 64) as u64, tenths as u64);
    let is_open = above.wrapping_add(3) < 6 || fraction.wrapping_sub(half).wrapping_add(3) < 6;
    let is_short = is_up || is_down;
    let is_open = is_open || !is_short && rest.wrapping_add(20) < 40;
    let digit = select_unpredictable(is_short, 10 * u64::from(is_up), digit);
    (10 * whole + digit, k, is_open)
}

/// The decimal `d` and the power `k` of the shortest `d 10^k` that rounds to `c 2^q`: R. Giulietti, "The
/// Schubfach way to render doubles" (2020), with powers of ten of 128 bits instead of 126. `is_at_power`: below
/// this number, the next one is only half as far as above.
fn shortest(c: u64, q: i32, is_at_power: bool) -> (u64, i32) {
    let odd = c & 1;
    // The number and the ends of what rounds to it, times 4.
    let (center, upper) = (4 * c, 4 * c + 2);
    let (lower, k) = match is_at_power {
        false => (4 * c - 2, log10_of_power_of_2(q)),
        true => (4 * c - 1, log10_of_three_quarters(q)),
    };
    let power = POWERS[(-k - FIRST_POWER) as usize];
    let shift = q + log2_of_power_of_10(-k) + 1;
    let scaled = |quarters: u64| rounded_to_odd(power, quarters << shift);
    let (lower, center, upper) = (scaled(lower) + odd, scaled(center), scaled(upper) - odd);
    // With a digit less, if exactly one such number rounds to this one.
    let s = center / 4;
    let tens = s / 10;
    let (is_below, is_above) = (lower <= 40 * tens, 40 * tens + 40 <= upper);
    if s >= 10 && is_below != is_above {
        return (10 * (tens + u64::from(is_above)), k);
    }
    let (is_below, is_above) = (lower <= 4 * s, 4 * s + 4 <= upper);
    let is_nearer_above = center + (s & 1) > 4 * s + 2;
    let goes_up = if is_below != is_above {
        is_above
    } else {
        is_nearer_above
    };
    (s + u64::from(goes_up), k)
}

/// Floor of log10(2^q).
fn log10_of_power_of_2(q: i32) -> i32 {
    (q * 1_262_611) >> 22
}

/// Floor of log10(3/4 2^q).
fn log10_of_three_quarters(q: i32) -> i32 {
    (q * 1_262_611 - 524_031) >> 22
}

/// Floor of log2(10^k).
fn log2_of_power_of_10(k: i32) -> i32 {
    (k * 1_741_647) >> 19
}

/// The upper 64 of the 192 bits of a product, the last one set if any below is. The factor is rounded up by
/// less than 1, so that 1 in the bits below stands for nothing.
fn rounded_to_odd(factor: u128, number: u64) -> u64 {
    let product = wide_product(factor, number);
    (product >> 64) as u64 | u64::from(product as u64 > 1)
}

/// The upper 128 of the 192 bits of a product.
#[inline(always)]
fn wide_product(factor: u128, number: u64) -> u128 {
    let (high, low) = ((factor >> 64) as u64, factor as u64);
    let carried = (u128::from(low) * u128::from(number)) >> 64;
    u128::from(high) * u128::from(number) + carried
}

/// The digits after the first, the first of them lowest: in loops that become vector instructions, halves of
/// eight digits, then of four and two, by multiplications that round down to the right quotients.
#[inline(always)]
fn texts(decimals: &[Decimal; TOGETHER]) -> [u128; TOGETHER] {
    let upper_half = |number: u16, inverse: u32| ((u32::from(number) * inverse) >> 16) as u16;
    let mut fours = [0; 4 * TOGETHER];
    for (k, decimal) in decimals.iter().enumerate() {
        for (i, &number) in decimal.rest.iter().enumerate() {
            let half = ((u64::from(number) * 109_951_163) >> 40) as u32;
            (fours[4 * k + 2 * i], fours[4 * k + 2 * i + 1]) =
                (half as u16, (number - 10_000 * half) as u16);
        }
    }
    let mut twos = [0; 8 * TOGETHER];
    for (k, &number) in fours.iter().enumerate() {
        let half = upper_half(number, 5243) >> 3;
        (twos[2 * k], twos[2 * k + 1]) = (half, number - 100 * half);
    }
    for number in &mut twos {
        let half = upper_half(*number, 6554);
        *number = half | (*number - 10 * half) << 8;
    }
    let mut texts = [0; TOGETHER];
    for (text, twos) in texts.iter_mut().zip(twos.as_chunks::<8>().0) {
        let half = |k: usize| (0..4).fold(0, |all, i| all | u64::from(twos[4 * k + i]) << (16 * i));
        *text = u128::from(half(0)) | u128::from(half(1)) << 64;
    }
    texts
}

/// Writes digits, the first with that power of ten; how long that is.
#[inline(always)]
fn put_digits(text: &mut [u8], first: u8, rest: u128, power: i32) -> usize {
    // Without zeros at the end.
    let count = 17 - (rest.leading_zeros() / 8) as usize;
    let (first, rest) = (b'0' + first, rest | u128::from_ne_bytes([b'0'; 16]));
    match power {
        -5..=-1 => {
            let at = (1 - power) as usize;
            text[..8].copy_from_slice(b"0.000000");
            text[at] = first;
            put_rest(text, at + 1, rest);
            at + count
        }
        0..=15 => {
            let point = 1 + power as usize;
            text[0] = first;
            put_rest(text, 1, rest);
            put_rest(text, point + 1, rest >> (8 * power));
            text[point] = b'.';
            if count > point { count + 1 } else { point }
        }
        _ => {
            text[0] = first;
            text[1] = b'.';
            put_rest(text, 2, rest);
            let at = if count > 1 { count + 1 } else { 1 };
            at + put_exponent(&mut text[at..], power)
        }
    }
}

#[inline(always)]
fn put_rest(text: &mut [u8], at: usize, rest: u128) {
    text[at..at + 16].copy_from_slice(&rest.to_le_bytes());
}

#[inline(always)]
fn put_exponent(text: &mut [u8], power: i32) -> usize {
    let size = power.unsigned_abs();
    let digits = 1 + usize::from(size >= 10) + usize::from(size >= 100);
    let sign = if power < 0 { b'-' } else { b'+' };
    let [hundreds, tens, ones] = [size / 100, size / 10 % 10, size % 10].map(|d| b'0' + d as u8);
    let all = u32::from_le_bytes([hundreds, tens, ones, 0]) >> (8 * (3 - digits));
    text[..2].copy_from_slice(&[b'e', sign]);
    text[2..6].copy_from_slice(&all.to_le_bytes());
    2 + digits
}
