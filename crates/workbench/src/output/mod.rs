//! Results on disk: whole or not at all.
//!
//! A command that writes many files fills a [`RunFolder`]; one that writes a single file uses [`write_file`].

pub mod checksums;
pub(crate) mod date;
mod exchange;
mod file;
pub mod inputs;
pub mod kinds;
pub mod page;
mod run_folder;
pub mod work_folder;

use serde::Serialize;

pub use file::{check_file, write_file};
pub use run_folder::{Published, RunFolder, Staging};

use crate::error::{InputError, Mistake, RunError};

/// Folder of the runs of programs, in the folder of a calibration.
pub const CAMPAIGN: &str = "campaign";

/// Folder of the user's files, in an archive and in the folder of a run that was made of one.
pub(crate) const INPUTS: &str = "inputs";

/// A function that writes a file of a run: its name and its bytes.
pub type WriteFile<'a> = dyn Fn(&str, &[u8]) -> Result<(), RunError> + Sync + 'a;

/// Adds the remedy to an error of results that could not be written.
pub fn make_room(error: RunError) -> RunError {
    error.help("make room on the disk, or choose another folder with --out")
}

/// A text on one line and without control characters, which could break a table or pass for something else on a terminal.
pub fn on_one_line(text: &str) -> String {
    let shown =
        |c: char| if c.is_control() { c.escape_default().to_string() } else { c.to_string() };
    text.chars().map(shown).collect()
}

/// JSON as it is written to files.
pub fn pretty(value: &impl Serialize) -> Result<String, RunError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|error| {
        RunError::new(format_args!("the result cannot be written as JSON: {error}"))
    })?;
    text.push('\n');
    Ok(text)
}

/// Most threads of a pool per core: more do nothing but wait for each other, and results are the same for any number.
const THREADS_PER_CORE: usize = 8;

/// A pool of so many threads, at most 8 per core; of all cores where no number is given.
///
/// # Errors
///
/// [`InputError`] for more threads than the machine can start.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, InputError> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let started = threads.map_or(0, |threads| threads.min(THREADS_PER_CORE * cores));
    rayon::ThreadPoolBuilder::new().num_threads(started).build().map_err(|error| {
        InputError::new("--threads", Mistake::OutOfRange)
            .found(threads.map_or_else(|| "all cores".to_owned(), |n| n.to_string()))
            .expected(format_args!("as many threads as the machine can start ({error})"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pool_has_the_threads_that_were_asked_for_but_at_most_eight_per_core() {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        for asked in [1, 2, THREADS_PER_CORE * cores, THREADS_PER_CORE * cores + 1, usize::MAX] {
            let pool = pool(Some(asked)).expect("starts");
            assert_eq!(pool.current_num_threads(), asked.min(THREADS_PER_CORE * cores));
        }
    }
}
