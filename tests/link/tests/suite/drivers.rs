//! Drivers as programs of their own: the template, faulty ones, and ones that die.

use std::io::BufReader;
use std::net::{Shutdown, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use handeye_arm::JointValues;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::CancelToken;
use handeye_driver::conformance::{self, ConformanceOptions, Report};
use handeye_driver::fake::{Fake, FakeOptions, FakePart};
use handeye_driver::{
    Driver, DriverCell, DriverCellSpec, DriverError, DriverHost, DriverOptions, DriverSpec, Ending, Goal, MoveEnd,
};
use handeye_geometry::testing::python;
use handeye_server::{CellConfig, CellServer};

/// Longest wait for what takes a second on an idle machine.
const PATIENCE: Duration = Duration::from_secs(20);

fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn command(python: &Path, script: &str, arguments: &[&str]) -> DriverSpec {
    let mut words = vec![python.display().to_string(), file(script).display().to_string()];
    words.extend(arguments.iter().map(|&word| word.to_owned()));
    DriverSpec::Command(words)
}

/// As the workbench waits, but for a busy machine.
fn options() -> DriverOptions {
    DriverOptions { hello: PATIENCE, ..DriverOptions::default() }
}

fn broken(python: &Path, fault: &str) -> DriverSpec {
    command(python, "tests/drivers/broken.py", &[fault])
}

fn start(spec: &DriverSpec) -> Result<Driver, DriverError> {
    Driver::start(spec, &options(), &CancelToken::default())
}

/// How the connection ended; it does within the patience.
fn ending(driver: &Driver) -> Ending {
    let until = Instant::now() + PATIENCE;
    loop {
        match driver.image(None, Duration::from_millis(100), &CancelToken::default()) {
            Err(DriverError::Gone { why, .. }) => return why,
            other => assert!(Instant::now() < until, "the driver is not gone: {other:?}"),
        }
    }
}

#[test]
fn the_template_gives_images_with_the_pose_at_their_instant_and_moves_once_it_is_armed() {
    let Some(python) = python() else { return };
    let cancel = CancelToken::default();
    let spec = DriverCellSpec { robot: command(&python, "../../assets/drivers/template.py", &[]), camera: None };
    let cell = DriverCell::start(&spec, &options(), &cancel).unwrap();
    let robot = cell.robot();
    let start = robot.first_state(PATIENCE, &cancel).unwrap().reading.joints.unwrap();
    let goal = Goal::Joints(JointValues::from_fn(6, |i| start[i] + 0.4));

    let refused = robot.move_to(&goal, 0.5, &cancel);
    assert!(matches!(refused, Err(DriverError::NotArmed { .. })), "{refused:?}");
    robot.arm(true).unwrap();
    let moving = std::thread::spawn({
        let (robot, goal) = (robot.clone(), goal);
        move || robot.move_to(&goal, 0.2, &CancelToken::default())
    });
    let mut after = None;
    let mut heights = Vec::new();
    while heights.len() < 12 {
        let Some(frame) = cell.frame(after, PATIENCE, &cancel).unwrap() else { panic!("no image has come") };
        assert!(after.is_none_or(|after| frame.stamp_s > after));
        after = Some(frame.stamp_s);
        if let Ok(robot) = frame.robot {
            let joints = robot.joints.unwrap();
            // What the template does with its joints, at every instant and not only at those of its states.
            let pose = robot.base_from_tip.translation();
            assert!((pose.y - 0.1 * joints[1]).abs() < 1e-6 && (pose.z - 0.3 - 0.1 * joints[2]).abs() < 1e-6, "{pose}");
            heights.push(pose.z);
        }
    }
    assert!(heights.windows(2).all(|pair| pair[1] >= pair[0]), "it moves up: {heights:?}");
    assert_eq!(moving.join().unwrap().unwrap(), MoveEnd::Arrived);
    let outside = Goal::Joints(JointValues::from_fn(6, |_| 7.0));
    let answer = robot.move_to(&outside, 0.5, &cancel).unwrap();
    assert_eq!(answer, MoveEnd::Refused("out of range".to_owned()));
}

#[test]
fn a_motion_is_stopped_on_its_way_by_whoever_asks_for_it() {
    let Some(python) = python() else { return };
    let driver = start(&command(&python, "../../assets/drivers/template.py", &[])).unwrap();
    driver.first_state(PATIENCE, &CancelToken::default()).unwrap();
    driver.arm(true).unwrap();
    let goal = Goal::Joints(JointValues::from_fn(6, |_| 3.0));
    let is_seen = |moving: bool| {
        let until = Instant::now() + PATIENCE;
        while driver.state().unwrap().is_none_or(|now| now.reading.moving != Some(moving)) {
            assert!(Instant::now() < until, "moving: {moving} is not reported");
            std::thread::yield_now();
        }
    };
    for by_another_thread in [false, true] {
        // What it reported last may belong to the motion before.
        is_seen(false);
        let cancel = CancelToken::default();
        let moving = std::thread::spawn({
            let (driver, cancel) = (driver.clone(), cancel.clone());
            move || driver.move_to(&goal, 0.05, &cancel)
        });
        is_seen(true);
        if by_another_thread {
            driver.stop().unwrap();
        } else {
            cancel.cancel();
        }
        assert_eq!(moving.join().unwrap().unwrap(), MoveEnd::Stopped("stop".to_owned()));
    }
}

#[test]
fn a_driver_that_dies_says_why_and_another_takes_its_place() {
    let Some(python) = python() else { return };
    let driver = start(&broken(&python, "dies")).unwrap();
    let Ending::Exited { status, last_line } = ending(&driver) else { panic!("it exits") };
    assert!(status.contains('3') && last_line.unwrap().contains("the robot is not reachable"), "{status}");
    assert!(driver.check().unwrap_err().is_gone());
    drop(driver);
    let again = start(&broken(&python, "none")).unwrap();
    assert!(again.image(None, PATIENCE, &CancelToken::default()).unwrap().is_some());

    drop(again);

    // As in the window: each thread asks the host, and the first one that finds the driver gone starts another.
    let spec = DriverCellSpec { robot: broken(&python, "none"), camera: None };
    let host = DriverHost::new(spec, options());
    let cancel = CancelToken::default();
    let again = host.cell(&cancel).unwrap().robot().clone();
    assert_eq!(host.cell(&cancel).unwrap().robot().hello(), again.hello(), "the same for all");
    let id = again.hello().name.rsplit(' ').next().unwrap().to_owned();
    assert!(Command::new("kill").args(["-s", "KILL", &id]).status().unwrap().success());
    let Ending::Exited { status, .. } = ending(&again) else { panic!("it was killed") };
    assert!(status.contains("signal: 9"), "{status}");
    drop(again);
    let another = host.cell(&cancel).unwrap();
    assert!(!another.robot().hello().name.ends_with(&id) && !another.robot().is_armed());
    another.robot().first_state(PATIENCE, &cancel).unwrap();

    let early = start(&broken(&python, "early exit")).unwrap_err().to_string();
    assert!(early.contains("No module named 'robot'"), "{early}");
    let nothing = start(&DriverSpec::Command(vec!["/there/is/no/such/program".to_owned()]));
    assert!(matches!(nothing, Err(DriverError::Start { .. })), "{nothing:?}");
}

#[test]
fn a_driver_that_is_killed_is_noticed_and_one_that_was_left_is_ended_with_all_it_started() {
    let Some(python) = python() else { return };
    let driver = start(&broken(&python, "child holds the pipe")).unwrap();
    assert!(matches!(ending(&driver), Ending::Exited { .. }), "the child still holds the pipe");

    let began = Instant::now();
    let stubborn = start(&broken(&python, "ignores the end")).unwrap();
    drop(stubborn);
    assert!(began.elapsed() < PATIENCE, "a driver that does not end is killed");
}

#[test]
fn what_a_driver_has_started_ends_with_it_also_when_it_has_left_the_group() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("children");
    let spec = command(&python, "tests/drivers/broken.py", &["children leave", &file.display().to_string()]);
    let is_alive = |id: &str| {
        let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        stat.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with(['Z', 'X']))
    };
    let kill = |id: &str| assert!(Command::new("kill").args(["-s", "KILL", id]).status().unwrap().success());
    for is_killed in [false, true] {
        let driver = start(&spec).unwrap();
        let ids = std::fs::read_to_string(&file).unwrap();
        let mut ids: Vec<&str> = ids.split_whitespace().collect();
        assert!(ids.len() == 3 && ids.iter().all(|id| is_alive(id)), "{ids:?}");
        if is_killed {
            kill(driver.hello().name.rsplit(' ').next().unwrap());
            assert!(matches!(ending(&driver), Ending::Exited { .. }));
            // Its parent process was gone before anybody looked.
            ids.pop().into_iter().for_each(kill);
        }
        drop(driver);
        let until = Instant::now() + PATIENCE;
        while ids.iter().any(|id| is_alive(id)) {
            assert!(Instant::now() < until, "{ids:?} outlive their driver");
            std::thread::yield_now();
        }
    }
}

