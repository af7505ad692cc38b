use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::judged::upper_level;
use super::*;
use crate::testing::clutter::{Tally, session};
use crate::testing::guided_cell::{CellArm, CellSetup, GuidedCell, HiddenErrors, Places};
use crate::{ArmBody, Carried, Surroundings};
use handeye_arm::ArmKind;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::stated_uncertainty::Alternative;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::Links;
use handeye_simulate::session::{REALISTIC, camera};

fn at_upper_levels_m(calibration: &Calibration) -> Option<f64> {
    JudgedError::of(calibration, 1e-3, None).map(|error| error.at_upper_levels_m)
}

fn options(goal_m: f64) -> GuidedOptions {
    GuidedOptions { goal_m, candidates: 300, ..GuidedOptions::default() }
}

#[test]
fn from_one_view_of_the_board_the_goal_is_reached_on_three_arms_with_the_camera_on_the_arm_and_beside_it() {
    let goal_m = 2e-4;
    for arm in CellArm::ALL {
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            for seed in 0..2 {
                let mut cell = GuidedCell::new(CellSetup::new(arm, mode, seed));
                let run = cell.run(options(goal_m));
                let Ending::GoalReached { promised } = run.ending else {
                    panic!("{arm:?} {mode:?} {seed}: {:?}", run.ending)
                };
                assert!(promised.error_m <= goal_m);
                let (views, _, true_m) = *run.history.last().expect("it was solved");
                assert!(views <= 16, "{arm:?} {mode:?} {seed}: {views} views");
                assert!(true_m < 2.0 * goal_m, "{arm:?} {mode:?} {seed}: {true_m} m off");
                assert!(run.failed <= 2, "{arm:?} {mode:?} {seed}: the board left the image {} times", run.failed);
            }
        }
    }
}

/// Link errors of a usual arm whose controller uses the data sheet.
const LINKS: HiddenErrors = HiddenErrors { links: Some((1.2e-3, 2.5e-4)), ..HiddenErrors::NOTHING };
/// A robot that repeats well.
const PRECISE: Noise = Noise { robot_m: 2e-5, robot_rad: 4e-5, ..REALISTIC };

#[test]
fn an_arm_whose_links_are_off_reaches_the_goal_by_corrected_commands() {
    let (goal_m, mut by_arm, mut all, mut beyond) = (3e-4, 0, 0, 0);
    for (arm, mode) in
        [(CellArm::Ur5e, Mode::EyeInHand), (CellArm::Panda, Mode::EyeInHand), (CellArm::Xarm6, Mode::EyeToHand)]
    {
        let mut cell = GuidedCell::new(CellSetup { hidden: LINKS, noise: PRECISE, ..CellSetup::new(arm, mode, 3) });
        let run = cell.run(options(goal_m));
        let Ending::GoalReached { promised } = run.ending else { panic!("{arm:?} {mode:?}: {:?}", run.ending) };
        assert_eq!(
            promised.of,
            Promise::ReachCorrected,
            "{arm:?} {mode:?}: by commands as they are it is out of reach"
        );
        let calibration = run.calibration.expect("it was solved");
        let touches = cell.touches_m(&calibration);
        let off = touches.iter().filter(|m| **m > promised.error_m).count();
        (all, beyond) = (all + touches.len(), beyond + off);
        let views = cell.observations.views.len();
        println!("{arm:?} {mode:?}: {views} views, {touches:?}, promised {promised:?}");
        assert!(views <= 25, "{arm:?} {mode:?}: {views} views");
        by_arm += run.steps.iter().filter(|step| matches!(step.why, Why::Gain { part: Part::Arm, .. })).count();
    }
    assert!(by_arm > 3, "{by_arm} views were chosen by the errors of the arm");
    // One in twenty; five of thirty by chance once in seventy.
    assert!(all >= 20 && beyond <= 4, "{beyond} of {all} touches are farther off than was promised");
}

#[test]
fn a_goal_below_what_the_arm_repeats_is_said_to_be() {
    let setup = CellSetup { hidden: LINKS, ..CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 3) };
    let run = GuidedCell::new(setup).run(GuidedOptions { most_views: 12, ..options(5e-5) });
    let Ending::Repeatability { promised } = run.ending else { panic!("{:?}", run.ending) };
    assert!(promised.least_m > 5e-5 && promised.least_m < promised.error_m, "{promised:?}");
}

