//! Servers that answer every call, and whose time does not go on as time does.

use std::time::Instant;

use super::*;
use crate::cell::{FollowLimits, FollowRequest};

/// Far longer than the limits of these tests.
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(20);

fn with_clock(clock: fn(f64) -> f64) -> Cell {
    let mut cell = cell(world());
    edit(&cell.world, |w| {
        w.clock = clock;
        w.targets = [0.5; JOINTS];
        w.follow = 0.5;
    });
    assert!(cell.client.arm().joint_values().is_ok());
    cell
}

fn settled(clock: fn(f64) -> f64) -> Result<f64, LinkError> {
    let started = Instant::now();
    let options = SettleOptions { longest: std::time::Duration::from_millis(100), ..SettleOptions::default() };
    let outcome = with_clock(clock).client.arm().settle(&options, &CancelToken::default());
    assert!(started.elapsed() < PATIENCE, "{:?}", started.elapsed());
    outcome
}

#[test]
fn an_arm_is_not_waited_for_by_a_clock_that_stands_or_runs_backwards_or_is_none() {
    for clock in [(|time_s| time_s) as fn(f64) -> f64, |time_s| time_s - 0.05] {
        let error = settled(clock).expect_err("no time");
        let LinkError::WaitedTooLong { awaited, .. } = &error else { panic!("{error}") };
        assert!(awaited.contains("simulated time to go on from"), "{error}");
        assert!(error.to_string().starts_with("waiting for the arm to stand still: waited"), "{error}");
    }
    for clock in [(|_| f64::NAN) as fn(f64) -> f64, |_| f64::INFINITY] {
        let error = settled(clock).expect_err("no time");
        assert!(
            matches!(&error, LinkError::UnexpectedReply { expected, .. } if expected == "a finite time"),
            "{error}"
        );
    }
}

#[test]
fn a_clock_that_hardly_goes_on_is_not_waited_for() {
    // Every pass is the distance to the next number, so the joints always seem to race.
    let mut cell = with_clock(f64::next_up);
    edit(&cell.world, |w| w.targets = [1e9; JOINTS]);
    edit(&cell.world, |w| w.follow = 1e-12);
    let options = SettleOptions { longest: std::time::Duration::from_millis(100), ..SettleOptions::default() };
    let error = cell.client.arm().settle(&options, &CancelToken::default()).expect_err("it races");
    assert!(matches!(&error, LinkError::WaitedTooLong { awaited, .. } if awaited.contains("at rest")), "{error}");
}

#[test]
fn a_simulation_that_was_started_again_is_waited_for_from_its_start() {
    // Time begins again once, and the arm comes to rest after that.
    let restarted = |time_s: f64| if time_s > 0.9 { 0.0 } else { time_s + 0.05 };
    let after_s = settled(restarted).expect("it comes to rest");
    assert!((0.1..0.9).contains(&after_s), "{after_s} s");
}

#[test]
fn a_jog_and_a_following_arm_do_not_wait_for_a_clock_that_stands() {
    let mut cell = with_clock(|time_s| time_s);
    edit(&cell.world, |w| w.targets = [0.0; JOINTS]);
    edit(&cell.world, |w| w.joints = [0.0; JOINTS]);
    let jog = ArmJog::Joint { index: 0, forward: true };
    let error = cell.client.arm().jog(&jog, None, &mut || Some(1.0)).expect_err("no pass");
    assert!(matches!(error, LinkError::WaitedTooLong { task: "jogging the arm", .. }), "{error}");

    edit(&cell.world, |w| (w.joints, w.targets) = ([0.1, 0.2, -0.9, 0.3, 0.8, 0.1], [0.1, 0.2, -0.9, 0.3, 0.8, 0.1]));
    let kinematics = ArmKinematics::ur5(
        nalgebra::Isometry3::identity(),
        nalgebra::Isometry3::identity(),
        &handeye_arm::ArmKind::Ur5Coppeliasim.ranges(),
    )
    .expect("ranges with room");
    let tip = kinematics.tip(&cell.client.arm().joint_values().expect("angles"));
    edit(&cell.world, |w| w.base_from_tip = tip);
    let outcome = cell.client.arm().follow(&kinematics, &FollowLimits::default(), &mut |_| FollowRequest::Rest);
    assert!(matches!(outcome, Err(LinkError::WaitedTooLong { task: "following", .. })), "{outcome:?}");
}
