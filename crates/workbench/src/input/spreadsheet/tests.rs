use proptest::prelude::*;

use super::*;
use crate::input::columns::Unit;
use crate::input::observation_table::ObservationTable;

const RADIUS: f64 = 20e-6;

fn read_as(text: &str, columns: &Columns) -> Result<ObservationTable, InputError> {
    ObservationTable::parse_as("t.csv", text, columns, Some(RADIUS))
}

fn read(text: &str) -> Result<ObservationTable, InputError> {
    read_as(text, &Columns::default())
}

#[track_caller]
fn reads(text: &str, time_s: &[f64], contact_ratio: &[f64], how: &[&str]) {
    let table = read(text).unwrap_or_else(|error| panic!("{text}\n{error}"));
    assert_eq!(table.time_s, time_s, "{text}");
    assert_eq!(table.contact_ratio.len(), contact_ratio.len(), "{text}");
    for (found, expected) in table.contact_ratio.iter().zip(contact_ratio) {
        assert!((found - expected).abs() < 1e-14, "{found}, not {expected}: {text}");
    }
    let said = table.how.unwrap_or_default();
    for word in how {
        assert!(said.contains(word), "{word} is not in {said:?}");
    }
    assert!(!said.contains('\n'));
}

#[test]
fn a_table_of_a_german_spreadsheet_is_read_as_it_is() {
    let text = "\u{feff}Probe;t [min];Hals-Radius (\u{b5}m);T [\u{b0}C];;\r\n\
                A;0,5;5;180,5;;\r\nA;1;7,5;180,6;;\r\nA;1 000;15,0;180,4;;\r\n;;;;;\r\n;;;;;\r\n";
    reads(
        text,
        &[30.0, 60.0, 60_000.0],
        &[0.25, 0.375, 0.75],
        &[
            "\"t [min]\" as times in min",
            "\"Hals-Radius (\u{b5}m)\" as neck-radius in um",
            "decimal commas",
            "semicolons",
            "not read: Probe, T [\u{b0}C]",
            "R = 20.00 um",
        ],
    );
}

#[test]
fn headers_say_units_and_quantities_in_many_ways() {
    for header in [
        "t [min],a/R",
        "Zeit / min,x/R",
        "Time (min),contact ratio [-]",
        "time in min,contact_ratio",
        "time_min,Contact ratio",
        "\"t, min\",a/R",
        "\"Sinter-\nzeit [min]\",a/R",
    ] {
        reads(
            &format!("{header}\n0,0.25\n2,0.5\n"),
            &[0.0, 120.0],
            &[0.25, 0.5],
            &["times in min"],
        );
    }
    for (header, factor) in [
        ("neck radius [um]", 0.05),
        ("neck radius (\u{3bc}m)", 0.05),
        ("Halsradius in \u{b5}m", 0.05),
        ("neck_radius_um", 0.05),
        ("neck diameter [\u{b5}m]", 0.025),
        ("Hals-Durchmesser [\u{b5}m]", 0.025),
        ("neck width, mm", 25.0),
        ("a/D", 2.0),
        ("a/R [%]", 0.01),
    ] {
        let value = 0.5 / factor;
        let text = format!("t [s]\t{header}\n0\t{}\n3\t{value}\n", 0.5 * value);
        reads(&text, &[0.0, 3.0], &[0.25, 0.5], &["cells between tabs"]);
    }
}

#[test]
fn units_may_stand_in_a_row_below_the_names() {
    for units in ["min;\u{b5}m;\u{b0}C", "[min];(um);"] {
        let text = format!("Zeit;Halsradius;T\n{units}\n0,5;5;180,5\n1;10;180\n");
        reads(&text, &[30.0, 60.0], &[0.25, 0.5], &["\"Zeit [min]\" as times in min"]);
    }
    let error = read("Zeit;Halsradius\nmin;um\n0;x\n").expect_err("no number");
    assert_eq!(error.line, Some(3), "{error}");
}

#[test]
fn thousands_in_groups_are_said() {
    let text = "time_s;contact_ratio\n0.5;0.25\n1,234;0.5\n";
    reads(text, &[0.5, 1234.0], &[0.25, 0.5], &["decimal points, thousands in groups"]);
    let table = read("time_s;contact_ratio\n0.5;0.25\n1234;0.5\n").expect("a table");
    assert_eq!(table.how, None);
}

