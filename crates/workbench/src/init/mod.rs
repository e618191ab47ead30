//! Experiment and prior files for a table: from measurements to a calibration without writing a file by hand.
//!
//! The priors are ranges around a quick fit of the same table, so wide that the data decide:
//!
//! | parameter | range | of |
//! |---|---|---|
//! | tau_s | 0.1 to 10 times | the sintering time of the best Frenkel curve, least squares in a/R |
//! | C1 | 1e-4 to 100 times | `R/(gamma tau_s)`, the size of the fluidity 1/eta in Frenkel's law (eq. 5: tau_s is of the size `eta R/gamma`) |
//! | delta_c | R/3000 to R/10 | |
//!
//! For R = 30 um these are the widths of the built-in priors.

mod quick_fit;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use dem_core::{Powder, Sintering, paper};
use figures::{Figure as _, FitFigure, Width};

use self::quick_fit::{QuickFit, quick_fit};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::columns::Columns;
use crate::input::experiment::{Experiment, is_plain, is_toml};
use crate::input::material::Material;
use crate::input::observation_table::ObservationTable;
use crate::input::prior_file::PriorFile;
use crate::input::toml_fields::quoted;
use crate::number::significant;
use crate::output::{check_file, write_file};
use crate::plan::shell_word;

/// What is known of a table and its powder.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct InitOptions {
    /// The table.
    pub table: PathBuf,
    /// What is said of its columns.
    pub columns: Columns,
    /// Built-in material, whose constants are taken.
    pub material: Option<Material>,
    /// Particle radius R \[m\].
    pub radius_m: Option<f64>,
    /// Young's modulus E \[Pa\]; the material's where there is none.
    pub youngs_modulus_pa: Option<f64>,
    /// Surface tension gamma \[N/m\]; the material's where there is none.
    pub surface_tension_n_per_m: Option<f64>,
    /// Density rho \[kg/m3\]; the material's, or 1000, where there is none.
    pub density_kg_per_m3: Option<f64>,
    /// Final contact ratio phi; from the table where there is none.
    pub final_contact_ratio: Option<f64>,
    /// Whether files that are there are written over.
    pub overwrite: bool,
}

/// What must be known, and is not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Open {
    /// The particle radius.
    Radius,
    /// The material, or Young's modulus of another.
    YoungsModulus,
    /// The material, or the surface tension of another.
    SurfaceTension,
}

impl InitOptions {
    /// What must still be said.
    pub fn open(&self) -> Vec<Open> {
        let own = self.material.is_none();
        let open = [
            (self.radius_m.is_none(), Open::Radius),
            (own && self.youngs_modulus_pa.is_none(), Open::YoungsModulus),
            (own && self.surface_tension_n_per_m.is_none(), Open::SurfaceTension),
        ];
        open.into_iter().filter(|(is_open, _)| *is_open).map(|(_, open)| open).collect()
    }

    /// The powder, once nothing is open.
    ///
    /// # Errors
    ///
    /// Everything that is open, with the option that says it.
    fn powder(&self) -> Result<Powder, InputError> {
        let of = self.material.map(Material::powder);
        let (Some(radius_m), Some(youngs_modulus_pa), Some(surface_tension_n_per_m)) = (
            self.radius_m,
            self.youngs_modulus_pa.or(of.map(|powder| powder.youngs_modulus_pa)),
            self.surface_tension_n_per_m.or(of.map(|powder| powder.surface_tension_n_per_m)),
        ) else {
            let missing = |open| {
                let (option, what, example) = match open {
                    Open::Radius => ("--radius-m", "the particle radius R [m]", "30e-6"),
                    Open::YoungsModulus => {
                        ("--youngs-modulus-pa", "Young's modulus E [Pa]", "1.6e9")
                    }
                    Open::SurfaceTension => {
                        ("--surface-tension-n-per-m", "the surface tension gamma [N/m]", "0.035")
                    }
                };
                let error = InputError::new(option, Mistake::MissingField)
                    .found("missing")
                    .expected(format_args!("{what}, as in {option} {example}"));
                if open == Open::Radius {
                    error
                } else {
                    error.help("or --material ps|pa12|peek for that of the paper")
                }
            };
            let all = InputError::all(self.open().into_iter().map(missing).collect());
            return Err(all.unwrap_or_else(|| InputError::new("init", Mistake::MissingField)));
        };
        let density = of.map_or(paper::DENSITY_KG_PER_M3, |powder| powder.density_kg_per_m3);
        Ok(Powder {
            radius_m,
            youngs_modulus_pa,
            surface_tension_n_per_m,
            density_kg_per_m3: self.density_kg_per_m3.unwrap_or(density),
        })
    }

