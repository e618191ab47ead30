//! The directory: what it refuses, and what comes back from it.

use std::collections::BTreeMap;
use std::fs;

use campaign::{
    Campaign, CampaignError, Executor, ExecutorError, FailureKind, Fault, InProcess, Outcome, Stop,
    Task,
};
use proptest::prelude::*;
use serde_json::json;

use crate::sandbox::{Sandbox, bits, create, rows, run, shell, spec, task, tasks};

fn function(outputs: u32) -> campaign::CommandSpec {
    let mut command = shell("");
    command.call.argv.clear();
    command.outputs = if outputs == 0 { vec![] } else { vec![rows("-", "x", outputs)] };
    command
}

#[test]
fn whatever_was_stored_is_there_after_opening_it_again() {
    let sandbox = Sandbox::new();
    let extra = BTreeMap::from([
        ("plan.toml".to_owned(), b"a = 1\n".to_vec()),
        ("data.bin".to_owned(), vec![0, 255, 10, 13]),
    ]);
    let spec = spec(function(1));
    let campaign = Campaign::create(&sandbox.dir(), &spec, &extra).unwrap();
    assert!(campaign.is_new());
    campaign.record_submitted(&tasks(3)).unwrap();
    let failed = Outcome::Failed {
        kind: FailureKind::Timeout { limit_s: 0.1 },
        detail: "x\n\"y\" \u{1f980}".into(),
        attempts: 2,
        seconds: 0.1,
    };
    campaign.record(vec![(2, failed.clone())]).unwrap();
    campaign.record_iteration(0, &json!({"ess": 0.1, "mixture": [1e-300, -0.0]})).unwrap();
    campaign.record_iteration(1, &json!({"ess": 0.2})).unwrap();
    campaign.record_iteration(1, &json!({"ess": 0.3})).unwrap();
    let id = campaign.id().to_owned();
    drop(campaign);

    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert_eq!(damage, []);
    assert!(!campaign.is_new());
    assert_eq!((campaign.spec(), campaign.id()), (&spec, id.as_str()));
    assert_eq!(campaign.extra("plan.toml"), Some(&b"a = 1\n"[..]));
    assert_eq!(campaign.extra("data.bin"), Some(&[0, 255, 10, 13][..]));
    assert_eq!(campaign.tasks(), tasks(3));
    assert_eq!(campaign.outcome(2), Some(failed));
    assert_eq!(campaign.outcome(1), None);
    let iterations = campaign.iterations();
    assert_eq!(iterations[&1], json!({"ess": 0.3}));
    let zero = iterations[&0]["mixture"][1].as_f64().unwrap();
    assert_eq!(zero.to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn a_second_driver_is_told_who_has_the_directory() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(function(0)));
    let error = Campaign::open(&sandbox.dir()).unwrap_err();
    let CampaignError::Locked { holder: Some(holder), .. } = &error else { panic!("{error}") };
    assert_eq!(holder.pid, std::process::id());
    let words = format!("is in use by process {} on ", std::process::id());
    assert!(error.to_string().contains(&words), "{error}");
    let second = Campaign::create(&sandbox.dir(), &spec(function(0)), &BTreeMap::new());
    assert!(matches!(second, Err(CampaignError::Exists { .. })), "{second:?}");
    drop(campaign);
    Campaign::open(&sandbox.dir()).unwrap();
}

#[test]
fn a_directory_of_somebody_else_is_not_touched() {
    let sandbox = Sandbox::new();
    let dir = sandbox.dir();
    fs::create_dir(&dir).unwrap();
    fs::write(dir.join("thesis.tex"), "years of work").unwrap();
    let error = Campaign::create(&dir, &spec(function(0)), &BTreeMap::new()).unwrap_err();
    assert!(matches!(error, CampaignError::Exists { .. }), "{error}");
    let names: Vec<_> = fs::read_dir(&dir).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["thesis.tex"]);
    let error = Campaign::open(&dir).unwrap_err();
    assert!(matches!(error, CampaignError::NotACampaign { .. }), "{error}");
    drop(create(&sandbox.file("other"), &spec(function(0))));
    let again = Campaign::create(&sandbox.file("other"), &spec(function(0)), &BTreeMap::new());
    assert!(matches!(again, Err(CampaignError::Exists { .. })), "{again:?}");
}

#[test]
fn what_an_interrupted_create_left_is_used_again() {
    let sandbox = Sandbox::new();
    let extra = BTreeMap::from([("plan.toml".to_owned(), b"x".to_vec())]);
    drop(Campaign::create(&sandbox.dir(), &spec(function(0)), &extra).unwrap());
    // The record is written last.
    fs::remove_file(sandbox.dir().join("campaign.json")).unwrap();
    fs::write(sandbox.dir().join(".campaign-abc.tmp"), "half").unwrap();
    let campaign = Campaign::create(&sandbox.dir(), &spec(function(0)), &extra).unwrap();
    campaign.record_submitted(&tasks(1)).unwrap();
}

