//! Which scene the built-in cell has.

use egui::{ComboBox, Ui, WidgetInfo, WidgetType};
use handeye_cell::scene::{SceneChoice, ShippedScene};

use crate::style::form;
use handeye_workbench::model::{CellSource, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// The scene as it is chosen; `None` while nothing was.
pub(super) type Draft = Option<SceneChoice>;

/// The scenes that come with the program, and the file of the cell that runs, if it has one.
pub(super) fn scene_ui(ui: &mut Ui, model: &Model, draft: &mut Draft) -> CellSource {
    let language = model.view.language;
    let now = match &model.source {
        CellSource::BuiltIn(scene) => scene.clone(),
        CellSource::Address(_) | CellSource::Drivers(_) => SceneChoice::default(),
    };
    let mut wanted = draft.clone().unwrap_or_else(|| now.clone());
    form::row_ui(ui, tr!(language, "Scene"), |ui| {
        let combo = ComboBox::from_id_salt("scene of the built-in cell").width(260.0);
        let chosen = combo.selected_text(name(&wanted, language)).show_ui(ui, |ui| {
            let file = Some(now.clone()).filter(|scene| matches!(scene, SceneChoice::File(_)));
            for scene in ShippedScene::ALL.map(SceneChoice::Shipped).into_iter().chain(file) {
                let words = name(&scene, language);
                ui.selectable_value(&mut wanted, scene, words);
            }
        });
        let label = tr!(language, "Scene of the built-in cell");
        chosen.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, label));
    });
    *draft = (wanted != now).then(|| wanted.clone());
    CellSource::BuiltIn(wanted)
}

fn name(scene: &SceneChoice, language: Language) -> String {
    let shipped = match scene {
        SceneChoice::Shipped(shipped) => shipped,
        SceneChoice::File(file) => return file.display().to_string(),
    };
    let words = match shipped {
        ShippedScene::Reference => tr!(language, "UR5, exact"),
        ShippedScene::Realistic => tr!(language, "UR5, with the errors of a real cell"),
        ShippedScene::Nominal => tr!(language, "UR5, with links that are a little off"),
        ShippedScene::Coppeliasim => tr!(language, "UR5, as CoppeliaSim shows it"),
        ShippedScene::Tracking => tr!(language, "UR5, moving board"),
        ShippedScene::Panda => tr!(language, "Franka Panda, seven joints"),
        ShippedScene::Xarm6 => tr!(language, "UFACTORY xArm 6"),
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::pane::connect_ui;
    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::connect;
    use handeye_workbench::testing::sample;

    #[test]
    fn another_scene_is_chosen_and_connected_to() {
        let mut pane = Driven::new(connect_ui, sample::connected());
        pane.click("Scene of the built-in cell");
        pane.steps();
        pane.click("Franka Panda, seven joints");
        pane.steps();
        let panda = CellSource::BuiltIn(SceneChoice::Shipped(ShippedScene::Panda));
        assert_eq!(pane.click("Connect now"), [Command::Connect(connect::Command::Connect(panda))]);
        assert!(pane.nothing_is_cut_off());
    }

    #[test]
    fn a_scene_file_that_is_in_use_is_among_the_scenes() {
        let mut model = sample::connected();
        model.source = CellSource::BuiltIn(SceneChoice::File("cells/mine.toml".into()));
        let mut pane = Driven::new(connect_ui, model);
        assert_eq!(pane.click("Connect again"), [Command::Connect(connect::Command::Reconnect)]);
        pane.click("Scene of the built-in cell");
        pane.steps();
        assert!(pane.sees("cells/mine.toml"));
    }
}