#[test]
fn a_driver_that_no_longer_moves_the_arm_says_why_and_is_asked_for_no_motion() {
    let Some(python) = python() else { return };
    let driver = start(&broken(&python, "disarms")).unwrap();
    driver.first_state(PATIENCE, &CancelToken::default()).unwrap();
    driver.arm(true).unwrap();
    let until = Instant::now() + PATIENCE;
    while driver.is_armed() {
        assert!(Instant::now() < until, "it has said that it is not armed");
        std::thread::yield_now();
    }
    let goal = Goal::Joints(JointValues::from([0.2]));
    let refused = driver.move_to(&goal, 0.5, &CancelToken::default()).unwrap_err();
    let manual = "the pendant is in manual mode";
    assert!(matches!(&refused, DriverError::NotArmed { why: Some(why), .. } if why == manual), "{refused:?}");
    assert!(refused.to_string().contains(manual));
    assert!(driver.take_log().iter().any(|line| line.text.contains(manual)));
}

#[test]
fn a_driver_that_does_not_stop_the_arm_loses_its_connection() {
    let Some(python) = python() else { return };
    let driver = start(&broken(&python, "ignores stop")).unwrap();
    driver.first_state(PATIENCE, &CancelToken::default()).unwrap();
    driver.arm(true).unwrap();
    let cancel = CancelToken::default();
    cancel.cancel();
    let ended = driver.move_to(&Goal::Joints(JointValues::from([0.5])), 1.0, &cancel);
    assert!(matches!(ended, Err(DriverError::Gone { why: Ending::DoesNotStop, .. })), "{ended:?}");
    assert!(driver.check().is_err());
}

