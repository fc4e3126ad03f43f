//! Assignment of columns to quantities.

use super::TrialError;
use pilotage_text::suggestion::suggestion;

/// Quantities of a trial, which are also the default column names.
const QUANTITIES: [&str; 4] = ["time", "target", "position", "stick"];

/// Column names that differ from the defaults.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnNames(Vec<(&'static str, String)>);

impl ColumnNames {
    /// From pairs such as `position`, `z`: the position is in the column `z`.
    ///
    /// # Errors
    /// If the first of a pair is none of `time`, `target`, `position` and `stick`, or occurs twice.
    pub fn new(pairs: &[(String, String)]) -> Result<Self, TrialError> {
        let mut names = Self::default();
        for (quantity, name) in pairs {
            let Some(known) = QUANTITIES.into_iter().find(|known| known == quantity) else {
                return Err(TrialError::Quantity {
                    found: quantity.clone(),
                    suggestion: suggestion(quantity, QUANTITIES).map(str::to_owned),
                });
            };
            if names.given(known).is_some() {
                return Err(TrialError::TwoColumns { quantity: known });
            }
            names.0.push((known, name.clone()));
        }
        Ok(names)
    }

    /// The name given for a quantity's column, if any.
    pub fn given(&self, quantity: &str) -> Option<&str> {
        let mut pairs = self.0.iter();
        let (_, name) = pairs.find(|(known, _)| *known == quantity)?;
        Some(name)
    }

    /// The name of a quantity's column.
    pub fn of<'a>(&'a self, quantity: &'a str) -> &'a str {
        self.given(quantity).unwrap_or(quantity)
    }
}