    /// Whether the constants are those of the material.
    fn built_in(&self) -> Option<Material> {
        let own =
            self.youngs_modulus_pa.or(self.surface_tension_n_per_m).or(self.density_kg_per_m3);
        self.material.filter(|_| own.is_none())
    }
}

/// Files that were written, and what to do next.
#[derive(Debug, Clone, PartialEq)]
pub struct Initialised {
    /// What was found and written, and the next commands.
    pub text: String,
    /// Values that are allowed but probably a mistake.
    pub warnings: Vec<String>,
}

/// Reads the table, and writes the experiment, the priors and a figure of the data beside it. Nothing is written where one
/// of the files is there, unless they are to be written over.
///
/// # Errors
///
/// [`Failure`] from the table, for what is open, or for files that are there or cannot be written.
pub fn init(options: &InitOptions) -> Result<Initialised, Failure> {
    if is_toml(&options.table) {
        return Err(InputError::new(options.table.display().to_string(), Mistake::Conflict)
            .found("a TOML file")
            .expected("a table of measurements")
            .help("calibrate check says what is in that file")
            .into());
    }
    let powder = options.powder()?;
    let table = ObservationTable::read(&options.table, &options.columns, Some(powder.radius_m))?;
    let files = Files::beside(&options.table);
    files.check(options.overwrite)?;
    let Some(fit) = quick_fit(powder, &table)? else {
        return Err(InputError::new(options.table.display().to_string(), Mistake::EmptyWindow)
            .found("no observation after first contact")
            .expected("times above 0")
            .into());
    };
    let phi = options.final_contact_ratio.unwrap_or(fit.final_contact_ratio);
    let experiment_text = experiment_text(options, &files, powder, &table, &fit);
    let priors_text = priors_text(&files, powder, &fit);
    // What is written is what the other commands read.
    let experiment = Experiment::parse(
        &files.experiment.display().to_string(),
        &files.name,
        &experiment_text,
        |name, _, _| Ok((name.to_owned(), table.clone())),
    )?;
    let priors = PriorFile::parse(&files.priors.display().to_string(), &priors_text)?;
    let picture = figure(&files.name, powder, phi, &table, &fit)?
        .render(Width::Column)
        .map_err(|error| RunError::new(format_args!("the figure of the data: {error}")))?;
    write_file(&files.experiment, experiment_text.as_bytes())?;
    write_file(&files.priors, priors_text.as_bytes())?;
    write_file(&files.pictures[0], &picture.png)?;
    write_file(&files.pictures[1], picture.svg.as_bytes())?;
    let mut text = crate::check::words_of_table(&options.table.display().to_string(), &table);
    let _ = writeln!(
        text,
        "  quick fit Frenkel curve with tau_s = {} s up to a/R = {}{}, root mean square of the residuals {}",
        significant(fit.tau_s, 3),
        significant(fit.final_contact_ratio, 3),
        if fit.plateau_rows.is_some() { " (a plateau)" } else { "" },
        significant(fit.rms, 2)
    );
    for line in crate::check::words_of_priors(&priors) {
        let _ = writeln!(text, "  prior     {line}");
    }
    text.push_str(&files.text(phi));
    Ok(Initialised { text, warnings: experiment.warnings() })
}