#[test]
fn what_is_no_message_ends_the_connection_with_the_line() {
    let Some(python) = python() else { return };
    for (fault, says) in [
        ("chatter", "message 1: not a message: standard output is for JSON messages alone"),
        ("long line", "longer than 65536 bytes"),
        ("deep", "not JSON: EOF while parsing"),
    ] {
        let error = start(&broken(&python, fault)).unwrap_err().to_string();
        assert!(error.contains(says), "{fault}: {error}");
    }
    let driver = start(&broken(&python, "nan")).unwrap();
    let Ending::Broken(error) = ending(&driver) else { panic!("NaN is no JSON") };
    assert!(error.to_string().contains("JSON has no NaN"), "{error}");
}

#[test]
fn images_of_one_driver_get_the_pose_of_another_whose_clock_is_elsewhere() {
    let Some(python) = python() else { return };
    let cancel = CancelToken::default();
    let part = |part, ahead| command(&python, "tests/drivers/clock.py", &[part, ahead]);
    let spec = DriverCellSpec { robot: part("robot", "0.08"), camera: Some(part("camera", "-1000")) };
    let cell = DriverCell::start(&spec, &options(), &cancel).unwrap();
    assert!(cell.is_two() && cell.camera().is_some());
    cell.robot().first_state(PATIENCE, &cancel).unwrap();
    let until = Instant::now() + PATIENCE;
    let clocks = loop {
        match cell.clock_difference() {
            Some(clocks) => break clocks,
            None => assert!(Instant::now() < until, "no pong has come"),
        }
        std::thread::yield_now();
    };
    let off_s = (clocks.robot_from_camera_s - 1000.08).abs();
    assert!(off_s <= clocks.uncertainty_s, "off by {off_s} s, stated {} s", clocks.uncertainty_s);

    let height_m = |time_s: f64| 0.5 + 0.2 * (std::f64::consts::PI * time_s).sin();
    // The fastest speed of the tip, and the deviation of the curve from a straight line between states up to 0.25 s
    // apart.
    let (fastest_m_s, curve_m_s2) = (0.2 * std::f64::consts::PI, 0.2 * std::f64::consts::PI.powi(2));
    let (mut after, mut compared, mut worst_m) = (None, 0, 0.0_f64);
    while compared < 40 {
        let frame = cell.frame(after, PATIENCE, &cancel).unwrap().unwrap();
        after = Some(frame.stamp_s);
        let bytes: Vec<u8> = frame.rgb.pixels().map(|pixel| pixel[0]).collect();
        let time_s = f64::from_le_bytes(bytes.try_into().unwrap());
        let Ok(robot) = frame.robot else { continue };
        let off_m = (robot.base_from_tip.translation().z - height_m(time_s)).abs();
        let gap_s = 0.25;
        let allowed_m = fastest_m_s * frame.time_uncertainty_s + curve_m_s2 * gap_s * gap_s / 8.0;
        assert!(off_m <= allowed_m, "off by {off_m} m, stated {allowed_m} m");
        worst_m = worst_m.max(off_m);
        compared += 1;
    }
    // Taken for one clock, 80 ms would be 50 mm.
    assert!(worst_m < 0.02, "{worst_m}");
}

