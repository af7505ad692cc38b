//! The viewpoint of the 3D pane.

use super::command::Command;
use crate::model::Model;

/// Does what is wanted of the 3D pane.
pub(crate) fn apply(model: &mut Model, command: Command) {
    match command {
        Command::SetView(view) => model.scene = view,
    }
}

/// Fits the view to everything that is known, once it is known.
pub(crate) fn fit_scene(model: &mut Model) {
    let is_there = model.robot.is_some() && model.cell.is_some();
    let is_recorded = !model.control.is_connected() && !model.document().captures.is_empty();
    if !model.scene_is_fitted
        && (is_there || is_recorded)
        && let Some(view) = crate::scene::fitted_view(model)
    {
        model.scene = view;
        model.scene_is_fitted = true;
    }
}
