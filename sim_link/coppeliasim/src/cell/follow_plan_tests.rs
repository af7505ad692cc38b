use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4};

use nalgebra::{Point3, Translation3, UnitQuaternion};
use proptest::prelude::*;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::super::follow_goal::Workspace;
use super::super::surroundings::Among;
use super::*;
use handeye_arm::{ArmKind, JointRange};
use handeye_plan as planning;

const DT_S: f64 = 0.05;

/// As the public scene begins: 0°, 45°, −60°, 0°, 90°, 0°.
const START: JointValues = JointValues::of([0.0, FRAC_PI_4, -FRAC_PI_3, 0.0, FRAC_PI_2, 0.0]);

/// From full speed every limit is down to zero after six or seven of these passes, one after the other.
const PASSES_TO_REST: usize = 20;

fn arm() -> ArmKinematics {
    arm_within(&ArmKind::Ur5Coppeliasim.ranges())
}

fn arm_within(limits: &[JointRange]) -> ArmKinematics {
    let base_from_arm = Isometry3::translation(0.0, 0.0, 0.025);
    ArmKinematics::ur5(base_from_arm, Isometry3::translation(0.0, 0.0, 0.017), limits).expect("limits with room")
}

/// Without walls.
fn open() -> FollowLimits {
    boxed(Point3::new(-2.0, -2.0, -2.0), Point3::new(2.0, 2.0, 2.0))
}

fn boxed(min: Point3<f64>, max: Point3<f64>) -> FollowLimits {
    FollowLimits { workspace: Workspace { min, max }, ..FollowLimits::default() }
}

fn still(base_from_tip: Pose<Base, Tip>) -> FollowGoal {
    FollowGoal { base_from_tip, velocity_m_s: Vector3::zeros(), angular_velocity_rad_s: Vector3::zeros() }
}

fn shifted(start: &Pose<Base, Tip>, by: Vector3<f64>) -> FollowGoal {
    still(Pose::from_isometry(moved(start.isometry(), &by, &Vector3::zeros())))
}

/// Every point that is sent, the standstill before first.
struct Run<'a> {
    arm: &'a ArmKinematics,
    plan: FollowPlan<'a>,
    dt_s: f64,
    points: Vec<JointValues>,
}

impl<'a> Run<'a> {
    fn new(arm: &'a ArmKinematics, limits: &FollowLimits, start: JointValues, dt_s: f64) -> Self {
        let plan = FollowPlan::new(arm, limits, None, start, dt_s).expect("nothing forbids to move");
        Self { arm, plan, dt_s, points: vec![start] }
    }

    fn pass(&mut self, goal: Option<&FollowGoal>) -> Pose<Base, Tip> {
        let joints = self.plan.advance(goal);
        self.points.push(joints);
        self.arm.tip(&joints)
    }

    /// Among boxes, with a centimetre of free space.
    fn among(arm: &'a ArmKinematics, limits: &FollowLimits, among: &'a Among) -> Self {
        let guard = Some(among.guard(&START));
        let plan = FollowPlan::new(arm, limits, guard, START, DT_S).expect("nothing forbids to move");
        Self { arm, plan, dt_s: DT_S, points: vec![START] }
    }

    /// Brakes until it is at rest; the number of passes.
    fn rest(&mut self) -> usize {
        for pass in 0..1000 {
            if self.plan.is_at_rest() {
                return pass;
            }
            self.pass(None);
        }
        panic!("it never stands")
    }