#[test]
fn an_unknown_lens_is_estimated_on_the_way() {
    for (seed, mode) in [(4, Mode::EyeInHand), (5, Mode::EyeInHand), (6, Mode::EyeToHand)] {
        let mut cell = GuidedCell::new(CellSetup { free_lens: true, ..CellSetup::new(CellArm::Ur5e, mode, seed) });
        let run = cell.run(options(8e-4));
        assert!(matches!(run.ending, Ending::GoalReached { .. }), "{:?} {:?}", run.ending, run.history);
        let camera = run.calibration.and_then(|it| it.camera).expect("a lens");
        let sigma_px = camera.sigma_px.expect("it was estimated")[0];
        let off_px = (camera.intrinsics.fx - 581.0).abs();
        // One in 16,000 by chance.
        assert!(off_px < 4.0 * sigma_px && sigma_px < 2.0, "{off_px} px, stated {sigma_px} px");
    }
}

/// The board straight on and near the edge of the image leaves room for turns that determine no lens.
#[test]
fn a_board_near_the_edge_of_the_image_is_tilted_by_a_rough_answer_until_the_lens_is_known() {
    // Lenses of 85°, 58° and 33°, where 53° is guessed.
    for (arm, mode, focal_px, seed) in [
        (CellArm::Ur5e, Mode::EyeInHand, 581.0, 4),
        (CellArm::Panda, Mode::EyeInHand, 350.0, 5),
        (CellArm::Xarm6, Mode::EyeInHand, 1100.0, 6),
        (CellArm::Ur5e, Mode::EyeToHand, 350.0, 7),
    ] {
        let setup = CellSetup { free_lens: true, straight: Some(focal_px), ..CellSetup::new(arm, mode, seed) };
        let mut cell = GuidedCell::new(setup);
        let run = cell.run(options(1.5e-3));
        let tilts = run.steps.iter().filter(|step| matches!(step.why, Why::FirstTilts { .. })).count();
        assert!(
            matches!(run.ending, Ending::GoalReached { .. }),
            "{arm:?} {mode:?} {:?} {:?}",
            run.ending,
            run.history
        );
        assert!((1..=6).contains(&tilts) && run.failed <= 2, "{arm:?} {mode:?}: {tilts} tilts, {} failed", run.failed);
    }
}

/// The arm with a board on its tip, and a camera on the side of its base, with the arm between both in many poses.
fn camera_at_the_base(seed: u64) -> Option<GuidedCell> {
    let part = |k: u64| ((seed * 37 + k * 101) % 97) as f64 / 97.0 - 0.5;
    let chain = ArmKind::Ur5e.arm();
    let board_at = Vector3::new(0.45 + 0.1 * part(1), 0.2 * part(2), 0.45 + 0.1 * part(3));
    let eye = board_at + Vector3::new(-0.35, 0.5 * part(4), 0.25 + 0.2 * part(5));
    let base_from_camera = Isometry3::face_towards(&eye.into(), &board_at.into(), &Vector3::z());
    let on_tip = Isometry3::from_parts(
        Vector3::new(0.0, 0.0, 0.05).into(),
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI),
    ) * Translation3::from(-BOARD.centre().coords);
    let seen_first =
        Isometry3::translation(0.0, 0.0, (board_at - eye).norm()) * Translation3::from(-BOARD.centre().coords);
    let arm = crate::Arm {
        body: ArmBody::of(&chain),
        chain,
        world_from_arm: Isometry3::identity(),
        connection_from_tip: Isometry3::identity(),
        carried: Vec::new(),
    };
    let first_tip = Pose::from_isometry(base_from_camera * seen_first * on_tip.inverse());
    let joints = arm.reach(&first_tip, &[std::f64::consts::PI, -1.6, 1.9, -1.9, -1.57, 0.0])?;
    let places = Places {
        arm,
        joints,
        around: Surroundings::default(),
        links: Links {
            mode: Mode::EyeToHand,
            mount_from_camera: Pose::from_isometry(base_from_camera),
            anchor_from_target: Pose::from_isometry(on_tip),
        },
        intrinsics: camera(),
    };
    GuidedCell::placed(CellSetup::new(CellArm::Ur5e, Mode::EyeToHand, seed), places)
}

/// Whether a link other than the last is between the camera and a corner of the board, checked point by point.
fn is_hidden(cell: &GuidedCell, joints: &[f64]) -> bool {
    let chain = &cell.robot.arm.chain;
    let frames = chain.frames(joints).expect("its joints");
    let at: Vec<Isometry3<f64>> = handeye_arm::links::arm_from_links(&frames).collect();
    let links = handeye_arm::links::capsules(chain);
    let last = links.iter().map(|link| link.link).max();
    let eye = Point3::from(cell.links.mount_from_camera.translation());
    let tip = cell.robot.arm.tip(joints).expect("its joints");
    BOARD.points().iter().any(|point| {
        let corner = tip.isometry() * cell.links.anchor_from_target.isometry() * point;
        (5..95).any(|percent| {
            let here = eye + (corner - eye) * (f64::from(percent) / 100.0);
            links.iter().filter(|link| Some(link.link) != last).any(|link| {
                let (from, to) = (at[link.link] * link.from, at[link.link] * link.to);
                let along = (to - from).dot(&(here - from)) / (to - from).norm_squared();
                (here - (from + (to - from) * along.clamp(0.0, 1.0))).norm() < link.radius_m
            })
        })
    })
}

