//! Images of a chessboard among convex bodies: RGB and registered depth, computed on one CPU core without a graphics card. The built-in
//! cell sees with it, and so do tests.
//!
//! The lens is exact for every model of [`handeye_geometry::camera`], and so is the anti-aliasing of the board: a pixel
//! holds the integral of the printed pattern over its own area, so that a corner detector meets the truth and not
//! the artefacts of a sampler. [`Sampling::Centre`] has those artefacts: it is what CoppeliaSim's vision sensors do.
//! Every image is a function of its arguments alone, seed included.
//!
//! Pixel (0, 0) is the centre of the top left pixel and row 0 is the top row. Colours are linear reflectances from
//! 0 to 1; there is no gamma. Lengths are metres.
//!
//! ```
//! use handeye_geometry::camera::Intrinsics;
//! use handeye_render::{BoardSurface, Imaging, Light, RenderScene, Renderer};
//! use nalgebra::Isometry3;
//!
//! let board = BoardSurface::new(Isometry3::translation(-0.0675, -0.045, 0.4), 10, 7, 0.015, [0.2, 0.15]);
//! let world_from_camera = Isometry3::identity();
//! let scene = RenderScene { world_from_camera, board, solids: Vec::new(), light: Light::default(), background: [0.8; 3] };
//! let frame = Renderer::new(Intrinsics::pinhole(640, 480, 581.0), 0.01, 3.5).render(&scene, &Imaging::default(), 1);
//! assert!((frame.depth_m[240 * 640 + 320] - 0.4).abs() < 1e-6, "the board is 40 cm away");
//! ```
//!
//! Never depends on arms, protocols, files or clocks.

#![warn(missing_docs)]

mod board;
mod ground;
mod imaging;
mod print;
mod rays;
mod renderer;
mod shade;
mod shadow;
mod shapes;
mod stage;
mod texture;

use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use serde::{Deserialize, Serialize};

pub use print::PrintErrors;
pub use renderer::Renderer;

/// All that a camera can see, and from where.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderScene {
    /// Pose of the camera in OpenCV axes: x right, y down, z forward.
    pub world_from_camera: Isometry3<f64>,
    /// The calibration board.
    pub board: BoardSurface,
    /// Everything else: floor, table, arm, gripper.
    pub solids: Vec<Solid>,
    /// The lamp.
    pub light: Light,
    /// Colour where nothing is hit between the near and the far plane.
    pub background: [f32; 3],
}

/// A chessboard printed on a sheet of paper without thickness, `(columns + 1) × (rows + 1)` squares.
///
/// The target frame has its origin in the first inner corner, x along the columns, y along the rows and z into the
/// board, so the print faces −z. The square between the corners (0, 0), (1, 0), (0, 1) and (1, 1) is dark.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardSurface {
    /// Pose of the target frame.
    pub world_from_target: Isometry3<f64>,
    /// Inner corners along x.
    pub columns: usize,
    /// Inner corners along y.
    pub rows: usize,
    /// Side of a square.
    pub square_m: f64,
    /// Width and height of the sheet, with the pattern in its middle. What of the pattern is beyond is cut off.
    pub paper_m: [f64; 2],
    /// Reflectance of the dark squares.
    pub dark: f32,
    /// Reflectance of the paper.
    pub white: f32,
    /// Colour of the back of the sheet.
    pub back: [f32; 3],
    /// Displacements of the print's corners from the grid; `None` for an exact print.
    pub print: Option<Arc<PrintErrors>>,
}

impl BoardSurface {
    /// Print and paper in usual greys.
    pub fn new(
        world_from_target: Isometry3<f64>,
        columns: usize,
        rows: usize,
        square_m: f64,
        paper_m: [f64; 2],
    ) -> Self {
        let (dark, white, back) = (0.06, 0.9, [0.72, 0.72, 0.7]);
        Self { world_from_target, columns, rows, square_m, paper_m, dark, white, back, print: None }
    }
}

/// A convex body with a colour.
///
/// A body that contains the camera is not drawn, so that a camera may sit inside its own housing.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Form and size.
    pub shape: Shape,
    /// Pose of the frame in which the shape is given.
    pub world_from_shape: Isometry3<f64>,
    /// Reflectance in red, green, blue.
    pub colour: [f32; 3],
    /// What varies the colour over the surface.
    pub finish: Finish,
}

impl Solid {
    /// A matt body of one colour.
    pub fn new(shape: Shape, world_from_shape: Isometry3<f64>, colour: [f32; 3]) -> Self {
        Self { shape, world_from_shape, colour, finish: Finish::Matt }
    }

    /// The same body with another finish.
    #[must_use]
    pub fn with_finish(self, finish: Finish) -> Self {
        Self { finish, ..self }
    }
}

