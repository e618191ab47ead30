//! The terminal: progress bars, notes and warnings on standard error, results on standard output, Ctrl-C.

use std::borrow::Cow;
use std::ffi::OsStr;
use std::io::{IsTerminal, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use campaign::Stop;
use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use smc_calib::StageRecord;
use workbench::error::{Failure, RunError};
use workbench::output::Published;
use workbench::watch::Watch;

/// Effect of Ctrl-C on jobs on a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum OnInterrupt {
    /// They run on.
    #[default]
    Detach,
    /// They are ended.
    Cancel,
}

/// Watches a job on a terminal.
pub(crate) struct Terminal {
    quiet: bool,
    visible: bool,
    bar: Mutex<ProgressBar>,
    /// The step of the job that is under way, and of how many.
    step: AtomicU64,
    steps: AtomicU64,
    stop: Stop,
}

impl Terminal {
    /// The terminal of this process, which shows progress and notes unless `quiet`. It takes over Ctrl-C, termination
    /// and hang-up: the first asks the job to stop, a second ends the program at once.
    pub(crate) fn new(quiet: bool, on_interrupt: OnInterrupt) -> Self {
        let stop = Stop::new();
        let asked = stop.clone();
        // Without a handler the signals end the program as they always do.
        let _ = ctrlc::set_handler(move || {
            if asked.asked() {
                std::process::exit(130);
            }
            match on_interrupt {
                OnInterrupt::Detach => asked.detach(),
                OnInterrupt::Cancel => asked.cancel(),
            }
        });
        Self::of(quiet, stop)
    }

    fn of(quiet: bool, stop: Stop) -> Self {
        Self {
            quiet,
            visible: !quiet && std::io::stderr().is_terminal(),
            bar: Mutex::new(ProgressBar::hidden()),
            step: AtomicU64::new(0),
            steps: AtomicU64::new(0),
            stop,
        }
    }

    fn bar(&self) -> ProgressBar {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Says what became of an earlier run in the folder.
    pub(crate) fn announce(&self, published: &Published, out: &Path) {
        let out = out.display();
        match published {
            Published::New => {}
            Published::Replaced => {
                self.note(&format!("{out}: replaced the earlier run of the same plan"));
            }
            Published::MovedAside { kept, same_plan, earlier } => {
                let by_now = match earlier {
                    0 | 1 => String::new(),
                    n => format!(
                        "; {n} earlier runs are kept by now, delete those that are not needed"
                    ),
                };
                self.note(&format!(
                    "{out}: moved the earlier run to {}, as {}{by_now}",
                    kept.display(),
                    if *same_plan { "it holds other files too" } else { "its plan was another" }
                ));
            }
        }
    }

    /// Warnings of a finished job that the summary, which `quiet` leaves out, would have said.
    pub(crate) fn advise(&self, advice: &[String]) {
        if self.quiet {
            advice.iter().for_each(|line| self.warn(line));
        }
    }

    /// Prints a result on standard output: always where it is asked for as JSON, else its text unless `quiet`. Only the
    /// one that is printed is made.
    pub(crate) fn print_result(
        &self,
        as_json: bool,
        json: impl FnOnce() -> Result<String, RunError>,
        text: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        if as_json { write(json()?.as_bytes()) } else { self.print(text) }
    }

    /// Prints a text on standard output unless `quiet`.
    pub(crate) fn print(&self, text: impl FnOnce() -> String) -> Result<(), Failure> {
        if self.quiet { Ok(()) } else { report(&text()) }
    }
}

impl Terminal {
    /// Bar, pieces, time left and the present step of some work; where its pieces cannot be counted, how long it has taken.
    fn style(&self, total: u64, what: &str) -> ProgressStyle {
        let of = self.steps.load(Ordering::Relaxed);
        let (step, within) = match self.step.fetch_add(1, Ordering::Relaxed) + 1 {
            step if step <= of => (format!("step {step} of {of}: "), " in this step"),
            _ => (String::new(), ""),
        };
        let template = if total == 0 {
            format!("{{spinner}} {step}{what}, {{elapsed}} so far {{msg}}")
        } else {
            format!("{{bar:20}} {step}{{pos}}/{{len}} {what}{{left}} {{msg}}")
        };
        let left = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // The first piece tells how long they take.
            let known = state.pos() > 0 && state.len().is_some_and(|len| state.pos() < len);
            if known {
                let _ = write!(out, ", {:#} left{within}", HumanDuration(state.eta()));
            }
        };
        ProgressStyle::with_template(&template)
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .with_key("left", left)
    }
}

impl Drop for Terminal {
    /// What is printed after the job, errors too, has a line of its own.
    fn drop(&mut self) {
        self.bar().finish_and_clear();
    }
}

/// Does work that watches nothing and cannot be counted, and says so on a terminal while it lasts.
pub(crate) fn working<T>(quiet: bool, what: &'static str, work: impl FnOnce() -> T) -> T {
    let terminal = Terminal::of(quiet, Stop::new());
    terminal.begin(0, 0, what);
    work()
}

/// Prints a warning on standard error.
pub(crate) fn warning(text: &str) {
    eprintln!("{} {}", on_stderr(YELLOW, "warning:"), plain(text));
}

/// Prints an error on standard error.
pub(crate) fn error(text: &str) {
    eprintln!("{} {}", on_stderr(RED, "error:"), plain(text));
}

