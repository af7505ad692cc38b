use std::fs;
use std::path::Path;

use crate::{LengthUnit, Numbers, Recording, Role, Track, open};

fn folder(files: &[(String, String)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    }
    folder
}

fn read(files: &[(String, String)]) -> Recording {
    open(folder(files).path()).expect("a recording")
}

fn file(name: &str, text: impl Into<String>) -> (String, String) {
    (name.to_owned(), text.into())
}

/// The series that are not another reading of one, by name.
fn tracks(recording: &Recording) -> Vec<&Track> {
    recording.tracks.iter().filter(|track| track.reading_of.is_none()).collect()
}

fn six(i: usize) -> String {
    format!("{i}.5, 2, 3, 0.1, -0.2, 0.{i}")
}

#[test]
fn the_number_of_a_folder_counts_its_files() {
    let text = |i: usize| {
        format!(
            r#"{{"board_rvec": [[0.1], [0.2], [0.{i}]], "board_tvec": [[1], [2], [{i}]], "robot_position_mm": [1, 2, {i}],
                "robot_rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "image": "color.png"}}"#
        )
    };
    let files: Vec<_> = [3, 7, 11, 20].map(|i| (format!("take/view_{i:02}/data.json"), text(i))).into();
    let folder = folder(&files);
    for (name, _) in &files {
        image::GrayImage::new(4, 4).save(folder.path().join(name).with_file_name("color.png")).expect("saved");
    }
    let recording = open(folder.path()).expect("a recording");
    let [board, robot] = recording.tracks.as_slice() else { panic!("{:?}", recording.tracks) };
    assert_eq!((board.name.as_str(), board.role), ("take/view_#/data.json:board", Role::Target));
    assert_eq!((robot.name.as_str(), robot.role), ("take/view_#/data.json:robot", Role::Robot));
    assert_eq!(robot.stated.length.as_ref().map(|known| known.value), Some(LengthUnit::Millimetre));
    assert_eq!(robot.samples.iter().map(|s| s.number).collect::<Vec<_>>(), [Some(3), Some(7), Some(11), Some(20)]);
    assert_eq!(robot.samples[1].image.as_deref(), Some("take/view_07/color.png"), "the one beside it");
    let [stream] = recording.streams.as_slice() else { panic!("{:?}", recording.streams) };
    assert_eq!(stream.name, "take/view_#/color.png");
    assert_eq!(stream.images.iter().map(|i| i.number).collect::<Vec<_>>(), [Some(3), Some(7), Some(11), Some(20)]);
}

#[test]
fn folders_with_a_series_each_are_not_one_of_their_first_poses() {
    let text =
        |day: usize| format!("[{}]", (0..4).map(|i| format!("[{}]", six(10 * day + i))).collect::<Vec<_>>().join(","));
    let files: Vec<_> = (1..4).map(|day| (format!("day{day}/poses.json"), text(day))).collect();
    let recording = read(&files);
    let names: Vec<_> = recording.tracks.iter().map(|track| (track.name.as_str(), track.samples.len())).collect();
    assert_eq!(names, [("day1/poses.json", 4), ("day2/poses.json", 4), ("day3/poses.json", 4)]);
}

#[test]
fn a_report_has_its_poses_among_rows_of_other_numbers() {
    let block = |i: usize| format!("Pose: [{}]\nits axes are\n1 0 0\n0 1 0\n0 0 {i}\ndone\n", six(i).replace(',', ""));
    let recording = read(&[file("report.txt", (1..6).map(block).collect::<String>())]);
    let [track] = tracks(&recording)[..] else { panic!("{:?}", recording.tracks) };
    assert_eq!(track.samples.len(), 5);
    assert_eq!(track.samples[3].numbers, Numbers::Angles([4.5, 2.0, 3.0, 0.1, -0.2, 0.4]));
    assert_eq!(track.samples[3].image, None, "a word that all rows have is no name of an image");
}

