//! Frames as types, so that a chain of transforms that does not fit does not compile.
//!
//! A transform is named `dst_from_src`, has the type [`Pose<Dst, Src>`] and maps coordinates in `src` to
//! coordinates in `dst`. Chains read by adjacent names:
//!
//! ```
//! use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
//! let base_from_tip = Pose::<Base, Tip>::identity();
//! let tip_from_camera = Pose::<Tip, Camera>::identity();
//! let camera_from_target = Pose::<Camera, Target>::identity();
//! let base_from_target: Pose<Base, Target> = base_from_tip * tip_from_camera * camera_from_target;
//! # let _ = base_from_target;
//! ```
//!
//! The wrong order is not a wrong number but a compile error:
//!
//! ```compile_fail
//! use handeye_geometry::frames::{Base, Camera, Pose, Tip};
//! let base_from_tip = Pose::<Base, Tip>::identity();
//! let tip_from_camera = Pose::<Tip, Camera>::identity();
//! let wrong = tip_from_camera * base_from_tip;
//! ```
//!
//! and neither is a transform accepted where another is expected:
//!
//! ```compile_fail
//! use handeye_geometry::frames::{Base, Pose, Tip};
//! let base_from_tip = Pose::<Base, Tip>::identity();
//! let tip_from_base: Pose<Tip, Base> = base_from_tip;
//! ```
//!
//! The list of frames and their axes is `docs/reference/conventions.md`.

use std::fmt;
use std::marker::PhantomData;
use std::ops::Mul;

use nalgebra::{Isometry3, Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A coordinate frame, used only as a type.
pub trait Frame: 'static {
    /// Name in messages and files.
    const NAME: &'static str;
}

macro_rules! frames {
    ($($(#[$doc:meta])* $name:ident = $text:literal),+ $(,)?) => {$(
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {}
        impl Frame for $name {
            const NAME: &'static str = $text;
        }
    )+};
}

frames! {
    /// The frame in which the robot controller reports tip poses; the world of a simulated cell.
    Base = "base",
    /// The robot's tool frame: what the controller reports.
    Tip = "tip",
    /// The camera in OpenCV axes: x right, y down, z forward.
    Camera = "camera",
    /// The calibration target: origin at its first point, x along columns, y along rows, z into the board.
    Target = "target",
    /// A CoppeliaSim vision sensor: z forward, y up, x left.
    Sensor = "sensor",
    /// What carries the camera: the tip in eye-in-hand, the base in eye-to-hand.
    Mount = "mount",
    /// What carries the target: the base in eye-in-hand, the tip in eye-to-hand.
    Anchor = "anchor",
}

/// The rigid transform `dst_from_src`: maps coordinates in `Src` to coordinates in `Dst`, in metres.
///
/// It is also the pose of `Src` seen in `Dst`. Tangent vectors are `[tx ty tz rx ry rz]` and perturb on the right,
/// `T * exp(delta)`, see [`crate::se3`].
#[derive(Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Pose<Dst, Src> {
    isometry: Isometry3<f64>,
    #[serde(skip)]
    frames: PhantomData<fn(Src) -> Dst>,
}

impl<Dst, Src> Clone for Pose<Dst, Src> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<Dst, Src> Copy for Pose<Dst, Src> {}

impl<Dst, Src> PartialEq for Pose<Dst, Src> {
    fn eq(&self, other: &Self) -> bool {
        self.isometry == other.isometry
    }
}

impl<Dst: Frame, Src: Frame> fmt::Debug for Pose<Dst, Src> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let t = self.isometry.translation.vector;
        let q = self.isometry.rotation.coords;
        write!(
            f,
            "{}_from_{} {{ t: [{}, {}, {}] m, q_xyzw: [{}, {}, {}, {}] }}",
            Dst::NAME,
            Src::NAME,
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w
        )
    }
}

impl<Dst, Src> From<Isometry3<f64>> for Pose<Dst, Src> {
    fn from(isometry: Isometry3<f64>) -> Self {
        Self::from_isometry(isometry)
    }
}

