//! Time stamps: ISO 8601 (`2024-03-01T12:00:00.25+01:00`) and times of the clock (`12:00:00.25`).
//!
//! A calendar of our own: only differences are needed, and crates of dates would bring zones and their rules into each FMU, whose
//! tables are read here, too.

/// What a stamp says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A time of a day.
    Clock,
    /// Date and time of some place.
    Local,
    /// Date and time with their distance to UTC.
    Utc,
}

const SECOND: i128 = 1_000_000_000;
const DAY: i128 = 86_400 * SECOND;

/// A point in time in nanoseconds, so that differences are those of the digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    pub kind: Kind,
    nanoseconds: i128,
}

impl Stamp {
    /// Reads a stamp; `None` if it is none or is no time there is, as 25:00:00. A time without date has seconds: `12:30` may be
    /// minutes.
    pub fn parse(text: &str) -> Option<Self> {
        let date = text.get(..10).and_then(day);
        let Some(day) = date else {
            let nanoseconds = time(text, true)?;
            return Some(Self {
                kind: Kind::Clock,
                nanoseconds,
            });
        };
        let rest = text[10..].strip_prefix(['T', 't', ' '])?.trim_start();
        let end = rest.find(|c: char| !(c.is_ascii_digit() || ":.,".contains(c)));
        let (clock, zone) = rest.split_at(end.unwrap_or(rest.len()));
        let (kind, ahead) = match zone.trim_start() {
            "" => (Kind::Local, 0),
            "Z" | "z" | "UTC" => (Kind::Utc, 0),
            zone => (Kind::Utc, offset(zone)?),
        };
        Some(Self {
            kind,
            nanoseconds: day * DAY + time(clock, false)? - ahead,
        })
    }
}

/// Days since 1970 of `YYYY-MM-DD`, in the Gregorian calendar.
fn day(text: &str) -> Option<i128> {
    let bytes = text.as_bytes();
    if bytes.len() != 10 || bytes[4] != b'-' || bytes[7] != b'-' {
        return None;
    }
    let [year, month, day] = [&text[..4], &text[5..7], &text[8..]].map(digits);
    let (year, month, day) = (year?, month?, day?);
    let is_leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let longest = match month {
        2 if is_leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
        _ => return None,
    };
    if !(1..=longest).contains(&day) {
        return None;
    }
    // Years that begin in March have their leap day at the end.
    let (year, month) = match month > 2 {
        true => (year, month - 3),
        false => (year - 1, month + 9),
    };
    let of_years = 365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    Some(of_years + (153 * month + 2) / 5 + day - 1 - 719_468)
}

/// Nanoseconds since midnight of `HH:MM:SS.fff`, or of `HH:MM` unless seconds are needed.
fn time(text: &str, needs_seconds: bool) -> Option<i128> {
    let mut parts = text.split(':');
    let hour = parts.next().filter(|part| (1..=2).contains(&part.len()))?;
    let minute = parts.next().filter(|part| part.len() == 2)?;
    let (second, fraction) = match parts.next() {
        Some(second) => second.split_once(['.', ',']).unwrap_or((second, "0")),
        None if needs_seconds => return None,
        None => ("00", "0"),
    };
    let (hour, minute) = (digits(hour)?, digits(minute)?);
    let second = Some(second).filter(|own| own.len() == 2).and_then(digits)?;
    digits(fraction)?;
    // Beyond nanoseconds no clock is right.
    let kept = &fraction[..fraction.len().min(9)];
    let nano = digits(kept)? * 10i128.pow(9 - kept.len() as u32);
    // A leap second is the 61st of its minute.
    let is_time = hour < 24 && minute < 60 && second <= 60 && parts.next().is_none();
    is_time.then_some(((hour * 60 + minute) * 60 + second) * SECOND + nano)
}

/// Nanoseconds of `+01:00`, `+0100` or `+01`.
fn offset(text: &str) -> Option<i128> {
    let (sign, rest) = match text.strip_prefix('+') {
        Some(rest) => (1, rest),
        None => (-1, text.strip_prefix('-')?),
    };
    let (hours, minutes) = match (rest.len(), rest.is_ascii()) {
        (2, true) => (rest, "00"),
        (4, true) => rest.split_at(2),
        (5, true) => rest.split_once(':')?,
        _ => return None,
    };
    let (hours, minutes) = (digits(hours)?, digits(minutes)?);
    (hours < 24 && minutes < 60).then_some(sign * (hours * 60 + minutes) * 60 * SECOND)
}

