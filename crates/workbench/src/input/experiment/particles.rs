//! The particles of an experiment: a built-in material or a powder of the user's own.

use dem_core::{Powder, paper};

use crate::error::{InputError, Mistake};
use crate::input::material::Material;
use crate::input::toml_fields::{At, Fields};

/// Reads the material or the powder.
pub(super) fn particles(fields: &Fields<'_>) -> Result<(Option<Material>, Powder), InputError> {
    let named =
        fields.choice("material", &Material::ALL.map(|m| (m.name(), m))).map_err(|error| {
            match error.mistake {
                Mistake::UnknownName => error.help("or give a table [powder] with your own values"),
                _ => error,
            }
        })?;
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
        (Some(At { value: material, .. }), None) => {
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

/// Explains a field of the top that stands below `[powder]`: in TOML it then belongs to that table.
fn misplaced(error: InputError) -> InputError {
    const TOP: [&str; 13] = [
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
        "columns",
        "heat",
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

/// A quantity, its range among powders, and the units that are given by mistake.
struct Quantity {
    key: &'static str,
    unit: &'static str,
    range: [f64; 2],
    mistaken: &'static [(&'static str, f64)],
}

impl Quantity {
    fn expected(&self) -> String {
        let Self { unit, range: [low, high], .. } = self;
        format!("{low:e} to {high:e} {unit}")
    }

    /// The value in the unit that it was probably given in.
    fn meant(&self, value: f64, write: &str) -> Option<String> {
        let [low, high] = self.range;
        let fits = |(_, scale): &&(&str, f64)| (low..=high).contains(&(value * scale));
        let (wrong, scale) = self.mistaken.iter().find(fits)?;
        Some(format!("is that in {wrong}? {write}{value}e{}", scale.log10().round()))
    }
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

/// A constant of a powder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constant {
    /// Particle radius \[m\]: a nanometre to a centimetre.
    Radius,
    /// Young's modulus \[Pa\]: 1e3 to 1e13.
    YoungsModulus,
    /// Surface tension \[N/m\]: 1e-4 to 10.
    SurfaceTension,
    /// Density \[kg/m3\]: 10 to 1e5.
    Density,
}

impl Constant {
    /// Checks a value in SI.
    ///
    /// # Errors
    ///
    /// The expected range, and what was probably meant.
    pub fn checked(self, value: f64) -> Result<f64, (String, Option<String>)> {
        let quantity = match self {
            Self::Radius => radius_quantity("radius_m"),
            Self::YoungsModulus => YOUNGS_MODULUS,
            Self::SurfaceTension => SURFACE_TENSION,
            Self::Density => DENSITY,
        };
        if (quantity.range[0]..=quantity.range[1]).contains(&value) {
            Ok(value)
        } else {
            Err((quantity.expected(), quantity.meant(value, "write ")))
        }
    }
}

/// Particle radii: a nanometre to a centimetre.
const fn radius_quantity(key: &'static str) -> Quantity {
    Quantity { key, unit: "m", range: [1e-9, 1e-2], mistaken: &[("um", 1e-6), ("mm", 1e-3)] }
}

pub(super) fn radius(fields: &Fields<'_>, key: &'static str) -> Result<Option<f64>, InputError> {
    scaled(fields, radius_quantity(key))
}

fn scaled(fields: &Fields<'_>, quantity: Quantity) -> Result<Option<f64>, InputError> {
    let Quantity { key, unit, range: [low, high], .. } = quantity;
    let Some(At { value, line }) = fields.positive(key, unit)? else { return Ok(None) };
    if (low..=high).contains(&value) {
        return Ok(Some(value));
    }
    Err(fields
        .error(key, line, Mistake::OutOfRange)
        .found(value)
        .expected(quantity.expected())
        .help_if(quantity.meant(value, &format!("write {key} = "))))
}
