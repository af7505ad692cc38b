//! What a recording may mean, before anything of it is written.

mod conventions;
mod places;

use std::sync::Arc;

use egui::{
    Align, Button, ColorImage, Id, Image, Layout, RichText, ScrollArea, TextEdit, TextureHandle, TextureOptions, Ui,
    Vec2, WidgetInfo, WidgetType,
};
use handeye_import::{Hypothesis, Source, Stream, Verdict};
use image::RgbImage;

use crate::style::parts;
use crate::style::theme::{Palette, TITLE, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::import::understand;
use handeye_workbench::model::{Found, ImportState, ImportWork, Model};
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;
use handeye_workbench::{import, shell};

/// Hypotheses that are listed.
const LISTED: usize = 12;
/// Times for reading that can be chosen, seconds; the first is what it begins with.
const READING_S: [u32; 4] = [20, 60, 300, 1800];
/// Height of the first images.
const PREVIEW: f32 = 72.0;

/// The dialog.
pub fn import_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let Some(import) = model.import.as_deref() else { return };
    ui.label(RichText::new(tr!(language, "Import a recording")).size(TITLE).color(Palette::of(ui).text));
    parts::hint_ui(ui, &import.path.display().to_string());
    let room = ui.ctx().content_rect().height() - 230.0;
    ScrollArea::vertical().id_salt("import").max_height(room.max(200.0)).auto_shrink([false, true]).show(ui, |ui| {
        ui.set_width(ui.available_width() - 8.0);
        if let Some(found) = import.found.as_deref() {
            files_ui(ui, found, language);
            images_ui(ui, import, found, language);
        }
        target_ui(ui, import, language, outbox);
        if import.found.as_deref().is_some_and(|found| !found.opened.joints.is_empty()) {
            typed_ui(ui, &Typed::arm(), import, language, outbox);
        }
        let without_size = |stream: &Stream| stream.points.is_some() && stream.size == (0, 0);
        if import.found.as_deref().is_some_and(|found| found.opened.streams.iter().any(without_size)) {
            typed_ui(ui, &Typed::image_size(), import, language, outbox);
        }
        meaning_ui(ui, import, language, outbox);
    });
    buttons_ui(ui, model, import, language, outbox);
}

/// What is in the folder.
fn files_ui(ui: &mut Ui, found: &Found, language: Language) {
    let recording = &found.recording;
    parts::section_ui(ui, tr!(language, "What is there"));
    for belief in &recording.beliefs {
        ui.label(RichText::new(belief.in_language(language)).color(Palette::of(ui).text));
    }
    if let Some(looked) = found.looked.as_deref() {
        for (stream, seen, images) in &looked.seen {
            let line = text!(
                "The target is found in {seen} of {images} {images|image|images} {stream}",
                seen = seen,
                images = images,
                stream = stream
            );
            ui.label(RichText::new(line.in_language(language)).color(Palette::of(ui).text));
        }
        for note in &looked.notes {
            parts::hint_ui(ui, &note.in_language(language));
        }
    }
    for warning in &recording.warnings {
        parts::hint_ui(ui, &warning.in_language(language));
    }
}

