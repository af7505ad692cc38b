//! A page: the drawing in its middle, a ruler along two sides, and what it is.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{Drawing, PrintError, Shape};
use handeye_geometry::targets::TargetSpec;

/// Margin that printers leave white \[mm\].
const MARGIN_MM: f64 = 10.0;
/// Strip of a ruler with its numbers \[mm\].
const RULER_STRIP_MM: f64 = 9.0;
/// Length of the rulers \[mm\].
const RULER_MM: usize = 100;
/// Strip of the two lines of text \[mm\].
const TEXT_STRIP_MM: f64 = 10.0;
/// Smallest white space between the drawing and its surroundings \[mm\].
const QUIET_MM: f64 = 5.0;
/// Longest side of a page that PDF readers must take: 14,400 points \[mm\].
const LONGEST_MM: f64 = 5080.0;
/// Stroke of ticks \[mm\].
const TICK_MM: f64 = 0.15;
/// Largest text \[mm\], and the largest width of a letter as a part of its size: Helvetica's average is a half.
const TEXT_MM: f64 = 3.5;
const LETTER: f64 = 0.56;

/// Page size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Page {
    /// 210 × 297 mm, either way round.
    #[default]
    A4,
    /// 297 × 420 mm, either way round.
    A3,
    /// 215.9 × 279.4 mm, either way round.
    Letter,
    /// As large as the drawing needs.
    Fit,
}

impl Page {
    /// All, as they are called.
    pub const NAMES: [&str; 4] = ["a4", "a3", "letter", "fit"];

    fn size_mm(self) -> Option<[f64; 2]> {
        match self {
            Self::A4 => Some([210.0, 297.0]),
            Self::A3 => Some([297.0, 420.0]),
            Self::Letter => Some([215.9, 279.4]),
            Self::Fit => None,
        }
    }
}

impl fmt::Display for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::A4 => "a4",
            Self::A3 => "a3",
            Self::Letter => "letter",
            Self::Fit => "fit",
        })
    }
}

handeye_wording::plain_values!(Page);

impl FromStr for Page {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        [Self::A4, Self::A3, Self::Letter, Self::Fit]
            .into_iter()
            .find(|page| page.to_string() == text.to_ascii_lowercase())
            .ok_or_else(|| format!("page {text:?} is not known: it is one of {}", Self::NAMES.join(", ")))
    }
}

/// A line of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Text {
    /// Left end of its base line, from the top left of the page \[mm\].
    pub at_mm: [f64; 2],
    /// Size of the letters \[mm\].
    pub size_mm: f64,
    /// The text, in ASCII.
    pub text: String,
}

/// A page ready to be written: millimetres from the top left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Width and height.
    pub size_mm: [f64; 2],
    /// Position of the target's origin.
    pub origin_mm: [f64; 2],
    /// The target, in metres from there.
    pub drawing: Drawing,
    /// Left end of the horizontal and upper end of the vertical ruler, each of 100 mm.
    pub rulers_mm: [[f64; 2]; 2],
    /// The texts on it.
    pub texts: Vec<Text>,
}

