//! `report.html` of every kind of run in a real browser: `tests/browser/check.mjs` says what it looks at.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Command;

use crate::sandbox::{Sandbox, root};

/// What the script finds wrong with reports, each beside the text that must be on it.
fn wrong(sandbox: &Sandbox, reports: &[(PathBuf, PathBuf)]) -> Vec<Vec<String>> {
    let variable =
        |name: &str| std::env::var_os(name).unwrap_or_else(|| panic!("{name} is not set"));
    let pictures = std::env::var_os("BROWSER_PICTURES").map(PathBuf::from);
    let mut command = Command::new("node");
    command
        .arg(root().join("tests/browser/check.mjs"))
        .arg(variable("BROWSER"))
        .arg(pictures.unwrap_or_else(|| sandbox.path().join("pictures")))
        .env("NODE_PATH", variable("BROWSER_TOOLS"));
    for (report, summary) in reports {
        command.arg(report).arg(summary);
    }
    let output = command.output().expect("node");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let list = |value: &serde_json::Value| -> Vec<String> {
        let words = value["wrong"].as_array().expect("a list").iter();
        words.map(|word| word.as_str().expect("a text").to_owned()).collect()
    };
    found.as_array().expect("a list").iter().map(list).collect()
}

/// BROWSER is a Chromium, BROWSER_TOOLS the `node_modules` with puppeteer-core and axe-core.
#[test]
#[ignore = "needs a browser"]
fn reports_of_all_kinds_are_right_in_a_browser() {
    let sandbox = Sandbox::new();
    for folder in ["experiments", "priors"] {
        symlink(root().join(folder), sandbox.path().join(folder)).expect("a link");
    }
    let scenes = "experiments/scenes/pair.toml";
    let runs = [
        ("ps", "--material ps".to_owned()),
        ("robust", "--material pa12 --samples 8192 --noise robust".to_owned()),
        ("impact", "--plan experiments/external/impact.toml".to_owned()),
        ("compare", "compare --material ps --samples 8192 --noise inferred".to_owned()),
        ("scene", format!("scene {scenes}")),
        (
            "densify",
            format!("densify --posterior robust --scene {scenes} --contact-ratio 0.8 --draws 20"),
        ),
        ("table3", "table3 --samples 8192".to_owned()),
        ("diff", "diff ps robust".to_owned()),
    ];
    let mut reports = Vec::new();
    for (name, arguments) in runs {
        let ran = sandbox.run(&format!("{arguments} --out {name}"));
        // Without how long it took, and where the files are.
        let lines =
            ran.succeeded().stdout.lines().filter(|line| !line.contains(&format!(" {name}")));
        let lines: Vec<&str> = lines
            .map(|line| match line.rsplit_once(" in ") {
                Some((start, end)) if end.ends_with(" s") => start.trim_end_matches(','),
                _ => line,
            })
            .collect();
        assert!(lines.len() > 3, "{}", ran.stdout);
        sandbox.write(&format!("{name}.txt"), lines.join("\n"));
        let file = |file: String| sandbox.path().join(file);
        reports.push((file(format!("{name}/report.html")), file(format!("{name}.txt"))));
    }
    for ((report, _), wrong) in reports.iter().zip(wrong(&sandbox, &reports)) {
        assert!(wrong.is_empty(), "{}: {wrong:#?}", report.display());
        assert!(fs::metadata(report).expect("a report").len() < 3_000_000);
    }
}

/// The script itself: each planted mistake is found.
#[test]
#[ignore = "needs a browser"]
fn mistakes_in_a_report_are_found_by_the_browser() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 8192 --out run -q").succeeded();
    let report = sandbox.path().join("run/report.html");
    let html = fs::read_to_string(&report).expect("a report");
    sandbox.write("summary.txt", "PS (polystyrene)\nno such words\n");
    let policy = html.find("<meta http-equiv").expect("a policy");
    let end = policy + html[policy..].find('>').expect("its end") + 1;
    let planted = html
        .replace(&html[policy..end], "")
        .replace("</main>", "<h5>deep</h5><img src=\"https://example.invalid/x.png\"><p style=\"color:#999;width:3000px\">pale</p></main>")
        .replace("<script>", "<script>console.error('loud'); undefined_name();");
    fs::write(&report, planted).expect("written");
    let found = wrong(&sandbox, &[(report, sandbox.path().join("summary.txt"))]);
    for mistake in [
        "not on the page: no such words",
        "request: https://example.invalid/x.png",
        "headings: ",
        "wider than the window",
        "axe, light: image-alt",
        "axe, light: color-contrast",
        "console: loud",
        "undefined_name",
        "a figure does not become wide",
        "figure that is not shown",
    ] {
        assert!(found[0].iter().any(|wrong| wrong.contains(mistake)), "{mistake}: {:#?}", found[0]);
    }
}
