//! One side of a square: between which pixels of each row or column it passes.

use image::GrayImage;
use nalgebra::Vector2;

use super::map::SmoothMap;
use super::polygon::{Moments, Polygon};

/// Least distance of a row from an end \[px\]: nearer, it may be the other edge that it crosses.
const MARGIN_PX: f64 = 1.0;
/// A pixel that differs from its square by more than this part of the contrast is neither dark nor light.
const MIXED: f64 = 0.2;
/// Least contrast in grey levels.
const MIN_CONTRAST: f64 = 20.0;
/// Fewest rows of a side that are used.
const MIN_ROWS: usize = 3;
/// Largest contradiction between rows \[px\]: a rasteriser rounds, a side may bend a little. If the polygon is still
/// empty, it is not a straight edge.
const SLACK_PX: [f64; 3] = [0.005, 0.05, 0.2];

/// How far to either side of an edge pixels are read.
pub(super) struct Reach {
    /// Distance as a part of a square.
    pub part: f64,
    pub most_px: f64,
}

/// A node of the grid: an inner corner, or a point on the outline of the print.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    /// Column and row, −1 to the number of them.
    place: [i64; 2],
    /// Its index where it is a corner.
    pub corner: Option<usize>,
}

/// A side of a square, between neighbouring nodes.
#[derive(Debug, Clone)]
pub(super) struct Side {
    pub ends: [End; 2],
}

/// The displacements of the ends of a side that the rows allow.
#[derive(Debug, Clone)]
pub(super) struct Edge {
    /// The direction in which both ends move, in the image.
    pub normal: Vector2<f64>,
    /// The axis along which the edge was searched: 0 along rows, 1 along columns.
    pub cross: usize,
    /// Possible displacements, pixels.
    pub polygon: Polygon,
    /// Mean and covariance of that, everything in it being as probable.
    pub moments: Moments,
}

/// Observations of a side.
pub(super) struct Seen {
    pub edge: Option<Edge>,
    pub passages: Vec<Passage>,
    /// Number of those where a pixel next to the edge is neither dark nor light.
    pub mixed: usize,
}

/// The edge passes `low` to `high` pixels from its expected place, along the row or column, at `part` of its length.
pub(super) struct Passage {
    pub part: f64,
    pub low: f64,
    pub high: f64,
}

impl Side {
    /// All sides that end at a corner, those that leave it for the outline of the print included; the outline itself is
    /// left out, because beyond it is the support of the board.
    pub fn all(columns: usize, rows: usize) -> Vec<Self> {
        let (last_column, last_row) = (columns as i64, rows as i64);
        let end = |column: i64, row: i64| {
            let is_corner = (0..last_column).contains(&column) && (0..last_row).contains(&row);
            End { place: [column, row], corner: is_corner.then(|| row as usize * columns + column as usize) }
        };
        let along = (0..last_row).flat_map(|row| (-1..last_column).map(move |column| (column, row)));
        let down = (0..last_column).flat_map(|column| (-1..last_row).map(move |row| (column, row)));
        let along = along.map(|(column, row)| Self { ends: [end(column, row), end(column + 1, row)] });
        let down = down.map(|(column, row)| Self { ends: [end(column, row), end(column, row + 1)] });
        along.chain(down).collect()
    }

    /// Whether it runs along a row of the grid.
    pub fn is_along_rows(&self) -> bool {
        self.ends[0].place[1] == self.ends[1].place[1]
    }

