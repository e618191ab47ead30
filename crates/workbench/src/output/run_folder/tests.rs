use super::*;
use crate::output::check_file;
use crate::record::FILE_NAME;

fn run(target: &Path, plan: &str, files: &[&str]) -> Published {
    let folder = RunFolder::prepare(target, FILE_NAME).expect("can be written");
    let staging = folder.stage().expect("staged");
    fill(staging.path(), plan, files);
    staging.publish().expect("published")
}

fn fill(folder: &Path, plan: &str, files: &[&str]) {
    let record = format!("{{\"plan\": {{\"seed\": {plan}}}, \"samples\": [1]}}");
    fs::write(folder.join(FILE_NAME), record).expect("written");
    for file in files {
        fs::write(folder.join(file), plan).expect("written");
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> = fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn a_run_appears_whole_is_replaced_by_the_same_plan_and_kept_for_another() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("results/ps");
    assert_eq!(run(&target, "1", &["a.csv"]), Published::New);
    assert_eq!(run(&target, "1", &["a.csv", "b.csv"]), Published::Replaced);
    assert_eq!(names(&target), ["a.csv", "b.csv", "posterior.json"]);
    let target_path = fs::canonicalize(&target).expect("there");
    let aside = |n| target_path.with_file_name(format!("ps.{n}"));
    let kept = |n, earlier| Published::MovedAside { kept: aside(n), same_plan: false, earlier };
    assert_eq!(run(&target, "2", &[]), kept(1, 1));
    assert_eq!(names(&aside(1)), ["a.csv", "b.csv", "posterior.json"]);
    assert_eq!(run(&target, "3", &[]), kept(2, 2));
    assert_eq!(names(&folder.path().join("results")), ["ps", "ps.1", "ps.2"]);
    // Those that were deleted are not counted, nor is what only begins alike.
    fs::remove_dir_all(aside(1)).expect("removed");
    fs::create_dir(target_path.with_file_name("ps.old")).expect("made");
    fs::create_dir(target_path.with_file_name("ps.2.bak")).expect("made");
    assert_eq!(run(&target, "4", &[]), kept(1, 2));
}

#[test]
fn a_users_notes_in_an_old_run_are_kept() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("ps");
    run(&target, "1", &[]);
    fs::write(target.join("notes.txt"), "mine").expect("written");
    assert!(matches!(run(&target, "1", &[]), Published::MovedAside { same_plan: true, .. }));
    assert_eq!(names(&folder.path().join("ps.1")), ["notes.txt", "posterior.json"]);
    assert_eq!(names(&target), ["posterior.json"]);
}

#[test]
fn a_folder_that_is_not_ours_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("thesis");
    fs::create_dir(&target).expect("made");
    assert!(RunFolder::prepare(&target, FILE_NAME).is_ok(), "an empty folder is fine");
    for record in [None, Some("{\"plan\": {\"se"), Some("{\"plan\": 3}"), Some("[]")] {
        fs::write(target.join("chapter1.tex"), "text").expect("written");
        if let Some(record) = record {
            fs::write(target.join(FILE_NAME), record).expect("written");
        }
        let before = names(&target);
        let error = RunFolder::prepare(&target, FILE_NAME).expect_err("not ours");
        assert_eq!(error.mistake, Mistake::NotOurs, "{error}");
        assert!(error.to_string().contains("--out"), "{error}");
        assert_eq!(names(&target), before);
    }
    assert_eq!(names(folder.path()), ["thesis"]);
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_the_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("file");
    fs::write(&file, "").expect("written");
    let mut places = vec![file.clone(), file.join("results"), PathBuf::from("/"), PathBuf::new()];
    if cfg!(target_os = "linux") {
        places.push(PathBuf::from("/proc/results"));
    }
    for place in places {
        let error = RunFolder::prepare(&place, FILE_NAME).expect_err("unwritable");
        assert_eq!(error.mistake, Mistake::Unwritable, "{error}");
    }
    assert!(check_file(&file.join("x.csv")).is_err());
    assert_eq!(check_file(folder.path()).expect_err("folder").mistake, Mistake::Unwritable);
    assert_eq!(names(folder.path()), ["file"], "checking writes nothing");
}

#[cfg(unix)]
#[test]
fn a_read_only_parent_is_refused_before_the_run() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let parent = folder.path().join("read-only");
    fs::create_dir(&parent).expect("made");
    fs::set_permissions(&parent, fs::Permissions::from_mode(0o555)).expect("set");
    // The superuser writes anywhere.
    let superuser = fs::write(parent.join("probe"), "").is_ok();
    let prepared = RunFolder::prepare(&parent.join("ps"), FILE_NAME);
    fs::set_permissions(&parent, fs::Permissions::from_mode(0o755)).expect("set");
    if superuser {
        assert!(prepared.is_ok());
    } else {
        assert_eq!(prepared.expect_err("read-only").mistake, Mistake::Unwritable);
    }
}

#[test]
fn an_unfinished_run_leaves_nothing_and_the_old_results_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("ps");
    run(&target, "1", &["a.csv"]);
    let prepared = RunFolder::prepare(&target, FILE_NAME).expect("ours");
    let staging = prepared.stage().expect("staged");
    fill(staging.path(), "2", &[]);
    drop(staging);
    assert_eq!(names(folder.path()), ["ps"]);
    let staging = prepared.stage().expect("staged");
    assert!(staging.publish().is_err(), "a run without its record");
    assert_eq!(names(folder.path()), ["ps"]);
    assert_eq!(names(&target), ["a.csv", "posterior.json"]);
}

#[test]
fn folders_of_killed_runs_are_removed_when_old_and_ignored_before() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let target = folder.path().join("ps");
    // Beyond any process number; the other is of this very process's parent family: alive.
    let dead = folder.path().join(format!(".ps.tmp-{}", i32::MAX));
    let recent = folder.path().join(format!(".ps.tmp-{}", i32::MAX - 1));
    let living = folder.path().join(".ps.tmp-1");
    let other = folder.path().join(".pa12.tmp-notanumber");
    let old = std::time::SystemTime::now() - 2 * STALE;
    for (path, is_old) in [(&dead, true), (&recent, false), (&living, true), (&other, true)] {
        fs::create_dir(path).expect("made");
        if is_old {
            std::fs::File::open(path).and_then(|file| file.set_modified(old)).expect("aged");
        }
    }
    assert_eq!(run(&target, "1", &[]), Published::New);
    assert!(!dead.exists() && recent.exists() && living.exists() && other.exists());
}
