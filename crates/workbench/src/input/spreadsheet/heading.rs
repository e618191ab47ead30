//! The header of a table: which columns hold times, necks and their standard deviations, and in which units.

use super::grid::Grid;
use crate::error::{InputError, Mistake, nearest};
use crate::input::columns::{Columns, Dimension, Quantity, Unit};

/// A column that is read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picked {
    /// Place in the table, from 0.
    pub(super) place: usize,
    /// Name in the header.
    pub(super) name: String,
    pub(super) unit: Unit,
}

/// The columns that are read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picks {
    pub(super) time: Picked,
    /// None where only times are asked for.
    pub(super) value: Option<(Picked, Quantity)>,
    pub(super) sigma: Option<Picked>,
}

impl Picks {
    /// All of them: times, necks, standard deviations.
    pub(super) fn all(&self) -> Vec<&Picked> {
        let value = self.value.as_ref().map(|(value, _)| value);
        [Some(&self.time), value, self.sigma.as_ref()].into_iter().flatten().collect()
    }
}

/// A column by its name in the header.
struct Head<'g> {
    place: usize,
    name: &'g str,
    /// The name without its unit, in lower case.
    label: String,
    unit: Stated,
}

/// The unit in a header.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stated {
    Nothing,
    Known(Unit),
    /// In brackets, and of another quantity.
    Other,
}

/// Words of standard deviations, which are no necks.
const SPREAD: [&str; 12] = [
    "sigma",
    "sd",
    "std",
    "stdev",
    "deviation",
    "error",
    "err",
    "uncertainty",
    "\u{b1}",
    "fehler",
    "abweichung",
    "standardabweichung",
];

impl<'g> Head<'g> {
    fn of((place, name): (usize, &'g String)) -> Self {
        let (label, unit) = split(name);
        let label = label.replace('_', " ").to_lowercase();
        Self { place, name, label: label.trim().to_owned(), unit }
    }

    fn is(&self, dimension: Dimension) -> bool {
        matches!(self.unit, Stated::Known(unit) if unit.dimension == dimension)
    }

    fn has_word(&self, words: &[&str]) -> bool {
        self.label
            .split(|c: char| !c.is_alphanumeric() && c != '\u{b1}')
            .any(|word| words.contains(&word))
    }

    /// Whether it is called like times. An upper-case T is a temperature as often as a time.
    fn is_called_time(&self) -> bool {
        self.has_word(&["time", "times", "zeit"])
            || self.label.ends_with("zeit")
            || (self.label == "t" && self.name.starts_with('t') && self.unit == Stated::Nothing)
    }

    /// Whether it could hold times.
    fn may_be_time(&self) -> bool {
        self.is(Dimension::Time) || (self.is_called_time() && self.unit == Stated::Nothing)
    }

    /// What it could hold of a neck: nothing, something that has no name here, or a quantity.
    fn neck(&self) -> Option<Option<Quantity>> {
        let plain: String = self.label.chars().filter(|c| !c.is_whitespace()).collect();
        let has = |words: &[&str]| words.iter().any(|word| self.label.contains(word));
        let length = self.unit == Stated::Nothing || self.is(Dimension::Length);
        let ratio = self.unit == Stated::Nothing || self.is(Dimension::Ratio);
        if self.has_word(&SPREAD) || self.unit == Stated::Other || self.is(Dimension::Time) {
            return None;
        }
        let quantity = match plain.as_str() {
            "a/r" | "x/r" | "contactratio" if ratio => Some(Quantity::ContactRatio),
            "a/d" | "x/d" if ratio => Some(Quantity::ContactOverDiameter),
            _ if !has(&["neck", "hals", "contact", "kontakt"]) => return None,
            // A neck over something: the name does not say in one word what it is.
            _ if has(&["ratio", "/", "particle", "partikel"]) => None,
            _ if has(&["radius"]) && length => Some(Quantity::NeckRadius),
            _ if has(&["diameter", "durchmesser", "width", "breite"]) && length => {
                Some(Quantity::NeckDiameter)
            }
            _ => None,
        };
        Some(quantity)
    }
}

/// A name and its unit: `t [min]`, `t (min)`, `t / min`, `t, min`, `t in min`, `t min`, `t_min`.
fn split(name: &str) -> (&str, Stated) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((label, unit)) =
            name.strip_suffix(close).and_then(|name| name.rsplit_once(open))
        {
            return (label, Unit::parse(unit).map_or(Stated::Other, Stated::Known));
        }
    }
    for between in [" in ", "/", ",", " ", "_"] {
        if let Some((label, unit)) = name.rsplit_once(between)
            && let Some(unit) = Unit::parse(unit)
            && !label.trim().is_empty()
        {
            return (label, Stated::Known(unit));
        }
    }
    (name, Stated::Nothing)
}

