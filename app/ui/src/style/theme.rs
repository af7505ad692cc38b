//! Every colour and text size of the window, in both themes.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, RichText, Stroke, TextStyle, Vec2, Visuals};

use super::fonts;
use handeye_workbench::model::{Severity, ThemeChoice};

/// Text of captions above numbers.
pub(crate) const CAPTION: f32 = 11.0;
/// Titles of empty states.
pub(crate) const TITLE: f32 = 19.0;
/// Rounding of cards and banners.
pub(crate) const CARD_RADIUS: u8 = 8;
/// Distance between cards, and from cards to the edge.
pub(crate) const GAP: f32 = 8.0;

/// Height of controls for a pointer \[points\].
const POINTER: f32 = 26.0;
/// Between the edge of a button and its words \[points\].
const PADDING: Vec2 = Vec2::new(10.0, 4.0);
/// Minimum width and height of controls for touch input \[points\].
pub(crate) const FINGER: f32 = 40.0;

/// Colours with a meaning.
#[derive(Debug, Clone, Copy)]
pub struct Palette {
    /// Behind cards.
    pub backdrop: Color32,
    /// Bars at the top and bottom.
    pub bar: Color32,
    pub card: Color32,
    /// Edges of cards and bars.
    pub edge: Color32,
    /// Behind images.
    pub well: Color32,
    /// Text that is read.
    pub text: Color32,
    /// Captions and hints.
    pub weak: Color32,
    /// Selections and marks.
    pub accent: Color32,
    /// Text that is selected, and the edge of what is being typed into.
    pub selected: Color32,
    /// It works.
    pub good: Color32,
    /// It is being worked on.
    pub busy: Color32,
    /// Needs attention soon.
    pub warning: Color32,
    /// It failed; stop.
    pub bad: Color32,
    /// Text on `bad`.
    pub on_bad: Color32,
    /// Text on `accent`.
    pub on_accent: Color32,
    /// A printed board.
    pub paper: Color32,
    /// What is printed on it.
    pub ink: Color32,
    /// The x axis of a frame.
    pub axis_x: Color32,
    /// The y axis of a frame.
    pub axis_y: Color32,
    /// Marks over images, and their outline.
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
    selected: Color32::from_rgb(158, 198, 255),
    good: Color32::from_rgb(70, 193, 118),
    busy: Color32::from_rgb(92, 159, 255),
    warning: Color32::from_rgb(240, 176, 64),
    bad: Color32::from_rgb(214, 60, 60),
    on_bad: Color32::from_rgb(255, 255, 255),
    on_accent: Color32::from_rgb(10, 22, 40),
    paper: Color32::from_rgb(206, 210, 218),
    ink: Color32::from_rgb(30, 33, 40),
    axis_x: Color32::from_rgb(236, 84, 84),
    axis_y: Color32::from_rgb(70, 193, 118),
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
    selected: Color32::from_rgb(16, 82, 178),
    good: Color32::from_rgb(24, 138, 74),
    busy: Color32::from_rgb(24, 104, 219),
    warning: Color32::from_rgb(176, 108, 0),
    bad: Color32::from_rgb(200, 36, 36),
    on_bad: Color32::from_rgb(255, 255, 255),
    on_accent: Color32::from_rgb(255, 255, 255),
    paper: Color32::from_rgb(255, 255, 255),
    ink: Color32::from_rgb(44, 48, 58),
    axis_x: Color32::from_rgb(208, 44, 44),
    axis_y: Color32::from_rgb(24, 138, 74),
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
    pub(crate) fn of(ui: &egui::Ui) -> &'static Self {
        if ui.visuals().dark_mode { &DARK } else { &LIGHT }
    }

    /// The colour of a tone.
    pub(crate) fn tone(&self, tone: Tone) -> Color32 {
        match tone {
            Tone::Good => self.good,
            Tone::Busy => self.busy,
            Tone::Warning => self.warning,
            Tone::Bad => self.bad,
        }
    }

    /// The colour of a message.
    pub(crate) fn severity(&self, severity: Severity) -> Color32 {
        match severity {
            Severity::Info => self.weak,
            Severity::Warning => self.warning,
            Severity::Error => self.bad,
        }
    }

    /// A surface one step above the cards: fields, hovered rows.
    pub(crate) fn raised(&self) -> Color32 {
        self.card.lerp_to_gamma(self.text, 0.05)
    }

    /// A surface that hints at a tone.
    pub(crate) fn tinted(&self, tone: Tone) -> Color32 {
        self.card.lerp_to_gamma(self.tone(tone), 0.16)
    }
}

