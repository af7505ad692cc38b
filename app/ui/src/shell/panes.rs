//! Every pane with its name and the function that draws it. A new one needs its name in [`Pane`] and a line here.

use egui::Ui;

use crate::capture::pane::poses_ui;
use crate::connect::pane::connect_ui;
use crate::export::pane::export_ui;
use crate::live::pane::{colour_ui, depth_ui};
use crate::live::textures::Textures;
use crate::messages::pane::log_ui;
use crate::motion::pane::jog_ui;
use crate::scene::pane::scene_ui;
use crate::solve::charts::charts_ui;
use crate::solve::pane::result_ui;
use crate::target::pane::target_ui;
use crate::taught::pane::taught_ui;
use crate::track::pane::track_ui;
use crate::verify::pane::verify_ui;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{ImagePoint, Model, Pane};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// What panes are drawn from.
pub struct Panes<'a> {
    pub model: &'a Model,
    pub textures: &'a mut Textures,
    pub outbox: &'a mut Outbox,
    /// The pixel under the pointer, from the image that it is over.
    pub pointed: Option<ImagePoint>,
}

type Draw = fn(&mut Ui, &mut Panes<'_>);

/// Name and content of each.
fn entry(pane: Pane, language: Language) -> (&'static str, Draw) {
    match pane {
        Pane::Colour => (tr!(language, "Colour"), |ui, it| {
            it.pointed = it.pointed.or(colour_ui(ui, it.model, &it.textures.live, it.outbox));
        }),
        Pane::Depth => (tr!(language, "Depth"), |ui, it| {
            it.pointed = it.pointed.or(depth_ui(ui, it.model, &it.textures.live, it.outbox));
        }),
        Pane::Poses => {
            (tr!(language, "Poses"), |ui, it| poses_ui(ui, it.model, &mut it.textures.thumbnails, it.outbox))
        }
        Pane::Charts => (tr!(language, "Charts"), |ui, it| charts_ui(ui, it.model, it.outbox)),
        Pane::Log => (tr!(language, "Log"), |ui, it| log_ui(ui, it.model, it.outbox)),
        Pane::Connect => (tr!(language, "Connect"), |ui, it| connect_ui(ui, it.model, it.outbox)),
        Pane::Target => (tr!(language, "Target"), |ui, it| target_ui(ui, it.model, it.outbox)),
        Pane::Jog => (tr!(language, "Jog"), |ui, it| jog_ui(ui, it.model, it.outbox)),
        Pane::Taught => (tr!(language, "Taught"), |ui, it| taught_ui(ui, it.model, it.outbox)),
        Pane::Result => (tr!(language, "Result"), |ui, it| result_ui(ui, it.model, it.outbox)),
        Pane::Verify => (tr!(language, "Verify"), |ui, it| verify_ui(ui, it.model, it.outbox)),
        Pane::Export => (tr!(language, "Export"), |ui, it| export_ui(ui, it.model, it.outbox)),
        Pane::Track => (tr!(language, "Track"), |ui, it| track_ui(ui, it.model, it.outbox)),
        Pane::Scene => (tr!(language, "3D"), |ui, it| scene_ui(ui, it.model, it.outbox)),
    }
}

/// The title of its tab.
pub fn title(pane: Pane, language: Language) -> &'static str {
    entry(pane, language).0
}

/// Draws it.
pub fn pane_ui(ui: &mut Ui, pane: Pane, from: &mut Panes<'_>) {
    entry(pane, from.model.view.language).1(ui, from);
}
