use nalgebra::{Isometry3, Vector2, Vector3};

use super::{Machine, NO_IMAGES_S, Plan, Progress, Refusal, RobotRate, Wait};
use crate::instant_for_tests::Instant;
use handeye_geometry::frames::Pose;
use handeye_geometry::targets::observation::Corner;
use handeye_simulate::flat_board::{Board, image};

/// When the capture is requested; image 0 arrives at 100 s and one every 0.05 s after.
const REQUESTED_S: f64 = 100.0;
const JOINTS: [f64; 6] = [0.1, 0.5, -1.0, 0.0, 1.5, -3.1];

fn plan(frames: u32) -> Plan {
    Plan {
        frames,
        settle_limit_s: 3.0,
        least_distance_m: 0.005,
        least_angle_rad: 1.0_f64.to_radians(),
        others: Vec::new(),
    }
}

/// Feeds image after image until it ends; the progress after each.
fn run(machine: &mut Machine, instants: impl Iterator<Item = Instant>) -> Vec<Progress> {
    let mut all = Vec::new();
    for instant in instants {
        let progress = machine.see(&instant.shot());
        all.push(progress);
        if !matches!(progress, Progress::Waits(_)) {
            break;
        }
    }
    all
}

/// Images of a board at rest, or wherever `shift_px` puts it, with noise.
fn images(noise: f64, shift_px: impl Fn(u64) -> f64) -> impl Iterator<Item = Instant> {
    (0..100).map(move |number| {
        let board = Board { origin: Board::new().origin + Vector2::new(shift_px(number), 0.0), ..Board::new() };
        Instant::new(number, &JOINTS, image(board.size, &board.levels(), noise, number))
    })
}

#[test]
fn a_robot_at_rest_is_captured_in_the_fourth_image_after_the_request() {
    for noise in [0.0, 2.0, 10.0] {
        let mut machine = Machine::new(plan(1), REQUESTED_S);
        let progress = run(&mut machine, images(noise, |_| 0.0));
        let waiting = Progress::Waits(Wait::ForImage);
        assert_eq!(progress, [waiting, waiting, waiting, Progress::Complete], "noise of {noise} levels");
        let taken = machine.finish().expect("complete");
        assert_eq!(taken.frames, 1);
        assert!((taken.settled_s - 0.15).abs() < 1e-9, "{} s", taken.settled_s);
        assert_eq!(taken.corner_noise_px, None, "one image has no scatter");
    }
}

#[test]
fn images_from_before_the_request_do_not_count() {
    let mut machine = Machine::new(plan(1), REQUESTED_S + 10.0 * 0.05 - 0.01);
    let progress = run(&mut machine, images(1.0, |_| 0.0));
    assert_eq!(progress.len(), 14, "ten that were there, four that were not");
}

#[test]
fn nothing_is_captured_while_a_joint_moves() {
    // At the limit of what rests, a tenth above, and coming to rest after a second.
    let at = |rate: f64, until: u64| {
        move |number: u64| {
            let mut joints = JOINTS;
            joints[5] -= rate * 0.05 * number.min(until) as f64;
            joints
        }
    };
    let feed = |joints: &dyn Fn(u64) -> [f64; 6]| {
        let mut machine = Machine::new(plan(1), REQUESTED_S);
        let moving: Vec<Instant> = images(1.0, |_| 0.0)
            .map(|instant| Instant { joints_rad: joints(instant.number).to_vec(), ..instant })
            .collect();
        run(&mut machine, moving.into_iter())
    };
    assert_eq!(feed(&at(0.9e-3, 1000)).last(), Some(&Progress::Complete));
    let refused = feed(&at(1.1e-3, 1000));
    let Some(Progress::Refused(Refusal::RobotMoves { after_s, rate: RobotRate::Joint(rate_rad_s) })) = refused.last()
    else {
        panic!("{refused:?}")
    };
    assert!((3.0..3.1).contains(after_s) && (rate_rad_s - 1.1e-3).abs() < 1e-9, "{refused:?}");
    assert_eq!(refused[1], Progress::Waits(Wait::RobotMoves));
    // The joint turns through half a turn on its way, which is not a jump.
    let settles = feed(&at(0.2, 20));
    assert_eq!(settles.last(), Some(&Progress::Complete));
    assert_eq!(settles.len(), 24, "image 20 is where it stands, and three more");
}

#[test]
fn a_joint_that_is_no_number_never_rests() {
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    let broken = images(1.0, |_| 0.0).map(|instant| Instant { joints_rad: vec![f64::NAN; 6], ..instant });
    let progress = run(&mut machine, broken);
    assert!(matches!(progress.last(), Some(Progress::Refused(Refusal::RobotMoves { .. }))), "{progress:?}");
}

#[test]
fn an_image_that_comes_late_is_waited_for() {
    // The joints are at rest, the image follows: it drifts, then jumps once more, then rests from image 12 on.
    for noise in [0.0, 2.0] {
        let drift = |number: u64| if number < 12 { 0.1 * number as f64 } else { 2.0 };
        let mut machine = Machine::new(plan(1), REQUESTED_S);
        let progress = run(&mut machine, images(noise, drift));
        assert!(progress.contains(&Progress::Waits(Wait::ImageChanges)), "{progress:?}");
        assert_eq!(progress.last(), Some(&Progress::Complete));
        assert_eq!(progress.len(), 16, "noise {noise}: images 12 to 15 are alike");
    }
}

