//! `calibrate init`: the experiment and prior files for a table.

use std::io::{BufRead, IsTerminal as _, Write};
use std::path::PathBuf;

use workbench::error::Failure;
use workbench::init::{InitOptions, Open, init};
use workbench::input::experiment::Constant;
use workbench::input::material::Material;

use crate::arguments;
use crate::columns::ColumnArgs;
use crate::terminal;

const EXAMPLES: &str = "\
Constants of built-in materials: ps, pa12 and peek, E and gamma of Table 1 of Alvarez et al., EPJ Web Conf. 249 \
(2021). For any other powder, state your own with their source; on a terminal, what is missing is asked for.

Examples:
  calibrate init my.csv --material pa12 --radius-m 29e-6
  calibrate init my.csv --radius-m 21e-6 --youngs-modulus-pa 1.8e9 \\
      --surface-tension-n-per-m 0.038
  calibrate init my.csv --value-column w --value-unit um \\
      --quantity neck-diameter";

/// A table and what is known of its powder.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct InitArgs {
    /// Table of measurements, as a spreadsheet or an instrument exports it
    #[arg(value_name = "TABLE")]
    table: PathBuf,

    /// Built-in material, for its Young's modulus, surface tension and density
    #[arg(short, long, value_name = "NAME", value_parser = arguments::material())]
    material: Option<Material>,

    /// Particle radius R in metres, from 1e-9 to 1e-2
    #[arg(short, long, value_name = "M", value_parser = arguments::radius, allow_negative_numbers = true)]
    radius_m: Option<f64>,

    /// Young's modulus E in Pa, from 1e3 to 1e13 [default: the material's]
    #[arg(long, value_name = "PA", value_parser = arguments::youngs_modulus, allow_negative_numbers = true)]
    youngs_modulus_pa: Option<f64>,

    /// Surface tension gamma in N/m, from 1e-4 to 10 [default: the material's]
    #[arg(long, value_name = "N/M", value_parser = arguments::surface_tension, allow_negative_numbers = true)]
    surface_tension_n_per_m: Option<f64>,

    /// Density rho in kg/m3, from 10 to 1e5 [default: the material's, or 1000]
    #[arg(long, value_name = "KG/M3", value_parser = arguments::solid_density, allow_negative_numbers = true)]
    density_kg_per_m3: Option<f64>,

    /// Final contact ratio phi, from 0.1 to 2 [default: a plateau of the table, or full coalescence, 2^(1/3)]
    #[arg(long, value_name = "A/R", value_parser = arguments::final_contact_ratio, allow_negative_numbers = true)]
    phi: Option<f64>,

    /// Write over files that are there
    #[arg(long)]
    overwrite: bool,

    /// Columns of the table.
    #[command(flatten)]
    columns: ColumnArgs,
}

/// Runs the command.
pub(crate) fn run(args: &InitArgs) -> Result<(), Failure> {
    let mut options = InitOptions {
        table: args.table.clone(),
        columns: args.columns.columns(),
        material: args.material,
        radius_m: args.radius_m,
        youngs_modulus_pa: args.youngs_modulus_pa,
        surface_tension_n_per_m: args.surface_tension_n_per_m,
        density_kg_per_m3: args.density_kg_per_m3,
        final_contact_ratio: args.phi,
        overwrite: args.overwrite,
    };
    if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        ask(&mut options, &mut std::io::stdin().lock(), &mut std::io::stderr())?;
    }
    let done = init(&options)?;
    for warning in &done.warnings {
        terminal::warning(warning);
    }
    terminal::write(done.text.as_bytes())
}

