//! The fonts of the window: Inter for Latin, Noto Sans SC for Chinese, and as a fallback the symbols that come with
//! egui.

use std::sync::Arc;

use egui::{FontData, FontDefinitions, FontFamily};

/// A font that is part of the program.
macro_rules! font {
    ($file:literal) => {
        Arc::new(FontData::from_static(include_bytes!(concat!("../../../../assets/fonts/", $file))))
    };
}

/// Semibold Latin, for titles.
const SEMIBOLD: &str = "semibold";

/// The family of titles. Chinese has one weight: a second one would double the size of the fonts.
pub fn semibold() -> FontFamily {
    FontFamily::Name(SEMIBOLD.into())
}

/// All families.
pub fn definitions() -> FontDefinitions {
    let mut fonts = FontDefinitions::default();
    for (name, data) in [
        ("Inter", font!("Inter-Regular-subset.otf")),
        ("Inter semibold", font!("Inter-SemiBold-subset.otf")),
        ("Noto Sans SC", font!("NotoSansSC-Regular-subset.otf")),
    ] {
        fonts.font_data.insert(name.to_owned(), data);
    }
    let signs = fonts.families.get(&FontFamily::Proportional).cloned().unwrap_or_default();
    let family = |first: &str| {
        [first, "Noto Sans SC"].map(str::to_owned).into_iter().chain(signs.iter().cloned()).collect::<Vec<_>>()
    };
    let (regular, titles) = (family("Inter"), family("Inter semibold"));
    fonts.families.insert(FontFamily::Proportional, regular);
    fonts.families.insert(semibold(), titles);
    let code = fonts.families.entry(FontFamily::Monospace).or_default();
    code.insert(1.min(code.len()), "Noto Sans SC".to_owned());
    fonts
}

/// Whether the fonts are loaded; they are from the second frame after [`super::theme::install`] on.
pub fn are_there(ctx: &egui::Context) -> bool {
    ctx.fonts(|fonts| fonts.definitions().families.contains_key(&semibold()))
}
