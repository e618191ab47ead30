//! Tables as spreadsheets and instruments write them.
//!
//! What is read without a word: cells between semicolons, tabs, commas or blanks; cells in quotes, also headers over several
//! lines; comments (`#`); a line `sep=;`; empty rows and columns at the end; further columns. Decimals have a point or a
//! comma, thousands may be in groups. Units are taken from the header: `t [min]`, `t (min)`, `t / min`, `t, min`,
//! `t in min`, `time_min`, or a row of units below the names; necks are known by their names ([`Quantity`]). [`Columns`] say what the header does not.
//!
//! What could be read in two ways is refused, with all that is open at once: a number such as `1,234` where no other cell
//! says whether its comma is a decimal one, two columns that could hold times, a separator that cannot be told.

mod grid;
mod heading;
mod numerals;
#[cfg(test)]
mod tests;

use std::borrow::Cow;

use self::grid::{Grid, Lines};
use self::heading::{Picked, Picks, pick};
use crate::error::{InputError, Mistake};
use crate::input::columns::{Columns, DecimalMark, Quantity};

/// A column that was read.
#[derive(Debug, Clone)]
pub(super) struct Column<'t> {
    /// Name in the header.
    pub(super) name: String,
    /// The numbers in SI; they may be infinite or NaN.
    pub(super) si: Vec<f64>,
    /// The cells as they are written.
    pub(super) cells: Vec<Cow<'t, str>>,
}

/// The columns of a table that are read.
#[derive(Debug, Clone)]
pub(super) struct Sheet<'t> {
    pub(super) time: Column<'t>,
    /// None where only times are asked for.
    pub(super) value: Option<(Column<'t>, Quantity)>,
    pub(super) sigma: Option<Column<'t>>,
    /// Line of each row in the file, from 1.
    pub(super) lines: Vec<usize>,
    /// How it was read, in one line; none for a table in the documented form.
    pub(super) how: Option<String>,
}

/// What a table is read for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) columns: &'a Columns,
    /// Whether the table must have a column of necks.
    pub(super) with_value: bool,
    /// A table of two lines, for the help of one that is empty.
    pub(super) example: &'a str,
}

impl<'t> Sheet<'t> {
    /// Reads a table; `name` is what errors call it.
    ///
    /// # Errors
    ///
    /// Everything that is wrong, or that could be read in two ways, as one error.
    pub(super) fn read(name: &'t str, text: &'t str, asked: Asked<'_>) -> Result<Self, InputError> {
        let lines = Lines::of(name, text, asked.example)?;
        Self::of_lines(&lines, asked).map_err(|wrong| together(name, wrong))
    }

    fn of_lines(lines: &Lines<'t>, asked: Asked<'_>) -> Result<Self, Vec<InputError>> {
        let mut read = Vec::new();
        let mut wrong: Vec<(bool, Vec<InputError>)> = Vec::new();
        for separator in lines.separators() {
            match lines.grid(separator) {
                Ok(grid) => match pick(&grid, asked.columns, asked.with_value) {
                    Ok(picks) => read.push((grid, picks)),
                    Err(mistakes) => wrong.push((true, mistakes)),
                },
                Err(mistakes) => wrong.push((false, mistakes)),
            }
        }
        if let [(first, _), (second, _), ..] = &read[..] {
            return Err(vec![
                InputError::new(first.name, Mistake::Conflict)
                    .at_line(first.names_line)
                    .found(format_args!(
                        "cells that could be separated by {} or by {}",
                        word(first.separator),
                        word(second.separator)
                    ))
                    .help("put cells with separators in them into quotes, or remove them"),
            ]);
        }
        match read.pop() {
            Some((grid, picks)) => Self::of_grid(&grid, &picks, asked.columns.decimal),
            None => {
                // What is wrong with the header of a table that is one, before rows that are none.
                let best = wrong.iter().position(|(is_table, _)| *is_table).unwrap_or(0);
                Err(wrong.swap_remove(best).1)
            }
        }
    }

