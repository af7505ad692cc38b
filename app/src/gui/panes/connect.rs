//! Which cell the window works with, and how the connection is doing.

use egui::{Button, ComboBox, Grid, Id, Label, RichText, TextEdit, Ui, WidgetInfo, WidgetType};
use handeye_sim_link::client::Endpoint;

use super::{action_ui, form};
use crate::command::{Command, Outbox};
use crate::gui::status;
use crate::gui::theme::{Palette, Tone};
use crate::model::{CellSource, Link, LinkState, Model};
use crate::text::Text;
use crate::{text, tr};

/// What the user is about to connect to; it belongs to nothing but the window.
#[derive(Debug, Clone, Default)]
struct Draft {
    /// Whether an address is wanted; `None` while the user has chosen nothing.
    remote: Option<bool>,
    /// The address; `None` while nothing was typed.
    address: Option<String>,
}

/// The pane.
pub fn connect_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let id = Id::new("connect draft");
    let mut draft: Draft = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    form::body_ui(ui, |ui| {
        state_ui(ui, model, outbox);
        form::heading_ui(ui, tr!(language, "Cell"));
        let remote = draft.remote.unwrap_or(matches!(model.source, CellSource::Address(_)));
        let choices = [
            (false, tr!(language, "Built-in"), tr!(language, "A simulated UR5 cell inside this program")),
            (true, tr!(language, "Address"), tr!(language, "A CoppeliaSim or a cell that is running")),
        ];
        if let Some(choice) = form::choice_ui(ui, remote, &choices) {
            draft.remote = Some(choice);
        }
        let wanted = if remote { address_ui(ui, model, &mut draft) } else { Some(CellSource::BuiltIn) };
        let is_new = wanted.as_ref().is_some_and(|wanted| *wanted != model.source);
        let name = if is_new { tr!(language, "Connect") } else { tr!(language, "Connect again") };
        let palette = Palette::of(ui);
        let button = match is_new {
            true => Button::new(RichText::new(name).color(palette.on_accent)).fill(palette.accent),
            false => Button::new(name),
        };
        let response = ui.add_enabled(wanted.is_some(), button);
        if let Some(source) = wanted.filter(|_| response.clicked()) {
            outbox.send(if is_new { Command::Connect(source) } else { Command::Reconnect });
            draft = Draft::default();
        }
    });
    ui.data_mut(|data| data.insert_temp(id, draft));
}

/// How each connection is doing.
fn state_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let status = status::connection(model);
    form::note_ui(ui, status.tone, &status.title.say(language), &status.detail.say(language));
    action_ui(ui, status.action, language, outbox);
    Grid::new("links").num_columns(2).spacing([24.0, 3.0]).min_row_height(18.0).show(ui, |ui| {
        for (link, name) in [
            (Link::Control, tr!(language, "Robot")),
            (Link::Camera, tr!(language, "Camera")),
            (Link::Motion, tr!(language, "Motions")),
        ] {
            let (tone, words) = words(model, model.link(link));
            let palette = Palette::of(ui);
            ui.label(RichText::new(name).color(palette.weak));
            ui.add(Label::new(RichText::new(words.say(language)).color(palette.tone(tone))).truncate());
            ui.end_row();
        }
    });
}

/// A connection in a few words.
fn words(model: &Model, state: &LinkState) -> (Tone, Text) {
    match state {
        LinkState::StartingCell { .. } => (Tone::Busy, text!("starting")),
        LinkState::Searching { attempt, .. } => (Tone::Busy, text!("searching, try {attempt}", attempt = attempt)),
        LinkState::Connected { server, .. } => (Tone::Good, Text::verbatim(server.clone())),
        LinkState::Lost { since_s, .. } => {
            (Tone::Warning, text!("lost {ago} ago", ago = status::duration(model.now_s - since_s)))
        }
        LinkState::Retrying { since_s, attempt, .. } => {
            let ago = status::duration(model.now_s - since_s);
            (Tone::Warning, text!("lost {ago} ago, try {attempt}", ago = ago, attempt = attempt))
        }
        LinkState::Failed { .. } => (Tone::Bad, text!("failed")),
    }
}

/// The field for the address; the cell when it is a good one.
fn address_ui(ui: &mut Ui, model: &Model, draft: &mut Draft) -> Option<CellSource> {
    let language = model.view.language;
    let mut address = draft.address.clone().unwrap_or_else(|| match (&model.source, model.addresses.first()) {
        (CellSource::Address(address), _) | (CellSource::BuiltIn, Some(address)) => address.clone(),
        (CellSource::BuiltIn, None) => Endpoint::default().to_string(),
    });
    let before = address.clone();
    let name = tr!(language, "Address of the cell");
    ui.horizontal(|ui| {
        let width = (ui.available_width() - 40.0).clamp(80.0, 320.0);
        let field = ui.add(TextEdit::singleline(&mut address).desired_width(width).hint_text("tcp://host:port"));
        field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, name));
        if !model.addresses.is_empty() {
            let history = ComboBox::from_id_salt("addresses").selected_text("").width(20.0).show_ui(ui, |ui| {
                for earlier in &model.addresses {
                    ui.selectable_value(&mut address, earlier.clone(), earlier);
                }
            });
            history.response.on_hover_text(tr!(language, "Earlier addresses"));
        }
    });
    if address != before {
        draft.address = Some(address.clone());
    }
    match address.parse::<Endpoint>() {
        Ok(endpoint) => Some(CellSource::Address(endpoint.to_string())),
        Err(error) => {
            let colour = Palette::of(ui).bad;
            ui.add(Label::new(RichText::new(error.to_string()).color(colour)).wrap());
            None
        }
    }
}
