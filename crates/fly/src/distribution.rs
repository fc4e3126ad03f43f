//! Distributions of times. Constant lags can be corrected, varying ones cannot, so both are recorded.

use serde::Serialize;

/// Median, quantiles and maximum.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Distribution {
    /// Number of values.
    pub count: usize,
    /// The median.
    pub median: f64,
    /// The 95 % quantile.
    pub p95: f64,
    /// The 99.9 % quantile.
    pub p999: f64,
    /// The largest.
    pub most: f64,
}

impl Distribution {
    /// The distribution of these values; non-finite values are omitted.
    pub fn of(mut values: Vec<f64>) -> Self {
        values.retain(|value| value.is_finite());
        values.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let place = (part * values.len() as f64).ceil() as usize;
            values.get(place.max(1) - 1).copied().unwrap_or(0.0)
        };
        Self {
            count: values.len(),
            median: at(0.5),
            p95: at(0.95),
            p999: at(0.999),
            most: at(1.0),
        }
    }
}

impl std::fmt::Display for Distribution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.count {
            0 => f.write_str("none"),
            _ => write!(
                f,
                "median {:.2}, 95 % below {:.2}, 99.9 % below {:.2}, most {:.2}",
                self.median, self.p95, self.p999, self.most
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_those_of_the_sorted_values() {
        let all: Vec<f64> = (1..=1000).rev().map(f64::from).collect();
        let own = Distribution::of([all, vec![f64::NAN]].concat());
        let figures = (own.count, own.median, own.p95, own.p999, own.most);
        assert_eq!(figures, (1000, 500.0, 950.0, 999.0, 1000.0));
        assert_eq!(Distribution::of(Vec::new()).to_string(), "none");
    }
}