/// No image shows the board through a forearm.
#[test]
fn no_pose_is_proposed_with_the_arm_between_camera_and_board() {
    let (mut cells, mut poses) = (0, 0);
    for cell in (0..60).filter_map(camera_at_the_base) {
        if is_hidden(&cell, &cell.robot.joints) {
            // Blocked as it was placed; a person would have moved it.
            continue;
        }
        let run = cell.clone().run(GuidedOptions { most_views: 8, ..options(1e-9) });
        cells += 1;
        for step in &run.steps {
            let joints = step.joints.expect("the chain is known");
            assert!(!is_hidden(&cell, &joints), "pose {poses} of cell {cells}: {joints:?}");
            poses += 1;
        }
        if cells == 6 {
            break;
        }
    }
    assert!(cells >= 3 && poses >= 20, "{poses} poses in {cells} cells are too few to say so");
}

/// The place of the camera is unknown at first, so the arm hardly moves.
#[test]
fn the_first_moves_are_small_and_grow_with_what_is_known() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, mode, 6));
        let first = cell.base_from_tip();
        let _run = cell.run(GuidedOptions { most_views: 9, ..options(1e-9) });
        let turns: Vec<f64> = cell
            .observations
            .views
            .iter()
            .map(|view| view.base_from_tip.expect("a robot").rotation().angle_to(&first.rotation()).to_degrees())
            .collect();
        assert!(turns[1..3].iter().all(|turn| *turn < 15.0), "{mode:?} {turns:?}");
        assert!(turns[3] < 80.0, "{mode:?} {turns:?}");
        assert!(turns.iter().copied().fold(0.0, f64::max) > 45.0, "{mode:?} {turns:?}");
    }
}

#[test]
fn a_goal_out_of_reach_ends_when_more_views_are_not_worth_it_or_are_not_allowed() {
    let run = |options| GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1)).run(options);
    let Ending::LittleToGain { gain } = run(options(1e-9)).ending else { panic!("it never ends") };
    assert!((0.0..LEAST_GAIN).contains(&gain));
    let few = run(GuidedOptions { most_views: 6, ..options(1e-9) });
    assert_eq!(few.ending, Ending::MostViews);
    assert_eq!(few.history.last().map(|point| point.0), Some(6));
    assert_eq!(run(GuidedOptions { most_s: 5.0, ..options(1e-9) }).ending, Ending::MostTime);
}

#[test]
fn two_runs_of_one_seed_are_the_same_and_promises_are_kept() {
    let run = || GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 2)).run(options(1.5e-4));
    let (a, b) = (run(), run());
    assert_eq!(a.history, b.history);
    let mut ratios: Vec<f64> = a.steps.iter().filter_map(Step::achieved_over_promised).collect();
    ratios.sort_by(f64::total_cmp);
    assert!(ratios.len() >= 5, "{:?}", a.steps);
    let median = ratios[ratios.len() / 2];
    assert!((0.6..1.6).contains(&median), "{ratios:?}");
}

#[test]
fn a_pose_that_failed_is_not_proposed_again_and_many_in_a_row_end_it_as_a_lost_answer_does() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 3));
    let _begun = cell.run(GuidedOptions { most_views: 5, ..options(1e-9) });
    let calibration = cell.calibrate();
    let known = cell.known(calibration.as_ref(), 0.0);
    let mut guide = Guide::new(options(1e-9));
    let mut tried: Vec<Pose<Base, Tip>> = Vec::new();
    for _ in 0..MOST_FAILURES {
        let Next::Go { plan, .. } = guide.next(&known, &CancelToken::default()) else { panic!("there is more") };
        let next = plan.proposals[0].base_from_tip;
        for before in &tried {
            let (m, rad) = before.distance_to(&next);
            assert!(m >= 0.04 || rad >= 8_f64.to_radians(), "{m} m and {rad} rad from one that failed");
        }
        guide.failed();
        tried.push(next);
    }
    let lost = guide.next(&known, &CancelToken::default());
    assert_eq!(lost, Next::End(Ending::BoardLost { poses: MOST_FAILURES }));

    // Without an answer the arm does not go back to the first turns from its present place.
    let mut guide = Guide::new(options(1e-9));
    assert!(matches!(guide.next(&known, &CancelToken::default()), Next::Go { .. }));
    guide.captured();
    let without = Known { calibration: None, ..known };
    assert_eq!(guide.next(&without, &CancelToken::default()), Next::End(Ending::AnswerLost));
}

