//! Two calibrations side by side: what differs in their plans, and what that did to each parameter and to the evidence.

mod numbers;
mod plans;
mod text;

use figures::Width;

use crate::error::Failure;
use crate::output::page::FILE_NAME;
use crate::output::{Published, RunFolder, pretty};
use crate::report::draw_all;

pub use numbers::{Compared, Diff, DiffPlan, EvidenceBeside, Moved, compare};
pub use plans::Difference;
pub use text::text;

/// The record of a comparison of two runs.
pub const RECORD: &str = crate::output::kinds::DIFFERENCE;

impl Compared {
    /// Writes the folder of the comparison.
    ///
    /// # Errors
    ///
    /// [`Failure::Run`] for a file that cannot be written; nothing has been published then.
    pub fn publish(&self, folder: &RunFolder) -> Result<Published, Failure> {
        let staging = folder.stage()?;
        let write = |name: &str, bytes: &[u8]| staging.write(folder.path(), name, bytes);
        write(RECORD, pretty(&self.diff)?.as_bytes())?;
        self.inputs.write(&write)?;
        let drawn = draw_all(&self.figures, Width::Full, &write)?;
        let page = text::page(&self.diff, &drawn, &self.inputs);
        write(FILE_NAME, page.html()?.as_bytes())?;
        Ok(staging.publish()?)
    }
}
