use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;
use crate::testing as arms;
use crate::{ArmKind, JointKind};

/// Two links and a joint between, with the lines of the joint.
fn one_joint(kind: &str, lines: &str) -> String {
    format!(
        "<robot name=\"r\">\n<link name=\"a\"/>\n<link name=\"b\"/>\n<joint name=\"j\" type=\"{kind}\">\n\
         <parent link=\"a\"/><child link=\"b\"/>{lines}</joint>\n</robot>"
    )
}

const LIMIT: &str = "<limit lower=\"-1\" upper=\"2\" velocity=\"3\" effort=\"0\"/>";

fn arm_of(text: &str) -> Result<crate::Arm, UrdfError> {
    Urdf::parse(text, "r.urdf")?.arm(None, None)
}

fn problem(text: &str) -> UrdfProblem {
    *arm_of(text).expect_err("a bad file").problem
}

#[test]
fn a_joint_has_its_place_axis_range_and_speed() {
    let text =
        one_joint("revolute", &format!("<origin xyz=\"1 2 3\" rpy=\"0.1 0.2 0.3\"/><axis xyz=\"0 0 -2\"/>{LIMIT}"));
    let arm = arm_of(&text).expect("a good file");
    let joint = &arm.joints()[0];
    assert_eq!((joint.name.as_str(), joint.kind), ("j", JointKind::Revolute));
    assert_eq!((joint.range.min, joint.range.max, joint.range.speed), (-1.0, 2.0, 3.0));
    // Roll, pitch and yaw are turns about the fixed axes of the parent, in this order.
    let turn = |axis: Vector3<f64>| nalgebra::UnitQuaternion::from_scaled_axis(axis);
    let rotation = turn(Vector3::z() * 0.3) * turn(Vector3::y() * 0.2) * turn(Vector3::x() * 0.1);
    let tip = arm.forward(&[0.5]).expect("one joint");
    assert!(tip.rotation().angle_to(&(rotation * turn(Vector3::z() * -0.5))) < 1e-7);
    assert_eq!(tip.translation(), Vector3::new(1.0, 2.0, 3.0));
}

#[test]
fn what_a_file_leaves_out_is_what_urdf_says_it_is() {
    let arm = arm_of(&one_joint("continuous", "")).expect("a good file");
    assert_eq!(arm.joints()[0].axis, Vector3::x_axis());
    assert_eq!(arm.joints()[0].range, crate::JointRange::ENDLESS);
    let half = arm_of(&one_joint("prismatic", "<limit upper=\"0.5\"/>")).expect("lower is 0");
    assert_eq!((half.joints()[0].range.min, half.joints()[0].range.max), (0.0, 0.5));
    // Version 1.1 brought quaternions, 1.2 joints that state that they have no limits.
    let turned =
        one_joint("revolute", "<origin quat_xyzw=\"0 0 2 2\"/><limit/>").replace("name=\"r\"", "version=\"1.2\"");
    let turned = arm_of(&turned).expect("a good file");
    assert!(turned.forward(&[0.0]).expect("one").rotation().scaled_axis().z - FRAC_PI_2 < 1e-12);
    assert_eq!(turned.joints()[0].range.max, f64::INFINITY);
}

#[test]
fn fixed_joints_in_front_between_and_behind_belong_to_the_chain() {
    let text = r#"<robot name="r"><link name="w"/><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
        <joint name="f1" type="fixed"><parent link="w"/><child link="a"/><origin xyz="1 0 0"/></joint>
        <joint name="j" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="0" upper="1"/></joint>
        <joint name="f2" type="fixed"><parent link="b"/><child link="c"/><origin rpy="0 0 1.5707963267948966"/></joint>
        <joint name="f3" type="fixed"><parent link="c"/><child link="d"/><origin xyz="0 1 0"/></joint></robot>"#;
    let urdf = Urdf::parse(text, "r.urdf").expect("a good file");
    let tip = |base, tip| urdf.arm(base, tip).expect("a chain").forward(&[0.25]).expect("one").translation();
    assert!((tip(None, None) - Vector3::new(0.0, 0.0, 0.25)).norm() < 1e-12);
    assert!((tip(Some("a"), Some("c")) - Vector3::new(0.0, 0.0, 0.25)).norm() < 1e-12);
    assert!((tip(Some("w"), Some("b")) - Vector3::new(1.0, 0.0, 0.25)).norm() < 1e-12);
    let none = urdf.arm(Some("b"), Some("d")).expect_err("nothing moves").problem;
    assert!(matches!(*none, UrdfProblem::JointCount { got: 0, .. }), "{none}");
}

