use super::*;
use crate::handeye::joint::{ArmErrors, SmallSample, arm_parameters};
use crate::reach_error::USUAL_TOOL;
use handeye_arm::{Arm, testing};

/// An arm of four joints whose zeros are off by a degree and whose links by a millimetre.
fn arm() -> CorrectedArm {
    let arm = testing::FOUR_JOINTS.arm().expect("an arm");
    let parameters = arm_parameters(4);
    let size = |k: usize| if parameters[k].error.kind() == 1 { 1e-3 } else { 1.0_f64.to_radians() };
    let values = (0..parameters.len()).map(|k| size(k) * ((k * k + 1) as f64).sin()).collect();
    corrected(arm, ArmErrors::new(4, values).expect("so many"))
}

fn corrected(arm: Arm, errors: ArmErrors) -> CorrectedArm {
    let count = errors.number_count();
    CorrectedArm {
        arm,
        errors,
        covariance: DMatrix::identity(count, count) * 1e-10,
        unexplained: (2e-5, 1e-5),
        small_sample: SmallSample::KNOWN,
        tool_m: USUAL_TOOL.into(),
    }
}

const JOINTS: [f64; 4] = [0.4, 0.3, 0.2, 0.7];

fn tool(arm: &CorrectedArm, pose: &Pose<Base, Tip>) -> Point3<f64> {
    pose.isometry() * Point3::from(arm.tool_m)
}

#[test]
fn the_tip_of_the_tool_arrives_and_turns_as_nearly_as_it_can() {
    let arm = arm();
    let wanted = arm.arm.forward(&JOINTS).expect("four joints");
    for near in [JOINTS, [0.2, 0.0, 0.5, 0.5], [-0.5, 0.8, -0.6, 1.0]] {
        let command = arm.command(&wanted, &near).expect("within reach");
        let actual = arm.actual(&command.joints_rad).expect("four joints");
        assert!((tool(&arm, &actual) - tool(&arm, &wanted)).norm() < 1e-9, "{near:?}");
        // With four joints one turn is left while the tool stays in its place.
        let off = actual.isometry().rotation.angle_to(&wanted.isometry().rotation);
        let uncorrected = arm.actual(&JOINTS).expect("four joints");
        assert!((tool(&arm, &uncorrected) - tool(&arm, &wanted)).norm() > 1e-3, "its errors are seen");
        for bend in [-0.3, -0.01, -1e-4, 1e-4, 0.01, 0.3] {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), bend);
            let other = Pose::from_isometry(Isometry3::from_parts(
                (tool(&arm, &wanted).coords - turn * wanted.isometry().rotation * arm.tool_m).into(),
                turn * wanted.isometry().rotation,
            ));
            let goal = PointGoal { base_from_tip: &other, free_about_tool: false, turn_rad: 1.0 };
            let other =
                arm.actual(&joints_for(&arm, &goal, &JOINTS, 1e-9).expect("within reach")).expect("four joints");
            assert!(other.isometry().rotation.angle_to(&wanted.isometry().rotation) >= off - 1e-9, "{near:?}, {bend}");
        }
    }
}

#[test]
fn an_orientation_that_the_arm_does_not_have_is_refused_and_a_rotation_about_the_tool_may_be_free() {
    let arm = arm();
    let there = arm.arm.forward(&JOINTS).expect("four joints");
    let about_tool = UnitQuaternion::from_scaled_axis(Vector3::z() * 1.0);
    let turned = Pose::from_isometry(there.isometry() * about_tool);
    let refused = arm.command(&turned, &JOINTS).expect_err("no fifth joint");
    assert!(
        matches!(refused, CorrectError::Orientation { joints: 4, angle_deg } if (40.0..65.0).contains(&angle_deg)),
        "{refused}"
    );
    let goal = PointGoal { base_from_tip: &turned, free_about_tool: true, turn_rad: 0.1 };
    let joints = joints_for(&arm, &goal, &JOINTS, 1e-9).expect("the direction of the tool is one that it has");
    let actual = arm.actual(&joints).expect("four joints");
    let wanted_direction = turned.isometry().rotation * arm.tool_m;
    assert!((actual.isometry().rotation * arm.tool_m).angle(&wanted_direction) < 0.1);
}

#[test]
fn a_place_out_of_reach_says_how_far_off_the_nearest_is() {
    let far = Pose::from_isometry(Isometry3::translation(2.0, 0.0, 0.1));
    let Err(CorrectError::Reach(IkError::NotFound { distance_mm, .. })) = arm().command(&far, &JOINTS) else {
        panic!("it is out of reach");
    };
    assert!((1000.0..2000.0).contains(&distance_mm), "{distance_mm}");
}
