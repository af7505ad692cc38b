//! The robot behind a driver: where it is, whether it may be moved, stop.

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::{self, ArmKinematics};
use handeye_driver::message::Ability;
use handeye_driver::{ChainPlacement, Driver, DriverCell, LogLevel};
use handeye_geometry::frames::{Base, Pose, Tip};

use super::{TypedPose, port_error};
use crate::{ArmDoubt, CellFacts, JointFacts, Moves, RobotState, Simulation};
use crate::{ControlPort, PortError};
use handeye_wording::text;

pub(super) struct DriverControl {
    cell: DriverCell,
    typed: Option<TypedPose>,
    /// The placement that was reported last.
    placement: ChainPlacement,
}

impl DriverControl {
    pub fn new(cell: DriverCell, typed: Option<TypedPose>) -> Self {
        Self { cell, typed, placement: ChainPlacement::Unnamed }
    }

    fn simulated() -> PortError {
        PortError::Refused(text!("Only a simulated cell can do that"))
    }
}

impl ControlPort for DriverControl {
    fn facts(&mut self) -> Result<CellFacts, PortError> {
        self.placement = self.cell.robot().chain_placement();
        let robot = self.cell.robot().hello();
        let camera = self.cell.camera().map(Driver::hello);
        let joints = robot
            .joints
            .iter()
            .filter(|_| robot.can(Ability::Joints))
            .map(|joint| JointFacts { kind: joint.kind, range: joint.min.zip(joint.max).map(|(min, max)| [min, max]) });
        Ok(CellFacts {
            joints: joints.collect(),
            nominal_intrinsics: camera.and_then(|hello| {
                let camera = hello.camera?;
                camera.intrinsics?.intrinsics(camera.width, camera.height).ok()
            }),
            arm: match &self.placement {
                ChainPlacement::Known(kinematics) => Some(ArmKinematics::clone(kinematics)),
                _ => None,
            },
            arm_doubt: match self.placement {
                ChainPlacement::Unnamed | ChainPlacement::Known(_) => None,
                ChainPlacement::Open { .. } => Some(ArmDoubt::Open),
                ChainPlacement::Foreign { distance_m, angle_rad } => Some(ArmDoubt::Foreign { distance_m, angle_rad }),
            },
            truth: None,
            has_depth: camera.is_some_and(|hello| hello.can(Ability::Depth)),
            moves: match (&self.typed, robot.can(Ability::MoveJoints), robot.can(Ability::MoveTip)) {
                (Some(_), ..) | (None, false, false) => Moves::Never,
                (None, joints, tip) => Moves::OnceArmed { joints, tip },
            },
            poses_are_typed: self.typed.is_some(),
        })
    }

    fn facts_differ(&mut self) -> bool {
        std::mem::discriminant(&self.placement) != std::mem::discriminant(&self.cell.robot().chain_placement())
    }

    fn state(&mut self) -> Result<Option<RobotState>, PortError> {
        let simulation = Simulation::Running;
        if let Some(typed) = &self.typed {
            self.cell.check().map_err(port_error)?;
            let sim_time_s = self.cell.timebase().now_s();
            let state = |base_from_tip| RobotState {
                base_from_tip,
                joints_rad: JointValues::zeros(0),
                sim_time_s,
                simulation,
                is_armed: false,
            };
            return Ok(typed.get().map(state));
        }
        let robot = self.cell.robot();
        let Some(now) = robot.state().map_err(port_error)? else { return Ok(None) };
        let reading = now.reading;
        Ok(Some(RobotState {
            base_from_tip: reading.base_from_tip,
            joints_rad: reading.joints.unwrap_or_else(|| JointValues::zeros(0)),
            sim_time_s: robot.clock().map_or(reading.stamp_s, |clock| reading.stamp_s + clock.offset_s),
            simulation,
            is_armed: robot.is_armed(),
        }))
    }

    fn start_simulation(&mut self) -> Result<(), PortError> {
        Err(Self::simulated())
    }

    fn stop(&mut self) -> Result<(), PortError> {
        self.cell.robot().stop().map_err(port_error)
    }

    fn move_board(&mut self, _motion: &cell::BoardMotion) -> Result<(), PortError> {
        Err(Self::simulated())
    }

    fn hide_board(&mut self, _hidden: bool) -> Result<(), PortError> {
        Err(Self::simulated())
    }

    fn arm(&mut self, on: bool) -> Result<(), PortError> {
        self.cell.robot().arm(on).map_err(port_error)
    }

    fn type_pose(&mut self, pose: Option<Pose<Base, Tip>>) -> Result<(), PortError> {
        let Some(typed) = &self.typed else {
            return Err(PortError::Refused(text!("The robot reports its pose by itself")));
        };
        typed.set(pose);
        Ok(())
    }

    fn heard(&mut self) -> Vec<(LogLevel, String)> {
        let camera = self.cell.camera().filter(|_| self.cell.is_two());
        let drivers = std::iter::once(self.cell.robot()).chain(camera);
        let lines = drivers.flat_map(|driver| {
            let name = driver.hello().name.clone();
            driver.take_log().into_iter().map(move |line| (line.level, format!("{name}: {}", line.text)))
        });
        lines.collect()
    }
}
