//! Numbers as people write them: with a decimal point or a decimal comma, or a word where there is none.

use super::SeriesError;

/// What stands for a number that there is none, in any case, beside an empty cell and `NaN`.
const MISSING: &[&str] = &[
    "na",
    "n/a",
    "#n/a",
    "null",
    "none",
    "-",
    "--",
    "nan(ind)",
    "-nan(ind)",
];

/// Number of such words that are told.
const TOLD: usize = 4;

/// What a cell holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A number; NaN where it is missing.
    Number(f64),
    /// No number.
    Word,
    /// Something that can be read in two ways: why.
    Unclear(String),
}

/// Where a cell stands: its line and the name of its column.
pub type Place = (usize, String);

/// The first cell with a decimal sign. All numbers of a file have the same.
#[derive(Debug, Clone)]
struct Sign {
    is_comma: bool,
    /// Whether some cell shows that it does not part thousands.
    is_certain: bool,
    place: Place,
    cell: String,
}

/// Reads the cells of one file, whose decimal sign it finds out.
#[derive(Debug, Clone)]
pub struct Numbers {
    separator: u8,
    sign: Option<Sign>,
    missing: Vec<String>,
    /// The last number with a comma, with a point.
    with_point: String,
}

impl Numbers {
    /// Those of a file with this separator between its cells.
    pub fn new(separator: u8) -> Self {
        Self {
            separator,
            sign: None,
            missing: Vec::new(),
            with_point: String::new(),
        }
    }

    /// Reads a cell without space around it; its place is asked for where the sign was not seen before.
    pub fn read(&mut self, cell: &str, place: impl FnOnce() -> Place) -> Cell {
        // No number with a comma is parsed, and to try takes time.
        if self.sign.as_ref().is_some_and(|sign| sign.is_comma) && cell.contains(',') {
            return self.read_comma(cell, place);
        }
        match cell.parse::<f64>() {
            Ok(value) => match &self.sign {
                Some(sign) if sign.is_certain && !sign.is_comma => Cell::Number(value),
                _ if !cell.contains('.') => Cell::Number(value),
                _ => self.signed(value, cell, false, place),
            },
            Err(_) if cell.is_empty() => Cell::Number(f64::NAN),
            Err(_) if cell.contains(',') => self.read_comma(cell, place),
            Err(_) => self.read_odd(cell),
        }
    }

    fn read_odd(&mut self, cell: &str) -> Cell {
        if MISSING.iter().any(|word| cell.eq_ignore_ascii_case(word)) {
            if self.missing.len() < TOLD && !self.missing.iter().any(|word| word == cell) {
                self.missing.push(cell.to_owned());
            }
            return Cell::Number(f64::NAN);
        }
        match is_grouped(cell, '.', ',') {
            true => Cell::Unclear(GROUPED.to_owned()),
            false => Cell::Word,
        }
    }

    fn read_comma(&mut self, cell: &str, place: impl FnOnce() -> Place) -> Cell {
        let mut with_point = std::mem::take(&mut self.with_point);
        with_point.clear();
        with_point.extend(cell.chars().map(|c| if c == ',' { '.' } else { c }));
        let parsed = with_point.parse();
        self.with_point = with_point;
        match parsed {
            Ok(value) => self.signed(value, cell, true, place),
            Err(_) if is_grouped(cell, ',', '.') || is_grouped(cell, '.', ',') => {
                Cell::Unclear(GROUPED.to_owned())
            }
            Err(_) => Cell::Word,
        }
    }

    /// A number with a decimal sign, unless others have the other one.
    fn signed(
        &mut self,
        value: f64,
        cell: &str,
        is_comma: bool,
        place: impl FnOnce() -> Place,
    ) -> Cell {
        // A table with commas or tabs and points is as any program writes it; semicolons are of where points may part thousands.
        let is_doubtful = is_comma || self.separator == b';';
        let is_known = (self.sign.as_ref()).is_some_and(|sign| sign.is_certain);
        let is_certain =
            is_known || !(is_doubtful && is_grouped(cell, if is_comma { ',' } else { '.' }, ' '));
        let name = |is_comma| if is_comma { "comma" } else { "point" };
        match &mut self.sign {
            Some(sign) if sign.is_comma != is_comma => {
                return Cell::Unclear(format!(
                    "has a {}, but `{}` on line {} has a {}; write all numbers with decimal points, and nothing between thousands",
                    name(is_comma),
                    sign.cell,
                    sign.place.0,
                    name(sign.is_comma),
                ));
            }
            Some(sign) => sign.is_certain |= is_certain,
            None => {
                self.sign = Some(Sign {
                    is_comma,
                    is_certain,
                    place: place(),
                    cell: cell.to_owned(),
                });
            }
        }
        Cell::Number(value)
    }

