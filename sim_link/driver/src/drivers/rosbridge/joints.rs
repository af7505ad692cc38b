//! Joint values out of `sensor_msgs/JointState`, in the order of the arm.

use handeye_arm::JointValues;

use super::messages::JointState;
use crate::drivers::interpolate::Samples;

/// What is known of the joints that were asked for.
#[derive(Debug, Default)]
pub(super) struct Joints {
    names: Vec<String>,
    samples: Samples<JointValues>,
    /// Names of the last message, for a user who has not said which.
    seen: Vec<String>,
}

impl Joints {
    /// Of joints by name, from the base up.
    pub fn new(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }

    /// Takes a message. One that lacks a joint says nothing: another publisher has it.
    pub fn take(&mut self, message: &JointState) {
        const MOST: usize = 64;
        self.seen = message.name.iter().take(MOST).cloned().collect();
        let value = |name: &String| {
            let index = message.name.iter().position(|other| other == name)?;
            message.position.get(index).copied().flatten()
        };
        let values: Option<Vec<f64>> = self.names.iter().map(value).collect();
        if let Some(values) = values.filter(|values| !values.is_empty()) {
            self.samples.push(message.header.stamp.seconds(), JointValues::from_fn(values.len(), |i| values[i]));
        }
    }

    /// The joints that were asked for.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Names of the last message.
    pub fn seen(&self) -> &[String] {
        &self.seen
    }

    /// When the newest values were.
    pub fn last_s(&self) -> Option<f64> {
        self.samples.last_s()
    }

    /// At an instant among the messages.
    pub fn at(&self, at_s: f64) -> Option<JointValues> {
        self.samples
            .at(at_s, |left, right, share| JointValues::from_fn(left.len(), |i| left[i] + share * (right[i] - left[i])))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn values_come_in_the_order_that_was_asked_for_and_between_messages() {
        let mut joints = Joints::new(vec!["lift".into(), "pan".into()]);
        let message = |at: i32, names: [&str; 3], position: [f64; 3]| -> JointState {
            serde_json::from_value(json!({
                "header": {"stamp": {"sec": at, "nanosec": 0}, "frame_id": ""},
                "name": names, "position": position, "velocity": [null], "effort": [],
            }))
            .expect("a message")
        };
        joints.take(&message(1, ["elbow", "pan", "lift"], [9.0, 1.0, 2.0]));
        joints.take(&message(2, ["gripper", "finger", "thumb"], [0.0, 0.0, 0.0]));
        joints.take(&message(3, ["elbow", "pan", "lift"], [9.0, 2.0, 4.0]));
        assert_eq!(&joints.at(2.0).expect("values")[..], [3.0, 1.5]);
        assert_eq!(joints.at(4.0), None);
        assert_eq!(joints.seen(), ["elbow", "pan", "lift"]);
    }
}
