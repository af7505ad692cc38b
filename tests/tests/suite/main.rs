//! All end-to-end tests in one program, which is linked once.
//!
//! `slow` is what the fast tier (`./test fast`) skips: real-time sequences, desktops, browsers, the long fuzz.

mod circles;
mod command_line;
mod documents;
mod exports;
mod hostile_clients;
mod imports;
mod kinematics;
mod reference_sets;
mod renderer_truth;
mod rerun_doors;
mod restart;
mod scene_script;
mod served_doors;
mod sessions;
mod shared_intrinsics;
mod solved;
#[cfg(unix)]
mod streams;
mod walls;

mod slow {
    mod asleep;
    mod auto;
    mod coppeliasim_only;
    mod coppeliasim_scene;
    mod driven_cells;
    mod driven_commands;
    mod drivers;
    mod first_user;
    mod following;
    mod fuzz;
    mod guided;
    mod interrupted;
    mod leaving;
    mod many_sessions;
    mod official_client;
    mod pasted;
    mod python_module;
    mod rerun_recording;
    mod rerun_viewers;
    mod robots;
    mod sample;
    mod served;
    mod simulators;
    mod stops;
    mod tracking;
    mod verifying;
    mod web_page;
    mod workbench;
}
