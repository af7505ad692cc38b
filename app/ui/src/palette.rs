//! The command palette: type a few letters of what you want, press Enter.

use egui::{
    Align2, Area, Context, CornerRadius, FontId, Frame, Id, Key, Margin, Modifiers, Order, ScrollArea, Sense, Stroke,
    TextEdit, Ui, Vec2, WidgetInfo, WidgetType,
};

use super::actions::{self, Action};
use super::dialogs;
use super::style::theme::{CAPTION, Palette};
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::Model;
use handeye_workbench::shell;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Width of the palette.
const WIDTH: f32 = 520.0;
/// Height of a line.
const ROW: f32 = 30.0;
/// Lines that are visible at once.
const ROWS: f32 = 11.0;

/// Letters that can be typed; no command has a longer name.
const LONGEST: usize = 64;

/// What is typed and chosen.
#[derive(Debug, Default)]
pub struct CommandPalette {
    typed: String,
    chosen: usize,
}

impl CommandPalette {
    /// Draws it over the window.
    pub fn palette_ui(&mut self, ctx: &Context, model: &Model, outbox: &mut Outbox) {
        let language = model.view.language;
        let found = found(model, language, &self.typed);
        self.chosen = self.chosen.min(found.len().saturating_sub(1));
        // Before the text field, which would move its cursor.
        let step = ctx.input_mut(|input| {
            let count = |input: &mut egui::InputState, key| input.count_and_consume_key(Modifiers::NONE, key) as isize;
            count(input, Key::ArrowDown) - count(input, Key::ArrowUp)
        });
        self.chosen = self.chosen.saturating_add_signed(step).min(found.len().saturating_sub(1));
        let enter = ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Enter));
        let top = ctx.content_rect().center_top() + Vec2::new(0.0, 90.0);
        let area = Area::new(Id::new("command palette")).order(Order::Foreground).pivot(Align2::CENTER_TOP);
        let shown = area.fixed_pos(top).show(ctx, |ui| {
            let frame = Frame::popup(ui.style()).inner_margin(Margin::same(10));
            frame.show(ui, |ui| self.content_ui(ui, &found, step != 0, language)).inner
        });
        let clicked = shown.inner;
        let outside = dialogs::pressed_outside(ctx, shown.response.rect);
        let choice = if enter { Some(self.chosen) } else { clicked };
        if let Some(action) = choice.and_then(|index| found.get(index)) {
            if action.available {
                outbox.send(shell::Command::SetDialog(None));
                outbox.send(action.command.clone());
            }
        } else if outside {
            outbox.send(shell::Command::SetDialog(None));
        }
    }

    /// The line that was clicked.
    fn content_ui(&mut self, ui: &mut Ui, found: &[Action], moved: bool, language: Language) -> Option<usize> {
        let palette = Palette::of(ui);
        ui.set_width(WIDTH);
        let hint = tr!(language, "Type a command");
        let field =
            ui.add(TextEdit::singleline(&mut self.typed).char_limit(LONGEST).hint_text(hint).desired_width(WIDTH));
        field.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, hint));
        field.request_focus();
        if field.changed() {
            self.chosen = 0;
        }
        ui.add_space(6.0);
        if found.is_empty() {
            ui.label(egui::RichText::new(tr!(language, "No command of that name")).color(palette.weak));
            return None;
        }
        let mut clicked = None;
        ui.spacing_mut().item_spacing.y = 0.0;
        ScrollArea::vertical().max_height(ROW * ROWS).auto_shrink([false, true]).show(ui, |ui| {
            for (index, action) in found.iter().enumerate() {
                let is_chosen = index == self.chosen;
                let response = row_ui(ui, action, is_chosen, language);
                if is_chosen && moved {
                    response.scroll_to_me(None);
                }
                if response.clicked() {
                    clicked = Some(index);
                }
            }
        });
        clicked
    }
}

