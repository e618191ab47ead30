//! A population in words, as a table and as figures.

use std::fmt::Write as _;

use figures::{Axes, FitFigure, MarginalsFigure, MarginalsParameter};
use smc_calib::{Coordinate, Moments, ParameterSummary, Weighted};

use super::drawing::{NamedFigures, band};
use super::notation::{TimeScale, symbol};
use super::points::PointColumns;
use crate::input::data_table::quoted;
use crate::number::significant;
use crate::record::{Marginal, MemberRecord, NextPair, PopulationRecord, Record};

/// More members than this cannot be told apart in a figure, beside the next one.
const MOST_DRAWN: usize = 7;

/// The first line of the summary.
pub(super) fn headline(record: &Record, population: &PopulationRecord) -> String {
    let at = match &population.next {
        Some(next) => {
            let radius_um = significant(1e6 * next.pair.powder.radius_m, 3);
            format!(", {} kinetics; the next pair, R = {radius_um} um", next.pair.kinetics)
        }
        None => "; the next one".to_owned(),
    };
    let members: Vec<&str> = population.members.iter().map(|member| member.name.as_str()).collect();
    format!("{} ({}){at}\n", record.plan.title, members.join(", "))
}

/// Mean, spread and what they rest on.
pub(super) fn lines(record: &Record, population: &PopulationRecord, width: usize) -> String {
    let mut text = String::from("  between members (mean; spread, 90 %):\n");
    let each = record.parameters.iter().zip(population.mean.iter().zip(&population.spread));
    for (summary, (mean, spread)) in each {
        let unit = match summary.coordinate {
            Coordinate::Log10 => " decades",
            Coordinate::Linear => "",
        };
        let [low, high] = [spread.eti90.lower, spread.eti90.upper].map(|end| significant(end, 2));
        let _ = writeln!(
            text,
            "  {:<width$} {:>9} spread {}{unit} ({low} .. {high})",
            summary.parameter.name,
            significant(summary.coordinate.theta(mean.median), 3),
            significant(spread.median, 2),
        );
    }
    for member in &population.members {
        let fitted = match member.fitted {
            share if share >= 0.01 => {
                format!(", a fitted density in {} %", significant(100.0 * share, 2))
            }
            _ => String::new(),
        };
        let _ = writeln!(
            text,
            "  {}: likelihood from {:.0} effective samples (5 % below {:.0}{fitted})",
            member.name, member.effective, member.effective_least,
        );
    }
    text
}

/// A median and its 90 % interval in the unit of the parameter.
fn in_si(of: ParameterInWords<'_>, median: f64, ends: [f64; 2]) -> String {
    let [low, high] = ends.map(|end| significant(of.coordinate.theta(end), 3));
    format!("{} ({low} … {high})", significant(of.coordinate.theta(median), 3))
}

#[derive(Clone, Copy)]
struct ParameterInWords<'a> {
    name: &'a str,
    coordinate: Coordinate,
}

fn of(summary: &ParameterSummary) -> ParameterInWords<'_> {
    ParameterInWords { name: &summary.parameter.name, coordinate: summary.coordinate }
}

/// The table of the report: a row for each parameter of the population, its members and the next one.
pub(super) fn cells(
    record: &Record,
    population: &PopulationRecord,
) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let mut rows = Vec::new();
    for (j, summary) in record.parameters.iter().enumerate() {
        let (mean, spread, next) =
            (&population.mean[j], &population.spread[j], &summary.in_coordinate);
        let ends = |of: &Moments| [of.eti90.lower, of.eti90.upper];
        let of = of(summary);
        let mut row = |what: &str, value: String| {
            rows.push(vec![of.name.to_owned(), what.to_owned(), value]);
        };
        row("mean of the population", in_si(of, mean.median, ends(mean)));
        let [low, high] = ends(spread).map(|end| significant(end, 2));
        let unit = if of.coordinate == Coordinate::Log10 { " decades" } else { "" };
        row(
            "spread between members",
            format!("{} ({low} … {high}){unit}", significant(spread.median, 2)),
        );
        for member in &population.members {
            let (alone, shrunk) = (&member.alone[j], &member.shrunk[j]);
            row(&format!("{}, alone", member.name), in_si(of, alone.median, alone.eti90));
            row(&format!("{}, as a member", member.name), in_si(of, shrunk.median, shrunk.eti90));
        }
        row("the next one", in_si(of, next.median, ends(next)));
    }
    (vec!["parameter", "of", "median (90 %)"], rows)
}

