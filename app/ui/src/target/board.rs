//! The board that is searched for: its kind and its numbers, how it looks, and printing it.

use egui::{Button, ComboBox, DragValue, Id, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, Layout, TargetSpec};
use handeye_print::Page;

use super::drawing::drawing_ui;
use crate::style::theme::Tone;
use crate::style::{form, parts};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::target;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Points of a board along one side: what is usually printed.
const POINTS: std::ops::RangeInclusive<usize> = 3..=40;
/// Tags of a board along one side.
const TAGS: std::ops::RangeInclusive<usize> = 1..=20;
/// A length on a board \[mm\].
const LENGTH_MM: std::ops::RangeInclusive<f64> = 0.5..=500.0;
/// Minimum width that the drawing of the board needs next to the numbers.
const BESIDE: f32 = 520.0;

/// Kinds of boards: all that can be detected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Chessboard,
    Charuco,
    AprilGrid,
    AprilTag,
    Circles,
    AsymmetricCircles,
}

impl Kind {
    const ALL: [Self; 6] =
        [Self::Chessboard, Self::Charuco, Self::AprilGrid, Self::AprilTag, Self::Circles, Self::AsymmetricCircles];

    fn of(target: &TargetSpec) -> Self {
        match target {
            TargetSpec::Chessboard(_) => Self::Chessboard,
            TargetSpec::Charuco(_) => Self::Charuco,
            TargetSpec::AprilGrid(_) => Self::AprilGrid,
            TargetSpec::AprilTag(_) => Self::AprilTag,
            TargetSpec::Circles(_) => Self::Circles,
            TargetSpec::AsymmetricCircles(_) => Self::AsymmetricCircles,
        }
    }

    fn title(self, language: Language) -> &'static str {
        match self {
            Self::Chessboard => tr!(language, "Chessboard"),
            Self::Charuco => tr!(language, "ChArUco"),
            Self::AprilGrid => tr!(language, "AprilTag board"),
            Self::AprilTag => tr!(language, "Single AprilTag"),
            Self::Circles => tr!(language, "Dots"),
            Self::AsymmetricCircles => tr!(language, "Dots, staggered"),
        }
    }

    /// A target of this kind to start with, which fits on A4; with the numbers of the previous board if both are a
    /// lattice.
    fn first(self, before: &TargetSpec) -> TargetSpec {
        let grid = match before {
            TargetSpec::Chessboard(grid) | TargetSpec::Circles(grid) | TargetSpec::AsymmetricCircles(grid) => *grid,
            _ => Grid { columns: 10, rows: 7, square_m: 0.015 },
        };
        let family = Dictionary::APRILTAG_36H11;
        match self {
            Self::Chessboard => TargetSpec::Chessboard(grid),
            Self::Circles => TargetSpec::Circles(grid),
            // The rows are half as far apart as the dots in them, and the odd number of rows distinguishes its ends.
            Self::AsymmetricCircles => TargetSpec::AsymmetricCircles(Grid { columns: 4, rows: 11, square_m: 0.018 }),
            Self::Charuco => TargetSpec::Charuco(Charuco {
                columns: 6,
                rows: 8,
                square_m: 0.022,
                marker_m: 0.016,
                dictionary: Dictionary::ARUCO_5X5_100,
                layout: None,
            }),
            Self::AprilGrid => TargetSpec::AprilGrid(AprilGrid {
                columns: 4,
                rows: 6,
                tag_m: 0.03,
                spacing_m: 0.009,
                first_id: 0,
                family,
                border_bits: None,
                ids: IdOrder::BottomUp,
            }),
            Self::AprilTag => TargetSpec::AprilTag(AprilTag { tag_m: 0.1, id: 0, family, border_bits: Some(1) }),
        }
    }
}