#[test]
fn a_number_stands_for_one_set_of_parameters() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(function(1)));
    campaign.record_submitted(&tasks(3)).unwrap();
    campaign.record_submitted(&tasks(4)).unwrap();
    let mut other = task(1);
    other.parameters[0] = f64::from_bits(other.parameters[0].to_bits() + 1);
    let error = campaign.record_submitted(&[task(9), other.clone()]).unwrap_err();
    assert!(matches!(error, CampaignError::TaskDiffers { number: 1, .. }), "{error}");
    assert_eq!(campaign.task(9), None, "nothing of a refused call is stored");
    let twice = campaign.record_submitted(&[task(9), Task { number: 9, ..other }]).unwrap_err();
    assert!(matches!(twice, CampaignError::TaskDiffers { number: 9, .. }), "{twice}");
    for (wrong, words) in [
        (Task { command: 1, ..task(8) }, "command 1 of 1"),
        (Task { parameters: vec![1.0], ..task(8) }, "1 parameters, there are 2"),
        (Task { parameters: vec![1.0, f64::NAN], ..task(8) }, "b = NaN is not a number"),
    ] {
        let error = campaign.record_submitted(&[wrong]).unwrap_err();
        assert_eq!(error.to_string(), format!("run 8: {words}"));
    }
    let finished =
        |values: &[f64]| Outcome::Finished { values: values.to_vec(), attempts: 1, seconds: 0.0 };
    for (number, values) in [(8, &[1.0][..]), (1, &[1.0, 2.0]), (1, &[f64::INFINITY])] {
        let error = campaign.record(vec![(number, finished(values))]).unwrap_err();
        assert!(matches!(error, CampaignError::InvalidOutcome { .. }), "{error}");
    }
    campaign.record(vec![(1, finished(&[1.0]))]).unwrap();
    campaign.record(vec![(1, finished(&[2.0]))]).unwrap();
    assert_eq!(campaign.outcome(1), Some(finished(&[1.0])), "the first outcome counts");
}

#[test]
fn names_that_would_leave_the_directory_or_hide_our_files_are_refused() {
    for name in ["", "a/b", "..", ".x", "lock", "tasks.jsonl", "work", "a\0"] {
        let sandbox = Sandbox::new();
        let extra = BTreeMap::from([(name.to_owned(), vec![])]);
        let error = Campaign::create(&sandbox.dir(), &spec(function(0)), &extra).unwrap_err();
        assert!(matches!(error, CampaignError::FileName { .. }), "{name:?}: {error}");
    }
}

#[test]
fn mistakes_in_a_specification_are_named() {
    type Spoil = fn(&mut campaign::CampaignSpec);
    let cases: [(&str, Spoil); 12] = [
        ("parameter_names[1]", |s| s.parameter_names[1] = "a".into()),
        ("parameter_names[0]", |s| s.parameter_names[0] = "seed".into()),
        ("parameter_names[0]", |s| s.parameter_names[0] = "{".into()),
        ("commands", |s| s.commands.clear()),
        ("commands[0].call.timeout_s", |s| s.commands[0].call.timeout_s = f64::NAN),
        ("commands[0].call.argv[0]", |s| s.commands[0].call.argv[0] = "./run.sh".into()),
        ("commands[0].call.argv[2]", |s| s.commands[0].call.argv[2] = "{c}".into()),
        ("commands[0].call.environment.X", |s| {
            s.commands[0].call.environment.insert("X".into(), "{".into());
        }),
        ("commands[0].outputs", |s| s.commands[0].outputs.clear()),
        ("commands[0].outputs[0].result.file", |s| {
            s.commands[0].outputs[0].result.file = "../x".into()
        }),
        ("commands[0].outputs[0].at", |s| s.commands[0].outputs[0].at[0] = f64::INFINITY),
        ("commands[0].outputs[0].result.interpolate", |s| {
            s.commands[0].outputs[0].result.interpolate = campaign::Interpolation::Linear;
        }),
    ];
    for (field, spoil) in cases {
        let mut spec = spec(shell("true"));
        assert_eq!(spec.check(), Ok(()));
        spoil(&mut spec);
        assert_eq!(spec.check().unwrap_err().field, field);
        let refused = Campaign::create(&Sandbox::new().dir(), &spec, &BTreeMap::new());
        assert!(matches!(refused, Err(CampaignError::Spec(_))), "{field}");
    }
}

