//! Whether all text can be read in a small window, with a pointer and with fingers, in both languages.

use egui::accesskit::Role;
use egui::epaint::{ClippedShape, Shape, TextShape};
use egui::{Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use handeye_plan::guided::GuidedOptions;
use handeye_plan::guided::by_hand::Judged;

use super::style::theme;
use crate::by_hand::section::to_do;
use crate::testing::Silent;
use handeye_workbench::by_hand::state::HandWaits;
use handeye_workbench::model::{ByHand, CellSource, Model};
use handeye_workbench::testing::sample;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// A small screen without its bars.
const SIZE: Vec2 = vec2(1024.0, 700.0);

fn texts<'a>(shape: &'a Shape, found: &mut Vec<&'a TextShape>) {
    match shape {
        Shape::Text(text) => found.push(text),
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| texts(shape, found)),
        _ => {}
    }
}

/// Whether a text is shown somewhere completely.
fn is_whole(silent: &Silent, words: &str) -> bool {
    silent.harness.output().shapes.iter().any(|ClippedShape { clip_rect, shape }| {
        let mut found = Vec::new();
        texts(shape, &mut found);
        let is_in_sight = |text: &&TextShape| clip_rect.expand(1.0).contains_rect(text.visual_bounding_rect());
        found.iter().any(|text| text.galley.text() == words && !text.galley.elided && is_in_sight(text))
    })
}

fn small(mut model: Model, language: Language, fingers: bool) -> Silent {
    let mut silent = Silent::built(CellSource::default(), Harness::builder().with_size(SIZE));
    model.view.language = language;
    silent.show_model(model);
    theme::for_fingers(&silent.harness.ctx, fingers);
    silent.steps();
    silent
}

#[test]
fn what_a_person_has_to_do_by_hand_is_whole_over_the_image() {
    for language in Language::ALL {
        let mut model = sample::solved();
        let judged = Judged { present: None, deviation: None, is_good: false };
        let refused_at = model.robot.as_ref().map(|robot| robot.base_from_tip);
        let hand =
            ByHand { judged: Some(judged), refused_at, ..ByHand::new(GuidedOptions::default(), HandWaits::View, 0.0) };
        let words = to_do(&hand).in_language(language);
        model.by_hand = Some(Box::new(hand));
        let silent = small(model, language, false);
        assert!(is_whole(&silent, &words), "{words}");
    }
}

#[test]
fn hints_under_the_image_are_whole() {
    for language in Language::ALL {
        for fingers in [false, true] {
            let silent = small(sample::connected(), language, fingers);
            let hint = if fingers {
                tr!(language, "Touch an image to read a pixel; two fingers zoom, a double tap fits")
            } else {
                tr!(language, "Point at an image to read a pixel; the wheel zooms, a double click fits")
            };
            assert!(is_whole(&silent, hint), "{hint}");
        }
    }
}

#[test]
fn the_line_under_the_tabs_is_under_them_with_a_pointer_and_with_fingers() {
    for fingers in [false, true] {
        let silent = small(sample::connected(), Language::English, fingers);
        let tab = silent.harness.get_by_role_and_label(Role::Button, "Colour").rect();
        let shapes = &silent.harness.output().shapes;
        let mut lines = Vec::new();
        for clipped in shapes {
            horizontals(&clipped.shape, &mut lines);
        }
        let is_under = lines.iter().any(|y| (y - tab.bottom()).abs() < 1.5);
        assert!(is_under, "fingers {fingers}: the tab ends at {}, lines are at {lines:?}", tab.bottom());
    }
}

fn horizontals(shape: &Shape, found: &mut Vec<f32>) {
    match shape {
        Shape::LineSegment { points: [from, to], .. } if from.y == to.y && (to.x - from.x).abs() > 200.0 => {
            found.push(from.y);
        }
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| horizontals(shape, found)),
        _ => {}
    }
}