/// A view that is left out as an outlier adds no information: the next proposal is another one.
#[test]
fn a_view_that_is_an_outlier_is_not_proposed_again() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 8));
    let _begun = cell.run(GuidedOptions { most_views: 10, ..options(1e-9) });
    let mut guide = Guide::new(options(1e-9));
    let mut proposed: Vec<Pose<Base, Tip>> = Vec::new();
    for _ in 0..3 {
        let calibration = cell.calibrate();
        let known = cell.known(calibration.as_ref(), 0.0);
        let Next::Go { plan, .. } = guide.next(&known, &CancelToken::default()) else { panic!("there is more") };
        let next = plan.proposals[0].base_from_tip;
        if let Some(before) = proposed.last() {
            let (m, rad) = before.distance_to(&next);
            assert!(m >= 0.04 || rad >= 8_f64.to_radians(), "{m} m and {rad} rad from the outlier");
        }
        // The one before was an outlier, and its neighbourhood is barred.
        assert_eq!(guide.failed, proposed);
        proposed.push(next);
        assert!(cell.capture(&plan.proposals[0].joints.expect("a chain")));
        // The robot reported a pose that is off by 3 cm.
        let view = cell.observations.views.last_mut().expect("it was captured");
        let off = nalgebra::Vector6::new(0.03, -0.02, 0.02, 0.0, 0.0, 0.0);
        view.base_from_tip = view.base_from_tip.map(|pose| pose.perturbed(&off));
        guide.captured();
    }
}

#[test]
fn a_board_that_is_never_seen_again_and_an_arm_that_touches_something_end_with_the_reason() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 5));
    let first = cell.robot.joints;
    let next = |guide: &mut Guide, cell: &GuidedCell| guide.next(&cell.known(None, 0.0), &CancelToken::default());
    let mut guide = Guide::new(options(1e-3));
    assert_eq!(next(&mut guide, &cell), Next::End(Ending::NoStart), "there is no view of the board yet");
    assert!(cell.capture(&first));
    let mut moves = 0;
    let ending = loop {
        match next(&mut guide, &cell) {
            Next::Go { .. } => guide.failed(),
            Next::End(ending) => break ending,
        }
        moves += 1;
    };
    assert_eq!(ending, Ending::NoStart);
    assert!((4..=MOST_FAN).contains(&moves), "{moves} moves");
    let on_tip = crate::Obstacle::new("block", *cell.base_from_tip().isometry(), [0.1; 3]);
    cell.robot.around.obstacles.push(on_tip);
    let by = Contact::Box { name: "block".to_owned() };
    assert_eq!(next(&mut Guide::new(options(1e-3)), &cell), Next::End(Ending::StartBlocked { by }));
}

/// The path of the arm, point by point: tip and camera of every move, by the chain and the true place of the camera.
fn places_on_the_way(cell: &GuidedCell, from: &JointValues, to: &JointValues) -> Vec<Isometry3<f64>> {
    (0..=200)
        .flat_map(|step| {
            let part = f64::from(step) / 200.0;
            let joints = JointValues::from_fn(from.len(), |k| from[k] + part * (to[k] - from[k]));
            let tip = *cell.robot.arm.tip(&joints).expect("its own joints").isometry();
            [tip, tip * cell.links.mount_from_camera.isometry()]
        })
        .collect()
}

