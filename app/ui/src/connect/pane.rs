//! Which cell the window works with, and how the connection is doing.

use egui::text::LayoutJob;
use egui::{Align, Button, ComboBox, FontSelection, Id, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType};
use handeye_coppeliasim::{BadEndpoint, Endpoint};

use crate::connect::{objects, scene};
use crate::status;
use crate::style::theme::{Palette, Tone};
use crate::style::{form, parts};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::connect::server_name;
use handeye_workbench::model::{CellSource, Link, LinkState, Model};
use handeye_workbench::text::Text;
use handeye_workbench::tr;
use handeye_workbench::{connect, session};

/// What the user is about to connect to; known to the window only.
#[derive(Debug, Clone, Default)]
struct Draft {
    /// Which kind of cell is wanted; `None` while the user has chosen nothing.
    kind: Option<Kind>,
    /// The scene of the built-in cell.
    scene: scene::Draft,
    /// The address; `None` while nothing was typed.
    address: Option<String>,
    /// Where the scene there has the parts of the cell.
    objects: objects::Draft,
    /// The drivers of a robot that is driven, and of one that is moved by hand.
    drivers: [Option<crate::connect::drivers::pane::Draft>; 2],
}

/// Kinds of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    BuiltIn,
    Address,
    Driver,
    Freehand,
}

impl Kind {
    fn of(source: &CellSource) -> Self {
        match source {
            CellSource::BuiltIn(_) => Self::BuiltIn,
            CellSource::Address(_) => Self::Address,
            CellSource::Drivers(drivers) if drivers.robot.is_none() => Self::Freehand,
            CellSource::Drivers(_) => Self::Driver,
        }
    }
}

/// The pane.
pub fn connect_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("connect draft");
    let mut draft: Draft = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    form::body_ui(ui, |ui| {
        form::heading_ui(ui, tr!(language, "Cell"));
        let kind = draft.kind.unwrap_or_else(|| Kind::of(&model.source));
        let choices = [
            (Kind::BuiltIn, tr!(language, "Built-in"), tr!(language, "A simulated cell inside this program")),
            (Kind::Address, tr!(language, "CoppeliaSim"), tr!(language, "A CoppeliaSim or a cell that is running")),
            (
                Kind::Driver,
                tr!(language, "Driver"),
                tr!(language, "Any robot and camera, through programs that speak the driver protocol"),
            ),
            (Kind::Freehand, tr!(language, "Freehand"), tr!(language, "A camera, and a robot whose pose you type")),
        ];
        if let Some(choice) = form::choice_ui(ui, kind, &choices) {
            draft.kind = Some(choice);
        }
        let named = match kind {
            Kind::BuiltIn => Some(scene::scene_ui(ui, model, &mut draft.scene)),
            Kind::Address => None,
            Kind::Driver => crate::connect::drivers::pane::drivers_ui(ui, model, false, &mut draft.drivers[0]),
            Kind::Freehand => crate::connect::drivers::pane::drivers_ui(ui, model, true, &mut draft.drivers[1]),
        };
        let wanted = ui.horizontal(|ui| {
            let wanted = match kind {
                Kind::Address => address_ui(ui, model, &mut draft).map(Some),
                Kind::BuiltIn | Kind::Driver | Kind::Freehand => Ok(named),
            };
            if connect_button_ui(ui, model, wanted.as_ref().ok().and_then(Option::as_ref), outbox) {
                draft = Draft::default();
            }
            wanted
        });
        if let Err(error) = wanted.inner {
            let colour = Palette::of(ui).bad;
            ui.add(Label::new(RichText::new(Text::from(error).in_language(language)).color(colour)).wrap());
        }
        if kind == Kind::Address {
            objects::objects_ui(ui, model, &mut draft.objects, outbox);
        }
        ui.add_space(4.0);
        state_ui(ui, model);
        clocks_ui(ui, model);
        session_ui(ui, model, outbox);
    });
    ui.data_mut(|data| data.insert_temp(id, draft));
}