#[test]
fn standard_deviations_have_the_unit_and_the_divisor_of_the_necks() {
    for (header, sigma) in [("sigma", 0.5), ("sigma [um]", 0.5), ("sigma [nm]", 500.0)] {
        let text = format!("t [s],neck diameter [um],{header}\n0,10,{sigma}\n1,20,{sigma}\n");
        let found = read(&text).expect(header).sigma.expect("sigma");
        assert!(found.iter().all(|sigma| (sigma - 0.0125).abs() < 1e-15), "{found:?}");
    }
    let wrong = read("t [s],a/R,sigma [um]\n0,0.1,1\n").expect_err("lengths");
    assert!(wrong.to_string().contains("standard deviations in um"), "{wrong}");
    let columns = Columns { sigma: Some("SD".to_owned()), ..Columns::default() };
    let named = read_as("t [s],a/R,SD\n0,0.1,0.02\n", &columns).expect("a table");
    assert_eq!(named.sigma, Some(vec![0.02]));
}

#[test]
fn what_the_header_does_not_say_is_said_beside_it() {
    let columns = Columns {
        time: Some("clock".to_owned()),
        value: Some("w".to_owned()),
        time_unit: Unit::parse("ms"),
        value_unit: Unit::parse("um"),
        quantity: Some(Quantity::NeckDiameter),
        decimal: Some(DecimalMark::Comma),
        ..Columns::default()
    };
    let table = read_as("clock;other t [s];w\n1,500;0;10,125\n", &columns).expect("a table");
    assert_eq!(table.time_s, [1.5e-3]);
    assert!((table.contact_ratio[0] - 10.125 / 40.0).abs() < 1e-15);
    let other = Columns { time_unit: Unit::parse("h"), ..Columns::default() };
    let twice = read_as("t [min],a/R\n0,0.1\n", &other).expect_err("two units");
    assert!(twice.to_string().contains("min in the header, and h in time_unit"), "{twice}");
    let other = Columns { value: Some("a/r".to_owned()), ..Columns::default() };
    assert!(read_as("t [min],a/R,x/R\n0,0.1,1\n", &other).is_ok());
    let missing = Columns { time: Some("tine".to_owned()), ..Columns::default() };
    let error = read_as("time,a/R\n0,0.1\n", &missing).expect_err("no such column");
    assert!(error.to_string().contains("did you mean time?"), "{error}");
}

#[test]
fn what_could_be_read_in_two_ways_is_refused_with_the_remedy() {
    for (text, words) in [
        (
            "t [s];a/R\n1,234;1,100\n",
            &["line 2, column t [s]: found \"1,234\"", "1.234 with", "1234 with", "--decimal"][..],
        ),
        (
            "t [s];a [um]\n1.200;15\n2.400;18\n",
            &["called contact_ratio", "the table has t [s], a [um] (line 1; put # before"],
        ),
        (
            "t [s];neck radius [um]\n1.200;15\n2.400;18\n",
            &["found \"1.200\"", "it is 1200 with a decimal comma"],
        ),
        (
            "t [s],t [min],a/R\n0,0,0\n",
            &["2 columns that could hold times: t [s], t [min]", "--time-column \"t [s]\""],
        ),
        (
            "t [s],a/R,neck radius [um]\n0,0,0\n",
            &["2 columns that could hold necks: a/R, neck radius [um]", "--value-column"],
        ),
        ("t [s],a/R,a/R\n0,0,0\n", &["the column twice"]),
        ("t [s],neck [um]\n0,0\n", &["does not say what was measured", "--quantity neck-radius"]),
        (
            "t [s],contact angle [\u{b0}]\n0,0\n",
            &["called contact_ratio", "the table has t [s], contact angle"],
        ),
        ("t,a/R\n0,0\n", &["column t: no unit", "--time-unit min"]),
        ("time [d],a/R\n0,0\n", &["column time [d]: a unit that is not known"]),
        ("t [s],,a/R\n0,7,0\n", &["column 2 without a name"]),
    ] {
        let error = read(text).expect_err(text).to_string();
        for word in words {
            assert!(error.contains(word), "{word:?} is not in\n{error}");
        }
    }
}