/// A rod that hangs into the space next to the first pose: without it some paths lead through its place. Judged by the
/// places of tip and camera, not by the planner's own shapes.
#[test]
fn the_arm_is_driven_around_what_stands_in_the_way_and_within_its_ranges() {
    let mut crossed = 0;
    for (seed, beside) in [(2, 0.14), (3, -0.14), (11, 0.14), (12, -0.14)] {
        let mut hits = [0, 0];
        for (with_rod, hits) in [false, true].into_iter().zip(&mut hits) {
            let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, seed));
            let first = cell.robot.joints;
            let middle = cell.base_from_tip().translation() + nalgebra::Vector3::new(0.0, beside, 0.15);
            let at = Isometry3::translation(middle.x, middle.y, middle.z);
            let rod = crate::Obstacle::new("rod", at, [0.03, 0.03, 0.5]);
            if with_rod {
                cell.robot.around.obstacles.push(rod.clone());
            }
            let run = cell.run(GuidedOptions { most_views: 14, least_gain: 0.0, ..options(1e-9) });
            if with_rod {
                assert_eq!(run.ending, Ending::MostViews, "seed {seed}");
            }
            let stops: Vec<JointValues> =
                std::iter::once(first).chain(run.steps.iter().filter_map(|step| step.joints)).collect();
            for way in stops.windows(2) {
                assert_eq!(cell.robot.arm.chain.first_violation(&way[1]), None);
                *hits += places_on_the_way(&cell, &way[0], &way[1])
                    .iter()
                    .map(|place| (rod.world_from_centre.inverse() * place).translation.vector.abs())
                    .filter(|beside| beside.x < 0.025 && beside.y < 0.025 && beside.z < 0.26)
                    .count();
            }
        }
        crossed += hits[0];
        assert_eq!(hits[1], 0, "seed {seed}");
    }
    assert!(crossed > 0, "the rods are in nobody's way: this test asserts nothing");
}

/// Without findings nothing contradicts it; a finding keeps it from ending as a success.
#[test]
fn an_answer_that_something_speaks_against_is_no_success_however_small_its_error() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1));
    let _begun = cell.run(GuidedOptions { most_views: 12, least_gain: 0.0, ..options(1e-9) });
    let moved = |metres: f64| {
        let shift = nalgebra::Vector6::new(metres, 0.0, 0.0, 0.0, 0.0, 0.0);
        StatedUncertainty::Moved(vec![Alternative { shift, covariance: nalgebra::Matrix6::identity() * 1e-12 }])
    };
    // Views are worth taking until it is good enough, and hardly worth it where it is doubted.
    let claims = [
        (StatedUncertainty::AsModelled, 0.0),
        (StatedUncertainty::Nothing, 1.0),
        (moved(5e-5), 0.0),
        (moved(2e-4), 1.0),
    ];
    let endings = claims.map(|(claim, least_gain)| {
        let mut guide = Guide::new(GuidedOptions { least_gain, ..options(1e-3) });
        let all = cell.observations.views.clone();
        let mut ending = None;
        for count in 11..=all.len() {
            cell.observations.views = all[..count].to_vec();
            let calibration = cell.calibrate().expect("twelve good views").claiming(claim.clone());
            if let Next::End(end) = guide.next(&cell.known(Some(&calibration), 0.0), &CancelToken::default()) {
                let is_first = count == 11;
                assert!(!is_first || !end.is_success(), "one small error may be luck");
                ending = Some(end);
            }
        }
        ending
    });
    assert!(matches!(endings[0], Some(Ending::GoalReached { .. })), "{endings:?}");
    assert_eq!(endings[1], Some(Ending::Doubted));
    assert!(matches!(endings[2], Some(Ending::GoalReached { .. })), "it moves by a twentieth of the goal: {endings:?}");
    assert_eq!(endings[3], Some(Ending::Doubted), "it moves by a fifth of the goal");
}

/// An error that was not waited for is as likely too small as too large: where more views are not worth it, one answer below the
/// goal is enough.
#[test]
fn an_end_that_no_small_error_brought_about_is_a_success_where_the_goal_is_reached() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1));
    let _begun = cell.run(GuidedOptions { most_views: 12, least_gain: 0.0, ..options(1e-9) });
    let calibration = cell.calibrate().expect("twelve good views");
    let ending = |options: GuidedOptions, elapsed_s: f64| match Guide::new(options)
        .next(&cell.known(Some(&calibration), elapsed_s), &CancelToken::default())
    {
        Next::End(ending) => ending.is_success(),
        Next::Go { .. } => panic!("it goes on"),
    };
    for (goal_m, is_reached) in [(1e-3, true), (1e-6, false)] {
        assert_eq!(ending(GuidedOptions { least_gain: 1.0, ..options(goal_m) }, 0.0), is_reached);
        assert_eq!(ending(GuidedOptions { most_views: 12, ..options(goal_m) }, 0.0), is_reached);
        assert_eq!(ending(GuidedOptions { most_s: 5.0, ..options(goal_m) }, 6.0), is_reached);
    }
}

