//! A robot and a camera that are drivers: one program that is both, or two.

use std::time::Duration;

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::progress::CancelToken;
use image::RgbImage;

use super::client::Driver;
use super::clock::Timebase;
use super::error::DriverError;
use super::limits::STATE_AFTER_IMAGE;
use super::message::Ability;
use super::options::DriverOptions;
use super::spec::DriverSpec;
use super::states::{NoPose, RobotAt};

/// The drivers of a cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DriverCellSpec {
    /// The robot's, or that of robot and camera, or of a camera alone.
    pub robot: DriverSpec,
    /// The camera's, where it is another program.
    pub camera: Option<DriverSpec>,
}

/// A robot and a camera through drivers. Clones are the same cell; each call is as in [`Driver`].
#[derive(Debug, Clone)]
pub struct DriverCell {
    robot: Driver,
    camera: Option<Driver>,
}

/// An image with the robot at its instant.
#[derive(Debug, Clone, PartialEq)]
pub struct DriverFrame {
    /// Colour, row 0 on top.
    pub rgb: RgbImage,
    /// Depth of the same instant, where the driver has it.
    pub depth: Option<DepthImage>,
    /// The lens, where the driver knows it.
    pub intrinsics: Option<Intrinsics>,
    /// The camera's stamp \[s\]: what the next call gives as `after`.
    pub stamp_s: f64,
    /// When it was on the clock of the workbench \[s\]; `None` before the clocks are related.
    pub time_s: Option<f64>,
    /// Largest time between image and pose \[s\]: the uncertainty of the timestamp and, with two drivers, of the relation
    /// of their clocks.
    pub time_uncertainty_s: f64,
    /// The robot at the image's instant, or why it is not known.
    pub robot: Result<RobotAt, NoPose>,
}

/// How the clocks of a robot and a camera that are two drivers relate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockDifference {
    /// Offset to add to a timestamp of the camera to get one of the robot \[s\].
    pub robot_from_camera_s: f64,
    /// The true one is within ± this \[s\].
    pub uncertainty_s: f64,
}

impl DriverCell {
    /// Starts both. Their stamps are related to the same clock.
    ///
    /// # Errors
    /// As [`Driver::start`]; [`DriverError::Cannot`] when the camera's driver has no images.
    pub fn start(spec: &DriverCellSpec, options: &DriverOptions, cancel: &CancelToken) -> Result<Self, DriverError> {
        let robot = Driver::start(&spec.robot, options, cancel)?;
        let camera = spec.camera.as_ref().map(|camera| Driver::start(camera, options, cancel)).transpose()?;
        if let Some(camera) = &camera
            && !camera.hello().can(Ability::Image)
        {
            return Err(DriverError::Cannot { driver: camera.name().to_owned(), ability: Ability::Image });
        }
        Ok(Self { robot, camera })
    }

    /// The robot's driver: states, motions, stop.
    pub fn robot(&self) -> &Driver {
        &self.robot
    }

    /// The camera's, which may be the same; `None` where neither has images.
    pub fn camera(&self) -> Option<&Driver> {
        self.camera.as_ref().or(Some(&self.robot)).filter(|driver| driver.hello().can(Ability::Image))
    }

    /// Whether robot and camera are two drivers.
    pub fn is_two(&self) -> bool {
        self.camera.is_some()
    }

    /// The clock of the workbench.
    pub fn timebase(&self) -> Timebase {
        self.robot.timebase()
    }

    /// Whether both are still connected.
    ///
    /// # Errors
    /// [`DriverError::Gone`] names the one that is not.
    pub fn check(&self) -> Result<(), DriverError> {
        self.robot.check()?;
        self.camera.as_ref().map_or(Ok(()), Driver::check)
    }

    /// Ends both, even if others still hold them.
    pub(crate) fn close(&self) {
        self.robot.close();
        if let Some(camera) = &self.camera {
            camera.close();
        }
    }

    /// How the clocks of the two relate; `None` for one driver, and before both have answered a ping.
    pub fn clock_difference(&self) -> Option<ClockDifference> {
        let (robot, camera) = (self.robot.clock()?, self.camera.as_ref()?.clock()?);
        Some(ClockDifference {
            robot_from_camera_s: camera.offset_s - robot.offset_s,
            uncertainty_s: camera.uncertainty_s + robot.uncertainty_s,
        })
    }

    /// An image whose stamp is greater than `after`, with the robot at its instant; `None` when none has come in time.
    ///
    /// # Errors
    /// As [`Driver::image`]. That there is no pose is not an error of the image: see [`DriverFrame::robot`].
    pub fn frame(
        &self,
        after: Option<f64>,
        patience: Duration,
        cancel: &CancelToken,
    ) -> Result<Option<DriverFrame>, DriverError> {
        let camera = self.camera.as_ref().unwrap_or(&self.robot);
        let Some(image) = camera.image(after, patience, cancel)? else { return Ok(None) };
        let (robot, apart_s) = self.robot_with(image.stamp_s)?;
        Ok(Some(DriverFrame {
            time_s: camera.clock().map(|clock| image.stamp_s + clock.offset_s),
            time_uncertainty_s: image.stamp_uncertainty_s + apart_s,
            robot,
            rgb: image.rgb,
            depth: image.depth,
            intrinsics: image.intrinsics,
            stamp_s: image.stamp_s,
        }))
    }

    /// The robot at a stamp of the camera, and how well that instant is known on the robot's clock.
    fn robot_with(&self, stamp_s: f64) -> Result<(Result<RobotAt, NoPose>, f64), DriverError> {
        if !self.is_two() {
            return Ok((self.robot.robot_at(stamp_s, STATE_AFTER_IMAGE)?, 0.0));
        }
        if !self.robot.hello().can(Ability::State) {
            return Ok((Err(NoPose::NoRobot), 0.0));
        }
        let Some(clocks) = self.clock_difference() else { return Ok((Err(NoPose::NoClock), 0.0)) };
        let robot = self.robot.robot_at(stamp_s + clocks.robot_from_camera_s, STATE_AFTER_IMAGE)?;
        Ok((robot, clocks.uncertainty_s))
    }
}
