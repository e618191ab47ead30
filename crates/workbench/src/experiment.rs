//! An experiment: observations of one pair, and what the model needs to know of it.
//!
//! A description is a TOML file. Fields at the top:
//!
//! | field | | meaning |
//! |---|---|---|
//! | `table` | required | the [observation table](crate::observation_table), relative to the description |
//! | `material` | this or `[powder]` | a built-in material: `ps`, `pa12` or `peek` |
//! | `name` | default: the file's name | what the run is called |
//! | `title` | optional | a line for headings |
//! | `radius_m` | default: the material's | radius R used in the model \[m\]; only with `material` |
//! | `measured_radius_m` | optional | radius of the measured pair \[m\]; recorded, not used |
//! | `temperature_k` | optional | recorded, not used |
//! | `final_contact_ratio` | default 2^(1/3) = 1.26 | phi, the a/R where coalescence stops |
//! | `final_contact_ratio_reason` | optional | why phi is what it is |
//! | `window_s` | default: all rows | `[from, to]`, the observations to fit \[s\] |
//! | `source` | optional | who measured it, and where it was published |
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

use std::path::{Path, PathBuf};

use dem_core::{Powder, paper};

use crate::error::{InputError, Mistake, nearest};
use crate::material::Material;
use crate::observation_table::ObservationTable;
use crate::text_file;
use crate::toml_fields::{At, Document, Fields};

/// A built-in experiment: name, description, table.
struct BuiltIn {
    name: &'static str,
    description: &'static str,
    table: &'static str,
}

macro_rules! built_in {
    ($name:literal) => {
        BuiltIn {
            name: $name,
            description: include_str!(concat!("../../../experiments/", $name, ".toml")),
            table: include_str!(concat!("../../../experiments/", $name, ".csv")),
        }
    };
}

const BUILT_IN: [BuiltIn; 4] = [
    built_in!("ps-r30"),
    built_in!("pa12-r32"),
    built_in!("pa12-r30"),
    built_in!("peek-450pf-r25"),
];

/// Names of the built-in experiments.
pub const BUILT_IN_NAMES: [&str; 4] =
    [BUILT_IN[0].name, BUILT_IN[1].name, BUILT_IN[2].name, BUILT_IN[3].name];

