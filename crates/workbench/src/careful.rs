//! Reasons to be careful, each as one line: what is wrong and by how much, what it means, what helps, and its section of
//! the page `crates/guide/pages/careful.md`.
//!
//! Those that the sampler sees are [`smc_calib::Concern`]s, those of a second calibration [`Doubt`](crate::record::Doubt)s; all others
//! are [`Careful`]. A new one of either is a variant
//! with its words and a section of the page under its kind; the tests below hold the two against each other.

use std::fmt;

use serde::Serialize;
use smc_calib::trust::limits::khat_in_words;

mod of_joint;
mod of_population;
mod of_sampler;
mod words;

pub(crate) use of_joint::{OfJoint, as_far_in_words, counted, noise_too_large};
pub(crate) use of_population::OfPopulation;
pub(crate) use of_sampler::{Simulations, concern, section};

use crate::number::significant;
use words::{
    dependent, few_reach, necks_meet, outside_energies, outside_model, outside_priors,
    prior_decides, soft_settling,
};

/// A reason to be careful that the sampler does not see: in the input, in what a result is used for, in a comparison.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum Careful {
    /// Measurements beyond the contact ratio at which the model stops.
    AboveFinalContactRatio { table: String, largest: f64, final_contact_ratio: f64 },
    /// A radius in the model far from that of the particles that were measured.
    OtherRadius { experiment: String, model_m: f64, measured_m: f64 },
    /// Kinetics whose data inform c1 * delta_c^2 and neither of the two.
    ProductOnly { kinetics: String },
    /// Most rows below the contact ratio that growth starts from.
    BelowAdhesiveContact {
        table: String,
        below: usize,
        rows: usize,
        start: f64,
        radius_m: f64,
        /// The largest contact ratio if the values are neck radii in metres, where that makes sense.
        in_metres: Option<f64>,
    },
    /// A prior of the cut-off distance that reaches above the particle radius.
    DeltaCAboveRadius {
        priors: String,
        prior: String,
        how: String,
        radius_m: f64,
        experiment: String,
    },
    /// A prior of the sintering time far from the times of the table.
    TauSFarFromTimes { priors: String, prior: String, table: String, best_s: f64 },
    /// A column of standard deviations beside a noise model that does not read it.
    UnusedSigma { observable: String, table: String, noise: String },
    /// Parameter sets that the sampler did not draw.
    GivenParameterSets,
    /// An earlier result as the first proposal that is not to be trusted itself.
    UntrustedProposal { from: String },
    /// An earlier result as the first proposal most of which the priors exclude.
    ProposalOutsidePriors { from: String, share: f64 },
    /// Draws of a result whose noise was tuned.
    TunedDraws,
    /// A contact ratio that few samples reach, whose time is theirs alone.
    FewReach { contact_ratio: f64, reach: usize, samples: usize, draws: usize },
    /// A contact ratio that is reached after an infinite time.
    NeverReached { kinetics: String },
    /// A heated phase in which inertia has a part.
    InertiaFelt { inertial_number: f64, limit: f64 },
    /// A bed in which the necks of a particle meet.
    NecksMeet { time_s: f64, contact_ratio: f64, limit: f64, then: String },
    /// A phase whose contacts are so soft that the stiffness decides how the bed settles.
    SoftSettling { phase: String, k1_n_per_m: f64, load: f64, limit: f64, needed_n_per_m: f64 },
    /// A bed that no balance follows to the stiffness of its heat.
    KeepsOverlaps { phase: String, k1_n_per_m: f64 },
    /// A bed of another powder than that of the posterior.
    OtherPowder { what: String, unit: String, scene: f64, calibrated: f64 },
    /// A bed whose contacts stop at another contact ratio than those of the posterior.
    OtherFinalContactRatio { scene: f64, calibrated: f64 },
    /// Draws whose beds could not be computed.
    FailedBeds { failed: usize, draws: usize },
    /// Draws that reach the target after their pairs have ended.
    TargetOutsideModel { outside: usize, draws: usize, limit: f64 },
    /// Too few draws for an interval.
    FewDraws { draws: usize },
    /// A regression that explains too little of the spread of the times.
    SpreadUnexplained { share: f64 },
    /// Too few times to divide their spread.
    SpreadUnknown,
    /// Kinetics in a comparison whose posterior is not to be trusted.
    UntrustedKinetics { kinetics: String, noise: String, ess: f64, khat: f64 },
    /// Evidences that differ by no more than their Monte Carlo error.
    EvidencesTooClose { best: String, other: String, noise: String, difference: f64, error: f64 },
    /// Evidences that differ by less than another prior would change them.
    PriorDecides {
        best: String,
        other: String,
        noise: String,
        parameters: usize,
        reach: f64,
        difference: f64,
    },
    /// A comparison of kinetics whose residuals are alike.
    DependentComparison { kinetics: String, noise: String, lag1: f64, correlated: bool },
    /// A final contact ratio that comes from the data that are fitted.
    FinalContactRatioReadOff {
        value: f64,
        /// The one explanation that rests on it; all kinetics alike where there is none.
        of: Option<String>,
    },
    /// Explanations whose priors of one parameter are not the same.
    PriorsDiffer {
        parameter: String,
        one: String,
        prior: String,
        other: String,
        other_prior: String,
    },
    /// A most probable explanation whose best curve misses measurements that another one meets.
    BestCurveMisses { best: String, observable: String, rmse: f64, other: String, other_rmse: f64 },
    /// A prior of a heat's parameter that the experiment's heat, or an experiment without one, has no use for.
    UnusedPrior { priors: String, parameter: String, experiment: String, heat: bool },
    /// A pulse energy that lies outside of the calibrated ones.
    OutsideEnergies { energy: f64, lowest: f64, highest: f64 },
}

