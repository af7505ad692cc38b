//! Boards of tags, and single tags.

use std::collections::BTreeSet;

use image::GrayImage;
use nalgebra::{Matrix3, Vector2};

use super::{Marker, Placed, edges, spread};
use crate::options::Effort;
use crate::{VisionError, markers};
use handeye_geometry::planar_pose::homography::{homography, mapped};
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{AprilGrid, AprilTag};

/// Borders that are in use, in bits: Kalibr's, and that of nearly everyone else.
const BORDERS: [usize; 2] = [2, 1];

/// Tags within this many pitches locate another one.
const AROUND: f64 = 2.3;
/// Least difference between white and black cells \[grey levels\].
const MIN_CONTRAST: f64 = 15.0;
/// Part of the cells that must be of the right colour: two codes of the weakest family differ in a fifth of theirs.
const MIN_RIGHT: f64 = 0.98;

/// The corners of all tags in sight that are placed as on the board, or of the one tag of a board of one.
pub(crate) fn find(image: &GrayImage, board: &AprilGrid, effort: Effort) -> Result<Option<Vec<Corner>>, VisionError> {
    let stated = board.border_bits.map(|bits| [bits]);
    let borders = stated.as_ref().map_or(&BORDERS[..], |bits| &bits[..]);
    for &border_bits in borders {
        let markers = markers::find(image, board.family, border_bits, effort)?;
        let Some((mut placed, turned)) = placed(board, &markers) else { continue };
        placed.extend(overlooked(image, board, border_bits, &placed, turned)?);
        tracing::debug!(border_bits, tags = placed.len(), "tags found");
        let corners = corners(image, board, border_bits, &placed);
        return Ok(spread::is_enough(&corners, |index| board.point(index)).then_some(corners));
    }
    Ok(None)
}

/// The numbers of the tags in sight that are of a tag's family and border, ascending, each once.
///
/// # Errors
/// [`VisionError::OpenCv`].
pub fn tags_in_sight(image: &GrayImage, tag: &AprilTag) -> Result<Vec<usize>, VisionError> {
    let markers = markers::find(image, tag.family, tag.border_bits.unwrap_or(1), Effort::Thorough)?;
    let ids: BTreeSet<usize> = markers.into_iter().map(|marker| marker.id).collect();
    Ok(ids.into_iter().collect())
}

/// The tags that are placed as on the board, and whether they are upright, half a turn from how OpenCV reads them; `None`
/// without any.
fn placed(board: &AprilGrid, markers: &[Marker]) -> Option<(Vec<Placed>, bool)> {
    let place = |id: usize| board.place_of(id).map(|place| board.tag_corners(place));
    // OpenCV reads the tags of the AprilTag project upside down.
    let turned = board.family.is_apriltag();
    let upright: Vec<Marker> =
        if turned { markers.iter().map(Marker::upside_down).collect() } else { markers.to_vec() };
    if board.columns * board.rows > 1 {
        let upright = markers::in_place(&upright, board.pitch_m(), place);
        // A board printed by OpenCV has them that way round.
        let as_read = markers::in_place(markers, board.pitch_m(), place);
        let chosen = if as_read.len() > upright.len() { (as_read, false) } else { (upright, turned) };
        return (!chosen.0.is_empty()).then_some(chosen);
    }
    let mut seen = upright.into_iter().filter_map(|m| Some(Placed { on_target: place(m.id)?, marker: m }));
    match (seen.next(), seen.next()) {
        (Some(only), None) => Some((vec![only], turned)),
        // Two tags with the same number: it is not known which is the target's.
        _ => None,
    }
}

