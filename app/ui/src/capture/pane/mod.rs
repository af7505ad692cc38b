//! The captures of the session: take, judge, exclude.

mod columns;
mod flags;
mod row;
mod selecting;
mod table;

use egui::{Align, Button, DragValue, Frame, Layout, Margin, RichText, Spinner, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_session::CaptureId;

use crate::capture::rows::{self, CaptureTable};
use crate::guided::section::{begin_ui, is_wanted, progress_ui};
use crate::live::textures::Thumbnails;
use crate::shell::asked::asked_ui;
use crate::shell::capturing::covers_image;
use crate::shell::capturing::waiting;
use crate::shell::reasons;
use crate::shell::sequence;
use crate::style::marks::{self, Marks};
use crate::style::theme::{self, Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{CaptureOptions, CapturePurpose, CaptureRefused, Model, Moves, PoseSequence};
use handeye_workbench::scene::CaptureUse;
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{capture, session, taught};

/// Most images that are averaged: more take longer than they help.
const MOST_FRAMES: u32 = 64;
/// A lower pane has lower buttons and rows, so that there is room for some.
const LOW: f32 = 300.0;
/// Height of what is shown in place of the table, in the narrowest pane of a window of 1024 × 700.
const NOTHING_YET: f32 = 130.0;
/// Height of the line at the bottom that shows how captures go.
const STATUS: f32 = 36.0;

/// The pane.
pub fn poses_ui(ui: &mut Ui, model: &Model, thumbnails: &mut Thumbnails, outbox: &mut Outbox) {
    let language = model.view.language;
    let table = rows::table(ui.ctx(), model);
    let (button, row) = if ui.available_height() < LOW { (26.0, row::LOW_HEIGHT) } else { (32.0, row::HEIGHT) };
    let row = theme::least(ui, 0.0, row).y;
    Frame::new().inner_margin(Margin { left: 10, right: 10, top: 8, bottom: 4 }).show(ui, |ui| {
        ui.spacing_mut().interact_size.y = ui.spacing().interact_size.y.min(button);
        ui.spacing_mut().item_spacing.y = 4.0;
        actions_ui(ui, model, &table, button, outbox);
        if let Some(hand) = &model.by_hand {
            crate::by_hand::section::progress_ui(ui, model, hand, outbox);
        } else if let Some(sequence) = &model.sequence {
            progress_ui(ui, model, sequence, outbox);
            if sequence.guided.is_none() && !sequence.is_planned() {
                sequence::visits_ui(ui, model, sequence, outbox);
            }
        }
        if !model.sequence_runs || model.sequence.as_ref().is_none_or(|sequence| sequence.guided.is_none()) {
            asked_ui(ui, model, outbox);
        }
    });
    let room = ui.available_rect_before_wrap();
    let has_status = model.capture.is_some() || kept_refusal(model).is_some();
    let (mut above, mut below) = (room, room);
    if has_status {
        above.max.y -= STATUS;
        below.min.y = above.max.y;
    }
    ui.advance_cursor_after_rect(room);
    ui.scope_builder(egui::UiBuilder::new().max_rect(above), |ui| {
        if table.rows.is_empty() {
            let by_hand = tr!(
                language,
                "With the whole board in the image, Guide me says how to move the robot. Or press Space at ten poses with the board \
                 tilted and turned to all sides."
            );
            let by_itself = tr!(
                language,
                "With the whole board in the image, Calibrate for me moves the arm from pose to pose, and Guide me says how \
                 to move it yourself. Or press Space at ten poses with the board tilted and turned to all sides."
            );
            let detail = if model.takes_chosen_poses() { by_itself } else { by_hand };
            let title = tr!(language, "No captures yet");
            marks::nothing_yet_but_ui(ui, title, detail, NOTHING_YET, |ui| sample_ui(ui, model, outbox));
        } else {
            table::table_ui(ui, model, &table, row, thumbnails, outbox);
        }
    });
    if has_status {
        ui.scope_builder(egui::UiBuilder::new().max_rect(below).id_salt("status"), |ui| status_ui(ui, model, outbox));
    }
}

/// Something to look at before anything was captured.
fn sample_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    if model.sequence_runs || model.by_hand.is_some() || model.capture.is_some() {
        return;
    }
    let language = model.view.language;
    ui.add_space(8.0);
    let what = tr!(
        language,
        "Twelve photographs of a board and the robot's poses, which come with the program: copied into a session of their own"
    );
    let button = ui.add_enabled(!model.opening, Button::new(tr!(language, "Open a sample")));
    if button.on_hover_text(what).clicked() {
        outbox.send(session::Command::OpenSample);
    }
}

/// Buttons that take captures, and those for the selected ones.
fn actions_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, height: f32, outbox: &mut Outbox) {
    let language = model.view.language;
    let hindrance = reasons::hindrance(model);
    ui.horizontal_wrapped(|ui| {
        let mut capture_ui = |ui: &mut Ui, button: Button<'_>, name: &str, what: &str, purpose| {
            let response = ui.add_enabled(hindrance.is_none(), button).on_hover_text(what);
            let response = match hindrance {
                Some(why) => response.on_disabled_hover_text(why),
                None => response,
            };
            response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, hindrance.is_none(), name));
            if response.clicked() {
                outbox.send(capture::Command::Take(purpose));
            }
        };
        let name = tr!(language, "Capture");
        let words = RichText::new(name).strong().size(15.0).color(Marks::of(ui).on_accent);
        let key = RichText::new(tr!(language, "Space")).size(11.0).color(Marks::of(ui).on_accent.gamma_multiply(0.75));
        let big = Button::new(words).fill(Palette::of(ui).accent).min_size(Vec2::new(130.0, height)).shortcut_text(key);
        let what = tr!(language, "Waits until robot and image stand still, then keeps image, depth and robot pose");
        capture_ui(ui, big, name, what, CapturePurpose::Calibrate);
        let name = tr!(language, "Capture for verification");
        let what = tr!(language, "This capture never enters the fit and shows how good the calibration is");
        capture_ui(ui, Button::new(name).min_size(Vec2::new(0.0, height)), name, what, CapturePurpose::Verify);
        frames_ui(ui, model.view.capture, language, outbox);
        sequence_ui(ui, model, hindrance, height, outbox);
        selected_ui(ui, model, table, outbox);
    });
}