/// The columns that the header, or what is said beside it, names.
///
/// # Errors
///
/// Everything that is missing or could be read in two ways.
pub(super) fn pick(
    grid: &Grid<'_>,
    columns: &Columns,
    with_value: bool,
) -> Result<Picks, Vec<InputError>> {
    let heads: Vec<Head<'_>> = grid.names.iter().enumerate().map(Head::of).collect();
    let chooser = Chooser { grid, heads: &heads };
    let mut wrong = chooser.unnamed();
    let time = chooser.time(columns).map_err(|error| wrong.push(error));
    let value = with_value.then(|| chooser.value(columns).map_err(|error| wrong.push(error)));
    let sigma = chooser.sigma(columns).map_err(|error| wrong.push(error));
    let (Ok(time), Ok(value), Ok(sigma)) = (time, value.transpose(), sigma) else {
        return Err(wrong);
    };
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let sigma = sigma.map(|head| Picked {
        place: head.place,
        name: head.name.to_owned(),
        unit: match (head.unit, &value) {
            (Stated::Known(unit), _) => unit,
            (_, Some((value, _))) => value.unit,
            _ => Unit::ONE,
        },
    });
    if let (Some(sigma), Some((value, quantity))) = (&sigma, &value)
        && sigma.unit.dimension != quantity.dimension()
    {
        return Err(vec![
            chooser
                .mistake(Mistake::Conflict)
                .in_column(&sigma.name)
                .found(format_args!("standard deviations in {}", sigma.unit))
                .expected(format_args!("a unit like that of {} ({})", value.name, value.unit)),
        ]);
    }
    Ok(Picks { time, value, sigma })
}

struct Chooser<'g> {
    grid: &'g Grid<'g>,
    heads: &'g [Head<'g>],
}

impl<'g> Chooser<'g> {
    fn mistake(&self, mistake: Mistake) -> InputError {
        InputError::new(self.grid.name, mistake).at_line(self.grid.names_line)
    }

    /// Columns without a name that hold something.
    fn unnamed(&self) -> Vec<InputError> {
        let unnamed = self.heads.iter().filter(|head| head.name.is_empty());
        let filled = unnamed.filter(|head| {
            self.grid.columns(&[head.place]).iter().flatten().any(|cell| !cell.is_empty())
        });
        filled
            .map(|head| {
                self.mistake(Mistake::Syntax)
                    .found(format_args!("column {} without a name", head.place + 1))
                    .help("give it a name or remove it")
            })
            .collect()
    }

    /// The one column of a name.
    fn named(&self, name: &str, option: &str) -> Result<&'g Head<'g>, InputError> {
        let wanted = super::grid::one_line(name);
        let same = |head: &&Head<'_>| head.name == wanted;
        let mut found: Vec<&Head<'_>> = self.heads.iter().filter(same).collect();
        if found.is_empty() {
            let label = wanted.to_lowercase();
            found = self.heads.iter().filter(|head| head.label == label).collect();
        }
        match found[..] {
            [head] => Ok(head),
            [] => Err(self
                .mistake(Mistake::MissingColumn)
                .in_column(name)
                .found(format_args!("missing, and {option} names it"))
                .did_you_mean(name, self.names())
                .help(self.has())),
            _ => Err(self.twice(name)),
        }
    }

