//! The closing summary of a run: what was found, how good the fit is, whether to trust it, where the files are.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;
use smc_calib::Evidence;

use crate::number::{self, shown_unit, significant, with_error};
use crate::pictures::KHAT_LIMIT;
use crate::posterior_file::PosteriorFile;

/// Information \[bits\] below which the data are said not to inform a parameter.
pub const INFORMED_BITS: f64 = 0.5;

/// What the sampler's own diagnostics say of a result.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diagnosis<'a> {
    pub(crate) is_posterior: bool,
    pub(crate) simulations: usize,
    /// Effective samples, by importance weights.
    pub(crate) ess: f64,
    pub(crate) khat: f64,
    pub(crate) evidence: &'a Evidence,
}

impl Diagnosis<'_> {
    /// Effective samples that a 95 % interval is read from without a warning: 400, or with a small budget a third of it.
    fn asked_for(&self) -> f64 {
        (self.simulations as f64 / 3.0).clamp(FEWEST, 400.0)
    }

    /// Nothing speaks against the result but perhaps its roughness.
    fn sound(&self) -> bool {
        self.is_posterior && self.khat < KHAT_LIMIT && self.evidence.agree && self.ess >= FEWEST
    }

    /// Whether the result is what it says, to the accuracy that users expect.
    pub(crate) fn trusted(&self) -> bool {
        self.sound() && self.ess >= self.asked_for()
    }

    /// The log evidence, with a standard error only where the sampling has earned one.
    pub(crate) fn evidence(&self) -> String {
        let Evidence { value, se, .. } = *self.evidence;
        if !self.is_posterior {
            "no evidence".to_owned()
        } else if self.sound() {
            format!("log evidence {} +- {}", with_error(value, se, 3), significant(se, 2))
        } else {
            format!("log evidence {value:.1} or more, its error unknown")
        }
    }

    /// One line: the verdict, and what it was read from.
    pub(crate) fn line(&self) -> String {
        let verdict = match (self.trusted(), self.sound()) {
            (true, _) => "converged",
            (false, true) => "rough",
            (false, false) => "NOT TO BE TRUSTED",
        };
        let wished = if self.ess < self.asked_for() {
            format!(" of at least {:.0} wished for", self.asked_for())
        } else {
            String::new()
        };
        format!(
            "{verdict}; {:.0} effective samples{wished}, k-hat {:.2} (limit {KHAT_LIMIT}), {}",
            self.ess,
            self.khat,
            self.evidence()
        )
    }
}

/// Effective samples below which a posterior is not even rough.
const FEWEST: f64 = 40.0;

pub(crate) fn diagnosis(file: &PosteriorFile) -> Diagnosis<'_> {
    Diagnosis {
        is_posterior: file.is_posterior,
        simulations: file.counters.simulations,
        ess: file.ess.importance,
        khat: file.khat,
        evidence: &file.log_evidence,
    }
}

/// Whether the sampler's own diagnostics let the result be trusted.
#[must_use]
pub fn trusted(file: &PosteriorFile) -> bool {
    diagnosis(file).trusted()
}