/// `population.csv`: the same in full precision, in the coordinates, with what each member's likelihood rests on.
pub fn csv(record: &Record) -> String {
    let mut text = String::from(
        "parameter,coordinate,of,median,eti90_lower,eti90_upper,effective_samples,effective_samples_5_percent,fitted_share,share_beyond_prior\n",
    );
    let Some(population) = &record.population else { return text };
    for (j, summary) in record.parameters.iter().enumerate() {
        let coordinate = match summary.coordinate {
            Coordinate::Log10 => "log10",
            Coordinate::Linear => "linear",
        };
        let name = quoted(&summary.parameter.name);
        let mut row = |of: &str, median: f64, [low, high]: [f64; 2], rests: &str| {
            let _ =
                writeln!(text, "{name},{coordinate},{},{median},{low},{high},{rests}", quoted(of));
        };
        let moments = |of: &Moments| (of.median, [of.eti90.lower, of.eti90.upper]);
        for (what, of) in [
            ("mean of the population", &population.mean[j]),
            ("spread between members", &population.spread[j]),
            ("the next one", &summary.in_coordinate),
        ] {
            let (median, ends) = moments(of);
            row(what, median, ends, ",,,");
        }
        for member in &population.members {
            let MemberRecord { effective, effective_least, fitted, outside, .. } = member;
            let rests = format!("{effective},{effective_least},{fitted},{}", outside[j]);
            let marginal = |of: &Marginal| (of.median, of.eti90);
            let (median, ends) = marginal(&member.alone[j]);
            row(&format!("{} alone", member.name), median, ends, &rests);
            let (median, ends) = marginal(&member.shrunk[j]);
            row(&format!("{} as a member", member.name), median, ends, &rests);
        }
    }
    text
}

/// The members side by side, alone and as members, each beside the next one; and the curves of the next pair.
pub(super) fn figures(
    record: &Record,
    population: &PopulationRecord,
    points: &PointColumns,
    scale: TimeScale,
) -> NamedFigures {
    let next = |j: usize, summary: &ParameterSummary| {
        let column = points.parameters[j].iter().map(|theta| summary.coordinate.of(*theta));
        Marginal::of(&Weighted::new(column.zip(points.weights.iter().copied()))).quantiles
    };
    let shown = &population.members[..population.members.len().min(MOST_DRAWN)];
    let names = |next: &str| {
        let names = shown.iter().map(|member| member.name.clone());
        names.chain([next.to_owned()]).collect::<Vec<_>>()
    };
    let all = population.members.len();
    let title = match shown.len() < all {
        true => format!("{}, {MOST_DRAWN} of them drawn", record.plan.title),
        false => record.plan.title.clone(),
    };
    let side_by_side = |marginals: fn(&MemberRecord) -> &[Marginal]| MarginalsFigure {
        title: title.clone(),
        names: names("the next one"),
        parameters: record
            .parameters
            .iter()
            .enumerate()
            .map(|(j, summary)| {
                let (symbol, unit) = symbol(&summary.parameter.name, &summary.parameter.unit);
                let own = shown.iter().map(|member| marginals(member)[j].quantiles.clone());
                MarginalsParameter {
                    symbol,
                    unit,
                    log10: summary.coordinate == Coordinate::Log10,
                    draws: own.chain([next(j, summary)]).collect(),
                }
            })
            .collect(),
    };
    let mut figures: NamedFigures = vec![
        ("pairs".to_owned(), Box::new(side_by_side(|member| &member.alone))),
        ("shrunk".to_owned(), Box::new(side_by_side(|member| &member.shrunk))),
    ];
    if let Some(next) = &population.next {
        figures.push(("next".to_owned(), Box::new(curves(record, next, scale))));
    }
    figures
}

fn curves(record: &Record, next: &NextPair, scale: TimeScale) -> FitFigure {
    FitFigure {
        title: record.plan.title.clone(),
        control: next.control.clone(),
        value: next.values.clone(),
        grid: next.time_s.clone(),
        mean: next.mean.clone(),
        band50: band(&next.curve50),
        band90: band(&next.curve90),
        axes: Axes { log_control: scale.is_log(&next.control, &next.values), ..Axes::default() },
        ..FitFigure::default()
    }
}
