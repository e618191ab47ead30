//! Lists of run numbers as people and scripts write them: `1-20,33`.

use thiserror::Error;

/// Largest length of a list.
const MOST: u64 = 10_000_000;

/// A text that is not a list of numbers.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{text:?} is not a list of runs: {problem}; write it as in 1-20,33")]
pub struct NumbersError {
    /// The text.
    pub text: String,
    /// The problem with it.
    pub problem: String,
}

/// Writes numbers as ranges, in their order: 1, 2, 3, 7 as `1-3,7`.
#[must_use]
pub fn format(numbers: &[u64]) -> String {
    let mut parts: Vec<String> = Vec::new();
    let mut rest = numbers;
    while let Some(&first) = rest.first() {
        let consecutive = |(i, &number): (usize, &u64)| first.checked_add(i as u64) == Some(number);
        let length = rest.iter().enumerate().take_while(|&pair| consecutive(pair)).count();
        let last = rest[length - 1];
        parts.push(if length == 1 { first.to_string() } else { format!("{first}-{last}") });
        rest = &rest[length..];
    }
    parts.join(",")
}

/// Reads what [`format()`] writes.
///
/// # Errors
///
/// [`NumbersError`] for anything else, and for more than ten million numbers.
pub fn parse(text: &str) -> Result<Vec<u64>, NumbersError> {
    let wrong = |problem: String| NumbersError { text: text.to_owned(), problem };
    let mut numbers = Vec::new();
    for part in text.split(',') {
        let part = part.trim();
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |digits: &str| {
            let plain = digits.bytes().all(|byte| byte.is_ascii_digit());
            digits.parse::<u64>().ok().filter(|_| plain)
        };
        let (Some(first), Some(last)) = (number(first), number(last)) else {
            return Err(wrong(format!("{part:?} is neither a number nor a range")));
        };
        if first > last {
            return Err(wrong(format!("{part} runs backwards")));
        }
        if last - first >= MOST - (numbers.len() as u64).min(MOST) {
            return Err(wrong(format!("more than {MOST} numbers")));
        }
        numbers.extend(first..=last);
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn ranges_are_written_and_read() {
        assert_eq!(format(&[1, 2, 3, 7]), "1-3,7");
        assert_eq!(format(&[]), "");
        assert_eq!(format(&[5, 4, 4, u64::MAX]), "5,4,4,18446744073709551615");
        assert_eq!(parse("1-3, 7"), Ok(vec![1, 2, 3, 7]));
    }

    #[test]
    fn a_text_that_is_not_a_list_is_refused() {
        for wrong in
            ["", ",", "1-", "-1", "3-1", "a", "1 2", "+1", "1--2", "0-18446744073709551615", "1.5"]
        {
            assert!(parse(wrong).is_err(), "{wrong:?}");
        }
    }

    proptest! {
        #[test]
        fn every_list_reads_back(numbers in proptest::collection::vec(0..60u64, 1..40)) {
            prop_assert_eq!(parse(&format(&numbers)), Ok(numbers));
        }
    }
}
