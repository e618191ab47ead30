//! Instructions, counted by valgrind's callgrind where it is installed: they do not depend on what else the machine does.

use std::process::Command;

/// Arguments for running this program again under callgrind: `STUDY --only PART TIMES`.
pub(crate) struct Counted<'a> {
    pub(crate) study: &'a str,
    pub(crate) part: &'a str,
}

impl Counted<'_> {
    /// Instructions of one run of the part, as the difference between `2 times` runs and `times`; none without
    /// callgrind.
    pub(crate) fn instructions(&self, times: u32) -> Option<f64> {
        Some((self.of(2 * times)? - self.of(times)?) / f64::from(times))
    }

    fn of(&self, times: u32) -> Option<f64> {
        let program = std::env::current_exe().ok()?;
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(program)
            .args([self.study, "--only", self.part, &times.to_string()])
            .output()
            .ok()?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let collected = said.lines().find_map(|line| line.split_once("Collected :"))?.1;
        output.status.success().then(|| collected.trim().parse().ok())?
    }
}