/// Asks for what is open, until it is said; at the end of the input the rest stays open.
fn ask(
    options: &mut InitOptions,
    input: &mut impl BufRead,
    output: &mut impl Write,
) -> Result<(), Failure> {
    if options.open().len() > usize::from(options.radius_m.is_none()) {
        writeln!(output, "Materials with constants (Alvarez et al. 2021, Table 1):")?;
        for material in Material::ALL {
            let powder = material.powder();
            writeln!(
                output,
                "  {:<5} {}: E = {} GPa, gamma = {} mN/m",
                material.name(),
                material.title(),
                powder.youngs_modulus_pa * 1e-9,
                powder.surface_tension_n_per_m * 1e3
            )?;
        }
        writeln!(output, "  own   any other: state E and gamma")?;
        let named = |text: &str| match (text, Material::from_name(text)) {
            ("own" | "", _) => Ok(None),
            (_, Some(material)) => Ok(Some(material)),
            _ => Err("expected ps, pa12, peek or own".to_owned()),
        };
        options.material = answer("Material [own]: ", named, input, output)?.flatten();
    }
    for open in options.open() {
        let (question, constant, unit): (&str, Constant, f64) = match open {
            Open::Radius => ("Particle radius R [um]: ", Constant::Radius, 1e-6),
            Open::YoungsModulus => ("Young's modulus E [GPa]: ", Constant::YoungsModulus, 1e9),
            Open::SurfaceTension => {
                ("Surface tension gamma [mN/m]: ", Constant::SurfaceTension, 1e-3)
            }
        };
        let number = |text: &str| {
            let value: f64 =
                text.replace(',', ".").parse().map_err(|_| "expected a number".to_owned())?;
            // Divided, 30 um are 3e-5 m to the last digit.
            let si = if unit < 1.0 { value / (1.0 / unit).round() } else { value * unit };
            constant
                .checked(si)
                .map_err(|(expected, _)| format!("that is {si:e}; expected {expected}"))
        };
        let said = answer(question, number, input, output)?;
        match open {
            Open::Radius => options.radius_m = said,
            Open::YoungsModulus => options.youngs_modulus_pa = said,
            Open::SurfaceTension => options.surface_tension_n_per_m = said,
        }
    }
    Ok(())
}

/// The answer to a question; none at the end of the input.
fn answer<T>(
    question: &str,
    parse: impl Fn(&str) -> Result<T, String>,
    input: &mut impl BufRead,
    output: &mut impl Write,
) -> Result<Option<T>, Failure> {
    loop {
        write!(output, "{question}")?;
        output.flush()?;
        let mut line = String::new();
        if input.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        match parse(line.trim()) {
            Ok(value) => return Ok(Some(value)),
            Err(expected) => writeln!(output, "  {expected}")?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(answers: &str, options: InitOptions) -> (InitOptions, String) {
        let (mut options, mut output) = (options, Vec::new());
        ask(&mut options, &mut answers.as_bytes(), &mut output).expect("answers");
        (options, String::from_utf8(output).expect("UTF-8"))
    }

    #[test]
    fn what_is_open_is_asked_for_until_it_is_said() {
        let (own, said) = asked("pom\nown\n30e3\n30,5\n0\n2,6\n44\n", InitOptions::default());
        assert_eq!(own.material, None);
        assert_eq!(own.radius_m, Some(30.5e-6));
        assert_eq!(own.youngs_modulus_pa, Some(2.6e9));
        assert_eq!(own.surface_tension_n_per_m, Some(44e-3));
        for words in [
            "expected ps, pa12, peek or own",
            "that is 3e-2; expected 1e-9",
            "PEEK 450PF: E = 2 GPa",
        ] {
            assert!(said.contains(words), "{words}: {said}");
        }
        let (paper, _) = asked("pa12\n21\n", InitOptions::default());
        assert_eq!((paper.material, paper.radius_m), (Some(Material::Pa12), Some(21e-6)));
        assert!(paper.open().is_empty());
        let known = InitOptions {
            material: Some(Material::Ps),
            radius_m: Some(2e-5),
            ..InitOptions::default()
        };
        assert_eq!(asked("", known.clone()), (known, String::new()));
        let (unanswered, _) = asked("own\n20\n", InitOptions::default());
        assert_eq!(unanswered.open(), [Open::YoungsModulus, Open::SurfaceTension]);
    }
}
