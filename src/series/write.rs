//! CSV out.

use super::{Column, Series};

impl Series {
    /// The series as CSV text that [`Series::parse`] reads back to the same bits: comments, then a
    /// header with units, then one row for each time.
    pub fn to_csv(&self) -> String {
        let mut text: String = self.comments.iter().map(|c| format!("# {c}\n")).collect();
        text += "time [s]";
        for column in &self.columns {
            text.push(',');
            text += &head(column);
        }
        text.push('\n');
        for (k, time) in self.time.iter().enumerate() {
            text += &number(*time);
            for column in &self.columns {
                text.push(',');
                text += &number(column.values[k]);
            }
            text.push('\n');
        }
        text
    }
}

/// One cell of the header, quoted where the name holds a comma or a quote.
fn head(column: &Column) -> String {
    let cell = match column.unit.as_str() {
        "" => column.name.clone(),
        unit => format!("{} [{unit}]", column.name),
    };
    match cell.contains([',', '"']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    }
}

/// The shortest text that reads back to the same bits; empty for a missing sample.
fn number(value: f64) -> String {
    match value.is_nan() {
        true => String::new(),
        // `{:?}` turns to exponents where `{}` would write hundreds of zeros; a whole number needs no `.0`.
        false => format!("{value:?}").trim_end_matches(".0").to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn what_is_written_reads_back_to_the_same_bits(
            values in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 1..20),
        ) {
            let series = Series {
                comments: vec!["pilot: A".into(), String::new()],
                time: (0..values.len()).map(|k| k as f64 * 0.05).collect(),
                columns: vec![Column { name: "a, \"b\"".into(), unit: "m/s".into(), values }],
            };
            let read = Series::parse(series.to_csv().as_bytes(), "f.csv").unwrap();
            prop_assert_eq!(&read, &series);
        }
    }

    #[test]
    fn missing_samples_are_empty_cells() {
        let series = Series {
            comments: vec!["x".into()],
            time: vec![0.0, 0.5],
            columns: vec![Column {
                name: "pilot.stick".into(),
                unit: "1".into(),
                values: vec![f64::NAN, -1e-12],
            }],
        };
        assert_eq!(
            series.to_csv(),
            "# x\ntime [s],pilot.stick [1]\n0,\n0.5,-1e-12\n"
        );
    }
}
