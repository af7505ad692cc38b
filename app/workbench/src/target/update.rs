//! Another target, and the target on paper.

use handeye_geometry::targets::TargetSpec;
use handeye_session::Edit;

use super::command::Command;
use crate::guided::update::forget_guided;
use crate::model::Model;
use crate::session::update::edit;
use crate::target::print::print_target;
use crate::worker::{SessionThreads, Workers};

/// Does what is wanted of the target.
pub(crate) fn apply(model: &mut Model, workers: &Workers, desk: &SessionThreads, command: Command) {
    match command {
        Command::Set(target) => set_target(model, workers, desk, target),
        Command::Print(page) => print_target(model, desk, page),
    }
}

fn set_target(model: &mut Model, workers: &Workers, desk: &SessionThreads, target: TargetSpec) {
    forget_guided(model, workers);
    edit(model, desk, Edit::SetTarget(target));
}
