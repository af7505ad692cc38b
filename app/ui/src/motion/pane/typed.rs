//! A place to move to, in numbers.

use egui::{Button, DragValue, Grid, Id, RichText, Ui, WidgetInfo, WidgetType};
use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::blocked::Blocked;
use super::joints::shown_range;
use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, MotionGoal, RobotState};
use handeye_workbench::motion;
use handeye_workbench::motion::correction::{corrected, expected_mm, real_tip};
use handeye_workbench::motion::way::Way;
use handeye_workbench::tr;

/// Width of a field.
const FIELD: f32 = 84.0;
/// No arm on a table reaches further \[mm\].
const FARTHEST_MM: f64 = 10_000.0;

/// What is being typed.
#[derive(Debug, Clone, Copy)]
struct Typed {
    is_tip: bool,
    /// Joints [°, or mm of a prismatic one].
    joints: JointValues,
    /// x, y, z \[mm\]; roll, pitch, yaw [°].
    tip: [f64; 6],
    /// Whether the user has typed any of it; until then the numbers are those of the arm.
    is_edited: bool,
    /// Whether the arm was commanded there.
    is_sent: bool,
    /// Whether the user wants the errors of the arm corrected; until one has decided, they are if that brings the tip nearer.
    corrected: Option<bool>,
    /// The cell that it is for, see [`Model::cells`].
    cell: u64,
}

impl Default for Typed {
    fn default() -> Self {
        Self {
            is_tip: false,
            joints: JointValues::zeros(0),
            tip: [0.0; 6],
            is_edited: false,
            is_sent: false,
            corrected: None,
            cell: 0,
        }
    }
}

impl Typed {
    fn fill(&mut self, model: &Model, robot: &RobotState) {
        let rounded = |value: f64| (value * 100.0).round() / 100.0;
        let shown = |i: usize| rounded(robot.joints_rad[i] * model.joint_kind(i).shown_per_si());
        self.joints = JointValues::from_fn(robot.joints_rad.len(), shown);
        let base_from_tip = self.real_tip(model).unwrap_or(robot.base_from_tip);
        let [x, y, z]: [f64; 3] = base_from_tip.translation().into();
        let (roll, pitch, yaw) = base_from_tip.rotation().euler_angles();
        let mm = [x, y, z].map(|metres| rounded(metres * 1e3));
        let deg = [roll, pitch, yaw].map(|radians| rounded(radians.to_degrees()));
        self.tip = [mm[0], mm[1], mm[2], deg[0], deg[1], deg[2]];
    }

    /// Makes the numbers follow the arm, unless the user has typed others for this arm.
    fn follow(&mut self, model: &Model) {
        let robot = model.robot.as_ref();
        self.is_edited &= self.cell == model.cells && robot.is_some_and(|it| it.joints_rad.len() == self.joints.len());
        self.cell = model.cells;
        // What was typed is cleared once the arm is there.
        self.is_edited &= !(self.is_sent && self.way(model).is_some_and(|way| way.is_none()));
        self.is_sent &= self.is_edited;
        if let Some(robot) = robot.filter(|_| !self.is_edited) {
            self.fill(model, robot);
        }
    }

    /// Where the tip really is, if moves are corrected for that.
    fn real_tip(&self, model: &Model) -> Option<Pose<Base, Tip>> {
        self.is_corrected(model).then(|| real_tip(model)).flatten()
    }

    fn is_corrected(&self, model: &Model) -> bool {
        let known = self.is_tip.then(|| corrected(model)).flatten();
        known.is_some_and(|(solved, _)| self.corrected.unwrap_or(solved.result.quality.correcting_helps()))
    }

    fn way(&self, model: &Model) -> Option<Way> {
        let to = |real: Pose<Base, Tip>| Way { tip: Some(real.distance_to(&self.base_from_tip())), joint: None };
        self.real_tip(model).map(to).or_else(|| Way::to(&self.goal(model), model))
    }

    fn goal(&self, model: &Model) -> MotionGoal {
        if self.is_tip {
            return MotionGoal::Tip(self.base_from_tip());
        }
        let si = |i: usize| self.joints[i] / model.joint_kind(i).shown_per_si();
        MotionGoal::Joints(JointValues::from_fn(self.joints.len(), si))
    }

    fn base_from_tip(&self) -> Pose<Base, Tip> {
        let [x, y, z, roll, pitch, yaw] = self.tip;
        let turn = UnitQuaternion::from_euler_angles(roll.to_radians(), pitch.to_radians(), yaw.to_radians());
        Pose::from_isometry(Isometry3::from_parts(Translation3::new(x * 1e-3, y * 1e-3, z * 1e-3), turn))
    }
}

