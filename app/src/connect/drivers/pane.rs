//! Which drivers the window is to work with.

use egui::{ComboBox, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::gui::style::{form, parts};
use crate::gui::typed::MOST_TYPED;
use crate::model::{CellSource, Drivers, Model};
use crate::tr;

/// What is typed; it belongs to nothing but the window.
#[derive(Debug, Clone, Default)]
pub struct Draft {
    robot: Option<String>,
    camera: Option<String>,
}

/// The fields; the cell, once they name one. A freehand cell has a camera alone.
pub fn drivers_ui(ui: &mut Ui, model: &Model, freehand: bool, draft: &mut Draft) -> Option<CellSource> {
    let language = model.view.language;
    let known = known(model, freehand);
    let first = known.first().cloned().unwrap_or_default();
    let mut robot = draft.robot.clone().unwrap_or_else(|| first.robot.unwrap_or_default());
    let mut camera = draft.camera.clone().unwrap_or_else(|| first.camera.unwrap_or_default());
    let before = (robot.clone(), camera.clone());
    parts::hint_ui(
        ui,
        if freehand {
            tr!(
                language,
                "You move the robot and type the pose that its pendant shows. The images come from a driver: a command such as \
                 “handeye driver folder DIR”, or tcp://HOST:PORT"
            )
        } else {
            tr!(
                language,
                "Programs that speak the driver protocol: a command such as “handeye driver ur-rtde --host 192.168.0.2”, or \
                 tcp://HOST:PORT"
            )
        },
    );
    if !freehand {
        field_ui(ui, tr!(language, "Robot"), tr!(language, "Driver of the robot"), "python3 my_driver.py", &mut robot);
    }
    let hint = if freehand { "handeye driver folder DIR" } else { tr!(language, "the same program, if empty") };
    field_ui(ui, tr!(language, "Camera"), tr!(language, "Driver of the camera"), hint, &mut camera);
    if known.len() > 1 {
        let history =
            ComboBox::from_id_salt("drivers").selected_text(tr!(language, "Earlier drivers")).show_ui(ui, |ui| {
                for earlier in &known {
                    if ui.selectable_label(false, earlier.to_string()).clicked() {
                        robot = earlier.robot.clone().unwrap_or_default();
                        camera = earlier.camera.clone().unwrap_or_default();
                    }
                }
            });
        history.response.on_hover_text(tr!(language, "Drivers that were connected before"));
    }
    if (&robot, &camera) != (&before.0, &before.1) {
        *draft = Draft { robot: Some(robot.clone()), camera: Some(camera.clone()) };
    }
    let named = |text: &str| Some(text.trim().to_owned()).filter(|text| !text.is_empty());
    let drivers = Drivers { robot: named(&robot).filter(|_| !freehand), camera: named(&camera) };
    let is_whole = if freehand { drivers.camera.is_some() } else { drivers.robot.is_some() };
    is_whole.then_some(CellSource::Drivers(drivers))
}

/// Those that are used and were used before, newest first, of this kind.
fn known(model: &Model, freehand: bool) -> Vec<Drivers> {
    let now = match &model.source {
        CellSource::Drivers(drivers) => Some(drivers),
        CellSource::BuiltIn(_) | CellSource::Address(_) => None,
    };
    let earlier = model.drivers.iter().filter(|drivers| Some(*drivers) != now);
    now.into_iter().chain(earlier).filter(|drivers| drivers.robot.is_none() == freehand).cloned().collect()
}

fn field_ui(ui: &mut Ui, name: &str, label: &str, hint: &str, value: &mut String) {
    let field = form::row_ui(ui, name, |ui| {
        let width = ui.available_width().min(360.0);
        ui.add(TextEdit::singleline(value).char_limit(MOST_TYPED).desired_width(width).hint_text(hint))
    });
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, label));
}
