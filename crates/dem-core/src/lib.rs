//! The discrete-element sintering simulator.
