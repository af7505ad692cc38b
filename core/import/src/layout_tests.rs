//! Ways in which repositories store poses with images, each distinguished by the data alone from similar ones.

use std::fs;
use std::path::Path;

use nalgebra::Isometry3;

use super::tests::{in_hand, judged, observed, pose_of, save_image, written_pairs};
use super::*;
use handeye_estimate::handeye::Mode;
use handeye_geometry::se3;

const VIEWS: usize = 14;

/// Writes the poses of a session into a folder.
type Writer = fn(&Path, &[Isometry3<f64>]);

fn joined(numbers: impl IntoIterator<Item = f64>, by: &str) -> String {
    numbers.into_iter().map(|n| format!("{n:?}")).collect::<Vec<_>>().join(by)
}

fn lines(folder: &Path, name: &str, poses: &[Isometry3<f64>], row: impl Fn(usize, &Isometry3<f64>) -> String) {
    let text: Vec<String> = poses.iter().enumerate().map(|(i, pose)| row(i, pose)).collect();
    fs::write(folder.join(name), text.join("\n")).expect("written");
}

fn rotation_first(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.txt", poses, |_, pose| {
        let turn = pose.rotation.euler_angles();
        let degrees = [turn.0, turn.1, turn.2].map(f64::to_degrees);
        joined(degrees.into_iter().chain(pose.translation.vector.iter().map(|v| v * 1e3)), " ")
    });
}

fn a_number_to_a_line_rotation_first(folder: &Path, poses: &[Isometry3<f64>]) {
    for (i, pose) in poses.iter().enumerate() {
        let turn = pose.rotation.euler_angles();
        let degrees = [turn.0, turn.1, turn.2].map(f64::to_degrees);
        let text = joined(degrees.into_iter().chain(pose.translation.vector.iter().map(|v| v * 1e3)), "\n");
        fs::write(folder.join(format!("image_{i}.txt")), text + "\n").expect("written");
    }
}

fn translation_and_matrix(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.txt", poses, |_, pose| {
        let turn = pose.rotation.to_rotation_matrix();
        joined(pose.translation.vector.iter().copied().chain(turn.matrix().transpose().iter().copied()), " ")
    });
}

fn matrix_by_columns_and_translation(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.txt", poses, |_, pose| {
        let turn = pose.rotation.to_rotation_matrix();
        joined(turn.matrix().iter().copied().chain(pose.translation.vector.iter().copied()), ",")
    });
}

fn npy(shape: &str, numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}").into_bytes();
    header.resize(117, b' ');
    header.push(b'\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header);
    bytes.extend(numbers.into_iter().flat_map(f64::to_le_bytes));
    bytes
}

fn an_array_to_a_pose(folder: &Path, poses: &[Isometry3<f64>]) {
    for (i, pose) in poses.iter().enumerate() {
        let bytes = npy("4, 4", pose.to_homogeneous().transpose().iter().copied());
        fs::write(folder.join(format!("pose_{i}.npy")), bytes).expect("written");
    }
}

/// Writes arrays as `numpy.savez` does.
fn npz(path: &Path, arrays: &[(&str, Vec<u8>)]) {
    let mut zip = zip::ZipWriter::new(fs::File::create(path).expect("made"));
    for (name, bytes) in arrays {
        zip.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).expect("begun");
        std::io::Write::write_all(&mut zip, bytes).expect("written");
    }
    zip.finish().expect("written");
}

fn vectors_in_a_file_of_arrays(folder: &Path, poses: &[Isometry3<f64>]) {
    for (i, pose) in poses.iter().enumerate() {
        let turn: [f64; 3] = se3::rotation_vector(&pose.rotation).into();
        let arrays = [("rvec", npy("3, 1", turn)), ("tvec", npy("3, 1", pose.translation.vector.iter().copied()))];
        npz(&folder.join(format!("robot_{i}.npz")), &arrays);
    }
}

fn matrix_and_vector_in_a_file_of_arrays(folder: &Path, poses: &[Isometry3<f64>]) {
    for (i, pose) in poses.iter().enumerate() {
        let turn = pose.rotation.to_rotation_matrix();
        let place = npy("3", pose.translation.vector.iter().map(|v| v * 1e3));
        let arrays = [("R", npy("3, 3", turn.matrix().transpose().iter().copied())), ("t", place)];
        npz(&folder.join(format!("pose_{i:03}.npz")), &arrays);
    }
}

fn blocks_with_names(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.txt", poses, |i, pose| {
        let turn: [f64; 3] = se3::rotation_vector(&pose.rotation).into();
        let place = joined(pose.translation.vector.iter().copied(), ", ");
        format!("{i}:\nRotation:\n[{}]\nTranslation:\n[{place}]\n", joined(turn, ", "))
    });
}

fn a_folder_to_a_pose(folder: &Path, poses: &[Isometry3<f64>]) {
    for (i, pose) in poses.iter().enumerate() {
        let path = folder.join(format!("view_{i:02}"));
        fs::create_dir_all(&path).expect("made");
        fs::rename(folder.join(format!("image_{i}.png")), path.join("image.png")).expect("moved");
        let column = |[a, b, c]: [f64; 3]| format!("[[{a:?}], [{b:?}], [{c:?}]]");
        let vector = column(se3::rotation_vector(&pose.rotation).into());
        let place = column((pose.translation.vector * 1e3).into());
        let text = format!("{{\"tcp_position_mm\": {place}, \"tcp_rvec\": {vector}}}");
        fs::write(path.join("data.json"), text).expect("written");
    }
}

