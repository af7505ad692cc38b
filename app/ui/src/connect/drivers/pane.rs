//! Which drivers the window should work with: those that come with the program, each with its fields, or another
//! program.

use egui::{ComboBox, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::style::{form, parts};
use crate::typed::MOST_TYPED;
use handeye_workbench::connect::offered::{self, Field, FieldKind, Offered, Part, Rank, Values};
use handeye_workbench::model::{CellSource, Drivers, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Height that the list of drivers may have, points: all of them are seen without scrolling.
const LIST: f32 = 420.0;
/// Width of the input fields \[points\].
const FIELD: f32 = 300.0;

/// What is chosen and typed; known to the window only.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    robot: Seat,
    camera: Seat,
}

/// The driver of one part of the cell.
#[derive(Debug, Clone, PartialEq)]
struct Seat {
    part: Part,
    choice: Choice,
    /// The options of the driver that comes with the program.
    values: Values,
    /// The command or address of another one.
    typed: String,
}

#[derive(Debug, Clone, Copy)]
enum Choice {
    /// No driver of its own: the robot's has the camera.
    Same,
    Offered(&'static Offered),
    Other,
}

impl PartialEq for Choice {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Same, Self::Same) | (Self::Other, Self::Other) => true,
            (Self::Offered(one), Self::Offered(other)) => one.name == other.name,
            _ => false,
        }
    }
}

impl Seat {
    /// From a command line.
    fn of(part: Part, command: Option<String>, otherwise: Choice) -> Self {
        let Some(command) = command else {
            return Self { part, choice: otherwise, values: Values::new(), typed: String::new() };
        };
        match offered::parse(&command, part) {
            Some((offered, values)) => Self { part, choice: Choice::Offered(offered), values, typed: command },
            None => Self { part, choice: Choice::Other, values: Values::new(), typed: command },
        }
    }

    /// The command or address, once it is complete.
    fn command(&self) -> Option<String> {
        match self.choice {
            Choice::Same => None,
            Choice::Offered(offered) => offered.command(self.part, &self.values),
            Choice::Other => Some(self.typed.trim().to_owned()).filter(|typed| !typed.is_empty()),
        }
    }
}

/// The fields; the cell, once they define one. A freehand cell has only a camera.
pub fn drivers_ui(ui: &mut Ui, model: &Model, freehand: bool, draft: &mut Option<Draft>) -> Option<CellSource> {
    let language = model.view.language;
    let known = known(model, freehand);
    if known.len() > 1 {
        let history =
            ComboBox::from_id_salt("drivers").selected_text(tr!(language, "Earlier drivers")).show_ui(ui, |ui| {
                for earlier in &known {
                    if ui.selectable_label(false, earlier.to_string()).clicked() {
                        *draft = Some(Draft::of(earlier, freehand));
                    }
                }
            });
        history.response.on_hover_text(tr!(language, "Drivers that were connected before"));
    }
    let before = draft.clone().unwrap_or_else(|| Draft::of(known.first().unwrap_or(&Drivers::default()), freehand));
    let Draft { mut robot, mut camera } = before.clone();
    if freehand {
        parts::hint_ui(
            ui,
            tr!(
                language,
                "You move the robot and type the pose that its pendant shows. The images come from a driver."
            ),
        );
    } else {
        let names = [tr!(language, "Robot"), tr!(language, "Driver of the robot")];
        seat_ui(ui, language, names, &mut robot, None);
    }
    let names = [tr!(language, "Camera"), tr!(language, "Driver of the camera")];
    seat_ui(ui, language, names, &mut camera, (!freehand).then_some(Choice::Same));
    let now = Draft { robot, camera };
    let drivers = Drivers { robot: now.robot.command().filter(|_| !freehand), camera: now.camera.command() };
    let has_camera = now.camera.choice == Choice::Same || drivers.camera.is_some();
    let is_whole = (freehand || drivers.robot.is_some()) && has_camera;
    if now != before {
        *draft = Some(now);
    }
    is_whole.then_some(CellSource::Drivers(drivers))
}

impl Draft {
    /// As last connected; the first of the list if nothing was.
    fn of(drivers: &Drivers, freehand: bool) -> Self {
        let first = |part| offered::of_part(part).next().map_or(Choice::Other, Choice::Offered);
        let without_camera = if freehand { first(Part::Camera) } else { Choice::Same };
        Self {
            robot: Seat::of(Part::Robot, drivers.robot.clone(), first(Part::Robot)),
            camera: Seat::of(Part::Camera, drivers.camera.clone(), without_camera),
        }
    }
}

