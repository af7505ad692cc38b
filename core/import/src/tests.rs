//! Whole recordings, simulated, in many forms and with many defects. The first pixel of each image encodes its view, so that
//! it is known whatever the name of the file is.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use image::{GrayImage, Luma};
use nalgebra::Isometry3;
use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

use super::*;
use handeye_dataset::Dataset;
use handeye_estimate::handeye::Mode;

use handeye_estimate::{CameraKnowledge, Observations};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;
use handeye_geometry::targets::TargetSpec;
use handeye_simulate::session::{Setup, observed as observed_session};

pub(super) fn observed(mode: Mode, views: usize, seed: u64) -> Observations {
    observed_session(&Setup::new(mode, views, seed))
}

pub(super) fn pose_of(session: &Observations, view: usize) -> Isometry3<f64> {
    *session.views[view].base_from_tip.expect("a pose").isometry()
}

pub(super) fn save_image(path: &Path, view: usize) {
    let mut image = GrayImage::new(16, 12);
    image.put_pixel(0, 0, Luma([view as u8]));
    fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    image.save(path).expect("saved");
}

fn view_of(path: &Path) -> usize {
    usize::from(handeye_images::load_gray(path).expect("an image").get_pixel(0, 0).0[0])
}

/// Views of the target in the existing images.
pub(super) fn sights(recording: &Recording, session: &Observations) -> Sights {
    let CameraKnowledge::Fixed(camera) = session.camera else { panic!("the camera is known") };
    let of = |stream: &Stream| {
        let corners: Vec<_> = stream
            .images
            .iter()
            .map(|image| session.views[view_of(&recording.root.join(&image.path))].corners.clone())
            .collect();
        Sight::of_corners(session.target, session.image_size, CameraKnowledge::Fixed(camera), &corners).ok()
    };
    Sights { streams: recording.streams.iter().map(of).collect(), target: Some(session.target) }
}

pub(super) fn judged(folder: &Path, session: &Observations, settings: &Settings) -> (Recording, Judgement) {
    let recording = open(folder).expect("a recording");
    let judgement =
        judge(&recording, &sights(&recording, session), settings, &CancelToken::default()).expect("hypotheses");
    (recording, judgement)
}

/// What is known where the target was given, the camera was not, and no hypothesis was chosen.
pub(super) fn known<'a>(
    recording: &'a Recording,
    judgement: &'a Judgement,
    settings: &'a Settings,
    target: TargetSpec,
) -> write::Context<'a> {
    let target = Some((target, "given with --target".to_owned()));
    write::Context { recording, judgement, settings, target, camera: None, is_taken: false }
}

pub(super) fn in_hand() -> Settings {
    Settings { mode: Some(Mode::EyeInHand), ..Settings::default() }
}

/// Ways to write a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Written {
    RpyRadM,
    RpyDegMm,
    KukaDegMm,
    VectorRadM,
    VectorDegMm,
    Xyzw,
    WxyzMm,
    Matrix,
    InverseMatrix,
    InverseXyzw,
}

const WRITTEN: [Written; 10] = [
    Written::RpyRadM,
    Written::RpyDegMm,
    Written::KukaDegMm,
    Written::VectorRadM,
    Written::VectorDegMm,
    Written::Xyzw,
    Written::WxyzMm,
    Written::Matrix,
    Written::InverseMatrix,
    Written::InverseXyzw,
];

pub(super) fn numbers(written: Written, pose: &Isometry3<f64>) -> Vec<f64> {
    let degrees = |angles: [f64; 3]| angles.map(f64::to_degrees);
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let vector: [f64; 3] = se3::rotation_vector(&pose.rotation).into();
    let t: [f64; 3] = pose.translation.vector.into();
    let mm = t.map(|v| v * 1e3);
    let q = pose.rotation.coords;
    match written {
        Written::RpyRadM => [t, [roll, pitch, yaw]].concat(),
        Written::RpyDegMm => [mm, degrees([roll, pitch, yaw])].concat(),
        Written::KukaDegMm => [mm, degrees([yaw, pitch, roll])].concat(),
        Written::VectorRadM => [t, vector].concat(),
        Written::VectorDegMm => [mm, degrees(vector)].concat(),
        Written::Xyzw => [t.as_slice(), &[q.x, q.y, q.z, q.w]].concat(),
        Written::WxyzMm => [mm.as_slice(), &[q.w, q.x, q.y, q.z]].concat(),
        Written::Matrix => pose.to_homogeneous().transpose().as_slice().to_vec(),
        Written::InverseMatrix => numbers(Written::Matrix, &pose.inverse()),
        Written::InverseXyzw => numbers(Written::Xyzw, &pose.inverse()),
    }
}

