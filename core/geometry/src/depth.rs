//! Depth images: samples, deprojection, colours.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use crate::camera::{CameraError, Intrinsics};
use crate::frames::{Camera, PointIn};
use crate::statistics::{SIGMA_PER_MEDIAN_SIZE, median_high};

/// A depth closer to the far plane than this part of it is the far plane: a renderer's 24-bit depth buffer, near at a
/// hundredth of far or less, resolves a few parts in a hundred thousand there.
const FAR_TOLERANCE: f32 = 1e-4;
/// Measurements around a place that make a median where not all four around it are there.
const MIN_AROUND: usize = 3;
/// Depths around a place that differ by more than this part belong to two surfaces: a board seen at 80° from its
/// normal, with a pixel of 1/500, has 1 %.
const ONE_SURFACE: f64 = 0.02;
/// Depths off by more than this many standard deviations (from the median) do not belong to the surface.
const OUTLIER: f64 = 4.0;
/// Depths are never outliers below this [m]: a depth camera's steps.
const OUTLIER_FLOOR_M: f64 = 1e-3;

/// Why depths are not usable.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum DepthError {
    /// The number of samples is not width × height.
    #[error("a depth image of {width}×{height} needs {need} samples, there are {got}")]
    WrongLength {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Samples given.
        got: usize,
        /// Samples needed.
        need: usize,
    },
    /// The range to colour, or the scale of the encoding, is empty or NaN.
    #[error("{what} from {low} to {high} is not usable: both must be finite and the second larger")]
    BadRange {
        /// What the range belongs to.
        what: &'static str,
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Image and camera are of different sizes.
    #[error("the depth image is {width}×{height} and the camera {camera_width}×{camera_height}")]
    OtherCamera {
        /// Width of the image.
        width: u32,
        /// Height of the image.
        height: u32,
        /// Width of the camera's image.
        camera_width: u32,
        /// Height of the camera's image.
        camera_height: u32,
    },
    /// The pixel has no ray.
    #[error("{0}")]
    Camera(#[from] CameraError),
}

/// Depths along the optical axis in metres, row 0 on top.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Row by row from the top left; NaN and numbers that are not positive mean no measurement.
    pub metres: Vec<f32>,
}

/// Meaning of a depth pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthSample {
    /// A surface at this distance along the optical axis, metres.
    Metres(f32),
    /// Nothing up to the end of the sensor's range.
    Far,
    /// No measurement: NaN, negative infinity, zero or negative, or outside the image.
    Invalid,
}

impl DepthSample {
    /// Meaning of a depth \[m\]; `far_m` is the sensor's far plane, infinity when it has none.
    pub fn of(depth_m: f32, far_m: f32) -> Self {
        if depth_m.is_nan() || depth_m <= 0.0 {
            Self::Invalid
        } else if depth_m >= far_m * (1.0 - FAR_TOLERANCE) {
            Self::Far
        } else {
            Self::Metres(depth_m)
        }
    }
}

impl DepthImage {
    /// Checks the number of samples.
    ///
    /// # Errors
    /// [`DepthError::WrongLength`].
    pub fn new(width: u32, height: u32, metres: Vec<f32>) -> Result<Self, DepthError> {
        let need = width as usize * height as usize;
        if metres.len() == need {
            Ok(Self { width, height, metres })
        } else {
            Err(DepthError::WrongLength { width, height, got: metres.len(), need })
        }
    }

    /// The sample at a pixel; `far_m` is the sensor's far plane, infinity when it has none.
    pub fn sample(&self, column: u32, row: u32, far_m: f32) -> DepthSample {
        if column >= self.width || row >= self.height {
            return DepthSample::Invalid;
        }
        let index = row as usize * self.width as usize + column as usize;
        self.metres.get(index).map_or(DepthSample::Invalid, |&depth| DepthSample::of(depth, far_m))
    }

