//! The two poses of a plane that are consistent with its map to the image.

use nalgebra::{
    Isometry3, Matrix2, Matrix2x3, Matrix3, Rotation3, SymmetricEigen, Translation3, UnitQuaternion, Vector2, Vector3,
};

use super::homography::{homography, jacobian, mapped};
use crate::camera::CameraError;
use crate::targets::observation::Corner;
use crate::view_equations::ViewInput;

/// Smallest cosine to the optical axis of the rays that start a pose: on the plane z = 1 they would be too far out.
const MIN_RAY_Z: f64 = 0.05;

/// A point of the target's plane z = 0, metres, and where its ray meets the plane z = 1 of the camera.
pub type Pair = (Vector2<f64>, Vector2<f64>);

/// The pair of a corner, the target taken as flat; `None` beyond 87° from the optical axis.
///
/// # Errors
/// [`CameraError::OutsideModel`] for a corner without ray.
pub fn pair(seen: &ViewInput<'_>, corner: &Corner) -> Result<Option<Pair>, CameraError> {
    let ray = seen.intrinsics.unproject(&corner.px)?;
    let point = seen.board.drawn()[corner.index].coords.xy();
    Ok((ray.z > MIN_RAY_Z).then(|| (point, ray.xy() / ray.z)))
}

/// Both poses of a plane that the rays allow to first order in the size of the target: starts for
/// [`super::refine::refine`]. The first fits better by the reprojection error on the plane z = 1. `None` where fewer than
/// four pairs are given, or where they do not determine a map.
pub fn starts(pairs: &[Pair]) -> Option<[Isometry3<f64>; 2]> {
    both(pairs).map(|[a, b]| if misfit(pairs, &b) < misfit(pairs, &a) { [b, a] } else { [a, b] })
}

/// Sum of squared distances on the plane z = 1; infinite where a point is behind the camera.
fn misfit(pairs: &[Pair], pose: &Isometry3<f64>) -> f64 {
    let rotation = pose.rotation.to_rotation_matrix();
    let squared = |(p, ray): &Pair| {
        let q = rotation * Vector3::new(p.x, p.y, 0.0) + pose.translation.vector;
        if q.z > 0.0 { (q.xy() / q.z - ray).norm_squared() } else { f64::INFINITY }
    };
    pairs.iter().map(squared).sum()
}

/// The poses `camera_from_plane` whose image of the plane has value and slope of the homography of the pairs (a point of
/// the plane z = 0, its image on the plane z = 1) in the middle of the points.
///
/// # Derivation
/// Let the point `m` of the plane be imaged at `v` with the slope `J` (2×2), and let it be at the depth `d`, that is, at
/// `d [v, 1]`. A motion of the point by `δ` moves it by `R₁₂ δ` in the camera, `R₁₂` being the first two columns of the
/// rotation, and its image by `(1/d) [I | −v] R₁₂ δ`. So `[I | −v] R₁₂ = d J`: three equations too few for the rotation,
/// since `[I | −v]` takes the line of sight to zero. In axes that are turned by `Q` such that z is the line of sight,
/// `[I | −v] Q = [B | 0]`, and the upper two rows of `Qᵀ R₁₂` are `d A` with `A = B⁻¹ J`. What remains to be found is the
/// third row `c`, how fast the plane recedes, and `d`. The columns of a rotation are perpendicular and of length 1:
///
/// `d² AᵀA + cᵀc = I`.
///
/// `cᵀc` has rank one and no negative eigenvalue, so the larger eigenvalue `λ₁` of `AᵀA` gives the depth,
/// `d² λ₁ = 1`, and `c` points along the eigenvector of the smaller one with the length `√(1 − λ₂/λ₁)`. Its sign is free:
/// the plane may recede one way or the other, which differ only in second order. These are the two poses; where `λ₁ = λ₂`
/// the plane is perpendicular to the line of sight and they are one.
///
/// # Reference
/// Collins & Bartoli 2014, "Infinitesimal plane-based pose estimation", IJCV 109.
fn both(pairs: &[Pair]) -> Option<[Isometry3<f64>; 2]> {
    let middle = pairs.iter().map(|(p, _)| p).sum::<Vector2<f64>>() / pairs.len() as f64;
    let map = homography(pairs)?;
    let (v, slope) = (mapped(&map, middle), jacobian(&map, middle));
    let to_image = Matrix2x3::new(1.0, 0.0, -v.x, 0.0, 1.0, -v.y);
    let from_sight = Rotation3::rotation_between(&Vector3::z(), &Vector3::new(v.x, v.y, 1.0))?;
    let across: Matrix2<f64> = (to_image * from_sight.matrix()).fixed_columns::<2>(0).into_owned();
    let a = across.try_inverse()? * slope;
    let eigen = SymmetricEigen::new(a.transpose() * a);
    let (large, small) = (eigen.eigenvalues.imax(), eigen.eigenvalues.imin());
    let depth = eigen.eigenvalues[large].sqrt().recip();
    let receding = (1.0 - eigen.eigenvalues[small] / eigen.eigenvalues[large]).max(0.0).sqrt();
    let c = eigen.eigenvectors.column(small) * receding;
    let pose = |sign: f64| {
        let column = |i: usize| from_sight * Vector3::new(depth * a[(0, i)], depth * a[(1, i)], sign * c[i]);
        let (x, y) = (column(0), column(1));
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        let place = Vector3::new(v.x, v.y, 1.0) * depth - rotation * Vector3::new(middle.x, middle.y, 0.0);
        Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_rotation_matrix(&rotation))
    };
    let poses = [pose(1.0), pose(-1.0)];
    let finite =
        |p: &Isometry3<f64>| p.translation.vector.iter().chain(p.rotation.coords.iter()).all(|x| x.is_finite());
    poses.iter().all(finite).then_some(poses)
}
