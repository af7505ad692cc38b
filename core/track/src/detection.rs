//! The board in one image: corners near where they are expected, or a search of the whole image.

use image::GrayImage;
use nalgebra::{Isometry3, Point3, Vector2};

use super::corner::{self, Place};
use super::glance;
use super::pose::{self, Fit};
use handeye_detect::checkerboard::on_hard_edges;
use handeye_detect::{DetectOptions, VisionError, detect_with};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::planar_pose;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::view_equations::{ViewInput, Whitener};

/// Corners that a pose is believed from: twice what it needs, so that one wrong corner shows.
pub(super) const MIN_CORNERS: usize = 8;
/// Corners spread over at least this many squares (standard deviation) along the narrow side: two rows do.
const MIN_SPREAD: f64 = 0.4;
/// Smallest squares that are searched for corner by corner [px]: with smaller ones the samples are on the edges.
const MIN_SQUARE_PX: f64 = 5.0;
/// Smallest radius of the search [px]: lens and pose are never better than that for a board that moves.
const MIN_RADIUS_PX: f64 = 2.0;
/// Largest radius of the search as a part of a square: beyond a half the next corner of the same colour is as near.
const MAX_RADIUS: f64 = 0.45;
/// Accuracy of the rough search, 1σ: a part of a square, at least that many pixels.
const ROUGH: (f64, f64) = (0.03, 0.5);
/// Accuracy that a corner is not asked to exceed, 1σ [px]: blur and lens change over the image.
const EXACT_PX: f64 = 0.05;
/// Corners just outside of the board that may be seen by chance. A board shifted by whole squares shows five or more.
const MAX_BEYOND: usize = 2;
/// Corners with less than this part of the usual contrast are something else.
const MIN_CONTRAST_PART: f64 = 0.3;
/// Reduction of the cost, in variances of a corner, from which the mirrored pose is believed against the expected one: by
/// chance it happens less than once in a million images.
const MIRRORED_BETTER: f64 = 30.0;
/// Smallest standard deviation of a corner \[px\] that costs are compared with: the grey levels are whole numbers.
const MIN_SIGMA_PX: f64 = 0.01;

/// The board in an image.
#[derive(Debug, Clone)]
pub(super) struct Board {
    pub fit: Fit,
    /// Blur of the edges, 1σ \[px\]; of corners near where they were expected.
    pub blur_px: Option<f64>,
    /// Whether the square between the first four corners is dark; only for a whole board.
    pub first_dark: Option<bool>,
}

/// Expected contents of an image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Expected {
    pub camera_from_target: Isometry3<f64>,
    /// Largest distance of corners from there \[px\].
    pub radius_px: f64,
    pub blur_px: f64,
    /// Whether the square between the first four corners is dark.
    pub first_dark: bool,
}

/// The target, and the camera that sees it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eye<'a> {
    pub image: &'a GrayImage,
    pub target: &'a TargetSpec,
    /// The points of the target.
    pub board: &'a BoardPoints,
    pub camera: &'a Intrinsics,
}