impl<Dst, Src> Pose<Dst, Src> {
    /// The two frames coincide.
    pub fn identity() -> Self {
        Self::from_isometry(Isometry3::identity())
    }

    /// States that `isometry` is `dst_from_src`. The one place where a bare transform gets its frames.
    pub fn from_isometry(isometry: Isometry3<f64>) -> Self {
        Self { isometry, frames: PhantomData }
    }

    /// The transform with a translation in metres and a quaternion in the order x, y, z, w, which is normalised.
    pub fn from_translation_xyzw(translation_m: [f64; 3], xyzw: [f64; 4]) -> Self {
        let [x, y, z, w] = xyzw;
        Self::from_isometry(Isometry3::from_parts(
            Translation3::from(translation_m),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        ))
    }

    /// The transform without its frames, for inner loops.
    pub fn isometry(&self) -> &Isometry3<f64> {
        &self.isometry
    }

    /// Translation part in metres: the origin of `Src` in `Dst`.
    pub fn translation(&self) -> Vector3<f64> {
        self.isometry.translation.vector
    }

    /// Rotation part.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        self.isometry.rotation
    }

    /// Unit quaternion in the order x, y, z, w with w ≥ 0, as required in files.
    pub fn xyzw(&self) -> [f64; 4] {
        let q = self.isometry.rotation.coords;
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        [sign * q.x, sign * q.y, sign * q.z, sign * q.w]
    }

    /// The 4×4 homogeneous matrix.
    pub fn matrix(&self) -> Matrix4<f64> {
        self.isometry.to_homogeneous()
    }

    /// `src_from_dst`.
    #[must_use]
    pub fn inverse(&self) -> Pose<Src, Dst> {
        Pose::from_isometry(self.isometry.inverse())
    }

    /// `T * exp(delta)` with `delta = [tx ty tz rx ry rz]` in metres and radians, in the `Src` frame.
    #[must_use]
    pub fn perturbed(&self, delta: &nalgebra::Vector6<f64>) -> Self {
        Self::from_isometry(self.isometry * crate::se3::exp(delta))
    }

    /// The same numbers between other frames. State why at the call: this bypasses the type check.
    #[must_use]
    pub fn relabel<NewDst, NewSrc>(&self) -> Pose<NewDst, NewSrc> {
        Pose::from_isometry(self.isometry)
    }

    /// Distance between the origins in metres and angle in radians between `self` and `other`.
    pub fn distance_to(&self, other: &Self) -> (f64, f64) {
        ((self.translation() - other.translation()).norm(), self.isometry.rotation.angle_to(&other.isometry.rotation))
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.isometry.translation.vector.iter().all(|v| v.is_finite())
            && self.isometry.rotation.coords.iter().all(|v| v.is_finite())
    }
}

impl<A, B, C> Mul<Pose<B, C>> for Pose<A, B> {
    type Output = Pose<A, C>;

    fn mul(self, rhs: Pose<B, C>) -> Pose<A, C> {
        Pose::from_isometry(self.isometry * rhs.isometry)
    }
}

impl<Dst, Src> Mul<PointIn<Src>> for Pose<Dst, Src> {
    type Output = PointIn<Dst>;

    fn mul(self, rhs: PointIn<Src>) -> PointIn<Dst> {
        PointIn::new(self.isometry * rhs.point)
    }
}

/// A point with its frame, in metres.
pub struct PointIn<F> {
    point: Point3<f64>,
    frame: PhantomData<fn() -> F>,
}

impl<F> Clone for PointIn<F> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<F> Copy for PointIn<F> {}

impl<F: Frame> fmt::Debug for PointIn<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}, {}, {}] m in {}", self.point.x, self.point.y, self.point.z, F::NAME)
    }
}

impl<F> PointIn<F> {
    /// States that `point` is in `F`, in metres.
    pub fn new(point: Point3<f64>) -> Self {
        Self { point, frame: PhantomData }
    }

    /// The bare coordinates in metres.
    pub fn point(&self) -> Point3<f64> {
        self.point
    }
}
