//! Bayesian calibration of simulators.
