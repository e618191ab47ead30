//! The files in `experiments/` and `priors/`, held against the program that reads them.

use std::fs;

use workbench::input::columns::Columns;
use workbench::input::experiment::{BUILT_IN_NAMES, Experiment};
use workbench::input::material::Material;
use workbench::input::observation_table::ObservationTable;
use workbench::input::prior_file::PriorFile;
use workbench::pair::parameter::ParameterName;

use crate::sandbox::{Sandbox, root};

#[test]
fn every_file_of_the_repository_is_read_without_complaint() {
    let mut files = 0;
    for folder in ["experiments", "experiments/heat", "experiments/scenes", "priors"] {
        for entry in fs::read_dir(root().join(folder)).expect("the folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                continue;
            }
            let ran = Sandbox::new().run_args(&["check", path.to_str().expect("UTF-8")]);
            ran.succeeded();
            assert_eq!(ran.stderr, "", "{}", path.display());
            files += 1;
        }
    }
    assert_eq!(files, 41, "a new file needs no change here but this number");
}

#[test]
fn built_in_experiments_are_the_files_of_the_repository() {
    for name in BUILT_IN_NAMES {
        let from_file =
            Experiment::read(&root().join(format!("experiments/{name}.toml")), &Columns::default());
        let from_file = from_file.expect("a description");
        let built_in = Experiment::built_in(name).expect("built in");
        assert_eq!(from_file.table, built_in.table);
        assert_eq!(from_file.powder, built_in.powder);
        assert_eq!(from_file.name, built_in.name);
    }
    for material in Material::ALL {
        let from_file = PriorFile::read(&root().join(format!("priors/{material}.toml")));
        let from_file = from_file.expect("priors");
        let built_in = PriorFile::of_material(material).expect("built in");
        for parameter in ParameterName::ALL {
            assert_eq!(from_file.get(parameter), built_in.get(parameter));
        }
    }
}

#[test]
fn the_tables_are_the_published_measurements() {
    for (name, rows, first, last) in [
        ("ps-r30", 44, [0.0070, 0.204], [1.0651, 1.035]),
        ("ps-r60-e19", 40, [0.0036, 0.147], [0.8214, 0.274]),
        ("ps-r60-e23", 39, [0.0025, 0.146], [0.8079, 0.606]),
        ("ps-r60-e29", 26, [0.0013, 0.215], [0.7959, 1.073]),
        ("pa12-r32", 30, [0.0, 0.0], [15.0, 1.260]),
        ("pa12-r30", 30, [0.0, 0.0], [15.0, 1.290]),
        ("pa12-r29-3", 30, [0.0, 0.0], [15.0, 1.268]),
        ("pa12-r28-9", 30, [0.0, 0.0], [15.0, 1.305]),
        ("peek-450pf-r25", 26, [2.96, 0.339], [78.06, 1.336]),
    ] {
        let table = Experiment::built_in(name).expect("built in").table;
        let row = |place: usize| [table.time_s[place], table.contact_ratio[place]];
        assert_eq!((table.len(), row(0), row(rows - 1)), (rows, first, last), "{name}");
    }
}

#[test]
fn spreadsheet_dialects_read_to_the_same_table() {
    let sandbox = Sandbox::new();
    let plain = "time_s,contact_ratio\n0.5,0.4\n1,0.6\n";
    sandbox.write("plain.csv", plain);
    sandbox.write("bom.csv", format!("\u{feff}{}", plain.replace('\n', "\r\n")));
    sandbox.write("semicolon.csv", plain.replace(',', ";"));
    sandbox.write("spaces.txt", plain.replace(',', "   "));
    let read = |name: &str| {
        let path = sandbox.path().join(name);
        ObservationTable::read(&path, &Columns::default(), None).expect(name)
    };
    for name in ["bom.csv", "semicolon.csv", "spaces.txt"] {
        assert_eq!(read(name), read("plain.csv"), "{name}");
    }
}

#[test]
fn fewer_points_than_parameters_is_a_warning() {
    let sandbox = Sandbox::new();
    sandbox.write("two.csv", "time_s,contact_ratio\n0.5,0.4\n1,0.6\n");
    let ran = sandbox.run("check two.csv");
    ran.succeeded();
    assert!(ran.stderr.contains("warning: 2 observations for 3 parameters"), "{}", ran.stderr);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn several_experiments_of_one_powder_are_one_calibration_the_same_as_by_their_plan() {
    let sandbox = Sandbox::new();
    let options = "--experiment pa12-r30 --experiment pa12-r32 --samples 8192";
    let plan = sandbox.run(&format!("{options} --dry-run --toml")).succeeded().stdout.clone();
    sandbox.write("plan.toml", &plan);
    sandbox.run(&format!("{options} --out both --quiet")).succeeded();
    sandbox.run("--plan plan.toml --out plan --quiet").succeeded();
    let read = |file: &str| std::fs::read_to_string(sandbox.path().join(file)).expect(file);
    assert_eq!(read("both/draws.csv"), read("plan/draws.csv"));
    assert!(
        read("both/report.html").contains("calibrate --experiment pa12-r30 --experiment pa12-r32")
    );
    let of_second = sandbox.run("predict --posterior both --of pa12-r32 --contact-ratio 0.8");
    assert!(of_second.succeeded().stdout.contains("R = 31.5 um"), "{}", of_second.stdout);
    sandbox.run(&format!("{options} --verify")).refused(&["--verify", "2 experiments"]);
}

#[test]
fn completions_version_and_help_are_there() {
    let sandbox = Sandbox::new();
    for shell in ["bash", "zsh", "fish"] {
        let ran = sandbox.run(&format!("completions {shell}"));
        ran.succeeded();
        assert!(ran.stdout.contains("kinetics"), "{shell}");
    }
    let version = sandbox.run("--version");
    assert_eq!(version.succeeded().stdout, format!("calibrate {}\n", env!("CARGO_PKG_VERSION")));
    let help = sandbox.run("--help").stdout;
    for word in ["--material", "simulate", "16384", "Examples:", "--window"] {
        assert!(help.contains(word), "{word} is not in\n{help}");
    }
}
