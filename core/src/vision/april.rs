//! Boards of tags, and single tags.

use image::GrayImage;

use super::detect::Effort;
use super::markers::{self, Marker, Placed};
use super::{VisionError, edges, spread};
use crate::observation::Corner;
use crate::target::AprilGrid;

/// Borders that are in use, in bits: Kalibr's, and that of nearly everyone else.
const BORDERS: [usize; 2] = [2, 1];

/// The corners of all tags in sight that lie as the board has them, or of the one tag of a board of one.
pub(super) fn find(image: &GrayImage, board: &AprilGrid, effort: Effort) -> Result<Option<Vec<Corner>>, VisionError> {
    let stated = board.border_bits.map(|bits| [bits]);
    let borders = stated.as_ref().map_or(&BORDERS[..], |bits| &bits[..]);
    for &border_bits in borders {
        let markers = markers::find(image, board.family, border_bits, effort)?;
        let placed = placed(board, &markers);
        if placed.is_empty() {
            continue;
        }
        tracing::debug!(border_bits, tags = placed.len(), "tags found");
        let corners = corners(image, board, border_bits, &placed);
        return Ok(spread::is_enough(&corners, |index| board.point(index)).then_some(corners));
    }
    Ok(None)
}

fn placed(board: &AprilGrid, markers: &[Marker]) -> Vec<Placed> {
    let place = |id: usize| board.place_of(id).map(|place| board.tag_corners(place));
    // OpenCV reads the tags of the AprilTag project upside down.
    let upright: Vec<Marker> =
        if board.family.is_apriltag() { markers.iter().map(Marker::upside_down).collect() } else { markers.to_vec() };
    if board.columns * board.rows > 1 {
        let upright = markers::in_place(&upright, board.pitch_m(), place);
        // A board printed by OpenCV has them that way round.
        let as_read = markers::in_place(markers, board.pitch_m(), place);
        return if as_read.len() > upright.len() { as_read } else { upright };
    }
    let mut seen = upright.into_iter().filter_map(|m| Some(Placed { on_target: place(m.id)?, marker: m }));
    match (seen.next(), seen.next()) {
        (Some(only), None) => vec![only],
        // Two tags of one number: which is the target, nobody knows.
        _ => Vec::new(),
    }
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
