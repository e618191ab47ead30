//! Many particles through the phases of a scene file.
//!
//! Unfinished work is in a `WorkFolder`, from which the same scene goes on with the same bits.

mod compute;
mod page;
mod picture;
mod record;

use std::path::{Path, PathBuf};
use std::time::Instant;

use dem_core::bed::write_csv;
use dem_core::heat::Heat;
use figures::{BedFigure, Width};
use serde_json::json;

use crate::error::{Failure, RunError};
use crate::input::files_read::noted;
use crate::input::scene_file::{self, SceneInput, table_of};
use crate::output::inputs::Inputs;
use crate::output::page::{Drawn, FILE_NAME};
use crate::output::work_folder::WorkFolder;
use crate::output::{Published, RunFolder, make_room, pretty};
use crate::report::draw_all;
use crate::watch::Watch;
use compute::{Computed, compute, vtk_name};
use picture::{bed_figure, colour_range, series_figure};

pub use record::{
    PhaseRecord, RatesRecord, SCHEMA_VERSION, ScenePlan, SceneRecord, State, WorkRecord,
};

/// The record of a scene that ran.
pub const SCENE_RECORD: &str = crate::output::kinds::SCENE;

/// A scene that was read, and the folder that its results go to.
#[derive(Debug)]
pub struct SceneJob {
    input: SceneInput,
    heat: Option<Heat>,
    plan: ScenePlan,
    inputs: Inputs,
    folder: RunFolder,
}

/// A scene that has run and is published.
#[derive(Debug)]
pub struct SceneResult {
    /// Results.
    pub record: SceneRecord,
    /// How long the run took \[s\].
    pub seconds: f64,
    /// Fate of an earlier run in the folder.
    pub published: Published,
}

impl SceneJob {
    /// Reads and checks a scene. Results go to `out`, or to `results/NAME` of the scene; with `vtk` a VTK file is written
    /// at every observation.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for a scene that does not hold together or a folder that cannot be written.
    pub fn read(file: &Path, out: Option<PathBuf>, vtk: bool) -> Result<Self, Failure> {
        let (input, read) = noted(|| scene_file::read(file));
        let input = input?;
        let (heat_plan, heat) = input.stated_heat()?.unzip();
        let out = out.unwrap_or_else(|| Path::new("results").join(input.folder_name()));
        let plan = ScenePlan {
            name: input.file.name.clone(),
            scene: input.identity()?,
            heat: heat_plan,
            vtk,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let files = [(page::SCENE, file.to_owned())];
        let inputs = Inputs::of(files.into_iter().chain(table_of(plan.heat.as_ref())), None, &read);
        Ok(Self { input, heat, plan, inputs, folder: RunFolder::prepare(&out, SCENE_RECORD)? })
    }

    /// Plan of the scene, which decides the result.
    pub fn plan(&self) -> &ScenePlan {
        &self.plan
    }

    /// Folder of the results.
    pub fn out(&self) -> &Path {
        self.folder.path()
    }

    /// The job as text, for a dry run.
    pub fn describe(&self) -> String {
        let mut lines = vec![format!("scene: {}", self.plan.name)];
        lines.extend(self.input.describe().iter().map(|line| format!("  {line}")));
        lines.push(format!("  results to    {}\n", self.out().display()));
        lines.join("\n")
    }

    /// Runs the scene and publishes its results.
    ///
    /// # Errors
    ///
    /// [`Failure`] with the reason; work done so far is kept for the same scene.
    pub fn run(
        &self,
        threads: rayon::ThreadPool,
        watch: &dyn Watch,
    ) -> Result<SceneResult, Failure> {
        let cores = threads.current_num_threads();
        let start = Instant::now();
        let plan = serde_json::to_string(&self.plan).map_err(RunError::new)?;
        let work = WorkFolder::open(&self.folder, &plan)?;
        work.mention_others(watch);
        let computed = compute((&self.input, &self.heat), self.plan.vtk, &work, threads, watch);
        watch.end();
        let computed = computed?;
        let seconds = start.elapsed().as_secs_f64();
        let record =
            SceneRecord::new(&self.input, self.plan.clone(), &computed.run, self.heat.as_ref());
        let timings = json!({ "threads": cores, "seconds": seconds });
        let published = self.publish(&record, computed, &work, &pretty(&timings)?, watch)?;
        work.finish();
        Ok(SceneResult { record, seconds, published })
    }

    fn publish(
        &self,
        record: &SceneRecord,
        computed: Computed,
        work: &WorkFolder,
        timings: &str,
        watch: &dyn Watch,
    ) -> Result<Published, Failure> {
        let Computed { run, first } = computed;
        let name = &self.input.file.name;
        let staging = self.folder.stage()?;
        let write =
            |name: &str, bytes: &[u8]| staging.write(self.out(), name, bytes).map_err(make_room);
        write(SCENE_RECORD, pretty(record)?.as_bytes())?;
        let mut csv = Vec::new();
        write_csv(run.series(), &mut csv).map_err(RunError::new)?;
        write("series.csv", &csv)?;
        let failed = |error| RunError::new(format_args!("figure: {error}"));
        let series = series_figure(name, run.series(), &self.input.file.phases);
        let named = vec![("series".to_owned(), Box::new(series) as _)];
        let mut drawn = draw_all(&named, Width::Column, &write)?;
        let last = bed_figure(run.bed(), name);
        for (name, figure) in [("bed-start", first), ("bed", last)] {
            let range = colour_range(&figure);
            let png = BedFigure { range, ..figure }.png(Width::Column).map_err(failed)?;
            write(&format!("{name}.png"), &png)?;
            drawn.push(Drawn::of_png(name, png));
        }
        for number in (0..run.series().samples.len()).filter(|_| self.plan.vtk) {
            let name = vtk_name(number);
            let frame = work.get(&name).ok_or_else(|| {
                RunError::new(format_args!("{name} of the unfinished run is gone"))
                    .help("run the command again")
            })?;
            write(&format!("vtk/{name}"), &frame)?;
        }
        self.inputs.write(&write)?;
        let page = page::page(record, &self.input.describe(), &drawn, &self.inputs);
        write(FILE_NAME, page.html()?.as_bytes())?;
        write("timings.json", timings.as_bytes())?;
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        Ok(staging.publish()?)
    }
}
