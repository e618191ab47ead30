//! The result of a densification as JSON, CSV, figure and text.

use std::fmt::Write as _;
use std::path::Path;

use dem_core::Kinetics;
use serde::Serialize;
use serde_json::Value;

use super::curve::{Curve, Point, Target, TimeTo, bands};
use super::draws::Draw;
use super::freezing::Freezing;
use super::laws::{self, OtherLaw};
use super::spread::{Spread, divide};
use crate::careful::Careful;
use crate::number::significant;
use crate::pair::heat::HeatPlan;
use dem_core::bed::NECKS_MEET;
use figures::DensificationFigure;

/// Version of the layout of `densify.json`.
const SCHEMA_VERSION: u32 = 2;

/// Everything that decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DensifyPlan {
    /// Name of the scene.
    pub scene_name: String,
    /// The scene itself.
    pub scene: Value,
    /// Name of the calibration that the draws come from.
    pub posterior_name: String,
    /// Fingerprint of the calibration's plan and draws.
    pub posterior_fingerprint: String,
    /// Kinetics of both.
    pub kinetics: Kinetics,
    /// Radius that tau_s was calibrated at \[m\].
    pub calibrated_radius_m: f64,
    /// Number of draws.
    pub draws: usize,
    /// Seed of their choice.
    pub seed: u64,
    /// The level whose time is wanted.
    pub target: Target,
    /// The experiment of a posterior of several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<String>,
    /// The heat of the beds, its open numbers being those of each draw; none at the temperature of the calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatPlan>,
    /// The energy of its pulse, where another than the file's was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pulse_energy: Option<f64>,
    /// Version of this program.
    pub version: String,
}

/// A draw and its bed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DrawRecord {
    /// The draw.
    #[serde(flatten)]
    pub draw: Draw,
    /// Time at which its bed reaches the target \[s\]; none where it does not.
    pub time_to_target_s: Option<f64>,
    /// Time at which its pairs end \[s\].
    pub pairs_end_s: Option<f64>,
    /// The target's quantity at that time.
    pub pairs_end_at: Option<f64>,
    /// The target's quantity at the end of the run.
    pub last: f64,
    /// Sum of the errors of a/R of all quasi-static steps.
    pub error_estimate: f64,
}

/// A draw whose bed could not be computed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FailedDraw {
    /// The draw.
    #[serde(flatten)]
    pub draw: Draw,
    /// The cause.
    pub reason: String,
}

/// The time to the target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reached {
    /// Over all draws \[s\].
    pub time_s: TimeTo,
    /// Draws that reach it.
    pub draws: usize,
    /// Draws that do not reach it. They count as later than all others.
    pub never: usize,
    /// Those of them that no longer time would help: their pairs end below it, and with them the run or its contact ratios.
    pub ended_below: usize,
    /// Draws whose pairs have ended before they reach it.
    pub outside_model: usize,
}

/// Where the pairs end.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PairsEndAt {
    /// Share of the particles on which necks meet at its end.
    pub necks_meet: f64,
    /// Over all draws \[s\].
    pub time_s: TimeTo,
    /// Median of the target's quantity at that time; none where no draw gets there.
    pub at: Option<f64>,
    /// Draws that get there.
    pub draws: usize,
}

/// `densify.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of the layout.
    pub schema_version: u32,
    /// Everything that decides the result.
    pub plan: DensifyPlan,
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// The time to the target.
    pub target: Reached,
    /// Where the pairs end.
    pub pairs_end: PairsEndAt,
    /// Where the beds stop growing, with a heat that ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub freezes: Option<Freezing>,
    /// What other laws say of the same time; none where the target is no relative density.
    pub other_laws: Vec<OtherLaw>,
    /// Where the spread of the time comes from; none where too few draws reach the target.
    pub spread: Option<Spread>,
    /// Bands over time.
    pub curve: Vec<Point>,
    /// The draws.
    pub draws: Vec<DrawRecord>,
    /// Draws without a result.
    pub failed: Vec<FailedDraw>,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

