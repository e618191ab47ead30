use proptest::prelude::*;

use super::*;

fn column(text: &str, format: Format, name: &str) -> Result<Vec<f64>, TableError> {
    Table::parse(text, format)?.column(name)
}

/// As a program reads a user's table: any separator, every column named.
fn user_table(text: &str) -> Result<Table<'_>, TableError> {
    let table = Table::parse(text, Format::guess(text))?;
    table.check_names()?;
    Ok(table)
}

#[test]
fn every_usual_way_to_write_a_table_is_read() {
    let cases = [
        ("t,x\n0,1\n1,2.5\n", Format::Csv),
        ("\u{feff}\"t\";\"x\"\r\n0;1\r\n1;2.5\r\n", Format::Csv),
        ("# a comment\n# t,x\n0,1\n\n# another\n1,2.5", Format::Csv),
        ("# t x\n0,1\n1,2.5", Format::Csv),
        ("t\tx\n0\t1\n1\t2.5\n", Format::Csv),
        ("# Time-averaged data\n# t x\n0 1\n1 2.5\n", Format::Whitespace),
        ("t   x\n 0 1\n 1.0D0  0.25d+01\n", Format::Whitespace),
        ("#t\tx\n0\t1\n1\t2.5\n", Format::Whitespace),
        ("{\"t\": [0, 1], \"x\": [1, 2.5], \"note\": \"text\"}", Format::Json),
        ("[{\"t\": 0, \"x\": 1}, {\"x\": 2.5, \"t\": 1}]", Format::Json),
    ];
    for (text, format) in cases {
        assert_eq!(column(text, format, "t").expect(text), [0.0, 1.0], "{text:?}");
        assert_eq!(column(text, format, "x").expect(text), [1.0, 2.5], "{text:?}");
    }
    assert_eq!(column("{\"x\": 3}", Format::Json, "x").expect("one number"), [3.0]);
}

#[test]
fn the_separator_and_the_format_of_a_users_table_are_found() {
    for text in [
        "u,f\n0,0\n0.1,4.98\n",
        "\u{feff}u,f\r\n0,0\r\n0.1,4.98\r\n",
        "# a remark\nu;f\n0;0\n0.1;4.98\n",
        "# c\n\n u ; f \n0;0\n# c\n1e-1; 4.98",
        "u f\n0 0\n\n  0.1   4.98  \n",
        "u\tf\n0\t0\n0.1\t4.98\n",
        "f,u\r0,0\r4.98,0.1\r",
        "\"u\",\"f\"\n\"0\",\"0\"\n0.1,4.98\n",
        "# u f\n0.0e+00 0.0\n1.0e-01 4.98\n",
        "#\tu\tf\n0\t0\n0.1\t4.98\n",
        "#u f\n# made by hand\n0 0\n0.1 4.98\n",
        "# u,f\n0,0\n0.1,4.98\n",
        "# u,f\n0 0\n0.1 4.98\n",
    ] {
        let table = user_table(text).unwrap_or_else(|error| panic!("{text:?}: {error}"));
        assert_eq!(table.column("u").expect("u"), [0.0, 0.1], "{text:?}");
        assert_eq!(table.column("f").expect("f"), [0.0, 4.98], "{text:?}");
    }
    assert_eq!(user_table("time_s\n0\n1e-3\n").expect("one column").len(), 2);
}

#[test]
fn a_separator_within_a_name_is_told_from_the_one_between_the_cells() {
    let german = user_table("Zeit, s; Kraft, N\n0.5;0.41\n").expect("semicolons");
    assert_eq!(german.names(), ["Zeit, s", "Kraft, N"]);
    let units = user_table("m [N;m],weight\n1e0,0.5\n").expect("commas");
    assert_eq!(units.names(), ["m [N;m]", "weight"]);
}

#[test]
fn quotes_keep_separators_and_quotes_within_a_cell() {
    let text = "a,\"b, c\",\"d \"\"e\"\"\"\n1, \"2\" ,\"x, \"\"y\"\"\"\n3,4,\"open\n";
    let table = Table::parse(text, Format::Csv).expect("a table");
    assert_eq!(table.names(), ["a", "b, c", "d \"e\""]);
    let rows: Vec<Row<'_>> = table.rows().collect();
    assert_eq!(rows[0].cells, ["1", "2", "x, \"y\""]);
    assert_eq!(rows[1].cells, ["3", "4", "\"open"]);
    assert_eq!(table.column("b, c").expect("numbers"), [2.0, 4.0]);
}

#[test]
fn rows_give_texts_and_numbers_with_their_lines() {
    let text =
        "!OMP_NUM_THREADS description key a b! \n 8 one 0 0.5 3\n# a remark\n\n 8 two 1 = 6.5\n";
    let table = Table::parse(text, Format::Whitespace).expect("a table");
    assert_eq!(table.names(), ["!OMP_NUM_THREADS", "description", "key", "a", "b!"]);
    assert_eq!((table.names_line(), table.len(), table.line(1)), (Some(1), 2, Some(5)));
    let rows: Vec<Row<'_>> = table.rows().collect();
    assert_eq!((rows[1].line, &*rows[1].cells[1], &*rows[1].cells[3]), (5, "two", "="));
    assert_eq!(rows[1].number(4), Ok(6.5));
    assert_eq!(table.column_at(4).expect("b"), [3.0, 6.5]);
}

