//! Instructions, counted by valgrind's callgrind where it is installed: they do not depend on what else the machine does.

use std::process::Command;

/// What this program runs again under callgrind: `STUDY --only WHAT TIMES`.
pub(super) struct Counted<'a> {
    pub(super) study: &'a str,
    pub(super) what: &'a str,
}

/// Instructions of one run of something, as the difference between `2 times` runs and `times`; none where callgrind
/// is not there.
pub(super) fn of(counted: &Counted<'_>, times: u32) -> Option<f64> {
    Some((count(counted, 2 * times)? - count(counted, times)?) / f64::from(times))
}

fn count(counted: &Counted<'_>, times: u32) -> Option<f64> {
    let program = std::env::current_exe().ok()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args([counted.study, "--only", counted.what, &times.to_string()])
        .output()
        .ok()?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let collected = said.lines().find_map(|line| line.split_once("Collected :"))?.1;
    output.status.success().then(|| collected.trim().parse().ok())?
}
