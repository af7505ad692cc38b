//! Recordings of poses of the robot with poses of the target or recorded corners, in layouts with few hints.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use nalgebra::Isometry3;

use super::tests::{Written, in_hand, known, numbers, observed, pose_of, row, save_image};
use super::*;
use handeye_dataset::Dataset;
use handeye_estimate::handeye::Mode;

use handeye_estimate::{CameraKnowledge, Observations};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;

const VIEWS: usize = 9;

/// The robot's poses, and the target as an exact camera sees it.
fn pairs(session: &Observations, mode: Mode) -> Vec<(Isometry3<f64>, Isometry3<f64>)> {
    let links = handeye_simulate::session::links(mode);
    let pair = |view: usize| {
        let base_from_tip = session.views[view].base_from_tip.expect("a pose");
        (*base_from_tip.isometry(), *links.camera_from_target(&base_from_tip).isometry())
    };
    (0..session.views.len()).map(pair).collect()
}

fn judged_alone(path: &Path, settings: &Settings) -> Result<(Recording, Judgement), ImportError> {
    let recording = open(path)?;
    let sights = Sights { streams: vec![None; recording.streams.len()], target: None };
    let judgement = judge(&recording, &sights, settings, &CancelToken::default())?;
    Ok((recording, judgement))
}

/// The best hypothesis alone explains the recording and gives these poses.
fn is_understood(path: &Path, pairs: &[(Isometry3<f64>, Isometry3<f64>)], what: &str) {
    let (recording, judgement) = judged_alone(path, &in_hand()).unwrap_or_else(|why| panic!("{what}: {why}"));
    let best = &judgement.hypotheses[0];
    // Both lengths in another unit are the same recording of a smaller cell, which no data distinguish.
    let is_reported = |h: &&Hypothesis| h.reading.length == LengthUnit::Metre && h.explains();
    let metres = judgement.hypotheses.iter().find(is_reported).unwrap_or_else(|| panic!("{what}: {best:#?}"));
    let samples = &recording.tracks[metres.robot].samples;
    assert_eq!(samples.len(), pairs.len(), "{what}");
    for (sample, (pose, _)) in samples.iter().zip(pairs) {
        let found = metres.base_from_tip(sample).expect("a pose");
        let apart = se3::log(&(pose.inverse() * found.isometry())).norm();
        assert!(apart < 1e-6, "{what}: {apart} {}", recording.tracks[metres.robot].name);
    }
}

/// A rotation vector before the translation, and every other way to put two poses into a row.
#[test]
fn two_poses_in_a_row_are_read_in_every_order_that_they_may_have() {
    let session = observed(Mode::EyeInHand, VIEWS, 31);
    let pairs = pairs(&session, Mode::EyeInHand);
    let folder = tempfile::tempdir().expect("a folder");
    let turned = |n: Vec<f64>| [&n[3..], &n[..3]].concat();
    let of = |written: Written, is_turned: bool, pose: &Isometry3<f64>| {
        let plain = numbers(written, pose);
        if is_turned { turned(plain) } else { plain }
    };
    for (written, is_turned) in [
        (Written::VectorRadM, true),
        (Written::VectorRadM, false),
        (Written::RpyRadM, true),
        (Written::Xyzw, false),
        (Written::Xyzw, true),
        (Written::Matrix, false),
    ] {
        for counted in [false, true] {
            for by in [",", " ", "; "] {
                let mut text = String::new();
                for (i, (robot, seen)) in pairs.iter().enumerate() {
                    let both = [of(written, is_turned, robot), of(written, is_turned, seen)].concat();
                    let count = if counted { format!("{i}{by}") } else { String::new() };
                    let _ok = writeln!(text, "{count}{}", row(&both, by));
                }
                fs::write(folder.path().join("pairs.csv"), text).expect("written");
                is_understood(folder.path(), &pairs, &format!("{written:?} {is_turned} {counted} {by:?}"));
            }
        }
    }
}