pub fn board_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let target = &model.document().meta.target;
    form::heading_ui(ui, tr!(language, "Board"));
    let beside = ui.available_width() >= BESIDE;
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| numbers_ui(ui, target, language, outbox));
        if beside {
            ui.add_space(8.0);
            let width = (ui.available_width() - 4.0).min(220.0);
            drawing_ui(ui, target, Vec2::new(width, 150.0), language);
        }
    });
    if !beside {
        let width = ui.available_width().min(300.0);
        drawing_ui(ui, target, Vec2::new(width, 150.0), language);
    }
    parts::hint_ui(ui, &hint(target).in_language(language));
    if target.is_symmetric() {
        let title = tr!(language, "This board looks the same after half a turn");
        let detail = match target {
            TargetSpec::Chessboard(_) => {
                tr!(
                    language,
                    "Its two ends look the same. Use one with an odd number of rows plus columns, such as 10 × 7."
                )
            }
            _ => tr!(language, "Its two ends look the same. A chessboard is safer."),
        };
        form::note_ui(ui, Tone::Warning, title, detail);
    }
    print_ui(ui, language, outbox);
}

/// What to count, and what is found from the images.
fn hint(target: &TargetSpec) -> handeye_wording::Text {
    match target {
        TargetSpec::Chessboard(grid) => text!(
            "Count inner corners, where four squares meet: {columns} × {rows} corners are {across} × {down} squares.",
            columns = grid.columns,
            rows = grid.rows,
            across = grid.columns + 1,
            down = grid.rows + 1
        ),
        TargetSpec::Charuco(board) => text!(
            "Count inner corners: {columns} × {rows} corners are {across} × {down} squares. Parts of the board suffice.",
            columns = board.columns,
            rows = board.rows,
            across = board.columns + 1,
            down = board.rows + 1
        ),
        TargetSpec::Circles(_) => text!("Count the dots along each side; the distance is from centre to centre."),
        TargetSpec::AsymmetricCircles(_) => text!(
            "Count the dots of one row, and all rows. The distance is from row to row: half of that between dots in a row."
        ),
        TargetSpec::AprilGrid(_) | TargetSpec::AprilTag(_) => {
            text!("The side of a tag is measured over its black border.")
        }
    }
}

fn numbers_ui(ui: &mut Ui, target: &TargetSpec, language: Language, outbox: &mut Outbox) {
    ui.spacing_mut().item_spacing.y = 6.0;
    let mut kind = Kind::of(target);
    let before = kind;
    let words = |kind: Kind| kind.title(language).to_owned();
    choice_ui(ui, tr!(language, "Kind of board"), &mut kind, Kind::ALL, words);
    let mut wanted = if kind == before { *target } else { kind.first(target) };
    match &mut wanted {
        TargetSpec::Chessboard(grid) => {
            let names = [tr!(language, "Inner corners, x"), tr!(language, "Inner corners, y"), tr!(language, "Square")];
            grid_ui(ui, grid, names, language);
        }
        TargetSpec::Circles(grid) => {
            let names = [tr!(language, "Dots, x"), tr!(language, "Dots, y"), tr!(language, "Distance")];
            grid_ui(ui, grid, names, language);
        }
        TargetSpec::AsymmetricCircles(grid) => {
            let names = [tr!(language, "Dots in a row"), tr!(language, "Rows"), tr!(language, "Row distance")];
            grid_ui(ui, grid, names, language);
        }
        TargetSpec::Charuco(board) => charuco_ui(ui, board, language),
        TargetSpec::AprilGrid(board) => april_grid_ui(ui, board, language),
        TargetSpec::AprilTag(tag) => {
            length_ui(ui, tr!(language, "Tag"), &mut tag.tag_m, language);
            count_ui(ui, tr!(language, "Tag number"), &mut tag.id, 0..=10_000);
            family_ui(ui, tr!(language, "Tag family"), &mut tag.family, language);
            border_ui(ui, &mut tag.border_bits, language);
        }
    }
    let key = Id::new("why the board cannot be");
    if wanted != *target {
        // An invalid board is not looked for; the previous one stays, with the error shown.
        let refused = wanted.check().err().map(|why| why.to_string());
        if refused.is_none() {
            outbox.send(target::Command::Set(wanted));
        }
        parts::remember(ui, key, refused);
    }
    if let Some(why) = parts::remembered::<Option<String>>(ui, key) {
        form::note_ui(ui, Tone::Bad, tr!(language, "There is no such board"), &why);
    }
}