/// The first images of what is searched, with the pose that belongs to each by the chosen hypothesis.
fn images_ui(ui: &mut Ui, import: &ImportState, found: &Found, language: Language) {
    let hypothesis = found.hypotheses().get(import.chosen.unwrap_or(0));
    let stream = match hypothesis.map(|h| h.source) {
        Some(Source::Stream(stream)) => stream,
        Some(Source::Track(_)) => return,
        None => 0,
    };
    let Some(previews) = found.previews.get(stream).filter(|previews| !previews.is_empty()) else { return };
    ui.horizontal(|ui| {
        for (index, preview) in previews.iter().enumerate() {
            let image = &found.recording.streams[stream].images[index];
            let pose = hypothesis.and_then(|h| pose_of(found, h, index));
            let size = [preview.width() as usize, preview.height() as usize];
            // The texture is kept with it, so that another recording replaces it.
            let id = Id::new(("image of a recording", index));
            let kept = ui.ctx().data_mut(|data| data.get_temp::<(Arc<RgbImage>, TextureHandle)>(id));
            let texture = kept.filter(|(shown, _)| Arc::ptr_eq(shown, preview)).map_or_else(
                || {
                    let pixels = ColorImage::from_rgb(size, preview.as_raw());
                    let texture = ui.ctx().load_texture("recording", pixels, TextureOptions::LINEAR);
                    ui.ctx().data_mut(|data| data.insert_temp(id, (Arc::clone(preview), texture.clone())));
                    texture
                },
                |(_, texture)| texture,
            );
            ui.vertical(|ui| {
                let width = PREVIEW * size[0] as f32 / size[1].max(1) as f32;
                let shown = ui.add(Image::new(&texture).fit_to_exact_size(Vec2::new(width, PREVIEW)));
                let named = text!("Image {name}", name = image.shown());
                shown.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, named.in_language(language)));
                parts::caption_ui(ui, &image.shown());
                parts::caption_ui(ui, &pose.unwrap_or_else(|| "–".to_owned()));
            });
        }
    });
}

/// The position of the tip, in short.
fn pose_of(found: &Found, h: &Hypothesis, image: usize) -> Option<String> {
    let sample = h.pairing.image_of.iter().position(|of| *of == Some(image))?;
    let tip = h.base_from_tip(&found.recording.tracks[h.robot].samples[sample])?.translation() * 1e3;
    Some(format!("{:.0} {:.0} {:.0} mm", tip.x, tip.y, tip.z))
}

fn target_ui(ui: &mut Ui, import: &ImportState, language: Language, outbox: &mut Outbox) {
    parts::section_ui(ui, tr!(language, "Target"));
    // Another recording has its own.
    let id = Id::new(("target of the recording", &import.path));
    let mut typed: String = ui.data_mut(|data| data.get_temp(id)).unwrap_or_else(|| import.target.clone());
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut typed)
            .desired_width(ui.available_width() - 120.0)
            .char_limit(400)
            .hint_text(tr!(language, "10x7x15, or as the files have it"));
        let response = ui.add(field);
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, tr!(language, "Target")));
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if ui.button(tr!(language, "Look again")).clicked() || entered {
            outbox.send(import::Command::SetTarget(typed.clone()));
        }
    });
    ui.data_mut(|data| data.insert_temp(id, typed));
    parts::hint_ui(
        ui,
        tr!(
            language,
            "Inner corners and the square in mm; or kind=charuco,columns=4,rows=6,square=33,marker=20,dictionary=6x6_250"
        ),
    );
}

/// Settings that the user types; the others are chosen among what the data allow.
const ARM: &str = "arm";
const IMAGE_SIZE: &str = "image_size";

fn is_typed(key: &str) -> bool {
    matches!(key, ARM | IMAGE_SIZE)
}

/// A setting that the user types.
struct Typed {
    key: &'static str,
    label: Text,
    example: &'static str,
    button: Text,
    hint: Text,
}

impl Typed {
    /// The arm that makes poses of joint values.
    fn arm() -> Self {
        Self {
            key: ARM,
            label: text!("Arm"),
            example: "ur5e, robot.urdf",
            button: text!("Compute poses"),
            hint: text!("Poses are computed from joint values by the chain of this arm, built in or in a URDF file."),
        }
    }

    /// The size of the images that corners come from.
    fn image_size() -> Self {
        Self {
            key: IMAGE_SIZE,
            label: text!("Image size"),
            example: "1280x720",
            button: text!("Look again"),
            hint: text!("The files have corners without their images: width and height of the images in pixels."),
        }
    }
}