    fn of_grid(
        grid: &Grid<'t>,
        picks: &Picks,
        said: Option<DecimalMark>,
    ) -> Result<Self, Vec<InputError>> {
        let picked = picks.all();
        let places: Vec<usize> = picked.iter().map(|picked| picked.place).collect();
        let mut columns = grid.columns(&places);
        let mut lines: Vec<usize> = grid.rows.iter().map(|row| row.0).collect();
        let documented = picked
            .iter()
            .all(|picked| ["time_s", "contact_ratio", "sigma"].contains(&&*picked.name));
        let alone = grid.names.len() == picked.len();
        // A row of remarks alone is no measurement; one without further columns is a mistake.
        let keep: Vec<bool> = (0..lines.len())
            .map(|row| alone || columns.iter().any(|column| !column[row].is_empty()))
            .collect();
        let left_out = keep.iter().filter(|keep| !**keep).count();
        if left_out == lines.len() {
            let empty = InputError::new(grid.name, Mistake::Empty).at_line(grid.names_line);
            return Err(vec![empty.found("columns without numbers").expected("at least one row")]);
        }
        retain(&mut lines, &keep);
        columns.iter_mut().for_each(|column| retain(column, &keep));
        let cells = Cells { grid, picked: &picked, columns: &columns, lines: &lines };
        let decimal = cells.decimal(said, documented)?;
        let numbers = cells.numbers(decimal)?;
        let ratio =
            picks.value.as_ref().is_none_or(|(_, quantity)| *quantity == Quantity::ContactRatio);
        let plain =
            documented && alone && ratio && picked.iter().all(|picked| picked.unit.si == 1.0);
        let grouped = cells.all().any(|(_, _, cell)| numerals::is_grouped(cell, decimal));
        let how = (!plain || grouped || decimal == DecimalMark::Comma)
            .then(|| how(grid, picks, (decimal, grouped), left_out));
        let mut read =
            picked.iter().zip(numbers).zip(columns).map(|((picked, numbers), cells)| Column {
                name: picked.name.clone(),
                si: numbers.into_iter().map(|number| number * picked.unit.si).collect(),
                cells,
            });
        let time = read.next();
        let value = picks.value.as_ref().and_then(|(_, quantity)| Some((read.next()?, *quantity)));
        let sigma = picks.sigma.as_ref().and_then(|_| read.next());
        match time {
            Some(time) => Ok(Self { time, value, sigma, lines, how }),
            None => Err(Vec::new()),
        }
    }
}

/// Mistakes as one error.
fn together(name: &str, wrong: Vec<InputError>) -> InputError {
    InputError::all(wrong)
        .unwrap_or_else(|| InputError::new(name, Mistake::Syntax).found("no table"))
}

fn retain<T>(all: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    all.retain(|_| keep.next().copied().unwrap_or(false));
}

/// The cells that are read as numbers.
struct Cells<'a, 't> {
    grid: &'a Grid<'t>,
    picked: &'a [&'a Picked],
    columns: &'a [Vec<Cow<'t, str>>],
    lines: &'a [usize],
}

impl Cells<'_, '_> {
    fn all(&self) -> impl Iterator<Item = (usize, usize, &str)> {
        (0..self.lines.len()).flat_map(move |row| {
            self.columns.iter().enumerate().map(move |(column, cells)| (row, column, &*cells[row]))
        })
    }

    fn mistake(&self, row: usize, column: usize, mistake: Mistake) -> InputError {
        InputError::new(self.grid.name, mistake)
            .at_line(self.lines[row])
            .in_column(&self.picked[column].name)
    }

    /// The decimal mark under which all cells are numbers. Where both marks give numbers, and not the same ones, it cannot
    /// be told: the cells of other columns may be labels (`1.10`), and do not decide.
    fn decimal(
        &self,
        said: Option<DecimalMark>,
        documented: bool,
    ) -> Result<DecimalMark, Vec<InputError>> {
        use DecimalMark::{Comma, Point};
        if let Some(said) = said {
            return Ok(said);
        }
        let commas = self.all().any(|(_, _, cell)| cell.contains(','));
        // Commas between cells, and the documented form, go with points.
        if !commas && (documented || self.grid.separator == ',') {
            return Ok(Point);
        }
        let bad =
            |mark| self.all().filter(|(_, _, cell)| numerals::read(cell, mark).is_none()).count();
        match (bad(Point), bad(Comma)) {
            (0, 0) => {}
            (points, bad_commas) => return Ok(if points <= bad_commas { Point } else { Comma }),
        }
        let differs = |cell: &str| {
            let [point, comma] = [Point, Comma].map(|mark| numerals::read(cell, mark));
            point.zip(comma).filter(|(point, comma)| point.total_cmp(comma).is_ne())
        };
        let Some((row, column, cell)) = self.all().find(|(_, _, cell)| differs(cell).is_some())
        else {
            return Ok(Point);
        };
        let (point, comma) = differs(cell).unwrap_or_default();
        Err(vec![
            self.mistake(row, column, Mistake::Conflict)
                .found(format_args!("\"{cell}\""))
                .expected("a number that can be read in one way only")
                .help(format_args!(
                    "it is {comma} with a decimal comma, and {point} with a decimal point: say decimal = \"comma\" or \"point\" in \
                     [columns] of the experiment file, or --decimal comma or point"
                )),
        ])
    }