pub(super) fn row(numbers: &[f64], by: &str) -> String {
    numbers.iter().map(|n| format!("{n:?}")).collect::<Vec<_>>().join(by)
}

/// A table without a header, and images from 0.
pub(super) fn table_folder(session: &Observations, written: Written) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = String::new();
    for view in 0..session.views.len() {
        save_image(&folder.path().join(format!("images{view}.png")), view);
        let _ok = writeln!(table, "{}", row(&numbers(written, &pose_of(session, view)), ","));
    }
    fs::write(folder.path().join("poses.txt"), table).expect("written");
    folder
}

/// Pairs of view of the image and view of the pose that a hypothesis writes, and how far its poses are from the truth.
pub(super) fn written_pairs(
    recording: &Recording,
    h: &Hypothesis,
    session: &Observations,
) -> Vec<(usize, Option<usize>)> {
    let Source::Stream(stream) = h.source else { panic!("images were there") };
    let left_out: Vec<usize> = h.fit.iter().flat_map(|fit| fit.disagreeing.iter().map(|(s, _)| *s)).collect();
    let samples = &recording.tracks[h.robot].samples;
    let pairs = h.pairing.image_of.iter().enumerate().filter(|(sample, _)| !left_out.contains(sample));
    pairs
        .filter_map(|(sample, image)| {
            let image = &recording.streams[stream].images[(*image)?];
            let pose = h.base_from_tip(&samples[sample])?;
            let own = (0..session.views.len()).find(|view| {
                let (metres, radians) = pose.distance_to(&Pose::from_isometry(pose_of(session, *view)));
                metres < 1e-9 && radians < 1e-9
            });
            Some((view_of(&recording.root.join(&image.path)), own))
        })
        .collect()
}

#[test]
fn every_way_to_write_a_pose_is_found_by_the_data_once_the_place_of_the_camera_is_known() {
    for (seed, mode) in [(1, Mode::EyeInHand), (2, Mode::EyeToHand)] {
        let session = observed(mode, 15, seed);
        for written in WRITTEN {
            let folder = table_folder(&session, written);
            let settings = Settings { mode: Some(mode), ..Settings::default() };
            let (recording, judgement) = judged(folder.path(), &session, &settings);
            assert_eq!(judgement.verdict, Verdict::Decided, "{written:?} {mode:?}: {:#?}", judgement.hypotheses[0]);
            let pairs = written_pairs(&recording, &judgement.hypotheses[0], &session);
            assert_eq!(pairs.len(), 15, "{written:?}");
            assert!(pairs.iter().all(|(image, pose)| *pose == Some(*image)), "{written:?} {mode:?}: {pairs:?}");
        }
    }
}

#[test]
fn without_the_place_of_the_camera_both_are_listed_and_the_likelier_one_is_first() {
    for (seed, mode) in [(3, Mode::EyeInHand), (4, Mode::EyeToHand)] {
        let session = observed(mode, 12, seed);
        for written in [Written::RpyRadM, Written::Xyzw, Written::Matrix] {
            let folder = table_folder(&session, written);
            let (_, judgement) = judged(folder.path(), &session, &Settings::default());
            assert_eq!(judgement.verdict, Verdict::Ambiguous(2), "{written:?}: the equations are the same");
            let fit = judgement.hypotheses[0].fit.as_ref().expect("a fit");
            let [first, second] = [0, 1].map(|i| (judgement.hypotheses[i].mode, judgement.hypotheses[i].direction));
            assert_ne!(first, second);
            let nearer = fit.camera_at_m < fit.target_at_m;
            assert_eq!(first.0 == Mode::EyeInHand, nearer, "{written:?} {mode:?}");
        }
    }
}

