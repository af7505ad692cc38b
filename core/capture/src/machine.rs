//! From the request for a capture to the average of its images.

use image::RgbImage;
use serde::{Deserialize, Serialize};

use super::watch::Reference;
use super::{Average, Rest, RobotRate, Scatter, Shot, Similar, Watch, nearest_similar};
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::Corner;

/// Longest time \[s\], on the caller's clock, without images or progress of simulated time: a slow camera, or one late image
/// of a computer under load, is waited for.
pub const NO_IMAGES_S: f64 = 5.0;

/// Images that must have come before robot or image are reported not to come to rest: twice as many as show that they
/// are. A simulation that runs as fast as it can may pass the limit of time between two.
const FAIR_IMAGES: u32 = 8;

/// A request for a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Images to average; 0 counts as 1.
    pub frames: u32,
    /// Longest wait for robot and image to come to rest \[s\], simulated.
    pub settle_limit_s: f64,
    /// See [`nearest_similar`] \[m\].
    pub least_distance_m: f64,
    /// See [`nearest_similar`] \[rad\].
    pub least_angle_rad: f64,
    /// The captures that there are: number and pose.
    pub others: Vec<(u32, Pose<Base, Tip>)>,
}

/// What a capture waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wait {
    /// Images from after the request.
    ForImage,
    /// The robot to come to rest.
    RobotMoves,
    /// The image to come to rest.
    ImageChanges,
    /// More images to average.
    Averaging {
        /// So many are there.
        done: u32,
        /// Number requested.
        of: u32,
    },
}

/// Why there are no images to measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refusal {
    /// The robot did not come to rest.
    RobotMoves {
        /// Simulated time waited \[s\].
        after_s: f64,
        /// Speed of the robot.
        rate: RobotRate,
    },
    /// The robot is at rest and the image is not.
    ImageChanges {
        /// Simulated time waited \[s\].
        after_s: f64,
    },
    /// Simulated time does not advance.
    Paused,
    /// No images come.
    NoImages,
    /// There is a capture from almost the same pose.
    TooSimilar(Similar),
}

/// The next step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Progress {
    /// More images.
    Waits(Wait),
    /// All images are there: [`Machine::finish`].
    Complete,
    /// Nothing; it has ended.
    Refused(Refusal),
}

/// The average of the images of a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// Colour, see [`Average`].
    pub rgb: RgbImage,
    /// Depth, where every image had one.
    pub depth: Option<DepthImage>,
    /// Images in the average.
    pub frames: u32,
    /// Simulated time \[s\] from the first image until everything was at rest.
    pub settled_s: f64,
    /// See [`Scatter::sigma_px`].
    pub corner_noise_px: Option<f64>,
}

/// Takes in images one by one, from the request on, and returns the next step.
///
/// 1. Images that arrived before the request do not count.
/// 2. [`Watch`] must find joints and image still over four images that do.
/// 3. The last of these is the first of the average. Each further one is held against it: when a joint has turned or the
///    image has changed since, all of them are dropped and it goes back to waiting.
///
/// An image may show the pass before the joints of its instant were read; as nothing moved over three intervals, it
/// shows the arm where its joints are.
#[derive(Debug)]
pub struct Machine {
    plan: Plan,
    requested_s: f64,
    /// When the last image arrived, and when the last one with a later simulated time did.
    arrived_s: f64,
    advanced_s: f64,
    sim_time_s: Option<f64>,
    settling_s: f64,
    settling_images: u32,
    wait: Wait,
    watch: Watch,
    collected: Option<Collected>,
    ended: Option<Refusal>,
}

#[derive(Debug)]
struct Collected {
    reference: Reference,
    reference_s: f64,
    average: Average,
    scatter: Scatter,
    newest: u64,
}

impl Machine {
    /// A request at a time on the clock that images arrive by.
    pub fn new(plan: Plan, requested_s: f64) -> Self {
        Self {
            plan,
            requested_s,
            arrived_s: requested_s,
            advanced_s: requested_s,
            sim_time_s: None,
            settling_s: 0.0,
            settling_images: 0,
            wait: Wait::ForImage,
            watch: Watch::default(),
            collected: None,
            ended: None,
        }
    }

    /// Takes in an image.
    pub fn see(&mut self, shot: &Shot<'_>) -> Progress {
        if self.ended.is_some() || self.is_complete() || shot.received_s < self.requested_s {
            return self.progress();
        }
        self.arrived_s = shot.received_s;
        let passed_s = self.sim_time_s.map(|before_s| shot.sim_time_s - before_s);
        // A simulation that was started again counts from its own beginning. Images of an instant that was seen
        // already, or without a valid time, are ignored.
        if passed_s == Some(0.0) || !shot.sim_time_s.is_finite() {
            return self.progress();
        }
        self.advanced_s = shot.received_s;
        self.sim_time_s = Some(shot.sim_time_s);
        if !self.collect(shot) {
            self.settle(shot, passed_s.map_or(0.0, |s| s.max(0.0)));
        }
        self.progress()
    }

