//! The native part of the Python module `calibrate`: the workbench library under functions that take and give plain Python
//! values. The module's own Python code, in `python/calibrate`, makes of them what a user meets.

mod curves;
mod failures;
mod job;
mod runs;
mod watching;

/// Native part of the module `calibrate`.
#[pyo3::pymodule]
mod _calibrate {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::curves::{check_prior, contact_ratios, material};
    #[pymodule_export]
    use crate::failures::{InputMistake, RunFailed};
    #[pymodule_export]
    use crate::runs::{
        calibrate_function, calibrate_pair, export, groups, init, predict, read, simulated,
    };

    #[pymodule_init]
    fn init_module(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