#[test]
fn a_written_import_is_a_data_set_with_the_same_poses_to_nine_digits() {
    let session = observed(Mode::EyeInHand, 12, 5);
    let folder = table_folder(&session, Written::KukaDegMm);
    let (recording, judgement) = judged(folder.path(), &session, &in_hand());
    let settings = in_hand();
    let known = known(&recording, &judgement, &settings, session.target);
    for link in [false, true] {
        let home = tempfile::tempdir().expect("a folder");
        let out = home.path().join("set");
        fs::create_dir(&out).expect("made");
        let plan = plan(&judgement.hypotheses[0], &known, link.then_some(out.as_path()));
        write::write(&plan, &out, |_, _| ()).expect("written");
        let dataset = Dataset::read(&out).expect("a data set");
        assert_eq!(dataset.entries.len(), 12);
        for entry in &dataset.entries {
            let view = view_of(entry.image_path.as_ref().expect("an image"));
            let pose = entry.base_from_tip.expect("a pose");
            let (metres, radians) = pose.distance_to(&Pose::from_isometry(pose_of(&session, view)));
            assert!(metres < 1e-9 && radians < 1e-9, "{metres} {radians}");
        }
        let text = fs::read_to_string(out.join("dataset.toml")).expect("text");
        for reported in ["mode = eye_in_hand", "given with --set", "rotation = euler_zyx_123", "by the data: it leaves"]
        {
            assert!(text.contains(reported), "{reported:?} in\n{text}");
        }
        let again = write::write(&plan, &out, |_, _| ()).expect_err("there is something");
        assert!(matches!(again, ImportError::OutNotEmpty(_)), "{again}");
    }
}

#[test]
fn a_file_to_a_pose_in_json_and_yaml_gives_the_same_poses_and_joints() {
    let session = observed(Mode::EyeInHand, 10, 6);
    for ending in ["json", "yaml"] {
        let folder = tempfile::tempdir().expect("a folder");
        for view in 0..10 {
            save_image(&folder.path().join(format!("rgb/{view}.png")), view);
            let pose = numbers(Written::VectorRadM, &pose_of(&session, view));
            let text = format!("{{\"joints\": [1, 2, 3, 4, 5, {view}], \"pose_flange\": [{}]}}", row(&pose, ", "));
            fs::write(folder.path().join(format!("{view}.{ending}")), text).expect("written");
        }
        let (recording, judgement) = judged(folder.path(), &session, &in_hand());
        assert_eq!(judgement.verdict, Verdict::Decided, "{ending}: {:#?}", judgement.hypotheses[0]);
        let pairs = written_pairs(&recording, &judgement.hypotheses[0], &session);
        assert!(pairs.len() == 10 && pairs.iter().all(|(image, pose)| *pose == Some(*image)), "{pairs:?}");
        assert_eq!(recording.tracks[0].samples[3].joints[5], 3.0);
    }
}

#[test]
fn pose_pairs_without_images_are_understood_from_their_names_alone() {
    let session = observed(Mode::EyeToHand, 12, 7);
    let CameraKnowledge::Fixed(camera) = session.camera else { panic!("known") };
    let corners: Vec<_> = session.views.iter().map(|v| v.corners.clone()).collect();
    let sight =
        Sight::of_corners(session.target, session.image_size, CameraKnowledge::Fixed(camera), &corners).expect("poses");
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = String::from("%YAML:1.0\n---\nframeCount: 12\n");
    for view in 0..12 {
        for (name, pose) in [("gripper2base", pose_of(&session, view)), ("target2cam", sight.seen[view].expect("seen"))]
        {
            let data = row(&numbers(Written::Matrix, &pose), ", ");
            let _ok =
                writeln!(text, "{name}_{view}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: [ {data} ]");
        }
    }
    fs::write(folder.path().join("pairs.yml"), text).expect("written");
    let recording = open(folder.path()).expect("a recording");
    let settings = Settings { mode: Some(Mode::EyeToHand), ..Settings::default() };
    let judgement = judge(&recording, &Sights::default(), &settings, &CancelToken::default()).expect("hypotheses");
    let best = &judgement.hypotheses[0];
    assert_eq!((best.direction, best.reading.length), (Direction::Forward, LengthUnit::Metre), "{judgement:#?}");
    assert_eq!(best.target_reading.map(|(_, direction)| direction), Some(Direction::Forward));
    // The other way round of both fits as well; it is listed.
    assert_ne!(judgement.verdict, Verdict::Unexplained);
}

/// Damage to a folder.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Happened {
    Nothing,
    ImageMissing,
    ImagesMissing,
    RowMissing,
    ImageDoubled,
    RowDoubled,
    ImageReplaced,
    TwoSwapped,
    Renumbered,
    Padded,
    Shuffled,
    LettersOrder,
    RowAndImageMissing,
}

