//! The pose that a robot's pendant shows, typed or pasted: where no driver reports it.

use egui::{Button, ComboBox, Id, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType};
use handeye_dataset::typed_pose::{self, TypedPoseError, TypedRotation};
use handeye_geometry::frames::Pose;

use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::connect;
use handeye_workbench::model::Model;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// What is being typed, and in which convention.
#[derive(Debug, Clone, Default)]
struct Draft {
    numbers: String,
    in_metres: bool,
    rotation: TypedRotation,
}

/// The form.
pub fn typed_pose_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("typed pose");
    let mut draft: Draft = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    parts::section_ui(ui, tr!(language, "Pose that the pendant shows"));
    if model.robot.is_none() {
        let reported = tr!(
            language,
            "Move the robot, let it stand, and type its pose before you capture. After each capture the next pose is wanted"
        );
        parts::notice_ui(ui, Tone::Busy, reported, |_| ());
    }
    ui.horizontal_wrapped(|ui| {
        for (in_metres, unit) in [(false, "mm"), (true, "m")] {
            if ui.selectable_label(draft.in_metres == in_metres, unit).clicked() {
                draft.in_metres = in_metres;
            }
        }
        let chosen =
            ComboBox::from_id_salt("rotation of the pose").width(260.0).selected_text(name(draft.rotation, language));
        let response = chosen.show_ui(ui, |ui| {
            for rotation in TypedRotation::ALL {
                ui.selectable_value(&mut draft.rotation, rotation, name(rotation, language));
            }
        });
        let label = tr!(language, "How the rotation is written");
        response.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, label));
    });
    let hint = columns(draft.rotation);
    let field = TextEdit::multiline(&mut draft.numbers).char_limit(400).desired_rows(2);
    let field = ui.add(field.desired_width(f32::INFINITY).hint_text(hint));
    let label = tr!(language, "Numbers of the pose");
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, label));
    let metres_per_unit = if draft.in_metres { 1.0 } else { 1e-3 };
    let read = typed_pose::read(&draft.numbers, metres_per_unit, draft.rotation);
    if let (Err(error), false) = (&read, draft.numbers.trim().is_empty()) {
        let colour = Palette::of(ui).bad;
        ui.add(Label::new(RichText::new(fault(error).in_language(language)).color(colour)).wrap());
    }
    let taken = ui.add_enabled(read.is_ok(), Button::new(tr!(language, "The robot stands here")));
    if let (true, Ok(pose)) = (taken.clicked(), read) {
        outbox.send(connect::Command::TypePose(Pose::from_isometry(pose)));
        draft.numbers.clear();
    }
    ui.data_mut(|data| data.insert_temp(id, draft));
}

fn name(rotation: TypedRotation, language: Language) -> &'static str {
    match rotation {
        TypedRotation::RotationVectorRad => tr!(language, "Rotation vector [rad]: Universal Robots"),
        TypedRotation::RotationVectorDeg => tr!(language, "Rotation vector [°]"),
        TypedRotation::RollPitchYawDeg => tr!(language, "Roll, pitch, yaw [°]: URDF, xArm, Fanuc, Yaskawa"),
        TypedRotation::RollPitchYawRad => tr!(language, "Roll, pitch, yaw [rad]"),
        TypedRotation::KukaAbc => tr!(language, "A, B, C [°]: KUKA"),
        TypedRotation::QuaternionXyzw => tr!(language, "Quaternion x, y, z, w"),
        TypedRotation::QuaternionWxyz => tr!(language, "Quaternion w, x, y, z: ABB"),
        TypedRotation::Matrix => tr!(language, "Matrix, row by row"),
    }
}

fn columns(rotation: TypedRotation) -> &'static str {
    match rotation {
        TypedRotation::RotationVectorRad | TypedRotation::RotationVectorDeg => "x y z rx ry rz",
        TypedRotation::RollPitchYawDeg | TypedRotation::RollPitchYawRad => "x y z roll pitch yaw",
        TypedRotation::KukaAbc => "X Y Z A B C",
        TypedRotation::QuaternionXyzw => "x y z qx qy qz qw",
        TypedRotation::QuaternionWxyz => "x y z qw qx qy qz",
        TypedRotation::Matrix => "r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z",
    }
}

fn fault(error: &TypedPoseError) -> Text {
    match error {
        TypedPoseError::NoNumber { word } => text!("“{word}” is not a number", word = word),
        TypedPoseError::Count { got, need } => {
            text!("There are {got} numbers, and this convention has {need}", got = got, need = need)
        }
        TypedPoseError::TooFar { metres } => text!(
            "The position is {metres} m from the base: check whether it is in metres or millimetres",
            metres = format!("{metres:.1}")
        ),
        TypedPoseError::AngleTooLarge { radians } => text!(
            "An angle of {radians} rad is more than two turns: check whether it is in degrees or radians",
            radians = format!("{radians:.1}")
        ),
        TypedPoseError::NotUnit { length } => text!(
            "The quaternion has the length {length} instead of 1: check the order of the numbers",
            length = format!("{length:.4}")
        ),
        TypedPoseError::NoRotation => {
            text!("The first three columns are not a rotation: check that the numbers are given row by row")
        }
        other => other.into(),
    }
}

#[cfg(test)]
mod tests {
    use handeye_geometry::frames::{Base, Tip};

    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::testing::sample;

    fn pane() -> Driven {
        let mut model = sample::connected();
        model.robot = None;
        Driven::new(typed_pose_ui, model)
    }

    #[test]
    fn a_pose_is_taken_as_it_is_typed_and_asked_for_again_afterwards() {
        let mut pane = pane();
        assert!(pane.sees("After each capture the next pose is wanted"));
        pane.retype("Numbers of the pose", "400 -100 300 0 3.0 0");
        let commands = pane.click("The robot stands here");
        let [Command::Connect(connect::Command::TypePose(pose))] = commands.as_slice() else { panic!("{commands:?}") };
        let wanted: Pose<Base, Tip> =
            Pose::from_isometry(typed_pose::read("0.4 -0.1 0.3 0 3 0", 1.0, TypedRotation::default()).expect("a pose"));
        assert!(pose.distance_to(&wanted).0 < 1e-12);
        assert_eq!(pane.click("The robot stands here"), [], "the field is empty now");
    }

    #[test]
    fn what_is_no_pose_is_not_sent() {
        let mut pane = pane();
        pane.retype("Numbers of the pose", "400 -100 300 0 180 0");
        assert!(pane.sees("more than two turns"));
        assert_eq!(pane.click("The robot stands here"), []);
    }
}
