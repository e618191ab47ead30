//! A cluster as the executor uses it.

use super::client::Client;
use super::settings::SlurmSettings;

/// How runs are submitted, by which commands, and what an array element calls.
#[derive(Debug, Clone)]
pub(super) struct Cluster {
    pub(super) settings: SlurmSettings,
    /// The program of an array element, with its first arguments.
    pub(super) worker: Vec<String>,
    pub(super) client: Client,
}
