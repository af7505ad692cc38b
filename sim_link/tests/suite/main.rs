//! All integration tests of the client and the cell in one program, which is linked once.
//!
//! `slow` is what the fast tier (`./test fast`) leaves out.

mod any_joints;
mod arm;
mod board;
mod client_faults;
mod drivers;
mod joint_offsets;
mod other_arms;
mod surroundings;
mod vendor;

mod slow {
    mod follow;
    mod stops;
}
