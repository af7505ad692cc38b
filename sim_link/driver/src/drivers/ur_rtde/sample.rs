//! What is read of the controller, and the bytes that it is in.

use handeye_geometry::frames::{Base, Frame, Pose, Tip};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::RtdeError;
use super::wire::Body;

/// Outputs that every controller with version 2 of the protocol has, with their types, in the order of [`Sample::read`].
pub(super) const OUTPUTS: [(&str, &str); 7] = [
    ("timestamp", "DOUBLE"),
    ("actual_q", "VECTOR6D"),
    ("actual_qd", "VECTOR6D"),
    ("actual_TCP_pose", "VECTOR6D"),
    ("actual_TCP_speed", "VECTOR6D"),
    ("robot_mode", "INT32"),
    ("safety_mode", "INT32"),
];
/// The tool that is set on the controller, which only newer software says.
pub(super) const TCP_OFFSET: (&str, &str) = ("tcp_offset", "VECTOR6D");

/// The tool flange, on which the TCP is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flange {}

impl Frame for Flange {
    const NAME: &'static str = "flange";
}

/// Slower than this an arm stands still. What is measured at rest is noise of about a tenth of it.
const REST_M_S: f64 = 2e-3;
/// As [`REST_M_S`], of the joints and of the rotation of the TCP.
const REST_RAD_S: f64 = 1e-2;

/// The robot at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Seconds since the controller was started.
    pub timestamp_s: f64,
    /// Joint positions, base to wrist 3, radians.
    pub joints_rad: [f64; 6],
    /// Their speeds.
    pub joint_speeds_rad_s: [f64; 6],
    /// The TCP as the pendant shows it for the feature "base".
    pub base_from_tip: Pose<Base, Tip>,
    /// Speed of the TCP, m/s, and of its rotation, rad/s.
    pub tip_speed: [f64; 6],
    /// The guide's number of the robot's mode.
    pub robot_mode: i32,
    /// The guide's number of the safety mode.
    pub safety_mode: i32,
    /// The TCP that is set on the controller, in the frame of the tool flange; `None` where the software does not say it.
    pub flange_from_tcp: Option<Pose<Flange, Tip>>,
}

impl Sample {
    /// Reads the values of [`OUTPUTS`], and of [`TCP_OFFSET`] if it is there.
    pub(super) fn read(body: &[u8], has_tcp_offset: bool) -> Result<Self, RtdeError> {
        let mut fields = Body::new(body, "a data package");
        let sample = Self {
            timestamp_s: fields.double()?,
            joints_rad: fields.vector6()?,
            joint_speeds_rad_s: fields.vector6()?,
            base_from_tip: pose(fields.vector6()?),
            tip_speed: fields.vector6()?,
            robot_mode: fields.int()?,
            safety_mode: fields.int()?,
            flange_from_tcp: if has_tcp_offset { Some(pose(fields.vector6()?)) } else { None },
        };
        match fields.rest().len() {
            0 => Ok(sample),
            more => Err(RtdeError::malformed(format!("{more} bytes too many in a data package"))),
        }
    }

    /// Whether the arm moves, by the speeds that the controller measures.
    pub fn moves(&self) -> bool {
        let [vx, vy, vz, wx, wy, wz] = self.tip_speed;
        Vector3::new(vx, vy, vz).norm() > REST_M_S
            || Vector3::new(wx, wy, wz).norm() > REST_RAD_S
            || self.joint_speeds_rad_s.iter().any(|speed| speed.abs() > REST_RAD_S)
    }
}

/// `x y z` in metres and a rotation vector, as the controller writes poses.
fn pose<Dst: Frame, Src: Frame>([x, y, z, rx, ry, rz]: [f64; 6]) -> Pose<Dst, Src> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(rx, ry, rz));
    Pose::from_isometry(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}