impl Careful {
    /// The problem, its size and what it means.
    fn what(&self) -> String {
        let short = |value: &f64| significant(*value, 3);
        match self {
            Self::AboveFinalContactRatio { table, largest, final_contact_ratio } => format!(
                "{table}: a/R reaches {largest}, but the model stops at final_contact_ratio = {final_contact_ratio}: later rows cannot be fitted"
            ),
            Self::OtherRadius { experiment, model_m, measured_m } => format!(
                "{experiment}: the model uses R = {model_m} m, the pair measured {measured_m} m: tau_s and delta_c are those of the model's R"
            ),
            Self::ProductOnly { kinetics } => format!(
                "under the {kinetics} kinetics c1 and delta_c enter only as c1 * delta_c^2: the data inform the product, and the prior alone divides it between the two"
            ),
            Self::BelowAdhesiveContact { table, below, rows, start, radius_m, in_metres } => format!(
                "{table}: contact_ratio: {below} of {rows} rows lie below {}, the adhesive contact a0/R that growth starts from with R = {radius_m} m{}",
                short(start),
                in_metres.map_or_else(String::new, |ratio| format!(
                    ": necks in metres? the largest is then a/R = {}",
                    significant(ratio, 3)
                ))
            ),
            Self::DeltaCAboveRadius { priors, prior, how, radius_m, experiment } => format!(
                "{priors}: [delta_c]: the prior, {prior}, {how} the particle radius R = {radius_m} m of {experiment}: delta_c is the reach of adhesion in metres, far below R"
            ),
            Self::TauSFarFromTimes { priors, prior, table, best_s } => format!(
                "{priors}: [tau_s]: the prior, {prior} s, is far from the times of {table}, whose best Frenkel curve has tau_s = {} s",
                significant(*best_s, 2)
            ),
            Self::UnusedSigma { observable, table, noise } => format!(
                "the standard deviations of {observable} in {table} are not used: its noise is {noise}"
            ),
            Self::GivenParameterSets => "the parameter sets were given: they are weighted as draws from the prior, which is right only if they are that".to_owned(),
            Self::UntrustedProposal { from } => format!(
                "{from}, which the first runs are placed by, is a result that is not to be trusted itself: they may be in the wrong place, and this result needs more of them; it stays that of its own model and prior"
            ),
            Self::ProposalOutsidePriors { from, share } => outside_priors(from, *share),
            Self::TunedDraws => "the draws are not of a posterior: the noise was tuned, and intervals from them mean nothing".to_owned(),
            Self::NeverReached { kinetics } => format!(
                "under the {kinetics} kinetics a/R approaches 2^(1/3) for ever: times to it have no meaning"
            ),
            Self::FewReach { contact_ratio, reach, samples, draws } => {
                few_reach(*contact_ratio, *reach, *samples, *draws)
            }
            Self::NecksMeet { time_s, contact_ratio, limit, then } => {
                necks_meet(*time_s, *contact_ratio, *limit, then)
            }
            Self::InertiaFelt { .. }
            | Self::SoftSettling { .. }
            | Self::KeepsOverlaps { .. }
            | Self::OtherPowder { .. }
            | Self::OtherFinalContactRatio { .. }
            | Self::FailedBeds { .. } => self.of_a_bed(),
            Self::TargetOutsideModel { outside, draws, limit } => {
                outside_model(*outside, *draws, *limit)
            }
            Self::FewDraws { draws } => format!(
                "{draws} draws are few for a 90 % interval: its ends are the extreme draws"
            ),
            Self::SpreadUnexplained { share } => format!(
                "only {:.0} % of the spread is explained for draws left out: the shares of the parameters are indicative",
                100.0 * share
            ),
            Self::SpreadUnknown => "too few draws reach the target, or at one time, to say which parameter the spread comes from".to_owned(),
            Self::UntrustedKinetics { .. }
            | Self::EvidencesTooClose { .. }
            | Self::PriorDecides { .. }
            | Self::DependentComparison { .. }
            | Self::FinalContactRatioReadOff { .. }
            | Self::PriorsDiffer { .. }
            | Self::BestCurveMisses { .. } => self.of_a_comparison(),
            Self::UnusedPrior { priors, parameter, experiment, heat } => {
                let why = if *heat { "its heat has no use for it" } else { "it has no [heat]" };
                format!("{priors}: the prior of {parameter} changes nothing in {experiment}: {why}")
            }
            Self::OutsideEnergies { energy, lowest, highest } => {
                outside_energies(*energy, [*lowest, *highest])
            }
        }
    }

