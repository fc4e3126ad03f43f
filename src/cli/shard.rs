//! Parts of numbered work, for several machines.

/// A part of the numbers from 0 on: those that leave the same rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Which one, from 1.
    pub own: usize,
    /// Number of parts.
    pub of: usize,
}

impl Shard {
    /// Everything.
    pub const WHOLE: Self = Self { own: 1, of: 1 };

    /// Whether a number belongs to it.
    pub fn has(self, number: usize) -> bool {
        number % self.of == self.own - 1
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(own, of)| {
            Some(Self {
                own: own.trim().parse().ok()?,
                of: of.trim().parse().ok()?,
            })
        });
        let is_one = |own: &Self| (1..=own.of).contains(&own.own);
        parts
            .filter(is_one)
            .ok_or_else(|| "expected I/N, such as 1/3, with I from 1 to N".to_owned())
    }
}