#[test]
fn all_mistakes_of_a_table_are_told_at_once_with_line_and_value() {
    let error = read("time_s;contact_ratio\n0;0,1\n1;abc\n2;\n2,5;0,2 um\n").expect_err("three");
    let lines: Vec<String> = error.to_string().lines().map(str::to_owned).collect();
    let errors: Vec<&String> = lines.iter().filter(|line| line.starts_with("t.csv")).collect();
    assert_eq!(
        errors,
        [
            "t.csv, line 3, column contact_ratio: found \"abc\", expected a number >= 0",
            "t.csv, line 4, column contact_ratio: found nothing, expected a number >= 0",
            "t.csv, line 5, column contact_ratio: found \"0,2 um\", expected a number >= 0",
        ]
    );
    let error = read("time_s,contact_ratio\n0,-1\n2,0.1\n1,0.2\n3,7\n").expect_err("three");
    let of = |error: &InputError| (error.line, error.mistake);
    let mut all = vec![of(&error)];
    let mut next = &error.next;
    while let Some(error) = next {
        all.push(of(error));
        next = &error.next;
    }
    assert_eq!(
        all,
        [
            (Some(2), Mistake::Negative),
            (Some(4), Mistake::Unsorted),
            (Some(5), Mistake::OutOfRange)
        ]
    );
    let error = read("when,what\n0,0.1\n").expect_err("both columns").to_string();
    assert!(
        error.contains("column time_s: missing") && error.contains("column contact_ratio: missing")
    );
}

#[test]
fn necks_in_other_units_are_told_with_their_conversion() {
    let error = read("time_s,contact_ratio\n0,4\n1,15\n").expect_err("micrometres").to_string();
    assert!(
        error.contains("a neck in micrometres? a = 15.0 um over R = 20.0 um is a/R = 0.750"),
        "{error}"
    );
    assert!(error.contains("in percent? 15.0 % is a/R = 0.150"), "{error}");
    assert_eq!(error.matches("micrometres?").count(), 1, "{error}");
    let error =
        ObservationTable::parse("t", "time_s,contact_ratio\n0,15\n").expect_err("no radius");
    assert!(error.to_string().contains("--quantity neck-radius --value-unit um"), "{error}");
    let error = read("t [s],neck radius [mm]\n0,15\n").expect_err("micrometres").to_string();
    assert!(error.contains("the neck over R = 20.0 um is a/R = 750 at most"), "{error}");
}

/// A table as a spreadsheet might write it.
#[derive(Debug, Clone)]
struct Dialect {
    separator: char,
    comma: bool,
    group: Option<char>,
    line_end: &'static str,
    mark: bool,
    quotes: bool,
    /// Empty columns and rows at the end.
    trailing: usize,
    further: bool,
}

fn dialects() -> impl Strategy<Value = Dialect> {
    let groups = prop_oneof![
        Just(None),
        Just(Some('\u{a0}')),
        Just(Some('\u{2009}')),
        Just(Some('\u{202f}')),
        Just(Some('\''))
    ];
    let separators = prop_oneof![Just(';'), Just('\t'), Just(','), Just(' ')];
    let ends = prop_oneof![Just("\n"), Just("\r\n"), Just("\r")];
    (separators, any::<bool>(), groups, ends, any::<[bool; 3]>(), 0usize..3).prop_map(
        |(separator, comma, group, line_end, [mark, quotes, further], trailing)| Dialect {
            separator,
            // Unquoted decimal commas between commas cannot be told apart, and blanks end cells.
            comma: comma && (separator != ',' || quotes),
            group: group.filter(|group| separator != ' ' || *group == '\''),
            line_end,
            mark,
            quotes,
            trailing: if separator == ' ' { 0 } else { trailing },
            further,
        },
    )
}

impl Dialect {
    fn number(&self, value: f64) -> String {
        let text = value.to_string();
        let (whole, decimals) = text.split_once('.').unwrap_or((&text, ""));
        let mut number = String::new();
        for (k, digit) in whole.chars().enumerate() {
            if let Some(group) = self.group
                && k > 0
                && (whole.len() - k).is_multiple_of(3)
            {
                number.push(group);
            }
            number.push(digit);
        }
        if !decimals.is_empty() {
            number.push(if self.comma { ',' } else { '.' });
            number.push_str(decimals);
        }
        number
    }

    fn row(&self, cells: &[String]) -> String {
        let cells: Vec<String> = cells
            .iter()
            .map(|cell| if self.quotes { format!("\"{cell}\"") } else { cell.clone() })
            .collect();
        let mut row = cells.join(&self.separator.to_string());
        row.extend(std::iter::repeat_n(self.separator, self.trailing));
        row + self.line_end
    }

