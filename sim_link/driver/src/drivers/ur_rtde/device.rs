//! A Universal Robots controller as a driver reads it.

use handeye_arm::JointKind;

use super::modes::{POWER_ON, robot_mode, safety_mode};
use super::{RtdeClient, RtdeOptions, Sample};
use crate::drivers::{Device, Fault, Outlet};
use crate::message::{Ability, ArmMessage, Hello, JointMessage, LogLevel, PROTOCOL, PoseMessage, StateMessage};

/// The joints, as Universal Robots' own description names them.
const JOINTS: [&str; 6] =
    ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"];
/// So many values tell how fast messages arrive at best: 0.2 s of them.
const FOR_THE_CLOCK: u32 = 25;

/// What is read, and what only the user knows of it.
#[derive(Debug, Clone)]
pub struct UrRtdeOptions {
    /// The controller.
    pub rtde: RtdeOptions,
    /// Which arm it is; RTDE does not say.
    pub arm: Option<ArmMessage>,
}

/// Reads a controller. It ends when the stream breaks; the workbench starts it again.
#[derive(Debug)]
pub struct UrRtde {
    options: UrRtdeOptions,
    client: Option<RtdeClient>,
}

impl UrRtde {
    /// Nothing is connected yet.
    pub fn new(options: UrRtdeOptions) -> Self {
        Self { options, client: None }
    }
}

impl Device for UrRtde {
    fn open(&mut self, outlet: &Outlet) -> Result<Hello, Fault> {
        let mut client = RtdeClient::connect(&self.options.rtde).map_err(Fault::of)?;
        for _ in 0..FOR_THE_CLOCK {
            outlet.heard(client.next_sample().map_err(Fault::of)?.timestamp_s);
        }
        let [major, minor, fix, build] = client.controller();
        self.client = Some(client);
        let joint =
            |name: &&str| JointMessage { name: (*name).into(), kind: JointKind::Revolute, min: None, max: None };
        Ok(Hello {
            protocol: PROTOCOL,
            name: format!("Universal Robots controller {major}.{minor}.{fix}.{build} at {}", self.options.rtde.host),
            version: env!("CARGO_PKG_VERSION").into(),
            clock: "controller".into(),
            can: vec![Ability::State, Ability::Joints],
            joints: JOINTS.iter().map(joint).collect(),
            arm: self.options.arm.clone(),
            base_from_arm: None,
            camera: None,
            depth_limits_m: None,
        })
    }

    fn run(&mut self, outlet: &Outlet) -> Result<(), Fault> {
        let Some(mut client) = self.client.take() else { return Err(Fault("the controller was not opened".into())) };
        let mut modes = None;
        let mut last_s = f64::NEG_INFINITY;
        while !outlet.has_ended() {
            let sample = client.next_sample().map_err(Fault::of)?;
            for message in client.take_messages() {
                outlet.log(LogLevel::Info, format!("the controller says: {message}"));
            }
            if sample.timestamp_s < last_s {
                return Err(Fault("the controller was started anew: its clock went back".into()));
            }
            outlet.heard(sample.timestamp_s);
            if modes.replace((sample.robot_mode, sample.safety_mode)) != Some((sample.robot_mode, sample.safety_mode)) {
                say_modes(outlet, &sample);
            }
            // Switched off, the controller repeats what it last knew, or zeros.
            if sample.robot_mode >= POWER_ON && sample.timestamp_s > last_s {
                outlet.state(&state(&sample));
            }
            last_s = sample.timestamp_s;
        }
        Ok(())
    }
}

fn say_modes(outlet: &Outlet, sample: &Sample) {
    const NORMAL: i32 = 1;
    const REDUCED: i32 = 2;
    let mode = robot_mode(sample.robot_mode);
    if sample.robot_mode < POWER_ON {
        let text = format!("the arm is switched off ({mode}): nothing says where it is until it is switched on");
        outlet.log(LogLevel::Warn, text);
    } else if [NORMAL, REDUCED].contains(&sample.safety_mode) {
        outlet.log(LogLevel::Info, format!("robot mode {mode}, safety mode {}", safety_mode(sample.safety_mode)));
    } else {
        let text = format!("the arm was stopped by its safety system: {}", safety_mode(sample.safety_mode));
        outlet.log(LogLevel::Warn, text);
    }
}

fn state(sample: &Sample) -> StateMessage {
    StateMessage {
        stamp: sample.timestamp_s,
        joints_rad: Some(sample.joints_rad.into()),
        base_from_flange: None,
        flange_from_tcp: sample.flange_from_tcp.as_ref().map(PoseMessage::of),
        base_from_tip: Some(PoseMessage::of(&sample.base_from_tip)),
        moving: Some(sample.moves()),
    }
}
