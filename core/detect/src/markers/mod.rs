//! Square markers: found and read by OpenCV, accepted where several are placed as on the target.

pub(crate) mod april;
pub(crate) mod charuco;
pub(crate) mod crossing;
mod edge;
mod edge_profile;
pub(crate) mod edges;
mod grey_levels;
pub(crate) mod spread;

use image::GrayImage;
use nalgebra::{Matrix3, Vector2, Vector3};
use opencv::aruco::{
    self, CORNER_REFINE_APRILTAG, CORNER_REFINE_NONE, DetectorParameters, DetectorParametersTrait as _,
};
use opencv::core::{Mat, MatTraitConstManual as _, Point2f, Vector, no_array};

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray};
use super::options::Effort;
use handeye_geometry::planar_pose::homography::{homography, mapped};
use handeye_geometry::targets::Dictionary;

/// Markers within this many pitches of each other confirm each other: next neighbours, also diagonally on a `ChArUco`
/// board.
const NEIGHBOURS: f64 = 2.1;
/// Largest distance, as a part of its side, of a marker from where its neighbour expects it. Corners are known to a
/// pixel, and a lens bends; a marker in the next place is off by more than a whole side.
const MAX_OFF: f64 = 0.35;
/// What is added to that for corners that are whole pixels.
const MAX_OFF_PX: f64 = 1.5;

/// A marker in an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Marker {
    pub id: usize,
    /// Its top left, top right, bottom right and bottom left corner, to a pixel or so.
    pub corners: [Vector2<f64>; 4],
}

impl Marker {
    /// The same marker read the other way up.
    pub fn upside_down(&self) -> Self {
        let [a, b, c, d] = self.corners;
        Self { id: self.id, corners: [c, d, a, b] }
    }

    fn centre(&self) -> Vector2<f64> {
        self.corners.iter().sum::<Vector2<f64>>() / 4.0
    }

    /// Length of its shortest side in pixels.
    pub fn side_px(&self) -> f64 {
        (0..4).map(|i| (self.corners[(i + 1) % 4] - self.corners[i]).norm()).fold(f64::INFINITY, f64::min)
    }
}

/// A marker and its place on the target.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placed {
    pub marker: Marker,
    /// Its corners in the target frame, in the same order.
    pub on_target: [Vector2<f64>; 4],
}

impl Placed {
    pub fn pairs(&self) -> [(Vector2<f64>, Vector2<f64>); 4] {
        std::array::from_fn(|i| (self.on_target[i], self.marker.corners[i]))
    }

    pub fn centre_on_target(&self) -> Vector2<f64> {
        self.on_target.iter().sum::<Vector2<f64>>() / 4.0
    }
}

/// The cells of a marker as OpenCV draws it, row by row from the top left, its border included; `true` is black.
pub fn cells(dictionary: Dictionary, id: usize, border_bits: usize) -> Result<Vec<bool>, VisionError> {
    let refused = failed("draw a marker");
    let codes = aruco::get_predefined_dictionary_i32(dictionary.opencv_number()).map_err(&refused)?;
    // Checked by `TargetSpec::check`; numbers that are not refused by OpenCV.
    let (id, border) = (i32::try_from(id).unwrap_or(-1), i32::try_from(border_bits).unwrap_or(-1));
    let side = dictionary.bits() as i32 + 2 * border;
    let mut drawn = Mat::default();
    aruco::draw_marker(&codes, id, side, &mut drawn, border).map_err(&refused)?;
    Ok(drawn.data_typed::<u8>().map_err(&refused)?.iter().map(|grey| *grey < 128).collect())
}

/// All markers of the family in the image.
pub(super) fn find(
    image: &GrayImage,
    dictionary: Dictionary,
    border_bits: usize,
    effort: Effort,
) -> Result<Vec<Marker>, VisionError> {
    let first = search(image, dictionary, border_bits, effort, CORNER_REFINE_NONE)?;
    if !first.is_empty() || effort == Effort::Live {
        return Ok(first);
    }
    // The quads of the AprilTag project, slower. Their half pixel of shift is nothing to the refinement.
    search(image, dictionary, border_bits, effort, CORNER_REFINE_APRILTAG)
}

