//! All integration tests of the core in one program, which is linked once.
//!
//! `slow` is what the fast tier (`./test fast`) skips.

mod arm_recorded;
mod broken_datasets;
mod camera_alone;
mod doctor;
mod doctor_on_real_data;
mod joint_on_real_data;
mod lens_claims;
mod reference_datasets;
mod target_data;
mod vision_data;

mod slow {
    mod monte_carlo;
    mod session_kill;
}