    /// The limit that was exceeded and by how much, over all points and a stop after them. Computed from the points
    /// alone.
    fn broken_limit(&self, limits: &FollowLimits) -> Option<String> {
        let last = *self.points.last()?;
        let points: Vec<JointValues> =
            std::iter::once(self.points[0]).chain(self.points.iter().copied()).chain([last]).collect();
        let tips: Vec<_> = points.iter().map(|q| self.arm.tip(q)).collect();
        let over = |what: &str, pass: usize, value: f64, limit: f64| {
            // The rounding that the plan allows itself, and that of differences of poses divided by two time steps.
            (value > limit * 1.00001 + 1e-7).then(|| format!("{what} in pass {pass}: {value} instead of {limit}"))
        };
        let velocity = |k: usize| (tips[k + 1].translation() - tips[k].translation()) / self.dt_s;
        let turn = |k: usize| (tips[k + 1].rotation() * tips[k].rotation().inverse()).scaled_axis() / self.dt_s;
        let rates =
            |k: usize| -> JointValues { JointValues::from_fn(6, |i| (points[k + 1][i] - points[k][i]) / self.dt_s) };
        let largest = |q: JointValues| q.iter().fold(0.0, |most: f64, q| most.max(q.abs()));
        for k in 0..points.len() - 1 {
            let broken = over("speed", k, velocity(k).norm(), limits.speed_m_s)
                .or(over("turn", k, turn(k).norm(), limits.turn_rad_s))
                .or(over("joint speed", k, largest(rates(k)), limits.joint_speed_rad_s));
            let outside = !limits.workspace.contains(&tips[k].translation());
            let broken = broken.or(outside.then(|| format!("the tip is outside in pass {k}")));
            let unreached = self.arm.arm().first_violation(&points[k]).is_some();
            let broken = broken.or(unreached.then(|| format!("a joint is out of its range in pass {k}")));
            if broken.is_some() {
                return broken;
            }
        }
        for k in 0..points.len() - 2 {
            let acceleration = (velocity(k + 1) - velocity(k)).norm() / self.dt_s;
            let turning = (turn(k + 1) - turn(k)).norm() / self.dt_s;
            let (before, after) = (rates(k), rates(k + 1));
            let joint = largest(JointValues::from_fn(6, |i| (after[i] - before[i]) / self.dt_s));
            let broken = over("acceleration", k, acceleration, limits.acceleration_m_s2)
                .or(over("angular acceleration", k, turning, limits.turn_acceleration_rad_s2))
                .or(over("joint acceleration", k, joint, limits.joint_acceleration_rad_s2));
            if broken.is_some() {
                return broken;
            }
        }
        None
    }
}

#[test]
fn the_tip_comes_to_a_goal_that_stands_without_passing_it() {
    let (arm, limits) = (arm(), open());
    for dt_s in [0.005, 0.05, 0.1] {
        let mut run = Run::new(&arm, &limits, START, dt_s);
        let start = arm.tip(&START);
        let goal = still(Pose::from_isometry(moved(
            start.isometry(),
            &Vector3::new(-0.08, 0.1, 0.06),
            &Vector3::new(0.1, 0.3, -0.2),
        )));
        let mut before = start.distance_to(&goal.base_from_tip);
        for _ in 0..(4.0 / dt_s) as usize {
            let now = run.pass(Some(&goal)).distance_to(&goal.base_from_tip);
            assert!(now.0 <= before.0 + 1e-9 && now.1 <= before.1 + 1e-7, "it moves away: {before:?} {now:?}");
            before = now;
        }
        assert!(before.0 < 1e-6 && before.1 < 1e-6, "{before:?} after 4 s");
        run.rest();
        assert_eq!(run.broken_limit(&limits), None);
        assert_eq!(run.plan.obstacle(), None);
    }
}

