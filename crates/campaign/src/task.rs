//! Tasks: runs to be made.

use serde::{Deserialize, Serialize};

use crate::seal;
use crate::spec::CampaignSpec;

/// One run: which command, with which parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Number of the run, unique in its campaign; the caller chooses it.
    pub number: u64,
    /// Place of the command in [`CampaignSpec::commands`].
    pub command: usize,
    /// Values of the parameters, in the order of [`CampaignSpec::parameter_names`].
    pub parameters: Vec<f64>,
}

impl CampaignSpec {
    /// Seed of the run `number`: 1 to 900 000 000, what LAMMPS and others take, and the same at
    /// every attempt.
    ///
    /// # Formula
    ///
    /// SplitMix64 of (seed of the campaign + golden ratio × (number + 1)), modulo 900 000 000, plus 1.
    #[must_use]
    pub fn seed_of(&self, number: u64) -> u64 {
        let step = 0x9e37_79b9_7f4a_7c15_u64;
        let mut z = self.seed.wrapping_add(number.wrapping_add(1).wrapping_mul(step));
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % 900_000_000 + 1
    }

    /// Checksum of the number, the parameters and everything in the command that can change the values of a run. A result
    /// belongs to a task only if they agree in it.
    pub(crate) fn fingerprint(&self, task: &Task) -> u64 {
        let mut digest = seal::Digest::new();
        digest.add(&task.number.to_le_bytes());
        for value in &task.parameters {
            digest.add(&value.to_bits().to_le_bytes());
        }
        digest.add(&self.seed.to_le_bytes());
        if let Some(command) = self.commands.get(task.command) {
            let call = &command.call;
            let what = (&self.parameter_names, &call.argv, &call.environment, &command.outputs);
            digest.add(serde_json::to_string(&what).unwrap_or_default().as_bytes());
            if call.worker {
                digest.add(b"worker");
            }
            if !call.files.is_empty() {
                digest.add(serde_json::to_string(&call.files).unwrap_or_default().as_bytes());
            }
        }
        digest.finish()
    }
}
