//! A powder bed for the draws of a posterior, and what that says of its densification.

mod agreement;
mod beds;
mod curve;
mod draws;
mod freezing;
mod heat;
mod laws;
mod options;
mod page;
mod report;
mod spread;

use std::path::Path;
use std::time::Instant;

use dem_core::bed::{BedError, SinteringTable};
use figures::Width;
use serde_json::json;
use smc_calib::Parameter;

use crate::error::{Failure, RunError};
use crate::input::files_read::noted;
use crate::input::scene_file::{self, SceneInput};
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::page::FILE_NAME;
use crate::output::work_folder::{WorkFolder, fingerprint};
use crate::output::{Published, RunFolder, make_room, pretty};
use crate::pair::asked_heat::outside_energies;
use crate::pair::draws::PairDraws;
use crate::pair::heat::HeatPlan;
use crate::plan::pairs;
use crate::report::{NamedFigures, draw_all};
use crate::watch::Watch;
use beds::{Wanted, file_name};
use heat::BedHeat;
use report::FailedDraw;

pub use curve::{Band, Curve, Moment, Point, Target, TimeTo, crossing};
pub use draws::Draw;
pub use freezing::Freezing;
pub use laws::OtherLaw;
pub use options::DensifyOptions;
pub use report::{DensifyPlan, Report};
pub use spread::{Share, Spread};

/// The record of a densification.
pub const DENSIFY_RECORD: &str = crate::output::kinds::DENSIFICATION;

/// A scene and a posterior that were read and go together, and the folder that the results go to.
#[derive(Debug)]
pub struct DensifyJob {
    input: SceneInput,
    sintering: SinteringTable,
    calibrated: PairDraws,
    /// The parameters of the draws.
    parameters: Vec<Parameter>,
    draws: Vec<Draw>,
    plan: DensifyPlan,
    /// Everything that a bed depends on, the draw apart.
    bed_plan: String,
    advice: Vec<String>,
    inputs: Inputs,
    folder: RunFolder,
}

/// Beds that were computed and published.
#[derive(Debug)]
pub struct DensifyResult {
    /// Results.
    pub report: Report,
    /// How long the beds took \[s\].
    pub seconds: f64,
    /// Fate of an earlier run in the folder.
    pub published: Published,
}