#[test]
fn along_with_a_goal_on_a_circle_the_tip_lags_by_less_than_a_millimetre() {
    let (arm, limits) = (arm(), open());
    let (radius_m, speed_m_s) = (0.1, 0.05);
    let start = *arm.tip(&START).isometry();
    let centre = start.translation.vector - Vector3::x() * radius_m;
    // It swings about the vertical by 0.2 rad meanwhile.
    let (swing_rad, swing_rad_s) = (0.2, 0.2);
    let goal_at = |time_s: f64| {
        let (sin, cos) = (speed_m_s / radius_m * time_s).sin_cos();
        let position = centre + Vector3::new(cos, sin, 0.0) * radius_m;
        let turn = Vector3::z() * swing_rad * (swing_rad_s / swing_rad * time_s).sin();
        let rotation = UnitQuaternion::from_scaled_axis(turn) * start.rotation;
        FollowGoal {
            base_from_tip: Pose::from_isometry(Isometry3::from_parts(Translation3::from(position), rotation)),
            velocity_m_s: Vector3::new(-sin, cos, 0.0) * speed_m_s,
            angular_velocity_rad_s: Vector3::z() * swing_rad_s * (swing_rad_s / swing_rad * time_s).cos(),
        }
    };
    let mut run = Run::new(&arm, &limits, START, DT_S);
    let mut worst = (0.0_f64, 0.0_f64);
    for pass in 1..=250 {
        let goal = goal_at(f64::from(pass) * DT_S);
        let (lag_m, lag_rad) = run.pass(Some(&goal)).distance_to(&goal.base_from_tip);
        if pass > 20 {
            worst = (worst.0.max(lag_m), worst.1.max(lag_rad));
        }
    }
    assert!(worst.0 < 1e-3 && worst.1 < 1e-3, "{worst:?}");
    run.rest();
    assert_eq!(run.broken_limit(&limits), None);
}

#[test]
fn the_noise_of_a_goal_from_images_hardly_shakes_the_arm() {
    let (arm, limits) = (arm(), open());
    let start = arm.tip(&START);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut noise = |most: f64| Vector3::from_fn(|_, _| rng.random_range(-most..most));
    let mut run = Run::new(&arm, &limits, START, DT_S);
    let mut before = Vector3::zeros();
    let mut most_m_s2 = 0.0_f64;
    for _ in 0..400 {
        // ±0.1 mm, ±0.5 mrad, and what a filter makes of it as a velocity.
        let goal = FollowGoal {
            base_from_tip: Pose::from_isometry(moved(start.isometry(), &noise(1e-4), &noise(5e-4))),
            velocity_m_s: noise(1e-3),
            angular_velocity_rad_s: noise(5e-3),
        };
        let (off_m, off_rad) = run.pass(Some(&goal)).distance_to(&start);
        assert!(off_m < 5e-4 && off_rad < 2.5e-3, "{off_m} m, {off_rad} rad");
        most_m_s2 = most_m_s2.max((run.plan.now.velocity_m_s - before).norm() / DT_S);
        before = run.plan.now.velocity_m_s;
    }
    assert!(most_m_s2 < 0.1 * limits.acceleration_m_s2, "{most_m_s2} m/s²");
}

#[test]
fn a_goal_that_jumps_starts_no_wild_motion() {
    let (arm, limits) = (arm(), open());
    let mut run = Run::new(&arm, &limits, START, DT_S);
    let start = arm.tip(&START);
    for jump in 0..8 {
        let sign = if jump % 2 == 0 { 1.0 } else { -1.0 };
        let goal = shifted(&start, Vector3::new(0.0, 0.1, 0.05) * sign);
        // Not long enough to arrive: every jump meets a tip at full speed.
        for _ in 0..9 {
            run.pass(Some(&goal));
        }
    }
    assert!(run.rest() <= PASSES_TO_REST);
    assert_eq!(run.broken_limit(&limits), None);
}