/// A checked experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// What the run is called.
    pub name: String,
    /// A line for headings.
    pub title: Option<String>,
    /// The built-in material, if it is one.
    pub material: Option<Material>,
    /// The particles, with the radius R used in the model.
    pub powder: Powder,
    /// Radius of the measured pair \[m\].
    pub measured_radius_m: Option<f64>,
    /// Temperature of the experiment \[K\].
    pub temperature_k: Option<f64>,
    /// Final contact ratio phi.
    pub final_contact_ratio: f64,
    /// Why phi is what it is.
    pub final_contact_ratio_reason: Option<String>,
    /// The observations to fit \[s\]; all where `None`.
    pub window_s: Option<[f64; 2]>,
    /// Who measured it.
    pub source: Option<String>,
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
                .help_if(
                    nearest(name, BUILT_IN_NAMES).map(|near| format!("did you mean {near}?")),
                ));
        };
        let description = format!("built-in experiments/{name}.toml");
        Self::parse(&description, name, built_in.description, |table| {
            let table_name = format!("built-in experiments/{table}");
            ObservationTable::parse(&table_name, built_in.table).map(|table| (table_name, table))
        })
    }

    /// The experiment that a built-in material is calibrated on.
    ///
    /// # Errors
    ///
    /// None in practice: what is compiled in is held by a test.
    pub fn of_material(material: Material) -> Result<Self, InputError> {
        Self::built_in(material.experiment_name())
    }

    /// What `--experiment` names: a description, a bare table (which needs a material), or a built-in
    /// experiment by its name. `material` is what `--material` says.
    ///
    /// # Errors
    ///
    /// [`InputError`] from the file, or where `--material` and the description exclude each other.
    pub fn open(argument: &Path, material: Option<Material>) -> Result<Self, InputError> {
        let built_in = argument.to_str().filter(|name| BUILT_IN_NAMES.contains(name));
        let experiment = if let Some(name) = built_in.filter(|_| !argument.exists()) {
            Self::built_in(name)?
        } else if is_toml(argument) {
            Self::read(argument)?
        } else {
            return Self::from_table(argument, material);
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

    /// Reads a description and its table.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line, field, value and remedy.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = text_file::read(path)?;
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into());
        Self::parse(&path.display().to_string(), &stem, &text, |table| {
            let table_path = match path.parent() {
                Some(folder) => folder.join(table),
                None => PathBuf::from(table),
            };
            Ok((table_path.display().to_string(), ObservationTable::read(&table_path)?))
        })
    }

    /// A bare table of a built-in material.
    fn from_table(path: &Path, material: Option<Material>) -> Result<Self, InputError> {
        let table = ObservationTable::read(path)?;
        let table_name = path.display().to_string();
        let Some(material) = material else {
            return Err(InputError::new(&table_name, Mistake::MissingField)
                .found("a bare table, which does not say what the particles are made of")
                .help("add --material ps|pa12|peek")
                .help("or describe your own powder in a TOML file (see experiments/example-my-powder.toml) and name that"));
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
            table,
            description_name: table_name.clone(),
            table_name,
        })
    }

    /// Reads a description from text; `open_table` reads the table that it names and says what it is called.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line, field, value and remedy.
    pub fn parse(
        file: &str,
        default_name: &str,
        text: &str,
        open_table: impl FnOnce(&str) -> Result<(String, ObservationTable), InputError>,
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
        fields.finish()?;

        let Some(table_field) = table_field else {
            return Err(fields.missing("table").expected("the observation table").help(
                "add table = \"my-powder.csv\", a CSV with the columns time_s and contact_ratio",
            ));
        };
        let (table_name, table) = open_table(table_field.value)
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
    #[must_use]
    pub fn fitted_window(&self, window_s: Option<[f64; 2]>) -> Option<[f64; 2]> {
        let last = self.table.span_s()[1];
        window_s
            .or(self.window_s)
            .map(|[start, end]| [start, if end.is_finite() { end } else { last }])
    }

    /// What is allowed and yet worth saying.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let largest = self.table.contact_ratio.iter().copied().fold(0.0, f64::max);
        if largest > 1.15 * self.final_contact_ratio {
            warnings.push(format!(
                "{}: a/R reaches {largest}, but the model stops at final_contact_ratio = {}: later rows cannot be fitted",
                self.table_name, self.final_contact_ratio
            ));
        }
        if let Some(measured) = self.measured_radius_m
            && (self.powder.radius_m / measured).ln().abs() > 0.5f64.ln().abs()
        {
            warnings.push(format!(
                "{}: the model uses R = {} m, the pair measured {measured} m",
                self.description_name, self.powder.radius_m
            ));
        }
        warnings
    }
}

/// Two equal spheres merged at constant volume: `2^(1/3)`.
#[must_use]
pub fn full_coalescence() -> f64 {
    2f64.cbrt()
}

