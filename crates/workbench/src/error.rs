//! Failures as a user meets them, and the exit code of each: 2 for the user's mistakes, 1 for a run
//! that failed, 130 for one that was interrupted.

use std::fmt;

use thiserror::Error;

/// Kind of a mistake in an input, for code that must tell one from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Mistake {
    /// The file does not exist.
    MissingFile,
    /// The file exists and cannot be read, or is a directory.
    Unreadable,
    /// The file is larger than anything this program reads.
    TooLarge,
    /// The file is not text in UTF-8.
    NotUtf8,
    /// The file is not what this program wrote.
    Damaged,
    /// The file is not TOML, CSV or JSON where it should be.
    Syntax,
    /// A table without rows, or a file with nothing in it.
    Empty,
    /// A column that must be there is not.
    MissingColumn,
    /// A field or an option that must be there is not.
    MissingField,
    /// An unknown field or column, most likely misspelt.
    UnknownField,
    /// A name that is not one of a closed list.
    UnknownName,
    /// A value of the wrong type, such as text in place of a number.
    WrongType,
    /// Not a number, or infinite.
    NotFinite,
    /// A negative number where none can be.
    Negative,
    /// Times that go backwards.
    Unsorted,
    /// The same time twice.
    Duplicate,
    /// A number outside its range.
    OutOfRange,
    /// A lower bound at or above its upper bound.
    Bounds,
    /// A time window without an observation.
    EmptyWindow,
    /// Two statements that exclude each other.
    Conflict,
    /// A place that cannot be written to.
    Unwritable,
    /// An existing directory that this program did not write.
    NotOurs,
}

/// How many mistakes of one file are told at once.
pub const MOST_AT_ONCE: usize = 10;

/// A mistake in what the user gave: where, what was seen, what was expected, what to do.
///
/// ```
/// use workbench::error::{InputError, Mistake};
///
/// let error = InputError::new("my.csv", Mistake::WrongType)
///     .at_line(7)
///     .in_column("contact_ratio")
///     .found("\"abc\"")
///     .expected("a number >= 0")
///     .help("remove the row if nothing was measured");
/// assert_eq!(
///     error.to_string(),
///     "my.csv, line 7, column contact_ratio: found \"abc\", expected a number >= 0\n  \
///      help: remove the row if nothing was measured"
/// );
/// ```
#[derive(Debug, Clone, PartialEq, Error)]
#[must_use]
pub struct InputError {
    /// The kind of mistake.
    pub mistake: Mistake,
    /// File or option.
    pub source_name: Box<str>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Column or field, as in "column contact_ratio".
    pub field: Option<Box<str>>,
    /// Value that was seen.
    pub found: Option<Box<str>>,
    /// Expected value.
    pub expected: Option<Box<str>>,
    /// Remedies, the likeliest first.
    pub help: Vec<String>,
    /// The next mistake, where several were found at once.
    pub next: Option<Box<InputError>>,
}

impl InputError {
    /// Mistakes that were found at once, in this order, as one error; none where there are none. Beyond the first
    /// [`MOST_AT_ONCE`] they are counted.
    pub fn all(mistakes: Vec<Self>) -> Option<Self> {
        let more = mistakes.len().saturating_sub(MOST_AT_ONCE);
        let shown = mistakes.into_iter().take(MOST_AT_ONCE).rev();
        let mut chain: Option<Self> = None;
        for mut mistake in shown {
            if chain.is_none() && more > 0 {
                mistake = mistake.help(format_args!("{more} more mistakes are not shown"));
            }
            mistake.next = chain.map(Box::new);
            chain = Some(mistake);
        }
        chain
    }

    /// An error in a file or an option, with nothing else known yet.
    pub fn new(source_name: impl AsRef<str>, mistake: Mistake) -> Self {
        Self {
            mistake,
            source_name: source_name.as_ref().into(),
            line: None,
            field: None,
            found: None,
            expected: None,
            help: Vec::new(),
            next: None,
        }
    }

    /// At a line, from 1.
    pub fn at_line(mut self, line: usize) -> Self {
        self.line = Some(line);
        self
    }

    /// In a column of a table.
    pub fn in_column(mut self, name: impl fmt::Display) -> Self {
        self.field = Some(format!("column {name}").into());
        self
    }

    /// In a field of a TOML or JSON file.
    pub fn in_field(mut self, name: impl fmt::Display) -> Self {
        self.field = Some(format!("field {name}").into());
        self
    }

    /// Adds the value that was seen, as it is to be shown.
    pub fn found(mut self, found: impl fmt::Display) -> Self {
        self.found = Some(shortened(&found.to_string()).into());
        self
    }

    /// Expected value.
    pub fn expected(mut self, expected: impl fmt::Display) -> Self {
        self.expected = Some(expected.to_string().into());
        self
    }

    /// Adds a remedy; may be called several times.
    pub fn help(mut self, help: impl fmt::Display) -> Self {
        self.help.push(help.to_string());
        self
    }

    /// Adds a remedy, if there is one.
    pub fn help_if(self, help: Option<impl fmt::Display>) -> Self {
        match help {
            Some(help) => self.help(help),
            None => self,
        }
    }

    /// Offers the choice most like a misspelt name, if one is near enough.
    pub fn did_you_mean<'a>(self, name: &str, choices: impl IntoIterator<Item = &'a str>) -> Self {
        self.help_if(nearest(name, choices).map(|near| format!("did you mean {near}?")))
    }
}

