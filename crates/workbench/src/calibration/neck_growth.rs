//! Results that only a pair of particles has: Table 3, the product, the fit errors, the knee and the curves.

use dem_core::{Knee, knee, printed};
use smc_calib::{Trust, Weighted};

use super::curves::{AtData, curves};
use super::of_pair::{OfPair, simulation_failure};
use crate::careful::Careful;
use crate::error::Failure;
use crate::input::material::Material;
use crate::pair::derived::{of_points, weighted};
use crate::pair::frenkel_fit;
use crate::pair::parameter::ParameterName;
use crate::pair::product;
use crate::record::{
    Derived, Fit, FitError, KneeSummary, NeckGrowthRecord, ObservableRecord, PaperComparison,
    PrintedParameter,
};

impl OfPair<'_> {
    /// Everything that only a pair has.
    pub(super) fn record(
        &self,
        found: &ObservableRecord,
        trust: &Trust,
    ) -> Result<NeckGrowthRecord, Failure> {
        let observed = &self.measured.values;
        let frenkel_tau_s = frenkel_fit::best_tau_s(&self.reference(), observed)
            .map_err(|error| simulation_failure(&error))?;
        let paper = self.paper().zip(self.pair.material);
        let paper = paper.map(|(_, material)| self.paper_comparison(material));
        let (curves, at_data) = curves(self, frenkel_tau_s)?;
        let AtData { paper: paper_at_data, frenkel: frenkel_at_data } = at_data;
        let kinetics = self.pair.kinetics;
        let frenkel = frenkel_at_data.map(|curve| FitError::of(observed, &curve));
        Ok(NeckGrowthRecord {
            printed: self.printed_parameters(paper.as_ref()),
            paper,
            product: product::summary(self.plan, self.pair, self.posterior),
            fit: Fit {
                map: found.map_error,
                posterior_mean: found.mean_error,
                paper: paper_at_data.map(|curve| FitError::of(observed, &curve)),
                frenkel,
                frenkel_tau_s,
            },
            knee: if kinetics.separates_c1_from_delta_c() { self.knee()? } else { None },
            freezes_at: self.freezes_at(),
            curves,
            doubts: self.doubts(trust, found.map_error, frenkel),
            other_kinetics: Vec::new(),
        })
    }

    /// Advice on kinetics whose data inform a product but neither of its factors.
    pub(super) fn advice(&self) -> Option<String> {
        let kinetics = self.pair.kinetics;
        (kinetics.uses_c1_delta_c() && !kinetics.separates_c1_from_delta_c())
            .then(|| Careful::ProductOnly { kinetics: kinetics.to_string() }.to_string())
    }

    fn paper_comparison(&self, material: Material) -> PaperComparison {
        // The form of Table 3 belongs to a radius; at that of Table 1 it is what the paper prints, to the digit.
        let radius_m = self.pair.powder.radius_m;
        let si = material.table3_sintering_at(radius_m);
        let printed = if radius_m == material.powder().radius_m {
            material.table3()
        } else {
            printed::to_printed(&si, radius_m)
        };
        let percentile = |place: usize| {
            let value = match self.model.name(place)? {
                ParameterName::C1 => si.c1,
                ParameterName::TauS => si.tau_s,
                ParameterName::DeltaC => si.delta_c,
                _ => return None,
            };
            Some(100.0 * self.weighted(|theta| theta[place]).share_below(value))
        };
        PaperComparison {
            printed: [printed.c1, printed.tau_s, printed.delta_c],
            si: [si.c1, si.tau_s, si.delta_c],
            percentile_si: (0..self.plan.parameters.len()).map(percentile).collect(),
        }
    }

    /// The posterior pushed, sample by sample, through the map to the form of Table 3.
    fn printed_parameters(&self, paper: Option<&PaperComparison>) -> Vec<PrintedParameter> {
        let three = [ParameterName::C1, ParameterName::TauS, ParameterName::DeltaC];
        // Table 3 knows the paper's three powders, and no other.
        let Some(paper) = paper else { return Vec::new() };
        if three.iter().any(|name| self.model.place(*name).is_none()) {
            return Vec::new();
        }
        let radius_m = self.pair.powder.radius_m;
        let push = |theta: &[f64]| {
            let printed = printed::to_printed(&self.model.sintering(theta), radius_m);
            [printed.c1, printed.tau_s, printed.delta_c]
        };
        let at_map = push(&self.posterior.map.theta);
        // In the units that its numbers have: Table 3 itself prints 1/(Pa s) and s.
        [("c1", "1/(Pa s m)"), ("tau_s", "s m"), ("delta_c", "m")]
            .into_iter()
            .enumerate()
            .map(|(place, (name, unit))| {
                let log10 = self.weighted(|theta| push(theta)[place].log10());
                let back = |[lower, upper]: [f64; 2]| [10f64.powf(lower), 10f64.powf(upper)];
                let (mean_log10, sd_log10) = log10.moments();
                let printed = paper.printed[place];
                PrintedParameter {
                    name: name.to_owned(),
                    unit: unit.to_owned(),
                    map: at_map[place],
                    median: 10f64.powf(log10.quantile(0.5)),
                    mean_log10,
                    sd_log10,
                    eti50: back(log10.interval(0.5)),
                    eti90: back(log10.interval(0.9)),
                    eti95: back(log10.interval(0.95)),
                    paper: Some(printed),
                    paper_percentile: Some(100.0 * log10.share_below(printed.log10())),
                }
            })
            .collect()
    }

    /// Contact ratio after infinite time, where the heat ends before full coalescence.
    fn freezes_at(&self) -> Option<Derived> {
        let at = |theta: &[f64]| self.model.frozen_contact_ratio(theta).ok().flatten();
        let map = at(&self.posterior.map.theta)?;
        let marginal = weighted(self.posterior, at);
        Some(Derived {
            map,
            median: marginal.quantile(0.5),
            eti95: marginal.interval(0.95),
            paper: None,
        })
    }

    fn knee(&self) -> Result<Option<KneeSummary>, Failure> {
        let at = |theta: &[f64]| {
            let scene = self.model.scene(theta).ok()?;
            let knee = knee(&scene, &self.model.sintering(theta));
            // With a heat the knee comes at its reduced time, or never.
            let time_s = match self.model.heat(theta).ok()? {
                Some(heat) => heat.time(knee.time_s)?,
                None => knee.time_s,
            };
            let time_s = time_s + self.model.start_s(theta);
            (knee.has_zipping && knee.has_stretching).then_some(Knee { time_s, ..knee })
        };
        let Some(at_map) = at(&self.posterior.map.theta) else { return Ok(None) };
        let total: f64 = self.posterior.points().map(|point| point.weight).sum();
        let knees: Vec<(Knee, f64)> =
            of_points(self.posterior, at).map(|(knee, point)| (knee, point.weight)).collect();
        let with_knee: f64 = knees.iter().map(|(_, weight)| weight).sum();
        let scene = self.pair.scene()?;
        // The paper's pair in the clock of this table.
        let paper = self.paper().map(|sintering| {
            let knee = knee(&scene, &sintering);
            Knee { time_s: knee.time_s + self.start_s(), ..knee }
        });
        let derived = |of: fn(&Knee) -> f64| {
            let marginal = Weighted::new(knees.iter().map(|(knee, weight)| (of(knee), *weight)));
            Derived {
                map: of(&at_map),
                median: marginal.quantile(0.5),
                eti95: marginal.interval(0.95),
                paper: paper.as_ref().map(of),
            }
        };
        Ok(Some(KneeSummary {
            probability: (with_knee / total).min(1.0),
            contact_ratio: derived(|knee| knee.contact_ratio),
            time_s: derived(|knee| knee.time_s),
        }))
    }
}
