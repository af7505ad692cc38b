//! `--arm`: the chain of the arm by a name or a file, checked against what the robot reports.

use std::path::Path;

use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind, JointRange, JointValues};
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_estimate::placement::{JointView, place};
use handeye_geometry::frames::Pose;

use super::Failure;

/// Configurations at which the chain is compared.
const VIEWS: usize = 24;
/// Largest simulated displacement of each joint from its position: radians, or metres of a prismatic one.
const SPREAD: f64 = 0.7;
/// How far the chain may put the tip from where the robot reports it, metres and degrees: a tenth of the free space that the arm
/// keeps, so nothing is touched.
const MOST_M: f64 = 0.002;
const MOST_DEG: f64 = 0.5;

/// The named chain, with its base at the robot's, once it agrees with the poses that the robot reports: the arm is never moved
/// with one that does not.
pub fn checked(named: &str, read: &ArmKinematics, here: &JointValues) -> Result<ArmKinematics, Failure> {
    let arm = named_arm(named)?;
    let need = read.arm().joint_count();
    if arm.joint_count() != need {
        let got = arm.joint_count();
        return Err(Failure::unusable(anyhow::anyhow!(
            "--arm {named} has {got} joints and the robot has {need}: give the file of this robot, or leave the option out"
        )));
    }
    let ranges = read.arm().ranges();
    let joints: Vec<JointValues> = (0..VIEWS).map(|view| about(here, &ranges, view)).collect();
    let views: Vec<JointView<'_>> =
        joints.iter().map(|joints| JointView { base_from_tip: read.tip(joints), joints_rad: joints }).collect();
    let placed = place(&arm, &views).map_err(Failure::failed)?;
    let worst = |of: fn(&(f64, f64)) -> f64| placed.misses.iter().map(of).fold(0.0, f64::max);
    let (off_m, off_deg) = (worst(|miss| miss.0), worst(|miss| miss.1).to_degrees());
    // Written so that NaN counts as too far.
    if !(off_m <= MOST_M && off_deg <= MOST_DEG) {
        return Err(Failure::unusable(anyhow::anyhow!(
            "--arm {named} puts the tip up to {:.1} mm and {off_deg:.2}° from where the robot reports it: it is another arm, or \
             counts its joints from other zeros. Leave the option out: the chain is read from the simulation",
            off_m * 1e3
        )));
    }
    tracing::info!("the chain of {named} agrees with the robot to {:.2} mm and {off_deg:.3}°", off_m * 1e3);
    let within: Vec<JointRange> = placed.arm.ranges().iter().zip(&ranges).map(|(a, b)| both(a, b)).collect();
    if read.is_ur5() {
        // Its housings are known, unlike for any other description.
        return ArmKinematics::ur5(*read.base_from_arm(), *read.connection_from_tip(), &within)
            .map_err(Failure::unusable);
    }
    let base_from_arm = *read.base_from_arm();
    let (base_from_first, flange_from_tip) = (placed.arm.base_from_first, placed.arm.flange_from_tip);
    let arm = placed.arm.mounted(base_from_arm.inverse() * base_from_first, flange_from_tip);
    let arm = arm.with_ranges(&within).map_err(Failure::unusable)?;
    let known = ArmKinematics::new(arm, base_from_arm);
    debug_assert!(known.fits(here, &Pose::from_isometry(*read.tip(here).isometry())));
    Ok(known)
}

fn named_arm(named: &str) -> Result<Arm, Failure> {
    if let Some(kind) = ArmKind::ALL.into_iter().find(|kind| kind.name() == named) {
        return Ok(kind.arm());
    }
    if !Path::new(named).exists() {
        let names: Vec<&str> = ArmKind::ALL.into_iter().map(ArmKind::name).collect();
        return Err(Failure::unusable(anyhow::anyhow!(
            "--arm {named} is neither a file nor one of {}",
            names.join(", ")
        )));
    }
    Urdf::read(Path::new(named)).and_then(|urdf| urdf.arm(None, None)).map_err(Failure::unusable)
}

/// A configuration near the position of the arm, within its ranges; the first one is the position itself.
fn about(here: &JointValues, ranges: &[JointRange], view: usize) -> JointValues {
    JointValues::from_fn(here.len(), |joint| {
        // Spread evenly and differently for every joint, by multiples of the golden section.
        let part = (view as f64 * 0.618_033_988_749_894_8 * (joint as f64 + 1.0)).fract();
        let part = if part > 0.5 { part - 1.0 } else { part };
        (here[joint] + 2.0 * SPREAD * part).clamp(ranges[joint].min, ranges[joint].max)
    })
}

/// The intersection of two ranges.
fn both(a: &JointRange, b: &JointRange) -> JointRange {
    JointRange { min: a.min.max(b.min), max: a.max.min(b.max), speed: a.speed.min(b.speed) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    const HERE: [f64; 6] = [0.3, -1.2, 1.4, -1.7, -1.5, 0.2];

    fn read(kind: ArmKind) -> ArmKinematics {
        let arm = kind.arm().mounted(Isometry3::translation(0.0, 0.1, 0.0), Isometry3::translation(0.0, 0.0, 0.12));
        ArmKinematics::new(arm, Isometry3::translation(0.4, 0.0, 0.8))
    }

    #[test]
    fn a_chain_that_agrees_is_taken_wherever_the_robot_stands_and_whatever_its_tool() {
        let read = read(ArmKind::Ur5e);
        let known = checked("ur5e", &read, &JointValues::of(HERE)).unwrap_or_else(|failure| panic!("{failure:?}"));
        let elsewhere = [0.9, -0.8, 1.1, -1.2, -1.4, 1.2];
        let (off_m, off_rad) = known.tip(&elsewhere).distance_to(&read.tip(&elsewhere));
        assert!(off_m < 1e-6 && off_rad < 1e-6, "{off_m} m, {off_rad} rad");
        assert_eq!(known.base_from_arm(), read.base_from_arm());
    }

    #[test]
    fn a_chain_of_another_arm_is_refused_with_how_far_it_is_off() {
        for (named, says) in [("ur5", "mm and"), ("ur10e", "mm and"), ("no such arm", "neither a file nor one of ur3")]
        {
            let refused = checked(named, &read(ArmKind::Ur5e), &JointValues::of(HERE)).expect_err(named);
            let message = format!("{refused:?}");
            assert!(message.contains(says), "{named}: {message}");
        }
    }
}