#[test]
fn an_image_that_never_rests_is_refused_after_the_limit_and_noise_or_flicker_are_no_change() {
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    let progress = run(&mut machine, images(2.0, |number| 0.05 * number as f64));
    assert!(matches!(progress.last(), Some(Progress::Refused(Refusal::ImageChanges { .. }))), "{progress:?}");

    let board = Board::new();
    let levels = board.levels();
    // A lamp on mains: brightness up and down by a fifth.
    let flickering = (0..100).map(|number| {
        let gain = 1.0 + 0.2 * (2.1 * number as f64).sin();
        let levels: Vec<f64> = levels.iter().map(|level| level * gain).collect();
        Instant::new(number, &JOINTS, image(board.size, &levels, 1.5, number))
    });
    let mut machine = Machine::new(plan(8), REQUESTED_S);
    let progress = run(&mut machine, flickering);
    assert_eq!((progress.len(), progress.last()), (11, Some(&Progress::Complete)), "{progress:?}");
}

#[test]
fn what_moves_while_images_are_averaged_starts_it_anew() {
    for by_joint in [true, false] {
        // At rest, then elsewhere from image 8 on: a joint by 0.01°, or the image by a third of a pixel.
        let mut machine = Machine::new(plan(10), REQUESTED_S);
        let shift = move |number: u64| if number >= 8 && !by_joint { 0.3 } else { 0.0 };
        let moved = images(1.0, shift).map(move |mut instant| {
            if by_joint && instant.number >= 8 {
                instant.joints_rad[2] += 0.01_f64.to_radians();
            }
            instant
        });
        let progress = run(&mut machine, moved);
        let averaging = |done| Progress::Waits(Wait::Averaging { done, of: 10 });
        assert_eq!(progress[7], averaging(5));
        let wait = if by_joint { Wait::RobotMoves } else { Wait::ImageChanges };
        assert_eq!(progress[8], Progress::Waits(wait));
        assert_eq!(progress.last(), Some(&Progress::Complete));
        // Images 8 to 11 show that it rests, 11 to 20 are the ten.
        assert_eq!(progress.len(), 21, "{progress:?}");
    }
}

#[test]
fn a_slow_creep_is_no_rest_however_slow() {
    // 0.2 mrad/s is below the limit between two images and 0.2 mm at 1 m over a second.
    let mut machine = Machine::new(plan(30), REQUESTED_S);
    let creeping = images(1.0, |_| 0.0).map(|mut instant| {
        instant.joints_rad[1] += 0.2e-3 * instant.sim_time_s;
        instant
    });
    let progress = run(&mut machine, creeping.take(60));
    assert!(!progress.contains(&Progress::Complete), "{progress:?}");
}

#[test]
fn a_simulation_that_rests_is_told_from_a_camera_that_is_gone() {
    let still = || images(1.0, |_| 0.0);
    // No image at all.
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    assert_eq!(machine.pass_time(REQUESTED_S + NO_IMAGES_S - 0.1, None), Progress::Waits(Wait::ForImage));
    assert_eq!(machine.pass_time(REQUESTED_S + NO_IMAGES_S + 0.1, None), Progress::Refused(Refusal::NoImages));
    // The camera answers, and has no new image.
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    assert_eq!(
        machine.pass_time(REQUESTED_S + NO_IMAGES_S + 0.1, Some(REQUESTED_S + NO_IMAGES_S)),
        Progress::Refused(Refusal::Paused),
        "it was heard after the request"
    );
    // Images come, all of the same instant.
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    for instant in still().map(|instant| Instant { sim_time_s: 7.0, ..instant }) {
        machine.see(&instant.shot());
        machine.pass_time(instant.received_s, None);
    }
    let later_s = REQUESTED_S + NO_IMAGES_S + 1.0;
    assert_eq!(machine.pass_time(later_s, Some(later_s)), Progress::Refused(Refusal::Paused));
    // It stops in the middle of an average.
    let mut machine = Machine::new(plan(10), REQUESTED_S);
    let progress = run(&mut machine, still().take(6));
    assert_eq!(progress.last(), Some(&Progress::Waits(Wait::Averaging { done: 3, of: 10 })));
    assert_eq!(machine.pass_time(REQUESTED_S + NO_IMAGES_S + 0.4, None), Progress::Refused(Refusal::NoImages));
}

#[test]
fn a_simulation_started_anew_in_between_is_waited_for() {
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    let restarted = images(1.0, |_| 0.0).map(|instant| match instant.number {
        0..=2 => Instant { sim_time_s: 50.0 + instant.sim_time_s, ..instant },
        _ => instant,
    });
    let progress = run(&mut machine, restarted);
    assert_eq!((progress.len(), progress.last()), (7, Some(&Progress::Complete)));
    assert!(machine.finish().expect("complete").settled_s < 0.3);
}