#[test]
fn a_goal_that_leaves_the_workspace_ends_it_with_the_tip_inside() {
    let arm = arm();
    let start = arm.tip(&START);
    let wall = start.translation().z + 0.06;
    let limits = boxed(Point3::new(-2.0, -2.0, 0.0), Point3::new(2.0, 2.0, wall));
    for (speed_m_s, jump_m) in [(0.05, 0.0), (0.25, 0.0), (0.25, 0.05), (0.0, 0.5)] {
        let mut run = Run::new(&arm, &limits, START, DT_S);
        let mut goal = shifted(&start, Vector3::z() * jump_m);
        goal.velocity_m_s = Vector3::z() * speed_m_s;
        for pass in 1..200 {
            run.pass(Some(&goal.after(f64::from(pass) * DT_S)));
        }
        assert_eq!(run.plan.obstacle(), Some(FollowEnd::Workspace));
        assert!(run.plan.is_at_rest());
        assert_eq!(run.broken_limit(&limits), None);
    }
    assert_eq!(
        FollowPlan::new(&arm, &boxed(Point3::new(-2.0, -2.0, 1.9), Point3::new(2.0, 2.0, 2.0)), None, START, DT_S)
            .err(),
        Some(FollowEnd::Workspace),
        "outside nothing begins"
    );
}

#[test]
fn near_a_wall_the_tip_still_reaches_its_goal() {
    let arm = arm();
    let start = arm.tip(&START);
    let limits = boxed(Point3::new(-2.0, -2.0, 0.0), Point3::new(2.0, 2.0, start.translation().z + 0.1));
    let mut run = Run::new(&arm, &limits, START, DT_S);
    let goal = shifted(&start, Vector3::z() * 0.0999);
    for _ in 0..80 {
        run.pass(Some(&goal));
    }
    assert_eq!(run.plan.obstacle(), None);
    let left_m = run.plan.base_from_tip().distance_to(&goal.base_from_tip).0;
    assert!(left_m < 1e-5, "{left_m} m");
}

#[test]
fn a_goal_out_of_reach_ends_it_before_any_joint_is_wild() {
    let (arm, limits) = (arm(), open());
    let start = arm.tip(&START);
    let outwards = start.translation().normalize();
    for along in [outwards, Vector3::z(), -Vector3::x(), -Vector3::z() - outwards] {
        let mut run = Run::new(&arm, &limits, START, DT_S);
        let goal = shifted(&start, along.normalize() * 1.8);
        for _ in 0..400 {
            run.pass(Some(&goal));
        }
        assert!(
            matches!(run.plan.obstacle(), Some(FollowEnd::Singular | FollowEnd::Workspace)),
            "{:?} along {along:?}",
            run.plan.obstacle()
        );
        assert!(run.plan.is_at_rest());
        assert_eq!(run.broken_limit(&limits), None);
    }
}

#[test]
fn a_joint_at_the_end_of_its_range_ends_it_and_is_named() {
    let mut ranges = ArmKind::Ur5Coppeliasim.ranges();
    ranges[5].max = START[5] + 0.8;
    let (arm, limits) = (arm_within(&ranges), open());
    let start = arm.tip(&START);
    let mut run = Run::new(&arm, &limits, START, DT_S);
    let axis = start.rotation() * Vector3::z();
    let sign = {
        let mut turned = START;
        turned[5] += 0.01;
        axis.dot(&(arm.tip(&turned).rotation() * start.rotation().inverse()).scaled_axis()).signum()
    };
    let goal = FollowGoal { angular_velocity_rad_s: axis * sign * 0.8, ..still(start) };
    for pass in 1..100 {
        run.pass(Some(&goal.after(f64::from(pass) * DT_S)));
    }
    assert_eq!(run.plan.obstacle(), Some(FollowEnd::JointLimit { joint: 6 }));
    assert!(run.plan.is_at_rest());
    assert_eq!(run.broken_limit(&limits), None);
    let left_rad = ranges[5].max - run.plan.joints()[5];
    assert!((0.0..0.1).contains(&left_rad), "{left_rad} rad");
}

#[test]
fn an_arm_that_rests_goes_on_with_the_next_goal() {
    let (arm, limits) = (arm(), open());
    let start = arm.tip(&START);
    let mut run = Run::new(&arm, &limits, START, DT_S);
    for _ in 0..10 {
        run.pass(Some(&shifted(&start, Vector3::y() * 0.2)));
    }
    assert!(run.rest() <= PASSES_TO_REST);
    let goal = shifted(&start, Vector3::x() * 0.05);
    for _ in 0..100 {
        run.pass(Some(&goal));
    }
    assert!(run.plan.base_from_tip().distance_to(&goal.base_from_tip).0 < 1e-5);
    assert_eq!(run.broken_limit(&limits), None);
}

