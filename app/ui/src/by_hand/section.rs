//! What the guided user has to do, in the pane of the poses.

use egui::{Button, RichText, Spinner, Ui, Vec2};
use handeye_plan::guided::CHECKS;

use crate::guided::section::error_ui;
use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::by_hand;
use handeye_workbench::by_hand::state::{ByHand, HandWaits};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::text::Text;
use handeye_workbench::tr;

/// The start button.
pub fn begin_ui(ui: &mut Ui, model: &Model, hindrance: Option<&'static str>, height: f32, outbox: &mut Outbox) {
    let language = model.view.language;
    let reason = hindrance.or_else(|| blocked(model));
    let button = Button::new(tr!(language, "Guide me")).min_size(Vec2::new(0.0, height));
    let what = tr!(
        language,
        "For an arm that you move yourself: shows how the board is to look in the image and what to change, and captures by \
         itself when the view is good enough and the robot stands still"
    );
    if parts::gated_ui(ui, reason, button).on_hover_text(what).clicked() {
        outbox.send(by_hand::Command::Guide);
    }
}

/// Why it cannot begin.
pub fn blocked(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    if model.intrinsics().is_none() {
        Some(tr!(language, "Nothing is known of the lens yet: connect a cell or solve once"))
    } else if model.board_seen_s.is_none() && model.document().captures.is_empty() {
        Some(tr!(language, "The board has not been seen: move the arm until the whole board is in the image"))
    } else {
        None
    }
}

/// What to do now, why, and the two ways out.
pub fn progress_ui(ui: &mut Ui, model: &Model, hand: &ByHand, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.horizontal_wrapped(|ui| {
        if matches!(hand.waits, HandWaits::Answer | HandWaits::Choice) {
            ui.add(Spinner::new().size(14.0).color(Palette::of(ui).busy));
        }
        ui.label(RichText::new(to_do(hand).in_language(language)).strong().size(15.0));
    });
    if let Some(why) = hand.wanted.as_ref().and_then(|wanted| wanted.why) {
        parts::hint_ui(ui, &why.text().in_language(language));
    }
    let left = hand.wanted.as_ref().and_then(|wanted| wanted.views_left).filter(|views| *views > 0);
    error_ui(ui, model, hand.guide.guide(), left.map(|views| text!("about {n} more {n|pose|poses}", n = views)));
    ui.horizontal_wrapped(|ui| {
        let what = tr!(language, "Leaves this view and those near it out, and asks for another one");
        let button = ui.add_enabled(hand.waits == HandWaits::View, Button::new(tr!(language, "Skip this view")));
        if button.on_hover_text(what).clicked() {
            outbox.send(by_hand::Command::SkipView);
        }
        if ui.button(tr!(language, "Stop guiding")).clicked() {
            outbox.send(by_hand::Command::StopGuiding);
        }
    });
}

/// What the user has to do now.
pub fn to_do(hand: &ByHand) -> Text {
    match (hand.waits, hand.judged) {
        (HandWaits::Answer, _) => text!("Solving…"),
        (HandWaits::Choice, _) if hand.ending.is_some() => {
            text!("Check {n} of {of}: a pose that is not in the fit", n = hand.checked + 1, of = CHECKS)
        }
        (HandWaits::Choice, _) => text!("Choosing the next view"),
        (HandWaits::Capture, _) => text!("Hold still"),
        (HandWaits::View, Some(_)) if hand.refused_at.is_some() => {
            text!("There was no capture here: move on, and hold still in another place")
        }
        (HandWaits::View, None) => text!("The board is not seen: bring the whole board into the image"),
        (HandWaits::View, Some(judged)) if judged.is_good => text!("Good: hold still"),
        (HandWaits::View, Some(judged)) => {
            let advice = judged.deviation.and_then(|deviation| deviation.advice());
            // Near the view, but the board is cut off by the edge of the image.
            advice.unwrap_or_else(|| text!("The whole board has to be in the image: bring it towards the middle"))
        }
    }
}