fn grid_ui(ui: &mut Ui, grid: &mut Grid, [columns, rows, size]: [&str; 3], language: Language) {
    count_ui(ui, columns, &mut grid.columns, POINTS);
    count_ui(ui, rows, &mut grid.rows, POINTS);
    length_ui(ui, size, &mut grid.square_m, language);
}

fn charuco_ui(ui: &mut Ui, board: &mut Charuco, language: Language) {
    count_ui(ui, tr!(language, "Inner corners, x"), &mut board.columns, POINTS);
    count_ui(ui, tr!(language, "Inner corners, y"), &mut board.rows, POINTS);
    length_ui(ui, tr!(language, "Square"), &mut board.square_m, language);
    length_ui(ui, tr!(language, "Marker"), &mut board.marker_m, language);
    family_ui(ui, tr!(language, "Marker family"), &mut board.dictionary, language);
    if !board.layouts_are_alike() {
        let layouts = [None, Some(Layout::New), Some(Layout::Legacy)];
        choice_ui(ui, tr!(language, "Marker layout"), &mut board.layout, layouts, |layout| {
            let words = match layout {
                None => tr!(language, "told from the images"),
                Some(Layout::New) => tr!(language, "OpenCV from 4.6 on"),
                Some(Layout::Legacy) => tr!(language, "OpenCV before 4.6"),
            };
            words.to_owned()
        });
    }
}

fn april_grid_ui(ui: &mut Ui, board: &mut AprilGrid, language: Language) {
    count_ui(ui, tr!(language, "Tags, x"), &mut board.columns, TAGS);
    count_ui(ui, tr!(language, "Tags, y"), &mut board.rows, TAGS);
    length_ui(ui, tr!(language, "Tag"), &mut board.tag_m, language);
    length_ui(ui, tr!(language, "Gap"), &mut board.spacing_m, language);
    count_ui(ui, tr!(language, "First number"), &mut board.first_id, 0..=10_000);
    family_ui(ui, tr!(language, "Tag family"), &mut board.family, language);
    choice_ui(ui, tr!(language, "Numbers begin"), &mut board.ids, [IdOrder::BottomUp, IdOrder::TopDown], |order| {
        let words = match order {
            IdOrder::BottomUp => tr!(language, "bottom left (Kalibr)"),
            IdOrder::TopDown => tr!(language, "top left (OpenCV)"),
        };
        words.to_owned()
    });
    border_ui(ui, &mut board.border_bits, language);
}

fn border_ui(ui: &mut Ui, bits: &mut Option<usize>, language: Language) {
    choice_ui(ui, tr!(language, "Black border"), bits, [None, Some(1), Some(2)], |bits| match bits {
        None => tr!(language, "told from the images").to_owned(),
        Some(bits) => text!("{bits} {bits|bit|bits}", bits = bits).in_language(language),
    });
}

fn family_ui(ui: &mut Ui, name: &str, family: &mut Dictionary, language: Language) {
    choice_ui(ui, name, family, Dictionary::all(), |family| {
        text!("{family} ({count})", family = family.to_string(), count = family.markers()).in_language(language)
    });
}

/// One of several, in a list.
fn choice_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    name: &str,
    value: &mut T,
    all: impl IntoIterator<Item = T>,
    words: impl Fn(T) -> String,
) {
    form::row_ui(ui, name, |ui| {
        let combo = ComboBox::from_id_salt(name).selected_text(words(*value)).show_ui(ui, |ui| {
            for choice in all {
                ui.selectable_value(value, choice, words(choice));
            }
        });
        combo.response.widget_info(|| WidgetInfo::labeled(WidgetType::ComboBox, true, name));
    });
}

fn count_ui(ui: &mut Ui, name: &str, count: &mut usize, range: std::ops::RangeInclusive<usize>) {
    form::row_ui(ui, name, |ui| number_ui(ui, name, DragValue::new(count).range(range).speed(0.05)));
}