/// Drivers in use and used before, newest first, of this kind.
fn known(model: &Model, freehand: bool) -> Vec<Drivers> {
    let now = match &model.source {
        CellSource::Drivers(drivers) => Some(drivers),
        CellSource::BuiltIn(_) | CellSource::Address(_) => None,
    };
    let earlier = model.drivers.iter().filter(|drivers| Some(*drivers) != now);
    now.into_iter().chain(earlier).filter(|drivers| drivers.robot.is_none() == freehand).cloned().collect()
}

/// Which driver a part of the cell has, and its options.
fn seat_ui(ui: &mut Ui, language: Language, [name, label]: [&str; 2], seat: &mut Seat, none: Option<Choice>) {
    let list = none.into_iter().chain(offered::of_part(seat.part).map(Choice::Offered)).chain([Choice::Other]);
    let before = seat.choice;
    form::row_ui(ui, name, |ui| {
        let combo = ComboBox::from_id_salt(label).width(FIELD.min(ui.available_width())).height(LIST);
        let shown = combo.selected_text(title(seat.choice, language)).show_ui(ui, |ui| {
            for choice in list {
                ui.selectable_value(&mut seat.choice, choice, title(choice, language));
            }
        });
        shown.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, label));
    });
    if seat.choice != before {
        // The options of one driver mean nothing to another; the command line is a start for another program.
        if let Choice::Offered(offered) = before {
            seat.typed = offered.command(seat.part, &seat.values).unwrap_or_default();
        }
        seat.values = Values::new();
    }
    match seat.choice {
        Choice::Same => {}
        Choice::Other => {
            parts::hint_ui(
                ui,
                tr!(
                    language,
                    "A program that speaks the driver protocol: a command such as “python3 my_driver.py”, or tcp://HOST:PORT"
                ),
            );
            text_ui(ui, name, tr!(language, "Command or address"), "python3 my_driver.py", &mut seat.typed);
        }
        Choice::Offered(offered) => {
            parts::hint_ui(ui, offered.about(seat.part, language));
            let (more, usual): (Vec<&Field>, Vec<&Field>) =
                offered.fields_of(seat.part).partition(|field| field.rank == Rank::More);
            for field in usual {
                field_ui(ui, language, name, field, &mut seat.values);
            }
            if !more.is_empty() {
                let are_set = more.iter().any(|field| seat.values.contains_key(field.option));
                let header = egui::CollapsingHeader::new(tr!(language, "More options"));
                header.id_salt((label, offered.name)).default_open(are_set).show(ui, |ui| {
                    for field in more {
                        field_ui(ui, language, name, field, &mut seat.values);
                    }
                });
            }
            if let Some(command) = offered.command(seat.part, &seat.values) {
                parts::hint_ui(ui, &command);
            }
        }
    }
}

fn title(choice: Choice, language: Language) -> &'static str {
    match choice {
        Choice::Same => tr!(language, "From the robot's driver"),
        Choice::Offered(offered) => offered.title(language),
        Choice::Other => tr!(language, "Another program"),
    }
}

fn field_ui(ui: &mut Ui, language: Language, of: &str, field: &Field, values: &mut Values) {
    let name = field.label(language);
    let before = values.get(field.option).cloned().unwrap_or_default();
    let mut now = before.clone();
    match field.kind {
        FieldKind::Text(example) => text_ui(ui, of, name, example, &mut now),
        FieldKind::Word(words) => {
            form::row_ui(ui, name, |ui| {
                let not_stated = tr!(language, "not stated");
                let shown = if now.is_empty() { not_stated } else { before.as_str() };
                let combo = ComboBox::from_id_salt((of, field.option)).selected_text(shown).show_ui(ui, |ui| {
                    ui.selectable_value(&mut now, String::new(), not_stated);
                    for word in words() {
                        ui.selectable_value(&mut now, word.to_owned(), word);
                    }
                });
                combo.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, named(of, name)));
            });
        }
        FieldKind::Switch => {
            let mut on = !now.is_empty();
            let check = ui.checkbox(&mut on, name);
            check.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, true, on, named(of, name)));
            now = if on { offered::ON.to_owned() } else { String::new() };
        }
    }
    if now != before {
        if now.is_empty() {
            values.remove(field.option);
        } else {
            values.insert(field.option, now);
        }
    }
}

