//! Damage anywhere: never a panic, never a wrong value, and everything that is whole is used.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use campaign::{Campaign, CampaignError, Damage, Outcome, Stop, run_task, status};
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::sandbox::{Sandbox, create, run, shell, spec, tasks};

const TASKS: u64 = 12;

/// A directory with everything in it, and what must come out of it.
struct Original {
    _sandbox: Sandbox,
    files: BTreeMap<PathBuf, Vec<u8>>,
    outcomes: BTreeMap<u64, Outcome>,
}

fn the_spec() -> campaign::CampaignSpec {
    spec(shell("if [ $3 = 3 ]; then exit 3; fi; printf 'x\\n%s\\n' $1 > out.csv"))
}

fn extra() -> BTreeMap<String, Vec<u8>> {
    BTreeMap::from([("plan.toml".to_owned(), b"seed = 1\n[powder]\nradius_m = 3e-5\n".to_vec())])
}

fn original() -> &'static Original {
    static ORIGINAL: OnceLock<Original> = OnceLock::new();
    ORIGINAL.get_or_init(|| {
        let sandbox = Sandbox::new();
        let dir = sandbox.dir();
        let campaign = Campaign::create(&dir, &the_spec(), &extra()).unwrap();
        run(&campaign, &tasks(8));
        campaign.record_iteration(0, &json!({"ess": 0.25})).unwrap();
        campaign.record_iteration(1, &json!({"ess": 0.5})).unwrap();
        campaign.record_submitted(&tasks(TASKS)).unwrap();
        let mut outcomes: BTreeMap<u64, Outcome> =
            (0..8).map(|number| (number, campaign.outcome(number).unwrap())).collect();
        for number in 8..TASKS - 1 {
            outcomes.insert(number, run_task(&dir, number, &Stop::new()).unwrap());
        }
        drop(campaign);
        let mut files = BTreeMap::new();
        for folder in ["", "outcomes", "iterations"] {
            for entry in fs::read_dir(dir.join(folder)).unwrap() {
                let path = entry.unwrap().path();
                if path.is_file() {
                    let name = path.strip_prefix(&dir).unwrap().to_path_buf();
                    files.insert(name, fs::read(&path).unwrap());
                }
            }
        }
        assert!(files.len() >= 4 + 3 + 2 && outcomes.len() as u64 == TASKS - 1);
        Original { _sandbox: sandbox, files, outcomes }
    })
}

fn copy(dir: &Path) {
    for folder in ["outcomes", "iterations", "work"] {
        fs::create_dir_all(dir.join(folder)).unwrap();
    }
    for (name, contents) in &original().files {
        fs::write(dir.join(name), contents).unwrap();
    }
}

#[derive(Debug, Clone)]
enum Fault {
    /// The file ends at this fraction of its length.
    Truncate(f64),
    /// One bit, by fraction of the length and number.
    Flip(f64, u8),
    /// Zeros over a part, as after a crash of the machine.
    Zeros(f64, usize),
    /// A part is there twice.
    Double(f64, usize),
    /// The file is gone.
    Remove,
    /// Something else altogether.
    Replace(Vec<u8>),
    /// A directory of its name.
    Directory,
}

fn apply(fault: &Fault, contents: &[u8]) -> Option<Vec<u8>> {
    let place = |at: f64| ((contents.len() as f64 * at) as usize).min(contents.len());
    let mut damaged = contents.to_vec();
    match fault {
        Fault::Truncate(at) => damaged.truncate(place(*at)),
        Fault::Flip(at, bit) => {
            if let Some(byte) = damaged.get_mut(place(*at)) {
                *byte ^= 1 << bit;
            }
        }
        Fault::Zeros(at, length) => {
            let from = place(*at);
            let to = (from + length).min(damaged.len());
            damaged[from..to].fill(0);
        }
        Fault::Double(at, length) => {
            let from = place(*at);
            let part = contents[from..(from + length).min(contents.len())].to_vec();
            damaged.splice(from..from, part);
        }
        Fault::Remove | Fault::Directory => return None,
        Fault::Replace(other) => damaged.clone_from(other),
    }
    Some(damaged)
}

fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        4 => (0.0..1.0).prop_map(Fault::Truncate),
        8 => ((0.0..1.0), 0u8..8).prop_map(|(at, bit)| Fault::Flip(at, bit)),
        2 => ((0.0..1.0), 1usize..300).prop_map(|(at, length)| Fault::Zeros(at, length)),
        2 => ((0.0..1.0), 1usize..300).prop_map(|(at, length)| Fault::Double(at, length)),
        1 => Just(Fault::Remove),
        1 => proptest::collection::vec(any::<u8>(), 0..200).prop_map(Fault::Replace),
        1 => Just(Fault::Directory),
    ]
}

