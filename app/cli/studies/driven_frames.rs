//! What the thread of the window does for a frame while the user does the whole workflow over drivers: connect, capture ten,
//! solve, verify, export.
//!
//!     cargo run --release -p handeye_app --example driven_frames
//!
//! Prints for each run the median, the 99th percentile and the worst of all its frames from the first one on (fonts and connections
//! included), 60 a second without a graphics card, and the error of the answer. The program is its own drivers, each a process; the
//! cell behind them keeps pace with real time.

mod window;

use std::io::{stdin, stdout};
use std::path::{Path, PathBuf};
use std::process::Command as Program;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail, ensure};
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{Arm, CellPaths, MotionTolerance, SettleOptions};
use handeye_coppeliasim::{CancelToken, ConnectionOptions, Endpoint};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_driver::fake::{Fake, FakeOptions, FakePart};
use handeye_geometry::frames::{Base, Camera, Pose, Tip};
use handeye_link::limits;
use handeye_record::RerunChoice;
use handeye_server::{CellConfig, CellServer};
use handeye_workbench::command::Command;
use handeye_workbench::model::{
    Axis, CapturePurpose, CellSource, Drivers, Jog, JogFrame, JogSettings, JogStep, Model, Motion, SolveStatus,
};
use handeye_workbench::{capture, connect, export, motion, taught};
use window::Drawn;

/// Longest wait for anything in the workflow.
const PATIENCE: Duration = Duration::from_mins(2);
/// Captures of a calibration, and for its verification.
const CAPTURES: usize = 10;
const VERIFIED: usize = 2;

fn reference_poses() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/poses/seed10.toml")
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [part, cell, clock_s, number] = arguments.as_slice() {
        return be_driver(part, cell.parse()?, clock_s.parse()?, Path::new(number));
    }
    println!(
        "{:<50} {:>5} {:>7} {:>26} {:>9} {:>9}",
        "", "s", "frames", "ms: median, 99 %, worst", "over 8 ms", "off by mm"
    );
    let folder = tempfile::tempdir()?;
    let numbers = folder.path();
    measure("one driver, robot and camera", numbers, |cell| {
        Ok(Drivers { robot: Some(driver(cell, "both", 0.0, numbers)?), camera: None })
    })?;
    measure("the same, killed after five captures", numbers, |cell| {
        Ok(Drivers { robot: Some(driver(cell, "both-killed", 0.0, numbers)?), camera: None })
    })?;
    measure("robot and camera two drivers, clocks 80 ms apart", numbers, |cell| {
        let camera = Some(driver(cell, "camera", 500.08, numbers)?);
        Ok(Drivers { robot: Some(driver(cell, "robot", 500.0, numbers)?), camera })
    })?;
    measure("freehand, poses typed", numbers, |cell| {
        Ok(Drivers { robot: None, camera: Some(driver(cell, "camera", 0.0, numbers)?) })
    })?;
    Ok(())
}

/// The command of a driver of one part of a cell; its process writes its id into a file of the part's name.
fn driver(cell: &Endpoint, part: &str, clock_s: f64, numbers: &Path) -> anyhow::Result<String> {
    let (program, number) = (std::env::current_exe()?, numbers.join(part));
    Ok(format!("'{}' {part} {cell} {clock_s} '{}'", program.display(), number.display()))
}

fn be_driver(part: &str, cell: Endpoint, clock_s: f64, number: &Path) -> anyhow::Result<()> {
    std::fs::write(number, std::process::id().to_string())?;
    let part = match part {
        "robot" => FakePart::Robot,
        "camera" => FakePart::Camera,
        _ => FakePart::Both,
    };
    let options = FakeOptions { connect: Some(cell), part, clock_s, ..FakeOptions::new(Scene::reference()?) };
    Ok(Fake::start(options)?.converse(stdin().lock(), stdout())?)
}

/// A user's run over these drivers.
struct Way {
    drawn: Drawn,
    /// The user's hand on the arm, and the pendant.
    hand: Arm,
    killed: Option<PathBuf>,
}

