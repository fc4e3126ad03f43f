//! Axis scales with round ticks.

use pilotage_text::number::short;
use std::ops::Range;

/// Approximate number of ticks of a scale.
const TICKS: f64 = 8.0;

/// Axes that reach as far as this are labelled without exponents.
const PLAIN: Range<f64> = 1e-3..1e6;

/// A linear scale from `low` to `high` with round ticks in between.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    low: f64,
    high: f64,
    /// The ticks, ascending: multiples of 1, 2 or 5 times a power of ten.
    pub ticks: Vec<f64>,
    /// Distance of the ticks.
    step: f64,
    /// Whether values are decimal logarithms of the displayed quantity.
    in_decades: bool,
}

impl Scale {
    /// A scale over the finite `values`, with a margin at both ends as a fraction of their range. Without data it
    /// reaches from 0 to 1.
    pub fn covering(values: impl IntoIterator<Item = f64>, margin: f64) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let (mut low, mut high) = finite
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let size = high.abs().max(low.abs());
        if high - low <= 1e-9 * size {
            let half = 0.5 * if size > 0.0 { size } else { 1e-3 };
            (low, high) = (low - half, high + half);
        }
        let margin = margin * (high - low);
        Self::between(low - margin, high + margin)
    }

    /// A scale from `low` to `high`, where `low < high`.
    fn between(low: f64, high: f64) -> Self {
        let step = round_step((high - low) / TICKS);
        // The tolerance keeps an end that is a tick up to rounding.
        let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
        Self {
            low,
            high,
            ticks: (0..=(last - first) as usize)
                .map(|i| (first + i as f64) * step)
                .collect(),
            step,
            in_decades: false,
        }
    }

    /// Turns a scale of decimal logarithms into decades: ticks at powers of ten, for small ranges also at 2 and 5 times
    /// them, labelled with the numbers.
    pub fn in_decades(mut self) -> Self {
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        let parts: &[f64] = match self.range() < 3.0 {
            true => &[1.0, 2.0, 5.0],
            false => &[1.0],
        };
        // As many powers of ten as fit.
        let step = (self.range() / TICKS).ceil().max(1.0) as i32;
        let powers = (first.div_euclid(step)..=last.div_euclid(step)).map(|k| k * step);
        let ticks = powers.flat_map(|decade| {
            let of_decade = parts
                .iter()
                .map(move |part| f64::from(decade) + part.log10());
            of_decade.collect::<Vec<_>>()
        });
        let is_within = |tick: &f64| (self.low..=self.high).contains(tick);
        self.ticks = ticks.filter(is_within).collect();
        self.in_decades = true;
        self
    }

    /// Difference between the ends.
    pub fn range(&self) -> f64 {
        self.high - self.low
    }

    /// A scale with the same centre and the given range.
    pub fn reaching(&self, range: f64) -> Self {
        let middle = 0.5 * (self.low + self.high);
        Self::between(middle - 0.5 * range, middle + 0.5 * range)
    }

    /// Relative position of a value between the ends, 0 to 1.
    pub fn position(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// A tick's label, with a true minus sign.
    pub fn label(&self, tick: f64) -> String {
        if self.in_decades {
            // The first digit is 1, 2 or 5, so one digit is exact.
            return short(10f64.powf(tick), 1).replace('-', "\u{2212}");
        }
        // `+ 0.0` turns the tick -0 into 0.
        let tick = tick + 0.0;
        let size = self.low.abs().max(self.high.abs());
        let decimals = |above: f64| (above - decade(self.step)).max(0.0) as usize;
        let text = match PLAIN.contains(&size) {
            true => format!("{tick:.*}", decimals(0.0)),
            false if tick == 0.0 => "0".to_owned(),
            false => format!("{tick:.*e}", decimals(decade(tick.abs()))),
        };
        text.replace('-', "\u{2212}")
    }
}

/// Power of ten of the first digit of a positive number.
fn decade(value: f64) -> f64 {
    // The tolerance keeps a power of ten that is one up to rounding.
    (value.log10() + 1e-9).floor()
}

/// The smallest number of the form 1, 2 or 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let mantissa = step / power;
    let round = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|m| mantissa <= m * (1.0 + 1e-9));
    power * round.unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_lie_within_the_data() {
        let scale = Scale::covering([0.0, 24.256, f64::NAN], 0.0);
        assert_eq!(scale.ticks, [0.0, 5.0, 10.0, 15.0, 20.0]);
        assert_eq!((scale.position(0.0), scale.position(24.256)), (0.0, 1.0));
        let scale = Scale::covering([-0.645, 0.392], 0.05);
        assert_eq!(scale.ticks.len(), 6);
        assert_eq!(scale.label(scale.ticks[0]), "\u{2212}0.6");
        assert!(scale.position(-0.645) > 0.0 && scale.position(0.392) < 1.0);
        assert_eq!(Scale::covering([0.0, 15.0], 0.0).ticks.last(), Some(&14.0));
        assert_eq!(
            Scale::covering([0.0, 0.3], 0.0).ticks.last(),
            Some(&(6.0 * 0.05))
        );
    }

    #[test]
    fn large_and_small_numbers_have_exponents() {
        let labels = |values: [f64; 2]| -> Vec<String> {
            let scale = Scale::covering(values, 0.0);
            scale.ticks.iter().map(|&tick| scale.label(tick)).collect()
        };
        let found = labels([-1e301, 1e301]);
        assert_eq!(found[0], "\u{2212}1.0e301");
        assert_eq!(
            labels([0.0, 1e-15])[..3],
            ["0", "2e\u{2212}16", "4e\u{2212}16"]
        );
        assert_eq!(labels([1e-300, 3e-300])[1], "1.5e\u{2212}300");
        assert_eq!(labels([0.0, 2e5])[1], "50000");
        assert_eq!(labels([1e12, 1e12 + 4e4])[1], "1.000000005e12");
    }

    #[test]
    fn decades_are_labelled_with_the_numbers() {
        let scale = Scale::covering([-2.3, 1.7], 0.0).in_decades();
        let labels: Vec<String> = scale.ticks.iter().map(|&tick| scale.label(tick)).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10"]);
        let scale = Scale::covering([-5.3, -3.6], 0.0).in_decades();
        let labels: Vec<String> = scale.ticks.iter().map(|&tick| scale.label(tick)).collect();
        assert_eq!(
            labels,
            [
                "1e\u{2212}5",
                "2e\u{2212}5",
                "5e\u{2212}5",
                "0.0001",
                "0.0002"
            ]
        );
    }

    #[test]
    fn a_wider_range_keeps_its_middle() {
        let scale = Scale::covering([1.0, 3.0], 0.0).reaching(8.0);
        assert_eq!(scale.range(), 8.0);
        assert_eq!(scale.position(2.0), 0.5);
    }

    #[test]
    fn no_data_and_constant_data_have_a_scale_too() {
        for values in [
            vec![],
            vec![f64::NAN],
            vec![0.0],
            vec![7.5; 3],
            vec![-1e-300],
        ] {
            let scale = Scale::covering(values.iter().copied(), 0.05);
            assert!(
                scale.ticks.len() >= 3 && scale.high > scale.low,
                "{values:?}"
            );
        }
    }
}
