use std::fs;
use std::path::PathBuf;

use super::super::open;
use super::*;
use crate::Recording;

fn angles(row: usize) -> [f64; 6] {
    std::array::from_fn(|i| (0.3 + 0.17 * i as f64) * ((row * (i + 2)) as f64).sin() - 0.4)
}

/// The poses that a chain makes of the only file of a folder, one entry a row.
fn poses(name: &str, text: &str, arm: &str) -> Result<Recording, ImportError> {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join(name), text).expect("written");
    fs::write(folder.path().join("arm.urdf"), URDF).expect("written");
    with_arm(&open(folder.path()).expect("a recording"), arm)
}

const URDF: &str = r#"<robot name="two"><link name="base"/><link name="a"/><link name="b"/><link name="tool"/>
    <joint name="pan" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
        <limit lower="-6" upper="6" velocity="1" effort="1"/></joint>
    <joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
    <joint name="end" type="fixed"><parent link="b"/><child link="tool"/><origin xyz="0.1 0 0"/></joint></robot>"#;

fn translation(track: &Track, row: usize) -> [f64; 3] {
    let Numbers::Matrix(m) = track.samples[row].numbers else { panic!("{track:?}") };
    [m[(0, 3)], m[(1, 3)], m[(2, 3)]]
}

/// ROS sorts the names of joints, so that the order of values is not that of the arm.
#[test]
fn joint_states_of_moveit_are_given_to_the_joints_that_they_name() {
    let order = [2usize, 1, 0, 3, 4, 5];
    let names: Vec<String> = order.iter().map(|i| format!("  - left_{}", ROS_NAMES_OF_UR[*i])).collect();
    let rows = (0..5).map(|row| format!("  - [{}]", order.map(|i| angles(row)[i].to_string()).join(", ")));
    let text = format!("joint_names:\n{}\njoint_values:\n{}\n", names.join("\n"), rows.collect::<Vec<_>>().join("\n"));
    let recording = poses("states.yaml", &text, "ur5e").expect("poses");
    let [track] = recording.tracks.as_slice() else { panic!("{:?}", recording.tracks) };
    for row in 0..5 {
        let truth = ArmKind::Ur5e.arm().forward(&angles(row)).expect("a pose");
        let Numbers::Matrix(m) = track.samples[row].numbers else { panic!("{track:?}") };
        assert!((m - truth.matrix()).amax() < 1e-12, "row {row}");
    }
    let why = track.stated.direction.as_ref().map(|known| known.why.clone()).unwrap_or_default();
    assert!(why.contains("ur5e") && why.contains("joint values"), "{why}");
    let why = poses("states.yaml", &text, "arm.urdf").expect_err("another arm").to_string();
    assert!(why.contains("left_elbow_joint") && why.contains("pan, slide"), "{why}");
}

#[test]
fn values_without_a_unit_are_tried_in_both_and_slides_stay_metres() {
    let rows: Vec<String> = (0..4).map(|i| format!("{},{}.5,0.{i}", i * 9, i)).collect();
    let text = format!("image,joint1,joint2\n{}", rows.join("\n"));
    assert!(poses("t.csv", &text, "arm.urdf").is_err(), "two columns may be anything");
    let rows: Vec<String> =
        (0..4).map(|i| format!("{{\"joints\": [{i}, 0.{i}, 0, 0], \"image\": \"{i}.png\"}}")).collect();
    let text = format!("[{}]", rows.join(","));
    let why = poses("j.json", &text, "arm.urdf").expect_err("four values for two joints").to_string();
    assert!(why.contains("4 joint values and the arm 2"), "{why}");
    let names = "joint_names: [slide, pan]\njoint_values: [[0.2, 1.0], [0.3, 0.5], [0.1, -1.0]]\n";
    let recording = poses("s.yaml", names, "arm.urdf,base=base,tip=tool").expect("poses");
    let at = translation(&recording.tracks[0], 0);
    let truth = [0.3 * 1.0f64.cos(), 0.3 * 1.0f64.sin(), 0.3];
    assert!(at.iter().zip(truth).all(|(a, b)| (a - b).abs() < 1e-12), "{at:?}");
}