fn length_ui(ui: &mut Ui, name: &str, metres: &mut f64, language: Language) {
    let mut mm = *metres * 1e3;
    form::row_ui(ui, name, |ui| {
        let value = DragValue::new(&mut mm).range(LENGTH_MM).speed(0.05).max_decimals(3).suffix(" mm");
        number_ui(ui, name, value).on_hover_text(tr!(
            language,
            "Measure it on the print: printers scale. An error of 1 % here is an error of 1 % in every distance"
        ));
    });
    // Only what was changed is written back, so that a value read from a file keeps its last digit.
    if mm != *metres * 1e3 {
        *metres = mm * 1e-3;
    }
}

/// A number with its name.
pub fn number_ui(ui: &mut Ui, name: &str, value: DragValue<'_>) -> egui::Response {
    let response = ui.add_sized(Vec2::new(92.0, 26.0), value);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::DragValue, true, name));
    response
}

/// The board on paper.
fn print_ui(ui: &mut Ui, language: Language, outbox: &mut Outbox) {
    let key = Id::new("page to print the board on");
    let before: Page = parts::remembered(ui, key);
    let mut page = before;
    let pages = [Page::A4, Page::A3, Page::Letter, Page::Fit];
    choice_ui(ui, tr!(language, "Page"), &mut page, pages, |page| match page {
        Page::A4 => "A4".to_owned(),
        Page::A3 => "A3".to_owned(),
        Page::Letter => "Letter".to_owned(),
        Page::Fit => tr!(language, "as large as the board").to_owned(),
    });
    if page != before {
        parts::remember(ui, key, page);
    }
    let what = tr!(language, "Writes a PDF of the board at its true size, with rulers to check the print");
    if ui.add(Button::new(tr!(language, "Print the board"))).on_hover_text(what).clicked() {
        outbox.send(target::Command::Print(page));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use egui::accesskit::Role;
    use egui_kittest::kittest::Queryable as _;
    use handeye_print::target_pdf;

    use super::super::pane::target_ui;
    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::testing::sample;

    /// Chooses from a list; returns the requested board.
    fn chosen(pane: &mut Driven, list: &str, entry: &str) -> Option<TargetSpec> {
        pane.harness.get_by_role_and_label(Role::ComboBox, list).click();
        pane.steps();
        let commands = pane.click(entry);
        let target = commands.iter().find_map(|command| match command {
            Command::Target(target::Command::Set(target)) => Some(*target),
            _ => None,
        })?;
        put(pane, target);
        Some(target)
    }

    fn put(pane: &mut Driven, target: TargetSpec) {
        let mut document = pane.model().document().clone();
        document.meta.target = target;
        pane.model().session.document = Arc::new(document);
        pane.steps();
    }

    #[test]
    fn every_kind_that_can_be_detected_is_chosen_with_its_numbers_and_fits_on_a4() {
        let mut pane = Driven::new(target_ui, sample::connected());
        // The present kind comes last: choosing it again would change nothing.
        for (name, field) in [
            ("ChArUco", "Marker family"),
            ("AprilTag board", "Gap"),
            ("Single AprilTag", "Tag number"),
            ("Dots, staggered", "Row distance"),
            ("Dots", "Dots, x"),
            ("Chessboard", "Inner corners, x"),
        ] {
            let target = chosen(&mut pane, "Kind of board", name).expect(name);
            assert!(target.check().is_ok(), "{target}");
            assert!(pane.sees(field), "{name}");
            assert!(pane.nothing_is_cut_off(), "{name}");
            target_pdf(&target, Page::A4).expect("it can be printed");
            assert_eq!(pane.click("Print the board"), [Command::Target(target::Command::Print(Page::A4))]);
        }
    }

    #[test]
    fn a_board_that_cannot_be_is_said_and_the_one_before_stays() {
        let mut pane = Driven::new(target_ui, sample::connected());
        let TargetSpec::Charuco(board) = chosen(&mut pane, "Kind of board", "ChArUco").expect("a board") else {
            panic!("another board")
        };
        put(&mut pane, TargetSpec::Charuco(Charuco { columns: 12, rows: 12, ..board }));
        assert_eq!(chosen(&mut pane, "Marker family", "4x4_50 (50)"), None);
        assert!(pane.sees("There is no such board") && pane.sees("a marker for every light square"));
        assert!(chosen(&mut pane, "Marker family", "4x4_250 (250)").is_some());
        assert!(!pane.sees("There is no such board"));
    }
}