    /// The depth of a surface between pixels, metres: by the inverse depths of the four pixels around, which are linear
    /// over a plane, where they belong to one surface; next to a pixel without measurement, or at an edge, the median
    /// of those around. `far_m` is the sensor's far plane, infinity when it has none.
    pub fn at(&self, px: Vector2<f64>, far_m: f32) -> Option<f64> {
        let measured = |column: f64, row: f64| {
            if column < 0.0 || row < 0.0 {
                return None;
            }
            match self.sample(column as u32, row as u32, far_m) {
                // An infinite depth is excluded where the sensor states no far plane.
                DepthSample::Metres(m) if m.is_finite() => Some(f64::from(m)),
                _ => None,
            }
        };
        let (u, v) = (px.x.floor(), px.y.floor());
        let four = [measured(u, v), measured(u + 1.0, v), measured(u, v + 1.0), measured(u + 1.0, v + 1.0)];
        if let [Some(a), Some(b), Some(c), Some(d)] = four {
            let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
            if high - low <= ONE_SURFACE * low {
                let (s, t) = (px.x - u, px.y - v);
                let inverse = (1.0 - t) * ((1.0 - s) / a + s / b) + t * ((1.0 - s) / c + s / d);
                return Some(1.0 / inverse);
            }
        }
        let (u, v) = (px.x.round(), px.y.round());
        let mut around = Vec::with_capacity(9);
        for (du, dv) in [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)] {
            around.extend(measured(u + f64::from(du), v + f64::from(dv)));
        }
        if around.len() < MIN_AROUND { None } else { median_high(around) }
    }

    /// The point that a pixel sees: where its ray has the pixel's depth along the optical axis. `None` for a pixel
    /// without surface ([`DepthSample::Far`], [`DepthSample::Invalid`]), and for a ray that does not point forward.
    ///
    /// # Errors
    /// [`DepthError::OtherCamera`] when the sizes differ, [`DepthError::Camera`] for a pixel outside the lens model.
    pub fn point(
        &self,
        column: u32,
        row: u32,
        far_m: f32,
        camera: &Intrinsics,
    ) -> Result<Option<PointIn<Camera>>, DepthError> {
        if (self.width, self.height) != (camera.width, camera.height) {
            return Err(DepthError::OtherCamera {
                width: self.width,
                height: self.height,
                camera_width: camera.width,
                camera_height: camera.height,
            });
        }
        let DepthSample::Metres(depth) = self.sample(column, row, far_m) else { return Ok(None) };
        let ray = camera.unproject(&Vector2::new(f64::from(column), f64::from(row)))?;
        let scale = f64::from(depth) / ray.z;
        Ok((ray.z > 0.0).then(|| PointIn::new((ray.into_inner() * scale).into())))
    }

    /// The depths as an image, red, green and blue of each pixel row by row: `near_m` is the map's first colour and `far_m` its
    /// last; depths outside are clipped. Pixels without measurement are [`INVALID_COLOUR`] and those at the sensor's far plane
    /// `far_plane_m` are [`FAR_COLOUR`], neither of which is in any map.
    ///
    /// # Errors
    /// [`DepthError::BadRange`], [`DepthError::WrongLength`] when the fields were set to disagree.
    pub fn colours(&self, map: ColourMap, near_m: f32, far_m: f32, far_plane_m: f32) -> Result<Vec<u8>, DepthError> {
        if !(near_m.is_finite() && far_m.is_finite() && near_m < far_m) {
            return Err(DepthError::BadRange { what: "the colour range", low: near_m.into(), high: far_m.into() });
        }
        let table: Vec<[u8; 3]> = (0..=255).map(|i| map.colour(f64::from(i) / 255.0)).collect();
        self.image(|depth| match DepthSample::of(depth, far_plane_m) {
            DepthSample::Metres(m) => {
                // In 0 ..= 255 because of the clamp.
                table[(((m - near_m) / (far_m - near_m)).clamp(0.0, 1.0) * 255.0).round() as usize]
            }
            DepthSample::Far => FAR_COLOUR,
            DepthSample::Invalid => INVALID_COLOUR,
        })
    }

    fn image(&self, colour: impl Fn(f32) -> [u8; 3]) -> Result<Vec<u8>, DepthError> {
        let (width, height) = (self.width, self.height);
        let need = width as usize * height as usize;
        if self.metres.len() != need {
            return Err(DepthError::WrongLength { width, height, got: self.metres.len(), need });
        }
        Ok(self.metres.iter().flat_map(|&depth| colour(depth)).collect())
    }
}