#[test]
fn nan_and_infinities_are_numbers_and_text_is_not() {
    for (text, format) in [
        ("x\nnan\n", Format::Csv),
        ("# x\n-NaN\n", Format::Whitespace),
        ("{\"x\": [NaN], \"NaN \\\" Infinity\": 1}", Format::Json),
        ("{\"x\": null}", Format::Json),
    ] {
        assert!(column(text, format, "x").expect(text)[0].is_nan(), "{text:?}");
    }
    assert_eq!(column("x\n1e999\n", Format::Csv, "x").expect("overflow"), [f64::INFINITY]);
    let error = column("t,x\n0,1\n1,broken\n", Format::Csv, "x").expect_err("text");
    assert_eq!(error.to_string(), "line 3, column x: \"broken\" is not a number");
    let error = column("[{\"x\": 1}, {\"x\": \"a\"}]", Format::Json, "x").expect_err("text");
    assert!(error.to_string().contains("row 2, column x"), "{error}");
    // A text in a column that nobody asked for does not matter.
    assert_eq!(column("t,x\n0,a\n", Format::Csv, "t").expect("a number"), [0.0]);
}

#[test]
fn each_mistake_has_its_own_kind_and_line() {
    let ragged = |line, found, decimal_commas| TableError::Ragged {
        line,
        found,
        expected: 2,
        decimal_commas,
    };
    for (text, error) in [
        ("", TableError::Empty),
        ("\u{feff}", TableError::Empty),
        (" \n# only a comment\n", TableError::Empty),
        ("t,x\n", TableError::NoRows { line: 1 }),
        ("\n# c\nt x", TableError::NoRows { line: 3 }),
        ("0,0.1\n1,0.2\n", TableError::NoNames { line: 1 }),
        ("# u\n1 2\n3 4\n", TableError::NoNames { line: 2 }),
        ("t,x\n0\n", ragged(2, 1, false)),
        ("t,x\n0,1\n\n2,3,4\n", ragged(4, 3, false)),
        ("t,x\n0,5,0,41\n", ragged(2, 4, true)),
        ("u f\n1 2\n3\n", ragged(3, 1, false)),
        ("t,t\n0,0\n", TableError::DuplicateName { line: Some(1), column: "t".into() }),
        ("t,,x\n0,0,0\n", TableError::EmptyName { line: Some(1), number: 2 }),
    ] {
        assert_eq!(user_table(text).expect_err(text), error, "{text:?}");
    }
    let number = |text: &str| user_table(text).expect(text).column("x").expect_err(text);
    for (text, found, with_point) in [
        ("t,x\n0,abc\n", "abc", None),
        ("t,x\n0,\n", "", None),
        ("t;x\n0,5;0,41\n", "0,41", Some("0.41")),
        ("t x\n0 0,41\n", "0,41", Some("0.41")),
    ] {
        let (found, with_point) = (found.to_owned(), with_point.map(str::to_owned));
        let error = TableError::NotANumber { line: 2, column: "x".into(), found, with_point };
        assert_eq!(number(text), error, "{text:?}");
        assert_eq!((error.line(), error.column()), (Some(2), Some("x")));
    }
    let missing = column("a,b\n1,2\n", Format::Csv, "t").expect_err("no such column");
    assert_eq!(missing.to_string(), "line 1: no column t; it has a, b");
    let twice = column("t t\n1 2\n", Format::Whitespace, "t").expect_err("which one?");
    assert!(matches!(twice, TableError::DuplicateName { .. }), "{twice}");
}

#[test]
fn broken_json_is_named() {
    for text in ["{\"t\": [1, 2", "[1, 2]", "3", "{\"t\": \"1\"}", "[{\"t\": 1}, {}]"] {
        let error = column(text, Format::Json, "t").expect_err(text);
        assert!(matches!(error, TableError::Json { .. }), "{text}: {error}");
    }
    assert!(Table::parse("{\"t\": []}", Format::Json).expect("JSON").is_empty());
}

proptest! {
    #[test]
    fn text_that_is_nearly_a_table_never_panics(
        text in "(\u{feff}|#)?(time_s|x|[,;\t \r\n\"0-9.eEdD+-]|nan|inf|µ|\u{a0}){0,60}",
    ) {
        for format in [Format::Csv, Format::Whitespace, Format::Json, Format::guess(&text)] {
            if let Ok(table) = Table::parse(&text, format) {
                let rows: Vec<Row<'_>> = table.rows().collect();
                for (place, name) in table.names().iter().enumerate() {
                    let column = table.column_at(place);
                    let by_rows: Result<Vec<f64>, _> =
                        rows.iter().map(|row| row.number(place)).collect();
                    if format != Format::Json {
                        prop_assert_eq!(format!("{column:?}"), format!("{by_rows:?}"), "{}", name);
                    }
                }
                prop_assert!(rows.iter().all(|row| row.cells.len() == table.names().len()));
            }
        }
    }

    #[test]
    fn numbers_that_are_written_read_back_to_the_same_bits(
        rows in proptest::collection::vec(proptest::array::uniform2(proptest::num::f64::ANY), 1..20),
        separator in prop_oneof![Just(','), Just(';'), Just('\t'), Just(' ')],
    ) {
        let mut text = format!("a{separator}b\n");
        for [a, b] in &rows {
            text += &format!("{a:e}{separator}{b}\n");
        }
        let table = user_table(&text).expect("a table");
        for (place, name) in ["a", "b"].into_iter().enumerate() {
            let read = table.column(name).expect("numbers");
            for (row, value) in rows.iter().zip(read) {
                prop_assert!(value.to_bits() == row[place].to_bits() || (value.is_nan() && row[place].is_nan()));
            }
        }
    }
}