#[test]
fn rows_that_say_what_they_are_of_are_a_series_each() {
    let session = observed(Mode::EyeInHand, VIEWS, 32);
    let pairs = pairs(&session, Mode::EyeInHand);
    for (robot, seen, header) in [
        ("hand,", "eye,", ""),
        ("hand: ", "eye: ", ""),
        ("robot ", "marker ", ""),
        ("A_#,", "B_#,", ""),
        ("tcp;", "board;", "kind;x;y;z;rx;ry;rz\n"),
    ] {
        let by = header.chars().nth(4).or_else(|| robot.chars().last()).map_or(",".to_owned(), String::from);
        let mut text = header.to_owned();
        for (i, (base_from_tip, camera_from_target)) in pairs.iter().enumerate() {
            let counted = |word: &str| word.replace('#', &i.to_string());
            let _ok = writeln!(text, "{}{}", counted(robot), row(&numbers(Written::VectorRadM, base_from_tip), &by));
            let _ok =
                writeln!(text, "{}{}", counted(seen), row(&numbers(Written::VectorRadM, camera_from_target), &by));
        }
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("session.csv"), text).expect("written");
        // A printed result is not a recording.
        fs::write(folder.path().join("result.yaml"), "hand_eye:\n  translation: {x: 0.1, y: 0.2, z: 0.3}\n")
            .expect("written");
        is_understood(folder.path(), &pairs, robot);
    }
}

#[test]
fn a_robot_that_did_not_move_is_called_so() {
    let session = observed(Mode::EyeInHand, VIEWS, 33);
    let pairs = pairs(&session, Mode::EyeInHand);
    let refusal = |jitter: f64| {
        let folder = tempfile::tempdir().expect("a folder");
        let mut text = String::new();
        for (i, (_, seen)) in pairs.iter().enumerate() {
            let mut robot = pairs[0].0;
            robot.translation.vector.x += jitter * (i % 3) as f64;
            let both = [numbers(Written::VectorRadM, &robot), numbers(Written::VectorRadM, seen)].concat();
            let _ok = writeln!(text, "{}", row(&both, ","));
        }
        fs::write(folder.path().join("pairs.csv"), text).expect("written");
        judged_alone(folder.path(), &Settings { poses: Some("pairs.csv:numbers 1-6".into()), ..Settings::default() })
            .err()
            .or_else(|| judged_alone(folder.path(), &Settings::default()).err())
            .map(|why| why.to_string())
    };
    let still = {
        let folder = tempfile::tempdir().expect("a folder");
        let table: String = pairs.iter().map(|_| row(&numbers(Written::Xyzw, &pairs[0].0), ",") + "\n").collect();
        fs::write(folder.path().join("poses.csv"), table).expect("written");
        (0..VIEWS).for_each(|view| save_image(&folder.path().join(format!("{view}.png")), view));
        judged_alone(folder.path(), &Settings::default()).expect_err("nothing to solve").to_string()
    };
    assert!(still.contains("the robot did not move: the 9 poses of poses.csv are all the same"), "{still}");
    let jitter = refusal(1e-5).expect("nothing to solve");
    assert!(jitter.contains("the robot did not move"), "{jitter}");
}

#[test]
fn a_robot_that_did_not_move_beside_a_target_that_did_is_called_so() {
    let session = observed(Mode::EyeInHand, VIEWS, 34);
    let pairs = pairs(&session, Mode::EyeInHand);
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::new();
    for (_, seen) in &pairs {
        let both = [numbers(Written::VectorRadM, &pairs[0].0), numbers(Written::VectorRadM, seen)].concat();
        let _ok = writeln!(text, "{}", row(&both, ","));
    }
    fs::write(folder.path().join("pairs.csv"), text).expect("written");
    let why = judged_alone(folder.path(), &Settings::default()).expect_err("nothing to solve").to_string();
    assert!(why.contains("the robot did not move"), "{why}");
}