#[test]
fn below_the_goal_it_says_why_it_goes_on() {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1));
    let _begun = cell.run(GuidedOptions { most_views: 12, least_gain: 0.0, ..options(1e-9) });
    let all = cell.observations.views.clone();
    let mut hold = |views: usize, goal_m: f64, claim: StatedUncertainty| {
        cell.observations.views = all[..views].to_vec();
        let calibration = cell.calibrate().expect("good views").claiming(claim);
        let mut guide = Guide::new(options(goal_m));
        let _next = guide.next(&cell.known(Some(&calibration), 0.0), &CancelToken::default());
        (guide.hold(), calibration.tip_error_95_m().expect("stated"), at_upper_levels_m(&calibration))
    };
    let far_m = 1e-3;
    assert_eq!(hold(LEAST_VIEWS - 1, far_m, StatedUncertainty::AsModelled).0, Some(Hold::FewViews));
    assert_eq!(hold(12, far_m, StatedUncertainty::AsModelled).0, Some(Hold::Confirmation));
    let shift = nalgebra::Vector6::new(2e-4, 0.0, 0.0, 0.0, 0.0, 0.0);
    let moved =
        StatedUncertainty::Moved(vec![Alternative { shift, covariance: nalgebra::Matrix6::identity() * 1e-12 }]);
    assert_eq!(hold(12, far_m, moved).0, Some(Hold::Doubted));
    let (above, stated_m, upper_m) = hold(12, 1e-9, StatedUncertainty::AsModelled);
    assert_eq!(above, None, "it is above the goal, which explains itself");
    let upper_m = upper_m.expect("known");
    assert_eq!(
        hold(12, f64::midpoint(stated_m, upper_m), StatedUncertainty::AsModelled).0,
        Some(Hold::NoiseLevels { error_m: upper_m })
    );
}

/// From ten views the noise levels are known to a quarter, and an end that waits for a small estimate has to allow for that.
#[test]
fn an_end_is_judged_at_the_upper_limit_of_the_noise_levels() {
    // Ten over the 20 % quantile of chi-square with ten degrees of freedom, 6.179.
    assert!((upper_level(10.0) - 1.2722).abs() < 1e-3, "{}", upper_level(10.0));
    assert!((upper_level(f64::INFINITY) - 1.0).abs() < 1e-12);
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1));
    let _begun = cell.run(GuidedOptions { most_views: LEAST_VIEWS, least_gain: 0.0, ..options(1e-9) });
    let calibration = cell.calibrate().expect("ten good views");
    let (stated_m, upper_m) = (calibration.tip_error_95_m(), at_upper_levels_m(&calibration));
    let ratio = upper_m.expect("known") / stated_m.expect("stated");
    assert!((1.01..2.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_board_that_may_lie_partly_outside_the_image_is_not_surely_seen() {
    let cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 1));
    let truth = cell.truth();
    let tip = cell.base_from_tip();
    let seen = truth.camera_from_target(&tip.into());
    let target = &cell.observations.target;
    let range = ViewRange::about([seen.translation().norm()].into_iter()).expect("in front of the camera");
    let surely = |sigma_rad: f64, doubt_factor: f64| {
        let covariance = nalgebra::DMatrix::identity(truth.unknowns(), truth.unknowns()) * sigma_rad.powi(2);
        range.surely_shows(target, &truth.pixels(&tip.into(), &covariance), doubt_factor)
    };
    assert!(range.shows(truth.intrinsics(), target, &seen));
    assert!(surely(1e-4, 1.0) && !surely(0.3, 1.0));
    assert!(!surely(1e-4, 1000.0), "with doubts it is not");
}

/// Where an estimate was wrong in spite of a small uncertainty, the next one gets a larger uncertainty.
#[test]
fn after_views_without_the_board_the_next_are_chosen_with_more_room_about_it() {
    let mut cell = GuidedCell::new(CellSetup { free_lens: true, ..CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, 4) });
    let _begun = cell.run(GuidedOptions { most_views: 5, ..options(1e-9) });
    let calibration = cell.calibrate().expect("five good views");
    let known = cell.known(Some(&calibration), 0.0);
    let target = &cell.observations.target;
    let model = ViewModel::new(&calibration, target).expect("a joint estimate");
    let views = expected_views(&model, &used_views(&cell.observations, Some(&calibration)));
    let design = Design::new(model.prior(), &views, nalgebra::Matrix6::identity()).expect("it is determined");
    let mut guide = Guide::new(options(1e-9));
    for failed in 0..4 {
        let next = guide.next(&known, &CancelToken::default());
        let Next::Go { plan, .. } = next else { panic!("{next:?}") };
        let range = guide.range.expect("there was a choice");
        let pixels = model.pixels(&plan.proposals[0].base_from_tip.into(), design.covariance());
        assert!(range.surely_shows(target, &pixels, 1.0 + f64::from(failed)), "after {failed}");
        guide.failed();
    }
}