/// A user's text for a message: one line, at most 120 characters, no control characters.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 120;
    let mut short: String =
        text.chars().take(LONGEST).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().count() > LONGEST {
        short.push('…');
    }
    short
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.source_name)?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(field) = &self.field {
            write!(f, ", {field}")?;
        }
        match (&self.found, &self.expected) {
            (Some(found), Some(expected)) => write!(f, ": found {found}, expected {expected}")?,
            (Some(found), None) => write!(f, ": {found}")?,
            (None, Some(expected)) => write!(f, ": expected {expected}")?,
            (None, None) => {}
        }
        for help in &self.help {
            write!(f, "\n  help: {help}")?;
        }
        match &self.next {
            Some(next) => write!(f, "\n{next}"),
            None => Ok(()),
        }
    }
}

/// A run that could not succeed although its input was right.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[must_use]
pub struct RunError {
    /// Cause of the failure.
    pub cause: String,
    /// Remedies.
    pub help: Vec<String>,
}

impl RunError {
    /// A failed run with its cause.
    pub fn new(cause: impl fmt::Display) -> Self {
        Self { cause: cause.to_string(), help: Vec::new() }
    }

    /// Adds a remedy; may be called several times.
    pub fn help(mut self, help: impl fmt::Display) -> Self {
        self.help.push(help.to_string());
        self
    }
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cause)?;
        for help in &self.help {
            write!(f, "\n  help: {help}")?;
        }
        Ok(())
    }
}

/// Why a command ended without success.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Failure {
    /// The user's mistake: exit 2.
    #[error("{0}")]
    Input(#[from] InputError),
    /// A failed run: exit 1.
    #[error("{0}")]
    Run(#[from] RunError),
    /// Stopped by Ctrl-C: exit 130, as shells expect.
    #[error("interrupted; nothing was written")]
    Interrupted,
    /// Stopped by Ctrl-C with everything that finished stored, and how to go on: exit 130.
    #[error("{0}")]
    Paused(String),
    /// The reader of standard output went away (`calibrate simulate ... | head`): exit 0, no message.
    #[error("standard output was closed")]
    OutputClosed,
    /// The mistakes were printed already, as by `check` over several files: exit 2, no message.
    #[error("mistakes were reported")]
    InputReported,
}

impl Failure {
    /// The exit code. The one place where it is decided, but for the command line itself, where clap
    /// says 2 for a mistake as well.
    pub fn code(&self) -> u8 {
        match self {
            Self::Input(_) | Self::InputReported => 2,
            Self::Run(_) => 1,
            Self::Interrupted | Self::Paused(_) => 130,
            Self::OutputClosed => 0,
        }
    }
}

/// A failed write to standard output: closed by its reader is no failure, a full disk is.
impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            Self::OutputClosed
        } else {
            Self::Run(RunError::new(format_args!("cannot write to standard output: {error}")))
        }
    }
}

/// The choice most like a misspelt name, if one is near enough.
pub fn nearest<'a>(name: &str, choices: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    choices
        .into_iter()
        .map(|choice| (strsim::damerau_levenshtein(&lower, &choice.to_lowercase()), choice))
        .filter(|(distance, choice)| *distance <= 1 + choice.len() / 4)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, choice)| choice)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exit_codes_tell_the_users_mistakes_from_failed_runs() {
        let input = Failure::from(InputError::new("x", Mistake::Empty));
        let run = Failure::from(RunError::new("every simulation failed"));
        assert_eq!((input.code(), run.code()), (2, 1));
        assert_eq!(Failure::Interrupted.code(), 130);
        let broken_pipe = std::io::Error::from(std::io::ErrorKind::BrokenPipe);
        assert_eq!(Failure::from(broken_pipe).code(), 0);
        let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
        assert_eq!(Failure::from(full).code(), 1);
    }

    #[test]
    fn nearest_offers_a_misspelt_name_and_nothing_for_another_word() {
        let fields = ["radius_m", "density_kg_per_m3", "source"];
        assert_eq!(nearest("raduis_m", fields), Some("radius_m"));
        assert_eq!(nearest("Radius", fields), Some("radius_m"));
        assert_eq!(nearest("surce", fields), Some("source"));
        assert_eq!(nearest("temperature", fields), None);
    }

    #[test]
    fn mistakes_that_are_found_at_once_are_told_together_and_counted_beyond_ten() {
        let mistake = |line| InputError::new("f", Mistake::WrongType).at_line(line).found("x");
        assert_eq!(InputError::all(Vec::new()), None);
        let two = InputError::all(vec![mistake(3), mistake(7)]).expect("two");
        assert_eq!((two.line, two.to_string().as_str()), (Some(3), "f, line 3: x\nf, line 7: x"));
        let many = InputError::all((1..=15).map(mistake).collect()).expect("many").to_string();
        assert_eq!(many.lines().count(), 11, "{many}");
        assert!(many.ends_with("f, line 10: x\n  help: 5 more mistakes are not shown"), "{many}");
    }

    #[test]
    fn a_message_never_carries_control_characters_or_a_megabyte() {
        let error = InputError::new("f", Mistake::WrongType).found("a\u{1b}[31m\n".repeat(1000));
        let text = error.to_string();
        assert!(!text.contains(['\u{1b}', '\n']) && text.len() < 200, "{text}");
    }
}