fn measure(
    what: &str,
    numbers: &Path,
    drivers: impl FnOnce(&Endpoint) -> anyhow::Result<Drivers>,
) -> anyhow::Result<()> {
    let cell = CellServer::start(CellConfig { real_time: Some(true), ..CellConfig::new(Scene::reference()?) })?;
    let endpoint: Endpoint = cell.endpoint().parse()?;
    let drivers = drivers(&endpoint)?;
    let is_typed = drivers.robot.is_none();
    let is_killed = drivers.robot.as_ref().is_some_and(|robot| robot.contains("both-killed"));
    let drawn = Drawn::open(CellSource::Drivers(drivers), RerunChoice::Record)?;
    let hand = Arm::connect(&endpoint, &ConnectionOptions::default(), &CellPaths::default())?;
    let killed = is_killed.then(|| numbers.join("both-killed"));
    let mut way = Way { drawn, hand, killed };
    way.until("a cell", |model| {
        model.control.is_connected() && model.camera.is_connected() && model.frame.is_some() && model.cell.is_some()
    })?;
    if is_typed {
        way.capture_by_hand()?;
    } else {
        way.capture_the_sequence()?;
    }
    way.until("a solution", is_solved)?;
    way.verify(is_typed)?;
    way.until("the solution with its verification", is_solved)?;
    way.click(export::Command::Export);
    way.until("the exports", |model| model.export.written.is_some())?;
    let truth = way.hand.ground_truth()?.tip_from_camera;
    let mm = way.error_mm(&truth)?;
    let (took_s, frames) = (way.drawn.age().as_secs(), way.drawn.times_ms.len());
    let late = way.drawn.times_ms.iter().filter(|&&ms| ms > 8.0).count();
    println!("{what:<50} {took_s:>5} {frames:>7} {:>26} {late:>9} {mm:>9.3}", way.drawn.summary());
    Ok(())
}

fn is_solved(model: &Model) -> bool {
    model.solve.status == SolveStatus::Idle && model.solve.fresh
}

fn captured(model: &Model) -> usize {
    model.document().captures.len()
}

impl Way {
    fn click(&mut self, command: impl Into<Command>) {
        self.drawn.app().apply(command);
    }

    /// Draws until the condition holds for the model.
    fn until(&mut self, what: &str, is_so: impl Fn(&Model) -> bool) -> anyhow::Result<()> {
        let began = Instant::now();
        while !is_so(self.drawn.app().model()) {
            if began.elapsed() > PATIENCE {
                let language = handeye_workbench::text::Language::English;
                let messages = self.drawn.app().model().messages.iter();
                let reported: Vec<String> = messages.map(|message| message.text.in_language(language)).collect();
                bail!("waiting for {what}; the window says:\n{}", reported.join("\n"));
            }
            self.drawn.draw();
        }
        Ok(())
    }

    fn allow(&mut self) -> anyhow::Result<()> {
        self.until("the robot", |model| model.robot.is_some() && model.mover.is_connected())?;
        self.click(connect::Command::Arm(true));
        self.until("the permission", Model::is_armed)
    }

    fn capture_the_sequence(&mut self) -> anyhow::Result<()> {
        self.until("related clocks", |model| {
            model.frame.as_ref().is_some_and(|frame| frame.info.base_from_tip.is_some())
        })?;
        self.allow()?;
        self.click(taught::Command::Import(reference_poses()));
        self.until("the poses", |model| model.taught().len() == CAPTURES)?;
        self.click(taught::Command::RunSequence { purpose: Some(CapturePurpose::Calibrate) });
        self.click(taught::Command::ConfirmMove);
        if let Some(number) = self.killed.take() {
            self.until("five captures", |model| captured(model) >= 5)?;
            let number = std::fs::read_to_string(number)?;
            ensure!(Program::new("kill").args(["-KILL", &number]).status()?.success(), "the driver had gone");
            self.until("the end of the sequence", |model| !model.sequence_runs && model.capture.is_none())?;
            self.until("the driver again", |model| model.camera.is_connected() && !model.is_armed())?;
            self.allow()?;
            self.click(taught::Command::ContinueSequence);
            self.click(taught::Command::ConfirmMove);
        }
        self.until("ten captures", |model| {
            captured(model) == CAPTURES && !model.sequence_runs && model.motion == Motion::Idle
        })
    }

