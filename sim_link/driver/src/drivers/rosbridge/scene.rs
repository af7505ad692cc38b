//! What the topics have told so far.

use std::collections::VecDeque;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::RosbridgeError;
use super::camera_info::lens;
use super::device::RosbridgeOptions;
use super::images::{self, Picture};
use super::joints::Joints;
use super::link::Subscription;
use super::messages::{AnyImage, CameraInfo, JointState, TfMessage};
use super::tf::Tree;
use crate::drivers::{DepthFrame, Frame};
use crate::message::LensMessage;

const TF: &str = "/tf";
const TF_STATIC: &str = "/tf_static";
/// Image and depth image of one exposure have stamps no further apart.
const ONE_INSTANT_S: f64 = 0.005;
/// Images and depth images that wait for the other.
const MOST_WAITING: usize = 3;

/// What a message brought.
#[derive(Debug)]
pub(super) enum News {
    /// Nothing that has to be passed on.
    None,
    /// Something of the arm moved; the newest stamp of it.
    Moved(f64),
    /// A whole image.
    Frame(Box<Frame>),
}

/// A message on a topic.
#[derive(Deserialize)]
struct Publish<T> {
    msg: T,
}

/// What is known.
#[derive(Debug)]
pub(super) struct Scene {
    options: RosbridgeOptions,
    pub tree: Tree,
    pub joints: Joints,
    info: Option<CameraInfo>,
    /// Size of the images.
    pub size: Option<(u32, u32)>,
    pictures: VecDeque<Picture>,
    depths: VecDeque<DepthFrame>,
    /// Topics on which something came.
    heard: Vec<String>,
    /// What the user is to know once: lines for the log.
    pub remarks: Vec<String>,
}

impl Scene {
    pub fn new(options: RosbridgeOptions) -> Self {
        Self {
            tree: Tree::default(),
            joints: Joints::new(options.arm_joints.iter().map(|joint| joint.name.clone()).collect()),
            info: None,
            size: None,
            pictures: VecDeque::new(),
            depths: VecDeque::new(),
            heard: Vec::new(),
            remarks: Vec::new(),
            options,
        }
    }

    /// All topics, bounded as each bears it: tf by its queue alone, since who leaves out messages of one publisher leaves
    /// out another's links.
    pub fn subscriptions(&self) -> Vec<Subscription> {
        const QUEUE: u32 = 100;
        let topic = |topic: &str, throttle_ms, queue| Subscription { topic: topic.into(), throttle_ms, queue };
        let options = &self.options;
        let mut all = vec![topic(TF, 0, QUEUE), topic(TF_STATIC, 0, QUEUE)];
        all.extend(options.joints.iter().map(|name| topic(name, 0, QUEUE)));
        // Image and depth, each thinned by itself, would never be of one instant.
        let throttle_ms = if options.depth.is_some() { 0 } else { (1000.0 / options.image_rate_hz) as u32 };
        all.extend(options.image.iter().chain(&options.depth).map(|name| topic(name, throttle_ms, 1)));
        all.extend(options.camera_info.iter().map(|name| topic(name, 1000, 1)));
        all
    }

    /// Whether anything came on a topic.
    pub fn has_heard(&self, topic: &str) -> bool {
        self.heard.iter().any(|heard| heard == topic)
    }