/// The files that belong to a table.
struct Files {
    /// Name of the table's file.
    table: String,
    /// Name of the run.
    name: String,
    experiment: PathBuf,
    priors: PathBuf,
    /// PNG and SVG.
    pictures: [PathBuf; 2],
}

impl Files {
    fn beside(table: &Path) -> Self {
        let stem = table.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into());
        let plain: String =
            stem.chars().map(|c| if is_plain(c) { c } else { '-' }).take(60).collect();
        let name = match plain.trim_matches(['-', '.']) {
            "" => "my-powder",
            name => name,
        };
        let beside = |end: &str| table.with_file_name(format!("{name}{end}"));
        Self {
            table: table.file_name().map_or_else(String::new, |file| file.to_string_lossy().into()),
            name: name.to_owned(),
            experiment: beside(".toml"),
            priors: beside("-priors.toml"),
            pictures: [beside("-data.png"), beside("-data.svg")],
        }
    }

    fn all(&self) -> [&Path; 4] {
        [&self.experiment, &self.priors, &self.pictures[0], &self.pictures[1]]
    }

    /// All can be written, and none is there unless it may be written over.
    fn check(&self, overwrite: bool) -> Result<(), InputError> {
        let there = self.all().into_iter().filter(|path| !overwrite && path.exists());
        let wrong = there.map(|path| {
            InputError::new(path.display().to_string(), Mistake::Conflict)
                .found("there already, and not written over")
        });
        if let Some(error) = InputError::all(wrong.collect()) {
            return Err(error.help("--overwrite writes over it; or give the table another name"));
        }
        self.all().into_iter().try_for_each(check_file)
    }

    /// What was written, and the next commands; `phi` is the final contact ratio.
    fn text(&self, phi: f64) -> String {
        let [experiment, priors] =
            [&self.experiment, &self.priors].map(|path| shell_word(&path.display().to_string()));
        let written = self.all().map(|path| path.display().to_string()).join(", ");
        format!(
            "wrote {written}\nnext, after a look at these:\n  calibrate check {experiment} {priors}\n  \
             calibrate --experiment {experiment} --prior {priors}\n  \
             calibrate predict --posterior results/{} --contact-ratio {:.2}\n",
            self.name,
            (0.8 * phi).min(0.9)
        )
    }
}

fn experiment_text(
    options: &InitOptions,
    files: &Files,
    powder: Powder,
    table: &ObservationTable,
    fit: &QuickFit,
) -> String {
    let mut text = format!(
        "# Written by `calibrate init` for the table below. All SI. Change what you know better; `calibrate check` reads it again.\n\ntable = {}\n",
        quoted(&files.table)
    );
    let _ = writeln!(text, "name = {}", quoted(&files.name));
    text.push_str(
        "# source = \"who measured, and where it is written down\"\n# temperature_k = 453.15\n",
    );
    if let Some(how) = &table.how {
        let _ = writeln!(
            text,
            "# The table was read with {}.",
            how.replace(|c: char| c.is_control(), " ")
        );
    }
    let (phi, reason) = match (options.final_contact_ratio, fit.plateau_rows) {
        (Some(phi), _) => (phi, "as stated".to_owned()),
        (None, Some(rows)) => {
            (fit.final_contact_ratio, format!("plateau of {rows} rows (quick fit)"))
        }
        (None, None) => {
            (fit.final_contact_ratio, "full coalescence at constant volume, 2^(1/3)".to_owned())
        }
    };
    text.push_str("\n# phi, the a/R where coalescence stops.\n");
    if fit.plateau_rows.is_some() {
        text.push_str("# A pair that was heated by a pulse may have cooled there instead: crates/guide/pages/heat.md.\n");
    }
    let _ = writeln!(
        text,
        "final_contact_ratio = {phi:?}\nfinal_contact_ratio_reason = {}\n",
        quoted(&reason)
    );
    match options.built_in() {
        Some(material) => {
            let _ = writeln!(
                text,
                "# E and gamma of {}: J.E. Alvarez et al., EPJ Web Conf. 249 (2021) 05001, Table 1.",
                material.title()
            );
            let _ = writeln!(text, "material = \"{material}\"\nradius_m = {:?}", powder.radius_m);
        }
        None => {
            let _ = writeln!(
                text,
                "[powder]\nradius_m = {:?}\nyoungs_modulus_pa = {:?}\nsurface_tension_n_per_m = {:?}\ndensity_kg_per_m3 = {:?}",
                powder.radius_m,
                powder.youngs_modulus_pa,
                powder.surface_tension_n_per_m,
                powder.density_kg_per_m3
            );
        }
    }
    let columns = options.columns.toml();
    if !columns.is_empty() {
        let _ = write!(text, "\n# What the header of the table does not say.\n{columns}");
    }
    text
}

