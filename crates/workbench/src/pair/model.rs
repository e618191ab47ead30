//! The pair simulator as the sampler sees it: from a parameter vector to contact ratios at the
//! observation times.

use std::borrow::Cow;

use dem_core::heat::{Heat, HeatError};
use dem_core::{
    Kinetics, PairScene, PairSpec, Powder, Sintering, SolveError, SolverKind, SolverSettings,
    contact_ratios, heated_contact_ratios, verlet_batch,
};
use rayon::prelude::*;
use smc_calib::{Parameter, SimError, Simulator};

use crate::error::{InputError, Mistake};
use crate::pair::heat::{HeatPlan, NoHeat};
use crate::pair::parameter::ParameterName;
use crate::plan::{PairPlan, Plan};

/// Neck growth of a pair of particles at given times, as a function of the parameter vector of a plan.
#[derive(Debug, Clone)]
pub struct NeckGrowth {
    /// Length of a parameter vector.
    parameters: usize,
    /// Place of each of the model's parameters in it, in the order of [`ParameterName::ALL`].
    places: [Option<usize>; ParameterName::ALL.len()],
    /// Factor from the calibrated tau_s to that of this pair.
    tau_s_factor: f64,
    powder: Powder,
    scene: PairScene,
    kinetics: Kinetics,
    solver: SolverSettings,
    times_s: Vec<f64>,
    /// Time of first contact in the clock of the times \[s\], where it is not calibrated.
    start_s: f64,
    heat: Heating,
}

/// The heat of a model.
#[derive(Debug, Clone)]
enum Heating {
    /// One temperature, that of C1 and tau_s.
    None,
    /// Known, whatever the parameters.
    Known(Heat),
    /// With numbers that are calibrated.
    Open(HeatPlan),
}

impl NeckGrowth {
    /// The model of a planned pair at times \[s\], sorted and not negative; `parameters` are those of the plan.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a powder that no scene can be built of.
    pub fn new(
        pair: &PairPlan,
        parameters: &[Parameter],
        times_s: Vec<f64>,
    ) -> Result<Self, InputError> {
        let place = |model: ParameterName| {
            let taken = !model.is_of_heat() || pair.takes(model);
            parameters.iter().position(|p| taken && p.name == pair.calibrated(model))
        };
        let places = ParameterName::ALL.map(place);
        let open = |name: &ParameterName| name.is_of_heat() && places[*name as usize].is_some();
        let heat = match &pair.heat {
            None => Heating::None,
            Some(heat) if ParameterName::ALL.iter().any(open) => Heating::Open(heat.clone()),
            Some(heat) => {
                let known = heat.at(pair.powder.radius_m, |_| None);
                Heating::Known(known.map_err(|error| {
                    InputError::new(&pair.experiment, Mistake::MissingField)
                        .in_field("heat")
                        .found(error)
                        .help("state it in [heat], or give it a prior")
                })?)
            }
        };
        Ok(Self {
            parameters: parameters.len(),
            places,
            tau_s_factor: pair.tau_s_radius_m.map_or(1.0, |radius| pair.powder.radius_m / radius),
            powder: pair.powder,
            scene: pair.scene()?,
            kinetics: pair.kinetics,
            solver: pair.solver.settings(),
            times_s,
            start_s: 0.0,
            heat,
        })
    }

    /// The model of a plan with one pair, at its observation times.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a plan of something else.
    pub fn of(plan: &Plan) -> Result<Self, InputError> {
        let (pair, observable) = plan.pair()?;
        Self::new(pair, &plan.parameters, observable.control.clone())
    }

    /// The same model at other times \[s\], sorted and not negative.
    pub fn at_times(&self, times_s: Vec<f64>) -> Self {
        Self { times_s, ..self.clone() }
    }

    /// The same model with other kinetics. Parameters that these do not use are ignored.
    pub fn with_kinetics(&self, kinetics: Kinetics) -> Self {
        Self { kinetics, ..self.clone() }
    }

    /// The same model with first contact at a time \[s\] of the clock of its times, where t0 is not calibrated.
    pub fn started_at(&self, start_s: f64) -> Self {
        Self { start_s, ..self.clone() }
    }

    /// The same model with the heat of a parameter vector, where it is calibrated.
    pub fn heated_as(&self, theta: &[f64]) -> Self {
        let heat = match self.heat(theta) {
            Ok(Some(heat)) => Heating::Known(heat.into_owned()),
            _ => Heating::None,
        };
        Self { heat, ..self.clone() }
    }