/// An unknown lens needs at most two turns and a tilt before poses are chosen, and none of these loses the board.
#[test]
fn with_an_unknown_lens_poses_are_chosen_from_the_fifth_view_on_at_the_latest() {
    for (arm, mode) in CellArm::ALL.into_iter().flat_map(|arm| [(arm, Mode::EyeInHand), (arm, Mode::EyeToHand)]) {
        for seed in 1..4 {
            let mut cell = GuidedCell::new(CellSetup { free_lens: true, ..CellSetup::new(arm, mode, seed) });
            let run = cell.run(GuidedOptions { most_views: 7, ..options(1e-9) });
            let chosen = run.steps.iter().position(|step| matches!(step.why, Why::Gain { .. }));
            assert!(chosen.is_some_and(|index| index <= 3), "{arm:?} {mode:?} {seed}: {chosen:?}");
            assert_eq!(run.failed, 0, "{arm:?} {mode:?} {seed}");
        }
    }
}

/// The input of a plan in the middle of a session.
fn half_way(seed: u64) -> (GuidedCell, Calibration) {
    let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeInHand, seed));
    let _begun = cell.run(GuidedOptions { most_views: 7, ..options(1e-9) });
    let calibration = cell.calibrate().expect("seven good views");
    (cell, calibration)
}

fn planned(cell: &GuidedCell, calibration: &Calibration, dwell_s: f64) -> Plan {
    let mut guide = Guide::new(GuidedOptions { dwell_s, ..options(1e-9) });
    let next = guide.next(&cell.known(Some(calibration), 0.0), &CancelToken::default());
    let Next::Go { plan, .. } = next else { panic!("{next:?}") };
    plan
}

#[test]
fn a_pose_where_something_stands_is_not_planned() {
    let (mut cell, calibration) = half_way(2);
    let before = planned(&cell, &calibration, 1.5);
    for proposal in &before.proposals {
        let there = crate::Obstacle::new("block", *proposal.base_from_tip.isometry(), [0.02; 3]);
        cell.robot.around.obstacles.push(there);
    }
    let after = planned(&cell, &calibration, 1.5);
    for proposal in &after.proposals {
        let joints = proposal.joints.expect("a chain");
        assert!(cell.robot.arm.is_free(&joints, &cell.robot.around, cell.robot.clearance_m));
    }
}

/// The estimate may put the camera where the arm would touch it, or a person may have moved the arm closer to something than
/// the planner would.
#[test]
fn an_arm_that_begins_too_near_to_something_is_driven_away_from_it() {
    let (mut cell, calibration) = half_way(2);
    // Next to the tip, at half of the clearance that is kept.
    let (tip, body) = (cell.base_from_tip(), cell.robot.arm.clone());
    let mut block = (0..100).map(|k| {
        let beside = Isometry3::translation(0.05 + 0.005 * f64::from(k), 0.0, 0.0);
        crate::Obstacle::new("block", tip.isometry() * beside, [0.02; 3])
    });
    let touches = |block: &crate::Obstacle, clearance_m: f64| {
        let around = crate::Surroundings::of(vec![block.clone()]);
        body.contact(&cell.robot.joints, &around, clearance_m).is_some()
    };
    let near = |block: &crate::Obstacle| touches(block, cell.robot.clearance_m) && !touches(block, 5e-3);
    let block = block.find(near).expect("it comes from afar");
    cell.robot.around.obstacles.push(block);
    let robot = &cell.robot;
    assert!(robot.arm.contact(&robot.joints, &robot.around, robot.clearance_m).is_some());
    assert!(!planned(&cell, &calibration, 1.5).proposals.is_empty());
}

/// Until then pose-dependent errors of an arm look like random ones, and its error is stated too small.
#[test]
fn it_does_not_end_before_errors_that_depend_on_the_place_are_looked_for() {
    for mode in [Mode::EyeInHand, Mode::EyeToHand] {
        let noise = Noise { field_m: 1.5e-3, ..REALISTIC };
        let mut cell = GuidedCell::new(CellSetup { noise, ..CellSetup::new(CellArm::Ur5e, mode, 3) });
        let run = cell.run(options(8e-3));
        assert!(matches!(run.ending, Ending::GoalReached { .. }), "{:?}", run.ending);
        let joint = run.calibration.and_then(|it| it.joint.clone()).expect("it was solved");
        assert!(joint.field.is_some(), "{mode:?}: {} views", run.history.last().expect("some").0);
    }
}