/// The whole set with one click: for a user who has never calibrated anything.
fn sequence_ui(ui: &mut Ui, model: &Model, hindrance: Option<&'static str>, height: f32, outbox: &mut Outbox) {
    let language = model.view.language;
    if model.sequence_runs {
        if ui.button(tr!(language, "Stop the sequence")).clicked() {
            outbox.send(taught::Command::StopSequence);
        }
        return;
    }
    if model.by_hand.is_some() {
        return;
    }
    // A guided one ends with checks, which are captures for verification.
    let is_ours = |it: &&PoseSequence| it.guided.is_some() || it.purpose == Some(CapturePurpose::Calibrate);
    if is_wanted(model) {
        begin_ui(ui, model, hindrance, height, outbox);
        crate::by_hand::section::begin_ui(ui, model, hindrance, height, outbox);
    }
    if let Some(sequence) = model.sequence.as_ref().filter(is_ours) {
        sequence::continue_ui(ui, model, sequence, outbox);
    }
    let count = model.taught().len();
    // With captures in the table the sequence is in the pane of the taught poses.
    if count == 0 || !model.document().captures.is_empty() || model.moves() == Moves::Never {
        return;
    }
    let name = text!("Run the {count} taught {count|pose|poses}", count = count).in_language(language);
    let what = tr!(language, "Moves to one taught pose after the other and captures at each");
    let button = ui.add_enabled(hindrance.is_none(), Button::new(name).min_size(Vec2::new(0.0, height)));
    let button = match hindrance {
        Some(why) => button.on_disabled_hover_text(why),
        None => button.on_hover_text(what),
    };
    if button.clicked() {
        outbox.send(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
    }
}

fn frames_ui(ui: &mut Ui, options: CaptureOptions, language: Language, outbox: &mut Outbox) {
    let name = tr!(language, "Images to average");
    let mut frames = options.frames;
    let suffix = if frames == 1 { tr!(language, " image") } else { tr!(language, " images averaged") };
    let drag = DragValue::new(&mut frames).range(1..=MOST_FRAMES).speed(0.1).suffix(suffix);
    let what = tr!(language, "The mean of several images has less noise: four images halve it");
    let response = ui.add(drag).on_hover_text(what);
    response.widget_info(|| WidgetInfo {
        value: Some(f64::from(frames)),
        ..WidgetInfo::labeled(WidgetType::DragValue, true, name)
    });
    if frames != options.frames {
        outbox.send(capture::Command::SetOptions(CaptureOptions { frames, ..options }));
    }
}

/// What can be done with the selected captures.
fn selected_ui(ui: &mut Ui, model: &Model, table: &CaptureTable, outbox: &mut Outbox) {
    let language = model.view.language;
    let ids: Vec<CaptureId> = model.selection.iter().copied().filter(|&id| table.row(id).is_some()).collect();
    if ids.is_empty() {
        if !table.rows.is_empty() {
            // As a whole on the next line when there is no room.
            let words = counted(table, language);
            ui.add(egui::Label::new(RichText::new(words).color(Palette::of(ui).weak)).extend());
        }
        return;
    }
    let count = ids.len();
    let all_out = ids.iter().all(|&id| table.row(id).is_some_and(|row| row.excluded));
    let (name, what) = if all_out {
        let what = tr!(language, "Puts the selected captures back to what they were for");
        (text!("Include {count}", count = count), what)
    } else {
        let what = tr!(language, "Takes the selected captures out of fit and verification; they stay in the session");
        (text!("Exclude {count}", count = count), what)
    };
    if ui.button(name.in_language(language)).on_hover_text(what).clicked() {
        outbox.send(session::Command::SetExcluded { ids: ids.clone(), excluded: !all_out });
    }
    let what = tr!(language, "Deletes the selected captures; undo brings them back");
    if ui.button(text!("Delete {count}", count = count).in_language(language)).on_hover_text(what).clicked() {
        outbox.send(session::Command::Delete(ids));
    }
}

/// How many captures there are of each kind that occurs.
fn counted(table: &CaptureTable, language: Language) -> String {
    let (fit, rejected) = (table.count(CaptureUse::Fit), table.count(CaptureUse::Rejected));
    let others = [
        (rejected, if rejected == 1 { tr!(language, "outlier") } else { tr!(language, "outliers") }),
        (table.count(CaptureUse::Verification), tr!(language, "for verification")),
        (table.count(CaptureUse::Excluded), tr!(language, "excluded")),
    ];
    let mut parts = vec![format!("{fit} {}", tr!(language, "in the fit"))];
    parts.extend(others.into_iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}")));
    parts.join(" · ")
}

/// Why the last capture was refused, once the image no longer shows it.
fn kept_refusal(model: &Model) -> Option<&CaptureRefused> {
    model.refused.as_ref().filter(|_| !covers_image(model))
}

/// How the capture goes, or why the last one was refused.
fn status_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let rect = ui.max_rect();
    let (tone, words) = match (&model.capture, kept_refusal(model)) {
        (Some(capture), _) => (Tone::Busy, waiting(capture).in_language(language)),
        (None, Some(refused)) => {
            (Tone::Warning, text!("No capture: {why}", why = refused.why.clone()).in_language(language))
        }
        (None, None) => return,
    };
    ui.painter().rect_filled(rect, 0.0, palette.tinted(tone));
    let inner = rect.shrink2(Vec2::new(10.0, 0.0));
    let layout = Layout::right_to_left(Align::Center);
    ui.scope_builder(egui::UiBuilder::new().max_rect(inner).layout(layout), |ui| {
        if model.capture.is_some() && ui.button(tr!(language, "Cancel capture")).clicked() {
            outbox.send(capture::Command::Cancel);
        }
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            if tone == Tone::Busy {
                ui.add(Spinner::new().size(15.0).color(palette.busy));
            }
            ui.add(egui::Label::new(&words).truncate()).on_hover_text(&words);
        });
    });
}

#[cfg(test)]
mod tests;