#[test]
fn a_simulation_that_races_is_given_enough_images() {
    // 4 s pass from image to image, more than the limit.
    let racing = || images(1.0, |_| 0.0).map(|instant| Instant { sim_time_s: 4.0 * instant.number as f64, ..instant });
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    assert_eq!(run(&mut machine, racing()).len(), 4);
    let mut machine = Machine::new(plan(1), REQUESTED_S);
    let progress = run(
        &mut machine,
        racing().map(|mut instant| {
            instant.joints_rad[0] += 0.1 * instant.number as f64;
            instant
        }),
    );
    assert_eq!(progress.len(), 8);
    assert!(matches!(progress[7], Progress::Refused(Refusal::RobotMoves { .. })), "{progress:?}");
}

#[test]
fn a_pose_that_there_is_already_is_named_with_its_distance() {
    let at = |x_m: f64, turn_deg: f64| {
        Pose::from_isometry(Isometry3::new(Vector3::new(x_m, 0.0, 0.0), Vector3::z() * turn_deg.to_radians()))
    };
    let refused = |others: Vec<(u32, _)>| {
        let mut machine = Machine::new(Plan { others, ..plan(1) }, REQUESTED_S);
        match run(&mut machine, images(1.0, |_| 0.0)).last() {
            Some(Progress::Refused(Refusal::TooSimilar(similar))) => Some(*similar),
            _ => None,
        }
    };
    let similar = refused(vec![(3, at(0.004, 0.9)), (9, at(0.002, 0.5)), (4, at(0.3, 0.0))]).expect("similar");
    assert_eq!(similar.id, 9);
    assert!((similar.distance_m - 0.002).abs() < 1e-12 && (similar.angle_rad.to_degrees() - 0.5).abs() < 1e-9);
    assert_eq!(refused(vec![(1, at(0.006, 0.0)), (2, at(0.0, 1.1))]), None, "near in one of the two only");
}

#[test]
fn the_average_has_its_images_and_their_scatter_and_no_others() {
    let mut machine = Machine::new(plan(16), REQUESTED_S);
    let corner = |number: u64| Corner::new(0, Vector2::new(if number.is_multiple_of(2) { 1.0 } else { -1.0 }, 5.0));
    let mut sum = 0.0;
    for instant in images(3.0, |_| 0.0) {
        let progress = machine.see(&instant.shot());
        machine.saw_board(instant.number, &[corner(instant.number)]);
        // A second look at an image that is not in the average does not count.
        machine.saw_board(instant.number + 1, &[corner(7), Corner::new(0, Vector2::new(900.0, 0.0))]);
        if instant.number >= 3 {
            sum += f64::from(instant.grey.get_pixel(5, 5).0[0]);
        }
        if progress == Progress::Complete {
            break;
        }
    }
    let taken = machine.finish().expect("complete");
    assert_eq!(taken.frames, 16);
    let mean = f64::from(taken.rgb.get_pixel(5, 5).0[0]);
    assert!((mean - sum / 16.0).abs() <= 0.5, "{mean}, {sum}");
    // ±1 in u with 15 degrees of freedom, nothing in v: σ² = 16 / 30.
    assert!((taken.corner_noise_px.expect("16 images") - (16.0_f64 / 30.0).sqrt()).abs() < 1e-12);
    let depth = taken.depth.expect("every image had one");
    assert_eq!(depth.metres[0], 0.5);
    assert!(depth.metres[1].is_nan(), "a hole stays one");
}

#[test]
fn a_robot_that_reports_no_joints_is_watched_by_its_tip_and_a_camera_without_depth_is_averaged() {
    // At the limit of what rests, and a tenth above, along the tip's x and about it.
    let feed = |m_s: f64, rad_s: f64| {
        let mut machine = Machine::new(plan(2), REQUESTED_S);
        let instants = images(1.0, |_| 0.0).map(|instant| {
            let passed_s = 0.05 * instant.number as f64;
            let moved = Isometry3::new(Vector3::x() * m_s * passed_s, Vector3::x() * rad_s * passed_s);
            Instant { joints_rad: Vec::new(), base_from_tip: Pose::from_isometry(moved), depth: None, ..instant }
        });
        let progress = run(&mut machine, instants);
        (progress.last().copied(), machine.finish())
    };
    let (progress, taken) = feed(0.99e-3 / 2.0, 0.99e-3 / 2.0);
    assert_eq!(progress, Some(Progress::Complete));
    assert_eq!(taken.map(|taken| (taken.frames, taken.depth)), Some((2, None)));
    for (m_s, rad_s) in [(1.1e-3, 0.0), (0.0, 1.1e-3)] {
        let (Some(Progress::Refused(Refusal::RobotMoves { rate: RobotRate::Tip { m_s: m, rad_s: rad }, .. })), _) =
            feed(m_s, rad_s)
        else {
            panic!("it moves");
        };
        assert!((m - m_s).abs() < 1e-9 && (rad - rad_s).abs() < 1e-9, "{m} m/s, {rad} rad/s");
    }
}
