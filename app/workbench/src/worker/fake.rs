//! A cell for tests: a gradient that moves, and failures on demand.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crossbeam_channel::{Receiver, Sender, bounded};
use handeye_arm::{ArmKind, JointKind, JointValues};
use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::{self, ArmKinematics, BoardInView, FollowEnd, FollowMoment, FollowRequest};
use handeye_driver::LogLevel;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::Pose;
use handeye_plan::Surroundings;
use handeye_plan::guided::choose::Robot;
use image::{Rgb, RgbImage};
use nalgebra::Isometry3;

use crate::text::Text;
use crate::track::state::BoardMotion;
use handeye_link::{
    CameraPort, Cell, Connected, ControlPort, JogRequest, MotionPort, Newest, PortError, RawFrame, Room, ViewsRequest,
};
use handeye_link::{CellFacts, MotionGoal, MotionOutcome, Moves, RobotState, Simulation};
use handeye_wording::text;

/// Width and height of the fake images in pixels.
pub const SIZE: (u32, u32) = (64, 48);

/// What happens to the motions of the fake cell.
#[derive(Debug, Clone, PartialEq)]
pub enum FakeMotions {
    /// They are over at once.
    Arrive,
    /// They are not begun, for this reason; nor are jogs. Otherwise a jog continues for as long as it is held.
    Refuse(Text),
    /// They continue until they are cancelled.
    Hang,
}

/// What the fake cell does.
#[derive(Debug)]
pub struct Script {
    /// Answers to the next attempts to connect for control or images; after the last one they succeed.
    pub refusals: Vec<PortError>,
    /// Connections break at the next call while this is set.
    pub broken: bool,
    /// Number of images to deliver before time is paused.
    pub frames_left: u64,
    /// Images delivered.
    pub frames: u64,
    /// Whether time advances.
    pub simulation: Simulation,
    /// Stops carried out.
    pub stops: u32,
    /// Why stops and starts are refused.
    pub refuse_tasks: Option<PortError>,
    /// What happens to motions.
    pub motions: FakeMotions,
    /// Whether there is room to follow.
    pub room: Room,
    /// The poses that are planned, or why there are none.
    pub views: Result<Vec<JointValues>, Text>,
    /// The arm as guided capture drives it.
    pub robot: Result<Robot, Text>,
    /// What the arm was requested to keep out of.
    pub keep_out: Surroundings,
    /// Motions that were begun.
    pub moved: Vec<MotionGoal>,
    /// Jogs and steps that were begun.
    pub jogged: Vec<JogRequest>,
    /// How the board was requested to move.
    pub board: BoardMotion,
    /// Whether it was requested to hide.
    pub board_hidden: bool,
    /// Lines that it returns whenever it is asked.
    pub lines: usize,
    /// How often they were requested.
    pub asked_for_lines: usize,
}

/// A cell under the test's control. Clones are the same cell.
#[derive(Clone)]
pub struct FakeCell {
    script: Arc<Mutex<Script>>,
    hang: Option<Receiver<()>>,
}

impl FakeCell {
    /// Connects at once, delivers `frames` images.
    pub fn new(frames: u64) -> Self {
        let script = Script {
            refusals: Vec::new(),
            broken: false,
            frames_left: frames,
            frames: 0,
            simulation: Simulation::Running,
            stops: 0,
            refuse_tasks: None,
            motions: FakeMotions::Arrive,
            room: Room::Enough,
            views: Ok(Vec::new()),
            robot: Err(text!("The kinematics of the arm is not known")),
            keep_out: Surroundings::default(),
            moved: Vec::new(),
            jogged: Vec::new(),
            board: BoardMotion::default(),
            board_hidden: false,
            lines: 0,
            asked_for_lines: 0,
        };
        Self { script: Arc::new(Mutex::new(script)), hang: None }
    }

    /// Accepts connections and then never answers, whatever is cancelled, until the sender is dropped.
    pub fn that_never_answers() -> (Self, Sender<()>) {
        let (release, hang) = bounded(0);
        (Self { hang: Some(hang), ..Self::new(u64::MAX) }, release)
    }

    /// The script, to look at and to change.
    pub fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many clones there are.
    pub fn owners(&self) -> usize {
        Arc::strong_count(&self.script)
    }

    /// The colour image of a number.
    pub fn rgb(number: u64) -> RgbImage {
        RgbImage::from_fn(SIZE.0, SIZE.1, |column, row| Rgb([column as u8, row as u8, number as u8]))
    }

