//! A capture as the window takes one, but for the board: images with the robot at their instant, until both stand still.

use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_capture::{Machine, Plan, Progress, Refusal, RobotRate, STILL_RATE_RAD_S, Shot};
use handeye_images::gray_from_rgb;

use super::super::limits;
use super::super::message::Ability;
use super::{Check, Run, gone, passed, skipped, warning, wrong};

/// How long robot and image may take to come to rest \[s\]: as long as in the window.
const SETTLE_S: f64 = 10.0;
/// Longest run of the check: that of the slowest camera, with the images that show that something does not come to rest.
const LONGEST: Duration = Duration::from_mins(1);
/// So many images in a row without a pose are the driver's doing; one may be that of a busy machine.
const WITHOUT_POSE: u32 = 3;

impl Run<'_> {
    pub(super) fn capture(&self) -> Result<Check, Check> {
        const NAME: &str = "capture";
        if !self.can(Ability::Image) {
            return Ok(skipped(NAME, "it has no images"));
        }
        if !self.can(Ability::State) {
            return Ok(skipped(NAME, "it sends no states: another driver has the robot, or a person types its poses"));
        }
        let (driver, timebase) = (self.driver, self.driver.timebase());
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
            let image = gone(NAME, driver.image(after, limits::IMAGE_WAIT, self.cancel))?;
            let Some(image) = image else {
                return Err(wrong(NAME, format!("no image for {} s", limits::IMAGE_WAIT.as_secs())));
            };
            self.of_this_clock(NAME, image.stamp_s)?;
            let robot = gone(NAME, driver.robot_at(image.stamp_s, limits::STATE_AFTER_IMAGE))?;
            let robot = match robot {
                Ok(robot) => robot,
                Err(why) => {
                    without_pose += 1;
                    if without_pose == WITHOUT_POSE {
                        let said =
                            format!("an image has no pose of the robot: {why}. States go on while the camera works");
                        return Err(wrong(NAME, said));
                    }
                    after = Some(image.stamp_s);
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
            after = Some(image.stamp_s);
            match progress {
                Progress::Waits(_) => {}
                Progress::Complete => {
                    return Ok(passed(NAME, format!("image and robot at rest after {number} images")));
                }
                Progress::Refused(refusal) => return not_at_rest(NAME, &refusal),
            }
        }
        Err(wrong(NAME, format!("{number} images in {} s do not make a capture", LONGEST.as_secs())))
    }
}

/// Why images and states make no capture.
fn not_at_rest(name: &'static str, refusal: &Refusal) -> Result<Check, Check> {
    let still_mrad_s = STILL_RATE_RAD_S * 1e3;
    match *refusal {
        Refusal::RobotMoves { after_s, rate } => {
            let rate = match rate {
                RobotRate::Joint(rate) => format!("a joint goes by {:.2} mrad or mm a second", rate * 1e3),
                RobotRate::Tip { m_s, rad_s } => {
                    format!("the tip goes by {:.2} mm and {:.2} mrad a second", m_s * 1e3, rad_s * 1e3)
                }
            };
            Err(wrong(
                name,
                format!(
                    "by its states the robot moves on for {after_s:.0} s: {rate} from image to image, and a capture waits until \
                     that is under {still_mrad_s:.0}. Let the arm stand; where it does, its states have too much noise"
                ),
            ))
        }
        Refusal::ImageChanges { after_s } => Ok(warning(
            name,
            format!(
                "the images change for {after_s:.0} s: a capture waits until nothing moves in them and the light is even"
            ),
        )),
        _ => Err(wrong(name, "the stamps of its images stand still")),
    }
}