#[test]
fn a_text_is_read_as_what_it_begins_with() {
    let yaml = (0..4).map(|i| format!("pose_{i}: [{}]\n", six(i))).collect::<Vec<_>>().concat();
    let json = format!("[{}]", (0..4).map(|i| format!(r#"{{"tcp": [{}]}}"#, six(i))).collect::<Vec<_>>().join(","));
    let recording = read(&[file("a.txt", format!("%YAML:1.0\n---\n{yaml}")), file("b.dat", json)]);
    let names: Vec<_> = tracks(&recording).iter().map(|track| (track.name.as_str(), track.samples.len())).collect();
    assert_eq!(names, [("a.txt:pose", 4), ("b.dat:tcp", 4)]);
}

#[test]
fn poses_in_parentheses_with_a_date_behind_them_are_read() {
    let row = |i: usize| format!("p({})     2021-02-0{i} 10:2{i}:59.119318\n", six(i));
    let recording = read(&[file("robot.txt", (1..6).map(row).collect::<String>())]);
    let [track] = tracks(&recording)[..] else { panic!("{:?}", recording.tracks) };
    assert_eq!((track.samples.len(), track.role), (5, Role::Robot));
    assert_eq!(track.samples[4].numbers, Numbers::Angles([5.5, 2.0, 3.0, 0.1, -0.2, 0.5]));
    assert!(track.stated.rotation.is_none() && track.stated.length.is_none(), "parentheses are no URScript");
}

#[test]
fn labelled_numbers_in_a_file_to_a_pose_are_its_fields() {
    let text = |i: usize| format!("tvec: [[{i}.]\n [2.]\n [3.]]\nrvec: [[0.1]\n [0.2]\n [0.3]]\n");
    let files: Vec<_> = (0..4).map(|i| (format!("view{i}.txt"), text(i))).collect();
    let recording = read(&files);
    let [track] = recording.tracks.as_slice() else { panic!("{:?}", recording.tracks) };
    assert_eq!((track.role, track.samples.len()), (Role::Target, 4));
    assert_eq!(track.samples[2].numbers, Numbers::Angles([2.0, 2.0, 3.0, 0.1, 0.2, 0.3]));
}

#[test]
fn a_document_is_of_what_its_file_is_called_after_where_it_says_nothing_itself() {
    let list = || format!("[{}]", (0..4).map(|i| format!("[{}]", six(i))).collect::<Vec<_>>().join(","));
    let role = |name: &str, text: String| read(&[file(name, text)]).tracks.first().map(|track| track.role);
    assert_eq!(role("robot_poses.yaml", list()), Some(Role::Robot));
    assert_eq!(role("board_poses.json", list()), Some(Role::Target));
    assert_eq!(
        role("handeye_data.json", list()),
        Some(Role::Unknown),
        "the hand of the calibration is not the robot's"
    );
    assert_eq!(role("camera.json", list()), Some(Role::Unknown), "a camera's poses may be of what carries it");
    assert_eq!(role("robot.json", format!(r#"{{"marker": {}}}"#, list())), Some(Role::Target), "the field says more");
}

#[test]
fn of_a_file_that_is_named_no_other_one_is_read_for_its_poses() {
    let rows = |by: &str| (0..4).map(|i| six(i).replace(", ", by)).collect::<Vec<_>>().join("\n");
    let yaml = (0..4).map(|i| format!("pose_{i}: [{}]\n", six(i))).collect::<Vec<_>>().concat();
    let camera = "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}\n\
                  distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
    let folder = folder(&[
        file("mine_1.yaml", yaml.clone()),
        file("mine_2.yaml", yaml.clone()),
        file("other.yml", yaml),
        file("other.dat", rows(" ")),
        file("other.log", rows(",")),
        file("ost.yaml", camera),
    ]);
    let named = |name: &str| open(&folder.path().join(Path::new(name))).expect("a recording");
    let recording = named("mine_1.yaml");
    assert_eq!(recording.tracks.iter().map(|t| t.name.as_str()).collect::<Vec<_>>(), ["mine_1.yaml:pose"]);
    assert_eq!(recording.cameras.len(), 1, "what it needs is read");
    let recording = named("other.dat");
    assert!(recording.tracks.iter().all(|track| track.name.starts_with("other.dat")), "{:?}", recording.tracks);
    assert!(!recording.tracks.is_empty() && recording.rows.len() == 1);
}

#[test]
fn poses_in_a_folder_of_images_of_the_board_are_not_the_boards() {
    let text = |i: usize| six(i).replace(", ", "\n");
    let files: Vec<_> = (0..4).map(|i| (format!("checkerboard/{i}.txt"), text(i))).collect();
    let folder = folder(&files);
    let role = |folder: &Path| open(folder).expect("a recording").tracks.first().map(|track| track.role);
    assert_eq!(role(folder.path()), Some(Role::Target), "of nothing but the folder's name");
    for i in 0..4 {
        image::GrayImage::new(4, 4).save(folder.path().join(format!("checkerboard/{i}.png"))).expect("saved");
    }
    assert_eq!(role(folder.path()), Some(Role::Unknown));
    let rows = (0..4).map(six).collect::<Vec<_>>().join("\n");
    let recording = read(&[file("board_images/robot_poses.csv", rows)]);
    assert!(recording.tracks.iter().all(|track| track.role != Role::Target), "{:?}", recording.tracks);
}
