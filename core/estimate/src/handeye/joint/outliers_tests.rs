use super::*;
use crate::handeye::Mode;
use crate::test_sessions::Estimated as _;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};

/// The target's own pose in every view: the chain with the error of the robot taken out by a fit of the corners.
fn own(t: &Session) -> Vec<Pose<Camera, Target>> {
    let seen: Vec<Pose<Camera, Target>> = t.true_camera_from_target.clone();
    t.views
        .iter()
        .zip(seen)
        .map(|(view, truth)| {
            let problem = t.problem(false, None);
            let state = State::new(&problem, &t.start());
            Pose::from_isometry(own_pose(&problem, &state, view, &truth).expect("seen").0)
        })
        .collect()
}

fn screened(t: &Session) -> Screened {
    estimate_screened(&t.problem(false, None), &t.start(), &own(t), &CancelToken::default()).expect("solves")
}

#[test]
fn healthy_sessions_keep_their_views() {
    // One session in a hundred may lose a view; of thirty at most one does in 96 of 100 choices of seeds.
    let mut lost = 0;
    for (views, seed) in [(10, 500), (20, 600), (40, 700)] {
        for k in 0..10 {
            let t = trial(Mode::EyeInHand, views, &REALISTIC, camera(), seed + k);
            lost += usize::from(screened(&t).kept.len() < views);
        }
    }
    assert!(lost <= 1, "{lost} of 30 sessions lost a view");
}

#[test]
fn wrong_views_are_set_aside_and_the_answer_is_that_of_the_others() {
    for (mode, views, wrong) in [(Mode::EyeInHand, 10, 1), (Mode::EyeToHand, 20, 2), (Mode::EyeInHand, 20, 6)] {
        for seed in 0..5 {
            let mut t = trial(mode, views, &REALISTIC, camera(), 800 + seed);
            let chosen: Vec<usize> = (0..wrong).map(|k| (3 + 3 * k) % views).collect();
            for (k, &i) in chosen.iter().enumerate() {
                let s = if k % 2 == 0 { 1.0 } else { -0.6 };
                let off = Vector6::new(0.006 * s, -0.004, 0.003 * k as f64, 0.02 * s, 0.01, -0.03);
                t.views[i].base_from_tip = t.views[i].base_from_tip.perturbed(&off);
            }
            let found = screened(&t);
            let expected: Vec<usize> = (0..views).filter(|i| !chosen.contains(i)).collect();
            assert_eq!(found.kept, expected, "{mode:?} {views} {wrong} {seed}");
            let clean: Vec<View> = found.kept.iter().map(|&i| t.views[i].clone()).collect();
            let problem = JointProblem { views: &clean, ..t.problem(false, None) };
            let alone = fit(&problem, &t.start(), &CancelToken::default()).expect("solves");
            let (metres, _) =
                alone.hand_eye.mount_from_camera().distance_to(&found.solution.hand_eye.mount_from_camera());
            // Where a noise level is small its likelihood is flat, and two starts end a few percent of it apart.
            let sigma_m = alone.hand_eye_covariance().diagonal().rows(0, 3).sum().sqrt();
            assert!(metres < 0.1 * sigma_m, "{metres} m, standard deviation {sigma_m} m");
        }
    }
}

#[test]
fn one_grossly_wrong_view_of_ten_does_not_lead_the_fit_astray() {
    let exact = super::super::Noise { corner_px: 0.1, robot_m: 0.0, robot_rad: 0.0, ..super::super::Noise::EXACT };
    for noise in [exact, REALISTIC] {
        for seed in 0..8 {
            let healthy = trial(Mode::EyeInHand, 10, &noise, camera(), 1000 + seed);
            let robot_off = |t: &mut Session| {
                let off = Vector6::new(0.03, -0.02, 0.03, 0.1, 0.05, -0.1);
                t.views[6].base_from_tip = t.views[6].base_from_tip.perturbed(&off);
            };
            let other_end = |t: &mut Session| {
                t.views[6].corners.iter_mut().for_each(|c| c.index = 69 - c.index);
                let centre = nalgebra::Translation3::from(handeye_geometry::testing::BOARD.centre().coords);
                let half_turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI);
                let turn = centre * half_turn * centre.inverse();
                let truth = &mut t.true_camera_from_target[6];
                *truth = Pose::from_isometry(truth.isometry() * turn);
            };
            let spoils: [&dyn Fn(&mut Session); 2] = [&robot_off, &other_end];
            for (kind, spoil) in spoils.into_iter().enumerate() {
                let mut t = trial(Mode::EyeInHand, 10, &noise, camera(), 1000 + seed);
                spoil(&mut t);
                let found = screened(&t);
                assert!(!found.kept.contains(&6), "{kind} {seed}: {:?}", found.kept);
                assert!(found.kept.len() >= 8, "{kind} {seed}: {:?}", found.kept);
                let error = healthy.hand_eye_error(&found.solution);
                let inverse = found.solution.hand_eye_covariance().try_inverse().expect("regular");
                assert!(error.dot(&(inverse * error)) < 50.0, "{kind} {seed}: {error}");
            }
        }
    }
}