    fn answer(&self) -> Result<MutexGuard<'_, Script>, PortError> {
        if let Some(hang) = &self.hang {
            // Returns when the test drops its end.
            let _released = hang.recv().is_err();
        }
        let script = self.script();
        if script.broken { Err(PortError::Lost(Text::verbatim("the cable is out"))) } else { Ok(script) }
    }

    fn connected<Port>(&self, port: Port) -> Result<Connected<Port>, PortError> {
        let mut script = self.script();
        if !script.refusals.is_empty() {
            return Err(script.refusals.remove(0));
        }
        if script.broken {
            return Err(PortError::Lost(Text::verbatim("nothing answers")));
        }
        Ok(Connected { port, address: "tcp://fake:1".to_owned(), server: "fake cell 1.2".to_owned() })
    }
}

impl Cell for FakeCell {
    fn control(&self, _shutdown: &CancelToken) -> Result<Connected<Box<dyn ControlPort>>, PortError> {
        self.connected(Box::new(self.clone()))
    }

    fn camera(&self, _shutdown: &CancelToken) -> Result<Connected<Box<dyn CameraPort>>, PortError> {
        self.connected(Box::new(self.clone()))
    }

    fn motion(&self, _shutdown: &CancelToken) -> Result<Connected<Box<dyn MotionPort>>, PortError> {
        if self.script().broken {
            return Err(PortError::Lost(Text::verbatim("nothing answers")));
        }
        let server = "fake cell 1.2".to_owned();
        Ok(Connected { port: Box::new(self.clone()), address: "tcp://fake:1".to_owned(), server })
    }
}

impl ControlPort for FakeCell {
    fn facts(&mut self) -> Result<CellFacts, PortError> {
        drop(self.answer()?);
        let (width, height) = SIZE;
        Ok(CellFacts {
            joints: vec![
                handeye_link::JointFacts {
                    kind: JointKind::Revolute,
                    range: Some([-std::f64::consts::TAU, std::f64::consts::TAU])
                };
                6
            ],
            nominal_intrinsics: Some(Intrinsics::pinhole(width, height, 60.0)),
            arm: ArmKinematics::ur5(Isometry3::identity(), Isometry3::identity(), &ArmKind::Ur5Coppeliasim.ranges())
                .ok(),
            arm_doubt: None,
            truth: None,
            has_depth: true,
            moves: Moves::Freely,
            poses_are_typed: false,
        })
    }

    fn state(&mut self) -> Result<Option<RobotState>, PortError> {
        let script = self.answer()?;
        Ok(Some(RobotState {
            base_from_tip: Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0]),
            joints_rad: [0.0, 0.5, -1.0, 0.0, 1.5, 0.0].into(),
            sim_time_s: script.frames as f64 * 0.05,
            simulation: script.simulation,
            is_armed: true,
        }))
    }

    fn start_simulation(&mut self) -> Result<(), PortError> {
        let mut script = self.answer()?;
        if let Some(error) = &script.refuse_tasks {
            return Err(error.clone());
        }
        script.simulation = Simulation::Running;
        Ok(())
    }

    fn stop(&mut self) -> Result<(), PortError> {
        let mut script = self.answer()?;
        if let Some(error) = &script.refuse_tasks {
            return Err(error.clone());
        }
        script.stops += 1;
        Ok(())
    }

    fn move_board(&mut self, motion: &cell::BoardMotion) -> Result<(), PortError> {
        self.answer()?.board = BoardMotion { path: motion.path, speed_m_s: motion.speed_m_s };
        Ok(())
    }

    fn hide_board(&mut self, hidden: bool) -> Result<(), PortError> {
        self.answer()?.board_hidden = hidden;
        Ok(())
    }

    fn heard(&mut self) -> Vec<(LogLevel, String)> {
        let mut script = self.script();
        script.asked_for_lines += 1;
        vec![(LogLevel::Info, "a line".to_owned()); script.lines]
    }
}

