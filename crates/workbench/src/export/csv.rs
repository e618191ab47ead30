//! Tables of draws: as CmdStan writes them, and as R's package posterior reads them.

use std::fmt::Write as _;

use super::groups::{Group, Groups, Variable, free_name};

/// A column: its name, the variable that it is of, and the places of its values.
struct Column<'a> {
    name: String,
    of: &'a Variable,
    places: Vec<usize>,
}

impl Column<'_> {
    fn text(&self, row: usize) -> String {
        self.of.values.text(self.places[row])
    }
}

/// Draws in the form of CmdStan: what cmdstanpy and rstan's `read_stan_csv` read. Names have letters, digits and `_` alone;
/// places in an array follow a point.
pub(super) fn stan(groups: &Groups) -> String {
    let columns = columns(groups, |place| format!(".{place}"));
    let attribute = |name: &str| groups.attributes.get(name);
    let name = attribute("name").and_then(|name| name.as_str()).unwrap_or("run");
    let seed = attribute("seed").map_or_else(String::new, ToString::to_string);
    let rows = rows(groups);
    let mut text = format!(
        "# stan_version_major = 2\n# stan_version_minor = 33\n# stan_version_patch = 0\n# model = {name}\n\
         # method = sample\n#   sample\n#     num_samples = {rows}\n#     num_warmup = 1\n#     save_warmup = 0\n\
         #     thin = 1\n#     algorithm = fixed_param\n# id = 1\n# random\n#   seed = {seed}\n"
    );
    let notes = ["inference_library_version", "draws", "importance_ess", "pareto_khat"]
        .into_iter()
        .chain(["log_evidence", "log_evidence_se", "trust"]);
    for (note, value) in notes.filter_map(|note| Some((note, attribute(note)?))) {
        // The sign of a setting would make it one.
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let _ = writeln!(text, "# {note}: {}", value.replace(['=', '\n'], " "));
    }
    let lp = groups.group("sample_stats").and_then(|group| group.variable("lp"));
    text.push_str("lp__,accept_stat__");
    columns.iter().for_each(|column| {
        let _ = write!(text, ",{}", column.name);
    });
    text.push('\n');
    for row in 0..rows {
        // Unknown where the simulated values are.
        text.push_str(&lp.map_or_else(|| "nan".to_owned(), |lp| lp.values.text(row)));
        text.push_str(",1");
        push_row(&mut text, &columns, row);
    }
    text.push_str(
        "# \n#  Elapsed Time: 0 seconds (Warm-up)\n#                0 seconds (Sampling)\n",
    );
    text.push_str("#                0 seconds (Total)\n# \n");
    text
}

/// Draws with the columns `.chain`, `.iteration` and `.draw`: what `as_draws_df` of R's package posterior takes.
pub(super) fn draws(groups: &Groups) -> String {
    let columns = columns(groups, |place| format!("[{place}]"));
    let lp = groups.group("sample_stats").and_then(|group| group.variable("lp"));
    let mut text = String::from(".chain,.iteration,.draw");
    columns.iter().for_each(|column| {
        let _ = write!(text, ",{}", column.name);
    });
    text.push_str(if lp.is_some() { ",lp__\n" } else { "\n" });
    for row in 0..rows(groups) {
        let _ = write!(text, "1,{},{}", row + 1, row + 1);
        push_row(&mut text, &columns, row);
        if let Some(lp) = lp {
            text.pop();
            let _ = writeln!(text, ",{}", lp.values.text(row));
        }
    }
    text
}

fn push_row(text: &mut String, columns: &[Column<'_>], row: usize) {
    for column in columns {
        text.push(',');
        text.push_str(&column.text(row));
    }
    text.push('\n');
}

/// Number of draws.
fn rows(groups: &Groups) -> usize {
    groups.group("posterior").and_then(Group::draws).unwrap_or(0)
}

/// Parameters and noise, then `log_lik` and `y_rep` of all observations, numbered on through the observables.
fn columns(groups: &Groups, index: impl Fn(usize) -> String) -> Vec<Column<'_>> {
    let mut taken = ["lp__", "accept_stat__", "log_lik", "y_rep"].map(str::to_owned).to_vec();
    let mut columns = Vec::new();
    for of in groups.group("posterior").into_iter().flat_map(|group| &group.variables) {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
        let name = free_name(&of.name.chars().map(plain).collect::<String>(), &mut taken);
        columns.push(Column { name, of, places: (0..of.values.len()).collect() });
    }
    for (group, name) in [("log_likelihood", "log_lik"), ("posterior_predictive", "y_rep")] {
        let all = groups.group(group).into_iter().flat_map(Group::by_observation);
        columns.extend(all.enumerate().map(|(place, (of, places))| {
            let name = format!("{name}{}", index(place + 1));
            Column { name, of, places }
        }));
    }
    columns
}
