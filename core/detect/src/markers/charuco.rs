//! `ChArUco` boards: markers identify the corners, the chessboard locates them.
//!
//! A corner is searched where the markers around it predict it. Only those nearby are used, so that distortion over the
//! whole board does no harm; then the corner itself is fitted to the pixels.

use image::GrayImage;
use nalgebra::{Matrix3, Vector2};

use super::crossing::{self, Expected};
use super::{Marker, Placed, spread};
use crate::options::Effort;
use crate::{VisionError, markers};
use handeye_geometry::planar_pose::homography::{homography, jacobian, mapped};
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Charuco, Layout};

/// Markers within this many squares of a corner locate it.
const AROUND: f64 = 2.3;
/// Number of neighbouring corners that locate one without a marker.
const NEIGHBOURS: usize = 5;
/// Largest distance from there: a part of a square, and some pixels for corners of markers that are whole pixels.
const REACH: (f64, f64) = (0.15, 1.5);
/// Smallest squares \[px\] whose corner is large enough to measure.
const MIN_SQUARE_PX: f64 = 6.0;
/// A corner with less than this part of the usual contrast is half covered.
const MIN_CONTRAST_PART: f64 = 0.3;

pub(crate) fn find(image: &GrayImage, board: &Charuco, effort: Effort) -> Result<Option<Vec<Corner>>, VisionError> {
    let markers = markers::find(image, board.dictionary, 1, effort)?;
    let Some((layout, placed)) = layout_of(board, &markers) else { return Ok(None) };
    if let Some(stated) = board.layout
        && stated != layout
        && !board.layouts_are_alike()
    {
        return Err(VisionError::OtherLayout { stated: stated.name(), seen: layout.name() });
    }
    tracing::debug!(layout = layout.name(), markers = placed.len(), "ChArUco board found");
    let corners = corners(image, board, layout, &placed);
    Ok(spread::is_enough(&corners, |index| board.grid().point(index)).then_some(corners))
}

/// Which layout the board in the image has; `None` when it is not there, or when the markers seen do not decide: those of
/// one row are in the same places in both. Boards of an even number of inner rows have only one layout, [`Layout::New`] by
/// name.
///
/// # Errors
/// As [`crate::detect`], without [`VisionError::OtherLayout`].
pub fn charuco_layout(image: &GrayImage, board: &Charuco) -> Result<Option<Layout>, VisionError> {
    crate::options::check(image, &handeye_geometry::targets::TargetSpec::Charuco(*board))?;
    let markers = markers::find(image, board.dictionary, 1, Effort::Thorough)?;
    Ok(layout_of(&Charuco { layout: None, ..*board }, &markers).map(|(layout, _)| layout))
}

/// The layout that more markers agree on, and those markers. Where both explain the same, what is stated counts.
fn layout_of(board: &Charuco, markers: &[Marker]) -> Option<(Layout, Vec<Placed>)> {
    let [new, legacy] = Layout::BOTH.map(|layout| {
        let squares = board.marker_squares(layout);
        let place = |id: usize| squares.get(id).map(|square| board.marker_corners(*square));
        markers::in_place(markers, board.square_m, place)
    });
    let stated = board.layout.or(board.layouts_are_alike().then_some(Layout::New));
    let chosen = match new.len().cmp(&legacy.len()) {
        std::cmp::Ordering::Greater => Layout::New,
        std::cmp::Ordering::Less => Layout::Legacy,
        std::cmp::Ordering::Equal => stated?,
    };
    let placed = match chosen {
        Layout::New => new,
        Layout::Legacy => legacy,
    };
    (!placed.is_empty()).then_some((chosen, placed))
}

fn corners(image: &GrayImage, board: &Charuco, layout: Layout, placed: &[Placed]) -> Vec<Corner> {
    let mut found = Vec::new();
    for index in 0..board.grid().len() {
        let Some(expected) = expected(board, layout, placed, index) else { continue };
        let spacing = expected.along_x.norm().min(expected.along_y.norm());
        if spacing < MIN_SQUARE_PX {
            continue;
        }
        let reach = REACH.0 * spacing + REACH.1;
        if let Some(seen) = crossing::fit(image, &expected, reach.min(0.3 * spacing)) {
            let corner = Corner { index, px: seen.px, covariance_px2: Some(seen.covariance_px2) };
            found.push((corner, seen.contrast));
        }
    }
    grow(image, board, layout, &mut found);
    let usual = median_high(found.iter().map(|(_, contrast)| *contrast)).unwrap_or(0.0);
    found.into_iter().filter(|(_, contrast)| *contrast >= MIN_CONTRAST_PART * usual).map(|(corner, _)| corner).collect()
}

/// Adds corners whose markers could not be read, each from the corners around it that were found, until there are no more.
fn grow(image: &GrayImage, board: &Charuco, layout: Layout, found: &mut Vec<(Corner, f64)>) {
    loop {
        let before = found.len();
        for index in 0..board.grid().len() {
            if found.iter().any(|(corner, _)| corner.index == index) {
                continue;
            }
            let on_target = board.grid().point(index).coords.xy();
            let pairs: Vec<_> = found
                .iter()
                .map(|(corner, _)| (board.grid().point(corner.index).coords.xy(), corner.px))
                .filter(|(at, _)| (at - on_target).norm() < AROUND * board.square_m)
                .collect();
            // Three in a row and one next to it are the fewest that determine both directions.
            if pairs.len() < NEIGHBOURS {
                continue;
            }
            let Some(expected) = homography(&pairs).map(|map| expected_by(&map, board, layout, index)) else {
                continue;
            };
            let spacing = expected.along_x.norm().min(expected.along_y.norm());
            if spacing < MIN_SQUARE_PX {
                continue;
            }
            if let Some(seen) = crossing::fit(image, &expected, REACH.0 * spacing) {
                let corner = Corner { index, px: seen.px, covariance_px2: Some(seen.covariance_px2) };
                found.push((corner, seen.contrast));
            }
        }
        if found.len() == before {
            break;
        }
    }
    found.sort_by_key(|(corner, _)| corner.index);
}

/// Where the markers around have a corner; `None` where no marker touches its squares.
fn expected(board: &Charuco, layout: Layout, placed: &[Placed], index: usize) -> Option<Expected> {
    let on_target = board.grid().point(index).coords.xy();
    let away = |p: &Placed| (p.centre_on_target() - on_target).norm() / board.square_m;
    // The centre of an adjacent square is 0.71 squares away.
    if !placed.iter().any(|p| away(p) < 0.8) {
        return None;
    }
    let pairs: Vec<_> = placed.iter().filter(|p| away(p) < AROUND).flat_map(Placed::pairs).collect();
    Some(expected_by(&homography(&pairs)?, board, layout, index))
}

/// A corner by a local map from the target to the image.
fn expected_by(map: &Matrix3<f64>, board: &Charuco, layout: Layout, index: usize) -> Expected {
    let on_target = board.grid().point(index).coords.xy();
    let steps = jacobian(map, on_target) * board.square_m;
    let (column, row) = (index % board.columns, index / board.columns);
    Expected {
        px: mapped(map, on_target),
        along_x: Vector2::from(steps.column(0)),
        along_y: Vector2::from(steps.column(1)),
        dark: board.is_dark(layout, column + 1, row + 1),
        margin: (1.0 - board.marker_m / board.square_m) / 2.0,
    }
}
