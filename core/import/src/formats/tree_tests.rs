use super::*;
use crate::value::json;

fn found(text: &str) -> Vec<Track> {
    series(&json(text).expect("JSON"), "a.json")
}

#[test]
fn a_list_of_groups_of_matrices_is_two_series() {
    let group =
        |x: f64| format!("[[[1,0,0,{x}],[0,1,0,0],[0,0,1,0],[0,0,0,1]], [[0,-1,0,{x}],[1,0,0,0],[0,0,1,2],[0,0,0,1]]]");
    let text = format!("[{}]", (0..4).map(|i| group(f64::from(i))).collect::<Vec<_>>().join(","));
    let tracks = found(&text);
    assert_eq!(tracks.iter().map(|t| t.name.as_str()).collect::<Vec<_>>(), ["a.json:[0]", "a.json:[1]"]);
    assert!(tracks.iter().all(|t| t.samples.len() == 4));
}

#[test]
fn keys_that_count_are_a_series_in_the_order_of_their_numbers() {
    let text = r#"{"n": 3, "T1_10": [3,0,0,0,0,0,1], "T1_2": [2,0,0,0,0,0,1], "T1_0": [1,0,0,0,0,0,1]}"#;
    let tracks = found(text);
    assert_eq!(tracks.len(), 1, "{tracks:?}");
    let numbers: Vec<_> = tracks[0].samples.iter().map(|s| s.number).collect();
    assert_eq!(numbers, [Some(0), Some(2), Some(10)]);
}

#[test]
fn named_fields_images_and_joints_are_found_whatever_they_stand_in() {
    let entry = |i: usize| {
        format!(
            r#"{{"img": "cam/{i}.png", "state": {{"joints": [1,2,3,4,5,{i}],
               "tcp": {{"position": {{"x": {i}, "y": 0, "z": 1}}, "orientation": {{"w": 1, "x": 0, "y": 0, "z": 0}}}}}}}}"#
        )
    };
    let text = format!(r#"{{"data": {{"views": [{}]}}}}"#, (1..5).map(entry).collect::<Vec<_>>().join(","));
    let tracks = found(&text);
    assert_eq!(tracks.len(), 1, "{tracks:?}");
    let track = &tracks[0];
    assert_eq!((track.name.as_str(), track.role), ("a.json:data.views.state.tcp", Role::Robot));
    assert_eq!(track.samples[1].image.as_deref(), Some("cam/2.png"));
    assert_eq!(track.samples[1].joints, [1.0, 2.0, 3.0, 4.0, 5.0, 2.0]);
    assert_eq!(track.samples[1].numbers, Numbers::Quaternion([2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
}

#[test]
fn rotations_and_translations_that_stand_apart_belong_together_by_their_names() {
    let text = r#"{"R_gripper2base": [[[1,0,0],[0,1,0],[0,0,1]],[[1,0,0],[0,1,0],[0,0,1]],[[1,0,0],[0,1,0],[0,0,1]]],
                   "t_gripper2base": [[1,2,3],[4,5,6],[7,8,9]],
                   "R_target2cam": [[0,0,1],[0,1,0],[0,0,2]], "t_target2cam": [[1,2,3],[4,5,6],[7,8,9]]}"#;
    let tracks = found(text);
    let names: Vec<_> = tracks.iter().map(|t| (t.name.as_str(), t.role)).collect();
    assert_eq!(
        names,
        [("a.json:R_gripper2base+t_gripper2base", Role::Robot), ("a.json:R_target2cam+t_target2cam", Role::Target)]
    );
}

#[test]
fn lists_of_nothing_are_no_series() {
    let text = r#"{"topic": {"rotations": [], "translations": []}, "rotation": {"a": [], "b": []}}"#;
    assert!(found(text).is_empty());
}

#[test]
fn a_matrix_of_opencv_with_many_rows_is_a_table() {
    let rows = |of: &dyn Fn(usize) -> String| (0..5).map(of).collect::<Vec<_>>().join(", ");
    let text = format!(
        r#"{{"rvecs": {{"rows": 5, "cols": 1, "dt": "3d", "data": [{}]}},
            "tvecs": {{"rows": 5, "cols": 3, "dt": "d", "data": [{}]}}, "poses": {{"rows": 5, "cols": 6, "dt": "d", "data": [{}]}}}}"#,
        rows(&|i| format!("0.1, 0.2, 0.{i}")),
        rows(&|i| format!("1, 2, {i}")),
        rows(&|i| format!("{i}, 2, 3, 4, 5, 6"))
    );
    let tracks = found(&text);
    let names: Vec<_> = tracks.iter().map(|track| (track.name.as_str(), track.samples.len(), track.role)).collect();
    assert_eq!(names, [("a.json:poses", 5, Role::Unknown), ("a.json:rvecs+tvecs", 5, Role::Target)]);
    assert_eq!(tracks[1].samples[4].numbers, Numbers::Angles([1.0, 2.0, 4.0, 0.1, 0.2, 0.4]));
}