impl Report {
    /// From the curves of all draws that have one.
    pub fn new(
        plan: DensifyPlan,
        parameters: Vec<String>,
        computed: &[(Draw, Curve)],
        failed: Vec<FailedDraw>,
        freezes: Option<Freezing>,
        (other_laws, mut advice): (Vec<OtherLaw>, Vec<String>),
    ) -> Self {
        let target = plan.target;
        let draws: Vec<DrawRecord> = computed
            .iter()
            .map(|(draw, curve)| {
                let ends = curve.pairs_end_at(target);
                DrawRecord {
                    draw: draw.clone(),
                    time_to_target_s: curve.time_to(target),
                    pairs_end_s: ends.map(|(time, _)| time),
                    pairs_end_at: ends.map(|(_, at)| at),
                    last: curve.moments.last().map_or(f64::NAN, |last| last.of_target(target)),
                    error_estimate: curve.error_estimate,
                }
            })
            .collect();
        let times: Vec<Option<f64>> = draws.iter().map(|draw| draw.time_to_target_s).collect();
        let ends: Vec<Option<f64>> = draws.iter().map(|draw| draw.pairs_end_s).collect();
        let reached: Vec<&DrawRecord> =
            draws.iter().filter(|draw| draw.time_to_target_s.is_some()).collect();
        let outside = reached
            .iter()
            .filter(|draw| draw.pairs_end_s.is_some_and(|end| Some(end) <= draw.time_to_target_s))
            .count();
        let columns: Vec<Vec<f64>> = (0..parameters.len())
            .map(|place| reached.iter().map(|draw| draw.draw.parameters[place]).collect())
            .collect();
        let reached_s: Vec<f64> =
            times.iter().flatten().copied().filter(|time| *time > 0.0).collect();
        let spread = (reached_s.len() == reached.len())
            .then(|| divide(&parameters, &columns, &reached_s))
            .flatten();
        let curves: Vec<Curve> = computed.iter().map(|(_, curve)| curve.clone()).collect();
        let ended: Vec<f64> = draws.iter().filter_map(|draw| draw.pairs_end_at).collect();
        let stays = |draw: &&DrawRecord| {
            draw.time_to_target_s.is_none() && draw.pairs_end_at.is_some_and(|at| draw.last <= at)
        };
        let record = Reached {
            time_s: TimeTo::of(&times),
            draws: reached.len(),
            never: draws.len() - reached.len(),
            ended_below: draws.iter().filter(stays).count(),
            outside_model: outside,
        };
        let pairs_end = PairsEndAt {
            necks_meet: NECKS_MEET,
            time_s: TimeTo::of(&ends),
            at: TimeTo::of(&ended.iter().copied().map(Some).collect::<Vec<_>>()).median,
            draws: ended.len(),
        };
        advice.extend(advice_on(&record, &pairs_end, spread.as_ref(), draws.len(), failed.len()));
        Self {
            schema_version: SCHEMA_VERSION,
            parameters,
            target: record,
            pairs_end,
            freezes,
            other_laws,
            spread,
            curve: bands(&curves),
            draws,
            failed,
            advice,
            plan,
        }
    }

    /// `densify.csv`: the bands over time.
    pub fn curve_csv(&self) -> String {
        let mut text = String::from("time_s");
        for quantity in ["relative_density", "mean_contact_ratio"] {
            for end in ["median", "eti50_lower", "eti50_upper", "eti90_lower", "eti90_upper"] {
                let _ = write!(text, ",{quantity}_{end}");
            }
        }
        text.push_str(",outside_model\n");
        for point in &self.curve {
            let _ = write!(text, "{:e}", point.time_s);
            for band in [point.relative_density, Some(point.mean_contact_ratio)] {
                match band {
                    Some(b) => {
                        for value in [b.median, b.eti50[0], b.eti50[1], b.eti90[0], b.eti90[1]] {
                            let _ = write!(text, ",{value:e}");
                        }
                    }
                    None => text.push_str(",,,,,"),
                }
            }
            let _ = writeln!(text, ",{}", point.outside_model);
        }
        text
    }

