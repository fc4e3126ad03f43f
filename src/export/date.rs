//! Dates as FMI writes them.

/// `YYYY-MM-DDThh:mm:ssZ` of so many seconds since 1970 (H. Hinnant, chrono-compatible low-level date
/// algorithms, `civil_from_days`); `None` beyond the year 9999.
pub fn of_epoch(seconds: u64) -> Option<String> {
    const DAY: u64 = 86_400;
    // Days since 0000-03-01, in eras of 400 years; years begin with March.
    let days = seconds / DAY + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    let second = seconds % DAY;
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    (year <= 9999)
        .then(|| format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z"))
}

#[cfg(test)]
mod tests {
    use super::of_epoch;

    /// As `date --utc --date=@SECONDS` says.
    #[test]
    fn dates_of_seconds() {
        for (seconds, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_709_251_200, "2024-03-01T00:00:00Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
            (253_402_300_799, "9999-12-31T23:59:59Z"),
        ] {
            assert_eq!(of_epoch(seconds).as_deref(), Some(date));
        }
        assert_eq!(of_epoch(253_402_300_800), None);
    }
}