    /// The same of a bed's material and stiffness.
    fn of_a_bed(&self) -> String {
        let short = |value: &f64| significant(*value, 3);
        match self {
            Self::InertiaFelt { inertial_number, limit } => format!(
                "inertia is felt: the inertial number reaches {} in a heated phase, above {limit}: the bed does not creep as powder does",
                significant(*inertial_number, 2)
            ),
            Self::SoftSettling { phase, k1_n_per_m, load, limit, needed_n_per_m } => {
                soft_settling(phase, *k1_n_per_m, [*load, *limit], *needed_n_per_m)
            }
            Self::KeepsOverlaps { phase, k1_n_per_m } => format!(
                "phase {phase}: no balance was found on the way to K1 = {} N/m, at which adhesion gives contacts the neck of the pair: they keep the overlaps of a softer K1, and heat starts from wider necks and a denser bed",
                short(k1_n_per_m)
            ),
            Self::OtherPowder { what, unit, scene, calibrated } => format!(
                "the scene's {what} is {} {unit}, the posterior was calibrated with {} {unit}: another powder?",
                short(scene),
                short(calibrated)
            ),
            Self::OtherFinalContactRatio { scene, calibrated } => format!(
                "contacts of the scene grow up to a/R = {}, those of the calibrated pair up to {}: late densities differ",
                significant(*scene, 4),
                significant(*calibrated, 4)
            ),
            Self::FailedBeds { failed, draws } => format!(
                "the beds of {failed} of {draws} draws could not be computed and are in no number"
            ),
            _ => String::new(),
        }
    }

    /// The same of a comparison.
    fn of_a_comparison(&self) -> String {
        match self {
            Self::UntrustedKinetics { kinetics, noise, ess, khat } => format!(
                "{kinetics} with {noise} errors: its posterior is not to be trusted (effective sample size {ess:.0}, k-hat {}), nor is its evidence",
                khat_in_words(*khat)
            ),
            Self::EvidencesTooClose { best, other, noise, difference, error } => format!(
                "{best} against {other} with {noise} errors: the evidences differ by {}, no more than their Monte Carlo error {} allows to tell",
                significant(difference.max(0.0), 2),
                significant(*error, 2)
            ),
            Self::PriorDecides { best, other, noise, parameters, reach, difference } => {
                let between = format!("{best} against {other} with {noise} errors");
                prior_decides(&between, *parameters, *reach, *difference)
            }
            Self::DependentComparison { kinetics, noise, lag1, correlated } => {
                dependent(kinetics, noise, *lag1, *correlated)
            }
            Self::FinalContactRatioReadOff { value, of } => format!(
                "the final contact ratio {} was read off the data that it helps to fit, {}",
                significant(*value, 3),
                of.as_ref().map_or_else(
                    || "for every kinetics alike".to_owned(),
                    |of| format!("which costs \"{of}\" nothing")
                )
            ),
            Self::PriorsDiffer { parameter, one, prior, other, other_prior } => format!(
                "the prior of {parameter} is {prior} in \"{one}\" and {other_prior} in \"{other}\": part of their Bayes factor is that of the priors"
            ),
            Self::BestCurveMisses { best, observable, rmse, other, other_rmse } => format!(
                "the best curve of \"{best}\" misses {observable} by {} (RMSE), that of \"{other}\" by {}: what the curve misses is taken for noise, and the evidence is that of both",
                significant(*rmse, 2),
                significant(*other_rmse, 2)
            ),
            _ => String::new(),
        }
    }