fn text_ui(ui: &mut Ui, of: &str, name: &str, example: &str, value: &mut String) {
    let field = form::row_ui(ui, name, |ui| {
        let width = ui.available_width().min(FIELD);
        ui.add(TextEdit::singleline(value).char_limit(MOST_TYPED).desired_width(width).hint_text(example))
    });
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, named(of, name)));
}

/// The name of a field for users who do not see under which driver it is.
fn named(of: &str, name: &str) -> String {
    format!("{of}: {name}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::connect::pane::connect_ui;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::connect;
    use handeye_workbench::testing::sample;

    fn drivers(robot: Option<&str>, camera: Option<&str>) -> CellSource {
        CellSource::Drivers(Drivers { robot: robot.map(str::to_owned), camera: camera.map(str::to_owned) })
    }

    fn choose(pane: &mut Driven, list: &str, entry: &str) {
        pane.click(list);
        pane.steps();
        pane.click(entry);
        pane.steps();
    }

    #[test]
    fn a_controller_is_connected_to_by_its_address_and_arm_without_a_command_line() {
        let mut pane = Driven::new(connect_ui, sample::connected());
        pane.click("Driver");
        assert!(!pane.is_enabled("Connect now"), "the address is missing");
        pane.type_into("Robot: Address", "192.168.0.7");
        choose(&mut pane, "Robot: Arm", "ur5e");
        assert!(pane.nothing_is_cut_off());
        let robot = "handeye driver ur-rtde --host 192.168.0.7 --arm ur5e";
        assert!(pane.sees(robot));
        assert_eq!(
            pane.click("Connect now"),
            [Command::Connect(connect::Command::Connect(drivers(Some(robot), None)))]
        );
    }

    #[test]
    fn robot_and_camera_are_two_drivers_of_the_list() {
        let mut pane = Driven::new(connect_ui, sample::connected());
        pane.click("Driver");
        choose(&mut pane, "Driver of the robot", "Simulated robot and camera");
        choose(&mut pane, "Robot: Scene", "panda");
        choose(&mut pane, "Driver of the camera", "Folder that images are saved in");
        assert!(!pane.is_enabled("Connect now"), "the folder is missing");
        pane.type_into("Camera: Folder", "/data/my images");
        let wanted = drivers(
            Some("handeye driver fake --scene panda"),
            Some("handeye driver folder '/data/my images' --images-only"),
        );
        assert_eq!(pane.click("Connect now"), [Command::Connect(connect::Command::Connect(wanted))]);
        assert!(pane.nothing_is_cut_off());
    }

    #[test]
    fn a_driver_that_was_connected_before_fills_its_fields_and_one_of_somebody_else_its_line() {
        let mut model = sample::connected();
        model.source =
            drivers(Some("handeye driver rosbridge --url ws://10.0.0.3:9090 --rectified"), Some("python3 cam.py"));
        let mut pane = Driven::new(connect_ui, model);
        assert!(pane.is_enabled("Connect again"));
        assert!(pane.sees("Robot: Images are rectified"), "an option that is set is not hidden");
        pane.retype("Camera: Command or address", "tcp://10.0.0.4:7000");
        pane.retype("Robot: Base frame", "base_link");
        pane.retype("Robot: Tip frame", "tool0");
        let robot =
            "handeye driver rosbridge --url ws://10.0.0.3:9090 --base-frame base_link --tip-frame tool0 --rectified";
        let wanted = drivers(Some(robot), Some("tcp://10.0.0.4:7000"));
        assert_eq!(pane.click("Connect now"), [Command::Connect(connect::Command::Connect(wanted))]);
    }

    #[test]
    fn freehand_takes_a_camera_of_the_list_and_no_fields_of_robots() {
        let mut pane = Driven::new(connect_ui, sample::connected());
        pane.click("Freehand");
        choose(&mut pane, "Driver of the camera", "ROS 1 or ROS 2 (rosbridge)");
        assert!(!pane.sees("Base frame") && !pane.sees("Driver of the robot"));
        pane.type_into("Camera: Image topic", "/image");
        let wanted = drivers(None, Some("handeye driver rosbridge --image /image"));
        assert_eq!(pane.click("Connect now"), [Command::Connect(connect::Command::Connect(wanted))]);
    }
}