/// A fake driver that listens, for this many workbenches one after the other; and its address.
fn listening_fake(options: FakeOptions, workbenches: usize) -> (DriverSpec, JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let spec = DriverSpec::Tcp(listener.local_addr().unwrap().to_string());
    let fake = Fake::start(options).unwrap();
    let thread = std::thread::spawn(move || {
        for _ in 0..workbenches {
            let (stream, _) = listener.accept().unwrap();
            let input = BufReader::new(stream.try_clone().unwrap());
            fake.converse(input, &stream).unwrap();
            stream.shutdown(Shutdown::Both).unwrap_or_default();
        }
    });
    (spec, thread)
}

#[test]
fn a_fake_cell_over_tcp_sees_its_board_and_goes_where_it_is_told_with_robot_and_camera_as_two_drivers() {
    let scene = Scene::reference().unwrap();
    let server = CellServer::start(CellConfig::new(scene.clone())).unwrap();
    let connect = Some(server.endpoint().parse().unwrap());
    let part =
        |part, clock_s| FakeOptions { connect: connect.clone(), part, clock_s, ..FakeOptions::new(scene.clone()) };
    let (robot, robot_thread) = listening_fake(part(FakePart::Robot, 0.0), 1);
    let (camera, camera_thread) = listening_fake(part(FakePart::Camera, 500.0), 1);
    let cancel = CancelToken::default();
    let cell = DriverCell::start(&DriverCellSpec { robot, camera: Some(camera) }, &options(), &cancel).unwrap();
    let chain = cell.robot().chain().unwrap();
    assert_eq!((chain.joint_count(), cell.robot().hello().joints.len()), (6, 6));

    let start = cell.robot().first_state(PATIENCE, &cancel).unwrap().reading.joints.unwrap();
    cell.robot().arm(true).unwrap();
    let goal = JointValues::from_fn(6, |i| start[i] + if i == 5 { 0.3 } else { 0.05 });
    assert_eq!(cell.robot().move_to(&Goal::Joints(goal), 1.0, &cancel).unwrap(), MoveEnd::Arrived);
    let mut after = None;
    let robot = loop {
        let frame = cell.frame(after, PATIENCE, &cancel).unwrap().unwrap();
        after = Some(frame.stamp_s);
        assert_eq!((frame.rgb.width(), frame.depth.as_ref().map(|depth| depth.width)), (640, Some(640)));
        assert!(frame.intrinsics.is_some_and(|lens| lens.validate().is_ok()));
        // Until the images are from the present position of the arm.
        match frame.robot {
            Ok(robot) if robot.moving == Some(false) && robot.speed_m_s < 1e-9 => break robot,
            _ => {}
        }
    };
    let joints = robot.joints.unwrap();
    assert!(goal.iter().zip(&joints).all(|(a, b)| (a - b).abs() < 1e-3), "{joints:?} and not {goal:?}");
    let (off_m, off_rad) = chain.forward(&joints).unwrap().distance_to(&robot.base_from_tip);
    assert!(off_m.is_finite() && off_rad.is_finite());

    let out_of_range = Goal::Joints(JointValues::from_fn(6, |_| 100.0));
    assert!(matches!(cell.robot().move_to(&out_of_range, 1.0, &cancel), Ok(MoveEnd::Refused(_))));
    drop(cell);
    robot_thread.join().unwrap();
    camera_thread.join().unwrap();
}