/// A file that is a description by its name.
#[must_use]
pub fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// A final contact ratio that makes sense; else what was expected and a remedy.
///
/// # Errors
///
/// What was expected, and a remedy.
pub fn checked_phi(phi: f64) -> Result<f64, (&'static str, &'static str)> {
    if (0.1..=crate::observation_table::LARGEST_CONTACT_RATIO).contains(&phi) {
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

/// A name becomes that of a folder.
pub(crate) fn checked_name(
    fields: &Fields<'_>,
    name: &str,
    line: usize,
) -> Result<String, InputError> {
    let plain = name.chars().all(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | '+'));
    if plain && !name.starts_with('.') && name.len() <= 100 {
        return Ok(name.to_owned());
    }
    Err(fields
        .error("name", line, Mistake::OutOfRange)
        .found(format_args!("\"{name}\""))
        .expected("letters, digits, - _ . +, not starting with a dot")
        .help("the results go into a folder of that name; put the long form into title"))
}

/// Either a built-in material or a powder of its own.
fn particles(fields: &Fields<'_>) -> Result<(Option<Material>, Powder), InputError> {
    let named = fields.text("material")?;
    let own = fields.table("powder")?;
    let radius_m = radius(fields, "radius_m")?;
    match (named, own) {
        (Some(At { line, .. }), Some(_)) => Err(fields
            .error("material", line, Mistake::Conflict)
            .found("both material and [powder]")
            .help("keep material for the values of the paper, or [powder] for your own")),
        (None, None) => Err(fields
            .missing("material")
            .expected("a material or a table [powder]")
            .help(format_args!(
                "add material = \"pa12\" (built in: {})",
                Material::NAMES.join(", ")
            ))
            .help(
                "or a table [powder] with radius_m, youngs_modulus_pa and surface_tension_n_per_m",
            )),
        (Some(At { value, line }), None) => {
            let Some(material) = Material::from_name(value) else {
                return Err(fields
                    .error("material", line, Mistake::UnknownName)
                    .found(format_args!("\"{value}\""))
                    .expected(format_args!("one of {}", Material::NAMES.join(", ")))
                    .help_if(
                        nearest(value, Material::NAMES).map(|near| format!("did you mean {near}?")),
                    )
                    .help("or give a table [powder] with your own values"));
            };
            let powder = material.powder();
            Ok((Some(material), Powder { radius_m: radius_m.unwrap_or(powder.radius_m), ..powder }))
        }
        (None, Some(own)) => {
            if radius_m.is_some() {
                return Err(fields
                    .table_error(Mistake::Conflict)
                    .in_field("radius_m")
                    .found("a radius outside [powder]")
                    .help("move radius_m into the table [powder]"));
            }
            let missing = |key: &str, example: &str| {
                own.missing(key).expected("a number").help(format_args!("add {key} = {example}"))
            };
            let radius_m = radius(&own, "radius_m")?.ok_or_else(|| missing("radius_m", "30e-6"))?;
            let youngs_modulus_pa = scaled(&own, YOUNGS_MODULUS)?
                .ok_or_else(|| missing("youngs_modulus_pa", "1.6e9"))?;
            let surface_tension_n_per_m = scaled(&own, SURFACE_TENSION)?
                .ok_or_else(|| missing("surface_tension_n_per_m", "0.035"))?;
            let density_kg_per_m3 = scaled(&own, DENSITY)?.unwrap_or(paper::DENSITY_KG_PER_M3);
            own.finish().map_err(misplaced)?;
            Ok((
                None,
                Powder { radius_m, youngs_modulus_pa, surface_tension_n_per_m, density_kg_per_m3 },
            ))
        }
    }
}

/// In TOML whatever follows `[powder]` belongs to it: the most likely reason for a field there that
/// belongs to the top.
fn misplaced(error: InputError) -> InputError {
    const TOP: [&str; 11] = [
        "name",
        "title",
        "material",
        "table",
        "measured_radius_m",
        "temperature_k",
        "final_contact_ratio",
        "final_contact_ratio_reason",
        "window_s",
        "source",
        "powder",
    ];
    let field = error.field.as_deref().and_then(|field| field.strip_prefix("field powder."));
    match field.filter(|field| TOP.contains(field)).map(str::to_owned) {
        Some(field) => InputError {
            help: vec![format!(
                "move {field} above the line [powder]: what follows that belongs to it"
            )],
            ..error
        },
        None => error,
    }
}

/// A quantity, the range a powder can have, and the unit people give it in by mistake.
struct Quantity {
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    mistaken: &'static [(&'static str, f64)],
}

const YOUNGS_MODULUS: Quantity = Quantity {
    key: "youngs_modulus_pa",
    unit: "Pa",
    range: [1e3, 1e13],
    mistaken: &[("GPa", 1e9), ("MPa", 1e6)],
};
const SURFACE_TENSION: Quantity = Quantity {
    key: "surface_tension_n_per_m",
    unit: "N/m",
    range: [1e-4, 10.0],
    mistaken: &[("mN/m", 1e-3)],
};
const DENSITY: Quantity = Quantity {
    key: "density_kg_per_m3",
    unit: "kg/m3",
    range: [10.0, 1e5],
    mistaken: &[("g/cm3", 1e3)],
};

/// Particle radii: a nanometre to a centimetre.
const fn radius_quantity(key: &'static str) -> Quantity {
    Quantity { key, unit: "m", range: [1e-9, 1e-2], mistaken: &[("um", 1e-6), ("mm", 1e-3)] }
}

fn radius(fields: &Fields<'_>, key: &'static str) -> Result<Option<f64>, InputError> {
    scaled(fields, radius_quantity(key))
}

