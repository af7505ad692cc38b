//! Vision sensors: what they are set to, and the moment that their buffers show.

use std::sync::Arc;

use handeye_geometry::camera::Intrinsics;
use nalgebra::Isometry3;

use crate::world::handle::Handle;

/// Where everything was at one sensing phase, with the robot where it really was.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// `world_from_object` of everything that can see or be seen.
    pub poses: Vec<(Handle, Isometry3<f64>)>,
    /// Objects that were hidden, in ascending order.
    pub hidden: Vec<Handle>,
}

impl Moment {
    /// Where an object was; `None` if it did not exist.
    pub fn pose(&self, handle: Handle) -> Option<&Isometry3<f64>> {
        // Handles are taken in ascending order.
        self.poses.binary_search_by_key(&handle, |(h, _)| *h).ok().map(|index| &self.poses[index].1)
    }

    /// Where an object was, if it was visible.
    pub fn seen(&self, handle: Handle) -> Option<&Isometry3<f64>> {
        self.pose(handle).filter(|_| self.hidden.binary_search(&handle).is_err())
    }
}

/// Where the robot was at one sensing phase by its controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Reported {
    /// Positions of the joints from the base up, radians.
    pub joints_rad: Vec<f64>,
    /// The tip by these positions.
    pub world_from_tip: Isometry3<f64>,
}

/// Contents of a sensor's buffers.
#[derive(Debug, Clone, PartialEq)]
pub struct Shown {
    /// Simulation pass that it was taken in, counted over the life of the world: every pass has its own image noise.
    pub pass: u64,
    /// Simulated time at the end of that pass, seconds.
    pub time_s: f64,
    /// The robot at that time; `None` if there was none.
    pub reported: Option<Reported>,
    /// Where everything was; shared by all passes in which nothing moved.
    pub moment: Arc<Moment>,
}

/// A camera that looks along its +z, +y up in the image, +x to the left.
#[derive(Debug, Clone)]
pub struct VisionSensor {
    /// Size, focal length, principal point and lens, pixels.
    pub intrinsics: Intrinsics,
    /// Nearest distance along the optical axis that is seen, metres.
    pub near_m: f64,
    /// Farthest, metres.
    pub far_m: f64,
    /// The colour image stays background.
    pub ignore_rgb: bool,
    /// The depth image stays at its far end.
    pub ignore_depth: bool,
    /// Refreshed on request only, not by the simulation.
    pub explicit: bool,
    /// Contents of the buffers; `None` before the first pass and after the end of a simulation.
    pub(super) shown: Option<Shown>,
}

impl VisionSensor {
    /// A sensor that sees colour and depth and is refreshed by the simulation.
    pub fn new(intrinsics: Intrinsics, near_m: f64, far_m: f64) -> Self {
        Self { intrinsics, near_m, far_m, ignore_rgb: false, ignore_depth: false, explicit: false, shown: None }
    }

    /// Full opening angle along the longer image side, radians.
    pub fn view_angle_rad(&self) -> f64 {
        let (side, focal) = if self.intrinsics.width >= self.intrinsics.height {
            (self.intrinsics.width, self.intrinsics.fx)
        } else {
            (self.intrinsics.height, self.intrinsics.fy)
        };
        2.0 * (f64::from(side) / 2.0 / focal).atan()
    }

    /// Contents of the buffers.
    pub fn shown(&self) -> Option<&Shown> {
        self.shown.as_ref()
    }
}
