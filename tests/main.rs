//! The command `calibrate` from end to end, each test in a folder of its own.

mod sandbox;

mod architecture;
mod archive;
mod bad_input;
mod bits;
mod browser;
mod campaign;
mod clock;
mod compare;
mod damage;
mod determinism;
mod diff;
mod exports;
mod files;
mod first_hour;
mod guide;
mod heat;
mod hostile;
mod lammps;
mod main_job;
mod noise;
mod plot;
mod pointers;
mod population;
mod predict;
mod readme;
mod report;
mod results;
mod scene_words;
mod scenes;
mod simulate;
mod spring;
mod table3;
mod validate;
mod work_counters;
