//! Temporary files that a description names.

use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// What is removed when the last copy of a description is gone, such as the folder of an unpacked archive.
#[derive(Clone, Default)]
pub struct Kept(Vec<Arc<dyn Any + Send + Sync>>);

impl Kept {
    /// Keeps one more.
    pub fn push(&mut self, own: impl Any + Send + Sync) {
        self.0.push(Arc::new(own));
    }

    /// Whether nothing is kept: all files that the description names are the user's.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl fmt::Debug for Kept {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} kept", self.0.len())
    }
}

impl PartialEq for Kept {
    /// Descriptions that say the same are equal, wherever their files lie.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}