/// Where what is captured is kept.
fn session_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    form::heading_ui(ui, tr!(language, "Session"));
    let folder = model.session.folder.as_ref().unwrap_or(&model.sessions);
    let reported = if model.session.folder.is_some() {
        text!("Captures and results are kept in {folder}", folder = folder.display())
    } else {
        text!(
            "From the first capture on, captures and results are kept in a folder of {folder}",
            folder = folder.display()
        )
    };
    if let (None, Some(last)) = (&model.session.folder, model.recent.first()) {
        let name = last.folder.file_name().unwrap_or(last.folder.as_os_str()).to_string_lossy();
        let words = text!("Open {name} again, {count} {count|capture|captures}", name = name, count = last.captures);
        let button = Button::new(words.in_language(language)).wrap_mode(egui::TextWrapMode::Truncate);
        if ui.add(button).on_hover_text(last.folder.display().to_string()).clicked() {
            outbox.send(session::Command::Open(last.folder.clone()));
        }
    }
    parts::hint_ui(ui, &reported.in_language(language));
    ui.horizontal(|ui| {
        let words =
            if model.in_browser { tr!(language, "Download the folder") } else { tr!(language, "Open the folder") };
        if ui.button(words).clicked() {
            outbox.send(session::Command::OpenFolder(folder.clone()));
        }
        parts::copy_ui(ui, language, tr!(language, "the path of the folder"), || folder.display().to_string());
    });
}

/// How the clocks of a robot and a camera that are two drivers relate.
fn clocks_ui(ui: &mut Ui, model: &Model) {
    let Some([robot_from_camera_s, uncertainty_s]) = model.frame.as_ref().and_then(|frame| frame.info.clocks) else {
        return;
    };
    let reported = text!(
        "Clocks: {ms} ± {uncertainty} ms are added to time stamps of the camera to convert them to the robot's clock",
        ms = format!("{:.1}", robot_from_camera_s * 1e3),
        uncertainty = format!("{:.1}", uncertainty_s * 1e3)
    );
    parts::hint_ui(ui, &reported.in_language(model.view.language));
}

/// How each connection is doing.
fn state_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let status = status::connection(model);
    form::note_ui(ui, status.tone, &status.title.in_language(language), &status.detail.in_language(language));
    ui.horizontal_wrapped(|ui| {
        for (link, name) in [
            (Link::Control, tr!(language, "Robot")),
            (Link::Camera, tr!(language, "Camera")),
            (Link::Motion, tr!(language, "Motions")),
        ] {
            let (tone, words) = words(model, model.link(link));
            let palette = Palette::of(ui);
            // As one, so that both are in one line.
            let mut both = LayoutJob::default();
            let (style, font) = (ui.style(), FontSelection::Default);
            RichText::new(format!("{name} ")).color(palette.weak).append_to(
                &mut both,
                style,
                font.clone(),
                Align::Center,
            );
            let words = RichText::new(words.in_language(language)).color(palette.tone(tone));
            words.append_to(&mut both, style, font, Align::Center);
            ui.add(Label::new(both).extend());
            ui.add_space(10.0);
        }
    });
}

/// A connection in a few words.
fn words(model: &Model, state: &LinkState) -> (Tone, Text) {
    match state {
        LinkState::StartingCell { .. } => (Tone::Busy, text!("starting")),
        LinkState::Searching { attempt, .. } => (Tone::Busy, text!("searching, try {attempt}", attempt = attempt)),
        LinkState::Connected { server, .. } => (Tone::Good, server_name(&model.source, server)),
        LinkState::Lost { since_s, .. } => {
            (Tone::Warning, text!("lost {ago} ago", ago = status::duration(model.now_s - since_s)))
        }
        LinkState::Retrying { since_s, attempt, .. } => {
            let ago = status::duration(model.now_s - since_s);
            (Tone::Warning, text!("lost {ago} ago, try {attempt}", ago = ago, attempt = attempt))
        }
        LinkState::Resting { .. } => (Tone::Warning, text!("not tried")),
        LinkState::Failed { .. } => (Tone::Bad, text!("failed")),
    }
}

