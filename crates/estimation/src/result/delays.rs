//! The order of delays without one, in words.

use pilotage_language::Delayed;
use pilotage_text::number::significant;

/// The order of the delays that have none.
#[derive(Debug, Clone, PartialEq)]
pub struct DelayOrder {
    /// The order.
    pub order: usize,
    /// The order before, and the largest move of an estimate from it, in standard deviations, with the name of the estimate. None if
    /// no other order was tried.
    pub moved: Option<(usize, f64, String)>,
    /// Whether the last move was below a tenth of a standard deviation.
    pub is_enough: bool,
}

impl DelayOrder {
    /// What it means, for people.
    pub fn words(&self) -> String {
        let order = self.order;
        let mut text = format!("delays without an order are Padé's approximation of order {order}");
        if let Some((before, most, name)) = &self.moved {
            text += &format!(
                ": from order {before} on no estimate moved by more than {} standard deviations (`{name}`)",
                significant(*most, 2)
            );
        }
        text + match self.is_enough {
            true => "",
            false if order == Delayed::HIGHEST => {
                "; the data have a wider band than the highest order follows"
            }
            false => "; no higher one was reached",
        }
    }
}
