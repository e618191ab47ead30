//! An experiment: observations of one pair, and what the model needs to know of it.
//!
//! A description is a TOML file. Fields at the top:
//!
//! | field | | meaning |
//! |---|---|---|
//! | `table` | required | the [observation table](crate::input::observation_table), relative to the description |
//! | `material` | this or `[powder]` | a built-in material: `ps`, `pa12` or `peek` |
//! | `name` | default: the file's name | what the run is called |
//! | `title` | optional | a line for headings |
//! | `radius_m` | default: the material's | radius R used in the model \[m\]; only with `material` |
//! | `measured_radius_m` | optional | radius of the measured pair \[m\]; recorded, not used |
//! | `temperature_k` | optional | recorded, not used |
//! | `final_contact_ratio` | default 2^(1/3) = 1.26 | phi, the a/R where coalescence stops |
//! | `final_contact_ratio_reason` | optional | the reason for this phi |
//! | `window_s` | default: all rows | `[from, to]`, the observations to fit \[s\] |
//! | `source` | optional | who measured it, and where it was published |
//! | `[columns]` | optional | what the header of the table does not say ([`Columns`]) |
//! | `[heat]` | optional | what is known of the heat that the pair got ([`HeatFields`]) |
//!
//! Fields of the table `[powder]`, for a material that is not built in:
//!
//! | field | | meaning |
//! |---|---|---|
//! | `radius_m` | required | particle radius R \[m\] |
//! | `youngs_modulus_pa` | required | Young's modulus E \[Pa\] |
//! | `surface_tension_n_per_m` | required | surface tension gamma \[N/m\] |
//! | `density_kg_per_m3` | default 1000 | density rho \[kg/m3\] |
//!
//! Other fields are refused. The built-in experiments are such files too, compiled into the program
//! and read by the same code.

mod particles;

use std::path::{Path, PathBuf};

use dem_core::{PairSpec, Powder};

pub use self::particles::Constant;
use self::particles::{particles, radius};
use crate::careful::Careful;
use crate::error::{InputError, Mistake};
use crate::input::columns::Columns;
use crate::input::heat::HeatFields;
use crate::input::material::Material;
use crate::input::observation_table::{LARGEST_CONTACT_RATIO, ObservationTable};
use crate::input::text_file;
use crate::input::toml_fields::{At, Document, Fields};

/// The files of a built-in experiment.
struct BuiltIn {
    name: &'static str,
    description: &'static str,
    table: &'static str,
}

macro_rules! built_in {
    ($name:literal) => {
        BuiltIn {
            name: $name,
            description: include_str!(concat!("../../built-in/", $name, ".toml")),
            table: include_str!(concat!("../../built-in/", $name, ".csv")),
        }
    };
}

const BUILT_IN: [BuiltIn; 9] = [
    built_in!("ps-r30"),
    built_in!("ps-r60-e19"),
    built_in!("ps-r60-e23"),
    built_in!("ps-r60-e29"),
    built_in!("pa12-r32"),
    built_in!("pa12-r30"),
    built_in!("pa12-r29-3"),
    built_in!("pa12-r28-9"),
    built_in!("peek-450pf-r25"),
];

/// Names of the built-in experiments.
pub const BUILT_IN_NAMES: [&str; BUILT_IN.len()] = {
    let mut names = [""; BUILT_IN.len()];
    let mut place = 0;
    while place < names.len() {
        names[place] = BUILT_IN[place].name;
        place += 1;
    }
    names
};

/// A checked experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Name of the run.
    pub name: String,
    /// A line for headings.
    pub title: Option<String>,
    /// The material, where it is a built-in one.
    pub material: Option<Material>,
    /// The particles, with the radius R used in the model.
    pub powder: Powder,
    /// Radius of the measured pair \[m\].
    pub measured_radius_m: Option<f64>,
    /// Temperature of the experiment \[K\].
    pub temperature_k: Option<f64>,
    /// Final contact ratio phi.
    pub final_contact_ratio: f64,
    /// Reason for this phi.
    pub final_contact_ratio_reason: Option<String>,
    /// The observations to fit \[s\]; all where `None`.
    pub window_s: Option<[f64; 2]>,
    /// Who measured it, and where it was published.
    pub source: Option<String>,
    /// What is known of the heat that the pair got; one temperature, that of C1 and tau_s, where there is none.
    pub heat: Option<HeatFields>,
    /// The observations, all of them.
    pub table: ObservationTable,
    /// The description's file, or `built-in`; the table's where there is no description.
    pub description_name: String,
    /// The table's file, or `built-in`.
    pub table_name: String,
}

