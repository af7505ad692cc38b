use std::fmt::Write as _;
use std::fs;

use super::*;
use crate::Dataset;
use handeye_estimate::placement::DISTANCE_LIMIT_M;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::tip_by_joint;

/// Degrees, as a person would copy them from a panel.
const JOINTS_DEG: [[f64; 6]; 5] = [
    [5.7, 40.1, -57.3, 5.7, 85.9, 11.5],
    [22.9, 51.6, -68.8, 17.2, 63.0, -28.6],
    [-17.2, 34.4, -45.8, -22.9, 103.1, 51.6],
    [11.5, 63.0, -80.2, 34.4, 74.5, 19.1],
    [40.1, 45.8, -63.0, -11.5, 91.7, 80.2],
];

fn radians(deg: &[f64; 6]) -> [f64; 6] {
    deg.map(f64::to_radians)
}

/// Pose of the tip of a UR5 on a table with a tool.
fn tip(joints_rad: &[f64; 6]) -> Pose<Base, Tip> {
    let arm = ArmModel::Kind(ArmKind::Ur5Coppeliasim).arm().expect("built in");
    let foot = nalgebra::Isometry3::translation(0.1, 0.2, 0.8) * arm.base_from_first;
    let tool = arm.flange_from_tip * nalgebra::Isometry3::translation(0.0, 0.02, 0.15);
    arm.mounted(foot, tool).forward(joints_rad).expect("six joints")
}

/// A data set without images, with the lines of `[robot]` about joints and a table of joint angles.
fn read(robot: &str, header: &str, joints: &[[f64; 6]]) -> Result<Dataset, String> {
    read_with(robot, header, joints, &[])
}

/// The same with more files.
fn read_with(robot: &str, header: &str, joints: &[[f64; 6]], files: &[(&str, &str)]) -> Result<Dataset, String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("in a folder")).expect("a folder");
        fs::write(path, text).expect("write");
    };
    for (name, text) in files {
        write(name, text);
    }
    let mut table = format!("image,x,y,z,qx,qy,qz,qw{header}\n");
    for (i, (deg, cells)) in JOINTS_DEG.iter().zip(joints).enumerate() {
        let tip = tip(&radians(deg));
        let (t, [x, y, z, w]) = (tip.translation(), tip.xyzw());
        write!(table, "{i}.png,{},{},{},{x},{y},{z},{w}", t.x, t.y, t.z).expect("text");
        for value in &cells[..header.matches(',').count()] {
            write!(table, ",{value}").expect("text");
        }
        table.push('\n');
    }
    write("poses.csv", &table);
    write("corners.csv", "image,column,row,u,v\n0.png,0,0,3,4\n");
    write(
        "dataset.toml",
        &format!(
            "mode = \"eye_in_hand\"\n[target]\nkind = \"chessboard\"\ncolumns = 4\nrows = 3\nsquare_m = 0.02\n\
             corners = \"corners.csv\"\n[camera]\nfixed = false\nwidth = 640\nheight = 480\n[robot]\n\
             poses = \"poses.csv\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n{robot}"
        ),
    );
    Dataset::read(folder.path()).map_err(|e| e.to_string())
}

const SIX: &str = ",q1,q2,q3,q4,q5,q6";
const UR5: &str = "joints = 6\njoint_unit = \"deg\"\n[robot.arm]\nkind = \"ur5_coppeliasim\"\n";

#[test]
fn joint_angles_and_an_arm_tell_how_the_tip_moves_with_each_joint() {
    // The central difference is off by h²/6; the angles are printed to all digits.
    const STEP: f64 = 1e-5;
    let data = read(UR5, SIX, &JOINTS_DEG).expect("a data set");
    let arm = data.arm.as_ref().expect("an arm");
    assert!(arm.placement.as_ref().expect("it fits").rms_m() < 1e-9);
    for (entry, deg) in data.entries.iter().zip(&JOINTS_DEG) {
        let q = radians(deg);
        assert_eq!(entry.joints_rad.as_deref(), Some(&q[..]));
        for j in 0..6 {
            let moved = |step: f64| {
                let mut q = q;
                q[j] += step;
                handeye_geometry::se3::log((tip(&radians(deg)).inverse() * tip(&q)).isometry())
            };
            let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            assert!((difference - tip_by_joint(&entry.tip_from_joints[j])).norm() < 1e-8, "joint {}", j + 1);
        }
    }
}