/// A fault of `broken.py`, and what a report contains about it.
const FAULTS: &[(&str, &str)] = &[
    ("early exit", "ended (exit status: 1): ModuleNotFoundError"),
    ("silent", "has not answered `hello` within"),
    ("chatter", "print to standard error"),
    ("empty line", "an empty line: each line is one message"),
    ("not JSON", "not JSON: key must be a string"),
    ("not UTF-8", "not UTF-8"),
    ("no type", "missing field `type`"),
    ("a list", "standard output is for JSON messages alone"),
    ("long line", "longer than 65536 bytes"),
    ("deep", "not JSON: EOF while parsing"),
    ("cut line", "the output ended before the end of the line"),
    ("early state", "only hello, log and error come before hello"),
    ("protocol 2", "protocol: 2, this workbench speaks 1"),
    ("state without can", "a state without `state` in `can`"),
    ("joints without joints", "can: joints needs joints"),
    ("nothing in can", "`can` has neither `state` nor `image`"),
    ("no can", "hello: missing field `can`"),
    ("arm of no name", "arm: ur99 is not built in"),
    ("another arm", "arm: the chain has 6 joints and `joints` has 1"),
    ("bytes after hello", "only image and depth are followed by bytes"),
    ("two hellos", "a second hello"),
    ("image that nobody asked for", "asks for no image"),
    ("answers nobody", "id 4711 is of no request that waits for an answer"),
    ("gives up", "gave up: the controller is in protective stop"),
    ("dies", "ended (exit status: 3): Traceback"),
    ("closes its output", "closed the connection"),
    ("does not read", "no `ping` is answered"),
    ("no pong", "no `ping` is answered"),
    ("one pong", "only the first `ping` is answered"),
    ("pong id", "is of no ping that waits for an answer"),
    ("milliseconds", "in milliseconds, seconds are needed"),
    ("nan", "JSON has no NaN"),
    ("no stamp", "state: missing field `stamp`"),
    ("text for a number", "state: invalid type: string \"now\""),
    ("quaternion", "rotation_xyzw has the norm 2.0000"),
    ("millimetres", "metres are needed and not millimetres"),
    ("degrees", "lift is at 90, outside 0 to 0.5: radians and metres are needed"),
    ("stamps back", "stamps never go back"),
    ("frozen stamps", "all have the stamp 100"),
    ("other clock", "s later than this pong, which came after it"),
    ("too many joints", "2 values, where hello has 1 joints"),
    ("no pose", "nothing else says where the tip is"),
    ("no states", "has not answered with a state"),
    ("slow states", "at least 10 are needed"),
    ("no images", "`next_image` with after null is not answered"),
    ("jpeg", "the image is no JPEG that can be read"),
    ("png of another size", "the PNG is 32×48 and its message says 64×48"),
    ("image of another size", "it is 128×48 and the camera of hello 64×48"),
    ("encoding", "unknown variant `yuv422`"),
    ("old image", "is not after"),
    ("image of three seconds ago", "s before the present by the stamps of `pong`"),
    ("camera blocks states", "an image has no pose of the robot"),
    ("trembles", "its states have too much noise"),
    ("image id", "asks for no image"),
    ("two images", "asks for no image"),
    ("wrong length", "bytes: 9216, where width, height and encoding make 3072"),
    ("endless image", "at most 67108864"),
    ("too few bytes", "it follows the 3072 bytes of the message before, of which there may be more or fewer"),
    ("too many bytes", "not UTF-8: it follows the 3072 bytes of the message before"),
    ("cut image", "the output ended after 100 of 3072 bytes"),
    ("dies of what it does not know", "after a message of an unknown type"),
    ("moves unarmed", "`move` was accepted before `arm`"),
    ("does not arm", "it refuses to be armed: the key is in local mode"),
    ("does not answer move", "has not answered `move` with accepted or refused"),
    ("stops short", "mm from the goal: 2 mrad and 2 mm at the most"),
    ("ignores stop", "did not come to rest after `stop`"),
    ("ignores silence", "a second of silence does not end a motion"),
    ("ignores the end", "does not end within 1 s after its standard input is closed"),
];

