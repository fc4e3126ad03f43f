//! Writing of CSV files.

use super::Series;
use super::read::name_and_unit;
use pilotage_text::printable::{comment, one_line};

impl Series {
    /// The series as CSV text: comments, a header with units, then one row per time. [`Series::parse`] reads it back to the
    /// same bits if the times ascend, no value is infinite and no column is called `time`; [`Series::read_table`] takes
    /// infinite values and repeated times too.
    ///
    /// # Panics
    /// If a column has fewer values than there are times.
    pub fn to_csv(&self) -> String {
        let mut text: String = self.comments.iter().map(|own| comment(own)).collect();
        text += "time [s]";
        for column in &self.columns {
            text.push(',');
            text += &head(&column.name, &column.unit);
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

/// `name [unit]` as a header cell that reads back as the same name and unit, both on [one line](one_line) and without space
/// around. A name without letters reads back as `_`, and brackets in a unit as parentheses, since a header has no room for them.
pub fn head(name: &str, unit: &str) -> String {
    let [name, unit] = [name, unit].map(one_line);
    let name = Some(name.trim()).filter(|own| !own.is_empty());
    let (name, unit) = (name.unwrap_or("_"), unit.trim());
    cell(&match unit {
        // If the name ends like a unit or part of one, an empty unit marks it as a name.
        "" if name_and_unit(name).is_none_or(|(read, _)| read != name) => format!("{name} []"),
        "" => name.to_owned(),
        unit => format!("{name} [{}]", unit.replace('[', "(").replace(']', ")")),
    })
}

/// Any text as a cell of a CSV file, on [one line](one_line); quoted if it contains a comma or a quote, or would begin a comment.
pub fn cell(text: &str) -> String {
    let text = one_line(text);
    match text.contains([',', '"']) || text.starts_with('#') {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.into_owned(),
    }
}

/// The shortest text that reads back to the same bits; empty for a missing sample.
fn number(value: f64) -> String {
    match value.is_nan() {
        true => String::new(),
        // `{:?}` uses exponents where `{}` would write hundreds of zeros; integers need no `.0`.
        false => format!("{value:?}").trim_end_matches(".0").to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Column;
    use proptest::prelude::*;

    /// Letters, and what readers of CSV take for more than a letter.
    fn texts() -> impl Strategy<Value = String> {
        let odd = "\0\x07\x1b\n\r\t\x0c\u{85}\u{202e}\u{2028}\u{feff}\"',;#=[]() m1";
        let odd: Vec<char> = odd.chars().collect();
        let letter = prop_oneof![any::<char>(), prop::sample::select(odd)];
        prop::collection::vec(letter, 0..12).prop_map(String::from_iter)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 512,
            rng_seed: proptest::test_runner::RngSeed::Fixed(3),
            ..ProptestConfig::default()
        })]
        #[test]
        fn what_is_written_reads_back_to_the_same_bits(
            values in prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO, 1..20),
            name in "[^\\s\\pC]([^\\pC]{0,8}[^\\s\\pC])?|[a-z]{1,2} ?\\[[0-9,m\\]]{0,3}",
            unit in "|1|m|rad/s|µs/rad|\"|m,s|°",
        ) {
            let series = Series {
                texts: Vec::new(),
                note: None,
                time_unit: "s".into(),
                comments: vec!["pilot: A".into(), String::new()],
                time: (0..values.len()).map(|k| k as f64 * 0.05).collect(),
                columns: vec![Column { name, unit, values }],
            };
            let read = Series::parse(series.to_csv().as_bytes(), "f.csv").unwrap();
            prop_assert_eq!(&read, &series);
        }

        #[test]
        fn whatever_names_and_comments_contain_the_file_reads_back(
            (name, unit, comment) in (texts(), texts(), texts()),
        ) {
            let expected = match one_line(&name).trim() {
                "" => "_".to_owned(),
                name => name.to_owned(),
            };
            let unit_read = one_line(&unit).trim().replace('[', "(").replace(']', ")");
            let series = Series {
                comments: vec![comment.clone()],
                time: vec![0.0, 1.0],
                columns: vec![Column { name, unit, values: vec![1.0, 2.0] }],
                ..Series::default()
            };
            let text = series.to_csv();
            prop_assert_eq!(text.lines().count(), 4);
            let read = Series::parse(text.as_bytes(), "f.csv").unwrap();
            let said = one_line(&comment);
            prop_assert_eq!(&read.comments, &[said.trim()]);
            prop_assert_eq!(&read.columns[0].name, &expected);
            prop_assert_eq!(&read.columns[0].unit, &unit_read);
            prop_assert_eq!(&read.columns[0].values, &[1.0, 2.0]);
        }
    }

    #[test]
    fn missing_samples_are_empty_cells() {
        let series = Series {
            texts: Vec::new(),
            note: None,
            time_unit: "s".into(),
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