    fn table(&self, rows: &[[f64; 2]]) -> String {
        let mut text = String::from(if self.mark { "\u{feff}" } else { "" });
        let mut header = vec!["t_s".to_owned(), "a/R".to_owned()];
        if self.further {
            header.insert(1, "remark".to_owned());
        }
        text += &self.row(&header);
        for row in rows {
            let mut cells: Vec<String> = row.iter().map(|value| self.number(*value)).collect();
            if self.further {
                cells.insert(1, "x".to_owned());
            }
            text += &self.row(&cells);
        }
        for _ in 0..self.trailing {
            text += &(self.separator.to_string().repeat(2) + self.line_end);
        }
        text
    }
}

proptest! {
    #[test]
    fn numbers_survive_every_dialect_to_the_last_bit_or_are_refused_as_ambiguous(
        dialect in dialects(),
        steps in proptest::collection::vec((1e-6f64..1e5, 0.0f64..=2.0), 1..20),
    ) {
        let mut time = 0.0;
        let rows: Vec<[f64; 2]> = steps.iter().map(|(step, ratio)| { time += step; [time, *ratio] }).collect();
        prop_assume!(rows.is_sorted_by(|a, b| a[0] < b[0]));
        let text = dialect.table(&rows);
        match read(&text) {
            Ok(table) => {
                prop_assert_eq!(&table.time_s, &rows.iter().map(|row| row[0]).collect::<Vec<_>>(), "{}", text);
                prop_assert_eq!(&table.contact_ratio, &rows.iter().map(|row| row[1]).collect::<Vec<_>>(), "{}", text);
            }
            Err(error) => prop_assert!(error.to_string().contains("one way only"), "{text}\n{error}"),
        }
    }

    /// Groups of three digits behind a mark: with nothing else in the table, no reading is the right one.
    #[test]
    fn a_table_of_ambiguous_numbers_is_never_read(
        rows in proptest::collection::vec((1u32..1000, 1u32..2, 0u32..1000), 1..10),
        separator in prop_oneof![Just(';'), Just('\t'), Just(' ')],
        mark in prop_oneof![Just(','), Just('.')],
    ) {
        let mut text = format!("t_s{separator}a/R\n");
        for (k, (decimals, whole, ratio)) in rows.iter().enumerate() {
            text += &format!("{}{mark}{decimals:03}{separator}{whole}{mark}{ratio:03}\n", k + 1);
        }
        let error = read(&text).expect_err(&text);
        prop_assert!(error.to_string().contains("one way only"), "{text}\n{error}");
        let columns = Columns {
            decimal: Some(if mark == ',' { DecimalMark::Comma } else { DecimalMark::Point }),
            ..Columns::default()
        };
        let table = read_as(&text, &columns).expect("with its mark");
        let expected: Vec<f64> =
            rows.iter().enumerate().map(|(k, row)| (k + 1) as f64 + f64::from(row.0) / 1000.0).collect();
        for (found, expected) in table.time_s.iter().zip(expected) {
            prop_assert!((found / expected - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    fn text_that_is_nearly_a_spreadsheet_never_panics(
        text in "(\u{feff}|#|sep=;\n)?(t \\[min\\]|zeit|neck radius|\\(µm\\)|a/R|sigma|[,;\t \r\n\"0-9.eE'-]|\u{a0}|\u{2212}|nan){0,60}",
        bytes in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let said = Columns {
            quantity: Some(Quantity::NeckRadius),
            value_unit: Unit::parse("um"),
            time_unit: Unit::parse("min"),
            ..Columns::default()
        };
        let decoded = crate::input::text_file::decode_table("t", bytes).map(|text| text.0);
        for text in decoded.iter().chain([&text]) {
            for columns in [&Columns::default(), &said] {
                if let Ok(table) = read_as(text, columns) {
                    prop_assert!(table.time_s.is_sorted_by(|a, b| a < b));
                    prop_assert!(table.contact_ratio.iter().all(|ratio| (0.0..=2.0).contains(ratio)));
                    let again = ObservationTable::parse("t", &table.to_csv()).expect("the documented form");
                    prop_assert_eq!(again.time_s, table.time_s);
                    prop_assert_eq!(again.contact_ratio, table.contact_ratio);
                }
            }
        }
    }
}
