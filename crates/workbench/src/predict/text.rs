//! A prediction as text and as CSV.

use super::{EnoughEnergy, Freezing, Predicted, Prediction};
use crate::number::{digits_of, significant};

impl Predicted {
    pub(super) fn text(&self, unit: &str) -> String {
        let digits = digits_of(self.eti95);
        let interval = |ends: [f64; 2]| {
            let [a, b] = ends.map(|end| significant(end, digits));
            format!("{a} .. {b}{unit}")
        };
        format!(
            "{}{unit} (50 % {}, 95 % {})",
            significant(self.median, digits),
            interval(self.eti50),
            interval(self.eti95)
        )
    }
}

impl Prediction {
    /// As text.
    pub fn text(&self) -> String {
        let elsewhere = if self.radius_m == self.calibrated_radius_m {
            String::new()
        } else {
            let calibrated_um = significant(1e6 * self.calibrated_radius_m, 3);
            format!(" (calibrated at {calibrated_um} um; tau_s moved in proportion to R)")
        };
        let radius_um = significant(1e6 * self.radius_m, 3);
        let of = match self.kinetics {
            Some(kinetics) => format!("{kinetics} kinetics"),
            None => format!("average of {} by evidence", models(self.averaged.len())),
        };
        let mut lines = vec![format!("{}, R = {radius_um} um, {of}{elsewhere}", self.title)];
        lines.extend(self.averaged.iter().map(|model| {
            let name = model.explanation.as_deref().unwrap_or(model.kinetics.name());
            format!("  {:.3}  {name} with {} errors", model.weight, model.noise)
        }));
        if self.left_out_models > 0 {
            lines.push(format!(
                "  {:.0e}  {}, left out",
                self.left_out_probability,
                models(self.left_out_models)
            ));
        }
        if let Some(start) = &self.first_contact_s {
            lines.push(format!(
                "  times count from first contact, at t0 = {} in the table's clock",
                start.text(" s")
            ));
        }
        for target in &self.sintering {
            let ratio = significant(target.contact_ratio, 3);
            let Some(time) = &target.time_s else {
                lines.push(format!("  a/R = {ratio} is never reached{}", self.ends_at()));
                continue;
            };
            lines.push(format!("  a/R = {ratio} is reached after {}", time.text(" s")));
            if target.never > 0 && !self.averaged.is_empty() {
                lines.push(format!(
                    "    with probability {} it is never reached, which is not in the interval{}",
                    significant(target.never_probability, 2),
                    self.ends_at()
                ));
            } else if target.never > 0 {
                lines.push(format!(
                    "    {} of {} draws never reach it and are not in the interval{}",
                    target.never,
                    target.draws,
                    self.ends_at()
                ));
            }
        }
        lines.extend(self.heat_lines());
        for after in &self.after {
            let time_s = significant(after.time_s, 4);
            lines.push(format!("  after {time_s} s a/R is {}", after.contact_ratio.text("")));
            if let Some(measured) = &after.measured {
                lines.push(format!("    and is measured as {}", measured.text("")));
            }
        }
        lines.extend(self.enough.iter().map(enough));
        lines.extend(self.advice.iter().map(|line| format!("  careful: {line}")));
        lines.push(String::new());
        lines.join("\n")
    }

    /// The final contact ratio that all models of an average have; explanations may each have another.
    fn ends_at(&self) -> String {
        let several = self.averaged.iter().any(|model| model.explanation.is_some());
        match several {
            true => String::new(),
            false => format!(" (phi = {})", significant(self.final_contact_ratio, 4)),
        }
    }

    /// Where a pair whose heat ends stops growing.
    fn heat_lines(&self) -> Option<String> {
        let Freezing { contact_ratio, probability } = self.freezes.as_ref()?;
        let of = if *probability < 0.9995 {
            format!(", with probability {}", significant(*probability, 2))
        } else {
            String::new()
        };
        Some(format!("  it freezes at a/R = {}{of}", contact_ratio.text("")))
    }

    /// As CSV, a row per prediction.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "predicted,given,unit,median,eti50_lower,eti50_upper,eti90_lower,eti90_upper,eti95_lower,eti95_upper,draws_never\n",
        );
        let mut row = |what: &str, given: f64, unit: &str, p: Option<&Predicted>, never: usize| {
            let numbers = p.map_or_else(
                || [const { String::new() }; 7],
                |p| {
                    let ([a, b], [c, d], [e, f]) = (p.eti50, p.eti90, p.eti95);
                    [p.median, a, b, c, d, e, f].map(|number| number.to_string())
                },
            );
            text.push_str(&format!("{what},{given},{unit},{},{never}\n", numbers.join(",")));
        };
        for target in &self.sintering {
            let time_s = target.time_s.as_ref();
            row("time to contact_ratio", target.contact_ratio, "s", time_s, target.never);
        }
        for after in &self.after {
            row("contact_ratio after time_s", after.time_s, "1", Some(&after.contact_ratio), 0);
            if let Some(measured) = &after.measured {
                row("measured contact_ratio after time_s", after.time_s, "1", Some(measured), 0);
            }
        }
        if let Some(freezes) = &self.freezes {
            row("contact_ratio at the end", f64::INFINITY, "1", Some(&freezes.contact_ratio), 0);
        }
        if let Some(enough) = &self.enough {
            let least = enough.least_energy.as_ref();
            row("least pulse_energy for contact_ratio", enough.contact_ratio, "1", least, 0);
        }
        text
    }
}

/// The energy that is enough, in words.
fn enough(found: &EnoughEnergy) -> String {
    let (ratio, percent) =
        (significant(found.contact_ratio, 3), significant(100.0 * found.probability, 4));
    match (&found.energy, &found.least_energy) {
        (Some(0.0), _) => {
            format!("  a/R = {ratio} is reached with {percent} % probability by any pulse energy")
        }
        (Some(energy), Some(least)) => format!(
            "  a/R = {ratio} is reached with {percent} % probability by a pulse energy of {}; least energy {}",
            significant(*energy, 4),
            least.text("")
        ),
        (Some(energy), None) => format!(
            "  a/R = {ratio} is reached with {percent} % probability by a pulse energy of {}",
            significant(*energy, 4)
        ),
        (None, _) => {
            format!("  a/R = {ratio} is reached with {percent} % probability by no pulse energy")
        }
    }
}

/// A number of models in words.
fn models(count: usize) -> String {
    if count == 1 { "1 model".to_owned() } else { format!("{count} models") }
}
