//! All integration tests of the client and the cell in one program, which is linked once.
//!
//! `slow` is what the fast tier (`./test fast`) skips.

mod any_joints;
mod arm;
mod board;
mod client_faults;
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod drivers;
mod other_arms;
mod robots;
mod surroundings;
mod vendor;

mod slow {
    mod follow;
    mod held;
    mod stops;
}