    /// Looks at every row (or column, across which the side runs) for where the level changes.
    pub fn seen(&self, image: &GrayImage, map: &SmoothMap, reach: &Reach) -> Seen {
        let [a, b] = self.ends.map(|end| map.at(end.place[0] as f64, end.place[1] as f64));
        let way = b - a;
        let length = way.norm();
        let mut seen = Seen { edge: None, passages: Vec::new(), mixed: 0 };
        let Some(normal) = Vector2::new(-way.y, way.x).try_normalize(1e-9) else { return seen };
        // Rows are counted along `main`; the step is searched along the other axis.
        let main = usize::from(way.y.abs() >= way.x.abs());
        let cross = 1 - main;
        // Off the line between the ends: perspective moves the middle along it, which bends nothing.
        let middle = self.middle(map) - a;
        let bend = middle[cross] - middle[main] / way[main] * way[cross];
        let reach = (reach.part * length).min(reach.most_px);
        let [from_a, from_b] = [0, 1].map(|i| self.margin(map, i, main, reach));
        let (low, high, from_low, from_high) =
            if way[main] > 0.0 { (a[main], b[main], from_a, from_b) } else { (b[main], a[main], from_b, from_a) };
        let (first, last) = ((low + from_low).ceil(), (high - from_high).floor());
        let mut row = first;
        while row <= last {
            let part = (row - a[main]) / way[main];
            let expected = a[cross] + part * way[cross] + 4.0 * part * (1.0 - part) * bend;
            if let Some((before, mixed)) = step(image, main, row, expected, reach) {
                seen.mixed += usize::from(mixed);
                seen.passages.push(Passage { part, low: before - expected, high: before + 1.0 - expected });
            }
            row += 1.0;
        }
        if seen.passages.len() >= MIN_ROWS {
            seen.edge = SLACK_PX.iter().find_map(|slack| left_by(&seen.passages, normal, cross, *slack));
        }
        seen
    }

    fn middle(&self, map: &SmoothMap) -> Vector2<f64> {
        let [a, b] = self.ends.map(|end| end.place.map(|value| value as f64));
        map.at(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]))
    }

    /// Distance from which on rows do not meet the other edge of an end within reach.
    fn margin(&self, map: &SmoothMap, end: usize, main: usize, reach: f64) -> f64 {
        let [column, row] = self.ends[end].place.map(|value| value as f64);
        let (by_column, by_row) = if self.is_along_rows() { (0.0, 0.5) } else { (0.5, 0.0) };
        let other = map.at(column + by_column, row + by_row) - map.at(column - by_column, row - by_row);
        let slope = (other[main] / other[1 - main]).abs();
        MARGIN_PX + (reach + 1.0) * slope.min(1e3)
    }
}

/// The coordinate of the last pixel before the one step within reach of where it is expected, and whether a pixel next to
/// it is neither dark nor light. `None` where there is no such step, or more than one.
fn step(image: &GrayImage, main: usize, row: f64, expected: f64, reach: f64) -> Option<(f64, bool)> {
    let size = [image.width(), image.height()].map(f64::from);
    let (first, last) = ((expected - reach).floor(), (expected + reach).ceil());
    if !(row >= 0.0 && row < size[main] && first >= 0.0 && last < size[1 - main]) {
        return None;
    }
    let level = |at: f64| {
        let (x, y) = if main == 1 { (at, row) } else { (row, at) };
        f64::from(image.get_pixel(x as u32, y as u32).0[0])
    };
    let (start, end) = (level(first), level(last));
    let contrast = end - start;
    if contrast.abs() < MIN_CONTRAST {
        return None;
    }
    let part = |at: f64| (level(at) - start) / contrast;
    let mut before = None;
    let mut at = first;
    while at < last {
        if (part(at) < 0.5) != (part(at + 1.0) < 0.5) {
            if before.is_some() {
                return None;
            }
            before = Some(at);
        }
        at += 1.0;
    }
    let before = before?;
    Some((before, part(before) > MIXED || part(before + 1.0) < 1.0 - MIXED))
}

/// The displacements of both ends along the normal that are possible.
fn left_by(passages: &[Passage], normal: Vector2<f64>, cross: usize, slack: f64) -> Option<Edge> {
    let mut polygon = Polygon::unbounded();
    // A step of one pixel along the row is less across the edge.
    let scale = normal[cross];
    for Passage { part, low, high } in passages {
        let along = Vector2::new(1.0 - part, *part);
        let (least, most) = if scale > 0.0 { (low * scale, high * scale) } else { (high * scale, low * scale) };
        polygon.cut(along, most + slack);
        polygon.cut(-along, slack - least);
    }
    let moments = polygon.moments()?;
    Some(Edge { normal, cross, polygon, moments })
}
