//! CoppeliaSim's conventions to ours, in this one place.
//!
//! | CoppeliaSim | here |
//! | --- | --- |
//! | pose `[x y z qx qy qz qw]` | [`Pose`] |
//! | image rows from the bottom up | row 0 on top |
//! | depth as little-endian `f32`, metres along the optical axis, rows from the bottom up | [`DepthImage`], row 0 on top |
//! | vision sensor axes: x left, y up, z forward | [`Camera`](handeye_geometry::frames::Camera): x right, y down, z forward |

use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use image::RgbImage;

/// How far a rotation may be inexact (norm of a quaternion, entries of RᵀR) before it is refused. Single precision has
/// an error of 1e-6; a quaternion in another order or scale by far more.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Largest image side believed.
const MAX_SIDE: f64 = 16384.0;

/// A value of the simulator that is not valid.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ConvertError {
    /// A number is infinite or not a number.
    #[error("the pose is not finite")]
    NotFinite,
    /// The rotation part is not a rotation.
    #[error("the pose has no rotation: it is off by {off_by:.1e}")]
    NotARotation {
        /// Largest deviation from a unit quaternion, or from an orthonormal right-handed matrix.
        off_by: f64,
    },
    /// Width or height is not a size.
    #[error("{width} × {height} is not an image size")]
    BadResolution {
        /// Width as given.
        width: f64,
        /// Height as given.
        height: f64,
    },
    /// The buffer does not fit the size.
    #[error("a buffer of {got} bytes is not an image of {width} × {height} pixels, which has {expected}")]
    BufferSize {
        /// Bytes in the buffer.
        got: usize,
        /// Bytes it should have.
        expected: usize,
        /// Image width in pixels.
        width: u32,
        /// Image height in pixels.
        height: u32,
    },
}

/// A pose from CoppeliaSim's seven numbers.
///
/// # Errors
/// [`ConvertError`] when they are not finite or the quaternion is not a unit one.
pub(crate) fn pose_from_seven<Dst, Src>(v: &[f64; 7]) -> Result<Pose<Dst, Src>, ConvertError> {
    if v.iter().any(|x| !x.is_finite()) {
        return Err(ConvertError::NotFinite);
    }
    let [x, y, z, qx, qy, qz, qw] = *v;
    let off_by = ((qx * qx + qy * qy + qz * qz + qw * qw).sqrt() - 1.0).abs();
    if off_by > ROTATION_TOLERANCE {
        return Err(ConvertError::NotARotation { off_by });
    }
    Ok(Pose::from_translation_xyzw([x, y, z], [qx, qy, qz, qw]))
}

/// CoppeliaSim's seven numbers for a pose.
pub(crate) fn seven_from_pose<Dst, Src>(pose: &Pose<Dst, Src>) -> [f64; 7] {
    let t = pose.translation();
    let [qx, qy, qz, qw] = pose.xyzw();
    [t.x, t.y, t.z, qx, qy, qz, qw]
}

/// An image size from two numbers.
///
/// # Errors
/// [`ConvertError::BadResolution`] unless both are whole and from 1 to 16384.
pub fn resolution(width: f64, height: f64) -> Result<(u32, u32), ConvertError> {
    let good = |side: f64| side.fract() == 0.0 && (1.0..=MAX_SIDE).contains(&side);
    if good(width) && good(height) {
        Ok((width as u32, height as u32))
    } else {
        Err(ConvertError::BadResolution { width, height })
    }
}

/// A colour image from `width * height` RGB triples with the bottom row first.
///
/// # Errors
/// [`ConvertError::BufferSize`].
pub(crate) fn rgb_from_bytes(bytes: &[u8], width: u32, height: u32) -> Result<RgbImage, ConvertError> {
    let flipped = top_row_first(bytes, width, height, 3)?;
    RgbImage::from_raw(width, height, flipped).ok_or(ConvertError::BufferSize {
        got: bytes.len(),
        expected: width as usize * height as usize * 3,
        width,
        height,
    })
}

/// A depth image from little-endian `f32` with the bottom row first. Where nothing was hit, the depth is that of the
/// far clipping plane.
///
/// # Errors
/// [`ConvertError::BufferSize`].
pub(crate) fn depth_from_bytes(bytes: &[u8], width: u32, height: u32) -> Result<DepthImage, ConvertError> {
    let flipped = top_row_first(bytes, width, height, 4)?;
    let metres = flipped.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok(DepthImage { width, height, metres })
}

fn top_row_first(bytes: &[u8], width: u32, height: u32, bytes_per_pixel: usize) -> Result<Vec<u8>, ConvertError> {
    let row = width as usize * bytes_per_pixel;
    let expected = row * height as usize;
    if bytes.len() != expected || expected == 0 {
        return Err(ConvertError::BufferSize { got: bytes.len(), expected, width, height });
    }
    let mut flipped = Vec::with_capacity(expected);
    for line in bytes.chunks_exact(row).rev() {
        flipped.extend_from_slice(line);
    }
    Ok(flipped)
}

#[cfg(test)]
#[path = "convert_tests.rs"]
mod tests;