const HAPPENED: [Happened; 13] = [
    Happened::Nothing,
    Happened::ImageMissing,
    Happened::ImagesMissing,
    Happened::RowMissing,
    Happened::ImageDoubled,
    Happened::RowDoubled,
    Happened::ImageReplaced,
    Happened::TwoSwapped,
    Happened::Renumbered,
    Happened::Padded,
    Happened::Shuffled,
    Happened::LettersOrder,
    Happened::RowAndImageMissing,
];

/// How poses are linked to images.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Link {
    Order,
    Names,
    Numbers,
    Files,
}

const LINKS: [Link; 4] = [Link::Order, Link::Names, Link::Numbers, Link::Files];

fn happened_folder(session: &Observations, what: Happened, link: Link, rng: &mut ChaCha8Rng) -> TempDir {
    let count = session.views.len();
    let first = rng.random_range(0..3);
    let mut name: Vec<String> = (0..count).map(|view| format!("shot_{}", view + first)).collect();
    // The order of the rows, and the names of the files.
    let mut rows: Vec<usize> = (0..count).collect();
    let mut files: Vec<(usize, String)> = name.iter().cloned().enumerate().collect();
    if link == Link::Names {
        rows.shuffle(rng);
    }
    let one = rng.random_range(1..count - 1);
    let other = (one + rng.random_range(1..count - 2)) % count;
    match what {
        Happened::Nothing => {}
        Happened::ImageMissing => {
            files.remove(one);
        }
        Happened::ImagesMissing => files.retain(|(view, _)| *view != one && *view != other && *view != 0),
        Happened::RowMissing => {
            rows.remove(one);
        }
        Happened::RowAndImageMissing => {
            files.remove(one);
            rows.retain(|row| *row != other);
        }
        Happened::ImageDoubled => files.push((one, format!("shot_{}", count + first))),
        Happened::RowDoubled => rows.insert(one, rows[other]),
        Happened::ImageReplaced => files[one].0 = other,
        Happened::TwoSwapped => {
            let (a, b) = (files[one].1.clone(), files[other].1.clone());
            (files[one].1, files[other].1) = (b, a);
        }
        Happened::Renumbered => {
            for (view, file) in &mut files {
                *file = format!("shot_{}", *view + 100);
            }
        }
        Happened::Padded => {
            for (view, file) in &mut files {
                *file = format!("shot_{:04}", *view + first);
            }
        }
        Happened::Shuffled => {
            let mut names = name.clone();
            names.shuffle(rng);
            for ((_, file), new) in files.iter_mut().zip(names) {
                *file = new;
            }
        }
        Happened::LettersOrder => rows.sort_by(|a, b| name[*a].cmp(&name[*b])),
    }
    name.push(String::new());
    let folder = tempfile::tempdir().expect("a folder");
    for (view, file) in &files {
        save_image(&folder.path().join(format!("{file}.png")), *view);
    }
    let written = WRITTEN[rng.random_range(0..WRITTEN.len())];
    let text_of = |view: usize, by: &str| row(&numbers(written, &pose_of(session, view)), by);
    if link == Link::Files {
        for (place, view) in rows.iter().enumerate() {
            let is_by_place = what == Happened::LettersOrder || what == Happened::RowDoubled;
            let stem = if is_by_place { format!("pose_{}", place + first) } else { format!("pose_{}", view + first) };
            let text = format!("{{\"pose\": [{}]}}", text_of(*view, ", "));
            fs::write(folder.path().join(format!("{stem}.json")), text).expect("written");
        }
        return folder;
    }
    let mut table = String::new();
    for view in rows {
        let _ok = match link {
            Link::Names => writeln!(table, "{}.png {}", name[view], text_of(view, " ")),
            Link::Numbers => writeln!(table, "{} {}", view + first, text_of(view, " ")),
            Link::Order | Link::Files => writeln!(table, "{}", text_of(view, " ")),
        };
    }
    fs::write(folder.path().join("poses.txt"), table).expect("written");
    folder
}