/// The form.
pub fn typed_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("typed goal");
    let mut typed: Typed = parts::remembered(ui, id);
    typed.follow(model);
    parts::section_ui(ui, tr!(language, "Move to numbers"));
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (is_tip, name) in [(false, tr!(language, "Joint values")), (true, tr!(language, "Tip pose in base"))] {
            if ui.selectable_label(typed.is_tip == is_tip, name).clicked() {
                typed.is_edited &= typed.is_tip == is_tip;
                typed.is_tip = is_tip;
            }
        }
    });
    fields_ui(ui, model, &mut typed);
    if typed.is_tip {
        parts::hint_ui(ui, tr!(language, "Rotation: R = Rz(yaw) · Ry(pitch) · Rx(roll), as in URDF"));
    }
    corrected_ui(ui, model, &mut typed);
    let (goal, way) = (typed.goal(model), typed.way(model));
    let reported = match way {
        Some(_) if !typed.is_edited => text!("These are the numbers of where the arm is: type others"),
        Some(way) => text!("To there {way}", way = way.text(model)),
        None => text!("Not read yet"),
    };
    parts::hint_ui(ui, &reported.in_language(language));
    ui.horizontal(|ui| {
        let reason = if typed.is_tip { blocked.tip } else { blocked.arm };
        if parts::gated_ui(ui, reason, Button::new(tr!(language, "Move there"))).clicked() {
            let what = if typed.is_tip { text!("typed tip pose") } else { text!("typed joint values") };
            outbox.send(if typed.is_corrected(model) {
                motion::Command::MoveCorrected { base_from_tip: typed.base_from_tip(), what }
            } else {
                motion::Command::Move { goal, what }
            });
            typed.is_sent = true;
        }
        let is_read = model.robot.is_some();
        if ui.add_enabled(is_read, Button::new(tr!(language, "Use current pose"))).clicked() {
            typed.is_edited = false;
        }
    });
    parts::remember(ui, id, typed);
}

/// Whether the errors of the arm are corrected, if they are known.
fn corrected_ui(ui: &mut Ui, model: &Model, typed: &mut Typed) {
    let language = model.view.language;
    let Some((plain, corrected)) = expected_mm(model).filter(|_| typed.is_tip) else { return };
    let mut is_corrected = typed.is_corrected(model);
    if ui.checkbox(&mut is_corrected, tr!(language, "Correct for the errors of the arm")).changed() {
        typed.corrected = Some(is_corrected);
    }
    let expected = text!(
        "A tool arrives within {corrected} mm with it and {plain} mm without, in 95 of 100 cases",
        corrected = format!("{corrected:.2}"),
        plain = format!("{plain:.2}")
    );
    parts::hint_ui(ui, &expected.in_language(language));
}

fn fields_ui(ui: &mut Ui, model: &Model, typed: &mut Typed) {
    let weak = Palette::of(ui).weak;
    let is_tip = typed.is_tip;
    let language = model.view.language;
    let tip = ["x", "y", "z", tr!(language, "roll"), tr!(language, "pitch"), tr!(language, "yaw")];
    let mut edited = false;
    let values: &mut [f64] = if is_tip { &mut typed.tip } else { &mut typed.joints };
    Grid::new("typed goal").num_columns(6).spacing([6.0, 4.0]).min_col_width(0.0).show(ui, |ui| {
        for (index, value) in values.iter_mut().enumerate() {
            let name = if is_tip { tip[index].to_owned() } else { format!("J{}", index + 1) };
            let is_length = is_tip && index < 3;
            let range = if is_length {
                -FARTHEST_MM..=FARTHEST_MM
            } else if is_tip {
                -360.0..=360.0
            } else {
                let [low, high] = shown_range(model, index);
                low..=high
            };
            let unit = match is_tip {
                true if is_length => " mm",
                true => "°",
                false => model.joint_kind(index).unit(),
            };
            ui.label(RichText::new(&name).small().color(weak));
            let field = DragValue::new(value)
                .range(range)
                .clamp_existing_to_range(false)
                .speed(0.1)
                .max_decimals(2)
                .suffix(unit);
            let response = ui.add_sized([FIELD, ui.spacing().interact_size.y], field);
            edited |= response.changed();
            let reported = text!("{name} of the goal", name = name).in_language(language);
            response
                .widget_info(|| WidgetInfo { label: Some(reported.clone()), ..WidgetInfo::new(WidgetType::DragValue) });
            if index % 3 == 2 {
                ui.end_row();
            }
        }
    });
    (typed.is_edited, typed.is_sent) = (typed.is_edited || edited, typed.is_sent && !edited);
}
