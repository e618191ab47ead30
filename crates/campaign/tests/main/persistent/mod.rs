//! Workers: programs that stay and are asked for one run after the other.

mod faults;
mod life;

use campaign::{ANSWER, Call, Campaign, CommandSpec, Event, Format, OutputSpec, ResultSpec};

use crate::sandbox::{Sandbox, bits, rows, tasks, values};

/// A worker in a shell: `fault` is done before an answer to a request, of which $id, $run, $a, $b and $folder are known.
/// Its starts and requests are lines of files beside the campaign.
pub(super) fn worker(sandbox: &Sandbox, fault: &str) -> CommandSpec {
    let script = format!(
        r#"cd "$0"; echo $$ >> starts
get() {{{{ echo "$line" | sed "s/.*\"$1\":\"*\([^,\"}}}}]*\).*/\1/"; }}}}
once() {{{{ if [ -e "once-$run" ]; then return 1; fi; touch "once-$run"; }}}}
read -r line; echo '{{{{"protocol": 1}}}}'
while read -r line; do
  id=$(get id); run=$(get run); a=$(get a); b=$(get b); folder=$(get folder); echo $run >> requests
  {fault}
  echo "{{{{\"id\": $id, \"values\": {{{{\"x\": [$a, $b]}}}}}}}}"
done"#
    );
    let dir = sandbox.file("").display().to_string();
    let argv = vec!["sh".to_owned(), "-c".to_owned(), script, dir];
    let call = Call { worker: true, timeout_s: 60.0, ..Call::new(argv) };
    let OutputSpec { result, at } = rows(ANSWER, "x", 2);
    let outputs = vec![OutputSpec { result: ResultSpec { format: Format::Json, ..result }, at }];
    CommandSpec { name: "worker".into(), call, outputs }
}

pub(super) fn pids(sandbox: &Sandbox, file: &str) -> Vec<i32> {
    sandbox.lines(file).iter().map(|pid| pid.parse().unwrap()).collect()
}

#[track_caller]
pub(super) fn all_are_right(campaign: &Campaign, count: u64) {
    for task in tasks(count) {
        assert_eq!(bits(&values(campaign, task.number)), bits(&task.parameters));
    }
}

pub(super) fn retried(events: &[Event]) -> usize {
    events.iter().filter(|event| matches!(event, Event::Retried { .. })).count()
}