#[test]
fn one_wrong_view_of_ten_cannot_hide_behind_the_noise_it_makes() {
    // An error in translation alone: the noise of the robot's position follows it, and within the fit its squared distance
    // is 3 N = 30, whatever its error; the limit is 33.
    let exact = super::super::Noise { corner_px: 0.1, robot_m: 0.0, robot_rad: 0.0, ..super::super::Noise::EXACT };
    for (mode, noise) in [(Mode::EyeInHand, exact), (Mode::EyeToHand, exact), (Mode::EyeInHand, REALISTIC)] {
        for seed in 0..5 {
            let mut t = trial(mode, 10, &noise, camera(), 820 + seed);
            let off = Vector6::new(0.006, -0.009, 0.004, 0.0, 0.0, 0.0);
            t.views[4].base_from_tip = t.views[4].base_from_tip.perturbed(&off);
            assert_eq!(screened(&t).kept, [0, 1, 2, 3, 5, 6, 7, 8, 9], "{mode:?} {seed}");
        }
    }
}

#[test]
fn a_wrong_corner_is_set_aside_and_named() {
    let mut t = trial(Mode::EyeInHand, 12, &REALISTIC, camera(), 900);
    t.views[4].corners[33].px.x += 3.0;
    let found = screened(&t);
    assert_eq!(found.corners, [(4, 33)]);
    assert_eq!(found.kept.len(), 12);
    assert_eq!(found.views[4].corners.len(), 69);
}

#[test]
fn noise_that_all_corners_of_a_view_share_is_found_and_stated() {
    // Every view is seen 0.3 px wrong in a way that looks like a pose, on top of 0.03 px of noise, by an exact robot.
    let fine = super::super::Noise { corner_px: 0.03, robot_m: 0.0, robot_rad: 0.0, ..super::super::Noise::EXACT };
    let mut t = trial(Mode::EyeInHand, 20, &fine, camera(), 901);
    for (i, view) in t.views.iter_mut().enumerate() {
        let (dx, dy) = (0.3 * (1.7 * i as f64).sin(), 0.3 * (2.9 * i as f64).cos());
        for corner in &mut view.corners {
            corner.px += nalgebra::Vector2::new(dx, dy);
        }
    }
    let solution = screened(&t).solution;
    assert!((solution.noise.corner_px / 0.03 - 1.0).abs() < 0.1, "{:?}", solution.noise);
    let error = t.hand_eye_error(&solution);
    let inverse = solution.hand_eye_covariance().try_inverse().expect("regular");
    let squared = error.dot(&(inverse * error));
    // 99.9 % of 6 F(6, 20).
    assert!(squared < 36.0, "{squared}");
}

#[test]
fn a_view_farther_out_than_the_others_is_judged_by_a_field_that_reaches_it() {
    // A robot whose errors are affine in the place, and no outliers. The farthest view is judged by a fit without it, whose
    // own views end before it.
    let noise = Noise { field_m: 3e-3, field_rad: 5e-3, robot_m: 2e-5, robot_rad: 1e-4, ..REALISTIC };
    let (mut farther, mut beyond) = (Vec::new(), 0);
    for seed in 0..20 {
        let t = trial(Mode::EyeInHand, 16, &noise, camera(), 950 + seed);
        let from_middle = |views: &[usize]| {
            let mean: nalgebra::Vector3<f64> =
                views.iter().map(|&i| t.views[i].base_from_tip.translation()).sum::<nalgebra::Vector3<f64>>()
                    / views.len() as f64;
            t.views.iter().map(|view| (view.base_from_tip.translation() - mean).norm()).collect::<Vec<f64>>()
        };
        let all: Vec<usize> = (0..16).collect();
        let far = from_middle(&all);
        let farthest = all.iter().copied().max_by(|&a, &b| far[a].total_cmp(&far[b])).expect("views");
        let kept: Vec<usize> = all.into_iter().filter(|&i| i != farthest).collect();
        let far = from_middle(&kept);
        farther.push(far[farthest] / kept.iter().map(|&i| far[i]).fold(0.0, f64::max));
        let free = super::super::Free { field: true, ..Default::default() };
        let problem = JointProblem { free, ..t.problem(false, None) };
        let own = own(&t);
        let cancel = CancelToken::default();
        let of_views =
            OfViews { problem: &problem, start: &t.start(), views: &t.views, own: &own, work: Work::from(&cancel) };
        let solution = of_views.fit(&kept, None).expect("solves");
        let judged = of_views.judge(&solution, &kept).expect("solves");
        beyond += usize::from(judged[farthest].squared > judged[farthest].limit);
    }
    let farthest = farther.iter().copied().fold(0.0, f64::max);
    assert!(farthest > 1.2, "none is far out: {farther:.2?}");
    // One in a thousand sessions has a view beyond the limit.
    assert_eq!(beyond, 0);
}