/// The summary as text, about ten lines. `seconds` is how long the inference took, where it has just run.
#[must_use]
pub fn text(file: &PosteriorFile, seconds: Option<f64>, out: Option<&Path>) -> String {
    let plan = &file.plan;
    let mut text = String::new();
    let took = seconds.map_or_else(String::new, |s| format!(" in {} s", significant(s, 2)));
    let _ = writeln!(
        text,
        "{}: {} kinetics, {} observations, {} simulations ({}){took}",
        plan.title,
        plan.kinetics,
        plan.experiment.time_s.len(),
        file.counters.simulations,
        plan.solver.name,
    );
    if !file.is_posterior {
        let _ = writeln!(text, "  NOT A POSTERIOR: noise tuned to a wished-for sample size");
    }
    for (place, summary) in file.parameters.iter().enumerate() {
        let si = &summary.in_si;
        let mut line = format!(
            "  {:<8} {:>9} {:<9} 95 % {} .. {}",
            summary.parameter.name,
            significant(si.median, 3),
            shown_unit(&summary.parameter.unit),
            significant(si.eti95.lower, 3),
            significant(si.eti95.upper, 3),
        );
        if let Some(paper) = &file.paper
            && let Some(Some(percentile)) = paper.percentile_si.get(place)
            && let Some(at) =
                ["c1", "tau_s", "delta_c"].iter().position(|name| *name == summary.parameter.name)
        {
            let _ = write!(
                line,
                "; paper {} ({})",
                significant(paper.si[at], 3),
                number::percentile(*percentile)
            );
        }
        if summary.information_gain_bits < INFORMED_BITS {
            let _ = write!(line, "; NOT INFORMED ({:.2} bits)", summary.information_gain_bits);
        }
        let _ = writeln!(text, "{line}");
    }
    if let Some(product) = &file.product {
        let _ = writeln!(
            text,
            "  {} {} {}  95 % {} .. {} ({:.1} bits): all that these kinetics see of the two",
            product.name,
            significant(product.median, 3),
            product.unit,
            significant(product.eti95[0], 3),
            significant(product.eti95[1], 3),
            product.information_gain_bits,
        );
    }
    if !file.printed.is_empty() {
        let medians: Vec<String> = file
            .printed
            .iter()
            .map(|printed| match printed.paper {
                Some(paper) => format!(
                    "{} {} (paper {})",
                    printed.name,
                    significant(printed.median, 3),
                    significant(paper, 3)
                ),
                None => format!("{} {}", printed.name, significant(printed.median, 3)),
            })
            .collect();
        let _ = writeln!(text, "  as printed in Table 3: {}", medians.join(", "));
    }
    let fit = &file.fit;
    let paper = fit
        .paper
        .map_or_else(String::new, |error| format!(", paper {}", significant(error.rmse, 2)));
    let frenkel = fit
        .frenkel
        .map_or_else(String::new, |error| format!(", best Frenkel {}", significant(error.rmse, 2)));
    let noise = file.sigma.map_or_else(String::new, |sigma| {
        format!("; noise sigma {}", significant(sigma.median, 2))
    });
    let _ = writeln!(
        text,
        "  fit: RMSE of a/R {} (MAP){paper}{frenkel}{noise}",
        significant(fit.map.rmse, 2),
    );
    if let Some(knee) = &file.knee {
        let _ = writeln!(
            text,
            "  knee: a/R {} at {} s (95 % {} .. {} s){}",
            significant(knee.contact_ratio.median, 3),
            significant(knee.time_s.median, 3),
            significant(knee.time_s.eti95[0], 3),
            significant(knee.time_s.eti95[1], 3),
            if knee.probability < 0.995 {
                format!(", with probability {:.2}", knee.probability)
            } else {
                String::new()
            },
        );
    }
    let _ = writeln!(text, "  sampling: {}", diagnosis(file).line());
    for line in &file.advice {
        let _ = writeln!(text, "  careful: {line}");
    }
    if let Some(out) = out {
        let _ = writeln!(
            text,
            "  files: {}/ (posterior.json, table.md, samples.csv, draws.csv, fit.png, corner.png, ...)",
            out.display()
        );
    }
    text
}

/// The summary as JSON: the same facts for a program to read.
#[derive(Debug, Serialize)]
struct Short<'a> {
    name: &'a str,
    kinetics: &'a str,
    is_posterior: bool,
    trusted: bool,
    parameters: &'a [smc_calib::ParameterSummary],
    printed: &'a [crate::posterior_file::PrintedParameter],
    paper: &'a Option<crate::posterior_file::PaperComparison>,
    sigma: &'a Option<smc_calib::SigmaSummary>,
    fit: &'a crate::posterior_file::Fit,
    knee: &'a Option<crate::posterior_file::KneeSummary>,
    log_evidence: &'a smc_calib::Evidence,
    ess: &'a smc_calib::EffectiveSampleSize,
    khat: f64,
    advice: &'a [String],
    out: Option<String>,
}

/// The summary as JSON.
///
/// # Errors
///
/// None in practice: the summary is plain data.
pub fn json(file: &PosteriorFile, out: Option<&Path>) -> Result<String, serde_json::Error> {
    let PosteriorFile { parameters, printed, paper, sigma, fit, knee, log_evidence, ess, .. } =
        file;
    serde_json::to_string_pretty(&Short {
        name: &file.plan.name,
        kinetics: &file.plan.kinetics,
        is_posterior: file.is_posterior,
        trusted: trusted(file),
        parameters,
        printed,
        paper,
        sigma,
        fit,
        knee,
        log_evidence,
        ess,
        khat: file.khat,
        advice: &file.advice,
        out: out.map(|path| path.display().to_string()),
    })
}