fn digits(text: &str) -> Option<i128> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    text.get(..text.len().min(30))
        .filter(|_| is_number)?
        .parse()
        .ok()
}

/// The stamps of a file, of one kind, in seconds since the first.
#[derive(Debug)]
pub struct Stamps {
    first: Stamp,
    last: i128,
    /// What midnights added to the clock.
    passed: i128,
}

impl Stamps {
    /// Begins at the first.
    pub fn new(first: Stamp) -> Self {
        Self {
            first,
            last: first.nanoseconds,
            passed: 0,
        }
    }

    /// Seconds from the first stamp to this one; `None` if it is of another kind or none. A clock that goes back by more than
    /// half a day has passed midnight.
    pub fn seconds(&mut self, cell: &str) -> Option<f64> {
        let own = Stamp::parse(cell).filter(|own| own.kind == self.first.kind)?;
        let mut now = own.nanoseconds + self.passed;
        if own.kind == Kind::Clock && now + DAY / 2 < self.last {
            self.passed += DAY;
            now += DAY;
        }
        self.last = now;
        // Of whole nanoseconds below 2^53, which are 104 days, this is the double nearest to the decimal.
        Some((now - self.first.nanoseconds) as f64 / SECOND as f64)
    }

    /// How they were taken.
    pub fn taken(&self) -> String {
        let what = match self.first.kind {
            Kind::Clock => "times of the clock",
            Kind::Local | Kind::Utc => "time stamps",
        };
        let passed = if self.passed > 0 {
            ", past midnight"
        } else {
            ""
        };
        format!("{what} as seconds since the first row{passed}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str) -> Option<(Kind, i128)> {
        Stamp::parse(text).map(|own| (own.kind, own.nanoseconds))
    }

    #[test]
    fn stamps_are_points_in_time() {
        let second = |own: i128| own * SECOND;
        assert_eq!(at("1970-01-01T00:00:00Z"), Some((Kind::Utc, 0)));
        // GNU date: date -u -d '2024-02-29 12:34:56' +%s
        let leap = second(1_709_210_096);
        for text in [
            "2024-02-29T12:34:56Z",
            "2024-02-29 12:34:56+00:00",
            "2024-02-29T14:34:56+0200",
            "2024-02-29 07:04:56 -05:30",
            "2024-02-29t12:34:56 UTC",
        ] {
            assert_eq!(at(text), Some((Kind::Utc, leap)), "{text}");
        }
        assert_eq!(at("2024-02-29 12:34:56"), Some((Kind::Local, leap)));
        assert_eq!(
            at("2024-02-29 12:34"),
            Some((Kind::Local, leap - second(56)))
        );
        let half = leap + SECOND / 2;
        assert_eq!(at("2024-02-29 12:34:56,5"), Some((Kind::Local, half)));
        assert_eq!(
            at("2024-02-29 12:34:56.500000000999"),
            Some((Kind::Local, half))
        );
        assert_eq!(
            at("9:00:00.001"),
            Some((Kind::Clock, second(32_400) + 1_000_000))
        );
        for wrong in [
            "",
            "12:30",
            "25:00:00",
            "12:60:00",
            "12:00:61",
            "12:00:00:00",
            "12:0:00",
            "1:2:3",
            "2023-02-29 12:00:00",
            "2024-13-01 12:00:00",
            "2024-00-01 12:00:00",
            "2024-01-01",
            "2024-01-01T",
            "2024-01-01T12",
            "2024-01-01 12:00:00 CET",
            "2024-01-01 12:00:00+1",
            "01.02.2024 12:00:00",
            "12:00:00.",
            "12:00:00.x",
            "ä:00:00",
            "2024-01-0ä 12:00:00",
            "-1:00:00",
            "2024-01-01T12:00:00Zx",
        ] {
            assert_eq!(at(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn seconds_are_those_of_the_digits() {
        let mut clock = Stamps::new(Stamp::parse("23:59:59.90").unwrap());
        let seconds = ["23:59:59.95", "00:00:00.05", "0:00:01.9"].map(|text| clock.seconds(text));
        assert_eq!(seconds, [Some(0.05), Some(0.15), Some(2.0)]);
        assert!(clock.taken().ends_with("past midnight"));
        // Back by less than half a day is a mistake, and the reader says so.
        let mut clock = Stamps::new(Stamp::parse("12:00:01").unwrap());
        assert_eq!(clock.seconds("12:00:00"), Some(-1.0));
        assert_eq!(clock.seconds("2024-01-01 12:00:00"), None);
    }
}