    /// The lens of the images, where it is asked for and known.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn lens(&self) -> Option<Result<LensMessage, RosbridgeError>> {
        let topic = self.options.camera_info.as_deref()?;
        let (info, size) = (self.info.as_ref()?, self.size?);
        Some(lens(info, size, self.options.is_rectified).map_err(|why| RosbridgeError::topic(topic, why)))
    }

    /// Takes a message on a topic.
    ///
    /// # Errors
    /// [`RosbridgeError::Topic`] for one that is not of the type that the topic is to have, or cannot be used.
    pub fn take(&mut self, topic: &str, text: &str) -> Result<News, RosbridgeError> {
        if !self.has_heard(topic) {
            self.heard.push(topic.to_owned());
        }
        let is = |option: &Option<String>| option.as_deref() == Some(topic);
        if topic == TF || topic == TF_STATIC {
            let message = parse(topic, text, "tf2_msgs/TFMessage")?;
            return Ok(self.take_tf(&message, topic == TF_STATIC));
        }
        if is(&self.options.joints) {
            let message: JointState = parse(topic, text, "sensor_msgs/JointState")?;
            self.joints.take(&message);
            return Ok(News::Moved(message.header.stamp.seconds()));
        }
        if is(&self.options.camera_info) {
            self.info = Some(parse(topic, text, "sensor_msgs/CameraInfo")?);
            return Ok(News::None);
        }
        if is(&self.options.image) {
            let image: AnyImage = parse(topic, text, "sensor_msgs/Image or sensor_msgs/CompressedImage")?;
            let picture = images::picture(image).map_err(|why| RosbridgeError::topic(topic, why))?;
            stamped(topic, picture.stamp_s)?;
            let size = (picture.width, picture.height);
            let first = *self.size.get_or_insert(size);
            if size != first {
                let why = format!("images were {}×{} and are {}×{} now", first.0, first.1, size.0, size.1);
                return Err(RosbridgeError::topic(topic, why));
            }
            keep(&mut self.pictures, picture);
            return Ok(self.frame());
        }
        if is(&self.options.depth) {
            let image: AnyImage = parse(topic, text, "sensor_msgs/Image")?;
            let (depth, size) = images::depth(image).map_err(|why| RosbridgeError::topic(topic, why))?;
            stamped(topic, depth.stamp)?;
            if self.size.is_some_and(|of_image| of_image != size) {
                let (image, depth) = (self.size.unwrap_or_default(), size);
                let why = format!(
                    "depth images are {}×{} and images {}×{}: name the topic of depth that is aligned to the image",
                    depth.0, depth.1, image.0, image.1
                );
                return Err(RosbridgeError::topic(topic, why));
            }
            keep(&mut self.depths, depth);
            return Ok(self.frame());
        }
        Ok(News::None)
    }

    fn take_tf(&mut self, message: &TfMessage, is_static: bool) -> News {
        let mut newest = f64::NEG_INFINITY;
        for transform in &message.transforms {
            let stamp_s = transform.header.stamp.seconds();
            let (parent, child) = (transform.header.frame_id.as_str(), transform.child_frame_id.as_str());
            let Some(pose) = transform.parent_from_child() else {
                self.remark(format!(
                    "tf: the quaternion from {parent:?} to {child:?} is not a rotation; it is not used"
                ));
                continue;
            };
            if !self.tree.insert(parent, child, stamp_s, pose, is_static) {
                self.remark("tf has more than 2000 frames; those that came last are not used".into());
            }
            newest = newest.max(stamp_s);
        }
        if newest.is_finite() && !is_static { News::Moved(newest) } else { News::None }
    }

    fn remark(&mut self, text: String) {
        const MOST: usize = 20;
        if self.remarks.len() < MOST && !self.remarks.contains(&text) {
            self.remarks.push(text);
        }
    }

    /// The newest image, with the depth of its instant where that is asked for.
    fn frame(&mut self) -> News {
        let depth = if self.options.depth.is_some() {
            let pair = self.pictures.iter().enumerate().rev().find_map(|(i, picture)| {
                let of_instant = |depth: &DepthFrame| (depth.stamp - picture.stamp_s).abs() <= ONE_INSTANT_S;
                self.depths.iter().rposition(of_instant).map(|j| (i, j))
            });
            let Some((i, j)) = pair else { return News::None };
            self.pictures.drain(..i);
            self.depths.drain(..j);
            self.depths.pop_front()
        } else {
            None
        };
        let Some(Picture { stamp_s, width, height, encoding, bytes }) = self.pictures.pop_front() else {
            return News::None;
        };
        let intrinsics = self.lens().and_then(Result::ok);
        let stamp = stamp_s;
        News::Frame(Box::new(Frame {
            stamp,
            stamp_uncertainty_s: 0.0,
            width,
            height,
            encoding,
            bytes,
            intrinsics,
            depth,
        }))
    }
}

fn keep<T>(waiting: &mut VecDeque<T>, new: T) {
    if waiting.len() == MOST_WAITING {
        waiting.pop_front();
    }
    waiting.push_back(new);
}

fn stamped(topic: &str, stamp_s: f64) -> Result<(), RosbridgeError> {
    if stamp_s > 0.0 {
        return Ok(());
    }
    let why = "its messages have no stamp (header.stamp is zero), so nothing says where the arm was then: have the camera's node \
               set it";
    Err(RosbridgeError::topic(topic, why))
}

fn parse<T: DeserializeOwned>(topic: &str, text: &str, kind: &str) -> Result<T, RosbridgeError> {
    serde_json::from_str::<Publish<T>>(text)
        .map(|publish| publish.msg)
        .map_err(|error| RosbridgeError::topic(topic, format!("its messages are not {kind}: {error}")))
}