/// Faults that a run without `--allow-motion` does not meet.
const IN_MOTION: &[&str] = &["does not arm", "does not answer move", "stops short", "ignores stop", "ignores silence"];

fn report(spec: &DriverSpec, allow_motion: bool) -> Report {
    let options = ConformanceOptions { allow_motion, driver: options() };
    conformance::run(spec, &options, &CancelToken::default()).unwrap()
}

mod slow {
    use std::sync::Mutex;

    use super::*;

    #[test]
    fn the_template_passes_the_conformance_test() {
        let Some(python) = python() else { return };
        let report = report(&command(&python, "../../assets/drivers/template.py", &[]), true);
        assert!(report.passed, "{}", report.text());
        assert!(!report.text().contains("warning"), "{}", report.text());
    }

    #[test]
    fn the_fake_driver_passes_the_conformance_test_over_tcp() {
        let (spec, thread) = listening_fake(FakeOptions::new(Scene::reference().unwrap()), 2);
        let report = report(&spec, true);
        assert!(report.passed, "{}", report.text());
        thread.join().unwrap();
    }

    #[test]
    fn a_driver_that_floods_its_log_and_standard_error_passes_all_the_same() {
        let Some(python) = python() else { return };
        for fault in ["floods standard error", "floods log"] {
            let report = report(&broken(&python, fault), false);
            assert!(report.passed, "{fault}: {}", report.text());
        }
    }

    #[test]
    fn every_broken_driver_is_told_what_is_wrong_and_none_moves_or_hangs() {
        let Some(python) = python() else { return };
        let folder = tempfile::tempdir().unwrap();
        let wait = DriverOptions { hello: Duration::from_secs(8), ..DriverOptions::default() };
        let queue = Mutex::new(FAULTS.iter());
        let failures = Mutex::new(Vec::new());
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    while let Some((fault, says)) = { queue.lock().unwrap().next() } {
                        let mark = folder.path().join(fault);
                        let allow_motion = IN_MOTION.contains(fault);
                        let mark_text = mark.display().to_string();
                        let spec = command(&python, "tests/drivers/broken.py", &[fault, &mark_text]);
                        let options = ConformanceOptions { allow_motion, driver: wait.clone() };
                        let began = Instant::now();
                        let report = conformance::run(&spec, &options, &CancelToken::default()).unwrap();
                        let text = report.text();
                        let is_reported = !report.passed && text.contains(says);
                        let is_still = allow_motion || !mark.exists();
                        let is_quick = began.elapsed() < Duration::from_mins(1);
                        if !(is_reported && is_still && is_quick) {
                            let what =
                                format!("{fault} (still {is_still}, {:?}): wanted {says}\n{text}", began.elapsed());
                            failures.lock().unwrap().push(what);
                        }
                    }
                });
            }
        });
        let failures = failures.into_inner().unwrap();
        assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), FAULTS.len(), failures.join("\n"));
    }
}