/// Number of these folders that were paired correctly without a question, and of those that were listed or refused.
fn damaged_folders(seeds: std::ops::Range<u64>) -> (usize, usize) {
    let (mut right, mut refused) = (0, 0);
    for seed in seeds {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let what = HAPPENED[seed as usize % HAPPENED.len()];
        let link = LINKS[(seed as usize / HAPPENED.len()) % LINKS.len()];
        let session = observed(Mode::EyeInHand, rng.random_range(12..22), seed);
        let folder = happened_folder(&session, what, link, &mut rng);
        let (recording, judgement) = judged(folder.path(), &session, &in_hand());
        let best = &judgement.hypotheses[0];
        // What is written without a question, and what `--take best` writes.
        if judgement.verdict == Verdict::Unexplained {
            refused += 1;
            let is_harmless = matches!(what, Happened::Nothing | Happened::Padded);
            assert!(!is_harmless, "{seed} {what:?} {link:?}: {:#?}", judgement.hypotheses[0]);
            continue;
        }
        let pairs = written_pairs(&recording, best, &session);
        let wrong = pairs.iter().filter(|(image, pose)| *pose != Some(*image)).count();
        assert_eq!(wrong, 0, "{seed} {what:?} {link:?} {:?}: {pairs:?}\n{best:#?}", judgement.verdict);
        if judgement.verdict == Verdict::Decided {
            right += 1;
        } else {
            refused += 1;
        }
        if what == Happened::Nothing {
            assert_eq!(judgement.verdict, Verdict::Decided, "{seed} {link:?}: {judgement:#?}");
            assert_eq!(pairs.len(), session.views.len(), "{seed} {link:?}");
        }
    }
    println!("{right} paired rightly without a word, {refused} listed");
    (right, refused)
}

#[test]
fn a_folder_with_any_damage_and_any_way_to_name_images_is_paired_rightly_or_not_at_all() {
    let kinds = (HAPPENED.len() * LINKS.len()) as u64;
    let (right, _) = damaged_folders(0..kinds);
    assert!(2 * right > kinds as usize, "{right} of {kinds}: what is not in doubt is not refused");
}

#[test]
fn the_angle_of_a_view_is_that_of_its_rotation() {
    // The figure in degrees is what a person compares with the robot's data sheet.
    let session = observed(Mode::EyeInHand, 12, 9);
    let folder = table_folder(&session, Written::Xyzw);
    let (_, judgement) = judged(folder.path(), &session, &in_hand());
    let fit = judgement.hypotheses[0].fit.as_ref().expect("a fit");
    assert!(fit.median_rad < 0.2f64.to_radians() && fit.median_m < 1e-3, "{fit:?}");
}

/// Files of many formats, to be broken.
fn samples_of_formats(session: &Observations) -> Vec<(&'static str, Vec<u8>)> {
    let rows = |by: &str| {
        (0..5)
            .map(|v| row(&numbers(Written::Xyzw, &pose_of(session, v)), by))
            .collect::<Vec<_>>()
            .join("\n")
            .into_bytes()
    };
    let named = "image,x [mm],y,z,rx,ry,rz\na.png,1,2,3,4,5,6\nb.png,2,2,3,4,5,6\nc.png,3,2,3,4,5,6\n";
    let json = r#"[{"image": "a.png", "pose": {"position": {"x": 1, "y": 2, "z": 3}, "orientation": [0, 0, 0, 1]}, "q": [1,2,3,4,5,6]},
        {"image": "b.png", "pose": {"position": {"x": 2, "y": 2, "z": 3}, "orientation": [0, 0, 1, 0]}},
        {"image": "c.png", "pose": {"position": {"x": 3, "y": 2, "z": 3}, "orientation": [0, 1, 0, 0]}}]"#;
    let opencv = "%YAML:1.0\n---\nT1_0: !!opencv-matrix\n   rows: 4\n   cols: 4\n   data: [ 1., 0., 0., 1., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1. ]\n\
        T1_1: !!opencv-matrix\n   rows: 4\n   cols: 4\n   data: [ 1., 0., 0., 2., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1. ]\n\
        T1_2: !!opencv-matrix\n   rows: 4\n   cols: 4\n   data: [ 1., 0., 0., 3., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1. ]\n";
    let samples = "samples:\n- robot: {translation: {x: 1, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n  tracking: {translation: {x: 1, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n\
        - robot: {translation: {x: 2, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n  tracking: {translation: {x: 2, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n\
        - robot: {translation: {x: 3, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n  tracking: {translation: {x: 3, y: 2, z: 3}, rotation: {x: 0, y: 0, z: 0, w: 1}}\n";
    let blocks = "0:\nRotation:\n[[1. 0. 0.]\n [0. 1. 0.]\n [0. 0. 1.]]\nTranslation: [1, 2, 3]\nPose 1\nrvec = 1 2 3, tvec = 4 5 6\na.png\n\
        2:\nRotation:\n[1, 2, 3]\nTranslation:\nnp.array([[1.], [2.], [4.]]) 10:28:59\n";
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 6), }\n";
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    npy.extend_from_slice(&(header.len() as u16).to_le_bytes());
    npy.extend_from_slice(header.as_bytes());
    npy.extend((0..18).flat_map(|i| f64::from(i).to_le_bytes()));
    let camera = "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 600, 240, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
    let mut out = vec![
        ("a.txt", rows(" ")),
        ("a.csv", named.as_bytes().to_vec()),
        ("blocks.txt", blocks.as_bytes().to_vec()),
        ("a.json", json.as_bytes().to_vec()),
        ("a.yaml", opencv.as_bytes().to_vec()),
        ("a.samples", samples.as_bytes().to_vec()),
        ("a.npy", npy.clone()),
        ("ost.yaml", camera.as_bytes().to_vec()),
        ("b.xml", b"<root><camera><image_width>640</image_width><px>600</px><py>600</py><u0>320</u0><v0>240</v0></camera></root>".to_vec()),
        ("c.cameramodel", b"{ 'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [600, 600, 320, 240], 'imagersize': [640, 480] }".to_vec()),
    ];
    let mut zipped = std::io::Cursor::new(Vec::new());
    {
        use std::io::Write as _;
        let mut zip = zip::ZipWriter::new(&mut zipped);
        let options = zip::write::SimpleFileOptions::default();
        zip.start_file("poses.npy", options).expect("begun");
        zip.write_all(&npy).expect("written");
        zip.finish().expect("finished");
    }
    out.push(("a.npz", zipped.into_inner()));
    out
}