/// Tags that OpenCV did not separate from what is around them, though they are where their neighbours have them: their
/// cells are black and white as those of the tag of that place.
fn overlooked(
    image: &GrayImage,
    board: &AprilGrid,
    border_bits: usize,
    placed: &[Placed],
    turned: bool,
) -> Result<Vec<Placed>, VisionError> {
    let mut found = Vec::new();
    for place in (0..board.rows).flat_map(|row| (0..board.columns).map(move |column| (column, row))) {
        let id = board.id_at(place.0, place.1);
        if placed.iter().any(|p| p.marker.id == id) {
            continue;
        }
        let on_target = board.tag_corners(place);
        let middle = on_target.iter().sum::<Vector2<f64>>() / 4.0;
        let near = placed.iter().filter(|p| (p.centre_on_target() - middle).norm() < AROUND * board.pitch_m());
        let pairs: Vec<_> = near.flat_map(Placed::pairs).collect();
        let Some(map) = homography(&pairs) else { continue };
        let mut cells = markers::cells(board.family, id, border_bits)?;
        if turned {
            cells.reverse();
        }
        let corners = on_target.map(|p| mapped(&map, p));
        if shows(image, &map, &on_target, &cells, board.spacing_m / board.tag_m) {
            found.push(Placed { marker: Marker { id, corners }, on_target });
        }
    }
    Ok(found)
}

/// Whether the cells of a tag are in the image where the map has them, with a light margin around it. `gap` is the
/// distance to the next tag as a part of its side.
fn shows(image: &GrayImage, map: &Matrix3<f64>, on_target: &[Vector2<f64>; 4], cells: &[bool], gap: f64) -> bool {
    // Cells are a square.
    let n = (cells.len() as f64).sqrt().round() as usize;
    let (along_x, along_y) = (on_target[1] - on_target[0], on_target[3] - on_target[0]);
    let level = |x: f64, y: f64| {
        let px = mapped(map, on_target[0] + along_x * x + along_y * y).map(f64::round);
        let inside = px.min() >= 0.0 && px.x < f64::from(image.width()) && px.y < f64::from(image.height());
        inside.then(|| f64::from(image.get_pixel(px.x as u32, px.y as u32).0[0]))
    };
    let part = |k: usize| (k as f64 + 0.5) / n as f64;
    let inside = (0..cells.len()).map(|i| level(part(i % n), part(i / n)));
    let (before, after) = (-gap / 2.0, 1.0 + gap / 2.0);
    let around = (0..n).map(part).flat_map(|t| [(t, before), (t, after), (before, t), (after, t)]);
    let Some(levels) = inside.chain(around.map(|(x, y)| level(x, y))).collect::<Option<Vec<f64>>>() else {
        return false;
    };
    let expected: Vec<bool> = cells.iter().copied().chain(std::iter::repeat_n(false, 4 * n)).collect();
    let mean = |black: bool| {
        let values = levels.iter().zip(&expected).filter(|(_, cell)| **cell == black).map(|(level, _)| *level);
        values.clone().sum::<f64>() / values.count().max(1) as f64
    };
    let (black, white) = (mean(true), mean(false));
    let middle = f64::midpoint(black, white);
    let right = levels.iter().zip(&expected).filter(|(level, cell)| (**level < middle) == **cell).count();
    white - black >= MIN_CONTRAST && right as f64 >= MIN_RIGHT * expected.len() as f64
}

fn corners(image: &GrayImage, board: &AprilGrid, border_bits: usize, placed: &[Placed]) -> Vec<Corner> {
    let cells = (board.family.bits() + 2 * border_bits) as f64;
    // A single tag has a light margin of one cell by the rules of its family.
    let gap = if board.columns * board.rows > 1 { board.spacing_m / board.tag_m } else { 1.0 / cells };
    let squares: Vec<_> = placed.iter().map(|p| p.marker.corners).collect();
    let refined = edges::refine(image, &squares, border_bits as f64 / cells, gap);
    let mut all = Vec::with_capacity(4 * placed.len());
    for (p, refined) in placed.iter().zip(refined) {
        let Some(place) = board.place_of(p.marker.id) else { continue };
        for (index, refined) in board.corner_indices(place).into_iter().zip(refined) {
            if let Some((px, covariance)) = refined {
                all.push(Corner { index, px, covariance_px2: Some(covariance) });
            }
        }
    }
    all.sort_by_key(|corner| corner.index);
    all
}