impl Experiment {
    /// A built-in experiment by name.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a name that is not built in.
    pub fn built_in(name: &str) -> Result<Self, InputError> {
        let Some(built_in) = BUILT_IN.iter().find(|built_in| built_in.name == name) else {
            return Err(InputError::new("--experiment", Mistake::UnknownName)
                .found(format_args!("\"{name}\""))
                .expected(format_args!("one of {}", BUILT_IN_NAMES.join(", ")))
                .did_you_mean(name, BUILT_IN_NAMES));
        };
        let description = format!("built-in experiments/{name}.toml");
        Self::parse(&description, name, built_in.description, |table, _, _| {
            let table_name = format!("built-in experiments/{table}");
            ObservationTable::parse(&table_name, built_in.table).map(|table| (table_name, table))
        })
    }

    /// The experiment that a built-in material is calibrated on.
    pub fn of_material(material: Material) -> Result<Self, InputError> {
        Self::built_in(material.experiment_name())
    }

    /// The experiment that `--experiment` names: a description, a bare table (which needs a material), or a built-in
    /// experiment by its name. `material` is that of `--material`, and `said` of the columns goes before what the description
    /// says of them.
    ///
    /// # Errors
    ///
    /// [`InputError`] from the file, or where `--material` and the description exclude each other.
    pub fn open(
        argument: &Path,
        material: Option<Material>,
        said: &Columns,
    ) -> Result<Self, InputError> {
        let built_in = argument.to_str().filter(|name| BUILT_IN_NAMES.contains(name));
        let experiment = if let Some(name) = built_in.filter(|_| !argument.exists()) {
            if *said != Columns::default() {
                return Err(InputError::new("--experiment", Mistake::Conflict)
                    .found(format_args!("{name}, whose columns are known, and options on columns"))
                    .help("leave out one of them"));
            }
            Self::built_in(name)?
        } else if is_toml(argument) {
            Self::read(argument, said)?
        } else {
            return Self::from_table(argument, material, said);
        };
        match (material, experiment.material) {
            (Some(asked), Some(described)) if asked != described => {
                Err(InputError::new("--material", Mistake::Conflict)
                    .found(asked)
                    .expected(format_args!(
                        "{described}, which {} names",
                        experiment.description_name
                    ))
                    .help("leave out --material"))
            }
            (Some(asked), None) => Err(InputError::new("--material", Mistake::Conflict)
                .found(format_args!(
                    "{asked}, but {} has a [powder] of its own",
                    experiment.description_name
                ))
                .help("leave out --material, or take [powder] out of the description")),
            _ => Ok(experiment),
        }
    }