/// Colour of pixels without measurement: magenta, which no map contains.
pub(crate) const INVALID_COLOUR: [u8; 3] = [255, 0, 255];
/// Colour of pixels at the far plane: a dark blue-grey outside all maps.
pub(crate) const FAR_COLOUR: [u8; 3] = [24, 28, 40];

/// Largest distance of depths from the surface of the others before they count as outliers, by the sizes of all
/// distances, metres.
pub fn outlier_reach_m(off_m: &[f64]) -> f64 {
    (OUTLIER * SIGMA_PER_MEDIAN_SIZE * median_high(off_m.iter().copied()).unwrap_or(0.0)).max(OUTLIER_FLOOR_M)
}

/// A map from a number between 0 and 1 to a colour.
///
/// The rainbows are linear between 17 anchors of their published tables of 256 colours and stay within 7 of 255 grey
/// levels of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColourMap {
    /// Rainbow of even steps: dark blue, green, dark red. Mikhailov 2019, "Turbo, an improved rainbow colormap".
    #[default]
    Turbo,
    /// Even luminance: dark violet, teal, yellow. Smith & van der Walt 2015, matplotlib's default map.
    Viridis,
    /// Black to white.
    Grey,
}

impl ColourMap {
    /// The colour of `t`, which is clipped to 0 … 1; NaN counts as 0.
    pub fn colour(self, t: f64) -> [u8; 3] {
        let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        match self {
            Self::Turbo => between(&TURBO, t),
            Self::Viridis => between(&VIRIDIS, t),
            Self::Grey => [(t * 255.0).round() as u8; 3],
        }
    }
}

/// The colour at `t` in 0 … 1 of a table of colours at equal steps.
fn between(table: &[[u8; 3]; 17], t: f64) -> [u8; 3] {
    let at = t * (table.len() - 1) as f64;
    let low = (at as usize).min(table.len() - 2);
    let part = at - low as f64;
    std::array::from_fn(|c| {
        let (a, b) = (f64::from(table[low][c]), f64::from(table[low + 1][c]));
        (a + part * (b - a)).round() as u8
    })
}

const TURBO: [[u8; 3]; 17] = [
    [48, 18, 59],
    [64, 64, 161],
    [70, 107, 227],
    [66, 147, 255],
    [41, 187, 236],
    [24, 220, 195],
    [49, 242, 153],
    [107, 253, 100],
    [163, 253, 60],
    [204, 237, 52],
    [237, 208, 58],
    [253, 174, 53],
    [251, 128, 34],
    [236, 82, 15],
    [210, 49, 5],
    [172, 23, 1],
    [122, 4, 3],
];

const VIRIDIS: [[u8; 3]; 17] = [
    [68, 1, 84],
    [72, 24, 106],
    [71, 45, 123],
    [66, 64, 134],
    [59, 82, 139],
    [51, 99, 141],
    [44, 114, 142],
    [38, 129, 142],
    [33, 144, 140],
    [31, 159, 136],
    [40, 174, 128],
    [62, 188, 116],
    [93, 201, 99],
    [130, 211, 76],
    [171, 220, 50],
    [213, 226, 26],
    [253, 231, 37],
];

#[cfg(test)]
#[path = "depth_tests.rs"]
mod tests;