#[test]
fn after_a_pause_the_arm_starts_from_rest() {
    let (arm, limits) = (arm(), open());
    let goal = shifted(&arm.tip(&START), Vector3::y() * 0.2);
    let mut run = Run::new(&arm, &limits, START, DT_S);
    for _ in 0..10 {
        run.pass(Some(&goal));
    }
    run.plan.stand();
    let stood = *run.plan.joints();
    let mut again = Run::new(&arm, &limits, stood, DT_S);
    assert_eq!(run.pass(Some(&goal)), again.pass(Some(&goal)));
}

#[test]
fn numbers_without_sense_move_nothing_wildly() {
    let (arm, limits) = (arm(), open());
    let start = arm.tip(&START);
    for value in [f64::NAN, f64::INFINITY, 1e308, -1e200] {
        for kind in 0..3 {
            let mut goal = still(start);
            match kind {
                0 => goal.velocity_m_s.x = value,
                1 => goal.angular_velocity_rad_s.y = value,
                _ => goal = shifted(&start, Vector3::new(value, 0.0, 0.0)),
            }
            let mut run = Run::new(&arm, &limits, START, DT_S);
            for pass in 0..5 {
                run.pass(Some(&goal.after(f64::from(pass) * DT_S)));
            }
            assert!(run.points.iter().flatten().all(|q| q.is_finite()), "{value} as {kind}");
            run.rest();
            assert_eq!(run.broken_limit(&limits), None, "{value} as {kind}");
        }
    }
}

#[derive(Debug, Clone)]
struct Leg {
    passes: u32,
    /// Without a goal it stays at rest.
    goal: Option<FollowGoal>,
}

fn vector(most: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-most..most).prop_map(Vector3::from)
}

/// Goals that jump about: near where the arm begins, or anywhere it reaches, and moving on at more than it can.
fn legs(near: JointValues) -> impl Strategy<Value = Vec<Leg>> {
    let goal =
        (prop::array::uniform6(-1.0_f64..1.0), prop_oneof![Just(0.2), Just(0.8), Just(3.0)], vector(0.25), vector(0.8))
            .prop_map(move |(by, spread, velocity_m_s, angular_velocity_rad_s)| {
                let joints = JointValues::from_fn(6, |i| near[i] + by[i] * spread);
                FollowGoal { base_from_tip: arm().tip(&joints), velocity_m_s, angular_velocity_rad_s }
            });
    let leg = (1_u32..40, prop::option::weighted(0.85, goal)).prop_map(|(passes, goal)| Leg { passes, goal });
    prop::collection::vec(leg, 1..5)
}

fn starts() -> impl Strategy<Value = JointValues> {
    prop::array::uniform6(-3.0_f64..3.0).prop_map(JointValues::from)
}

/// The defaults, each up to three times smaller or larger.
fn any_limits() -> impl Strategy<Value = FollowLimits> {
    prop::array::uniform6(-1.0_f64..1.0).prop_map(|exponents| {
        let [a, b, c, d, e, f] = exponents.map(|exponent| 3.0_f64.powf(exponent));
        let limits = open();
        FollowLimits {
            speed_m_s: limits.speed_m_s * a,
            acceleration_m_s2: limits.acceleration_m_s2 * b,
            turn_rad_s: limits.turn_rad_s * c,
            turn_acceleration_rad_s2: limits.turn_acceleration_rad_s2 * d,
            joint_speed_rad_s: limits.joint_speed_rad_s * e,
            joint_acceleration_rad_s2: limits.joint_acceleration_rad_s2 * f,
            workspace: limits.workspace,
        }
    })
}