fn row_ui(ui: &mut Ui, action: &Action, is_chosen: bool, language: Language) -> egui::Response {
    let palette = Palette::of(ui);
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW), Sense::click());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, action.available, action.name));
    if is_chosen || response.hovered() {
        let fill = if is_chosen { palette.card.lerp_to_gamma(palette.accent, 0.18) } else { palette.raised() };
        ui.painter().rect(rect, CornerRadius::same(5), fill, Stroke::NONE, egui::StrokeKind::Inside);
    }
    let colour = if action.available { palette.text } else { palette.weak };
    let left = rect.left_center() + Vec2::new(10.0, 0.0);
    let name = ui.painter().text(left, Align2::LEFT_CENTER, action.name, FontId::proportional(13.0), colour);
    let small = FontId::proportional(CAPTION);
    let group = name.right_center() + Vec2::new(10.0, 1.0);
    ui.painter().text(group, Align2::LEFT_CENTER, action.group.name(language), small.clone(), palette.weak);
    let right = rect.right_center() - Vec2::new(12.0, 0.0);
    let keys = actions::keys_text(ui.ctx(), action).join("  ");
    ui.painter().text(right, Align2::RIGHT_CENTER, keys, small, palette.weak);
    response
}

/// The actions that match what is typed, best first. English words find them in every language.
fn found(model: &Model, language: Language, typed: &str) -> Vec<Action> {
    let english = actions::all(model, Language::English);
    let mut found: Vec<_> = actions::all(model, language)
        .into_iter()
        .zip(english)
        .filter(|(action, _)| {
            action.command != Command::Shell(shell::Command::SetDialog(Some(handeye_workbench::model::Dialog::Palette)))
        })
        .filter_map(|(action, english)| {
            let score = fit(action.name, typed).into_iter().chain(fit(english.name, typed)).max()?;
            Some((score, action))
        })
        .collect();
    found.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    found.into_iter().map(|(_, action)| action).collect()
}

/// How well a name matches the typed letters, which must occur in it in order; `None` if they do not. Consecutive
/// letters count most, then first letters of words; skipped letters cost.
fn fit(name: &str, typed: &str) -> Option<i32> {
    let name: Vec<char> = name.to_lowercase().chars().collect();
    let begins_word = |at: usize| at == 0 || !name[at - 1].is_alphanumeric();
    // For each place in the name the best score of the letters so far, the last of which is at this place.
    let mut ends: Option<Vec<Option<i32>>> = None;
    for letter in typed.to_lowercase().chars().filter(|letter| !letter.is_whitespace()) {
        let score = |at: usize| {
            if name[at] != letter {
                return None;
            }
            let first = if begins_word(at) { 3 } else { 0 };
            let jumped = |letters: usize| letters.min(3) as i32;
            match &ends {
                None => Some(first - jumped(at)),
                Some(ends) => (0..at)
                    .filter_map(|last| {
                        let gap = at - last - 1;
                        Some(ends[last]? + if gap == 0 { 4 } else { first - jumped(gap) })
                    })
                    .max(),
            }
        };
        ends = Some((0..name.len()).map(score).collect());
    }
    match ends {
        None => Some(0),
        Some(ends) => ends.into_iter().flatten().max(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_workbench::model::{CellSource, ViewSettings};

    fn best(typed: &str, language: Language) -> Option<&'static str> {
        let model = Model::new(CellSource::default(), ViewSettings::default());
        found(&model, language, typed).first().map(|action| action.name)
    }

    #[test]
    fn a_few_letters_find_a_command() {
        for (typed, name) in
            [("reset l", "Reset layout"), ("rl", "Reset layout"), ("light", "Light theme"), ("stop", "Stop the arm")]
        {
            assert_eq!(best(typed, Language::English), Some(name), "{typed}");
        }
        assert_eq!(best("xyzzy", Language::English), None);
    }

    #[test]
    fn no_command_has_a_longer_name_than_can_be_typed() {
        let model = Model::new(CellSource::default(), ViewSettings::default());
        for language in Language::ALL {
            for action in actions::all(&model, language) {
                assert!(action.name.chars().count() <= LONGEST, "{}", action.name);
            }
        }
    }

    #[test]
    fn english_letters_find_a_command_in_chinese() {
        assert_eq!(best("reset l", Language::Chinese), Some(tr!(Language::Chinese, "Reset layout")));
    }
}