fn scaled(fields: &Fields<'_>, quantity: Quantity) -> Result<Option<f64>, InputError> {
    let Quantity { key, unit, range: [low, high], mistaken } = quantity;
    let Some(At { value, line }) = fields.positive(key, unit)? else { return Ok(None) };
    if (low..=high).contains(&value) {
        return Ok(Some(value));
    }
    let meant = mistaken.iter().find(|(_, scale)| (low..=high).contains(&(value * scale)));
    Err(fields
        .error(key, line, Mistake::OutOfRange)
        .found(value)
        .expected(format_args!("{low:e} to {high:e} {unit}"))
        .help_if(meant.map(|(wrong, scale)| {
            format!("is that in {wrong}? write {key} = {value}e{}", scale.log10().round())
        })))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TABLE: &str = "time_s,contact_ratio\n0,0.1\n1,0.5\n2,1.0\n";

    fn parse(text: &str) -> Result<Experiment, InputError> {
        Experiment::parse("my.toml", "my", text, |name| {
            Ok((name.to_owned(), ObservationTable::parse(name, TABLE)?))
        })
    }

    #[test]
    fn a_description_needs_only_a_table_and_a_material() {
        let experiment = parse("table = \"t.csv\"\nmaterial = \"pa12\"\n").expect("valid");
        assert_eq!(experiment.name, "my");
        assert_eq!(experiment.powder, paper::PA12);
        assert_eq!(experiment.final_contact_ratio, 2f64.cbrt());
        assert_eq!(experiment.table_name, "t.csv");
        assert_eq!(experiment.observations(None).expect("all").len(), 3);
        assert_eq!(experiment.observations(Some([0.5, 1.5])).expect("one").len(), 1);
        let open = Some([0.5, f64::INFINITY]);
        assert_eq!(experiment.observations(open).expect("two").len(), 2);
        assert_eq!(experiment.fitted_window(open), Some([0.5, 2.0]));
        assert_eq!(experiment.fitted_window(None), None);
    }

    #[test]
    fn a_powder_of_ones_own_has_the_density_of_table_2_unless_it_says_otherwise() {
        let text = "table = \"t.csv\"\n[powder]\nradius_m = 20e-6\nyoungs_modulus_pa = 2_000_000_000\n\
                    surface_tension_n_per_m = 0.03\n";
        let experiment = parse(text).expect("valid");
        assert_eq!(experiment.material, None);
        assert_eq!(experiment.powder.radius_m, 20e-6);
        assert_eq!(experiment.powder.youngs_modulus_pa, 2e9);
        assert_eq!(experiment.powder.density_kg_per_m3, 1000.0);
        let denser = parse(&format!("{text}density_kg_per_m3 = 1200\n")).expect("valid");
        assert_eq!(denser.powder.density_kg_per_m3, 1200.0);
    }

    #[test]
    fn each_mistake_names_its_line_and_field() {
        let ps = "material = \"ps\"\ntable = \"t.csv\"\n";
        let powder = "table = \"t.csv\"\n[powder]\nyoungs_modulus_pa = 2e9\nsurface_tension_n_per_m = 0.03\n";
        for (text, kind, line, says) in [
            ("material = \"ps\"\n".to_owned(), Mistake::MissingField, None, "field table"),
            ("table = \"t.csv\"\n".to_owned(), Mistake::MissingField, None, "[powder]"),
            (
                "table = \"t.csv\"\nmaterial = \"pa21\"".to_owned(),
                Mistake::UnknownName,
                Some(2),
                "did you mean pa12?",
            ),
            (format!("{ps}titel = \"x\"\n"), Mistake::UnknownField, Some(3), "did you mean title?"),
            (format!("{ps}radius_m = 30.5\n"), Mistake::OutOfRange, Some(3), "radius_m = 30.5e-6"),
            (format!("{ps}radius_m = 0\n"), Mistake::OutOfRange, Some(3), "a number > 0 [m]"),
            (format!("{ps}radius_m = -1e-6\n"), Mistake::Negative, Some(3), "radius_m"),
            (format!("{ps}radius_m = nan\n"), Mistake::NotFinite, Some(3), "radius_m"),
            (format!("{ps}radius_m = \"30 um\"\n"), Mistake::WrongType, Some(3), "without quotes"),
            (format!("{ps}final_contact_ratio = 0\n"), Mistake::OutOfRange, Some(3), "phi"),
            (format!("{ps}final_contact_ratio = 126\n"), Mistake::OutOfRange, Some(3), "phi"),
            (format!("{ps}window_s = [2, 1]\n"), Mistake::Bounds, Some(3), "swap"),
            (format!("{ps}window_s = [5, 6]\n"), Mistake::EmptyWindow, Some(3), "0 s to 2 s"),
            (format!("{ps}window_s = [5]\n"), Mistake::WrongType, Some(3), "two numbers"),
            (format!("{ps}window_s = 5\n"), Mistake::WrongType, Some(3), "two numbers"),
            (format!("{ps}name = \"../x\"\n"), Mistake::OutOfRange, Some(3), "folder"),
            (format!("{ps}source = \"\"\n"), Mistake::Empty, Some(3), "leave"),
            (format!("{ps}[powder]\n"), Mistake::Conflict, Some(1), "both material and [powder]"),
            (format!("{ps}name =\n"), Mistake::Syntax, Some(3), "not TOML"),
            (powder.to_owned(), Mistake::MissingField, Some(2), "powder.radius_m"),
            (format!("{powder}radius_m = 20\n"), Mistake::OutOfRange, Some(5), "is that in um?"),
            (
                format!("{powder}radius_m = 2e-5\nrho = 1\n"),
                Mistake::UnknownField,
                Some(6),
                "known",
            ),
            (format!("radius_m = 2e-5\n{powder}"), Mistake::Conflict, None, "move radius_m"),
            (
                format!("{powder}radius_m = 2e-5\nwindow_s = [0, 1]\n"),
                Mistake::UnknownField,
                Some(6),
                "move window_s above the line [powder]",
            ),
            (format!("powder = 3\n{ps}"), Mistake::WrongType, Some(1), "a table [powder]"),
        ] {
            let error = parse(&text).expect_err(&text);
            assert_eq!((error.mistake, error.line), (kind, line), "{text}\n{error}");
            assert!(error.to_string().contains(says), "{text}\n{error}");
            assert!(error.to_string().starts_with("my.toml"), "{error}");
        }
        let gigapascal =
            powder.replace("2e9", "1.6").replace("[powder]", "[powder]\nradius_m = 2e-5");
        let error = parse(&gigapascal).expect_err("GPa");
        assert!(error.to_string().contains("write youngs_modulus_pa = 1.6e9"), "{error}");
    }

    #[test]
    fn built_in_experiments_are_those_of_the_paper() {
        for name in BUILT_IN_NAMES {
            let experiment = Experiment::built_in(name).expect(name);
            assert_eq!(experiment.name, name);
            assert!(experiment.source.is_some() && experiment.title.is_some(), "{name}");
            assert_eq!(experiment.warnings(), Vec::<String>::new());
        }
        for (material, points, phi) in [
            (Material::Ps, 44, 1.08),
            (Material::Pa12, 30, full_coalescence()),
            (Material::Peek, 26, full_coalescence()),
        ] {
            let experiment = Experiment::of_material(material).expect("built in");
            assert_eq!(experiment.material, Some(material));
            assert_eq!(experiment.powder, material.powder());
            assert_eq!(experiment.observations(None).expect("all").len(), points);
            assert_eq!(experiment.final_contact_ratio, phi);
        }
        let other_pair = Experiment::built_in("pa12-r30").expect("built in");
        let transferred = 31.5e-6 * 30.4 / 32.1;
        assert!((other_pair.powder.radius_m / transferred - 1.0).abs() < 1e-6);
        let misspelt = Experiment::built_in("pa12-r23").expect_err("unknown");
        assert!(misspelt.to_string().contains("did you mean pa12-r32?"), "{misspelt}");
    }

    proptest! {
        #[test]
        fn arbitrary_descriptions_never_panic(text in ".*") {
            let _ = parse(&text);
        }

        #[test]
        fn nearly_valid_descriptions_never_panic(
            keys in proptest::collection::vec(
                ("(table|material|radius_m|window_s|name|powder|\\[powder\\]|[a-z_.]{1,9})",
                 "(\"[a-z0-9.]{0,6}\"|-?[0-9]{1,4}(\\.[0-9])?(e-?[0-9]{1,3})?|nan|inf|\\[[0-9, ]{0,8}\\]|0x1f|true|1979-05-27|\\{a=1\\})"),
                0..6),
        ) {
            let text: String = keys.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
            let _ = parse(&text);
        }
    }
}
