//! Computations of the Python module `handeye`.
//!
//! Python sources in `python/handeye` give it names, shapes and docstrings; here numbers become observations, and answers
//! become the documents that the command line writes. Arrays cross as bytes of doubles in the order of C, small things as
//! JSON.

#![expect(clippy::needless_pass_by_value, reason = "functions that Python calls own what they take")]

mod answer;
mod arm_of_views;
mod background;
mod clocks;
mod closed_form;
mod corrected;
mod error;
mod folder;
mod input;
mod numbers;

use pyo3::prelude::*;

/// The compiled part of `handeye`; use that.
#[pymodule]
mod _handeye {
    #[pymodule_export]
    use crate::answer::{calibrate, diagnose};
    #[pymodule_export]
    use crate::clocks::{of_streams, poses_at};
    #[pymodule_export]
    use crate::closed_form::by_name;
    #[pymodule_export]
    use crate::corrected::{CorrectedArm, read_result};
    #[pymodule_export]
    use crate::folder::read_folder;
    #[pymodule_export]
    use crate::input::{Observations, target_points};

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name that Python has for it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
