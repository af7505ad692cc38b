//! Targets made of square markers.

use nalgebra::{Point3, Vector2};
use serde::{Deserialize, Serialize};

use super::{BadTarget, Dictionary, Grid, count, length, mm};
use handeye_wording::Text;
use handeye_wording::text;

/// Which squares of a `ChArUco` board have the markers.
///
/// Both are the same for an odd number of rows of squares (an even number of inner corners along y).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// The top left square is dark: OpenCV from 4.6 on.
    New,
    /// The bottom left square is dark: OpenCV before 4.6, and `setLegacyPattern` since.
    Legacy,
}

impl Layout {
    /// Both, the usual one first.
    pub const BOTH: [Self; 2] = [Self::New, Self::Legacy];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::New => "new",
            Self::Legacy => "legacy",
        }
    }
}

/// A chessboard with a marker in each light square. Markers are numbered from 0, row by row from the top left.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Charuco {
    /// Inner corners along x: one less than squares.
    pub columns: usize,
    /// Inner corners along y: one less than squares.
    pub rows: usize,
    /// Side of a square in metres.
    pub square_m: f64,
    /// Side of a marker in metres, its black border included.
    pub marker_m: f64,
    /// Family of the markers.
    pub dictionary: Dictionary,
    /// Which squares have the markers; determined from each image where it is not stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<Layout>,
}

impl Charuco {
    /// The inner corners.
    pub fn grid(&self) -> Grid {
        Grid { columns: self.columns, rows: self.rows, square_m: self.square_m }
    }

    /// Whether both layouts give the same board.
    pub fn layouts_are_alike(&self) -> bool {
        self.rows.is_multiple_of(2)
    }

    /// Whether the square in that column and row of squares is dark.
    pub fn is_dark(&self, layout: Layout, column: usize, row: usize) -> bool {
        match layout {
            Layout::New => (column + row).is_multiple_of(2),
            Layout::Legacy => (column + row + self.rows).is_multiple_of(2),
        }
    }

    /// Column and row of the square of every marker, in the order of the markers' numbers.
    pub fn marker_squares(&self, layout: Layout) -> Vec<(usize, usize)> {
        let all = (0..=self.rows).flat_map(|row| (0..=self.columns).map(move |column| (column, row)));
        all.filter(|(column, row)| !self.is_dark(layout, *column, *row)).collect()
    }

    /// Corners of the marker in a square: top left, top right, bottom right, bottom left, metres.
    pub fn marker_corners(&self, (column, row): (usize, usize)) -> [Vector2<f64>; 4] {
        // The first inner corner is the origin, one square from the edge.
        let centre = Vector2::new(column as f64 - 0.5, row as f64 - 0.5) * self.square_m;
        square(centre - Vector2::repeat(self.marker_m / 2.0), self.marker_m)
    }

    pub(super) fn check(&self) -> Result<(), BadTarget> {
        let want = "a whole number of inner corners from 2 to 1000";
        count("columns", self.columns, 2, want)?;
        count("rows", self.rows, 2, want)?;
        length("square_m", self.square_m)?;
        length("marker_m", self.marker_m)?;
        if self.marker_m >= self.square_m {
            let want = "less than square_m: a marker has a light margin in its square";
            return Err(BadTarget { key: "marker_m", value: self.marker_m.to_string(), want });
        }
        if self.marker_squares(self.layout.unwrap_or(Layout::Legacy)).len() > self.dictionary.markers() {
            let want = "a family with a marker for every light square";
            return Err(BadTarget { key: "dictionary", value: self.dictionary.to_string(), want });
        }
        Ok(())
    }
}

impl Charuco {
    pub(super) fn text(&self) -> Text {
        let reported = match self.layout {
            None => text!(
                "ChArUco board of {columns}×{rows} inner corners, {square} mm apart, markers {family} of {marker} mm"
            ),
            Some(_) => text!(
                "ChArUco board of {columns}×{rows} inner corners, {square} mm apart, markers {family} of {marker} mm, {layout} layout"
            ),
        };
        let reported = reported.with("columns", self.columns).with("rows", self.rows).with("square", mm(self.square_m));
        let reported = reported.with("family", self.dictionary.name().to_owned()).with("marker", mm(self.marker_m));
        reported.with("layout", self.layout.map_or_else(String::new, |layout| layout.name().to_owned()))
    }
}

/// Where the numbering of tags begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IdOrder {
    /// At the bottom left, row by row upwards: Kalibr.
    #[default]
    BottomUp,
    /// At the top left, row by row downwards: OpenCV's `GridBoard`.
    TopDown,
}

impl IdOrder {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::BottomUp => "bottom_up",
            Self::TopDown => "top_down",
        }
    }
}

/// Rows of square tags with gaps between them.
///
/// The points are the corners of all tags, row by row from the top left corner of the board, so that each row of tags
/// gives two rows of points: the tag in column `c` and row `r` of tags (from the top) has the points of columns `2c`,
/// `2c + 1` and rows `2r`, `2r + 1` of the lattice. Kalibr numbers the same rows from the bottom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AprilGrid {
    /// Tags along x.
    pub columns: usize,
    /// Tags along y.
    pub rows: usize,
    /// Side of a tag in metres, its black border included.
    pub tag_m: f64,
    /// Gap between two tags in metres.
    pub spacing_m: f64,
    /// Number of the first tag.
    #[serde(default)]
    pub first_id: usize,
    /// Family of the tags.
    pub family: Dictionary,
    /// Width of the black border in bits: 2 on Kalibr's boards, 1 elsewhere. Both are searched for where it is not
    /// stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub border_bits: Option<usize>,
    /// Which tag is the first.
    #[serde(default)]
    pub ids: IdOrder,
}