    /// The heat at a parameter vector; none for one temperature.
    ///
    /// # Errors
    ///
    /// A recoverable [`SimError`] for numbers that no heat has.
    pub fn heat(&self, theta: &[f64]) -> Result<Option<Cow<'_, Heat>>, SimError> {
        match &self.heat {
            Heating::None => Ok(None),
            Heating::Known(heat) => Ok(Some(Cow::Borrowed(heat))),
            Heating::Open(plan) => {
                let value = |name| self.place(name).map(|place| theta[place]);
                let heat = plan.at(self.powder.radius_m, value);
                heat.map(|heat| Some(Cow::Owned(heat))).map_err(|error| no_heat(&error))
            }
        }
    }

    /// Contact ratio at which a pair of a parameter vector stops growing as its heat ends; none where it has no heat, or one
    /// without an end.
    ///
    /// # Errors
    ///
    /// [`SimError`] as [`Simulator::simulate`].
    pub fn frozen_contact_ratio(&self, theta: &[f64]) -> Result<Option<f64>, SimError> {
        let Some(heat) = self.heat(theta)? else { return Ok(None) };
        let end = heat.reduced_time_at_end();
        if !end.is_finite() {
            return Ok(None);
        }
        let exact = SolverSettings::of(SolverKind::ClosedForm);
        let (scene, sintering, mut out) = (self.scene(theta)?, self.sintering(theta), [0.0]);
        contact_ratios(&scene, self.kinetics, &sintering, &exact, &[end], &mut out)
            .map_err(|error| failure(&error))?;
        Ok(Some(out[0]))
    }

    /// The observation times \[s\].
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The last observation, after first contact where t0 is not calibrated \[s\]; negative infinity without observations.
    pub fn last_s(&self) -> f64 {
        self.times_s.last().map_or(f64::NEG_INFINITY, |last| last - self.start_s)
    }

    /// Place of one of the model's parameters in a parameter vector, where it is calibrated.
    pub fn place(&self, parameter: ParameterName) -> Option<usize> {
        self.places[parameter as usize]
    }

    /// The model's parameter at a place of a parameter vector.
    pub fn name(&self, place: usize) -> Option<ParameterName> {
        ParameterName::ALL.into_iter().find(|parameter| self.place(*parameter) == Some(place))
    }

    /// Sintering parameters at a parameter vector; those that are not calibrated are 1, lambda 0.
    pub fn sintering(&self, theta: &[f64]) -> Sintering {
        let value = |name| self.place(name).map_or(1.0, |place| theta[place]);
        Sintering {
            c1: value(ParameterName::C1),
            tau_s: value(ParameterName::TauS) * self.tau_s_factor,
            delta_c: value(ParameterName::DeltaC),
            lambda: self.place(ParameterName::Lambda).map_or(0.0, |place| theta[place]),
        }
    }

    /// The scene at a parameter vector: the plan's, unless phi is calibrated.
    ///
    /// # Errors
    ///
    /// A recoverable [`SimError`] for a phi without a scene.
    pub fn scene(&self, theta: &[f64]) -> Result<Cow<'_, PairScene>, SimError> {
        match self.place(ParameterName::Phi) {
            None => Ok(Cow::Borrowed(&self.scene)),
            Some(place) => PairSpec::new(self.powder, theta[place])
                .build()
                .map(Cow::Owned)
                .map_err(|_| SimError::recoverable("phi is out of the model's range")),
        }
    }

    /// Time of first contact \[s\] at a parameter vector, in the clock of the times.
    pub fn start_s(&self, theta: &[f64]) -> f64 {
        self.place(ParameterName::T0).map_or(self.start_s, |place| theta[place])
    }

    /// The curve of given sintering parameters at the plan's phi, and under its heat where that is known.
    ///
    /// # Errors
    ///
    /// [`SimError`] as [`Simulator::simulate`].
    pub fn curve(&self, sintering: &Sintering, out: &mut [f64]) -> Result<(), SimError> {
        let heat = match &self.heat {
            Heating::Known(heat) => Some(heat),
            Heating::None | Heating::Open(_) => None,
        };
        self.run((&self.scene, heat), sintering, self.start_s, out)
    }

    fn run(
        &self,
        (scene, heat): (&PairScene, Option<&Heat>),
        sintering: &Sintering,
        start_s: f64,
        out: &mut [f64],
    ) -> Result<(), SimError> {
        let (times_s, law) = (self.since(start_s), (self.kinetics, sintering));
        match heat {
            None => contact_ratios(scene, law.0, law.1, &self.solver, &times_s, out),
            Some(heat) => heated_contact_ratios(scene, law, heat, &self.solver, &times_s, out),
        }
        .map(|_| ())
        .map_err(|error| failure(&error))
    }

    /// Times after first contact \[s\]: zero, where the contact has its starting value, until it happens.
    fn since(&self, start_s: f64) -> Cow<'_, [f64]> {
        if start_s == 0.0 {
            return Cow::Borrowed(&self.times_s);
        }
        Cow::Owned(self.times_s.iter().map(|time| (time - start_s).max(0.0)).collect())
    }

    /// Curves of many parameter vectors, row by row, in parallel; those of the Verlet solver side by side in the lanes of
    /// the processor's vectors, with the same bits as [`Simulator::simulate`]. `go_on` is asked before every curve; after
    /// `false` it is not computed and is [`SimError::Interrupted`].
    pub fn curves(
        &self,
        thetas: &[f64],
        outputs: &mut [f64],
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Vec<Result<(), SimError>> {
        let (d, m) = (self.parameters, self.times_s.len());
        let (count, threads) = (thetas.len() / d, rayon::current_num_threads());
        // With another phi or another start for every curve there is no one scene, or no one set of times.
        let alike =
            [ParameterName::Phi, ParameterName::T0].map(|name| self.place(name)) == [None; 2];
        let lanes = self.solver.kind == SolverKind::Verlet
            && alike
            && self.start_s == 0.0
            && matches!(self.heat, Heating::None);
        // Many curves to a lane, so that no lane waits long for the last one.
        let rows = if lanes {
            (count / (2 * threads)).clamp(8, 64)
        } else {
            (count / (8 * threads)).clamp(1, 16)
        };
        thetas
            .par_chunks(rows * d)
            .zip(outputs.par_chunks_mut(rows * m))
            .flat_map_iter(|(thetas, outputs)| {
                let each = thetas.chunks_exact(d);
                if lanes {
                    if !each.clone().all(|_| go_on()) {
                        return vec![Err(SimError::Interrupted); each.len()];
                    }
                    return self.verlet_curves(thetas, outputs);
                }
                each.zip(outputs.chunks_exact_mut(m))
                    .map(|(theta, out)| match go_on() {
                        true => self.simulate(theta, out),
                        false => Err(SimError::Interrupted),
                    })
                    .collect()
            })
            .collect()
    }

    fn verlet_curves(&self, thetas: &[f64], outputs: &mut [f64]) -> Vec<Result<(), SimError>> {
        let sinterings: Vec<Sintering> =
            thetas.chunks_exact(self.parameters).map(|theta| self.sintering(theta)).collect();
        let (scene, times_s) = (&self.scene, &self.times_s);
        verlet_batch(scene, self.kinetics, &sinterings, &self.solver, times_s, outputs)
            .unwrap_or_else(|error| vec![Err(error); sinterings.len()])
            .into_iter()
            .map(|result| result.map(|_| ()).map_err(|error| failure(&error)))
            .collect()
    }
}