#[test]
fn a_table_of_joint_angles_has_poses_in_every_unit_that_its_numbers_may_have() {
    let row = |unit: f64, row: usize| angles(row).map(|angle| (angle * unit).to_string()).join(",");
    let table = |unit: f64| {
        let rows: Vec<String> = (0..4).map(|i| format!("{i}.png,{}", row(unit, i))).collect();
        format!("image,q1,q2,q3,q4,q5,q6\n{}", rows.join("\n"))
    };
    let of = |text: &str| poses("t.csv", text, "ur5").expect("poses").tracks;
    assert_eq!(of(&table(1.0)).len(), 2, "radians, or small degrees");
    let degrees = of(&table(1f64.to_radians().recip()));
    assert_eq!(degrees.len(), 1, "no radians");
    let truth = ArmKind::Ur5.arm().forward(&angles(3)).expect("a pose").matrix();
    let Numbers::Matrix(m) = degrees[0].samples[3].numbers else { panic!("{degrees:?}") };
    assert!((m - truth).amax() < 1e-9);
    assert_eq!(degrees[0].samples[3].image.as_deref(), Some("3.png"));
}

#[test]
fn joint_values_without_a_chain_are_refused_with_what_to_give() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = (0..4).map(|row| format!("[{}]", angles(row).map(|a| a.to_string()).join(", ")));
    let text = format!("joint_names: [a, b, c, d, e, f]\njoint_values: [{}]\n", rows.collect::<Vec<_>>().join(", "));
    fs::write(folder.path().join("states.yaml"), text).expect("written");
    let recording = open(folder.path()).expect("a recording");
    assert!(recording.tracks.is_empty(), "joint values are no poses: {:?}", recording.tracks);
    let sights = crate::Sights::default();
    let settings = crate::Settings::default();
    let why = crate::judge(&recording, &sights, &settings, &handeye_geometry::progress::CancelToken::default())
        .expect_err("no poses")
        .to_string();
    assert!(why.contains("states.yaml has joint values alone") && why.contains("arm=NAME"), "{why}");
    let missing = PathBuf::from("nobody.urdf").display().to_string();
    let why = with_arm(&recording, &missing).expect_err("no such file").to_string();
    assert!(why.contains("ur5e"), "what is built in is named: {why}");
}

#[test]
fn rows_without_a_header_are_joint_values_for_an_arm_of_as_many_joints() {
    let rows = |first: &dyn Fn(usize) -> String| {
        (0..5).map(|row| format!("{}{}", first(row), angles(row).map(|a| a.to_string()).join(", "))).collect::<Vec<_>>()
    };
    for text in [rows(&|_| String::new()), rows(&|row| format!("{}, ", row + 3)), rows(&|row| format!("{row}.png, "))] {
        let recording = poses("angles.txt", &text.join("\n"), "ur5e").expect("poses");
        let track = recording.tracks.iter().find(|track| track.name.contains("rad")).expect("in radians");
        let truth = ArmKind::Ur5e.arm().forward(&angles(4)).expect("a pose").matrix();
        let Numbers::Matrix(m) = track.samples[4].numbers else { panic!("{track:?}") };
        assert!((m - truth).amax() < 1e-12, "{text:?}");
        assert!(recording.tracks.iter().all(|track| matches!(track.samples[0].numbers, Numbers::Matrix(_))));
    }
    let why =
        poses("angles.txt", &rows(&|_| String::new()).join("\n"), "arm.urdf").expect_err("two joints").to_string();
    assert!(why.contains("rows of 2 numbers"), "{why}");
}

/// Drivers of arms with a gripper report its fingers with the joints.
#[test]
fn of_more_values_than_the_arm_has_joints_the_first_are_taken_and_it_is_said() {
    let row = |row: usize| {
        let values: Vec<String> =
            angles(row).iter().map(f64::to_string).chain(["0.04".into(), "0.04".into()]).collect();
        format!("{{\"joint_torques\": [9, 9, 9, 9, 9, {row}], \"joint_values\": [{}]}}", values.join(", "))
    };
    let text = format!("[{}]", (0..4).map(row).collect::<Vec<_>>().join(","));
    let recording = poses("states.json", &text, "ur5e").expect("poses");
    let truth = ArmKind::Ur5e.arm().forward(&angles(2)).expect("a pose").matrix();
    let Numbers::Matrix(m) = recording.tracks[0].samples[2].numbers else { panic!("{:?}", recording.tracks) };
    assert!((m - truth).amax() < 1e-12, "torques are no angles");
    let reported = |text: &str| recording.beliefs.iter().any(|belief| belief.to_string().contains(text));
    assert!(reported("8 values a row: the first 6 are taken"), "{:?}", recording.beliefs);
}