/// Numbers of the runs whose outcomes are untouched, found line by line and file by file.
fn untouched(damaged: &Damaged) -> BTreeSet<u64> {
    let mut numbers = BTreeSet::new();
    for (name, contents) in &original().files {
        let now = match damaged.get(name) {
            Some(None) => continue,
            Some(Some(now)) => now,
            None => contents,
        };
        let whole: BTreeSet<&[u8]> = contents.split(|&byte| byte == b'\n').collect();
        if name == Path::new("results.jsonl") || name.starts_with("outcomes") {
            for line in now.split(|&byte| byte == b'\n') {
                if !line.is_empty() && whole.contains(line) {
                    let value: Value = serde_json::from_slice(line).unwrap();
                    numbers.insert(value["number"].as_u64().unwrap());
                }
            }
        }
    }
    numbers
}

type Damaged = BTreeMap<PathBuf, Option<Vec<u8>>>;

/// Does damage to the files in `dir`, at most once to each, and gives what they hold now.
fn spoil(dir: &Path, faults: &[(usize, Fault)]) -> Damaged {
    let names: Vec<&PathBuf> = original().files.keys().collect();
    let mut damaged = Damaged::new();
    for (which, fault) in faults {
        let name = names[which % names.len()];
        if damaged.contains_key(name) {
            continue;
        }
        let path = dir.join(name);
        let now = apply(fault, &original().files[name]);
        match &now {
            Some(now) => fs::write(&path, now).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        if matches!(fault, Fault::Directory) {
            fs::create_dir(&path).unwrap();
        }
        damaged.insert(name.clone(), now);
    }
    // The lock says only who has it; an untouched file is no damage.
    damaged.retain(|name, now| {
        name != Path::new("lock") && now.as_ref() != original().files.get(name)
    });
    damaged
}

/// Opens the campaign, restored where its record is damaged; none where it rightly counts as no campaign.
fn open(dir: &Path, damaged: &Damaged) -> Result<Option<(Campaign, Vec<Damage>)>, TestCaseError> {
    match Campaign::open(dir) {
        Ok(opened) => Ok(Some(opened)),
        Err(CampaignError::Damaged { file, .. }) => {
            prop_assert!(damaged.contains_key(Path::new("campaign.json")), "{:?}", file);
            Ok(Some(Campaign::restore(dir, &the_spec(), &extra()).unwrap()))
        }
        Err(CampaignError::NotACampaign { .. }) => {
            let gone = |name: &str| damaged.get(Path::new(name)) == Some(&None);
            prop_assert!(gone("campaign.json") && gone("tasks.jsonl"));
            Ok(None)
        }
        Err(other) => Err(TestCaseError::fail(other.to_string())),
    }
}

/// Whether the damage to a file may go unsaid: a cut just behind a line's end, or a part that is there twice, may be no
/// damage to any line.
fn is_harmless(dir: &Path, name: &Path, now: Option<&Vec<u8>>) -> bool {
    let parts = |text: &[u8]| -> BTreeSet<Vec<u8>> {
        text.split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect()
    };
    let before = &original().files[name];
    let journal = name.extension().is_some_and(|extension| extension == "jsonl");
    // Nothing says how many of these files there were.
    let uncounted = name.starts_with("outcomes") || name.starts_with("iterations");
    match now {
        None => !dir.join(name).exists() && uncounted,
        Some(now) if journal => parts(now).is_subset(&parts(before)),
        Some(now) => {
            now.strip_suffix(b"\n") == Some(before) || before.strip_suffix(b"\n") == Some(now)
        }
    }
}

fn check(faults: &[(usize, Fault)]) -> Result<(), TestCaseError> {
    let sandbox = Sandbox::new();
    let dir = sandbox.dir();
    copy(&dir);
    let damaged = spoil(&dir, faults);
    let _ = status(&dir);
    if dir.join("lock").is_dir() {
        let refused = Campaign::open(&dir);
        prop_assert!(matches!(refused, Err(CampaignError::Io { .. })), "{:?}", refused);
        fs::remove_dir(dir.join("lock")).unwrap();
    }
    let Some((campaign, damage)) = open(&dir, &damaged)? else { return Ok(()) };
    for (name, now) in &damaged {
        let said = damage.iter().any(|damage| damage.file.ends_with(name));
        let harmless = is_harmless(&dir, name, now.as_ref());
        prop_assert!(said || harmless, "{:?} is not named in {:?}", name, damage);
    }
    // As a driver does that replays: the same tasks again.
    campaign.record_submitted(&tasks(TASKS)).unwrap();
    let whole = untouched(&damaged);
    for number in 0..TASKS {
        let outcome = campaign.outcome(number);
        if let Some(outcome) = &outcome {
            prop_assert_eq!(Some(outcome), original().outcomes.get(&number));
        }
        prop_assert!(outcome.is_some() || !whole.contains(&number), "{} is lost", number);
    }
    for (k, record) in campaign.iterations() {
        let expected = if k == 0 { json!({"ess": 0.25}) } else { json!({"ess": 0.5}) };
        prop_assert_eq!(record, expected);
    }
    if let Some(plan) = campaign.extra("plan.toml") {
        prop_assert_eq!(plan, &extra()["plan.toml"][..]);
    }
    drop(campaign);
    // It is mended: nothing but a damaged file of the caller, which only the caller can mend, is said again.
    let (campaign, damage) = Campaign::open(&dir).unwrap();
    let again: Vec<_> = damage.iter().filter(|d| !d.file.ends_with("plan.toml")).collect();
    prop_assert!(again.is_empty(), "{:?}", again);
    prop_assert_eq!(campaign.tasks().len() as u64, TASKS);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, max_shrink_iters: 200, ..ProptestConfig::default() })]
    #[test]
    fn any_damage_is_found_and_costs_only_its_own_runs(
        faults in proptest::collection::vec((any::<usize>(), fault()), 1..4),
    ) {
        check(&faults)?;
    }
}