/// The longest way to rest that the limits allow [s]: from full speed in everything, one after the other.
fn longest_rest_s(limits: &FollowLimits) -> f64 {
    limits.speed_m_s / (BRAKING_SHARE * limits.acceleration_m_s2)
        + limits.turn_rad_s / (BRAKING_SHARE * limits.turn_acceleration_rad_s2)
        + limits.joint_speed_rad_s / limits.joint_acceleration_rad_s2
}

fn keeps_limits_and_ends_at_rest(
    limits: &FollowLimits,
    start: JointValues,
    legs: &[Leg],
    dt_s: f64,
) -> Result<(), TestCaseError> {
    let arm = arm();
    let mut run = Run::new(&arm, limits, start, dt_s);
    for leg in legs {
        for pass in 0..leg.passes {
            run.pass(leg.goal.map(|goal| goal.after(f64::from(pass) * dt_s)).as_ref());
        }
    }
    let passes = run.rest();
    prop_assert!(passes as f64 <= longest_rest_s(limits) / dt_s + 3.0, "{} passes to rest", passes);
    prop_assert_eq!(run.broken_limit(limits), None);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_goals_all_limits_hold_in_every_pass_and_the_arm_ends_at_rest(
        (start, legs) in starts().prop_flat_map(|start| (Just(start), legs(start))),
        dt_s in prop_oneof![Just(0.05), Just(0.02), Just(0.1)],
        limits in any_limits(),
    ) {
        keeps_limits_and_ends_at_rest(&limits, start, &legs, dt_s)?;
    }

    #[test]
    fn in_a_small_workspace_too(
        (start, legs) in starts().prop_flat_map(|start| (Just(start), legs(start))),
        room in prop::array::uniform6(0.0_f64..0.1),
    ) {
        let tip = Point3::from(arm().tip(&start).translation());
        let min = tip - Vector3::new(room[0], room[1], room[2]);
        let max = tip + Vector3::new(room[3], room[4], room[5]);
        let limits = boxed(min, max);
        // Goals are brought inside, or most would end it at once.
        let inside = |leg: &Leg| {
            let goal = leg.goal.map(|goal| {
                let at = goal.base_from_tip.translation();
                let at = Vector3::from_fn(|axis, _| at[axis].clamp(min[axis], max[axis]));
                let pose = Isometry3::from_parts(Translation3::from(at), goal.base_from_tip.rotation());
                FollowGoal { base_from_tip: Pose::from_isometry(pose), velocity_m_s: Vector3::zeros(), ..goal }
            });
            Leg { passes: leg.passes, goal }
        };
        let legs: Vec<Leg> = legs.iter().map(inside).collect();
        keeps_limits_and_ends_at_rest(&limits, start, &legs, DT_S)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, max_shrink_iters: 200, ..ProptestConfig::default() })]

    #[test]
    fn a_goal_that_stays_is_reached_or_it_is_said_why_not(
        start in starts(),
        by in prop::array::uniform6(-0.6_f64..0.6),
    ) {
        let (arm, limits) = (arm(), open());
        let goal = still(arm.tip(&JointValues::from_fn(6, |i| start[i] + by[i])));
        let mut run = Run::new(&arm, &limits, start, DT_S);
        for _ in 0..600 {
            run.pass(Some(&goal));
        }
        let (distance_m, angle_rad) = run.plan.base_from_tip().distance_to(&goal.base_from_tip);
        let is_there = distance_m < 1e-4 && angle_rad < 1e-4;
        prop_assert!(
            is_there || (run.plan.obstacle().is_some() && run.plan.is_at_rest()),
            "{} m, {} rad, {:?}", distance_m, angle_rad, run.plan.obstacle()
        );
        prop_assert_eq!(run.broken_limit(&limits), None);
    }
}

/// A box of 2 × 30 × 30 cm about a point.
fn wall(at: Vector3<f64>) -> planning::Surroundings {
    planning::Surroundings::of(vec![planning::Obstacle::new("wall", Isometry3::from(at), [0.02, 0.3, 0.3])])
}