fn typed_ui(ui: &mut Ui, of: &Typed, import: &ImportState, language: Language, outbox: &mut Outbox) {
    let id = Id::new(("typed setting of the recording", of.key, &import.path));
    let known = || import.fixed.get(of.key).cloned().unwrap_or_default();
    let mut typed: String = ui.data_mut(|data| data.get_temp(id)).unwrap_or_else(known);
    let label = of.label.in_language(language);
    parts::row_ui(ui, &label, |ui| {
        let field = TextEdit::singleline(&mut typed).desired_width(260.0).char_limit(400).hint_text(of.example);
        let response = ui.add(field);
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, &label));
        let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        if ui.button(of.button.in_language(language)).clicked() || entered {
            let value = (!typed.trim().is_empty()).then(|| typed.trim().to_owned());
            outbox.send(import::Command::FixConvention { key: of.key.to_owned(), value });
        }
    });
    ui.data_mut(|data| data.insert_temp(id, typed));
    parts::hint_ui(ui, &of.hint.in_language(language));
}

/// The hypotheses.
fn meaning_ui(ui: &mut Ui, import: &ImportState, language: Language, outbox: &mut Outbox) {
    parts::section_ui(ui, tr!(language, "Possible interpretations"));
    if let Some(work) = import.work {
        let (reported, part) = text_of(work);
        if parts::progress_ui(ui, part, &reported.in_language(language), tr!(language, "Cancel")) {
            outbox.send(shell::Command::SetDialog(None));
        }
        return;
    }
    if let Some(why) = &import.trouble {
        parts::notice_ui(ui, Tone::Warning, &why.in_language(language), |_| ());
    }
    let Some(found) = import.found.as_deref() else {
        if import.trouble.is_some() {
            time_ui(ui, import, language, outbox);
        }
        return;
    };
    let Some(judgement) = &found.judgement else {
        if found.has_images() {
            parts::hint_ui(ui, tr!(language, "The camera alone can be calibrated with these images."));
        }
        let formats = Text::list(understand::formats_text());
        parts::hint_ui(ui, &text!("Formats that are read: {formats}", formats = formats).in_language(language));
        return;
    };
    let (tone, verdict) = match &judgement.verdict {
        Verdict::Decided => (Tone::Good, text!("One of {tried} explains the recording.", tried = judgement.tried)),
        Verdict::Ambiguous(_) if judgement.is_open_in_mode_alone() => (
            Tone::Warning,
            text!(
                "Everything is determined except where the camera is mounted, which the data cannot show: on the robot, or beside it? Choose it below."
            ),
        ),
        Verdict::Ambiguous(count) => (
            Tone::Warning,
            text!(
                "{count} of {tried} explain the recording, and the data cannot tell which is right: choose one, or fix what you know.",
                count = count,
                tried = judgement.tried
            ),
        ),
        Verdict::Unexplained => (
            Tone::Bad,
            text!(
                "None of {tried} explains the recording: images and poses may not belong together, or the target may be a different one.",
                tried = judgement.tried
            ),
        ),
    };
    parts::notice_ui(ui, tone, &verdict.in_language(language), |_| ());
    if judgement.untried + judgement.sources_untried > 0 {
        parts::hint_ui(ui, &understand::untried_text(judgement).in_language(language));
    }
    conventions::fixed_ui(ui, import, found, language, outbox);
    ui.horizontal_top(|ui| {
        let width = ui.available_width() - places::SIDE - 12.0;
        ui.vertical(|ui| {
            ui.set_width(width);
            list_ui(ui, import, found, language, outbox);
        });
        let shown = found.hypotheses().get(import.chosen.unwrap_or(0));
        if let Some(shown) = shown {
            places::places_ui(ui, found, shown, language);
        }
    });
}

/// How long the files may be read, if that was not enough.
fn time_ui(ui: &mut Ui, import: &ImportState, language: Language, outbox: &mut Outbox) {
    let now = import.time.as_secs();
    parts::row_ui(ui, tr!(language, "Time for reading"), |ui| {
        for seconds in READING_S {
            let reported = text!("{seconds} s", seconds = seconds).in_language(language);
            if ui.radio(now == u64::from(seconds), reported).clicked() {
                outbox.send(import::Command::SetTime(seconds));
            }
        }
    });
}