/// Numbers that no heat has, in words that are the same for the same kind of failure.
fn no_heat(error: &NoHeat) -> SimError {
    match error {
        NoHeat::OutOfRange(HeatError::Field { field, .. }) => {
            SimError::recoverable(format!("{field} of the heat is out of the model's range"))
        }
        NoHeat::Threshold { .. } => {
            SimError::recoverable("the threshold energy is not below the reference energy")
        }
        other => SimError::fatal(other.to_string()),
    }
}

/// A curve's failure as the sampler sees it.
fn failure(error: &SolveError) -> SimError {
    if error.is_recoverable() {
        SimError::recoverable(cause(error))
    } else {
        SimError::fatal(error.to_string())
    }
}

/// A cause in words that are the same for the same kind of failure, so that failures can be counted.
fn cause(error: &SolveError) -> String {
    match error {
        SolveError::Field { field, .. } => format!("{field} is out of the model's range"),
        SolveError::Derived { quantity, .. } => {
            format!("{quantity} does not fit into a number")
        }
        SolveError::WorkLimit { solver, max_work, .. } => {
            format!("the {solver} solver needs more than {max_work} steps")
        }
        other => other.to_string(),
    }
}

impl Simulator for NeckGrowth {
    fn parameters(&self) -> usize {
        self.parameters
    }

    fn observables(&self) -> usize {
        self.times_s.len()
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let (scene, heat) = (self.scene(theta)?, self.heat(theta)?);
        self.run((&scene, heat.as_deref()), &self.sintering(theta), self.start_s(theta), out)
    }

