//! The panes in their tiles: cards with tabs that can be moved.

use egui::{
    Color32, CornerRadius, FontId, Id, Response, Sense, Shape, Stroke, StrokeKind, Style, Ui, Vec2, Visuals,
    style::Spacing,
};
use egui::{WidgetInfo, WidgetText, WidgetType};
use egui_tiles::{Behavior, ResizeState, SimplificationOptions, TabState, TileId, Tiles, UiResponse};

use super::panes::{self, Panes};
use crate::live::textures::Textures;
use crate::shell::layout::{Layout, Slot};
use crate::style::fonts;
use crate::style::theme::{self, CARD_RADIUS, GAP, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::live;
use handeye_workbench::model::{Model, Moves, Pane};
use handeye_workbench::tr;

/// Height of a row of tabs.
const TABS: f32 = 34.0;
/// Room at each side of a tab's title.
const TAB_MARGIN: f32 = 6.0;
/// No tile is dragged smaller than this.
const SMALLEST: f32 = 150.0;

/// All tiles.
pub fn tiles_ui(ui: &mut Ui, model: &Model, textures: &mut Textures, layout: &mut Layout, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    // Behind the tiles, whose places are known only after they were drawn.
    let behind = ui.painter().add(Shape::Noop);
    layout.leave_out(model);
    let mut panes = Panes { model, textures, outbox, pointed: None };
    layout.tree.ui(&mut panes, ui);
    let pointed = panes.pointed;
    if pointed != model.cursor {
        outbox.send(live::Command::PointAt(pointed));
    }
    let bar = tabs_height(ui.spacing());
    let cards = layout.cards().filter_map(|id| layout.tree.tiles.rect(id)).flat_map(|rect| {
        let (radius, edge) = (CornerRadius::same(CARD_RADIUS), Stroke::new(1.0, palette.edge));
        let card = egui::epaint::RectShape::new(rect, radius, palette.card, edge, StrokeKind::Inside);
        let line = Shape::hline(rect.x_range(), rect.top() + bar - 0.5, edge);
        [Shape::from(card), line]
    });
    ui.painter().set(behind, Shape::Vec(cards.collect()));
}

/// Height of a row of tabs: more for touch input.
fn tabs_height(spacing: &Spacing) -> f32 {
    TABS.max(spacing.interact_size.y)
}

impl Behavior<Slot> for Panes<'_> {
    fn pane_ui(&mut self, ui: &mut Ui, _tile: TileId, slot: &mut Slot) -> UiResponse {
        if let Some(pane) = slot.pane() {
            // No part of a pane may touch the edge of its card.
            let inside = ui.max_rect().shrink(1.0);
            ui.scope_builder(egui::UiBuilder::new().max_rect(inside).id_salt(pane), |ui| {
                ui.set_clip_rect(ui.clip_rect().intersect(inside));
                panes::pane_ui(ui, pane, self);
            });
        }
        UiResponse::None
    }

    fn tab_title_for_pane(&mut self, slot: &Slot) -> WidgetText {
        let language = self.model.view.language;
        match slot.pane() {
            // A read-only robot is not jogged.
            Some(Pane::Jog) if self.model.moves() == Moves::Never => tr!(language, "Robot"),
            pane => pane.map_or("", |pane| panes::title(pane, language)),
        }
        .into()
    }

    fn tab_ui(&mut self, tiles: &mut Tiles<Slot>, ui: &mut Ui, id: Id, tile: TileId, state: &TabState) -> Response {
        let palette = Palette::of(ui);
        let title = self.tab_title_for_tile(tiles, tile);
        let font = FontId::new(13.0, if state.active { fonts::semibold() } else { egui::FontFamily::Proportional });
        let galley = title.into_galley(ui, Some(egui::TextWrapMode::Extend), f32::INFINITY, font);
        // As wide as with the heavier letters of the tab in front, so that selecting a tab does not shift the others.
        let width = {
            let heavy = FontId::new(13.0, fonts::semibold());
            let galley = ui.painter().layout_no_wrap(galley.text().to_owned(), heavy, palette.text);
            (galley.size().x + 2.0 * TAB_MARGIN).max(theme::least(ui, 0.0, 0.0).x)
        };
        let (_, rect) = ui.allocate_space(Vec2::new(width, ui.available_height()));
        let response = ui.interact(rect, id, Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, state.active, galley.text()));
        if state.is_being_dragged {
            return response;
        }
        let colour = match (state.active, response.hovered()) {
            (true, _) | (false, true) => palette.text,
            (false, false) => palette.weak,
        };
        let at = rect.center() - galley.size() / 2.0;
        ui.painter().galley_with_override_text_color(at, galley, colour);
        if state.active {
            let under = egui::Rect::from_min_max(
                egui::pos2(rect.left() + TAB_MARGIN, rect.bottom() - 2.5),
                egui::pos2(rect.right() - TAB_MARGIN, rect.bottom()),
            );
            ui.painter().rect_filled(under, CornerRadius::same(1), palette.accent);
        }
        self.on_tab_button(tiles, tile, response)
    }

    fn tab_bar_left_ui(&mut self, _tiles: &Tiles<Slot>, ui: &mut Ui, _tile: TileId, _tabs: &egui_tiles::Tabs) {
        ui.add_space(5.0);
    }

    fn tab_bar_height(&self, style: &Style) -> f32 {
        tabs_height(&style.spacing)
    }

    fn gap_width(&self, _style: &Style) -> f32 {
        GAP
    }

    fn min_size(&self) -> f32 {
        SMALLEST
    }

    fn tab_bar_color(&self, _visuals: &Visuals) -> Color32 {
        Color32::TRANSPARENT
    }

    fn tab_bar_hline_stroke(&self, _visuals: &Visuals) -> Stroke {
        Stroke::NONE
    }

    fn resize_stroke(&self, style: &Style, state: ResizeState) -> Stroke {
        match state {
            ResizeState::Idle => Stroke::NONE,
            ResizeState::Hovering | ResizeState::Dragging => Stroke::new(2.0, style.visuals.hyperlink_color),
        }
    }

    fn drag_preview_color(&self, visuals: &Visuals) -> Color32 {
        visuals.hyperlink_color.gamma_multiply(0.2)
    }

    fn drag_preview_stroke(&self, visuals: &Visuals) -> Stroke {
        Stroke::new(1.5, visuals.hyperlink_color)
    }

    fn simplification_options(&self) -> SimplificationOptions {
        SimplificationOptions { all_panes_must_have_tabs: true, ..SimplificationOptions::default() }
    }
}