/// Forms of a [`Solid`] in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A ball around the origin.
    Sphere {
        /// Its radius, metres.
        radius: f64,
    },
    /// All points within `radius` of the segment from `a` to `b`.
    Capsule {
        /// One end of the segment.
        a: Point3<f64>,
        /// The other end.
        b: Point3<f64>,
        /// Distance of the surface from the segment.
        radius: f64,
    },
    /// A box around the origin, edges along the axes.
    Box {
        /// Half of each edge.
        half_extents: Vector3<f64>,
    },
    /// A cylinder around the z axis with flat ends at z = ±`half_height`.
    Cylinder {
        /// Distance of the mantle from the axis.
        radius: f64,
        /// Half of its length.
        half_height: f64,
    },
    /// The endless plane z = 0, seen from +z only. It fades into the background before the far plane.
    Plane,
}

/// Surface of a [`Solid`]. Shadows fall on [`Self::Tiles`] and [`Self::Wood`] only.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Finish {
    /// One colour, no gloss.
    #[default]
    Matt,
    /// One colour with a soft highlight.
    Satin,
    /// Fine grooves across the local z axis with a soft highlight, as on turned aluminium.
    Brushed,
    /// Square tiles in the local x-y plane with thin darker joints.
    Tiles {
        /// Distance of the joints.
        pitch_m: f64,
        /// Width of a joint.
        joint_m: f64,
    },
    /// Grain along the local x axis.
    Wood,
}

/// One lamp and the light that comes from everywhere.
///
/// A surface that faces the lamp shines with `ambient + diffuse` times its colour; keep the sum at or below 1 and
/// no image saturates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Where the lamp is.
    pub source: LightSource,
    /// Part that reaches surfaces turned away from the lamp.
    pub ambient: f32,
    /// Part that falls with the cosine of the angle to the lamp.
    pub diffuse: f32,
}

/// Where a [`Light`] shines from, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightSource {
    /// So far away that only its direction counts; points from the scene to the lamp.
    Directional(Unit<Vector3<f64>>),
    /// A lamp at a place; its strength does not fall with distance.
    Point(Point3<f64>),
}

impl Default for Light {
    /// A ceiling lamp in front of the arm, mild enough for white paper.
    fn default() -> Self {
        let towards_lamp = Unit::new_normalize(Vector3::new(0.35, 0.9, 1.0));
        Self { source: LightSource::Directional(towards_lamp), ambient: 0.52, diffuse: 0.46 }
    }
}

/// Sampling of the scene by a pixel of the colour image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// The mean over its area, as a pixel of a camera.
    #[default]
    Area,
    /// The scene at its centre, as in a frame buffer with one sample a pixel: edges are hard steps. CoppeliaSim's
    /// vision sensors have it on every graphics card.
    Centre,
}

/// Effects of the sensor on the ideal image. A value that is not above zero, or not a number, switches its effect off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Imaging {
    /// Sampling of a pixel of the colour image.
    pub sampling: Sampling,
    /// Standard deviation of a Gaussian blur in pixels, on top of the box of a pixel.
    pub blur_px: f64,
    /// Standard deviation of the noise in grey levels, per channel and independent.
    pub noise_grey: f64,
    /// Grey levels per unit of reflected light, in units of 255.
    pub exposure: f64,
    /// Standard deviation of the depth noise at distance zero.
    pub depth_noise_m: f64,
    /// Growth of that deviation with the squared distance, 1/m.
    pub depth_noise_per_m2: f64,
    /// Depth that is added, in parts of what depth changes by from a pixel to the next along the row or the column,
    /// whichever is more: the polygon offset of OpenGL, half a pixel's in CoppeliaSim.
    pub depth_offset_px: f64,
    /// Reported depth where nothing is hit; the far plane if absent.
    pub depth_of_nothing_m: Option<f64>,
}

impl Default for Imaging {
    /// The ideal sensor.
    fn default() -> Self {
        Self {
            sampling: Sampling::Area,
            blur_px: 0.0,
            noise_grey: 0.0,
            exposure: 1.0,
            depth_noise_m: 0.0,
            depth_noise_per_m2: 0.0,
            depth_offset_px: 0.0,
            depth_of_nothing_m: None,
        }
    }
}

/// An image and the depth of each of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedFrame {
    /// The image, row 0 on top.
    pub rgb: RgbImage,
    /// Distance along the optical axis of what the centre of each pixel sees, row by row from the top; where there is
    /// nothing between near and far plane exactly the far plane, or what [`Imaging`] has for it.
    pub depth_m: Vec<f32>,
}

#[cfg(test)]
mod scene_tests;
#[cfg(test)]
mod truth_tests;