/// `import log.xml` finds what the file names, and a refusal names the file.
#[test]
fn an_xml_that_is_named_finds_its_images_below_and_is_spoken_of() {
    let session = observed(Mode::EyeInHand, VIEWS, 35);
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::from("<?xml version=\"1.0\"?>\n<log>\n");
    for view in 0..VIEWS {
        save_image(&folder.path().join(format!("pics/shot{view:02}.png")), view);
        let n = numbers(Written::RpyDegMm, &pose_of(&session, view));
        let values =
            n.iter().enumerate().fold(String::new(), |all, (i, v)| format!("{all}<pose{0}>{v:?}</pose{0}>", i + 1));
        let _ok = writeln!(text, "<record><image>pics/shot{view:02}.png</image>{values}</record>");
    }
    fs::write(folder.path().join("log.xml"), text + "</log>\n").expect("written");
    for path in [folder.path().to_path_buf(), folder.path().join("log.xml")] {
        let (recording, judgement) = super::tests::judged(&path, &session, &in_hand());
        assert_eq!(judgement.verdict, Verdict::Decided, "{:#?}", judgement.hypotheses[0]);
        assert_eq!(judgement.hypotheses[0].pairing.rule, "name");
        let samples = &recording.tracks[judgement.hypotheses[0].robot].samples;
        let found = judgement.hypotheses[0].base_from_tip(&samples[3]).expect("a pose");
        assert!(se3::log(&(pose_of(&session, 3).inverse() * found.isometry())).norm() < 1e-6);
    }
    fs::write(folder.path().join("log.xml"), "<log><note>nothing</note></log>").expect("written");
    let why = judged_alone(&folder.path().join("log.xml"), &Settings::default()).expect_err("no poses").to_string();
    assert!(why.contains("log.xml has no fields that are poses"), "{why}");
}