    /// `draws.csv`: every draw and its bed, with an empty cell for a time that is not reached.
    pub fn draws_csv(&self, units: &[&str]) -> String {
        let mut text = String::from("draw,row");
        for (name, unit) in self.parameters.iter().zip(units) {
            let _ = write!(text, ",{name} [{unit}]");
        }
        text.push_str(
            ",time_to_target [s],pairs_end [s],pairs_end_at [1],last [1],error_estimate [1]\n",
        );
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:e}"));
        for (place, record) in self.draws.iter().enumerate() {
            let _ = write!(text, "{place},{}", record.draw.row);
            for value in &record.draw.parameters {
                let _ = write!(text, ",{value:e}");
            }
            let _ = writeln!(
                text,
                ",{},{},{},{:e},{:e}",
                number(record.time_to_target_s),
                number(record.pairs_end_s),
                number(record.pairs_end_at),
                record.last,
                record.error_estimate
            );
        }
        text
    }

    /// The fan chart.
    pub fn figure(&self) -> DensificationFigure {
        let target = self.plan.target;
        let bands: Vec<_> =
            self.curve.iter().map(|point| (point.time_s, point.of_target(target))).collect();
        let column = |pick: &dyn Fn(&super::curve::Band) -> f64| -> Vec<f64> {
            bands.iter().map(|(_, band)| band.as_ref().map_or(f64::NAN, pick)).collect()
        };
        let time = &self.target.time_s;
        DensificationFigure {
            title: format!("{}, draws of {}", self.plan.scene_name, self.plan.posterior_name),
            quantity: target.name().to_owned(),
            time_s: bands.iter().map(|(time, _)| *time).collect(),
            median: column(&|band| band.median),
            band50: figures::Band {
                lower: column(&|band| band.eti50[0]),
                upper: column(&|band| band.eti50[1]),
            },
            band90: figures::Band {
                lower: column(&|band| band.eti90[0]),
                upper: column(&|band| band.eti90[1]),
            },
            pairs_end_at: self.pairs_end.at,
            target: target.value(),
            time_to_target_s: time.median,
            interval_s: time.eti90,
        }
    }

    /// The summary as text, where the beds were just computed with how long that took \[s\] and the folder of the results.
    pub fn text(&self, ended: Option<(f64, &Path)>) -> String {
        let plan = &self.plan;
        let took = ended.map_or_else(String::new, |(s, _)| format!(", in {} s", significant(s, 2)));
        let mut lines = vec![format!(
            "{}, {} draws of the posterior of {} ({}){took}",
            plan.scene_name,
            self.draws.len(),
            plan.posterior_name,
            plan.kinetics
        )];
        let target = &self.target;
        let what = format!("{} {}", plan.target.name(), significant(plan.target.value(), 3));
        match target.time_s.median {
            Some(median) => lines.push(format!(
                "  {what} is reached after {} s (50 % {}, 90 % {})",
                significant(median, 3),
                interval(target.time_s.eti50),
                interval(target.time_s.eti90)
            )),
            None => lines.push(format!("  {what}: half of the draws or more never reach it")),
        }
        let never = |count: usize, why: &str| {
            let all = self.draws.len();
            format!(
                "    {count} of {all} draws do not reach it{why} and count as later than all others"
            )
        };
        if target.ended_below > 0 {
            let why = match plan.target {
                Target::ContactRatio(_) => {
                    ": their pairs end at a smaller one, and what follows has a density only (ask for less, or for a density),"
                }
                Target::RelativeDensity(_) => {
                    ": their pairs end at a smaller one, and the run with them (when_necks_meet = \"closure\" goes on),"
                }
            };
            lines.push(never(target.ended_below, why));
        }
        let late = target.never - target.ended_below;
        match &self.freezes {
            None if late == 0 => {}
            None => lines.push(never(late, " within the scene's time")),
            Some(freezes) => lines.extend(freezes.lines(plan.target, (late, self.draws.len()))),
        }
        match self.pairs_end.at {
            Some(at) => lines.push(format!(
                "  the pairs end at a {} of {}, where necks meet on more than {} % of the particles or pores close",
                plan.target.name(),
                significant(at, 3),
                100.0 * NECKS_MEET
            )),
            None => lines.push("  necks do not meet within the scene's time".to_owned()),
        }
        lines.extend(laws::lines(&self.other_laws, target.time_s.median));
        lines.extend(self.spread.iter().flat_map(spread_in_words));
        for line in &self.advice {
            lines.push(format!("  careful: {line}"));
        }
        lines.extend(ended.map(|(_, out)| format!("  results in {}", out.display())));
        lines.push(String::new());
        lines.join("\n")
    }
}

/// Where the spread of the time comes from, in lines.
fn spread_in_words(spread: &Spread) -> Vec<String> {
    let mut lines = vec![format!(
        "  spread of ln(time) {}; of its variance comes from",
        significant(spread.sd_ln_time, 2)
    )];
    for share in &spread.shares {
        lines.push(format!(
            "    {:<8} {:>4.0} % +- {:.0}  ({:.0} % alone, {:.0} % last)",
            share.parameter,
            100.0 * share.share,
            100.0 * share.se,
            100.0 * share.alone,
            100.0 * share.last
        ));
    }
    lines.push(format!(
        "    a linear regression explains {:.0} % ({:.0} % of draws left out)",
        100.0 * spread.r_squared,
        100.0 * spread.r_squared_left_out
    ));
    lines
}

pub(super) fn interval([lower, upper]: [Option<f64>; 2]) -> String {
    let end = |end: Option<f64>| end.map_or_else(|| "never".to_owned(), |s| significant(s, 3));
    format!("{} .. {} s", end(lower), end(upper))
}

fn advice_on(
    target: &Reached,
    ends: &PairsEndAt,
    spread: Option<&Spread>,
    draws: usize,
    failed: usize,
) -> Vec<String> {
    let mut advice = Vec::new();
    if failed > 0 {
        advice.push(Careful::FailedBeds { failed, draws: draws + failed });
    }
    if target.outside_model > 0 {
        advice.push(Careful::TargetOutsideModel {
            outside: target.outside_model,
            draws: target.draws,
            limit: ends.necks_meet,
        });
    }
    if draws < 20 {
        advice.push(Careful::FewDraws { draws });
    }
    match spread {
        Some(spread) if spread.r_squared_left_out < 0.8 => {
            advice.push(Careful::SpreadUnexplained { share: spread.r_squared_left_out.max(0.0) });
        }
        Some(_) => {}
        None if target.draws > 0 => advice.push(Careful::SpreadUnknown),
        None => {}
    }
    advice.iter().map(ToString::to_string).collect()
}
