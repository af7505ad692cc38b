//! All end-to-end tests in one program, which is linked once.
//!
//! `slow` is what the fast tier (`./test fast`) leaves out: real-time sequences, desktops, browsers, the long fuzz.

mod auto;
mod command_line;
mod exports;
mod layering;
mod official_client;
mod reference_sets;
mod renderer_truth;
mod rerun_recording;
mod restart;
mod workbench;

mod slow {
    mod first_user;
    mod following;
    mod fuzz;
    mod rerun_viewers;
    mod tracking;
}