/// The button; whether it was pressed.
fn connect_button_ui(ui: &mut Ui, model: &Model, wanted: Option<&CellSource>, outbox: &mut Outbox) -> bool {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let same = wanted.is_some_and(|wanted| *wanted == model.source);
    let button = if same {
        Button::new(tr!(language, "Connect again"))
    } else {
        Button::new(RichText::new(tr!(language, "Connect now")).color(palette.on_accent)).fill(palette.accent)
    };
    let pressed = ui.add_enabled(wanted.is_some(), button).clicked();
    if let Some(source) = wanted.filter(|_| pressed) {
        outbox.send(if same { connect::Command::Reconnect } else { connect::Command::Connect(source.clone()) });
    }
    pressed
}

/// The field for the address; the cell when it is a good one.
fn address_ui(ui: &mut Ui, model: &Model, draft: &mut Draft) -> Result<CellSource, BadEndpoint> {
    let language = model.view.language;
    let mut address = draft.address.clone().unwrap_or_else(|| match (&model.source, model.addresses.first()) {
        (CellSource::Address(address), _) | (_, Some(address)) => address.clone(),
        (_, None) => Endpoint::default().to_string(),
    });
    let before = address.clone();
    let name = tr!(language, "Address of the cell");
    let width = (ui.available_width() - 170.0).clamp(80.0, 260.0);
    let field = TextEdit::singleline(&mut address).char_limit(400).desired_width(width).hint_text("tcp://host:port");
    let field = ui.add(field);
    field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, name));
    if !model.addresses.is_empty() {
        let history = ComboBox::from_id_salt("addresses").selected_text("").width(20.0).show_ui(ui, |ui| {
            for earlier in &model.addresses {
                ui.selectable_value(&mut address, earlier.clone(), earlier);
            }
        });
        history.response.on_hover_text(tr!(language, "Earlier addresses"));
    }
    if address != before {
        draft.address = Some(address.clone());
    }
    address.parse::<Endpoint>().map(|endpoint| CellSource::Address(endpoint.to_string()))
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::model::RecentSession;
    use handeye_workbench::testing::sample;

    #[test]
    fn it_is_said_where_captures_are_kept_and_the_folder_is_opened() {
        let mut model = sample::connected();
        model.sessions = PathBuf::from("/home/me/handeye-sessions");
        let mut pane = Driven::new(connect_ui, model);
        assert!(pane.sees("are kept in a folder of /home/me/handeye-sessions"));
        let sessions = PathBuf::from("/home/me/handeye-sessions");
        assert_eq!(pane.click("Open the folder"), [Command::Session(session::Command::OpenFolder(sessions.clone()))]);
        let session = sessions.join("2026-11-22");
        pane.model().session.folder = Some(session.clone());
        pane.steps();
        assert!(pane.sees("Captures and results are kept in /home/me/handeye-sessions/2026-11-22"));
        assert_eq!(pane.click("Open the folder"), [Command::Session(session::Command::OpenFolder(session))]);
        assert!(pane.nothing_is_cut_off());
    }

    #[test]
    fn the_session_that_was_open_last_is_offered_until_one_is_open() {
        let mut model = sample::connected();
        let last = PathBuf::from("/home/me/handeye-sessions/2026-11-22");
        model.recent = vec![
            RecentSession { folder: last.clone(), captures: 12 },
            RecentSession { folder: PathBuf::from("/home/me/older"), captures: 3 },
        ];
        let mut pane = Driven::new(connect_ui, model);
        assert_eq!(
            pane.click("Open 2026-11-22 again, 12 captures"),
            [Command::Session(session::Command::Open(last.clone()))]
        );
        assert!(pane.nothing_is_cut_off());
        pane.model().session.folder = Some(last);
        pane.steps();
        assert!(!pane.sees("2026-11-22 again"));
    }
}
