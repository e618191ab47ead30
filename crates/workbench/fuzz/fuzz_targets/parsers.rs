//! Every parser of user files, on any bytes: a result or a typed error, never a panic.
//!
//! ```text
//! cargo install cargo-fuzz
//! cd crates/workbench && cargo fuzz run parsers --sanitizer none -- -max_total_time=300
//! ```
//!
//! The first byte says which parser reads the rest.

#![no_main]

use libfuzzer_sys::fuzz_target;
use workbench::input::data_table::DataTable;
use workbench::error::InputError;
use workbench::input::columns::{Columns, Quantity, Unit};
use workbench::input::experiment::Experiment;
use workbench::input::observation_table::{self, ObservationTable};
use workbench::input::prior_file::PriorFile;
use workbench::input::sample_table::SampleTable;
use workbench::{record, report, input::scene_file, input::text_file};

/// What was refused says so in words.
fn refused<T>(outcome: Result<T, InputError>) -> Option<T> {
    match outcome {
        Ok(value) => Some(value),
        Err(error) => {
            assert!(error.to_string().len() > 10, "says little: {error}");
            None
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&which, rest)) = bytes.split_first() else { return };
    // Tables may be in more encodings than other files.
    if which % 11 < 2 {
        let Some((text, _)) = refused(text_file::decode_table("fuzz", rest.to_vec())) else { return };
        let necks = Columns {
            quantity: Some(Quantity::NeckRadius),
            time_unit: Unit::parse("min"),
            value_unit: Unit::parse("um"),
            ..Columns::default()
        };
        let columns = if which % 11 == 0 { Columns::default() } else { necks };
        let read = ObservationTable::parse_as("fuzz.csv", &text, &columns, Some(20e-6));
        if let Some(table) = refused(read) {
            // What is read is a table, and what is written reads back.
            assert!(!table.is_empty() && table.time_s.is_sorted());
            let again = ObservationTable::parse("again.csv", &table.to_csv()).expect("its own form");
            assert_eq!((again.time_s, again.contact_ratio), (table.time_s, table.contact_ratio));
            assert_eq!(again.sigma, table.sigma);
        }
        return;
    }
    let Some(text) = refused(text_file::decode("fuzz", rest.to_vec())) else { return };
    match which % 11 {
        10 => {
            refused(observation_table::parse_times("fuzz.csv", &text));
        }
        2 => {
            let table = |name: &str, _: &Columns, _: f64| {
                ObservationTable::parse(name, "time_s,contact_ratio\n0.5,0.4\n1,0.6\n")
                    .map(|table| (name.to_owned(), table))
            };
            refused(Experiment::parse("fuzz.toml", "fuzz", &text, table));
        }
        3 => {
            refused(PriorFile::parse("fuzz.toml", &text));
        }
        4 => {
            refused(record::parse("posterior.json", &text));
        }
        5 => {
            refused(report::parse_samples("samples.csv", &text, 3));
        }
        6 => {
            refused(report::parse_draws("draws.csv", &text, 3));
        }
        7 => {
            refused(SampleTable::parse("fuzz.txt", &text));
        }
        8 => {
            if let Some(table) = refused(DataTable::parse("fuzz.csv", &text, "u,f\n0.1,4.98")) {
                for column in table.columns() {
                    refused(table.column(column));
                }
            }
        }
        _ => {
            refused(scene_file::parse("fuzz.toml".to_owned(), &text, false));
        }
    }
});
