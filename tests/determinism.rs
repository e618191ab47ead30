//! Same seed, same bits: for any number of threads, every file of a run but its timings.

use crate::sandbox::Sandbox;

#[test]
fn any_number_of_threads_writes_the_same_bytes() {
    threads_do_not_matter(8192, &[1, 2, 7]);
    // Placed by a process, in all of its ways.
    threads_do_not_matter(48, &[1, 3]);
}

fn threads_do_not_matter(samples: usize, threads: &[usize]) {
    let run = |threads: &usize| {
        let sandbox = Sandbox::new();
        let samples = format!("--samples {samples} --seed 11");
        sandbox
            .run(&format!("--material peek {samples} --threads {threads} --out run"))
            .succeeded();
        let mut files = sandbox.snapshot();
        files.retain(|path, _| path.is_file() && !path.ends_with("timings.json"));
        files
            .into_iter()
            .map(|(path, bytes)| {
                (path.file_name().expect("a file").to_string_lossy().into_owned(), bytes)
            })
            .collect::<Vec<_>>()
    };
    let runs: Vec<_> = threads.iter().map(run).collect();
    for other in &runs[1..] {
        for ((name, one), (_, more)) in runs[0].iter().zip(other) {
            assert!(one == more, "{name} depends on the number of threads");
        }
        assert_eq!(runs[0].len(), other.len());
    }
    assert_eq!(runs[0].len(), 19);
}

#[test]
fn another_seed_gives_other_samples() {
    let draws = [1, 2].map(|seed| {
        let sandbox = Sandbox::new();
        sandbox
            .run(&format!(
                "--material ps --samples 8192 --no-other-kinetics --seed {seed} --out run"
            ))
            .succeeded();
        std::fs::read(sandbox.path().join("run/draws.csv")).expect("draws.csv")
    });
    assert!(draws[0] != draws[1]);
}
