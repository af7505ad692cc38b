//! A capture like that of the window, without the board: images with the robot at their instant, until both are at rest.

use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_capture::{Machine, Plan, Progress, Refusal, RobotRate, STILL_RATE_RAD_S, Shot};
use handeye_images::gray_from_rgb;

use super::super::limits;
use super::{Checked, Found, Run, wrong};

/// Longest time for robot and image to come to rest \[s\]: the same as in the window.
const SETTLE_S: f64 = 10.0;
/// Longest run of the check: that of the slowest camera, with the images that show that something does not come to rest.
const LONGEST: Duration = Duration::from_mins(1);
/// So many images in a row without a pose are the driver's doing; one may be that of a busy machine.
const WITHOUT_POSE: u32 = 3;

impl Run {
    pub(super) fn capture(&self) -> Checked {
        let (driver, timebase) = (&self.driver, self.driver.timebase());
        let plan = Plan {
            frames: 1,
            settle_limit_s: SETTLE_S,
            least_distance_m: 0.0,
            least_angle_rad: 0.0,
            others: Vec::new(),
        };
        let mut machine = Machine::new(plan, timebase.now_s());
        let until = Instant::now() + LONGEST;
        let (mut after, mut number, mut without_pose) = (None, 0, 0);
        while Instant::now() < until && !self.cancel.is_cancelled() {
            let Some(image) = driver.image(after, limits::IMAGE_WAIT, &self.cancel)? else {
                return wrong(format!("no image for {} s", limits::IMAGE_WAIT.as_secs()));
            };
            after = Some(image.stamp_s);
            self.of_this_clock(image.stamp_s)?;
            let robot = match driver.robot_at(image.stamp_s, limits::STATE_AFTER_IMAGE)? {
                Ok(robot) => robot,
                Err(why) if without_pose + 1 == WITHOUT_POSE => {
                    return wrong(format!(
                        "an image has no pose of the robot: {why}. States go on while the camera works"
                    ));
                }
                Err(_) => {
                    without_pose += 1;
                    continue;
                }
            };
            without_pose = 0;
            number += 1;
            let joints = robot.joints.unwrap_or_else(|| JointValues::zeros(0));
            let progress = machine.see(&Shot {
                number,
                sim_time_s: image.stamp_s,
                received_s: timebase.now_s(),
                base_from_tip: robot.base_from_tip,
                joints_rad: &joints,
                rgb: &image.rgb,
                grey: &gray_from_rgb(&image.rgb),
                depth: image.depth.as_ref(),
                far_plane_m: f32::INFINITY,
            });
            match progress {
                Progress::Waits(_) => {}
                Progress::Complete => {
                    return Ok(Found::Passed(format!("image and robot at rest after {number} images")));
                }
                Progress::Refused(refusal) => return not_at_rest(&refusal),
            }
        }
        wrong(format!("{number} images in {} s do not make a capture", LONGEST.as_secs()))
    }
}

/// Why images and states make no capture.
fn not_at_rest(refusal: &Refusal) -> Checked {
    match *refusal {
        Refusal::RobotMoves { after_s, rate } => {
            let rate = match rate {
                RobotRate::Joint(rate) => format!("a joint goes by {:.2} mrad or mm a second", rate * 1e3),
                RobotRate::Tip { m_s, rad_s } => {
                    format!("the tip goes by {:.2} mm and {:.2} mrad a second", m_s * 1e3, rad_s * 1e3)
                }
            };
            wrong(format!(
                "by its states the robot moves on for {after_s:.0} s: {rate} from image to image, and a capture waits until that is \
                 under {:.0}. Let the arm stand; where it does, its states have too much noise",
                STILL_RATE_RAD_S * 1e3
            ))
        }
        Refusal::ImageChanges { after_s } => Ok(Found::Warning(format!(
            "the images change for {after_s:.0} s: a capture waits until nothing moves in them and the light is even"
        ))),
        _ => wrong("the stamps of its images stand still"),
    }
}
