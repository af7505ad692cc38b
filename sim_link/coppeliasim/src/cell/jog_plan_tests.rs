use approx::assert_relative_eq;
use proptest::prelude::*;

use super::*;
use handeye_arm::ArmKind;

const DT_S: f64 = 0.05;
const START: JointValues = JointValues::of([0.2, 0.8, -1.1, 0.3, 1.4, -0.5]);

fn arm() -> ArmKinematics {
    let base_from_arm = Isometry3::translation(0.0, 0.0, 0.025);
    ArmKinematics::ur5(base_from_arm, Isometry3::translation(0.0, 0.0, 0.017), &ArmKind::Ur5Coppeliasim.ranges())
        .expect("ranges with room")
}

fn line(arm: &ArmKinematics, start: JointValues, along: Vector3<f64>) -> Path<'_> {
    Path::Line { kinematics: arm, start: arm.tip(&start), along: along.normalize() }
}

fn joint(index: usize, sign: f64, [min, max]: [f64; 2]) -> Path<'static> {
    let range = JointRange { min, max, speed: f64::INFINITY };
    Path::Joint { index, joint: CellJoint { kind: JointKind::Revolute, range }, sign, start: START }
}

/// Advances while `share` gives one, until it is at rest, and returns every point.
fn run(plan: &mut JogPlan<'_>, mut share: impl FnMut(usize) -> Option<f64>) -> Vec<JointValues> {
    let mut points = Vec::new();
    for pass in 0..10_000 {
        let wanted = share(pass);
        points.push(plan.advance(wanted));
        if plan.is_at_rest() && (wanted.is_none() || plan.is_at_end() || plan.obstacle().is_some()) {
            return points;
        }
    }
    panic!("it never stands")
}

/// Speeds from pass to pass, a standstill first and last.
fn speeds(start: f64, values: impl Iterator<Item = f64>) -> Vec<f64> {
    let values: Vec<f64> = std::iter::once(start).chain(values).collect();
    let moving = values.windows(2).map(|pair| (pair[1] - pair[0]).abs() / DT_S);
    std::iter::once(0.0).chain(moving).chain([0.0]).collect()
}

#[test]
fn a_joint_moves_in_the_first_pass_and_keeps_its_limits_from_start_to_rest() {
    let mut plan = JogPlan::new(joint(2, -1.0, [-3.0, 3.0]), None, START, DT_S, None).expect("nothing is in the way");
    let points = run(&mut plan, |pass| (pass < 10).then_some(0.5));
    assert!(points[0][2] < START[2], "it moves at once");
    let speeds = speeds(START[2], points.iter().map(|q| q[2]));
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    assert_relative_eq!(fastest, 0.5 * JOINT_SPEED, epsilon = 1e-9);
    for pair in speeds.windows(2) {
        assert!((pair[1] - pair[0]).abs() <= JOINT_ACCELERATION * DT_S + 1e-9, "{speeds:?}");
    }
    let others = |q: &JointValues| (0..q.len()).filter(|&i| i != 2).all(|i| q[i] == START[i]);
    assert!(points.iter().all(others));
}

#[test]
fn a_joint_comes_to_rest_at_the_end_of_its_range_and_says_so() {
    let mut plan = JogPlan::new(joint(0, 1.0, [-1.0, 0.9]), None, START, DT_S, None).expect("there is room");
    let points = run(&mut plan, |_| Some(1.0));
    assert_relative_eq!(points.last().expect("points")[0], 0.9, epsilon = 1e-6);
    assert!(points.iter().all(|q| q[0] <= 0.9 + 1e-12));
    assert_eq!(
        plan.obstacle().cloned(),
        Some(JogObstacle::JointRange { joint: 1, limit: JointKind::Revolute.quantity(0.9) })
    );
    for pair in speeds(START[0], points.iter().map(|q| q[0])).windows(2) {
        assert!((pair[1] - pair[0]).abs() <= JOINT_ACCELERATION * DT_S + 1e-9);
    }
}

#[test]
fn a_step_ends_exactly_where_it_was_asked_to() {
    let arm = arm();
    for (length, along) in [(1e-4, Vector3::x()), (0.01, Vector3::y()), (0.05, -Vector3::z())] {
        let mut plan = JogPlan::new(line(&arm, START, along), None, START, DT_S, Some(length)).expect("it is near");
        let points = run(&mut plan, |_| Some(0.25));
        let moved = arm.tip(points.last().expect("points")).translation() - arm.tip(&START).translation();
        assert_relative_eq!(moved, along * length, epsilon = 1e-9);
        assert!(plan.is_at_end());
    }
}

#[test]
fn a_step_that_leads_out_of_reach_or_range_is_not_begun() {
    let arm = arm();
    let far = JogPlan::new(line(&arm, START, Vector3::z()), None, START, DT_S, Some(2.0)).expect_err("two metres up");
    assert!(matches!(far, JogObstacle::Reach(_) | JogObstacle::Singular { .. }), "{far}");
    let error = JogPlan::new(joint(5, -1.0, [-0.6, 0.6]), None, START, DT_S, Some(0.2)).expect_err("out of range");
    assert!(matches!(error, JogObstacle::JointRange { joint: 6, .. }), "{error}");
}