#[test]
fn the_ur5_of_ros_is_the_one_that_is_built_in() {
    let (ours, theirs) = (ArmKind::Ur5.arm(), Urdf::parse(arms::UR5.urdf, "ur5").expect("a good file"));
    // The manufacturer's base is the link `base`, which in ROS is half a turn from `base_link`.
    let ros = theirs.arm(Some("base_link"), Some("tool0")).expect("a chain");
    for n in 0..20 {
        let q: Vec<f64> = (0..6).map(|i| (f64::from(n * 7 + i * 3) * 0.7).sin() * 3.0).collect();
        let half_turn = nalgebra::Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
        let there = handeye_geometry::frames::Pose::from_isometry(half_turn * ros.forward(&q).expect("six").isometry());
        let (distance_m, angle_rad) = ours.forward(&q).expect("six").distance_to(&there);
        // The file has quarter turns of twelve digits.
        assert!(distance_m < 1e-10 && angle_rad < 1e-7, "{distance_m} {angle_rad}");
    }
}

#[test]
fn where_a_file_leaves_a_choice_the_candidates_are_named() {
    let urdf = Urdf::parse(arms::UR5.urdf, "ur5.urdf").expect("a good file");
    let error = urdf.arm(None, None).expect_err("two ends");
    let leaves = UrdfProblem::SeveralLeaves { links: vec!["base".to_owned(), "tool0".to_owned()] };
    assert_eq!(*error.problem, leaves);
    assert_eq!(error.to_string(), "ur5.urdf: has 2 links at an end, \"base\", \"tool0\": name the one that is the tip");
    let error = urdf.arm(None, Some("tool1")).expect_err("no such link");
    assert!(error.to_string().contains("no link \"tool1\"; it has \"base_link\", \"shoulder_link\""), "{error}");
    let error = urdf.arm(Some("tool0"), Some("base")).expect_err("elsewhere");
    assert!(matches!(*error.problem, UrdfProblem::NotBelow { .. }), "{error}");
    let two = one_joint("continuous", "").replace("<link name=\"b\"/>", "<link name=\"b\"/><link name=\"c\"/>");
    assert_eq!(problem(&two), UrdfProblem::SeveralRoots { links: vec!["a".to_owned(), "c".to_owned()] });
    assert!(Urdf::parse(&two, "r").expect("read").arm(Some("a"), None).is_ok(), "named, it is no question");
}

#[test]
fn a_gripper_that_no_chain_can_have_is_in_nobodys_way() {
    let text = arms::PANDA.urdf.replace(
        "</robot>",
        r#"<link name="l"/><link name="m"/>
        <joint name="finger" type="prismatic"><parent link="panda_link8"/><child link="l"/><axis xyz="nan 0 0"/></joint>
        <joint name="other" type="prismatic"><parent link="panda_link8"/><child link="m"/><mimic joint="finger"/></joint></robot>"#,
    );
    let urdf = Urdf::parse(&text, "panda.urdf").expect("a good file");
    assert_eq!(urdf.arm(None, Some("panda_link8")).expect("seven joints").joint_count(), 7);
    let error = urdf.arm(None, Some("m")).expect_err("mimic");
    assert_eq!(*error.problem, UrdfProblem::Mimic { joint: "other".to_owned(), of: "finger".to_owned() });
}

#[test]
fn what_is_wrong_with_a_joint_is_said_with_file_line_and_name() {
    let cases = [
        ("floating", "", "is floating"),
        ("planar", "", "is planar"),
        ("hinge", "", "is hinge"),
        ("revolute", "", "revolute joint \"j\" has no <limit>"),
        ("prismatic", "<limit velocity=\"1\"/>", "prismatic joint \"j\" has no <limit> with lower and upper"),
        ("continuous", "<axis xyz=\"0 0 0\"/>", "the axis of joint \"j\" is 0 0 0"),
        ("continuous", "<axis xyz=\"0 NaN 1\"/>", "xyz of <axis> of joint \"j\" is \"0 NaN 1\""),
        ("continuous", "<axis xyz=\"0 1\"/>", "it takes three numbers"),
        ("continuous", "<axis xyz=\"0 0 1 x\"/>", "it takes three numbers"),
        ("continuous", "<origin xyz=\"0 0 0,3\"/>", "xyz of <origin>"),
        ("continuous", "<origin rpy=\"0 0 inf\"/>", "three angles in radians"),
        ("continuous", "<origin quat_xyzw=\"0 0 0 1\"/>", "version 1.1"),
        ("continuous", "<origin xyz=\"0 0 333\"/>", "333 m, longer than any arm"),
        ("prismatic", "<limit lower=\"0\" upper=\"500\"/>", "are these millimetres?"),
        ("revolute", "<limit lower=\"nan\" upper=\"1\"/>", "lower of <limit> of joint \"j\" is \"nan\""),
        ("revolute", "<limit lower=\"2\" upper=\"1\"/>", "goes from 2 to 1"),
        ("revolute", "<limit lower=\"0\" upper=\"0\"/>", "goes from 0 to 0"),
        ("revolute", "<limit lower=\"0\" upper=\"1\" velocity=\"-1\"/>", "velocity of joint \"j\" is -1"),
        ("revolute", &format!("{LIMIT}<mimic joint=\"k\"/>"), "follows joint \"k\""),
    ];
    for (kind, lines, says) in cases {
        let error = arm_of(&one_joint(kind, lines)).expect_err(says).to_string();
        assert!(error.starts_with("r.urdf, line 4: ") && error.contains(says), "{kind} {lines}: {error}");
    }
}