impl AprilGrid {
    /// The lattice of tag corners, see [`super::TargetSpec::grid`].
    pub(crate) fn grid(&self) -> Grid {
        let alone = self.columns == 1 && self.rows == 1;
        let square_m = if alone { self.tag_m } else { self.pitch_m() / 2.0 };
        Grid { columns: 2 * self.columns, rows: 2 * self.rows, square_m }
    }

    /// Distance from tag to tag in metres.
    pub fn pitch_m(&self) -> f64 {
        self.tag_m + self.spacing_m
    }

    /// Corner `index` in the target frame, metres.
    pub fn point(&self, index: usize) -> Point3<f64> {
        let columns = 2 * self.columns;
        let along = |n: usize| (n / 2) as f64 * self.pitch_m() + (n % 2) as f64 * self.tag_m;
        Point3::new(along(index % columns), along(index / columns), 0.0)
    }

    /// Column and row (from the top) of a tag by its number; `None` for a tag of another board.
    pub fn place_of(&self, id: usize) -> Option<(usize, usize)> {
        let number = id.checked_sub(self.first_id)?;
        let (column, row) = (number % self.columns, number / self.columns);
        let from_top = match self.ids {
            IdOrder::TopDown => row,
            IdOrder::BottomUp => (self.rows - 1).checked_sub(row)?,
        };
        (row < self.rows).then_some((column, from_top))
    }

    /// Number of the tag in that column and row (from the top).
    pub fn id_at(&self, column: usize, row: usize) -> usize {
        let row = match self.ids {
            IdOrder::TopDown => row,
            IdOrder::BottomUp => self.rows - 1 - row,
        };
        self.first_id + row * self.columns + column
    }

    /// Indices of a tag's corners: top left, top right, bottom right, bottom left.
    pub fn corner_indices(&self, (column, row): (usize, usize)) -> [usize; 4] {
        let first = 2 * row * 2 * self.columns + 2 * column;
        let below = first + 2 * self.columns;
        [first, first + 1, below + 1, below]
    }

    /// Corners of a tag: top left, top right, bottom right, bottom left, metres.
    pub fn tag_corners(&self, place: (usize, usize)) -> [Vector2<f64>; 4] {
        self.corner_indices(place).map(|index| self.point(index).coords.xy())
    }

    pub(super) fn check(&self) -> Result<(), BadTarget> {
        length("spacing_m", self.spacing_m)?;
        self.check_with_id("first_id")
    }

    pub(super) fn check_with_id(&self, id: &'static str) -> Result<(), BadTarget> {
        let want = "a whole number of tags from 1 to 1000";
        count("columns", self.columns, 1, want)?;
        count("rows", self.rows, 1, want)?;
        length("tag_m", self.tag_m)?;
        // Counts are at most 1000 here, and saturating leaves a huge first number too large.
        if self.first_id.saturating_add(self.columns * self.rows) > self.family.markers() {
            let want = "such that the family has a tag for every place";
            return Err(BadTarget { key: id, value: self.first_id.to_string(), want });
        }
        match self.border_bits {
            Some(bits) if !(1..=4).contains(&bits) => {
                Err(BadTarget { key: "border_bits", value: bits.to_string(), want: "from 1 to 4" })
            }
            _ => Ok(()),
        }
    }
}

impl AprilGrid {
    pub(super) fn text(&self) -> Text {
        text!(
            "AprilGrid of {columns}×{rows} tags {family} of {tag} mm, {gap} mm between them, first tag {first}",
            columns = self.columns,
            rows = self.rows,
            family = self.family.name().to_owned(),
            tag = mm(self.tag_m),
            gap = mm(self.spacing_m),
            first = self.first_id
        )
    }
}

/// One square tag.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AprilTag {
    /// Side of the tag in metres, its black border included.
    pub tag_m: f64,
    /// Its number in the family.
    pub id: usize,
    /// The family of the tag.
    pub family: Dictionary,
    /// Width of the black border in bits, 1 where it is not stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub border_bits: Option<usize>,
}

impl AprilTag {
    /// The board with only this tag.
    pub fn alone(&self) -> AprilGrid {
        AprilGrid {
            columns: 1,
            rows: 1,
            tag_m: self.tag_m,
            spacing_m: 0.0,
            first_id: self.id,
            family: self.family,
            border_bits: Some(self.border_bits.unwrap_or(1)),
            ids: IdOrder::TopDown,
        }
    }
}

impl AprilTag {
    pub(super) fn text(&self) -> Text {
        text!(
            "tag {id} of {family}, {mm} mm wide",
            id = self.id,
            family = self.family.name().to_owned(),
            mm = mm(self.tag_m)
        )
    }
}

fn square(corner: Vector2<f64>, side: f64) -> [Vector2<f64>; 4] {
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| corner + Vector2::new(x, y) * side)
}