#[test]
fn a_turn_keeps_its_centre() {
    let arm = arm();
    let start = arm.tip(&START);
    let centre = start.translation() + Vector3::new(0.05, -0.02, 0.1);
    let path = Path::Turn { kinematics: &arm, start, about: Vector3::y(), centre };
    let tip_from_centre = start.inverse().isometry() * nalgebra::Point3::from(centre);
    let mut plan = JogPlan::new(path, None, START, DT_S, None).expect("open");
    let points = run(&mut plan, |pass| (pass < 20).then_some(0.5));
    for q in &points {
        let now = arm.tip(q).isometry() * tip_from_centre;
        assert_relative_eq!(now.coords, centre, epsilon = 1e-9);
    }
    let (_, turned_rad) = start.distance_to(&arm.tip(points.last().expect("points")));
    assert!(turned_rad > 0.1, "{turned_rad}");
}

#[test]
fn out_of_a_singular_position_the_tip_goes_as_slowly_as_the_joints_need() {
    let arm = arm();
    // Stretched straight up: at first the tip hardly moves however fast the elbow turns.
    let upright = JointValues::zeros(6);
    let mut plan = JogPlan::new(line(&arm, upright, -Vector3::z()), None, upright, DT_S, None).expect("no length");
    let points = run(&mut plan, |pass| (pass < 100).then_some(1.0));
    assert!(pass_rates(&upright, &points) <= JOINT_RATE * (1.0 + 1e-9));
    let first_m = arm.tip(&upright).distance_to(&arm.tip(&points[0])).0;
    assert!(first_m < 0.1 * LINE_SPEED * DT_S, "{first_m} m in the first pass");
    let all_m = arm.tip(&upright).distance_to(&arm.tip(points.last().expect("points"))).0;
    assert!(all_m > 0.5, "and then it goes on: {all_m} m");
}

/// A Panda has a joint to spare: where the smallest motion takes another one to its end, that one stays within its range
/// and the tip goes on along its line.
#[test]
fn a_joint_to_spare_gives_way_where_another_one_comes_to_the_end_of_its_range() {
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/scenes/panda.toml");
    let scene = handeye_cell::scene::Scene::load(&scene).and_then(|scene| scene.resolve(0)).expect("it is shipped");
    let arm = ArmKinematics::new(scene.arm.clone(), scene.world_from_arm);
    let mut start = scene.start_joints;
    let range = arm.arm().joints()[6].range;
    start[6] = range.max - 0.02;
    let (tip, mut gave_way) = (arm.tip(&start), 0);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::x(), -Vector3::y(), -Vector3::z()];
    for about in axes.map(|axis| tip.rotation() * axis) {
        let path = Path::Turn { kinematics: &arm, start: tip, about, centre: tip.translation() };
        let mut plan = JogPlan::new(path, None, start, DT_S, None).expect("no length");
        let mut before = start;
        for joints in run(&mut plan, |pass| (pass < 40).then_some(0.5)) {
            assert_eq!(arm.arm().first_violation(&joints), None, "{joints:?}");
            let (_, by_rad) = largest_change(arm.kinds(), &before, &joints);
            assert!(by_rad <= JOINT_RATE * DT_S * (1.0 + 1e-9), "{by_rad} rad in a pass");
            assert!((arm.tip(&joints).translation() - tip.translation()).norm() < 1e-7);
            let free: Vec<JointRange> = vec![JointRange::ENDLESS; 7];
            let least = near(&arm, &arm.tip(&joints), &before, &free);
            let moved = joints != before;
            gave_way += u32::from(moved && least.is_ok_and(|least| arm.arm().first_violation(&least).is_some()));
            before = joints;
        }
    }
    assert!(gave_way > 3, "{gave_way} passes");
}

fn direction() -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-1.0_f64..1.0)
        .prop_map(Vector3::from)
        .prop_filter("a direction", |v| v.norm() > 0.1)
        .prop_map(|v| v.normalize())
}

fn pass_rates(start: &JointValues, points: &[JointValues]) -> f64 {
    let kinds = || std::iter::repeat(JointKind::Revolute);
    std::iter::once(start)
        .chain(points)
        .zip(points)
        .map(|(a, b)| largest_change(kinds(), a, b).1 / DT_S)
        .fold(0.0, f64::max)
}

mod slow {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

        #[test]
        fn wherever_the_tip_is_sent_it_stays_on_its_line_and_no_joint_is_faster_than_it_may_be(
            start in prop::array::uniform6(-3.0_f64..3.0),
            along in direction(),
            turns in any::<bool>(),
            share in 0.05_f64..1.0,
        ) {
            let (arm, start) = (arm(), JointValues::from(start));
            let tip = arm.tip(&start);
            let path = if turns {
                Path::Turn { kinematics: &arm, start: tip, about: along, centre: tip.translation() }
            } else {
                Path::Line { kinematics: &arm, start: tip, along }
            };
            let mut plan = JogPlan::new(path, None, start, DT_S, None).expect("no length");
            // Three metres of line, or more than a turn: most ways end at an obstacle before.
            let points = run(&mut plan, |pass| (pass < 2000).then_some(share));
            let rate = pass_rates(&start, &points);
            prop_assert!(rate <= JOINT_RATE * (1.0 + 1e-9), "{}°/s", rate.to_degrees());
            for q in &points {
                let now = arm.tip(q);
                let (distance_m, angle_rad) = if turns {
                    ((now.translation() - tip.translation()).norm(), 0.0)
                } else {
                    let moved = now.translation() - tip.translation();
                    ((moved - along * moved.dot(&along)).norm(), tip.distance_to(&now).1)
                };
                prop_assert!(distance_m < 1e-7 && angle_rad < 1e-6, "{distance_m} m, {angle_rad} rad off");
                prop_assert!(arm.arm().first_violation(q).is_none());
            }
        }
    }
}
