//! The columns of the table: names, units, widths, and what sorts by them.

use std::cmp::Ordering;

use egui::{Align2, FontId, Pos2, Rect, Sense, Shape, Ui, Vec2, WidgetInfo, WidgetType};

use crate::capture::rows::CaptureRow;
use crate::style::theme::{CAPTION, Palette};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Height of the heads.
pub const HEAD: f32 = 36.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Column {
    Image,
    /// Number and pose.
    Name,
    /// Whether it is used.
    Use,
    Purpose,
    /// Residuals.
    Rms,
    /// Correction of the tip's place.
    Correction,
    /// Correction of the tip's orientation.
    Turn,
    /// How far the answer moves without it.
    Influence,
    /// Noise of a corner.
    Noise,
    /// What is remarkable.
    Flags,
}

/// Which column the rows are sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sort {
    pub column: Column,
    /// Largest first.
    pub descending: bool,
}

impl Default for Sort {
    /// As they were taken.
    fn default() -> Self {
        Self { column: Column::Name, descending: false }
    }
}

impl Column {
    /// From left to right.
    pub const ALL: [Self; 10] = [
        Self::Image,
        Self::Name,
        Self::Use,
        Self::Purpose,
        Self::Rms,
        Self::Correction,
        Self::Turn,
        Self::Influence,
        Self::Noise,
        Self::Flags,
    ];

    /// The columns that a narrow table omits, least important first; the row under the pointer shows them in words.
    const DISPENSABLE: [Self; 6] =
        [Self::Noise, Self::Turn, Self::Correction, Self::Influence, Self::Image, Self::Purpose];

    /// Minimum width in points.
    fn width(self) -> f32 {
        match self {
            Self::Image => 54.0,
            Self::Name => 92.0,
            Self::Use => 34.0,
            Self::Purpose => 56.0,
            Self::Rms | Self::Correction | Self::Turn => 58.0,
            Self::Influence | Self::Noise => 62.0,
            Self::Flags => 106.0,
        }
    }

    /// Its share of the remaining room.
    fn stretch(self) -> f32 {
        match self {
            Self::Name => 2.0,
            Self::Flags => 1.5,
            Self::Image | Self::Use => 0.0,
            _ => 0.6,
        }
    }

    /// Whether its content is right-aligned, as numbers are.
    pub fn is_number(self) -> bool {
        matches!(self, Self::Rms | Self::Correction | Self::Turn | Self::Influence | Self::Noise)
    }

    /// Its heading.
    pub fn name(self, language: Language) -> &'static str {
        match self {
            Self::Image => "",
            Self::Name => tr!(language, "Pose"),
            Self::Use => tr!(language, "Use"),
            Self::Purpose => tr!(language, "For"),
            Self::Rms => tr!(language, "Residual"),
            Self::Correction => tr!(language, "Moved"),
            Self::Turn => tr!(language, "Turned"),
            Self::Influence => tr!(language, "Influence"),
            Self::Noise => tr!(language, "Noise"),
            Self::Flags => tr!(language, "Remarks"),
        }
    }

    /// Unit of its numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Rms | Self::Noise => "px",
            Self::Correction | Self::Influence => "mm",
            Self::Turn => "deg",
            _ => "",
        }
    }

    fn what(self, language: Language) -> &'static str {
        match self {
            Self::Image => "",
            Self::Name => tr!(language, "Number of the capture, and the taught pose at which it was taken"),
            Self::Use => tr!(language, "Captures that are not used stay in the session and do not affect the result"),
            Self::Purpose => tr!(language, "Whether it enters the fit, or verifies it"),
            Self::Rms => tr!(
                language,
                "RMS distance of measured to modelled corners. Of a verifying capture it is the error of the \
                 prediction, which is larger"
            ),
            Self::Correction => tr!(
                language,
                "How far the fit moved the reported place of the tip: what the robot seems to be off at this pose"
            ),
            Self::Turn => tr!(language, "How far the fit turned the reported orientation of the tip"),
            Self::Influence => tr!(language, "How far the answer moves when this capture is left out"),
            Self::Noise => tr!(language, "Noise of a corner in this image, one sigma, measured when it was taken"),
            Self::Flags => tr!(language, "Remarks: point at one to read why and what to do"),
        }
    }

    /// The columns that a row of this width has room for.
    fn shown(room: f32) -> Vec<Self> {
        let mut shown = Self::ALL.to_vec();
        for column in Self::DISPENSABLE {
            if Self::least_width(&shown) <= room {
                break;
            }
            shown.retain(|&other| other != column);
        }
        shown
    }

    /// The columns that do not fit.
    pub fn hidden(room: f32) -> impl Iterator<Item = Self> {
        let shown = Self::shown(room);
        Self::ALL.into_iter().filter(move |column| !shown.contains(column))
    }

    /// The places of the columns in a row of this width, as distances from its left edge.
    pub fn places(room: f32) -> Vec<(Self, egui::Rangef)> {
        let shown = Self::shown(room);
        let shares: f32 = shown.iter().map(|column| column.stretch()).sum();
        let spare = (room - Self::least_width(&shown)).max(0.0);
        let mut x = 0.0;
        let place = |column: Self| {
            let from = x;
            x += column.width() + spare * column.stretch() / shares;
            (column, egui::Rangef::new(from, x))
        };
        shown.into_iter().map(place).collect()
    }

    fn least_width(columns: &[Self]) -> f32 {
        columns.iter().map(|column| column.width()).sum()
    }

    /// The value of a row of the table in a column of numbers.
    pub fn number(self, row: &CaptureRow) -> Option<f64> {
        match self {
            Self::Rms => row.rms_px,
            Self::Correction => row.correction_mm,
            Self::Turn => row.correction_deg,
            Self::Influence => row.influence_mm,
            Self::Noise => row.corner_noise_px,
            Self::Image | Self::Name | Self::Use | Self::Purpose | Self::Flags => None,
        }
    }

    /// How many decimals its numbers have.
    pub fn decimals(self) -> usize {
        if self == Self::Turn { 4 } else { 3 }
    }
}