fn messages_echoed(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.yaml", poses, |i, pose| {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        format!(
            "header:\n  stamp:\n    sec: {}\n    nanosec: 5\n  frame_id: base\npose:\n  position:\n    x: {:?}\n    y: {:?}\n    z: \
             {:?}\n  orientation:\n    x: {:?}\n    y: {:?}\n    z: {:?}\n    w: {:?}\n---",
            1_700_000_000 + i,
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w
        )
    });
}

fn messages_echoed_as_a_table(folder: &Path, poses: &[Isometry3<f64>]) {
    let mut rows = vec![
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,field.pose.position.y,\
         field.pose.position.z,field.pose.orientation.x,field.pose.orientation.y,field.pose.orientation.z,\
         field.pose.orientation.w"
            .to_owned(),
    ];
    for (i, pose) in poses.iter().enumerate() {
        let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter()).copied();
        rows.push(format!("{0},{i},{0},base,{1}", 1_700_000_000_000_000_000u64 + i as u64, joined(numbers, ",")));
    }
    fs::write(folder.join("poses.csv"), rows.join("\n")).expect("written");
}

fn a_record_to_a_line(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.jsonl", poses, |i, pose| {
        let vector: [f64; 3] = se3::rotation_vector(&pose.rotation).into();
        let numbers = joined(pose.translation.vector.iter().copied().chain(vector), ", ");
        format!("{{\"image\": \"image_{i}.png\", \"tcp_pose\": [{numbers}]}}")
    });
}

fn opencv_in_xml(folder: &Path, poses: &[Isometry3<f64>]) {
    let matrices: Vec<String> = poses
        .iter()
        .enumerate()
        .map(|(i, pose)| {
            let numbers = joined(pose.to_homogeneous().transpose().iter().copied(), " ");
            format!(
                "<pose_{i} type_id=\"opencv-matrix\"><rows>4</rows><cols>4</cols><dt>d</dt><data>{numbers}</data></pose_{i}>"
            )
        })
        .collect();
    let text = format!("<?xml version=\"1.0\"?>\n<opencv_storage>\n{}\n</opencv_storage>\n", matrices.join("\n"));
    fs::write(folder.join("poses.xml"), text).expect("written");
}

fn a_program(folder: &Path, poses: &[Isometry3<f64>]) {
    lines(folder, "poses.src", poses, |i, pose| {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        let [x, y, z]: [f64; 3] = (pose.translation.vector * 1e3).into();
        let [a, b, c] = [yaw, pitch, roll].map(f64::to_degrees);
        format!("LIN {{X {x:?},Y {y:?},Z {z:?},A {a:?},B {b:?},C {c:?}}} ; {i}")
    });
}

#[test]
fn layouts_of_other_repositories_give_every_image_its_pose() {
    let writers: [(&str, Writer); 14] = [
        ("rotation first", rotation_first),
        ("translation and matrix", translation_and_matrix),
        ("matrix by columns", matrix_by_columns_and_translation),
        ("a number to a line", a_number_to_a_line_rotation_first),
        ("npy", an_array_to_a_pose),
        ("npz of vectors", vectors_in_a_file_of_arrays),
        ("npz of a matrix", matrix_and_vector_in_a_file_of_arrays),
        ("ros2 topic echo", messages_echoed),
        ("rostopic echo -p", messages_echoed_as_a_table),
        ("blocks", blocks_with_names),
        ("folders", a_folder_to_a_pose),
        ("jsonl", a_record_to_a_line),
        ("OpenCV XML", opencv_in_xml),
        ("KRL", a_program),
    ];
    for (seed, (name, write)) in writers.into_iter().enumerate() {
        let session = observed(Mode::EyeInHand, VIEWS, 40 + seed as u64);
        let folder = tempfile::tempdir().expect("a folder");
        for view in 0..VIEWS {
            save_image(&folder.path().join(format!("image_{view}.png")), view);
        }
        let poses: Vec<Isometry3<f64>> = (0..VIEWS).map(|view| pose_of(&session, view)).collect();
        write(folder.path(), &poses);
        let (recording, judgement) = judged(folder.path(), &session, &in_hand());
        let best = &judgement.hypotheses[0];
        let reported: Vec<_> =
            best.conventions(&recording).into_iter().map(|c| format!("{}={}", c.key, c.value)).collect();
        assert_eq!(judgement.verdict, Verdict::Decided, "{name}: {reported:?}");
        let pairs = written_pairs(&recording, best, &session);
        assert_eq!(pairs.len(), VIEWS, "{name}: {reported:?}");
        assert!(pairs.iter().all(|(image, pose)| Some(*image) == *pose), "{name}: {pairs:?} {reported:?}");
    }
}

/// The two orders of six numbers are one series: neither is the series of the target for the other.
#[test]
fn a_table_alone_is_no_pair_of_series() {
    let session = observed(Mode::EyeInHand, VIEWS, 77);
    let folder = tempfile::tempdir().expect("a folder");
    let poses: Vec<Isometry3<f64>> = (0..VIEWS).map(|view| pose_of(&session, view)).collect();
    rotation_first(folder.path(), &poses);
    let recording = open(folder.path()).expect("a recording");
    let judged = judge(
        &recording,
        &Sights::default(),
        &Settings::default(),
        &handeye_geometry::progress::CancelToken::default(),
    );
    assert!(matches!(judged, Err(ImportError::NoPoses { .. })), "{judged:?}");
}