#[test]
fn the_rows_of_an_arm_do_as_well_as_its_name() {
    let dh = "joints = 6\njoint_unit = \"deg\"\n[robot.arm]\ndh = [\n\
              [0, 1.5707963267948966, 0.07455, 0], [-0.4251, 0, 0, -1.5707963267948966], [-0.39215, 0, 0, 0],\n\
              [0, 1.5707963267948966, 0.11, -1.5707963267948966], [0, -1.5707963267948966, 0.09475, 0],\n\
              [0, 0, 0.07495, 0]]\n";
    let (by_rows, by_name) = (read(dh, SIX, &JOINTS_DEG), read(UR5, SIX, &JOINTS_DEG));
    for (a, b) in by_rows.expect("rows").entries.iter().zip(&by_name.expect("a name").entries) {
        assert!(
            a.tip_from_joints
                .iter()
                .zip(&b.tip_from_joints)
                .all(|(a, b)| { (tip_by_joint(a) - tip_by_joint(b)).norm() < 1e-9 })
        );
        assert_eq!(a.tip_from_joints.len(), 6);
    }
}

/// The same arm as a URDF without a tool, and with a gripper next to its tip.
fn urdf() -> String {
    let arm = ArmModel::Kind(ArmKind::Ur5Coppeliasim).arm().expect("built in");
    let mut text = "<robot name=\"ur5\"><link name=\"l0\"/>".to_owned();
    let origin = |at: &nalgebra::Isometry3<f64>| {
        let (t, (roll, pitch, yaw)) = (at.translation, at.rotation.euler_angles());
        format!("<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>", t.x, t.y, t.z)
    };
    for (i, joint) in arm.joints().iter().enumerate() {
        let (at, axis) = (origin(&joint.previous_from_joint), joint.axis);
        write!(
            text,
            "<link name=\"l{}\"/><joint name=\"j{i}\" type=\"continuous\"><parent link=\"l{i}\"/><child link=\"l{}\"/>{at}\
             <axis xyz=\"{} {} {}\"/></joint>",
            i + 1,
            i + 1,
            axis.x,
            axis.y,
            axis.z
        )
        .expect("text");
    }
    let at =
        origin(&arm.frames(&[0.0; 6]).map(|at| at.base_from_link[5].inverse() * at.base_from_flange).expect("six"));
    let fixed = |name: &str, at: &str| {
        format!(
            "<link name=\"{name}\"/><joint name=\"to_{name}\" type=\"fixed\"><parent link=\"l6\"/><child link=\"{name}\"/>{at}</joint>"
        )
    };
    format!("{text}{}{}</robot>", fixed("flange", &at), fixed("gripper", ""))
}

#[test]
fn a_urdf_of_the_data_set_does_as_well_and_the_chain_comes_back_from_what_a_session_writes() {
    let of = |arm: &str| format!("joints = 6\njoint_unit = \"deg\"\n[robot.arm]\n{arm}");
    let with_urdf = |arm: &str| read_with(&of(arm), SIX, &JOINTS_DEG, &[("robots/ur5.urdf", &urdf())]);
    let read_urdf = with_urdf("urdf = \"robots/ur5.urdf\"\ntip = \"flange\"\n").expect("a URDF");
    let by_name = read(UR5, SIX, &JOINTS_DEG).expect("a name");
    let agree = |a: &Dataset, b: &Dataset| {
        assert!(a.arm.as_ref().expect("an arm").placement.as_ref().expect("it fits").rms_m() < 1e-8);
        for (a, b) in a.entries.iter().zip(&b.entries) {
            let pairs = a.tip_from_joints.iter().zip(&b.tip_from_joints);
            assert!(
                a.tip_from_joints.len() == 6
                    && pairs.map(|(a, b)| tip_by_joint(a) - tip_by_joint(b)).all(|d| d.norm() < 1e-8)
            );
        }
    };
    agree(&read_urdf, &by_name);
    assert!(read_urdf.text_files().any(|(name, _)| name == "robots/ur5.urdf"), "it is part of the input");
    let model = &read_urdf.arm.as_ref().expect("an arm").model;
    let written = crate::write::description(
        handeye_estimate::handeye::Mode::EyeInHand,
        &read_urdf.target,
        None,
        crate::write::Robot {
            joints: Some(crate::write::Joints::Of(model)),
            tool_m: Some([0.0, -0.02, 0.12]),
            accuracy_mm: Some(0.5),
        },
    );
    let robot = written.split_once("tool_m").expect("joints").1.replace("\"rad\"", "\"deg\"");
    let back = read(&format!("tool_m{robot}"), SIX, &JOINTS_DEG).unwrap_or_else(|why| panic!("{why}\n{written}"));
    assert_eq!(&back.arm.expect("an arm").model, model);
    assert_eq!((back.tool_m, read_urdf.tool_m), (Some([0.0, -0.02, 0.12]), None));
    assert_eq!((back.robot_accuracy_mm, read_urdf.robot_accuracy_mm), (Some(0.5), None));
    for bad in ["0", "-0.5", "nan", "200"] {
        let error = read(&format!("accuracy_mm = {bad}\n"), "", &JOINTS_DEG).expect_err(bad);
        assert!(error.contains("accuracy_mm") && error.contains("between 0.001 and 100"), "{error}");
    }
    for bad in ["[0, 0, 120]", "[0, 0.1]", "[0, 0, nan]"] {
        let error = read(&format!("tool_m = {bad}\n"), "", &JOINTS_DEG).expect_err(bad);
        assert!(error.contains("tool_m") && error.contains("three numbers x, y, z in metres"), "{error}");
    }
    for (arm, why) in [
        ("urdf = \"robots/none.urdf\"\n", "none.urdf"),
        ("urdf = \"robots/ur5.urdf\"\n", "robots/ur5.urdf"),
        ("urdf = \"robots/ur5.urdf\"\ntip = \"l4\"\n", "joints = 6, but the arm of [robot.arm] has 4"),
        ("kind = \"ur5\"\ntip = \"flange\"\n", "name the file"),
        ("kind = \"ur5\"\nurdf = \"robots/ur5.urdf\"\n", "one of kind, dh, urdf and chain"),
    ] {
        let error = with_urdf(arm).expect_err(why);
        assert!(error.contains(why), "{error}");
    }
}