    fn simulate_batch(
        &self,
        _: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        self.curves(thetas, outputs, &|| true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places without those of a heat.
    fn places(first: [Option<usize>; 6]) -> [Option<usize>; ParameterName::ALL.len()] {
        std::array::from_fn(|place| first.get(place).copied().flatten())
    }

    #[test]
    fn curves_by_lanes_are_those_one_by_one_to_the_bit_and_so_are_failures() {
        let powder = dem_core::paper::PS;
        let model = NeckGrowth {
            parameters: 3,
            places: places([Some(0), Some(1), Some(2), None, None, None]),
            heat: Heating::None,
            tau_s_factor: 1.0,
            powder,
            scene: PairSpec::new(powder, 1.08).build().expect("a scene"),
            kinetics: Kinetics::ThreeStage,
            solver: SolverSettings { max_work: 10_000, ..SolverSettings::of(SolverKind::Verlet) },
            times_s: vec![0.0, 0.01, 0.03, 0.08, 0.5],
            start_s: 0.0,
        };
        let (rows, m) = (197, model.observables());
        let thetas: Vec<f64> = (0..rows)
            .flat_map(|i| {
                let u = |step: f64| (i as f64 * step).fract();
                [10f64.powf(-6.0 + 5.0 * u(0.618)), 10f64.powf(-2.0 + 2.0 * u(0.755)), 2e-7]
            })
            .chain([f64::NAN, 0.07, 2e-7])
            .collect();
        let mut together = vec![0.0; thetas.len() / 3 * m];
        let found = model.simulate_batch(0, &thetas, &mut together);
        let mut failed = 0;
        for ((theta, row), result) in
            thetas.chunks_exact(3).zip(together.chunks_exact(m)).zip(&found)
        {
            let mut alone = vec![0.0; m];
            assert_eq!(*result, model.simulate(theta, &mut alone), "{theta:?}");
            match result {
                Ok(()) => assert_eq!(row, alone, "{theta:?}"),
                Err(_) => failed += 1,
            }
        }
        let stopped = model.curves(&thetas, &mut together, &|| false);
        assert!(stopped.iter().all(|result| *result == Err(SimError::Interrupted)));
        assert!(failed > 1 && failed < rows, "{failed} of {rows} failed");
    }

    #[test]
    fn phi_as_a_fourth_parameter_moves_the_plateau_and_nothing_before_it() {
        let model = NeckGrowth {
            parameters: 2,
            places: places([None, Some(0), None, None, Some(1), None]),
            heat: Heating::None,
            tau_s_factor: 1.0,
            powder: dem_core::paper::PS,
            scene: PairSpec::new(dem_core::paper::PS, 1.2).build().expect("a scene"),
            kinetics: Kinetics::Frenkel,
            solver: SolverSettings::of(SolverKind::ClosedForm),
            times_s: vec![0.01, 10.0],
            start_s: 0.0,
        };
        let mut low = [0.0; 2];
        let mut high = [0.0; 2];
        model.simulate(&[0.07, 1.05], &mut low).expect("a curve");
        model.simulate(&[0.07, 1.25], &mut high).expect("a curve");
        assert_eq!(low[0], high[0]);
        assert!((low[1] - 1.05).abs() < 1e-12 && (high[1] - 1.25).abs() < 1e-12);
    }

    #[test]
    fn growth_begins_at_t0_under_every_kinetics_and_solver_and_rows_before_have_the_starting_value()
    {
        let scene = PairSpec::new(dem_core::paper::PA12, 1.26).build().expect("a scene");
        let from_contact = NeckGrowth {
            parameters: 4,
            places: places([Some(0), Some(1), Some(2), None, None, None]),
            heat: Heating::None,
            tau_s_factor: 1.0,
            powder: dem_core::paper::PA12,
            kinetics: Kinetics::ThreeStage,
            solver: SolverSettings::of(SolverKind::ClosedForm),
            times_s: vec![0.0, 0.0, 0.0, 0.5, 3.0],
            start_s: 0.0,
            scene,
        };
        let in_the_clock = NeckGrowth {
            places: places([Some(0), Some(1), Some(2), None, None, Some(3)]),
            times_s: vec![0.0, 1.0, 2.0, 2.5, 5.0],
            ..from_contact.clone()
        };
        for kinetics in Kinetics::ALL {
            for kind in [SolverKind::ClosedForm, SolverKind::QuasiStatic, SolverKind::Verlet] {
                // Slow sintering is beyond what a test can wait for with inertia; the last row is enough there.
                let solver = SolverSettings { max_work: 10_000_000, ..SolverSettings::of(kind) };
                let of = |model: &NeckGrowth| {
                    let mut rows = [0.0; 5];
                    let model = NeckGrowth { kinetics, solver, ..model.clone() };
                    let done = model.simulate_batch(0, &[3e-4, 3.9, 1e-7, 2.0], &mut rows);
                    (done, rows)
                };
                let (shifted, at_contact) = (of(&in_the_clock), of(&from_contact));
                assert_eq!(shifted, at_contact, "{kinetics} {kind}");
                if shifted.0[0].is_ok() {
                    assert_eq!(shifted.1[0], shifted.1[2], "{kinetics} {kind}");
                    assert!(shifted.1[4] > 0.3, "{kinetics} {kind}: {:?}", shifted.1);
                }
            }
        }
    }
}