/// Changes bytes as a broken disk, an editor and an enemy do.
fn mutated(bytes: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..rng.random_range(1..6) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..7) {
            0 => bytes[at] = rng.random(),
            1 => bytes.truncate(at),
            2 => {
                let piece = bytes[at..(at + rng.random_range(1..40)).min(bytes.len())].to_vec();
                bytes.splice(at..at, piece);
            }
            3 => {
                bytes.drain(at..(at + rng.random_range(1..20)).min(bytes.len()));
            }
            4 => {
                let words: [&[u8]; 10] = [
                    b"nan",
                    b"1e999",
                    b"-",
                    b"[",
                    b"{",
                    b"&a *a",
                    b"99999999999999999999",
                    b"\"",
                    b"\n",
                    b"../../x.png",
                ];
                bytes.splice(at..at, words[rng.random_range(0..words.len())].iter().copied());
            }
            5 => bytes[at] = b"0123456789.,;- []{}:"[rng.random_range(0..20)],
            _ => bytes[at] ^= 1 << rng.random_range(0..8),
        }
    }
    bytes
}

fn survive(count: usize, seed: u64) {
    let session = observed(Mode::EyeInHand, 6, 11);
    let files = samples_of_formats(&session);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let folder = tempfile::tempdir().expect("a folder");
    for i in 0..count {
        let (name, bytes) = &files[i % files.len()];
        let path = folder.path().join(name);
        fs::write(&path, mutated(bytes, &mut rng)).expect("written");
        let recording = open(folder.path()).expect("a folder can always be listed");
        fs::remove_file(&path).expect("removed");
        // Not all of them: that is about reading.
        if i % 20 == 0 {
            let _judged = judge(&recording, &Sights::default(), &Settings::default(), &CancelToken::default());
        }
        assert!(recording.tracks.len() <= 64, "{name} grew");
    }
    assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 0, "nothing was written");
}

#[test]
fn ten_thousand_broken_files_of_all_formats_are_read_without_a_panic() {
    survive(10_000, 21);
}

mod slow {
    #[test]
    fn of_two_hundred_folders_with_lost_doubled_renamed_and_shuffled_files_none_is_paired_wrongly() {
        let (right, refused) = super::damaged_folders(1000..1200);
        assert_eq!(right + refused, 200);
        assert!(right > 100, "{right}: what is not in doubt is not refused");
    }

    #[test]
    fn a_hundred_thousand_broken_files_of_all_formats_are_read_without_a_panic() {
        super::survive(100_000, 22);
    }
}