#[test]
fn joint_angles_without_an_arm_are_kept_and_not_used() {
    let data = read("joints = 6\njoint_unit = \"rad\"\n", SIX, &JOINTS_DEG.map(|deg| radians(&deg))).expect("read");
    assert_eq!(data.arm, None);
    assert_eq!(data.entries[1].joints_rad.as_deref(), Some(&radians(&JOINTS_DEG[1])[..]));
    assert!(data.entries.iter().all(|entry| entry.tip_from_joints.is_empty()));
}

#[test]
fn joint_angles_that_do_not_belong_to_the_poses_are_not_used_and_the_data_set_says_why() {
    let mut swapped = JOINTS_DEG;
    swapped.swap(1, 3);
    let mut misread = JOINTS_DEG;
    misread[2][3] += 10.0;
    let turned = JOINTS_DEG.map(|deg| [deg[0], deg[1], -deg[2], deg[3], deg[4], deg[5]]);
    for (what, joints) in [("two rows swapped", swapped), ("a digit misread", misread), ("a sign", turned)] {
        let data = read(UR5, SIX, &joints).expect("it reads");
        let why = data.arm.expect("an arm").placement.expect_err(what);
        assert!(matches!(why, PlacementError::Foreign { .. }), "{what}: {why}");
        assert!(data.entries.iter().all(|entry| entry.tip_from_joints.is_empty()), "{what}");
        assert!(data.entries.iter().all(|entry| entry.joints_rad.is_some()), "{what}: kept");
    }
    // Rounded to half a degree the tip is off by 4 mm at most for each of the joints that are far from it.
    let halves = JOINTS_DEG.map(|deg| deg.map(|value| (2.0 * value).round() / 2.0));
    let data = read(UR5, SIX, &halves).expect("it reads");
    let placement = data.arm.expect("an arm").placement.expect("half degrees will do");
    assert!(placement.rms_m() > 1e-4 && placement.rms_m() < DISTANCE_LIMIT_M);
}

#[test]
fn a_defect_of_the_joint_angles_is_named_with_its_row() {
    /// Lines of `[robot]`, columns of joints, their angles, and what the message must contain.
    type Case = (&'static str, &'static str, [[f64; 6]; 5], &'static [&'static str]);
    let mut huge = JOINTS_DEG;
    huge[2][4] = 721.0;
    let kind = "[robot.arm]\nkind = \"ur5\"\n";
    let cases: [Case; 9] = [
        (UR5, "", JOINTS_DEG, &["poses.csv, row 1", "\"q1\" is missing", "qw,q1,q2,q3,q4,q5,q6"]),
        ("", SIX, JOINTS_DEG, &["poses.csv, row 1", "unknown column \"q1\""]),
        (UR5, ",q1,q3,q2,q4,q5,q6", JOINTS_DEG, &["poses.csv, row 1", "another order"]),
        (UR5, SIX, huge, &["poses.csv, row 4", "q5 = 721 deg", "joint_unit"]),
        ("joints = 6\n", SIX, JOINTS_DEG, &["dataset.toml, row 17", "needs joint_unit"]),
        ("joints = 13\njoint_unit = \"deg\"\n", SIX, JOINTS_DEG, &["dataset.toml, row 17", "joints = 13", "1 to 12"]),
        (kind, SIX, JOINTS_DEG, &["dataset.toml, row 17", "needs joints"]),
        (
            "joints = 6\njoint_unit = \"deg\"\n[robot.arm]\nkind = \"ur6\"\n",
            SIX,
            JOINTS_DEG,
            &["dataset.toml, row 20", "ur6", "`ur5`", "`ur5_coppeliasim`"],
        ),
        (
            "joints = 5\njoint_unit = \"deg\"\n[robot.arm]\nkind = \"ur5\"\n",
            ",q1,q2,q3,q4,q5",
            JOINTS_DEG,
            &["dataset.toml, row 19", "joints = 5", "has 6"],
        ),
    ];
    for (robot, header, joints, expected) in cases {
        let error = read(robot, header, &joints).expect_err(robot);
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}