    fn names(&self) -> impl Iterator<Item = &'g str> {
        self.heads.iter().map(|head| head.name).filter(|name| !name.is_empty())
    }

    fn has(&self) -> String {
        format!(
            "the table has {} (line {}; put # before lines that stand above the header)",
            self.names().collect::<Vec<_>>().join(", "),
            self.grid.names_line
        )
    }

    fn twice(&self, name: &str) -> InputError {
        self.mistake(Mistake::Duplicate)
            .in_column(name)
            .found("the column twice")
            .help("rename or remove one of them")
    }

    /// The column that has the name of the documentation.
    fn documented(&self, name: &str) -> Result<Option<&'g Head<'g>>, InputError> {
        let mut found = self.heads.iter().filter(|head| head.name == name);
        match (found.next(), found.next()) {
            (Some(_), Some(_)) => Err(self.twice(name)),
            (head, _) => Ok(head),
        }
    }

    /// One of several that could be meant.
    fn one(
        &self,
        what: &str,
        option: &str,
        could: Vec<&'g Head<'g>>,
    ) -> Result<Option<&'g Head<'g>>, InputError> {
        if let [first, second, ..] = could[..] {
            if first.name == second.name {
                return Err(self.twice(first.name));
            }
            let names: Vec<&str> = could.iter().map(|head| head.name).collect();
            return Err(self
                .mistake(Mistake::Conflict)
                .found(format_args!("{} columns that could hold {what}: {}", could.len(), names.join(", ")))
                .expected("one")
                .help(format_args!(
                    "say which: {option} = \"{}\" in [columns] of the experiment file, or --{option}-column \"{}\"",
                    first.name, first.name
                )));
        }
        Ok(could.first().copied())
    }

    /// The column that was said, else that of the documentation, else the only one that could be meant.
    fn head(
        &self,
        said: Option<&String>,
        documented: &str,
        what: &str,
        field: &str,
        could: impl Fn(&Head<'_>) -> bool,
    ) -> Result<Option<&'g Head<'g>>, InputError> {
        if let Some(name) = said {
            return self.named(name, &format!("--{field}-column ({field} in [columns])")).map(Some);
        }
        match self.documented(documented)? {
            Some(head) => Ok(Some(head)),
            None => self.one(what, field, self.heads.iter().filter(|head| could(head)).collect()),
        }
    }

    fn time(&self, columns: &Columns) -> Result<Picked, InputError> {
        let said = columns.time.as_ref();
        // Times in a unit that is not known are better than none: that unit is then what is wrong.
        let sure = self.heads.iter().any(Head::may_be_time);
        let could = |head: &Head<'_>| if sure { head.may_be_time() } else { head.is_called_time() };
        let head = self.head(said, "time_s", "times", "time", could)?;
        let head = head.ok_or_else(|| {
            self.mistake(Mistake::MissingColumn)
                .in_column("time_s")
                .found("missing")
                .did_you_mean("time_s", self.names())
                .help(self.has())
                .help("call it time_s, or say time = \"NAME\" in [columns] of the experiment file, or --time-column NAME")
        })?;
        let wanted = "give times in seconds, in a column called time_s, or with their unit, as in t [min]; or say time_unit = \
                      \"min\" in [columns] of the experiment file, or --time-unit min";
        let unit = self.unit(head, columns.time_unit, "time_unit", wanted)?;
        if unit.dimension == Dimension::Time {
            Ok(Picked { place: head.place, name: head.name.to_owned(), unit })
        } else {
            Err(self
                .mistake(Mistake::Conflict)
                .in_column(head.name)
                .found(format_args!("a column in {unit}"))
                .expected("times"))
        }
    }

    /// The unit that the header or what is said beside it states.
    fn unit(
        &self,
        head: &Head<'_>,
        said: Option<Unit>,
        field: &str,
        help: &str,
    ) -> Result<Unit, InputError> {
        let option = field.replace('_', "-");
        match (head.unit, said) {
            (Stated::Known(header), Some(said)) if header != said => Err(self
                .mistake(Mistake::Conflict)
                .in_column(head.name)
                .found(format_args!("{header} in the header, and {said} in {field} (--{option})"))
                .expected("one unit")),
            (_, Some(unit)) | (Stated::Known(unit), None) => Ok(unit),
            (Stated::Nothing | Stated::Other, None) => Err(self
                .mistake(Mistake::UnknownField)
                .in_column(head.name)
                .found(if head.unit == Stated::Nothing {
                    "no unit"
                } else {
                    "a unit that is not known"
                })
                .help(help)),
        }
    }

    fn value(&self, columns: &Columns) -> Result<(Picked, Quantity), InputError> {
        let said = columns.value.as_ref();
        let could = |head: &Head<'_>| head.neck().is_some();
        let head = self.head(said, "contact_ratio", "necks", "value", could)?;
        let head = head.ok_or_else(|| {
            self.mistake(Mistake::MissingColumn)
                .in_column("contact_ratio")
                .found("missing")
                .did_you_mean("contact_ratio", self.names())
                .help(self.has())
                .help(
                    "give neck radius over particle radius, in a column called contact_ratio; or say value = \"NAME\" and \
                     quantity in [columns] of the experiment file, or --value-column NAME --quantity neck-radius",
                )
        })?;
        let quantity = columns.quantity.or_else(|| head.neck().flatten()).ok_or_else(|| {
            let names = Quantity::NAMES.map(|(name, _)| name).join(", ");
            self.mistake(Mistake::UnknownField)
                .in_column(head.name)
                .found("a column that does not say what was measured")
                .expected(format_args!("one of {names}"))
                .help("say quantity = \"neck-radius\" in [columns] of the experiment file, or --quantity neck-radius")
        })?;
        // A pure number needs no unit.
        let unit = match (quantity.dimension(), head.unit, columns.value_unit) {
            (Dimension::Ratio, Stated::Nothing, None) => Unit::ONE,
            _ => self.unit(
                head,
                columns.value_unit,
                "value_unit",
                "give it with its unit, as in neck radius [um]; or say value_unit = \"um\" in [columns] of the experiment \
                 file, or --value-unit um",
            )?,
        };
        if unit.dimension == quantity.dimension() {
            Ok((Picked { place: head.place, name: head.name.to_owned(), unit }, quantity))
        } else {
            Err(self
                .mistake(Mistake::Conflict)
                .in_column(head.name)
                .found(format_args!("a {} in {unit}", quantity.name()))
                .expected(match quantity.dimension() {
                    Dimension::Length => "a unit of length",
                    _ => "a pure number or percent",
                }))
        }
    }

    /// The standard deviations: by their name alone, as many things scatter.
    fn sigma(&self, columns: &Columns) -> Result<Option<&'g Head<'g>>, InputError> {
        if let Some(name) = &columns.sigma {
            return self.named(name, "--sigma-column (sigma in [columns])").map(Some);
        }
        let could: Vec<&Head<'_>> =
            self.heads.iter().filter(|head| head.label == "sigma").collect();
        let found = self.one("standard deviations", "sigma", could)?;
        if found.is_none()
            && let Some(near) = self.names().find(|name| nearest(name, ["sigma"]).is_some())
        {
            return Err(self
                .mistake(Mistake::UnknownField)
                .in_column(near)
                .found("unknown column")
                .help("did you mean sigma? rename or remove it"));
        }
        Ok(found)
    }
}
