//! Whether the board is followed, in a colour and in words.

use egui::{RichText, Ui};
use handeye_track::State;

use crate::status::STALE_AFTER_S;
use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::model::Model;
use handeye_workbench::text::Text;

/// Status of tracking; no tone while it is off.
pub fn state(model: &Model) -> (Option<Tone>, Text) {
    if !model.track.on {
        return (None, text!("The board is not tracked"));
    }
    let Some(newest) = &model.track.newest else {
        return (Some(Tone::Busy), text!("Waiting for the first image…"));
    };
    // What was seen before the camera was lost is outdated.
    if !model.camera.is_connected() {
        return (Some(Tone::Bad), text!("No connection to the camera: the board is not tracked"));
    }
    if model.frame_age_s().is_some_and(|age_s| age_s > STALE_AFTER_S) {
        return (Some(Tone::Warning), text!("No new images: the board is where it was seen last"));
    }
    let update = &newest.update;
    let ago = |since_s: f64| format!("{:.1}", (update.time_s - since_s).max(0.0));
    match update.state {
        State::Searching => (Some(Tone::Busy), text!("Searching for the board")),
        State::Tracking { corners, of } => {
            (Some(Tone::Good), text!("Tracking {corners} of {of} corners", corners = corners, of = of))
        }
        State::Coasting { since_s } => {
            let words = text!("Not seen for {time} s: assumed to go on as it went", time = ago(since_s));
            (Some(Tone::Warning), words)
        }
        State::Lost { since_s } => (Some(Tone::Bad), text!("Lost {time} s ago: searching", time = ago(since_s))),
    }
}

/// The state, the rate of poses and their latency.
pub fn state_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let (tone, words) = state(model);
    let colour = tone.map_or(palette.weak, |tone| palette.tone(tone));
    // The words wrap together with the dot, not after it.
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        parts::dot_ui(ui, colour);
        ui.label(RichText::new(words.in_language(language)).strong().color(if tone.is_some() {
            colour
        } else {
            palette.text
        }));
    });
    let Some(newest) = model.track.newest.as_ref().filter(|_| model.track.on) else { return };
    let (rate, latency) = (format!("{:.1}", newest.rate_hz), format!("{:.0}", newest.latency_s * 1e3));
    let words = text!("{rate} Hz · {latency} ms", rate = rate, latency = latency).in_language(language);
    let what = handeye_workbench::tr!(
        language,
        "Poses per second, and the time from the arrival of an image to the pose computed from it"
    );
    ui.label(RichText::new(words).color(palette.weak)).on_hover_text(what);
}