fn search(
    image: &GrayImage,
    dictionary: Dictionary,
    border_bits: usize,
    effort: Effort,
    method: i32,
) -> Result<Vec<Marker>, VisionError> {
    let refused = failed("look for markers");
    let mat = mat_from_gray(image)?;
    let codes = aruco::get_predefined_dictionary_i32(dictionary.opencv_number()).map_err(&refused)?;
    let mut parameters = DetectorParameters::create().map_err(&refused)?;
    parameters.set_marker_border_bits(border_bits as i32);
    parameters.set_corner_refinement_method(method);
    // OpenCV keeps the outermost of quads whose corners are near each other, as a part of the perimeter. That of the paper around a
    // tag with one cell of margin is 0.035 away, that of a square whose marker is nine tenths of it 0.02.
    parameters.set_min_marker_distance_rate(0.01);
    if effort == Effort::Thorough {
        // Markers down to a hundredth of the image, and windows for larger ones in uneven light.
        parameters.set_min_marker_perimeter_rate(0.015);
        parameters.set_adaptive_thresh_win_size_max(43);
    }
    let mut corners = Vector::<Vector<Point2f>>::new();
    let mut ids = Vector::<i32>::new();
    aruco::detect_markers(&mat, &codes, &mut corners, &mut ids, &parameters, &mut no_array()).map_err(&refused)?;
    let mut markers: Vec<Marker> = ids
        .iter()
        .zip(corners.iter())
        .filter_map(|(id, corners)| {
            let corners: [Vector2<f64>; 4] = from_points2f(&corners).try_into().ok()?;
            Some(Marker { id: usize::try_from(id).ok()?, corners })
        })
        .collect();
    // The edge of one marker has an inner and an outer contour, and the outer one is its outline.
    markers.sort_by(|a, b| b.side_px().total_cmp(&a.side_px()).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
    let mut found: Vec<Marker> = Vec::with_capacity(markers.len());
    for marker in markers {
        let is_of = |outer: &Marker| (outer.centre() - marker.centre()).norm() < 0.5 * outer.side_px();
        if !found.iter().any(|outer| outer.id == marker.id && is_of(outer)) {
            found.push(marker);
        }
    }
    // OpenCV searches in parallel; the order must not depend on it.
    found.sort_by(|a, b| a.id.cmp(&b.id).then(a.corners[0].x.total_cmp(&b.corners[0].x)));
    Ok(found)
}

/// The largest set of markers that are placed relative to their neighbours as on the target; `place` gives the corners
/// of a marker on the target by its number. A single marker has no neighbour to confirm it, and where most markers with
/// the target's numbers are elsewhere it is another target: the set has two or more and the majority, or is empty.
pub(super) fn in_place(
    markers: &[Marker],
    pitch_m: f64,
    place: impl Fn(usize) -> Option<[Vector2<f64>; 4]>,
) -> Vec<Placed> {
    let all: Vec<Placed> = markers
        .iter()
        .filter_map(|marker| Some(Placed { marker: marker.clone(), on_target: place(marker.id)? }))
        .collect();
    let mut group: Vec<usize> = (0..all.len()).collect();
    for i in 0..all.len() {
        for j in 0..i {
            if group[i] != group[j] && agree(&all[i], &all[j], pitch_m) {
                let (kept, gone) = (group[i], group[j]);
                group.iter_mut().filter(|g| **g == gone).for_each(|g| *g = kept);
            }
        }
    }
    let size = |g: usize| group.iter().filter(|other| **other == g).count();
    let Some(best) = group.iter().copied().max_by_key(|g| (size(*g), *g)) else { return Vec::new() };
    if size(best) < 2 {
        return Vec::new();
    }
    let (mut out, others): (Vec<_>, Vec<_>) = all.into_iter().zip(&group).partition(|(_, g)| **g == best);
    // An object in front may split a board. Markers where the largest part predicts them belong to the board.
    let pairs: Vec<_> = out.iter().flat_map(|(p, _)| p.pairs()).collect();
    if let Some(map) = homography(&pairs) {
        out.extend(others.into_iter().filter(|(p, _)| is_at(&map, p, 1.0)));
    }
    let mut out: Vec<Placed> = out.into_iter().map(|(p, _)| p).collect();
    if 2 * out.len() <= group.len() {
        return Vec::new();
    }
    out.sort_by_key(|p| p.marker.id);
    // A number seen twice in one set is not reliable.
    let ids: Vec<usize> = out.iter().map(|p| p.marker.id).collect();
    out.retain(|p| ids.iter().filter(|id| **id == p.marker.id).count() == 1);
    out
}

fn agree(a: &Placed, b: &Placed, pitch_m: f64) -> bool {
    let apart = (a.centre_on_target() - b.centre_on_target()).norm();
    apart > 0.5 * pitch_m && apart <= NEIGHBOURS * pitch_m && (vouches(a, b) || vouches(b, a))
}

/// Whether the second marker is where the first one expects it, seen straight or in perspective.
fn vouches(a: &Placed, b: &Placed) -> bool {
    // Markers that differ much in size are not side by side.
    let ratio = a.marker.side_px() / b.marker.side_px();
    let maps = [homography(&a.pairs()), affinity(&a.pairs())];
    let side = (a.on_target[1] - a.on_target[0]).norm();
    let sides_away = (a.centre_on_target() - b.centre_on_target()).norm() / side;
    (0.33..3.0).contains(&ratio)
        && (b.marker.centre() - a.marker.centre()).norm() > 0.0
        && maps.into_iter().flatten().any(|map| is_at(&map, b, sides_away))
}

/// The best map without perspective: steadier than [`homography`] where few noisy points lead far outside of them.
fn affinity(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut rhs = [Vector3::zeros(); 2];
    for (a, b) in pairs {
        let row = Vector3::new(a.x, a.y, 1.0);
        normal += row * row.transpose();
        for axis in 0..2 {
            rhs[axis] += row * b[axis];
        }
    }
    let inverse = normal.try_inverse()?;
    let (u, v) = (inverse * rhs[0], inverse * rhs[1]);
    Some(Matrix3::new(u.x, u.y, u.z, v.x, v.y, v.z, 0.0, 0.0, 1.0))
}

/// Corners that are a pixel off move points several sides away by as many pixels.
fn is_at(map: &Matrix3<f64>, placed: &Placed, sides_away: f64) -> bool {
    let off = placed.pairs().iter().map(|(on_target, px)| (mapped(map, *on_target) - px).norm_squared()).sum::<f64>();
    (off / 4.0).sqrt() <= MAX_OFF * placed.marker.side_px() + MAX_OFF_PX * sides_away.max(1.0)
}