    /// The step that helps.
    fn remedy(&self) -> &'static str {
        match self {
            Self::AboveFinalContactRatio { .. } => {
                "set final_contact_ratio in the experiment, calibrate it with a prior [phi], or leave those rows out with --window"
            }
            Self::OtherRadius { .. } => "set radius_m in the experiment if that is not meant",
            Self::ProductOnly { .. } => {
                "quote the product, or tell the two apart with --kinetics three-stage"
            }
            Self::BelowAdhesiveContact { .. } => {
                "give the neck radius over the particle radius, or say quantity = \"neck-radius\" and value_unit = \"m\" in [columns] (--quantity, --value-unit), and check R"
            }
            Self::DeltaCAboveRadius { .. } => "correct its unit or its bounds",
            Self::TauSFarFromTimes { .. } => {
                "correct the prior, or the unit of time_s (seconds after first contact)"
            }
            Self::UnusedSigma { .. } => "--noise fixed:table (fixed-table in a plan) uses them",
            Self::GivenParameterSets => {
                "draw them from the prior, or leave out design and let the sampler place them"
            }
            Self::UntrustedProposal { .. } => "give the earlier calibration more simulations first",
            Self::ProposalOutsidePriors { .. } => {
                "widen the priors if the earlier result holds, or leave it out"
            }
            Self::TunedDraws => "calibrate with --noise inferred",
            Self::NeverReached { .. } => "ask for a smaller --contact-ratio",
            Self::FewReach { .. } => "ask for a contact ratio that more of them reach",
            Self::InertiaFelt { .. } => "mode = \"quasi-static\" in that phase leaves it out",
            Self::NecksMeet { .. } => "sintering.when_necks_meet = \"stop\" ends the run there",
            Self::SoftSettling { .. } => "set it as k1_n_per_m of that phase, or of [material]",
            Self::KeepsOverlaps { .. } => {
                "let the bed settle longer, or with a K1 nearer to that of the heat"
            }
            Self::OtherPowder { .. } => {
                "write the powder of the posterior into [material] of the scene, or calibrate that of the scene"
            }
            Self::OtherFinalContactRatio { .. } => {
                "write the same final_contact_ratio into [material] of the scene"
            }
            Self::FailedBeds { .. } => {
                "see \"failed\" in densify.json; the same command tries them again"
            }
            Self::TargetOutsideModel { .. } => {
                "see what other laws say of that time, or ask for a smaller --target"
            }
            Self::FewDraws { .. } => "take --draws 20 or more",
            Self::SpreadUnexplained { .. } => "take more --draws",
            Self::SpreadUnknown => "take more --draws, or a --target that more of them reach",
            Self::UntrustedKinetics { .. } | Self::EvidencesTooClose { .. } => {
                "run more simulations: --samples, or --continue-from of a finished run"
            }
            Self::PriorDecides { .. } => {
                "give priors that hold what is known before the evidence is quoted"
            }
            Self::DependentComparison { correlated: false, .. } => {
                "see what the evidences are with errors that may be alike: --noise inferred,correlated; finished runs and plans are calibrated with correlated noise for that"
            }
            Self::DependentComparison { .. } => {
                "look at the residuals before a Bayes factor is quoted"
            }
            Self::FinalContactRatioReadOff { of: None, .. } => "--phi calibrates it instead",
            Self::FinalContactRatioReadOff { .. } => "a prior [phi] calibrates it instead",
            Self::PriorsDiffer { .. } => {
                "calibrate both with one prior of it, unless that difference is meant"
            }
            Self::BestCurveMisses { .. } => {
                "look at the curves in compare-*.png before the explanation is believed"
            }
            Self::UnusedPrior { .. } => {
                "describe the heat in [heat] of the experiment, or take the prior out"
            }
            Self::OutsideEnergies { .. } => {
                "measure a pair at such an energy, and see what another mobility law says"
            }
        }
    }
}