impl Eye<'_> {
    fn grid(&self) -> Grid {
        self.target.grid()
    }

    /// Point (column, row) of the board, which may lie beyond its points.
    fn point(&self, column: i64, row: i64) -> Point3<f64> {
        let square_m = self.grid().square_m;
        Point3::new(column as f64 * square_m, row as f64 * square_m, 0.0)
    }

    fn drawn(&self, index: usize) -> Point3<f64> {
        self.board.drawn()[index]
    }

    fn place(&self, board: &Isometry3<f64>, column: i64, row: i64, first_dark: bool) -> Option<Place> {
        let at = |c: i64, r: i64| self.camera.project(&(board * self.point(c, r))).ok();
        let place = Place {
            px: at(column, row)?,
            along_x: (at(column + 1, row)? - at(column - 1, row)?) / 2.0,
            along_y: (at(column, row + 1)? - at(column, row - 1)?) / 2.0,
            dark: ((column + row).rem_euclid(2) == 0) == first_dark,
        };
        (self.camera.contains(&place.px) && place.is_usable(MIN_SQUARE_PX)).then_some(place)
    }

    fn places(&self, board: &Isometry3<f64>, first_dark: bool) -> Vec<(usize, Place)> {
        let grid = self.grid();
        (0..grid.len())
            .filter_map(|i| {
                let place = self.place(board, (i % grid.columns) as i64, (i / grid.columns) as i64, first_dark)?;
                Some((i, place))
            })
            .collect()
    }

    /// Shortest distance between neighbours in the middle of the board \[px\]; `None` out of sight.
    pub fn square_px(&self, board: &Isometry3<f64>) -> Option<f64> {
        let grid = self.grid();
        let (column, row) = (grid.columns as i64 / 2, grid.rows as i64 / 2);
        let at = |c: i64, r: i64| self.camera.project(&(board * self.point(c, r))).ok();
        let middle = at(column, row)?;
        Some((at(column - 1, row)? - middle).norm().min((at(column, row - 1)? - middle).norm()))
    }

    /// Whether the corners expected could be mixed up with their neighbours.
    pub fn is_vague(&self, expected: &Expected) -> bool {
        self.square_px(&expected.camera_from_target).is_none_or(|square| expected.radius_px > 0.5 * square)
    }

    /// Looks around the places expected; `None` when too few corners are there, or when the pattern goes on beyond the
    /// board, so that it is seen shifted by whole squares.
    pub fn near(&self, expected: &Expected) -> Option<Board> {
        // Others have no corners of bare squares.
        if !matches!(self.target, TargetSpec::Chessboard(_)) {
            return None;
        }
        let rough = self.rough(expected)?;
        let board = match self.on_hard_edges(&rough) {
            Some(board) => board,
            None => self.on_soft_edges(&rough, expected)?,
        };
        if !self.shows_all_sides(&board.fit.corners) && self.goes_on(&board.fit.pose, expected) {
            return None;
        }
        Some(board)
    }

    /// The pose by corners found to a pixel or so.
    fn rough(&self, expected: &Expected) -> Option<Isometry3<f64>> {
        let places = self.places(&expected.camera_from_target, expected.first_dark);
        let square = median_high(places.iter().map(|(_, place)| place.spacing()))?;
        let radius = expected.radius_px.clamp(MIN_RADIUS_PX, (MAX_RADIUS * square).max(MIN_RADIUS_PX));
        let corners: Corners = places
            .iter()
            .filter_map(|(i, place)| {
                let reach = radius.min((MAX_RADIUS * place.spacing()).max(MIN_RADIUS_PX));
                Some(Corner::new(*i, corner::roughly(self.image, place, reach)?))
            })
            .collect();
        self.check(&corners)?;
        let floor_px = (ROUGH.0 * square).max(ROUGH.1);
        let fit = pose::robust(&self.seen(), &corners, &expected.camera_from_target, floor_px)?;
        self.check(&fit.corners)?;
        // Most of what looks like corners has to move as one board.
        (2 * fit.corners.len() > corners.len()).then_some(fit.pose)
    }

    fn check(&self, corners: &[Corner]) -> Option<()> {
        let points = corners.iter().map(|corner| self.drawn(corner.index));
        let spread = MIN_SPREAD * self.grid().square_m;
        (corners.len() >= MIN_CORNERS && pose::spans(points, spread)).then_some(())
    }

    fn fitted(&self, corners: &Corners, start: &Isometry3<f64>, blur_px: Option<f64>) -> Option<Board> {
        self.check(corners)?;
        let seen = self.seen();
        let fit = pose::robust(&seen, corners, start, EXACT_PX)?;
        self.check(&fit.corners)?;
        if 2 * fit.corners.len() <= corners.len() {
            return None;
        }
        Some(Board { fit: self.better_of_both(&seen, fit), blur_px, first_dark: None })
    }

    /// The board by all sides of the squares, where the image has hard edges: a profile of edges does not fit them.
    fn on_hard_edges(&self, rough: &Isometry3<f64>) -> Option<Board> {
        let place = |index: usize| Some(Corner::new(index, self.camera.project(&(rough * self.drawn(index))).ok()?));
        let places: Option<Vec<Corner>> = (0..self.grid().len()).map(place).collect();
        self.fitted(&on_hard_edges(self.image, &places?, &self.grid())?, rough, None)
    }

    /// Each corner separately.
    fn on_soft_edges(&self, rough: &Isometry3<f64>, expected: &Expected) -> Option<Board> {
        let mut found: Vec<(usize, corner::Found)> = self
            .places(rough, expected.first_dark)
            .into_iter()
            .filter_map(|(i, place)| Some((i, corner::exactly(self.image, &place, expected.blur_px)?)))
            .collect();
        let usual = median_high(found.iter().map(|(_, corner)| corner.contrast))?;
        found.retain(|(_, corner)| corner.contrast >= MIN_CONTRAST_PART * usual);
        let blur_px = median_high(found.iter().map(|(_, corner)| corner.blur_px));
        let corners: Corners = found.into_iter().map(|(index, corner)| Corner::new(index, corner.px)).collect();
        self.fitted(&corners, rough, blur_px)
    }

    /// The corners with their camera.
    fn seen(&self) -> ViewInput<'_> {
        ViewInput {
            intrinsics: self.camera,
            board: self.board,
            shape: &BoardShape::FLAT,
            corners: &[],
            whitener: &Whitener::Alike,
            depths: None,
        }
    }

    /// The mirrored pose, when the corners clearly support it.
    fn better_of_both(&self, seen: &ViewInput<'_>, fit: Fit) -> Fit {
        let Some(other) = pose::other_minimum(seen, &fit, &self.target.centre()) else { return fit };
        let freedom = (2 * fit.corners.len()).saturating_sub(6).max(1) as f64;
        let variance = (other.cost / freedom).max(MIN_SIGMA_PX * MIN_SIGMA_PX);
        if fit.cost - other.cost > MIRRORED_BETTER * variance { other } else { fit }
    }

    /// Whether corners of all four sides of the board are seen, more than occur by chance beyond it: then it is not seen
    /// shifted by whole squares, which would leave the corners of a side where there are none.
    pub fn shows_all_sides(&self, corners: &[Corner]) -> bool {
        let Grid { columns, rows, .. } = self.grid();
        let is_seen =
            |at: &dyn Fn(usize) -> bool| corners.iter().filter(|corner| at(corner.index)).nth(MAX_BEYOND).is_some();
        let (first, last) = (is_seen(&|index| index % columns == 0), is_seen(&|index| index % columns + 1 == columns));
        let (top, bottom) = (is_seen(&|index| index < columns), is_seen(&|index| index / columns + 1 == rows));
        first && last && top && bottom
    }

    /// Whether there are corners of the pattern just outside of the board.
    fn goes_on(&self, board: &Isometry3<f64>, expected: &Expected) -> bool {
        let (columns, rows) = (self.grid().columns as i64, self.grid().rows as i64);
        let beside = (0..rows).flat_map(|row| [(-1, row), (columns, row)]);
        let above = (-1..=columns).flat_map(|column| [(column, -1), (column, rows)]);
        beside
            .chain(above)
            .filter_map(|(column, row)| self.place(board, column, row, expected.first_dark))
            .filter(|place| corner::exactly(self.image, place, expected.blur_px).is_some())
            .nth(MAX_BEYOND)
            .is_some()
    }

    /// Whether [`Self::anywhere`] may succeed.
    pub fn may_show_all(&self) -> bool {
        match self.target {
            TargetSpec::Chessboard(grid) => glance::may_show(self.image, grid.len()),
            _ => true,
        }
    }

    /// Searches the whole image for the whole board. Where the pattern leaves a choice, the numbering nearer to
    /// `expected` counts.
    pub fn anywhere(&self, expected: Option<&Isometry3<f64>>) -> Result<Option<Board>, VisionError> {
        let Some(mut corners) = detect_with(self.image, self.target, &DetectOptions::live())? else { return Ok(None) };
        if let Some(expected) = expected
            && self.target.is_symmetric()
        {
            self.number_like(expected, &mut corners);
        }
        // Corners that do not determine a pose are not a board.
        let Ok(solved) = planar_pose::solve(&corners, self.target, self.camera) else { return Ok(None) };
        let turned = |pose: &Isometry3<f64>| expected.map_or(0.0, |e| e.rotation.angle_to(&pose.rotation));
        let best = *solved.best.camera_from_target.isometry();
        let start = match solved.alternative.map(|other| *other.camera_from_target.isometry()) {
            Some(other) if turned(&other) < turned(&best) => other,
            _ => best,
        };
        Ok(self.fitted(&corners, &start, None).map(|board| {
            let first_dark = Some(self.first_is_dark(&board.fit.pose));
            Board { first_dark, ..board }
        }))
    }

    fn number_like(&self, expected: &Isometry3<f64>, corners: &mut [Corner]) {
        let distance = |index: usize, px: Vector2<f64>| {
            self.camera.project(&(expected * self.target.point(index))).map_or(0.0, |at| (at - px).norm_squared())
        };
        let apart = |quarters: usize| -> f64 {
            corners.iter().map(|corner| distance(self.target.renumbered(corner.index, quarters), corner.px)).sum()
        };
        let ways = std::iter::once(0).chain(self.target.quarter_turns().iter().copied());
        let nearest = ways.map(|quarters| (apart(quarters), quarters)).min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, quarters)) = nearest.filter(|(_, quarters)| *quarters != 0) {
            for corner in corners {
                corner.index = self.target.renumbered(corner.index, quarters);
            }
        }
    }

    /// Whether the square between the first four corners is dark, by all corners together.
    fn first_is_dark(&self, board: &Isometry3<f64>) -> bool {
        let places = self.places(board, true);
        let sign = |dark: bool| if dark { 1.0 } else { -1.0 };
        places.iter().map(|(_, place)| sign(place.dark) * corner::darkness(self.image, place)).sum::<f64>() >= 0.0
    }
}