impl FakeCell {
    /// Ends as scripted; `goes_on` returns whether a motion that hangs is still wanted.
    fn end_of_motion(
        &self,
        begun: impl FnOnce(&mut Script),
        mut goes_on: impl FnMut() -> bool,
    ) -> Result<MotionOutcome, PortError> {
        let mut script = self.answer()?;
        let motions = script.motions.clone();
        if let FakeMotions::Refuse(why) = motions {
            return Ok(MotionOutcome::Refused(why));
        }
        begun(&mut script);
        drop(script);
        if motions == FakeMotions::Arrive {
            return Ok(MotionOutcome::Arrived);
        }
        while goes_on() {
            drop(self.answer()?);
            std::thread::yield_now();
        }
        Ok(MotionOutcome::Stopped)
    }
}

impl MotionPort for FakeCell {
    fn check(&mut self) -> Result<(), PortError> {
        let script = self.script();
        if script.broken { Err(PortError::Lost(Text::verbatim("the cable is out"))) } else { Ok(()) }
    }

    fn move_to(&mut self, goal: &MotionGoal, _speed: f64, cancel: &CancelToken) -> Result<MotionOutcome, PortError> {
        self.end_of_motion(|script| script.moved.push(*goal), || !cancel.is_cancelled())
    }

    fn jog_step(
        &mut self,
        request: &JogRequest,
        _length: f64,
        cancel: &CancelToken,
    ) -> Result<MotionOutcome, PortError> {
        self.end_of_motion(|script| script.jogged.push(*request), || !cancel.is_cancelled())
    }

    fn jog(&mut self, request: &JogRequest, held: &mut dyn FnMut() -> Option<f64>) -> Result<Option<Text>, PortError> {
        if let FakeMotions::Refuse(why) = &self.answer()?.motions {
            return Ok(Some(why.clone()));
        }
        self.script().jogged.push(*request);
        while held().is_some() {
            drop(self.answer()?);
            std::thread::yield_now();
        }
        Ok(None)
    }

    fn room(&mut self, _board: &BoardInView) -> Result<Room, PortError> {
        Ok(self.answer()?.room.clone())
    }

    fn views(&mut self, _request: &ViewsRequest) -> Result<Result<Vec<JointValues>, Text>, PortError> {
        Ok(self.answer()?.views.clone())
    }

    fn robot(&mut self, _speed: f64) -> Result<Result<Robot, Text>, PortError> {
        Ok(self.answer()?.robot.clone())
    }

    fn keep_out(&mut self, keep_out: &Surroundings) -> Result<Surroundings, Text> {
        self.script().keep_out = keep_out.clone();
        Ok(Surroundings::default())
    }

    fn follow(
        &mut self,
        requested: &mut dyn FnMut(&FollowMoment) -> FollowRequest,
    ) -> Result<Result<FollowEnd, MotionOutcome>, PortError> {
        let RobotState { base_from_tip, joints_rad, .. } = self.state()?.expect("it has one");
        let sim_time_s = || self.script().frames as f64 * 0.05;
        let moment = |sim_time_s| FollowMoment { sim_time_s, joints: joints_rad, base_from_tip, is_kept_off: false };
        let outcome = self.end_of_motion(|_| {}, || requested(&moment(sim_time_s())) != FollowRequest::End)?;
        Ok(if outcome == MotionOutcome::Stopped { Ok(FollowEnd::Released) } else { Err(outcome) })
    }
}

impl CameraPort for FakeCell {
    fn newest(&mut self, seen_s: Option<f64>) -> Result<Newest, PortError> {
        let mut script = self.answer()?;
        let next = script.frames + u64::from(script.frames_left > 0);
        if seen_s == Some(next as f64 * 0.05) {
            return Ok(Newest::Same);
        }
        if script.frames_left > 0 {
            script.frames_left -= 1;
            script.frames += 1;
        }
        let (width, height) = SIZE;
        let metres = (0..width * height).map(|i| 0.4 + 0.4 * (i % width) as f32 / width as f32).collect();
        Ok(Newest::Frame(Box::new(RawFrame {
            rgb: Self::rgb(script.frames),
            depth: Some(DepthImage { width, height, metres }),
            sim_time_s: script.frames as f64 * 0.05,
            image_age_s: 0.0,
            base_from_tip: Some(Pose::from_translation_xyzw([0.11, -0.016, 0.847], [0.0, 0.0, 0.0, 1.0])),
            no_pose: None,
            joints_rad: [0.0, 0.5, -1.0, 0.0, 1.5, 0.0].into(),
            base_from_target_true: None,
            clocks: None,
        })))
    }

    fn depth_limits_m(&self) -> [f32; 2] {
        [0.01, 3.5]
    }
}