/// Corners as another program has found them: whole, down the columns, by name or in one list.
#[test]
fn corners_in_json_become_the_corners_of_a_data_set() {
    let session = observed(Mode::EyeInHand, VIEWS, 36);
    let handeye_geometry::targets::TargetSpec::Chessboard(grid) = session.target else { panic!("a chessboard") };
    let (width, height) = session.image_size;
    let points = |view: usize| -> Vec<[f64; 2]> {
        session.views[view].corners.as_ref().expect("seen").iter().map(|corner| [corner.px.x, corner.px.y]).collect()
    };
    let down = |points: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        (0..points.len()).map(|at| points[(at % grid.rows) * grid.columns + at / grid.rows]).collect()
    };
    let board = format!("\"board_size\": [{}, {}], \"square_mm\": {}", grid.columns, grid.rows, grid.square_m * 1e3);
    let size = format!("\"image_size\": [{width}, {height}]");
    let forms: [(&str, &dyn Fn(usize) -> String); 4] = [
        ("pairs", &|view| format!("{{{size}, {board}, \"corners\": {{\"pixel\": {:?}}}}}", points(view))),
        ("nested", &|view| {
            let nested: Vec<[[f64; 2]; 1]> = points(view).into_iter().map(|point| [point]).collect();
            format!("{{\"width\": {width}, \"height\": {height}, {board}, \"image_points\": {nested:?}}}")
        }),
        ("down the columns", &|view| format!("{{{size}, {board}, \"points_px\": {:?}}}", down(points(view)))),
        ("by coordinates", &|view| {
            let points = points(view);
            let of = |axis: usize| points.iter().map(|point| point[axis]).collect::<Vec<f64>>();
            format!("{{{size}, {board}, \"detections\": {{\"u\": {:?}, \"v\": {:?}}}}}", of(0), of(1))
        }),
    ];
    let CameraKnowledge::Fixed(camera) = session.camera else { panic!("the camera is known") };
    let mut table = String::from("file_name,x,y,z,rx(deg),ry(deg),rz(deg)\n");
    for view in 0..VIEWS {
        let mut n = numbers(Written::VectorDegMm, &pose_of(&session, view));
        n[..3].iter_mut().for_each(|mm| *mm *= 1e-3);
        let _ok = writeln!(table, "frame_{view}.json,{}", row(&n, ","));
    }
    for (form, text) in forms {
        let folder = tempfile::tempdir().expect("a folder");
        for view in 0..VIEWS {
            fs::write(folder.path().join(format!("frame_{view}.json")), text(view)).expect("written");
        }
        fs::write(folder.path().join("robot_poses.csv"), &table).expect("written");
        let recording = open(folder.path()).expect("a recording");
        let found = recording.targets.first().unwrap_or_else(|| panic!("{form}: {recording:#?}"));
        let handeye_geometry::targets::TargetSpec::Chessboard(described) = found.target else {
            panic!("{form}: a chessboard")
        };
        assert_eq!((described.columns, described.rows), (grid.columns, grid.rows), "{form}");
        assert!((described.square_m - grid.square_m).abs() < 1e-9, "{form}");
        let [stream] = recording.streams.as_slice() else { panic!("{form}: {:?}", recording.streams) };
        let sight = Sight::of_points(session.target, stream, None, CameraKnowledge::Fixed(camera)).expect("seen");
        let sights = Sights { streams: vec![Some(sight)], target: Some(session.target) };
        let judgement = judge(&recording, &sights, &in_hand(), &CancelToken::default()).expect("hypotheses");
        assert_eq!(judgement.verdict, Verdict::Decided, "{form}: {:#?}", judgement.hypotheses[0]);
        let settings = in_hand();
        let context = known(&recording, &judgement, &settings, session.target);
        let out = folder.path().join("out");
        write::write(&plan(&judgement.hypotheses[0], &context, None), &out, |_, _| {}).expect("written");
        let data = Dataset::read(&out).expect("a data set");
        assert_eq!(data.entries.len(), VIEWS, "{form}");
        let text = fs::read_to_string(out.join("corners.csv")).expect("corners");
        let rows = text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        let mut seen: Vec<(usize, [f64; 2])> = Vec::new();
        for cells in rows.filter(|cells| cells[0] == "view_0003") {
            let number = |at: usize| cells[at].parse::<f64>().expect("a number");
            seen.push((number(2) as usize * grid.columns + number(1) as usize, [number(3), number(4)]));
        }
        let want: Vec<(usize, [f64; 2])> = points(2).into_iter().enumerate().collect();
        assert_eq!(seen, want, "{form}");
    }
}

/// The size of the images is stated by the files or by a person, and by nothing else.
#[test]
fn the_size_of_images_that_are_not_there_is_never_guessed() {
    let session = observed(Mode::EyeInHand, VIEWS, 37);
    let folder = tempfile::tempdir().expect("a folder");
    for view in 0..VIEWS {
        let points: Vec<[f64; 2]> = session.views[view]
            .corners
            .as_ref()
            .expect("seen")
            .iter()
            .map(|corner| [corner.px.x, corner.px.y])
            .collect();
        fs::write(folder.path().join(format!("{view}.json")), format!("{{\"corners\": {points:?}}}")).expect("written");
    }
    let recording = open(folder.path()).expect("a recording");
    let of = |size: Option<(u32, u32)>| size_of_points(&recording.streams[0], size);
    assert!(of(None).expect_err("nobody says it").to_string().contains("--set image_size=WIDTHxHEIGHT"));
    assert!(of(Some((60, 40))).expect_err("it is another").to_string().contains("beside an image of 60×40 px"));
    let mut settings = Settings::default();
    settings.set(&format!("image_size={}x{}", session.image_size.0, session.image_size.1)).expect("a size");
    assert_eq!(of(settings.image_size), Ok(session.image_size));
    assert!(settings.set("image_size=big").is_err());
}