    /// The numbers of every column, finite.
    fn numbers(&self, decimal: DecimalMark) -> Result<Vec<Vec<f64>>, Vec<InputError>> {
        let mut wrong = Vec::new();
        let mut numbers: Vec<Vec<f64>> =
            self.columns.iter().map(|cells| Vec::with_capacity(cells.len())).collect();
        for (row, column, cell) in self.all() {
            let expected =
                if self.picked[column].name == "sigma" { "a number > 0" } else { "a number >= 0" };
            match numerals::read(cell, decimal) {
                Some(number) if number.is_finite() => numbers[column].push(number),
                Some(_) => wrong.push(
                    self.mistake(row, column, Mistake::NotFinite)
                        .found(cell)
                        .expected(expected)
                        .help("remove the row if nothing was measured"),
                ),
                None => wrong.push(self.no_number(row, column, cell, decimal).expected(expected)),
            }
        }
        if wrong.is_empty() { Ok(numbers) } else { Err(wrong) }
    }

    fn no_number(&self, row: usize, column: usize, cell: &str, decimal: DecimalMark) -> InputError {
        let error = self.mistake(row, column, Mistake::WrongType);
        let other = match decimal {
            DecimalMark::Point => DecimalMark::Comma,
            DecimalMark::Comma => DecimalMark::Point,
        };
        let is = |mark| match mark {
            DecimalMark::Point => "points",
            DecimalMark::Comma => "commas",
        };
        if cell.is_empty() {
            return error.found("nothing").help("remove the row if nothing was measured");
        }
        let error = error.found(format_args!("\"{cell}\""));
        if numerals::read(cell, other).is_some() {
            error.help(format_args!(
                "the decimals of the other cells come after {}, that of this one after {}: write all alike",
                is(decimal),
                is(other)
            ))
        } else {
            error.help(
                "give the bare number, without unit; start comments with # on a line of their own",
            )
        }
    }
}

fn word(separator: char) -> &'static str {
    match separator {
        ';' => "semicolons",
        '\t' => "tabs",
        ',' => "commas",
        _ => "blanks",
    }
}

/// How a table was read, in one line.
fn how(
    grid: &Grid<'_>,
    picks: &Picks,
    (decimal, grouped): (DecimalMark, bool),
    left_out: usize,
) -> String {
    let mut parts = vec![format!("\"{}\" as times in {}", picks.time.name, picks.time.unit)];
    if let Some((value, quantity)) = &picks.value {
        parts.push(format!("\"{}\" as {} in {}", value.name, quantity.name(), value.unit));
    }
    if let Some(sigma) = &picks.sigma {
        parts.push(format!("\"{}\" as standard deviations in {}", sigma.name, sigma.unit));
    }
    let mark = if decimal == DecimalMark::Comma { "decimal commas" } else { "decimal points" };
    let groups = if grouped { ", thousands in groups" } else { "" };
    parts.push(format!("{mark}{groups}, cells between {}", word(grid.separator)));
    let picked = picks.all();
    let read = |place: &usize| picked.iter().any(|picked| picked.place == *place);
    let others: Vec<&str> = (0..grid.names.len())
        .filter(|place| !read(place))
        .map(|place| grid.names[place].as_str())
        .filter(|name| !name.is_empty())
        .collect();
    if !others.is_empty() {
        parts.push(format!("not read: {}", others.join(", ")));
    }
    if left_out > 0 {
        parts.push(format!(
            "{left_out} row{} without numbers left out",
            if left_out == 1 { "" } else { "s" }
        ));
    }
    parts.join("; ")
}