const BOLD: &str = "\u{1b}[1m";
const YELLOW: &str = "\u{1b}[1;33m";
const RED: &str = "\u{1b}[1;31m";
const END: &str = "\u{1b}[0m";

/// Whether colours are shown on a stream: on a terminal that has them, unless `NO_COLOR` is set to something
/// (<https://no-color.org>).
fn has_colours(is_terminal: bool, no_color: Option<&OsStr>, term: Option<&OsStr>) -> bool {
    is_terminal && no_color.is_none_or(OsStr::is_empty) && term.is_none_or(|term| term != "dumb")
}

fn colours_on(stream: &impl IsTerminal) -> bool {
    let (no_color, term) = (std::env::var_os("NO_COLOR"), std::env::var_os("TERM"));
    has_colours(stream.is_terminal(), no_color.as_deref(), term.as_deref())
}

fn on_stderr(colour: &str, word: &str) -> String {
    if colours_on(&std::io::stderr()) { format!("{colour}{word}{END}") } else { word.to_owned() }
}

/// Prints what a person reads on standard output; on a terminal headings are bold and warnings yellow, numbers plain.
pub(crate) fn report(text: &str) -> Result<(), Failure> {
    if !colours_on(&std::io::stdout()) {
        return write(text.as_bytes());
    }
    Ok(std::io::stdout().lock().write_all(painted(&plain(text)).as_bytes())?)
}

/// A text with its headings, the lines over indented ones, in bold and its words of warning in yellow.
fn painted(text: &str) -> String {
    const WARNINGS: [&str; 4] =
        ["careful:", "NOT TO BE TRUSTED", "NOT INFORMED", "NOT A POSTERIOR"];
    let mut painted = String::new();
    let mut lines = text.split_inclusive('\n').peekable();
    while let Some(line) = lines.next() {
        let indented = |line: &str| line.starts_with(' ') && !line.trim().is_empty();
        let heading = !line.starts_with(' ')
            && !line.trim().is_empty()
            && lines.peek().is_some_and(|next| indented(next));
        if heading {
            let end = line.trim_end().len();
            painted.extend([BOLD, &line[..end], END, &line[end..]]);
            continue;
        }
        let mut line = line.to_owned();
        for word in WARNINGS {
            line = line.replacen(word, &format!("{YELLOW}{word}{END}"), 1);
        }
        painted.push_str(&line);
    }
    painted
}

/// Writes on standard output.
pub(crate) fn write(bytes: &[u8]) -> Result<(), Failure> {
    let text = String::from_utf8_lossy(bytes);
    Ok(std::io::stdout().lock().write_all(plain(&text).as_bytes())?)
}

/// A text without control characters, which could change a terminal: names, titles and messages may come from files of
/// others. Line ends and tabs stay.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    let harmful = |c: char| c.is_control() && !matches!(c, '\n' | '\t');
    if text.contains(harmful) { text.replace(harmful, "\u{fffd}").into() } else { text.into() }
}

impl Watch for Terminal {
    fn stop(&self) -> &Stop {
        &self.stop
    }

    fn begin(&self, total: u64, done: u64, what: &'static str) {
        if !self.visible {
            return;
        }
        self.bar().finish_and_clear();
        let bar = ProgressBar::new(total);
        bar.set_style(self.style(total, what));
        bar.set_position(done);
        bar.reset_eta();
        bar.enable_steady_tick(Duration::from_millis(200));
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = bar;
    }

    fn steps(&self, of: u64) {
        self.step.store(0, Ordering::Relaxed);
        self.steps.store(of, Ordering::Relaxed);
    }

    fn advance(&self) {
        if self.visible {
            self.bar().inc(1);
        }
    }

    fn now(&self, what: &str) {
        if self.visible {
            self.bar().set_message(format!("({what})"));
        }
    }

    fn stage(&self, record: &StageRecord) {
        self.now(&format!("stage {}, ESS {:.0}", record.stage, record.ess));
    }

    fn end(&self) {
        self.bar().finish_and_clear();
    }

    fn note(&self, message: &str) {
        if !self.quiet {
            self.bar().suspend(|| eprintln!("note: {}", plain(message)));
        }
    }

    fn warn(&self, message: &str) {
        self.bar().suspend(|| warning(message));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_for_terminals_that_have_them_and_not_where_no_color_is_set() {
        let (set, empty, xterm) = (OsStr::new("1"), OsStr::new(""), OsStr::new("xterm"));
        assert!(has_colours(true, None, Some(xterm)));
        assert!(has_colours(true, Some(empty), None));
        assert!(!has_colours(false, None, Some(xterm)));
        assert!(!has_colours(true, Some(set), Some(xterm)));
        assert!(!has_colours(true, None, Some(OsStr::new("dumb"))));
    }

    #[test]
    fn headings_and_warnings_stand_out_and_numbers_are_plain() {
        let text = "PS: 44 observations\n  tau_s 0.07 s\n  careful: few\n\nlist\nrow 1\n";
        let shown = painted(text);
        assert_eq!(
            shown,
            format!(
                "{BOLD}PS: 44 observations{END}\n  tau_s 0.07 s\n  {YELLOW}careful:{END} few\n\nlist\nrow 1\n"
            )
        );
        let stripped = [BOLD, YELLOW, END].iter().fold(shown, |text, code| text.replace(code, ""));
        assert_eq!(stripped, text);
    }
}