    /// Adds an image to the average. `false` when there is none yet, or no longer.
    fn collect(&mut self, shot: &Shot<'_>) -> bool {
        let Some(collected) = &mut self.collected else { return false };
        let since_s = shot.sim_time_s - collected.reference_s;
        let rest = collected.reference.compare(shot, since_s);
        let added = since_s > 0.0
            && matches!(rest, Rest::Still { .. })
            && collected.average.add(shot.rgb, shot.depth, shot.far_plane_m);
        if added {
            collected.newest = shot.number;
            self.wait = Wait::Averaging { done: collected.average.frames(), of: self.frames() };
        } else {
            // What moved and is at rest again has to be checked from the beginning.
            self.collected = None;
            self.watch = Watch::default();
            self.waits_for(rest);
        }
        added
    }

    fn settle(&mut self, shot: &Shot<'_>, passed_s: f64) {
        self.settling_s += passed_s;
        self.settling_images = self.settling_images.saturating_add(1);
        let rest = self.watch.see(shot);
        self.waits_for(rest);
        if let Rest::Still { noise } = rest {
            let Plan { others, least_distance_m, least_angle_rad, .. } = &self.plan;
            if let Some(similar) = nearest_similar(&shot.base_from_tip, others, *least_distance_m, *least_angle_rad) {
                self.ended = Some(Refusal::TooSimilar(similar));
                return;
            }
            self.collected = Some(Collected {
                reference: Reference::new(shot, noise),
                reference_s: shot.sim_time_s,
                average: Average::begin(shot.rgb, shot.depth, shot.far_plane_m),
                scatter: Scatter::default(),
                newest: shot.number,
            });
            self.wait = Wait::Averaging { done: 1, of: self.frames() };
            return;
        }
        if self.settling_s > self.plan.settle_limit_s && self.settling_images >= FAIR_IMAGES {
            let after_s = self.settling_s;
            self.ended = match rest {
                Rest::RobotMoves(rate) => Some(Refusal::RobotMoves { after_s, rate }),
                Rest::ImageChanges => Some(Refusal::ImageChanges { after_s }),
                // Nothing moved last; one or two more images decide.
                Rest::Unknown | Rest::Still { .. } => None,
            };
        }
    }

    /// What moved last is waited for until everything is known to be at rest.
    fn waits_for(&mut self, rest: Rest) {
        match rest {
            Rest::RobotMoves(_) => self.wait = Wait::RobotMoves,
            Rest::ImageChanges => self.wait = Wait::ImageChanges,
            Rest::Unknown | Rest::Still { .. } => {}
        }
    }

    /// Takes in that time has passed: `now_s` on the clock that images arrive by. `camera_heard_s` is when the camera
    /// last answered in any way, which distinguishes a paused simulation from a camera that is gone.
    pub fn pass_time(&mut self, now_s: f64, camera_heard_s: Option<f64>) -> Progress {
        if self.ended.is_none() && !self.is_complete() && now_s - self.advanced_s > NO_IMAGES_S {
            let heard_s = camera_heard_s.map_or(self.arrived_s, |heard_s| heard_s.max(self.arrived_s));
            let answers = heard_s > self.requested_s && now_s - heard_s <= NO_IMAGES_S;
            self.ended = Some(if answers { Refusal::Paused } else { Refusal::NoImages });
        }
        self.progress()
    }

    /// Tells where the board was in the last image that was taken in. Counts when that image is in the average.
    pub fn saw_board(&mut self, number: u64, corners: &[Corner]) {
        if let Some(collected) = self.collected.as_mut().filter(|collected| collected.newest == number) {
            collected.scatter.add(corners);
        }
    }

    /// The next step.
    pub fn progress(&self) -> Progress {
        match self.ended {
            Some(refusal) => Progress::Refused(refusal),
            None if self.is_complete() => Progress::Complete,
            None => Progress::Waits(self.wait),
        }
    }

    fn is_complete(&self) -> bool {
        self.collected.as_ref().is_some_and(|collected| collected.average.frames() >= self.frames())
    }

    fn frames(&self) -> u32 {
        self.plan.frames.max(1)
    }

    /// The average; `None` before [`Progress::Complete`].
    pub fn finish(&self) -> Option<Taken> {
        let collected = self.collected.as_ref().filter(|_| self.is_complete())?;
        let (rgb, depth) = collected.average.finish();
        Some(Taken {
            rgb,
            depth,
            frames: collected.average.frames(),
            settled_s: self.settling_s,
            corner_noise_px: collected.scatter.sigma_px(),
        })
    }
}
