//! One taught pose.

use egui::{Align, Color32, Id, Key, Layout, Rect, RichText, Sense, Stroke, TextEdit, Ui, Vec2};
use egui::{WidgetInfo, WidgetType};
use handeye_dataset::taught_poses::{Goal, TaughtPose};

use crate::shell::reasons::immovable;
use crate::style::numbers;
use crate::style::parts::{self, Sign};
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, StopOutcome};
use handeye_workbench::taught;
use handeye_workbench::text::Text;
use handeye_workbench::tr;

/// A row that is dragged, by its place.
#[derive(Debug, Clone, Copy)]
struct Dragged(usize);

/// A name that is being edited.
#[derive(Debug, Clone, Default)]
struct Renaming {
    from: String,
    to: String,
}

/// The outcome of the last sequence for a pose.
enum Mark {
    None,
    UnderWay,
    Done,
    Skipped(Text),
}

pub fn row_ui(ui: &mut Ui, model: &Model, poses: &[&TaughtPose], index: usize, pose: &TaughtPose, outbox: &mut Outbox) {
    let language = model.view.language;
    let count = poses.len();
    let mark = mark(model, &pose.name);
    let row = ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 3.0;
        let name = &pose.name;
        let grip = text!("Drag {name} to another place", name = name).in_language(language);
        let is_free = !model.sequence_runs;
        parts::sign_ui(ui, Sign::Grip, &grip, is_free).dnd_set_drag_payload(Dragged(index));
        parts::dot_ui(ui, mark.colour(ui));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let remove = text!("Remove {name}", name = name).in_language(language);
            if parts::sign_ui(ui, Sign::Cross, &remove, is_free).clicked() {
                outbox.send(taught::Command::Remove(name.clone()));
            }
            let later = text!("Move {name} down", name = name).in_language(language);
            if parts::sign_ui(ui, Sign::Down, &later, is_free && index + 1 < count).clicked() {
                outbox.send(taught::Command::Reorder { name: name.clone(), to: index + 1 });
            }
            let earlier = text!("Move {name} up", name = name).in_language(language);
            if parts::sign_ui(ui, Sign::Up, &earlier, is_free && index > 0).clicked() {
                outbox.send(taught::Command::Reorder { name: name.clone(), to: index.saturating_sub(1) });
            }
            let button = parts::small_button(ui, tr!(language, "Go to"));
            let go = parts::gated_ui(ui, immovable(model), button);
            let go_name = text!("Go to {name}", name = name).in_language(language);
            let can_go = immovable(model).is_none();
            go.widget_info(|| WidgetInfo::labeled(WidgetType::Button, can_go, &go_name));
            if go.clicked() {
                outbox.send(taught::Command::GoTo(name.clone()));
            }
            kind_ui(ui, pose, model);
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| name_ui(ui, model, poses, index, pose, outbox));
        });
    });
    if let Mark::Skipped(why) = &mark {
        parts::caption_ui(ui, &text!("Skipped: {why}", why = why.clone()).in_language(language));
    }
    drop_ui(ui, poses, index, row.response.rect, outbox);
}

fn mark(model: &Model, name: &str) -> Mark {
    let Some(sequence) = model.sequence.as_ref().filter(|sequence| !sequence.is_planned()) else { return Mark::None };
    let Some(place) = sequence.names.iter().position(|visited| visited == name) else { return Mark::None };
    match sequence.outcomes.get(place) {
        Some(StopOutcome::Done) => Mark::Done,
        Some(StopOutcome::Skipped(why)) => Mark::Skipped(why.clone()),
        None if model.sequence_runs && sequence.current() == Some(name) => Mark::UnderWay,
        None => Mark::None,
    }
}

impl Mark {
    fn colour(&self, ui: &Ui) -> Color32 {
        let palette = Palette::of(ui);
        match self {
            Self::None => palette.edge,
            Self::UnderWay => palette.busy,
            Self::Done => palette.good,
            Self::Skipped(_) => palette.warning,
        }
    }
}

fn kind_ui(ui: &mut Ui, pose: &TaughtPose, model: &Model) {
    let language = model.view.language;
    let (kind, numbers) = match &pose.goal {
        Goal::Joints(joints) => {
            (tr!(language, "joints"), text!("Joints: {values}", values = model.joints_text(joints)))
        }
        Goal::Tip(base_from_tip) => {
            let mm = numbers::translation_mm(base_from_tip);
            let rpy = numbers::rpy_deg(base_from_tip);
            let what = text!("Tip in base: {mm} mm; roll pitch yaw {rpy}°", mm = mm, rpy = rpy);
            (tr!(language, "tip"), what)
        }
    };
    let weak = Palette::of(ui).weak;
    ui.add(egui::Label::new(RichText::new(kind).small().color(weak)).sense(Sense::hover()))
        .on_hover_text(numbers.in_language(language));
}

/// The name, which is edited in place.
fn name_ui(ui: &mut Ui, model: &Model, poses: &[&TaughtPose], index: usize, pose: &TaughtPose, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("renaming of a taught pose");
    let renaming: Option<Renaming> = parts::remembered(ui, id);
    let mut shown = match &renaming {
        Some(renaming) if renaming.from == pose.name => renaming.to.clone(),
        _ => pose.name.clone(),
    };
    let taken = shown.trim() != pose.name && poses.iter().any(|other| other.name == shown.trim());
    let palette = Palette::of(ui);
    let field = TextEdit::singleline(&mut shown)
        .desired_width(ui.available_width())
        .char_limit(60)
        .frame(egui::Frame::NONE)
        .text_color(if taken { palette.bad } else { palette.text });
    let mut response = ui.add_enabled(!model.sequence_runs, field);
    let name = text!("Name of pose {n}", n = index + 1).in_language(language);
    let enabled = !model.sequence_runs;
    response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, enabled, &name));
    if taken {
        response = response.on_hover_text(tr!(language, "There is a pose of that name already"));
    }
    if response.changed() {
        parts::remember(ui, id, Some(Renaming { from: pose.name.clone(), to: shown.clone() }));
    }
    if response.lost_focus() {
        let to = shown.trim();
        let is_kept = !taken && !to.is_empty() && to != pose.name && !ui.input(|input| input.key_pressed(Key::Escape));
        if is_kept {
            outbox.send(taught::Command::Rename { from: pose.name.clone(), to: to.to_owned() });
        }
        parts::remember(ui, id, None::<Renaming>);
    }
}

/// Where a dragged row would go, and dropping it.
fn drop_ui(ui: &mut Ui, poses: &[&TaughtPose], index: usize, row: Rect, outbox: &mut Outbox) {
    let area = row.expand2(Vec2::new(0.0, ui.spacing().item_spacing.y / 2.0));
    let response = ui.interact(area, Id::new(("place of a taught pose", index)), Sense::hover());
    let Some(dragged) = response.dnd_hover_payload::<Dragged>() else { return };
    let below = ui.input(|input| input.pointer.hover_pos()).is_some_and(|at| at.y > row.center().y);
    let line = if below { area.bottom() } else { area.top() };
    ui.painter().hline(row.x_range(), line, Stroke::new(2.0, Palette::of(ui).accent));
    if response.dnd_release_payload::<Dragged>().is_none() {
        return;
    }
    let gap = index + usize::from(below);
    // Its own place becomes free when it is removed.
    let to = if gap > dragged.0 { gap - 1 } else { gap };
    if let Some(pose) = poses.get(dragged.0).filter(|_| to != dragged.0) {
        outbox.send(taught::Command::Reorder { name: pose.name.clone(), to });
    }
}