fn priors_text(files: &Files, powder: Powder, fit: &QuickFit) -> String {
    let Powder { radius_m, surface_tension_n_per_m, .. } = powder;
    let fluidity = radius_m / (surface_tension_n_per_m * fit.tau_s);
    let mut text = format!(
        "# Priors for {}, written by `calibrate init`. All SI.\n#\n# From a quick fit of the same table: the Frenkel curve with tau_s = {} s. The ranges are so wide that the data decide;\n# what you know better makes them narrower.\n",
        files.experiment.file_name().unwrap_or_default().display(),
        significant(fit.tau_s, 3)
    );
    let ranges = [
        (
            "c1",
            "fluidity C1 [1/(Pa s)]: 1e-4 to 100 times R/(gamma tau_s)",
            fluidity * 1e-4,
            fluidity * 1e2,
        ),
        (
            "tau_s",
            "sintering time [s]: 0.1 to 10 times that of the quick fit",
            fit.tau_s * 0.1,
            fit.tau_s * 10.0,
        ),
        (
            "delta_c",
            "cut-off distance of the adhesive traction [m]: R/3000 to R/10",
            radius_m / 3000.0,
            radius_m / 10.0,
        ),
    ];
    for (name, words, lower, upper) in ranges {
        let _ = write!(
            text,
            "\n[{name}] # {words}\ndistribution = \"log-uniform\"\nlower = {:?}\nupper = {:?}\n",
            one_digit(lower, f64::floor),
            one_digit(upper, f64::ceil)
        );
    }
    let _ = write!(
        text,
        "\n# Optional: calibrate the final contact ratio too, instead of taking it from the experiment.\n# [phi]\n# distribution = \"uniform\"\n# lower = {:.2}\n# upper = {:.2}\n",
        (fit.final_contact_ratio - 0.1).max(0.1),
        fit.final_contact_ratio + 0.1
    );
    text
}

/// A positive number rounded to one digit.
fn one_digit(value: f64, round: fn(f64) -> f64) -> f64 {
    let exponent = value.log10().floor();
    // A digit that is whole already stays so.
    let digit = round((value / 10f64.powf(exponent) * 1e9).round() / 1e9);
    format!("{digit}e{exponent}").parse().unwrap_or(value)
}

/// The data, with the curve of the quick fit.
fn figure(
    name: &str,
    powder: Powder,
    phi: f64,
    table: &ObservationTable,
    fit: &QuickFit,
) -> Result<FitFigure, RunError> {
    const POINTS: usize = 200;
    let last_s = table.span_s()[1];
    let grid: Vec<f64> = (0..=POINTS).map(|k| last_s * k as f64 / POINTS as f64).collect();
    let mut frenkel = vec![0.0; grid.len()];
    let sintering = Sintering { c1: 1.0, tau_s: fit.tau_s, delta_c: 1.0, lambda: 0.0 };
    quick_fit::curve(&quick_fit::scene(powder, phi)?, &sintering, &grid, &mut frenkel)?;
    Ok(FitFigure {
        title: name.to_owned(),
        control: table.time_s.clone(),
        value: table.contact_ratio.clone(),
        grid,
        frenkel,
        ..FitFigure::default()
    })
}

#[cfg(test)]
mod tests;
