//! Runs of a pair: arguments checked, the solver chosen by name.

use super::{
    ClosedForm, Curve, PairRun, PairSolver, QuasiStatic, SolveReport, SolverKind, SolverSettings,
    Verlet,
};
use crate::heat::{Heat, Isothermal, Pace};
use crate::kinetics::{WithLaw, with_law};
use crate::{Kinetic, Kinetics, PairScene, Sintering, SolveError};

pub(super) fn check_times(times_s: &[f64]) -> Result<(), SolveError> {
    if times_s.is_empty() {
        return Err(SolveError::NoTimes);
    }
    let mut previous = 0.0;
    for (index, &value) in times_s.iter().enumerate() {
        if !(value >= previous && value < f64::INFINITY) {
            return Err(if !(value.is_finite() && value >= 0.0) {
                SolveError::Time { index, value }
            } else {
                SolveError::UnsortedTimes { index, value, previous }
            });
        }
        previous = value;
    }
    Ok(())
}

/// A run whose law is a name.
struct Named<'a, P> {
    scene: &'a PairScene,
    law: (Kinetics, &'a Sintering),
    pace: P,
    settings: &'a SolverSettings,
    times_s: &'a [f64],
}

impl<P: Pace> Named<'_, P> {
    fn contact_ratios(self, out: &mut [f64]) -> Result<SolveReport, SolveError> {
        check_times(self.times_s)?;
        if out.len() != self.times_s.len() {
            return Err(SolveError::OutputLength { out: out.len(), times: self.times_s.len() });
        }
        with_law(self.law.0, Ratios { of: self, out })
    }

    fn simulate(self) -> Result<Curve, SolveError> {
        check_times(self.times_s)?;
        let (scene, times_s) = (self.scene, self.times_s);
        let mut overlap = vec![0.0; times_s.len()];
        let mut plastic_overlap = vec![0.0; times_s.len()];
        let (kinetics, plastic) = (self.law.0, &mut plastic_overlap);
        let report = with_law(kinetics, Overlaps { of: self, overlap: &mut overlap, plastic })?;
        let (end, phi) = (scene.final_overlap(), scene.final_contact_ratio());
        let contact_ratio =
            overlap.iter().map(|&x| if x == end { phi } else { x.sqrt() }).collect();
        let radius_m = scene.radius_m();
        let metres = |overlaps: Vec<f64>| overlaps.into_iter().map(|x| x * radius_m).collect();
        Ok(Curve {
            time_s: times_s.to_vec(),
            overlap_m: metres(overlap),
            plastic_overlap_m: metres(plastic_overlap),
            contact_ratio,
            report,
        })
    }
}

struct Ratios<'a, P> {
    of: Named<'a, P>,
    out: &'a mut [f64],
}

impl<P: Pace> WithLaw for Ratios<'_, P> {
    type Output = Result<SolveReport, SolveError>;
    fn run<K: Kinetic>(self) -> Self::Output {
        let Self { of: Named { scene, law, pace, settings, times_s }, out } = self;
        let law = &K::new(scene, law.1)?;
        let run = PairRun { scene, law, pace, times_s };
        match settings.kind {
            SolverKind::ClosedForm => ClosedForm.contact_ratios(&run, out),
            SolverKind::QuasiStatic => QuasiStatic::new(settings)?.contact_ratios(&run, out),
            SolverKind::Verlet => Verlet::new(scene, settings)?.contact_ratios(&run, out),
        }
    }
}

struct Overlaps<'a, P> {
    of: Named<'a, P>,
    overlap: &'a mut [f64],
    plastic: &'a mut [f64],
}

impl<P: Pace> WithLaw for Overlaps<'_, P> {
    type Output = Result<SolveReport, SolveError>;
    fn run<K: Kinetic>(self) -> Self::Output {
        let Self { of: Named { scene, law, pace, settings, times_s }, overlap, plastic } = self;
        let law = &K::new(scene, law.1)?;
        let run = PairRun { scene, law, pace, times_s };
        match settings.kind {
            SolverKind::ClosedForm => ClosedForm.overlaps(&run, overlap, plastic),
            SolverKind::QuasiStatic => QuasiStatic::new(settings)?.overlaps(&run, overlap, plastic),
            SolverKind::Verlet => Verlet::new(scene, settings)?.overlaps(&run, overlap, plastic),
        }
    }
}

/// Contact ratios a/R at sorted times \[s\], written to `out`.
///
/// The hot path of a calibration: with the closed form nothing is allocated.
///
/// # Errors
///
/// A [`SolveError`] that names the parameter, setting or time.
pub fn contact_ratios(
    scene: &PairScene,
    kinetics: Kinetics,
    sintering: &Sintering,
    settings: &SolverSettings,
    times_s: &[f64],
    out: &mut [f64],
) -> Result<SolveReport, SolveError> {
    let law = (kinetics, sintering);
    Named { scene, law, pace: Isothermal, settings, times_s }.contact_ratios(out)
}

/// [`contact_ratios`] under a heat, to which the parameters are those of m = 1.
///
/// The closed form is taken at the reduced times; the solvers with steps have m in the rates.
///
/// # Errors
///
/// Same as [`contact_ratios`].
pub fn heated_contact_ratios(
    scene: &PairScene,
    law: (Kinetics, &Sintering),
    heat: &Heat,
    settings: &SolverSettings,
    times_s: &[f64],
    out: &mut [f64],
) -> Result<SolveReport, SolveError> {
    Named { scene, law, pace: heat.pace(), settings, times_s }.contact_ratios(out)
}

/// The curve at sorted times \[s\].
///
/// # Errors
///
/// A [`SolveError`] that names the parameter, setting or time.
pub fn simulate(
    scene: &PairScene,
    kinetics: Kinetics,
    sintering: &Sintering,
    settings: &SolverSettings,
    times_s: &[f64],
) -> Result<Curve, SolveError> {
    let law = (kinetics, sintering);
    Named { scene, law, pace: Isothermal, settings, times_s }.simulate()
}

/// [`simulate`] under a heat.
///
/// # Errors
///
/// Same as [`simulate`].
pub fn simulate_heated(
    scene: &PairScene,
    law: (Kinetics, &Sintering),
    heat: &Heat,
    settings: &SolverSettings,
    times_s: &[f64],
) -> Result<Curve, SolveError> {
    Named { scene, law, pace: heat.pace(), settings, times_s }.simulate()
}