impl Sheet {
    /// Lays a target on a page, upright or lying as it fits.
    ///
    /// # Errors
    /// [`PrintError`].
    pub fn new(target: &TargetSpec, page: Page) -> Result<Self, PrintError> {
        let drawing = Drawing::of(target)?;
        let (low, high) = drawing.bounds();
        let extent_mm = (high - low) * 1e3;
        let quiet_mm = (drawing.quiet_m * 1e3).max(QUIET_MM);
        let (left, right) = (MARGIN_MM + RULER_STRIP_MM + quiet_mm, MARGIN_MM.max(quiet_mm));
        let (top, bottom) = (MARGIN_MM.max(quiet_mm), MARGIN_MM + RULER_STRIP_MM + TEXT_STRIP_MM + quiet_mm);
        let least = RULER_MM as f64 + 2.0 * MARGIN_MM;
        let need = Vector2::new(
            (extent_mm.x + left + right).max(least + RULER_STRIP_MM),
            (extent_mm.y + top + bottom).max(least + RULER_STRIP_MM + TEXT_STRIP_MM),
        );
        let need_mm = [need.x.ceil(), need.y.ceil()];
        if need.max().is_nan() || need.max() > LONGEST_MM {
            return Err(PrintError::TooLarge { need_mm });
        }
        let size_mm = match page.size_mm() {
            None => need_mm,
            Some([short, long]) => {
                let fits = |size: &[f64; 2]| need.x <= size[0] && need.y <= size[1];
                let both = [[short, long], [long, short]];
                let nearer = if need.x > need.y { both[1] } else { both[0] };
                both.into_iter().find(fits).ok_or(PrintError::DoesNotFit { need_mm, page, has_mm: nearer })?
            }
        };
        // In the middle of what the strips leave.
        let free = Vector2::new(size_mm[0] - left - right, size_mm[1] - top - bottom) - extent_mm;
        let origin = Vector2::new(left, top) + free / 2.0 - low * 1e3;
        let [width, height] = size_mm;
        let across = [MARGIN_MM + RULER_STRIP_MM, height - MARGIN_MM - TEXT_STRIP_MM - RULER_STRIP_MM];
        let down = [MARGIN_MM, MARGIN_MM];
        let mut texts = ruler_texts(across, down);
        texts.extend(lines(target, width, height));
        Ok(Self { size_mm, origin_mm: [origin.x, origin.y], drawing, rulers_mm: [across, down], texts })
    }

    /// The ticks of both rulers, millimetres. Every tick is centred on its millimetre; a line joins the first and the last.
    pub(crate) fn ruler_shapes(&self) -> Vec<Shape> {
        let mut shapes = Vec::new();
        for (axis, [x, y]) in self.rulers_mm.into_iter().enumerate() {
            let mut add = |along: f64, length: f64, across: f64, depth: f64| {
                let (corner, size) = if axis == 0 {
                    (Vector2::new(x + along, y + across), Vector2::new(length, depth))
                } else {
                    (Vector2::new(x + across, y + along), Vector2::new(depth, length))
                };
                shapes.push(Shape::Rectangle { corner, size });
            };
            add(0.0, RULER_MM as f64, -TICK_MM, TICK_MM);
            for tick in 0..=RULER_MM {
                let depth = match tick {
                    t if t % 10 == 0 => 4.0,
                    t if t % 5 == 0 => 3.0,
                    _ => 2.0,
                };
                add(tick as f64 - TICK_MM / 2.0, TICK_MM, 0.0, depth);
            }
        }
        shapes
    }
}

fn ruler_texts(across: [f64; 2], down: [f64; 2]) -> Vec<Text> {
    let labels = [(0.0, "0"), (50.0, "50"), (100.0, "100 mm")];
    let text = |at_mm, text: &str| Text { at_mm, size_mm: 2.5, text: text.to_owned() };
    let below = labels.iter().map(|(at, label)| text([across[0] + at - 0.7, across[1] + 6.8], label));
    // Right of the ticks there are 4 mm; the longest label is wider and is placed below the ruler.
    let beside = labels.iter().map(|(at, label)| {
        let (dx, dy) = if *at == 100.0 { (0.0, 3.5) } else { (4.4, 0.9) };
        text([down[0] + dx, down[1] + at + dy], label)
    });
    below.chain(beside).collect()
}

fn lines(target: &TargetSpec, width: f64, height: f64) -> Vec<Text> {
    let what = format!("{}: {target}", target.kind()).replace('×', "x").replace(|c: char| !c.is_ascii(), "?");
    let how = "Print at 100 % (actual size, no fitting). Both rulers must then be 100 mm long.".to_owned();
    let room = width - 2.0 * MARGIN_MM;
    let size = |text: &str| TEXT_MM.min(room / (LETTER * text.chars().count() as f64));
    [(what, 5.0), (how, 0.5)]
        .into_iter()
        .map(|(text, up)| Text { at_mm: [MARGIN_MM, height - MARGIN_MM - up + 1.5], size_mm: size(&text), text })
        .collect()
}