#[test]
fn before_a_box_the_arm_stands_and_goes_on_when_the_goal_comes_back() {
    let arm = arm();
    let start = arm.tip(&START);
    let among = arm.among(wall(start.translation() + Vector3::new(0.25, 0.0, 0.0)), None);
    let limits = open();
    let mut run = Run::among(&arm, &limits, &among);
    let behind = shifted(&start, Vector3::new(0.25, 0.0, 0.0));
    for _ in 0..400 {
        run.pass(Some(&behind));
    }
    assert!(run.plan.is_kept_off());
    let away = shifted(&start, Vector3::new(-0.1, 0.0, 0.0));
    for _ in 0..200 {
        run.pass(Some(&away));
    }
    assert!(!run.plan.is_kept_off());
    assert!(run.arm.tip(run.plan.joints()).distance_to(&away.base_from_tip).0 < 1e-3);
    assert_eq!(run.plan.obstacle(), None);
    for joints in &run.points {
        assert_eq!(among.guard(&START).contact(joints), None, "{joints:?}");
    }
    let went_m = run.points.iter().map(|joints| run.arm.tip(joints).translation().x - start.translation().x);
    let went_m = went_m.fold(0.0, f64::max);
    assert!((0.05..0.25).contains(&went_m), "{went_m} m");
    run.rest();
    assert_eq!(run.broken_limit(&limits), None);
}

/// Cubes of 4 cm about the arm where it is half way, where it begins and ends free of them and could not go straight.
#[test]
fn past_a_box_that_is_too_near_to_its_way_the_arm_goes_on_to_its_goal() {
    let (arm, limits) = (arm(), open());
    let start = arm.tip(&START);
    let (way_m, speed_m_s) = (0.15, 0.05);
    let goal = |time_s: f64| {
        let (at_m, velocity_m_s) =
            if speed_m_s * time_s < way_m { (speed_m_s * time_s, speed_m_s) } else { (way_m, 0.0) };
        let velocity_m_s = Vector3::new(0.0, velocity_m_s, 0.0);
        FollowGoal { velocity_m_s, ..shifted(&start, Vector3::new(0.0, at_m, 0.0)) }
    };
    let passes = || (1..=240).map(|pass| goal(f64::from(pass) * DT_S));
    let mut free = Run::new(&arm, &limits, START, DT_S);
    for goal in passes() {
        free.pass(Some(&goal));
    }
    let apart_m = |joints: &JointValues| arm.tip(joints).distance_to(&goal(1e3).base_from_tip).0;
    let end = *free.plan.joints();
    assert!(apart_m(&end) < 1e-3, "{} m without a box", apart_m(&end));
    let (mut in_the_way, mut got_by) = (0, 0);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..3000 {
        let about = Vector3::from_fn(|_, _| (rng.random::<f64>() - 0.5) * 0.3);
        let at = start.translation() + Vector3::new(0.0, way_m / 2.0, 0.0) + about;
        let cube = planning::Obstacle::new("cube", Isometry3::from(at), [0.04; 3]);
        let among = arm.among(planning::Surroundings::of(vec![cube]), None);
        let touches = |joints: &JointValues| among.strict().contact(joints).is_some();
        if touches(&START) || touches(&end) || !free.points.iter().any(touches) {
            continue;
        }
        in_the_way += 1;
        let mut run = Run::among(&arm, &limits, &among);
        for goal in passes() {
            run.pass(Some(&goal));
        }
        got_by += u32::from(apart_m(run.plan.joints()) < 1e-3);
        run.rest();
        assert!(!run.points.iter().any(touches), "at {at}");
        assert_eq!(run.broken_limit(&limits), None);
        assert_eq!(run.plan.obstacle(), None, "at {at}");
    }
    println!("{got_by} of {in_the_way} boxes were gone past");
    // It stops before one in the middle of the way.
    assert!(got_by > 0, "none of {in_the_way}");
}
