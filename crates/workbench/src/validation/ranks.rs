//! Ranks and coverages of a study, and its tables.

use std::fmt::Write as _;

use smc_calib::sbc::{Band, Outcome, counts, coverage_score};
use smc_calib::trust::khat_holds;
use smc_calib::trust::limits::KHAT_LIMIT;

/// Ranks of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranked {
    /// The quantity.
    pub name: String,
    /// Number of ranks not above k/100, k = 1..99.
    pub counts: Vec<usize>,
    /// Probability that uniform ranks stray as far from the diagonal.
    pub p_value: f64,
    /// Whether the counts stay inside the simultaneous 95 % band.
    pub inside: bool,
}

/// Coverage of one interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Covered {
    /// The parameter.
    pub name: String,
    /// The share that the interval should hold.
    pub nominal: f64,
    /// The share of data sets whose truth it holds.
    pub share: f64,
    /// Their difference in Monte Carlo standard errors.
    pub score: f64,
}

/// Ranks and coverages over all data sets.
#[derive(Debug, Clone, PartialEq)]
pub struct Ranks {
    /// The plan and the size of the study.
    pub title: String,
    /// Number of data sets.
    pub data_sets: usize,
    /// Ranks.
    pub ranked: Vec<Ranked>,
    /// Coverages.
    pub covered: Vec<Covered>,
    /// Smallest and largest count at k/100 inside the simultaneous 95 % band.
    pub band: Vec<(usize, usize)>,
    /// Data sets with k-hat above 0.7.
    pub high_khat: usize,
    /// Median effective sample size.
    pub median_ess: f64,
}

/// Whether the sampler passed.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Every rank and coverage is as it should be.
    Passed,
    /// One is not, and which.
    Failed(String),
}

impl Ranks {
    pub(super) fn new(
        title: String,
        intervals: &[String],
        quantities: &[String],
        outcomes: &[Outcome],
    ) -> Self {
        let n = outcomes.len();
        let band = Band::new(n, 0.95);
        let ranked = quantities
            .iter()
            .enumerate()
            .map(|(q, name)| {
                let ranks: Vec<f64> = outcomes.iter().map(|o| o.ranks[q]).collect();
                Ranked {
                    name: name.clone(),
                    counts: counts(&ranks),
                    p_value: band.p_value(&ranks),
                    inside: band.holds(&ranks),
                }
            })
            .collect();
        let mut covered = Vec::new();
        for (j, name) in intervals.iter().enumerate() {
            for nominal in [0.5, 0.95] {
                let hits = outcomes
                    .iter()
                    .filter(|o| if nominal == 0.5 { o.inside50[j] } else { o.inside95[j] })
                    .count();
                covered.push(Covered {
                    name: name.clone(),
                    nominal,
                    share: hits as f64 / n as f64,
                    score: coverage_score(hits, n, nominal),
                });
            }
        }
        let mut ess: Vec<f64> = outcomes.iter().map(|o| o.ess).collect();
        ess.sort_unstable_by(f64::total_cmp);
        Self {
            title,
            data_sets: n,
            ranked,
            covered,
            band: band.counts,
            high_khat: outcomes.iter().filter(|o| !khat_holds(o.khat)).count(),
            median_ess: ess[n / 2],
        }
    }

    /// Passed where every rank is inside its band at 5 % shared among all quantities (Bonferroni), and every coverage
    /// within 3 standard errors. The table gives the band of each quantity alone as well.
    pub fn verdict(&self) -> Verdict {
        let level = 0.05 / self.ranked.len() as f64;
        if let Some(r) = self.ranked.iter().find(|r| r.p_value < level) {
            return Verdict::Failed(format!("ranks of {} (p = {:.2e})", r.name, r.p_value));
        }
        match self.covered.iter().find(|c| c.score.abs() > 3.0) {
            None => Verdict::Passed,
            Some(c) => Verdict::Failed(format!(
                "the {:.0} % interval of {} holds {:.2} % of the truths ({:+.1} standard errors)",
                100.0 * c.nominal,
                c.name,
                100.0 * c.share,
                c.score
            )),
        }
    }

    /// The tables as Markdown.
    pub fn markdown(&self, seconds: f64, threads: usize) -> String {
        let mut text = format!(
            "# Simulation-based calibration\n\n{}.\n\nWall time {seconds:.0} s on {threads} threads (a shared machine). k-hat above {KHAT_LIMIT} \
             in {} data sets; median effective sample size {:.0}.\n\n\
             | ranked | p | inside the simultaneous 95 % band |\n|---|---:|---|\n",
            self.title, self.high_khat, self.median_ess
        );
        for r in &self.ranked {
            let inside = if r.inside { "yes" } else { "no" };
            let _ = writeln!(text, "| {} | {:.3} | {inside} |", r.name, r.p_value);
        }
        text += "\n| interval | nominal | holds the truth | standard errors off |\n|---|---:|---:|---:|\n";
        for c in &self.covered {
            let _ = writeln!(
                text,
                "| {} | {:.0} % | {:.2} % | {:+.2} |",
                c.name,
                100.0 * c.nominal,
                100.0 * c.share,
                c.score
            );
        }
        text
    }

    /// Empirical distribution functions and the band as CSV.
    pub fn csv(&self) -> String {
        let mut text = String::from("u,band_lower,band_upper");
        for r in &self.ranked {
            let _ = write!(text, ",{}", r.name);
        }
        text.push('\n');
        let n = self.data_sets as f64;
        for (k, (low, high)) in self.band.iter().enumerate() {
            let _ =
                write!(text, "{},{},{}", (k + 1) as f64 / 100.0, *low as f64 / n, *high as f64 / n);
            for r in &self.ranked {
                let _ = write!(text, ",{}", r.counts[k] as f64 / n);
            }
            text.push('\n');
        }
        text
    }
}
