//! Every colour and text size of the window, in both themes.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Vec2, Visuals};

use crate::model::ThemeChoice;

/// Text of captions above numbers.
pub const CAPTION: f32 = 11.0;
/// Titles of empty states.
pub const TITLE: f32 = 21.0;
/// Rounding of cards and banners.
pub const CARD_RADIUS: u8 = 8;
/// Distance between cards, and from cards to the edge.
pub const GAP: f32 = 12.0;

/// Colours with a meaning.
#[derive(Debug, Clone, Copy)]
pub struct Palette {
    /// Behind cards.
    pub backdrop: Color32,
    /// Bars at the top and bottom.
    pub bar: Color32,
    /// Cards.
    pub card: Color32,
    /// Edges of cards and bars.
    pub edge: Color32,
    /// Behind pictures.
    pub well: Color32,
    /// Text that is read.
    pub text: Color32,
    /// Captions and hints.
    pub weak: Color32,
    /// Selections and marks.
    pub accent: Color32,
    /// It works.
    pub good: Color32,
    /// It is being worked on.
    pub busy: Color32,
    /// Look here soon.
    pub warning: Color32,
    /// It failed; stop.
    pub bad: Color32,
    /// Text on `bad`.
    pub on_bad: Color32,
    /// Marks over pictures, and their outline.
    pub mark: Color32,
    /// Outline of marks, which makes them visible on anything.
    pub mark_outline: Color32,
}

const DARK: Palette = Palette {
    backdrop: Color32::from_rgb(20, 22, 27),
    bar: Color32::from_rgb(28, 31, 37),
    card: Color32::from_rgb(28, 31, 37),
    edge: Color32::from_rgb(46, 50, 59),
    well: Color32::from_rgb(13, 14, 17),
    text: Color32::from_rgb(226, 229, 235),
    weak: Color32::from_rgb(142, 149, 162),
    accent: Color32::from_rgb(92, 159, 255),
    good: Color32::from_rgb(70, 193, 118),
    busy: Color32::from_rgb(92, 159, 255),
    warning: Color32::from_rgb(240, 176, 64),
    bad: Color32::from_rgb(214, 60, 60),
    on_bad: Color32::from_rgb(255, 255, 255),
    mark: Color32::from_rgb(255, 255, 255),
    mark_outline: Color32::from_rgb(0, 0, 0),
};

const LIGHT: Palette = Palette {
    backdrop: Color32::from_rgb(238, 240, 244),
    bar: Color32::from_rgb(252, 252, 253),
    card: Color32::from_rgb(252, 252, 253),
    edge: Color32::from_rgb(214, 218, 226),
    well: Color32::from_rgb(226, 229, 235),
    text: Color32::from_rgb(28, 32, 40),
    weak: Color32::from_rgb(96, 104, 118),
    accent: Color32::from_rgb(24, 104, 219),
    good: Color32::from_rgb(24, 138, 74),
    busy: Color32::from_rgb(24, 104, 219),
    warning: Color32::from_rgb(176, 108, 0),
    bad: Color32::from_rgb(200, 36, 36),
    on_bad: Color32::from_rgb(255, 255, 255),
    mark: Color32::from_rgb(255, 255, 255),
    mark_outline: Color32::from_rgb(0, 0, 0),
};

/// How good a state is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// It works.
    Good,
    /// It is being worked on.
    Busy,
    /// Not as it should be.
    Warning,
    /// It failed.
    Bad,
}

impl Palette {
    /// The colours of the theme that `ui` is drawn in.
    pub fn of(ui: &egui::Ui) -> &'static Self {
        if ui.visuals().dark_mode { &DARK } else { &LIGHT }
    }

    /// The colour of a tone.
    pub fn tone(&self, tone: Tone) -> Color32 {
        match tone {
            Tone::Good => self.good,
            Tone::Busy => self.busy,
            Tone::Warning => self.warning,
            Tone::Bad => self.bad,
        }
    }

    /// A surface that hints at a tone.
    pub fn tinted(&self, tone: Tone) -> Color32 {
        self.card.lerp_to_gamma(self.tone(tone), 0.16)
    }
}

/// The tint of a picture that is out of date.
pub fn stale_tint() -> Color32 {
    Color32::from_gray(110)
}

/// The colour of a pixel.
pub fn pixel([red, green, blue]: [u8; 3]) -> Color32 {
    Color32::from_rgb(red, green, blue)
}

/// Sets up both themes; once.
pub fn install(ctx: &egui::Context) {
    ctx.style_mut_of(egui::Theme::Dark, |style| shape(style, Visuals::dark(), &DARK));
    ctx.style_mut_of(egui::Theme::Light, |style| shape(style, Visuals::light(), &LIGHT));
}

/// Switches to a theme.
pub fn choose(ctx: &egui::Context, theme: ThemeChoice) {
    ctx.set_theme(match theme {
        ThemeChoice::Dark => egui::ThemePreference::Dark,
        ThemeChoice::Light => egui::ThemePreference::Light,
    });
}

fn shape(style: &mut egui::Style, visuals: Visuals, palette: &Palette) {
    style.text_styles = [
        (TextStyle::Heading, FontId::new(18.0, FontFamily::Proportional)),
        (TextStyle::Body, FontId::new(14.0, FontFamily::Proportional)),
        (TextStyle::Button, FontId::new(14.0, FontFamily::Proportional)),
        (TextStyle::Small, FontId::new(CAPTION, FontFamily::Proportional)),
        (TextStyle::Monospace, FontId::new(13.0, FontFamily::Monospace)),
    ]
    .into();
    style.spacing.item_spacing = Vec2::new(8.0, 4.0);
    style.spacing.button_padding = Vec2::new(10.0, 4.0);
    style.spacing.interact_size.y = 26.0;
    style.spacing.window_margin = Margin::same(12);
    style.interaction.selectable_labels = false;
    style.visuals = visuals;
    let visuals = &mut style.visuals;
    visuals.panel_fill = palette.backdrop;
    visuals.window_fill = palette.card;
    visuals.window_stroke = Stroke::new(1.0, palette.edge);
    visuals.extreme_bg_color = palette.well;
    visuals.weak_text_color = Some(palette.weak);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.bad;
    visuals.selection.bg_fill = palette.card.lerp_to_gamma(palette.accent, 0.35);
    visuals.selection.stroke = Stroke::new(1.0, palette.text);
    visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, palette.edge);
    visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, palette.text);
    for (widget, lift) in [
        (&mut visuals.widgets.inactive, 0.06),
        (&mut visuals.widgets.hovered, 0.14),
        (&mut visuals.widgets.active, 0.22),
        (&mut visuals.widgets.open, 0.10),
    ] {
        let fill = palette.card.lerp_to_gamma(palette.text, lift);
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.bg_stroke = Stroke::new(1.0, palette.edge);
        widget.fg_stroke = Stroke::new(1.0, palette.text);
        widget.corner_radius = CornerRadius::same(6);
        widget.expansion = 0.0;
    }
}