fn text_of(work: ImportWork) -> (Text, f32) {
    let part = |done: usize, of: usize| done as f32 / of.max(1) as f32;
    match work {
        ImportWork::Looking(_, 0) => (text!("Reading the files"), 0.0),
        ImportWork::Looking(done, of) => {
            (text!("{done} of {of} images looked at", done = done, of = of), part(done, of))
        }
        ImportWork::Writing(done, of) => (text!("{done} of {of} images copied", done = done, of = of), part(done, of)),
    }
}

fn list_ui(ui: &mut Ui, import: &ImportState, found: &Found, language: Language, outbox: &mut Outbox) {
    let differing = conventions::differing(found);
    for (place, h) in found.hypotheses().iter().take(LISTED).enumerate() {
        let fit = h.fit.as_ref().map_or_else(
            || tr!(language, "no solution").to_owned(),
            |fit| format!("{:.2} mm  {:.3}°", fit.median_m * 1e3, fit.median_rad.to_degrees()),
        );
        let of: Vec<String> = h
            .conventions(&found.recording)
            .into_iter()
            .filter(|convention| differing.contains(&convention.key))
            .map(|convention| convention.value)
            .collect();
        let line = format!("{}.  {fit}  {}", place + 1, of.join("  "));
        let colour = if h.explains() { Palette::of(ui).text } else { Palette::of(ui).weak };
        let chosen = import.chosen == Some(place);
        if ui.radio(chosen, RichText::new(line).color(colour)).clicked() {
            outbox.send(import::Command::ChooseHypothesis(place));
        }
        if chosen && let Some(fit) = &h.fit {
            let (camera, target) = (fit.camera_at_m * 1e3, fit.target_at_m * 1e3);
            let line = text!(
                "{views} views; the camera {camera} mm and the target {target} mm from what carries them; {off} {off|view disagrees|views disagree}",
                views = fit.views,
                camera = format!("{camera:.0}"),
                target = format!("{target:.0}"),
                off = fit.disagreeing.len()
            );
            parts::hint_ui(ui, &line.in_language(language));
            for why in &h.contradictions {
                parts::hint_ui(ui, &why.in_language(language));
            }
        }
    }
    parts::hint_ui(
        ui,
        tr!(
            language,
            "Median distance and angle between where robot and camera put the target: how well they agree, not how accurate \
             the result is."
        ),
    );
}

fn buttons_ui(ui: &mut Ui, model: &Model, import: &ImportState, language: Language, outbox: &mut Outbox) {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let can = import.chosen.is_some() && import.work.is_none() && !model.opening;
        let reason = if can { None } else { Some(tr!(language, "Choose an interpretation first")) };
        let button = Button::new(RichText::new(tr!(language, "Import")).strong());
        if parts::gated_ui(ui, reason, button).clicked() {
            outbox.send(import::Command::ConvertRecording);
        }
        if let Some(found) = import.found.as_deref().filter(|found| found.has_images()) {
            let is_busy = import.work.is_some() || model.opening;
            let reason =
                if found.target().is_some() { None } else { Some(tr!(language, "Say first what the target is")) };
            let reason = if is_busy { Some(tr!(language, "Just a moment…")) } else { reason };
            let button = Button::new(tr!(language, "Calibrate the camera alone"));
            let what = tr!(language, "The intrinsics from the images, without the poses of a robot");
            if parts::gated_ui(ui, reason, button).on_hover_text(what).clicked() {
                outbox.send(import::Command::ConvertImages);
            }
        }
        if ui.button(tr!(language, "Close")).clicked() {
            outbox.send(shell::Command::SetDialog(None));
        }
        if model.opening {
            parts::hint_ui(ui, tr!(language, "Just a moment…"));
        }
    });
}

#[cfg(test)]
#[path = "dialog_tests.rs"]
mod tests;
