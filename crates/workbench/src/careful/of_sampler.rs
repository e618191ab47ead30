//! Concerns of the sampler as lines, each with the option that helps.

use serde::Serialize;
use smc_calib::Concern;

/// The simulations of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Simulations {
    /// Simulations that it asks for.
    pub(crate) number: usize,
    /// Whether each is a run of a program.
    pub(crate) of_programs: bool,
    /// Whether each is a call of a function, which no file and no option asks for.
    pub(crate) of_function: bool,
    /// Whether a plan file asks for them, not options.
    pub(crate) of_file: bool,
    /// Whether more of them can be made for the same run.
    pub(crate) extendable: bool,
}

/// A concern of the sampler as a line, with the option that helps where there is one.
pub(crate) fn concern(concern: &Concern, asked: Simulations) -> String {
    let option = match option(concern, asked) {
        Some(option) => format!(": {option}"),
        None => String::new(),
    };
    format!("{concern}{option}{}", section(concern))
}

/// The option of the command, or the field of a file, that does what the remedy of a concern says.
fn option(concern: &Concern, asked: Simulations) -> Option<String> {
    let field =
        |option: &str, field: &str| Some(if asked.of_file { field } else { option }.to_owned());
    if asked.of_function {
        return argument(concern, asked);
    }
    match concern {
        few if few.wants_simulations() => {
            let more = more_than(asked);
            let extend = if asked.of_programs { "--resume" } else { "--continue-from" };
            if asked.extendable {
                return Some(format!("calibrate {extend} DIR --samples {more}"));
            }
            field(&format!("--samples {more}"), &format!("samples = {more} in [sampler]"))
        }
        alike if alike.is_alike() => {
            let in_plan = "noise = { kind = \"correlated\", s0 = ABOUT }";
            field(&format!("--noise correlated, in a plan {in_plan}"), in_plan)
        }
        Concern::NotAPosterior => {
            field("--noise inferred", "noise = { kind = \"inferred\" } of the observable")
        }
        Concern::AtPriorBound { parameter, bound, .. } => {
            Some(format!("a bound beyond {bound:.3e} in [{parameter}] of the priors"))
        }
        Concern::NotInformed { parameter, .. } | Concern::OrderOfMagnitude { parameter, .. } => {
            Some(format!("[{parameter}] of the priors"))
        }
        _ => None,
    }
}

/// The argument of a program that calibrates its own function that does what the remedy of a concern says.
fn argument(concern: &Concern, asked: Simulations) -> Option<String> {
    match concern {
        few if few.wants_simulations() => Some(format!("samples={}", 2 * asked.number)),
        alike if alike.is_alike() => Some("noise=Correlated(s0=ABOUT)".to_owned()),
        Concern::NotAPosterior => Some("noise=Inferred(s0=ABOUT)".to_owned()),
        Concern::AtPriorBound { parameter, bound, .. } => {
            Some(format!("a bound beyond {bound:.3e} in the prior of {parameter}"))
        }
        Concern::NotInformed { parameter, .. } | Concern::OrderOfMagnitude { parameter, .. } => {
            Some(format!("the prior of {parameter}"))
        }
        _ => None,
    }
}

/// The number of simulations to try next: at least twice as many, and the default where that is less for pairs, of which
/// a thousand take less than a second.
fn more_than(asked: Simulations) -> usize {
    let twice = 2 * asked.number;
    if asked.of_programs { twice } else { twice.next_power_of_two().max(16_384) }
}

/// The section of the page on reasons to be careful, by the kind that the reason is stored under.
pub(crate) fn section(reason: &impl Serialize) -> String {
    let stored = serde_json::to_value(reason).ok();
    let kind = stored.as_ref().and_then(|reason| reason.get("kind")?.as_str());
    kind.map_or_else(String::new, |kind| format!(" (see careful.md, \"{kind}\")"))
}
