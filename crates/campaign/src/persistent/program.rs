//! A process that stays, and is given a line at a time.

use std::fs::{self, OpenOptions};
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use crate::executor::Stop;
use crate::folder::STDERR;
use crate::process::{Ended, Family, GLANCE, GRACE};
use crate::streams;

/// Longest line of a worker \[bytes\].
const LONGEST: u64 = 64 << 20;

/// Pause before a full pipe is written to again.
const FULL: Duration = Duration::from_millis(1);

/// A process that stays. It is ended with all that it has started when it is dropped.
#[derive(Debug)]
pub(super) struct Program {
    family: Family,
    stdin: Option<ChildStdin>,
    lines: Receiver<Line>,
    folder: PathBuf,
    over: bool,
}

/// What a process wrote to its stdout.
#[derive(Debug)]
enum Line {
    Whole(Vec<u8>),
    /// The last line, without its end.
    Partial(Vec<u8>),
    TooLong,
}

/// What came of a line that a process was given. After all but a line the process is over.
#[derive(Debug)]
pub(super) enum Reply {
    /// A line.
    Line(Vec<u8>),
    /// The process ended, or was ended.
    Ended(Ended),
    /// It ended well, but not its last line.
    Partial(Vec<u8>),
    /// It ended well, or closed its stdout, without a word.
    Nothing,
    /// The line is longer than any may be.
    TooLong,
}

impl Program {
    /// Starts a process whose working directory is `folder`, where its stderr is already.
    pub(super) fn start(command: &mut Command, folder: PathBuf) -> io::Result<Self> {
        command.current_dir(&folder).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut family = Family::start(command)?;
        let (stdin, stdout) = (family.child().stdin.take(), family.child().stdout.take());
        // One line waits at most: a process that writes without being asked is held up.
        let (sender, lines) = sync_channel(1);
        let mut program = Self { family, stdin, lines, folder, over: false };
        #[cfg(unix)]
        if let Some(stdin) = &program.stdin {
            rustix::fs::fcntl_setfl(stdin, rustix::fs::OFlags::NONBLOCK)?;
        }
        let stdout = stdout.ok_or_else(|| io::Error::other("it has no stdout"))?;
        // It is not waited for: a process that has left its session may hold the pipe.
        let reader = std::thread::Builder::new().spawn(move || read(stdout, &sender));
        if let Err(error) = reader {
            program.end()?;
            return Err(error);
        }
        Ok(program)
    }

    /// Whether it has ended by itself.
    pub(super) fn has_ended(&mut self) -> bool {
        self.over || self.family.wait(Duration::ZERO).unwrap_or(true)
    }

    /// Gives it a line, and waits for at most `limit` for one; `glance` is called every moment meanwhile.
    pub(super) fn exchange(
        &mut self,
        line: &[u8],
        limit: Duration,
        stop: &Stop,
        glance: &mut dyn FnMut(),
    ) -> io::Result<Reply> {
        let begun = Instant::now();
        let (mut glanced, mut gone) = (begun, false);
        let mut rest = line;
        loop {
            rest = self.write(rest);
            let longest = if rest.is_empty() { GLANCE } else { FULL };
            let patience = limit.saturating_sub(begun.elapsed()).min(longest);
            let why = match self.lines.recv_timeout(patience) {
                Ok(Line::Whole(line)) => return Ok(Reply::Line(line)),
                Ok(Line::TooLong) => {
                    self.end()?;
                    return Ok(Reply::TooLong);
                }
                Ok(Line::Partial(line)) => return self.last(Reply::Partial(line)),
                Err(RecvTimeoutError::Disconnected) => return self.last(Reply::Nothing),
                // Another process holds its stdout; what it had written has arrived by now.
                Err(RecvTimeoutError::Timeout) if gone => return self.last(Reply::Nothing),
                Err(RecvTimeoutError::Timeout) if stop.asked() => Ended::Stopped,
                Err(RecvTimeoutError::Timeout) if begun.elapsed() >= limit => Ended::TimedOut,
                Err(RecvTimeoutError::Timeout) => {
                    if glanced.elapsed() >= GLANCE {
                        glanced = Instant::now();
                        glance();
                        gone = self.family.wait(Duration::ZERO)?;
                    }
                    continue;
                }
            };
            self.end()?;
            return Ok(Reply::Ended(why));
        }
    }

    /// Moves what it has written to stderr to the end of another file.
    pub(super) fn move_stderr(&self, to: &Path) {
        let moved = || -> io::Result<()> {
            let path = self.folder.join(STDERR);
            if fs::metadata(&path)?.len() == 0 {
                return Ok(());
            }
            let mut file = OpenOptions::new().read(true).write(true).open(path)?;
            io::copy(&mut file, &mut OpenOptions::new().append(true).create(true).open(to)?)?;
            // What is written at that very moment may be lost; its next line is at the start.
            file.set_len(0)?;
            streams::reserve(&file);
            Ok(())
        };
        // The run itself meets what is wrong with the disk.
        let _ = moved();
    }

    /// The folder that it works in.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Lets it end: it is told so by the end of its input.
    pub(super) fn close(&mut self) {
        self.stdin = None;
    }

    /// Writes as much of a line as the pipe takes; returns the rest.
    fn write<'l>(&mut self, line: &'l [u8]) -> &'l [u8] {
        let mut rest = line;
        while let Some(stdin) = self.stdin.as_mut().filter(|_| !rest.is_empty()) {
            match stdin.write(rest) {
                Ok(written) if written > 0 => rest = &rest[written..],
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return rest,
                // It reads no more; how it ended is seen at its stdout.
                _ => return &[],
            }
        }
        rest
    }

    /// How a process ended whose stdout did; `otherwise` where it ended well, or does not end.
    fn last(&mut self, otherwise: Reply) -> io::Result<Reply> {
        if !self.family.wait(GRACE)? {
            self.end()?;
            return Ok(otherwise);
        }
        let ended = self.family.ended()?;
        self.family.end_strays();
        self.over = true;
        Ok(if ended == Ended::Exit(0) { otherwise } else { Reply::Ended(ended) })
    }

    /// Ends it with all that it has started.
    fn end(&mut self) -> io::Result<()> {
        self.close();
        self.over = true;
        let ended = self.family.end().inspect_err(|_| self.family.kill());
        self.family.end_strays();
        ended
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if !self.over {
            self.close();
            // It ends by itself, or is asked to.
            if matches!(self.family.wait(GRACE), Ok(true)) {
                let _ = self.family.ended();
                self.family.end_strays();
            } else {
                let _ = self.end();
            }
        }
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Passes lines on until there are no more, or nobody listens.
fn read(stdout: ChildStdout, sender: &SyncSender<Line>) {
    let mut stdout = BufReader::new(stdout);
    loop {
        let mut line = Vec::new();
        let read = (&mut stdout).take(LONGEST + 1).read_until(b'\n', &mut line);
        let (line, more) = match read {
            Ok(length) if length as u64 > LONGEST => (Line::TooLong, false),
            Ok(_) if line.ends_with(b"\n") => (Line::Whole(line), true),
            _ if line.is_empty() => return,
            _ => (Line::Partial(line), false),
        };
        if sender.send(line).is_err() || !more {
            return;
        }
    }
}