    fn capture_by_hand(&mut self) -> anyhow::Result<()> {
        let taught = TaughtPoses::read(&reference_poses())?.poses;
        let mut before = None;
        for pose in taught.iter().take(CAPTURES) {
            let Goal::Tip(goal) = pose.goal else { bail!("the reference poses are poses of the tip") };
            // Two of them are equal, and the user is notified that the second adds nothing new.
            let mut place = *goal.isometry();
            if before.replace(goal) == Some(goal) {
                place.translation.vector.x += 0.03;
            }
            self.lead(&Pose::from_isometry(place))?;
            self.capture(CapturePurpose::Calibrate)?;
            // A pose that is typed before the last one was cleared would be cleared with it.
            self.until("the question for the next pose", |model| model.robot.is_none())?;
        }
        Ok(())
    }

    /// The user moves the arm, which the window does not wait for, and types what the pendant shows.
    fn lead(&mut self, goal: &Pose<Base, Tip>) -> anyhow::Result<()> {
        let cancel = CancelToken::default();
        let limits = limits::of_tip(&limits::SEQUENCE, 1.0);
        let Self { drawn, hand, .. } = self;
        let shown = std::thread::scope(|scope| -> anyhow::Result<_> {
            let moved = scope.spawn(|| -> anyhow::Result<_> {
                hand.move_to_pose(goal, &limits, &MotionTolerance::default(), &cancel)?;
                hand.settle(&SettleOptions::default(), &cancel)?;
                Ok(hand.base_from_tip()?)
            });
            while !moved.is_finished() {
                drawn.draw();
            }
            moved.join().map_err(|_panic| anyhow::anyhow!("the hand failed"))?
        })?;
        self.click(connect::Command::TypePose(shown));
        self.until("the typed pose", |model| model.robot.is_some())
    }

    fn capture(&mut self, purpose: CapturePurpose) -> anyhow::Result<()> {
        let before = captured(self.drawn.app().model());
        self.click(capture::Command::Take(purpose));
        self.until("the capture", |model| captured(model) == before + 1)
    }

    /// Captures at places that the fit has not seen.
    fn verify(&mut self, is_typed: bool) -> anyhow::Result<()> {
        for number in 0..VERIFIED {
            if is_typed {
                let mut goal = *self.hand.base_from_tip()?.isometry();
                goal.translation.vector[number % 2] += 0.02;
                self.lead(&Pose::from_isometry(goal))?;
            } else {
                let axis = [Axis::X, Axis::Y][number % 2];
                let before = self.drawn.app().model().view.jog;
                let step = JogStep::Step { metres: 0.02, radians: 0.05 };
                self.click(motion::Command::SetJog(JogSettings { step, ..before }));
                self.click(motion::Command::Jog(Jog::Translate { frame: JogFrame::Base, axis, forward: true }));
                self.until("the end of the step", |model| model.motion == Motion::Idle)?;
            }
            self.capture(CapturePurpose::Verify)?;
            self.until("the question for the next pose", |model| !is_typed || model.robot.is_none())?;
        }
        Ok(())
    }

    /// The error of the answer relative to the truth, which no driver reports.
    fn error_mm(&mut self, truth: &Pose<Tip, Camera>) -> anyhow::Result<f64> {
        let solved = self.drawn.app().model().solve.current().context("not solved")?;
        let found = solved.result.hand_eye.as_ref().context("no robot")?.translation_m;
        let off = nalgebra::Vector3::from(found) - truth.translation();
        Ok(off.norm() * 1e3)
    }
}