    /// How the numbers were taken where they are not plain; asked for at the end of the file.
    ///
    /// # Errors
    /// If each comma, or each point in a file with semicolons, may as well part thousands.
    pub fn taken(&self, file: &str) -> Result<Vec<String>, SeriesError> {
        let mut taken = Vec::new();
        match &self.sign {
            Some(sign) if !sign.is_certain => {
                let (line, column) = sign.place.clone();
                let [point, none] = [".", ""].map(|by| sign.cell.replace([',', '.'], by));
                return Err(SeriesError::Unclear {
                    file: file.to_owned(),
                    line,
                    column,
                    found: sign.cell.clone(),
                    reason: format!(
                        "is {point} or {none}, and no number of the file tells which; write decimals with a point and commas \
                         between cells, and nothing between thousands"
                    ),
                });
            }
            Some(sign) if sign.is_comma => taken.push("decimal commas".to_owned()),
            Some(_) if self.separator == b';' => taken.push("decimal points".to_owned()),
            _ => {}
        }
        if !self.missing.is_empty() {
            let words: Vec<String> = self.missing.iter().map(|own| format!("`{own}`")).collect();
            taken.push(format!("{} for no sample", words.join(", ")));
        }
        Ok(taken)
    }
}

const GROUPED: &str =
    "has signs between thousands; write it without them, and with a decimal point";

/// Whether the digits before the decimal sign, if there is one, stand in groups of three: `1,234`, `1,234,567.8`.
fn is_grouped(cell: &str, between: char, decimal: char) -> bool {
    let cell = cell.strip_prefix(['+', '-']).unwrap_or(cell);
    let (whole, fraction) = cell.split_once(decimal).unwrap_or((cell, ""));
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let mut groups = whole.split(between);
    let first = groups.next().unwrap_or_default();
    let mut count = 0;
    let is_first = (1..=3).contains(&first.len()) && is_digits(first) && !first.starts_with('0');
    let are_rest = groups.all(|group| {
        count += 1;
        group.len() == 3 && is_digits(group)
    });
    is_first && are_rest && count > 0 && is_digits(fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_of_thousands() {
        for cell in ["1,234", "-12,345", "+123,456,789", "1,234.5"] {
            assert!(is_grouped(cell, ',', '.'), "{cell}");
        }
        for cell in [
            "0,234", "1,23", "1234,567", "1,2345", "a,234", "1,234,", "12", "",
        ] {
            assert!(!is_grouped(cell, ',', '.'), "{cell}");
        }
    }

    #[test]
    fn one_sign_holds_for_the_file() {
        let place = || (2, "x".to_owned());
        let read = |separator, cells: &[&str]| {
            let mut numbers = Numbers::new(separator);
            let mut read = Vec::new();
            for cell in cells {
                match numbers.read(cell, place) {
                    Cell::Number(value) => read.push(value),
                    Cell::Word => return Err("a word".to_owned()),
                    Cell::Unclear(why) => return Err(why),
                }
            }
            let taken = numbers.taken("f.csv").map_err(|error| error.to_string())?;
            Ok((read, taken.join("; ")))
        };
        let commas = |values: &[f64]| Ok((values.to_vec(), "decimal commas".to_owned()));
        // `0,5` tells what `1,234` is.
        assert_eq!(
            read(b';', &["1,234", "0,5", "-2e3"]),
            commas(&[1.234, 0.5, -2e3])
        );
        assert_eq!(read(b'\t', &["1,5E-3", "7"]), commas(&[1.5e-3, 7.0]));
        assert_eq!(read(b',', &["1.234"]), Ok((vec![1.234], String::new())));
        assert_eq!(read(b'\t', &["1.234"]), Ok((vec![1.234], String::new())));
        for (separator, cells) in [
            (b';', &["1,234"][..]),
            (b'\t', &["1,234", "12"]),
            (b',', &["1,234"]),
            (b';', &["1.234", "7"]),
            (b';', &["0,5", "1.5"]),
            (b';', &["1.5", "0,5"]),
            (b',', &["1.5", "0,5"]),
            (b';', &["0,5", "1.234"]),
            (b';', &["1.234,5"]),
            (b';', &["1,234.5"]),
            (b';', &["1.234.567"]),
            (b';', &["1,234,567"]),
            (b';', &["1,2,3"]),
        ] {
            assert!(read(separator, cells).is_err(), "{cells:?}");
        }
        let mut numbers = Numbers::new(b',');
        for cell in ["", "NaN", "nan", "NA", "n/a", "NULL", "-"] {
            let Cell::Number(value) = numbers.read(cell, place) else {
                panic!("{cell}");
            };
            assert!(value.is_nan(), "{cell}");
        }
        assert_eq!(
            numbers.taken("f").unwrap(),
            ["`NA`, `n/a`, `NULL`, `-` for no sample"]
        );
    }
}