impl DensifyJob {
    /// Reads and checks what the options name.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for files that are wrong or do not go together.
    pub fn read(options: &DensifyOptions) -> Result<Self, Failure> {
        let files = || {
            let calibrated = PairDraws::read_of(&options.posterior, options.of.as_deref())?;
            let input = scene_file::read(&options.scene)?;
            let heat = BedHeat::read(options, &calibrated, &input)?;
            // The heat of the beds is told by itself.
            Ok((calibrated, SceneInput { heat: None, ..input }, heat))
        };
        let (files, read) = noted(files);
        let (calibrated, input, heat) = files.map_err(|error: Failure| error)?;
        let target = agreement::target(options.target, &input)?;
        let posterior = &calibrated.record.plan;
        let kinetics = calibrated.pair.kinetics;
        let sintering = agreement::sintering(&options.posterior, kinetics, &input)?.clone();
        agreement::heated(&input)?;
        let used = match options.of {
            None => (0..posterior.parameters.len()).collect(),
            Some(_) => draws::used(&calibrated),
        };
        let named = |&place: &usize| posterior.parameters.get(place).cloned();
        let parameters = used.iter().filter_map(named).collect();
        let wanted = (options.draws, options.seed);
        let draws = draws::choose(&calibrated, &used, heat.as_ref(), wanted)?;
        let of_posterior = serde_json::to_string(posterior).map_err(RunError::new)?;
        let identity = format!("{of_posterior}\n{:?}", calibrated.columns);
        let plan = DensifyPlan {
            scene_name: input.file.name.clone(),
            scene: input.identity()?,
            posterior_name: posterior.name.clone(),
            posterior_fingerprint: format!("{:016x}", fingerprint(&identity)),
            kinetics,
            calibrated_radius_m: calibrated.pair.powder.radius_m,
            draws: options.draws,
            seed: options.seed,
            target,
            of: options.of.clone(),
            heat: heat.map(|heat| heat.plan),
            pulse_energy: options.pulse_energy,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let energy = plan.heat.as_ref().and_then(HeatPlan::energy);
        let mut advice = agreement::advice(&calibrated, &input);
        let pairs = pairs(&calibrated.record.plan.experiments).map(|(_, pair)| pair);
        advice.extend(energy.and_then(|energy| outside_energies(pairs, energy)));
        let mut bed_plan = json!({
            "scene": plan.scene, "posterior": plan.posterior_fingerprint, "draws": plan.draws,
            "seed": plan.seed, "version": plan.version,
        });
        if let Some(of) = &plan.of {
            bed_plan["of"] = json!(of);
        }
        if let Some(heat) = &plan.heat {
            bed_plan["heat"] = json!(heat);
        }
        let default = format!("{}-{}", input.folder_name(), posterior.name);
        let out = options.out.clone().unwrap_or_else(|| Path::new("results").join(default));
        Ok(Self {
            advice,
            folder: RunFolder::prepare(&out, DENSIFY_RECORD)?,
            bed_plan: bed_plan.to_string(),
            inputs: page::inputs(options, plan.heat.as_ref(), &read),
            input,
            sintering,
            calibrated,
            parameters,
            draws,
            plan,
        })
    }

    /// Reasons to be careful that are known before anything is computed.
    pub fn advice(&self) -> &[String] {
        &self.advice
    }

    /// Folder of the results.
    pub fn out(&self) -> &Path {
        self.folder.path()
    }

    /// The job as text, for a dry run.
    pub fn describe(&self) -> String {
        let plan = &self.plan;
        let mut lines = vec![format!(
            "densify: {} with {} draws of {}",
            plan.scene_name, plan.draws, plan.posterior_name
        )];
        lines.extend(self.input.describe().iter().map(|line| format!("  {line}")));
        let names: Vec<&str> = self.parameters.iter().map(|p| p.name.as_str()).collect();
        let radius_um = significant(1e6 * plan.calibrated_radius_m, 4);
        let (quantity, level) = (plan.target.name(), significant(plan.target.value(), 3));
        lines.push(format!(
            "  draws         {} instead of the scene's, tau_s at R = {radius_um} um",
            names.join(", ")
        ));
        if let Some(heat) = &plan.heat {
            lines.push(format!("  heat          {}", heat.in_words()));
        }
        lines.push(format!("  target        {quantity} {level}"));
        lines.push(format!("  results to    {}\n", self.out().display()));
        lines.join("\n")
    }

    /// Computes the beds and publishes the results.
    ///
    /// # Errors
    ///
    /// [`Failure`] with the reason; finished beds are kept for the same job.
    pub fn run(
        &self,
        threads: rayon::ThreadPool,
        watch: &dyn Watch,
    ) -> Result<DensifyResult, Failure> {
        let cores = threads.current_num_threads();
        let start = Instant::now();
        let work = WorkFolder::open(&self.folder, &self.bed_plan)?;
        work.mention_others(watch);
        let wanted = Wanted {
            input: &self.input,
            sintering: &self.sintering,
            calibrated: &self.calibrated,
            draws: &self.draws,
            target: self.plan.target,
            plan: &self.bed_plan,
        };
        let beds = wanted.beds(&self.out().join("series"), &work, threads, watch)?;
        let seconds = start.elapsed().as_secs_f64();
        let (computed, failed) = divide(&self.draws, beds);
        let parameters = self.parameters.iter().map(|parameter| parameter.name.clone()).collect();
        let about = (self.other_laws(&wanted, &computed)?, self.advice.clone());
        let freezes = Freezing::of(&computed, self.plan.target, &self.input);
        let report = Report::new(self.plan.clone(), parameters, &computed, failed, freezes, about);

        let staging = self.folder.stage()?;
        let write =
            |name: &str, bytes: &[u8]| staging.write(self.out(), name, bytes).map_err(make_room);
        write(DENSIFY_RECORD, pretty(&report)?.as_bytes())?;
        write("densify.csv", report.curve_csv().as_bytes())?;
        let units: Vec<&str> = self.parameters.iter().map(|one| one.unit.as_str()).collect();
        write("draws.csv", report.draws_csv(&units).as_bytes())?;
        let figures: NamedFigures = vec![("densify".to_owned(), Box::new(report.figure()))];
        let drawn = draw_all(&figures, Width::Column, &write)?;
        self.inputs.write(&write)?;
        let page = page::page(&report, &self.input.describe(), &drawn, &self.inputs);
        write(FILE_NAME, page.html()?.as_bytes())?;
        for (draw, curve) in &computed {
            write(&format!("series/{}", file_name(draw)), wanted.file(draw, curve).as_bytes())?;
        }
        let timings = json!({ "threads": cores, "seconds": seconds });
        write("timings.json", pretty(&timings)?.as_bytes())?;
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        let published = staging.publish()?;
        if report.failed.is_empty() {
            work.finish();
        }
        Ok(DensifyResult { report, seconds, published })
    }
}

impl DensifyJob {
    /// What other laws say of the beds that were computed.
    fn other_laws(
        &self,
        wanted: &Wanted<'_>,
        computed: &[(Draw, Curve)],
    ) -> Result<Vec<OtherLaw>, Failure> {
        let radius_m = self.input.outline.mean_radius_m;
        let refused = |error| Failure::from(scene_file::refused(&self.input.place, &error));
        let mut draws = Vec::with_capacity(computed.len());
        for (draw, curve) in computed {
            let mut file = self.input.file.clone();
            let (growing, phi) = wanted.growing(draw);
            file.material.final_contact_ratio = phi.unwrap_or(file.material.final_contact_ratio);
            let pair = file.pair_of_radius(radius_m).map_err(refused)?;
            draws.push((pair, growing, draw.heat.as_ref(), curve));
        }
        Ok(laws::other_laws(self.plan.target, &draws))
    }
}

/// Draws with a bed, and draws without one.
fn divide(
    draws: &[Draw],
    beds: Vec<Result<Curve, BedError>>,
) -> (Vec<(Draw, Curve)>, Vec<FailedDraw>) {
    let (mut computed, mut failed) = (Vec::new(), Vec::new());
    for (draw, outcome) in draws.iter().zip(beds) {
        match outcome {
            Ok(curve) => computed.push((draw.clone(), curve)),
            Err(error) => failed.push(FailedDraw { draw: draw.clone(), reason: error.to_string() }),
        }
    }
    (computed, failed)
}