/// The tint of an image that is out of date.
pub(crate) fn stale_tint() -> Color32 {
    Color32::from_gray(110)
}

/// The colour of a pixel.
pub fn pixel([red, green, blue]: [u8; 3]) -> Color32 {
    Color32::from_rgb(red, green, blue)
}

/// A title: semibold if the language has it.
pub fn title(text: impl Into<String>, size: f32) -> RichText {
    RichText::new(text).font(FontId::new(size, fonts::semibold()))
}

/// Sets up fonts and both themes; once. The fonts are available from the next frame on.
pub fn install(ctx: &egui::Context) {
    ctx.set_fonts(fonts::definitions());
    ctx.style_mut_of(egui::Theme::Dark, |style| shape(style, Visuals::dark(), &DARK));
    ctx.style_mut_of(egui::Theme::Light, |style| shape(style, Visuals::light(), &LIGHT));
}

/// Makes controls large enough for fingers, or as large as a pointer needs.
pub fn for_fingers(ctx: &egui::Context, fingers: bool) {
    let (height, padding) = if fingers { (FINGER, Vec2::splat(12.0)) } else { (POINTER, PADDING) };
    ctx.all_styles_mut(|style| {
        style.spacing.interact_size.y = height;
        style.spacing.button_padding = padding;
    });
}

/// Switches to a theme.
pub fn choose(ctx: &egui::Context, theme: ThemeChoice) {
    ctx.set_theme(match theme {
        ThemeChoice::Dark => egui::ThemePreference::Dark,
        ThemeChoice::Light => egui::ThemePreference::Light,
    });
}

/// Whether controls are sized for fingers now.
pub(crate) fn is_for_fingers(ui: &egui::Ui) -> bool {
    ui.ctx().global_style().spacing.interact_size.y >= FINGER
}

/// The minimum size of a control: this one with a pointer, and never less than a finger can hit.
pub fn least(ui: &egui::Ui, width: f32, height: f32) -> Vec2 {
    let finger = if is_for_fingers(ui) { FINGER } else { 0.0 };
    Vec2::new(width, height).max(Vec2::splat(finger))
}

fn shape(style: &mut egui::Style, visuals: Visuals, palette: &Palette) {
    style.text_styles = [
        (TextStyle::Heading, FontId::new(16.0, fonts::semibold())),
        (TextStyle::Body, FontId::new(13.0, FontFamily::Proportional)),
        (TextStyle::Button, FontId::new(13.0, FontFamily::Proportional)),
        (TextStyle::Small, FontId::new(CAPTION, FontFamily::Proportional)),
        (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
    ]
    .into();
    style.spacing.item_spacing = Vec2::new(8.0, 4.0);
    style.spacing.button_padding = PADDING;
    style.spacing.interact_size.y = POINTER;
    style.spacing.window_margin = Margin::same(16);
    style.spacing.menu_margin = Margin::same(6);
    style.spacing.combo_width = 140.0;
    style.spacing.scroll = egui::style::ScrollStyle::thin();
    style.interaction.selectable_labels = false;
    style.visuals = visuals;
    let visuals = &mut style.visuals;
    visuals.panel_fill = palette.backdrop;
    visuals.window_fill = palette.card;
    visuals.window_stroke = Stroke::new(1.0, palette.edge);
    visuals.window_corner_radius = CornerRadius::same(10);
    visuals.menu_corner_radius = CornerRadius::same(8);
    visuals.text_edit_bg_color = Some(palette.well);
    visuals.extreme_bg_color = palette.well;
    visuals.weak_text_color = Some(palette.weak);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.bad;
    visuals.selection.bg_fill = palette.card.lerp_to_gamma(palette.accent, 0.2);
    visuals.selection.stroke = Stroke::new(1.0, palette.selected);
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
