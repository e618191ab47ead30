//! Options that say what the columns of a table are.

use workbench::input::columns::{Columns, DecimalMark, Dimension, Quantity, Unit};

use crate::arguments;

/// What the header of a table does not say.
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
#[command(next_help_heading = "Columns of a table, where its header does not say it")]
pub(crate) struct ColumnArgs {
    /// The column of times
    #[arg(long, value_name = "NAME")]
    time_column: Option<String>,

    /// The column of necks
    #[arg(long, value_name = "NAME")]
    value_column: Option<String>,

    /// The column of standard deviations of the necks
    #[arg(long, value_name = "NAME")]
    sigma_column: Option<String>,

    /// Unit of the times: s, ms, us, min or h
    #[arg(long, value_name = "UNIT", value_parser = time_unit)]
    time_unit: Option<Unit>,

    /// Unit of the necks: m, cm, mm, um or nm of a length, 1 or % of a ratio
    #[arg(long, value_name = "UNIT", value_parser = value_unit)]
    value_unit: Option<Unit>,

    /// What was measured: a/R, the neck radius a, its diameter 2a, or a/(2R). Lengths are divided by the particle radius
    #[arg(long, value_name = "NAME", value_parser = arguments::named(Quantity::NAMES))]
    quantity: Option<Quantity>,

    /// The decimal mark, for a table in which 1,234 could be two numbers
    #[arg(long, value_name = "MARK", value_parser = arguments::named(DecimalMark::NAMES))]
    decimal: Option<DecimalMark>,
}

impl ColumnArgs {
    /// Names of the options, for those that exclude them.
    pub(crate) const NAMES: [&'static str; 7] = [
        "time_column",
        "value_column",
        "sigma_column",
        "time_unit",
        "value_unit",
        "quantity",
        "decimal",
    ];

    /// What was said.
    pub(crate) fn columns(&self) -> Columns {
        Columns {
            time: self.time_column.clone(),
            value: self.value_column.clone(),
            sigma: self.sigma_column.clone(),
            time_unit: self.time_unit,
            value_unit: self.value_unit,
            quantity: self.quantity,
            decimal: self.decimal,
        }
    }
}

fn time_unit(text: &str) -> Result<Unit, String> {
    Unit::parse_of(text, &[Dimension::Time]).map_err(|expected| format!("expected {expected}"))
}

fn value_unit(text: &str) -> Result<Unit, String> {
    Unit::parse_of(text, &[Dimension::Length, Dimension::Ratio])
        .map_err(|expected| format!("expected {expected}"))
}