    /// Reads a description and its table; `said` of the columns goes before what the description says of them.
    pub fn read(path: &Path, said: &Columns) -> Result<Self, InputError> {
        let text = text_file::read(path)?;
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into());
        Self::parse(&path.display().to_string(), &stem, &text, |table, columns, radius_m| {
            let table_path = match path.parent() {
                Some(folder) => folder.join(table),
                None => PathBuf::from(table),
            };
            let columns = said.clone().or(columns);
            let table = ObservationTable::read(&table_path, &columns, Some(radius_m))?;
            Ok((table_path.display().to_string(), table))
        })
    }

    /// A bare table of a built-in material.
    fn from_table(
        path: &Path,
        material: Option<Material>,
        said: &Columns,
    ) -> Result<Self, InputError> {
        let radius_m = material.map(|material| material.powder().radius_m);
        let table = ObservationTable::read(path, said, radius_m)?;
        let table_name = path.display().to_string();
        let Some(material) = material else {
            return Err(InputError::new(&table_name, Mistake::MissingField)
                .found("a bare table, which does not say what the particles are made of")
                .help("add --material ps|pa12|peek")
                .help(format_args!(
                    "or describe your own powder: calibrate init {table_name} writes the files"
                )));
        };
        Ok(Self {
            name: path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into()),
            title: None,
            material: Some(material),
            powder: material.powder(),
            measured_radius_m: None,
            temperature_k: None,
            final_contact_ratio: full_coalescence(),
            final_contact_ratio_reason: None,
            window_s: None,
            source: None,
            heat: None,
            table,
            description_name: table_name.clone(),
            table_name,
        })
    }

    /// Reads a description from text; `open_table` reads the table that it names, with the columns that it says and the
    /// particle radius \[m\] that lengths are divided by, and says what it is called.
    pub fn parse(
        file: &str,
        default_name: &str,
        text: &str,
        open_table: impl FnOnce(&str, &Columns, f64) -> Result<(String, ObservationTable), InputError>,
    ) -> Result<Self, InputError> {
        let document = Document::parse(file, text)?;
        let fields = document.top();
        let name = match fields.text("name")? {
            Some(At { value, line }) => checked_name(&fields, value, line)?,
            None => default_name.to_owned(),
        };
        let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
        let title = owned("title")?;
        let source = owned("source")?;
        let final_contact_ratio_reason = owned("final_contact_ratio_reason")?;
        let (material, powder) = particles(&fields)?;
        let measured_radius_m = radius(&fields, "measured_radius_m")?;
        let temperature_k = fields.positive("temperature_k", "K")?.map(|at| at.value);
        let final_contact_ratio = match fields.number("final_contact_ratio")? {
            Some(at) => checked_phi(at.value).map_err(|(expected, help)| {
                fields
                    .error("final_contact_ratio", at.line, Mistake::OutOfRange)
                    .found(at.value)
                    .expected(expected)
                    .help(help)
            })?,
            None => full_coalescence(),
        };
        let window = fields.pair("window_s")?;
        let table_field = fields.text("table")?;
        let columns = fields.table("columns")?.map(|columns| Columns::of(&columns)).transpose()?;
        let heat = fields.table("heat")?;
        fields.finish()?;
        let folder = text_file::folder_of(Path::new(file));
        let heat = heat.map(|heat| HeatFields::read(folder, &heat)).transpose()?;

        let Some(table_field) = table_field else {
            return Err(fields.missing("table").expected("the observation table").help(
                "add table = \"my-powder.csv\", a CSV with the columns time_s and contact_ratio",
            ));
        };
        let columns = columns.unwrap_or_default();
        let measured = measured_radius_m.unwrap_or(powder.radius_m);
        let (table_name, table) = open_table(table_field.value, &columns, measured)
            .map_err(|error| error.named_in(&fields, "table", table_field.line))?;
        if let Some(At { value: window, line }) = window {
            check_window(&table, &table_name, window).map_err(|error| InputError {
                source_name: file.into(),
                line: Some(line),
                field: Some("field window_s".into()),
                ..error
            })?;
        }
        Ok(Self {
            name,
            title,
            material,
            powder,
            measured_radius_m,
            temperature_k,
            final_contact_ratio,
            final_contact_ratio_reason,
            window_s: window.map(|at| at.value),
            source,
            heat,
            table,
            description_name: file.to_owned(),
            table_name,
        })
    }

    /// The observations to fit: those in `window_s`, or else in the description's window, or else all.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a window the wrong way round or without an observation.
    pub fn observations(&self, window_s: Option<[f64; 2]>) -> Result<ObservationTable, InputError> {
        match window_s.or(self.window_s) {
            Some(window) => {
                check_window(&self.table, &self.table_name, window)?;
                Ok(self.table.within(window))
            }
            None => Ok(self.table.clone()),
        }
    }

    /// The window that [`observations`](Self::observations) keeps, as a plan records it: an end that was
    /// left open is that of the table.
    pub fn fitted_window(&self, window_s: Option<[f64; 2]>) -> Option<[f64; 2]> {
        let last = self.table.span_s()[1];
        window_s
            .or(self.window_s)
            .map(|[start, end]| [start, if end.is_finite() { end } else { last }])
    }

    /// Values that are allowed but probably a mistake, in words.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let largest = self.table.contact_ratio.iter().copied().fold(0.0, f64::max);
        if largest > 1.15 * self.final_contact_ratio {
            let warning = Careful::AboveFinalContactRatio {
                table: self.table_name.clone(),
                largest,
                final_contact_ratio: self.final_contact_ratio,
            };
            warnings.push(warning.to_string());
        }
        warnings.extend(self.below_the_adhesive_contact());
        if let Some(measured) = self.measured_radius_m
            && (self.powder.radius_m / measured).ln().abs() > 0.5f64.ln().abs()
        {
            let warning = Careful::OtherRadius {
                experiment: self.description_name.clone(),
                model_m: self.powder.radius_m,
                measured_m: measured,
            };
            warnings.push(warning.to_string());
        }
        warnings
    }
}