/// The indices of the rows in the order of a column. Rows without a value come last either way.
pub fn sorted(rows: &[CaptureRow], sort: Sort) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    let number = |row: &CaptureRow| match sort.column {
        column if column.is_number() => column.number(row),
        Column::Use => Some(f64::from(u8::from(row.excluded))),
        Column::Purpose => Some(f64::from(u8::from(row.verifies()))),
        Column::Flags => Some(-f64::from(super::flags::weight(row))),
        _ => Some(f64::from(row.id.0)),
    };
    order.sort_by(|&a, &b| {
        let by_value = match (number(&rows[a]), number(&rows[b])) {
            (Some(a), Some(b)) if sort.descending => b.total_cmp(&a),
            (Some(a), Some(b)) => a.total_cmp(&b),
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (None, None) => Ordering::Equal,
        };
        by_value.then(rows[a].id.cmp(&rows[b].id))
    });
    order
}

/// The heads of the columns; returns the sort after a click on one.
pub fn heads_ui(ui: &mut Ui, row: Rect, sort: Sort, language: Language) -> Sort {
    let palette = Palette::of(ui);
    let mut next = sort;
    for (column, x) in Column::places(row.width()) {
        let name = column.name(language);
        if name.is_empty() {
            continue;
        }
        let rect = Rect::from_x_y_ranges(x.min + row.left()..=x.max + row.left(), row.y_range());
        let response = ui.interact(rect, ui.id().with(("head", name)), Sense::click());
        let response = response.on_hover_text(column.what(language));
        response.widget_info(|| {
            let label = format!("{} {name}", tr!(language, "Sort by"));
            WidgetInfo::labeled(WidgetType::Button, true, label)
        });
        if response.clicked() {
            // The first click on numbers brings the largest to the top: those are usually wanted.
            let descending = if sort.column == column { !sort.descending } else { column.is_number() };
            next = Sort { column, descending };
        }
        let colour = if sort.column == column || response.hovered() { palette.text } else { palette.weak };
        let (x, align, unit_align) = if column.is_number() {
            (rect.right() - 6.0, Align2::RIGHT_TOP, Align2::RIGHT_BOTTOM)
        } else {
            (rect.left() + 6.0, Align2::LEFT_TOP, Align2::LEFT_BOTTOM)
        };
        let (top, font) = (rect.top() + 4.0, FontId::proportional(12.0));
        let words = ui.painter().text(Pos2::new(x, top), align, name, font, colour);
        let unit_at = Pos2::new(x, rect.bottom() - 3.0);
        ui.painter().text(unit_at, unit_align, column.unit(), FontId::proportional(CAPTION), palette.weak);
        if sort.column == column {
            arrow(ui, words, column.is_number(), sort.descending);
        }
    }
    let line = egui::Stroke::new(1.0, palette.edge);
    ui.painter().hline(row.x_range(), row.bottom() - 0.5, line);
    next
}

/// A small triangle next to the head of the column that sorts.
fn arrow(ui: &Ui, words: Rect, at_left: bool, descending: bool) {
    let x = if at_left { words.left() - 8.0 } else { words.right() + 8.0 };
    let centre = Pos2::new(x, words.center().y);
    let up = if descending { 1.0 } else { -1.0 };
    let points =
        [Vec2::new(-3.5, -2.0 * up), Vec2::new(3.5, -2.0 * up), Vec2::new(0.0, 3.0 * up)].map(|offset| centre + offset);
    ui.painter().add(Shape::convex_polygon(points.to_vec(), Palette::of(ui).accent, egui::Stroke::NONE));
}