#[test]
fn camera_and_board_are_where_the_estimate_has_them_when_ways_are_checked() {
    let (cell, _) = half_way(3);
    let truth = cell.truth();
    let free = |robot: &Robot, joints: &JointValues| robot.arm.is_free(joints, &robot.around, robot.clearance_m);
    let HandEye::EyeInHand { tip_from_camera, base_from_target } = *truth.hand_eye() else { panic!("in hand") };
    // The camera is 3 cm in front of the middle of the board.
    let centre = cell.observations.target.centre().coords;
    let before_board = Isometry3::translation(centre.x, centre.y, -0.03);
    let tip = base_from_target.isometry() * before_board * tip_from_camera.isometry().inverse();
    let near = cell.robot.arm.reach(&Pose::from_isometry(tip), &cell.robot.joints).expect("it is in reach");
    // Without the table on which the board is.
    let mut bare = cell.robot.clone();
    bare.around.obstacles.clear();
    bare.arm.carried = vec![Carried::camera(tip_from_camera.isometry())];
    assert!(free(&bare, &near), "nothing but the board is in the way");
    bare.arm.carried = Vec::new();
    let known = with_board(&bare, truth.hand_eye(), &cell.observations, 0.0);
    assert!(!free(&known, &near));
    assert_eq!(known.arm.carried, [Carried::camera(tip_from_camera.isometry())]);
    let roomy = with_board(&cell.robot, truth.hand_eye(), &cell.observations, 0.03);
    let edges = |robot: &Robot| robot.around.obstacles.last().expect("the board").size_m;
    let plain = with_board(&cell.robot, truth.hand_eye(), &cell.observations, 0.0);
    for axis in 0..3 {
        assert!((edges(&roomy)[axis] - edges(&plain)[axis] - 0.06).abs() < 1e-12);
    }
}

/// Where a capture takes no time the travel time counts, where it takes long the gain alone.
#[test]
fn what_comes_first_gains_most_for_its_time() {
    let mut shorter = 0;
    for seed in 2..6 {
        let (cell, calibration) = half_way(seed);
        let travel_s = |dwell_s| planned(&cell, &calibration, dwell_s).proposals[0].travel_s;
        let (at_once, slow) = (travel_s(1e-3), travel_s(1e4));
        assert!(at_once <= slow + 1e-12, "{at_once} s, {slow} s");
        shorter += usize::from(at_once < slow);
    }
    assert!(shorter > 0, "the way never mattered");
}

/// Far from where the board was the error is larger, and a goal there takes more views than the same goal at the board.
#[test]
fn a_goal_over_a_box_holds_for_its_worst_corner() {
    let far = TipBox::in_camera(Point3::new(-0.2, -0.2, 0.7), Point3::new(0.2, 0.2, 0.9));
    let run = |tool_box| {
        let mut cell = GuidedCell::new(CellSetup::new(CellArm::Ur5e, Mode::EyeToHand, 1));
        cell.run(GuidedOptions { tool_box, ..options(4e-4) })
    };
    let (near, over) = (run(None), run(Some(far)));
    let Ending::GoalReached { promised: Promised { error_m, .. } } = over.ending else { panic!("{:?}", over.ending) };
    let calibration = over.calibration.expect("it was solved");
    let corner_m = calibration.error_95_m(&Point3::new(0.2, 0.2, 0.9)).expect("stated");
    assert!(corner_m <= error_m + 1e-12 && error_m <= 4e-4, "{corner_m} m at a corner, {error_m} m stated");
    assert!(calibration.tip_error_95_m().expect("stated") < 0.8 * error_m, "the box is no harder: nothing is asserted");
    assert!(over.history.len() >= near.history.len());
}

/// Judged by points on the surfaces of links, camera and board, not by the planner's distances; `guided_safety` is the same
/// with 2,000 moves.
#[test]
fn nothing_is_touched_among_boxes_and_limits_are_kept() {
    let (mut known, mut unknown) = (Tally::default(), Tally::default());
    for (seed, arm) in (40..).zip([CellArm::Ur5e, CellArm::Panda, CellArm::Xarm6, CellArm::Ur5e]) {
        let mode = if seed % 2 == 0 { Mode::EyeInHand } else { Mode::EyeToHand };
        known = known.and(session(CellSetup::new(arm, mode, seed), 12, true));
        unknown = unknown.and(session(CellSetup::new(arm, mode, seed), 12, false));
    }
    assert!(known.moves >= 35, "{known:?}");
    let Tally { contacts, self_contacts, out_of_range, too_fast, .. } = known;
    assert_eq!((contacts, self_contacts, out_of_range, too_fast), (0, 0, 0, 0), "{known:?}");
    assert!(known.cut <= 2, "{known:?}");
    assert!(unknown.contacts > 0, "the boxes are in nobody's way: this test asserts nothing; {unknown:?}");
}