impl Experiment {
    /// The warning that most rows lie below the contact that growth starts from: the model never does, and a stray row or
    /// two is noise, so that half of them speak for a unit.
    fn below_the_adhesive_contact(&self) -> Option<String> {
        let pair = PairSpec::new(self.powder, self.final_contact_ratio).build().ok()?;
        let start = pair.start_contact_ratio();
        let largest = self.table.contact_ratio.iter().copied().fold(0.0, f64::max);
        let below = self.table.contact_ratio.iter().filter(|ratio| **ratio < start).count();
        (2 * below > self.table.len()).then(|| {
            let warning = Careful::BelowAdhesiveContact {
                table: self.table_name.clone(),
                below,
                rows: self.table.len(),
                start,
                radius_m: self.powder.radius_m,
                in_metres: Some(largest / self.powder.radius_m)
                    .filter(|ratio| (0.05..=LARGEST_CONTACT_RATIO).contains(ratio)),
            };
            warning.to_string()
        })
    }
}

/// Two equal spheres merged at constant volume: `2^(1/3)`.
pub fn full_coalescence() -> f64 {
    2f64.cbrt()
}

/// Whether a file is TOML, by its name.
pub fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Checks a final contact ratio: 0.1 to 2.
///
/// # Errors
///
/// The expected range and a remedy.
pub fn checked_phi(phi: f64) -> Result<f64, (&'static str, &'static str)> {
    if (0.1..=LARGEST_CONTACT_RATIO).contains(&phi) {
        Ok(phi)
    } else {
        Err((
            "a contact ratio between 0.1 and 2",
            "phi is the a/R where coalescence stops: 1.26 (2^(1/3)) for full coalescence, or the plateau you measured",
        ))
    }
}

fn check_window(
    table: &ObservationTable,
    table_name: &str,
    [start, end]: [f64; 2],
) -> Result<(), InputError> {
    let error = |mistake| InputError::new("--window", mistake).found(format_args!("{start}:{end}"));
    if start.is_nan() || end.is_nan() || start >= end {
        return Err(error(Mistake::Bounds)
            .expected("a start before its end [s]")
            .help("swap them, as in 0.0:1.5"));
    }
    if table.within([start, end]).is_empty() {
        let [first, last] = table.span_s();
        return Err(error(Mistake::EmptyWindow)
            .expected("a window with observations")
            .help(format_args!("{table_name} runs from {first} s to {last} s")));
    }
    Ok(())
}

/// Whether a character can stand in the name of a run.
pub(crate) fn is_plain(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | '+')
}

/// Checks a name, which becomes that of a folder.
pub(crate) fn checked_name(
    fields: &Fields<'_>,
    name: &str,
    line: usize,
) -> Result<String, InputError> {
    if name.chars().all(is_plain) && !name.starts_with('.') && name.len() <= 100 {
        return Ok(name.to_owned());
    }
    Err(fields
        .error("name", line, Mistake::OutOfRange)
        .found(format_args!("\"{name}\""))
        .expected("letters, digits, - _ . +, not starting with a dot")
        .help("the results go into a folder of that name; put the long form into title"))
}

#[cfg(test)]
mod tests;