#[test]
fn a_structure_that_is_no_tree_is_refused() {
    let joint = |name: &str, parent: &str, child: &str| {
        format!("<joint name=\"{name}\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>")
    };
    let robot = |joints: &str| {
        format!("<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>{joints}</robot>")
    };
    let (ab, bc) = (joint("ab", "a", "b"), joint("bc", "b", "c"));
    let ring = robot(&format!("{ab}{bc}{}", joint("ca", "c", "a")));
    assert!(matches!(problem(&ring), UrdfProblem::Loop { .. }), "{}", problem(&ring));
    let own = robot(&joint("aa", "a", "a"));
    assert!(matches!(problem(&own), UrdfProblem::Loop { .. }), "{}", problem(&own));
    // A loop separate from the root.
    let beside = robot(&format!("{bc}{}", joint("cb", "c", "b")));
    assert!(matches!(problem(&beside), UrdfProblem::Loop { .. }), "{}", problem(&beside));
    let closed = problem(&robot(&format!("{ab}{bc}{}", joint("ac", "a", "c"))));
    let (link, first, second) = ("c".to_owned(), "bc".to_owned(), "ac".to_owned());
    assert_eq!(closed, UrdfProblem::TwoParents { link, first, second });
    let lost = problem(&robot(&joint("ax", "a", "x")));
    assert_eq!(lost, UrdfProblem::UnknownLink { joint: "ax".to_owned(), end: "child", link: "x".to_owned() });
    let twice = problem(&robot(&format!("{ab}{}", joint("ab", "b", "c"))));
    assert_eq!(twice, UrdfProblem::Twice { element: "joint \"ab\"".to_owned() });
    let missing = robot("<joint name=\"j\" type=\"fixed\"><parent link=\"a\"/></joint>");
    assert!(problem(&missing).to_string().contains("joint \"j\" has no <child"), "{}", problem(&missing));
    assert!(problem("<robot name=\"r\"/>").to_string().contains("has no <link>"));
}

#[test]
fn files_that_are_no_urdf_say_what_they_are() {
    let xacro = r#"<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="m"/></robot>"#;
    let bare = r#"<robot name="r"><xacro:include filename="x"/></robot>"#;
    let text = r#"<robot name="r"><link name="${prefix}base"/></robot>"#;
    for source in [xacro, bare, text] {
        assert_eq!(problem(source), UrdfProblem::Xacro, "{source}");
    }
    assert!(problem(xacro).to_string().contains("run `xacro "));
    // The output of xacro keeps its namespace.
    let made = one_joint("continuous", "").replace("name=\"r\"", "xmlns:xacro=\"http://www.ros.org/wiki/xacro\"");
    assert!(arm_of(&made).is_ok());
    assert_eq!(problem("<sdf version=\"1.7\"/>"), UrdfProblem::NotUrdf { root: "sdf".to_owned() });
    let cut = arm_of(&arms::PANDA.urdf[..900]).expect_err("cut off");
    assert!(matches!(*cut.problem, UrdfProblem::NotXml(_)) && cut.line.is_none(), "{cut}");
    let crossed = arm_of(&one_joint("continuous", "</robot>")).expect_err("crossed");
    assert!(matches!(*crossed.problem, UrdfProblem::NotXml(_)) && crossed.line == Some(5), "{crossed}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let missing = Urdf::read(&folder.path().join("none.urdf")).expect_err("no file");
    assert!(matches!(*missing.problem, UrdfProblem::Unreadable(_)) && missing.file.ends_with("none.urdf"), "{missing}");
    let path = folder.path().join("panda.urdf");
    std::fs::write(&path, arms::PANDA.urdf).expect("written");
    assert_eq!(Urdf::read(&path).expect("read").arm(None, None).expect("a chain"), arms::PANDA.arm().expect("a chain"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(4), ..ProptestConfig::default() })]

    /// However a file is corrupted, the result is an arm whose numbers are finite, or an error.
    #[test]
    fn a_file_with_a_part_replaced_never_panics(
        file in proptest::sample::select(arms::ALL.to_vec()),
        at in 0.0..1.0_f64,
        length in 0_usize..60,
        put in proptest::sample::select(vec![
            "", "nan", "\"", "<", "/>", "-1e308", "0", "link0", "<joint/>", "mimic", "\u{0}", "1e400", "<!DOCTYPE x>",
        ]),
    ) {
        let text: Vec<char> = file.urdf.chars().collect();
        let begin = ((text.len() as f64) * at) as usize;
        let end = (begin + length).min(text.len());
        let broken: String = text[..begin].iter().copied().chain(put.chars()).chain(text[end..].iter().copied()).collect();
        if let Ok(arm) = Urdf::parse(&broken, file.name).and_then(|urdf| urdf.arm(None, Some(file.tip))) {
            let tip = arm.forward(&vec![0.1; arm.joint_count()]).expect("a value for each");
            prop_assert!(tip.is_finite());
        }
    }
}