#[test]
fn threads_of_this_process_store_the_same_for_any_number_of_them() {
    let mut stored = Vec::new();
    for threads in [1, 2, 7] {
        let sandbox = Sandbox::new();
        let campaign = create(&sandbox.dir(), &spec(function(0)));
        let mut pool = InProcess::new(threads, |task: &Task| match task.number {
            13 => Err(Fault::Run("it is unlucky".into())),
            14 => Ok(vec![f64::NAN]),
            _ => Ok(vec![task.parameters[0].sin(), task.parameters[1]]),
        })
        .unwrap();
        let mut ended = 0;
        let mut watch = |_| ended += 1;
        pool.run(&campaign, &tasks(200), &mut watch, &Stop::new()).unwrap();
        assert_eq!(ended, 200);
        drop(campaign);
        let (campaign, _) = Campaign::open(&sandbox.dir()).unwrap();
        let outcomes = (0..200).map(|number| campaign.outcome(number).unwrap());
        let all: Vec<_> = outcomes
            .map(|o| (o.values().map(bits), o.failure().map(ToString::to_string)))
            .collect();
        assert_eq!(all[13].1.as_deref(), Some("it is unlucky"));
        assert_eq!(all[14].1.as_deref(), Some("an output is not a number"));
        stored.push(all);
    }
    assert_eq!(stored[0], stored[1]);
    assert_eq!(stored[0], stored[2]);
}

#[test]
fn a_fatal_fault_and_a_stop_keep_what_had_finished() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(function(0)));
    let mut pool = InProcess::new(1, |task: &Task| match task.number {
        5 => Err(Fault::Fatal("the licence server is gone".into())),
        _ => Ok(vec![1.0]),
    })
    .unwrap();
    let error = pool.run(&campaign, &tasks(10), &mut |_| (), &Stop::new()).unwrap_err();
    assert!(matches!(&error, ExecutorError::Simulator(why) if why.contains("licence")), "{error}");
    assert!(campaign.outcome(5).is_none() && campaign.missing(&tasks(10)).len() < 10);

    let stop = Stop::new();
    let stopper = stop.clone();
    let mut pool = InProcess::new(1, move |task: &Task| {
        if task.number == 7 {
            stopper.cancel();
        }
        Ok(vec![1.0])
    })
    .unwrap();
    let error = pool.run(&campaign, &tasks(10), &mut |_| (), &stop).unwrap_err();
    assert!(matches!(error, ExecutorError::Interrupted { detached: false }), "{error}");
    assert!(campaign.outcome(7).is_some() && !campaign.missing(&tasks(10)).is_empty());
}

#[test]
fn results_of_another_command_are_not_taken_for_this_ones() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(shell("printf 'x\\n1\\n' > out.csv")));
    run(&campaign, &tasks(2));
    drop(campaign);
    fs::write(sandbox.dir().join("campaign.json"), "gone").unwrap();
    let error = Campaign::open(&sandbox.dir()).unwrap_err();
    assert!(matches!(error, CampaignError::Damaged { .. }), "{error}");
    let other = spec(shell("printf 'x\\n2\\n' > out.csv"));
    let (campaign, damage) = Campaign::restore(&sandbox.dir(), &other, &BTreeMap::new()).unwrap();
    assert_eq!(damage.len(), 1);
    assert_eq!(campaign.missing(&tasks(2)).len(), 2);
    run(&campaign, &tasks(2));
    assert_eq!(crate::sandbox::values(&campaign, 1), [2.0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn any_finite_number_comes_back_with_its_bits(
        raw in proptest::collection::vec(any::<u64>(), 1..40),
    ) {
        let finite: Vec<f64> =
            raw.into_iter().map(f64::from_bits).filter(|x| x.is_finite()).collect();
        let sandbox = Sandbox::new();
        let campaign = create(&sandbox.dir(), &spec(function(0)));
        let pair = |x: f64| vec![x, -x];
        let all: Vec<Task> = finite.iter().zip(0..)
            .map(|(&x, number)| Task { number, command: 0, parameters: pair(x) })
            .collect();
        campaign.record_submitted(&all).unwrap();
        let outcomes = all.iter().map(|task| {
            let values = finite.iter().map(|x| x * task.parameters[0]).filter(|x| x.is_finite());
            let values = values.chain(pair(task.parameters[0])).collect();
            (task.number, Outcome::Finished { values, attempts: 1, seconds: 0.5 })
        });
        let outcomes: Vec<_> = outcomes.collect();
        campaign.record(outcomes.clone()).unwrap();
        drop(campaign);
        let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
        prop_assert_eq!(damage, vec![]);
        for (task, (number, outcome)) in all.iter().zip(outcomes) {
            prop_assert_eq!(bits(&campaign.task(number).unwrap().parameters), bits(&task.parameters));
            let back = campaign.outcome(number).unwrap();
            prop_assert_eq!(bits(back.values().unwrap()), bits(outcome.values().unwrap()));
        }
    }
}