impl fmt::Display for Careful {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}{}", self.what(), self.remedy(), section(self))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use schemars::{JsonSchema, schema_for};
    use serde_json::Value;

    use smc_calib::Concern;

    use super::*;
    use crate::record::Doubt;

    const PAGE: &str = include_str!("../../guide/pages/careful.md");

    /// The kinds of all variants, from the schema of the type, which knows every variant.
    fn kinds<T: JsonSchema>() -> BTreeSet<String> {
        let schema = serde_json::to_value(schema_for!(T)).expect("a schema is JSON");
        let variants = schema["oneOf"].as_array().expect("variants");
        let kind =
            |variant: &Value| variant["properties"]["kind"]["const"].as_str().map(str::to_owned);
        variants.iter().map(|variant| kind(variant).expect("a kind")).collect()
    }

    /// Name and text of every section of the page that is on one kind.
    fn sections() -> Vec<(String, String)> {
        let after = |section: &str| {
            let (name, text) = section.split_once('\n').expect("text below a heading");
            (name.trim().to_owned(), text.trim().to_owned())
        };
        PAGE.split("\n### ").skip(1).map(after).collect()
    }

    #[test]
    fn every_kind_has_a_section_of_the_page_and_every_section_a_kind() {
        let of_types = [
            kinds::<Careful>(),
            kinds::<OfJoint>(),
            kinds::<OfPopulation>(),
            kinds::<Concern>(),
            kinds::<Doubt>(),
        ];
        let kinds: BTreeSet<String> = of_types.iter().flatten().cloned().collect();
        let number: usize = of_types.iter().map(BTreeSet::len).sum();
        assert_eq!(kinds.len(), number, "a kind names one reason");
        let named: Vec<String> = sections().into_iter().map(|(name, _)| name).collect();
        let on_page: BTreeSet<String> = named.iter().cloned().collect();
        assert_eq!(named.len(), on_page.len(), "a kind has one section");
        let missing: Vec<_> = kinds.difference(&on_page).collect();
        let unknown: Vec<_> = on_page.difference(&kinds).collect();
        assert!(missing.is_empty(), "careful.md needs a section \"### kind\" for {missing:?}");
        assert!(unknown.is_empty(), "no reason to be careful has the kind of {unknown:?}");
    }

    #[test]
    fn every_section_says_what_it_means_how_it_is_judged_and_what_to_do() {
        for (name, text) in sections() {
            let text = text.split("\n## ").next().unwrap_or_default().trim();
            for part in ["- Means: ", "- Judged: ", "- Do: "] {
                assert!(text.contains(part), "{name}: no {part:?}");
            }
            let lines = text.lines().filter(|line| !line.trim().is_empty()).count();
            assert!((4..=9).contains(&lines), "{name}: {lines} lines");
        }
    }

    #[test]
    fn a_line_says_what_it_means_what_helps_and_its_section() {
        let line = Careful::FewDraws { draws: 5 }.to_string();
        assert_eq!(
            line,
            "5 draws are few for a 90 % interval: its ends are the extreme draws; take --draws 20 or more (see careful.md, \"few-draws\")"
        );
        let few = Concern::FewEffectiveSamples {
            ess: 31.2,
            wished: 400.0,
            by_errors: None,
            drawn: false,
        };
        let of_pair = Simulations {
            number: 16_384,
            of_programs: false,
            of_function: false,
            of_file: false,
            extendable: true,
        };
        assert_eq!(
            concern(&few, of_pair),
            "only 31 effective samples: means and intervals are rough; run more simulations: calibrate --continue-from DIR --samples 32768 (see careful.md, \"few-effective-samples\")"
        );
        let of_programs = Simulations {
            number: 300,
            of_programs: true,
            of_function: false,
            of_file: true,
            extendable: true,
        };
        assert!(concern(&few, of_programs).contains("calibrate --resume DIR --samples 600"));
        let small = Simulations { number: 1000, ..of_pair };
        assert!(concern(&few, small).contains("--continue-from DIR --samples 16384"));
        // What cannot be extended is run anew.
        let given = Simulations { extendable: false, ..of_programs };
        assert!(concern(&few, given).contains("samples = 600 in [sampler]"));
        let pairs = Simulations { of_file: true, extendable: false, ..small };
        assert!(concern(&few, pairs).contains("samples = 16384 in [sampler]"));
    }

    #[test]
    fn a_reason_without_an_option_ends_with_its_remedy() {
        let many = Concern::ManyFailures { failed: 3, simulations: 9, commonest: "x".to_owned() };
        let asked = Simulations {
            number: 9,
            of_programs: true,
            of_function: false,
            of_file: true,
            extendable: true,
        };
        let line = concern(&many, asked);
        assert!(
            line.ends_with("where the simulator works (see careful.md, \"many-failures\")"),
            "{line}"
        );
    }
}
