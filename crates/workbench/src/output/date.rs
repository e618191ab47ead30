//! Dates of files.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// When a file was last written; none where that is not known.
pub(crate) fn written(path: &Path) -> Option<SystemTime> {
    path.metadata().and_then(|metadata| metadata.modified()).ok()
}

/// The day of a time in UTC as ISO 8601 writes it: `2026-11-22`.
pub(crate) fn iso_day(time: SystemTime) -> String {
    const DAY: u64 = 86_400;
    let days = match time.duration_since(UNIX_EPOCH) {
        Ok(since) => (since.as_secs() / DAY) as i64,
        Err(before) => -(before.duration().as_secs().div_ceil(DAY) as i64),
    };
    // Days of whole years are counted off, then those of whole months.
    let is_leap = |year: i64| (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let (mut year, mut left) = (1970, days);
    while left < 0 {
        year -= 1;
        left += 365 + i64::from(is_leap(year));
    }
    while left >= 365 + i64::from(is_leap(year)) {
        left -= 365 + i64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + i64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if left < length {
            break;
        }
        left -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", left + 1)
}

/// How long ago, in the largest unit that it fills: `3 days`.
pub(crate) fn ago(age: Duration) -> String {
    let seconds = age.as_secs();
    let units =
        [(31_557_600, "year"), (86_400, "day"), (3600, "hour"), (60, "minute"), (1, "second")];
    let (length, name) =
        units.into_iter().find(|(length, _)| seconds >= *length).unwrap_or((1, "second"));
    let count = seconds / length;
    format!("{count} {name}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        let at = |seconds: u64| iso_day(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01");
        // POSIX: 2^31 - 1 s is 2038-01-19 03:14:07.
        assert_eq!(at((1 << 31) - 1), "2038-01-19");
        // 2000 is a leap year, 2100 none.
        assert_eq!(at(951_782_400), "2000-02-29");
        assert_eq!(at(951_868_800), "2000-03-01");
        assert_eq!(at(4_107_542_400), "2100-03-01");
        assert_eq!(iso_day(UNIX_EPOCH - Duration::from_secs(1)), "1969-12-31");
    }

    #[test]
    fn an_age_is_in_the_largest_unit_that_it_fills() {
        let of = |seconds| ago(Duration::from_secs(seconds));
        assert_eq!(
            (of(0), of(1), of(59)),
            ("0 seconds".into(), "1 second".into(), "59 seconds".into())
        );
        assert_eq!((of(7199), of(200_000)), ("1 hour".into(), "2 days".into()));
    }
}