#[test]
fn every_damaged_line_is_named_with_its_number() {
    let sandbox = Sandbox::new();
    copy(&sandbox.dir());
    let path = sandbox.dir().join("results.jsonl");
    let mut text = fs::read(&path).unwrap();
    let starts: Vec<usize> = std::iter::once(0)
        .chain(text.iter().enumerate().filter(|(_, b)| **b == b'\n').map(|(i, _)| i + 1))
        .collect();
    // A digit of a value, in the third and the sixth line.
    text[starts[2] + 20] ^= 1;
    text[starts[5] + 40] ^= 4;
    fs::write(&path, &text).unwrap();
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    let lines: Vec<_> = damage.iter().map(|damage| damage.line).collect();
    assert_eq!(lines, [Some(3), Some(6)]);
    let kept = sandbox.dir().join("results.jsonl.damaged-1");
    assert_eq!(fs::read(&kept).unwrap(), text);
    let words = damage[0].to_string();
    for part in ["results.jsonl, line 3: its checksum does not fit", "damaged-1"] {
        assert!(words.contains(part), "{words}");
    }
    assert_eq!(campaign.missing(&tasks(TASKS)).len(), 2 + 1);
}

#[test]
fn a_torn_last_line_is_mended_and_costs_nothing_else() {
    let sandbox = Sandbox::new();
    copy(&sandbox.dir());
    let path = sandbox.dir().join("results.jsonl");
    let mut text = fs::read(&path).unwrap();
    text.extend_from_slice(b"{\"number\":11,\"task\":\"0123");
    fs::write(&path, &text).unwrap();
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert!(damage.len() == 1 && damage[0].torn && damage[0].set_aside.is_none(), "{damage:?}");
    assert_eq!(campaign.missing(&tasks(TASKS)).len(), 1);
    run(&campaign, &tasks(TASKS));
    drop(campaign);
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert_eq!(damage, []);
    assert_eq!(campaign.missing(&tasks(TASKS)), []);
}

#[test]
fn a_directory_of_an_older_or_newer_version_is_refused_and_not_touched() {
    for (format, expected) in [(1, "has format 1"), (3, "has format 3")] {
        let sandbox = Sandbox::new();
        drop(create(&sandbox.dir(), &the_spec()));
        let path = sandbox.dir().join("campaign.json");
        // Sealed as it should be, with another format: what another version writes.
        let text = fs::read_to_string(&path).unwrap();
        let body = text.split(",\"checksum\"").next().unwrap();
        let body = body.replace("\"format\": 2", &format!("\"format\": {format}"));
        let crc = crc::Crc::<u64>::new(&crc::CRC_64_XZ);
        let sum = crc.checksum(body.as_bytes());
        let other = format!("{body},\"checksum\":\"{sum:016x}\"}}\n");
        fs::write(&path, &other).unwrap();
        for refused in [
            Campaign::open(&sandbox.dir()),
            Campaign::restore(&sandbox.dir(), &the_spec(), &extra()),
        ] {
            let error = refused.unwrap_err();
            let right = matches!(error, CampaignError::Format { found, expected: 2, .. } if found == format);
            assert!(right && error.to_string().contains(expected), "{error}");
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), other);
    }
}
