use super::*;
use crate::tests::{folder, image, meta};
use crate::{Capture, Edit, EditError, Session, SessionMeta, Store};
use handeye_arm::{ArmKind, ArmModel, JointKind};
use handeye_dataset::Dataset;
use handeye_geometry::frames::{Base, Pose, Tip};

const JOINTS_RAD: [[f64; 6]; 4] = [
    [0.1, 0.7, -1.0, 0.1, 1.5, 0.2],
    [0.4, 0.9, -1.2, 0.3, 1.1, -0.5],
    [-0.3, 0.6, -0.8, -0.4, 1.8, 0.9],
    [0.2, 1.1, -1.4, 0.6, 1.3, 1.0 / 3.0],
];

fn ur5() -> ArmModel {
    ArmModel::Kind(ArmKind::Ur5Coppeliasim)
}

fn tip(joints_rad: &[f64]) -> Pose<Base, Tip> {
    ur5().arm().expect("built in").forward(joints_rad).expect("six joints")
}

fn store(folder: &std::path::Path, arm: Option<ArmModel>) -> Store {
    let mut store = Store::create(folder, SessionMeta { arm, ..meta() }).expect("create");
    for (i, joints) in JOINTS_RAD.iter().enumerate() {
        let image = image(i as u8);
        store.add_capture(&Capture { joints_rad: Some(joints), ..Capture::new(&image, tip(joints)) }).expect("add");
    }
    store
}

/// Poses of the joints relative to the tip in the captures that have them.
fn joints_of(document: &Document) -> BTreeMap<CaptureId, Vec<Isometry3<f64>>> {
    let placement = document.placement().expect("they belong together").expect("an arm");
    document.tip_from_joints(&placement)
}

#[test]
fn the_data_set_of_a_session_has_its_joints_and_tells_the_same_of_them() {
    let dir = folder();
    let mut store = store(dir.path(), Some(ur5()));
    store.apply(Edit::SetExcluded { ids: vec![CaptureId(2)], excluded: true }).expect("exclude");
    let by_session = joints_of(store.document());
    assert_eq!(by_session.len(), 4, "also of what is not in use");

    let data = Dataset::read(dir.path()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(data.arm.as_ref().map(|arm| arm.model.clone()), Some(ur5()));
    assert_eq!(data.entries.len(), 3);
    for (entry, index) in data.entries.iter().zip([0, 2, 3]) {
        assert_eq!(entry.joints_rad.as_deref(), Some(&JOINTS_RAD[index][..]), "every digit");
        let of_session = &by_session[&CaptureId(index as u32 + 1)];
        assert_eq!(entry.tip_from_joints.len(), 6);
        assert_eq!(&entry.tip_from_joints, of_session, "to the bit: the window and the command line solve the same");
    }
    let reopened = Session::open(dir.path()).expect("open");
    assert_eq!(reopened.document.meta.arm, Some(ur5()));
}

#[test]
fn a_session_without_an_arm_is_the_data_set_that_it_was_before_there_were_any() {
    let dir = folder();
    let store = store(dir.path(), None);
    assert_eq!(store.document().placement(), Ok(None));
    let (description, table) = store.document().as_dataset();
    let table = table.expect("it has a robot");
    assert!(!description.contains("joint") && table.starts_with("image,x,y,z,qx,qy,qz,qw\n"), "{description}");
    let json = std::fs::read_to_string(dir.path().join("session.json")).expect("read");
    assert!(!json.contains("\"arm\""));
}

/// Joints of a Panda, and of an arm on a track: a metre is not an angle, and is not converted.
#[test]
fn joints_of_an_arm_that_is_not_known_are_kept_in_session_and_data_set_whatever_their_number_and_kind() {
    let kinds = [vec![JointKind::Revolute; 7], vec![JointKind::Prismatic, JointKind::Revolute]];
    for (kinds, joints_rad) in kinds.into_iter().zip([&[0.1, -0.2, 0.3, -2.1, 0.5, 1.6, 0.7][..], &[-1.25, 3.0]]) {
        let dir = folder();
        let mut store =
            Store::create(dir.path(), SessionMeta { joint_kinds: Some(kinds.clone()), ..meta() }).expect("new");
        for n in 1..=3 {
            let (image, base_from_tip) = (image(n), tip(&JOINTS_RAD[usize::from(n)]));
            let capture = Capture { joints_rad: Some(joints_rad), ..Capture::new(&image, base_from_tip) };
            store.add_capture(&capture).expect("add");
        }
        let data = Dataset::read(dir.path()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((data.arm, data.entries.len()), (None, 3));
        assert!(data.entries.iter().all(|entry| entry.joints_rad.as_deref() == Some(joints_rad)), "every digit");
        drop(store);
        let reopened = Session::open(dir.path()).expect("open").document;
        assert_eq!(reopened.meta.joint_kinds, Some(kinds));
        assert!(reopened.captures.iter().all(|capture| capture.joints_rad.as_deref() == Some(joints_rad)));
        assert_eq!(reopened.placement(), Ok(None), "they are not used");
    }
    let none = SessionMeta { joint_kinds: Some(Vec::new()), ..meta() };
    assert!(Store::create(folder().path(), none).is_err(), "an arm has a joint");
}

#[test]
fn joints_of_another_arm_are_an_error_and_one_capture_without_joints_leaves_them_all_out() {
    let dir = folder();
    let mut store = store(dir.path(), Some(ArmModel::Kind(ArmKind::Ur5)));
    assert!(matches!(store.document().placement(), Err(PlacementError::Foreign { .. })), "its zero is another");
    let id = store.add_capture(&Capture::new(&image(9), tip(&[0.0; 6]))).expect("add");
    assert_eq!(store.document().placement(), Ok(None));
    assert_eq!(Dataset::read(dir.path()).unwrap_or_else(|e| panic!("{e}")).arm, None);
    store.apply(Edit::SetExcluded { ids: vec![id], excluded: true }).expect("exclude");
    assert!(matches!(store.document().placement(), Err(PlacementError::Foreign { .. })), "it no longer counts");
}

#[test]
fn a_capture_out_of_use_whose_joints_are_of_another_pose_has_nothing_to_tell() {
    let dir = folder();
    let mut store = store(dir.path(), Some(ur5()));
    let image = image(9);
    let wrong = Capture { joints_rad: Some(&JOINTS_RAD[0]), ..Capture::new(&image, tip(&JOINTS_RAD[2])) };
    let id = store.add_capture(&wrong).expect("add");
    assert!(matches!(store.document().placement(), Err(PlacementError::Foreign { view: 5, .. })));
    store.apply(Edit::SetExcluded { ids: vec![id], excluded: true }).expect("exclude");
    let reported = joints_of(store.document());
    assert_eq!(reported.into_keys().map(|id| id.0).collect::<Vec<_>>(), [1, 2, 3, 4]);
}

#[test]
fn a_session_with_an_impossible_arm_is_refused() {
    let bad = SessionMeta { arm: Some(ArmModel::Dh(vec![[425.0, 0.0, 0.0, 0.0]])), ..meta() };
    let error: EditError = bad.check().expect_err("millimetres");
    assert!(error.to_string().contains("arm"), "{error}");
}
