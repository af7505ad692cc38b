use std::fs;

use super::*;
use crate::Dataset;
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Pose, Tip};

fn folder(images: &[(&str, u32, u32)], tables: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, width, height) in images {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("created");
        image::GrayImage::new(*width, *height).save(path).expect("saved");
    }
    for (name, table) in tables {
        fs::write(folder.path().join(name), table).expect("written");
    }
    folder
}

/// Takes in the lines of a template that begin so.
fn decide(template: &str, taken: &[&str]) -> String {
    let take = |line: &str| {
        let choice = line.strip_prefix(CHOICE).filter(|choice| taken.iter().any(|begin| choice.starts_with(begin)));
        choice.unwrap_or(line).to_owned()
    };
    let decided = template.lines().map(take).collect::<Vec<_>>().join("\n");
    decided.replace("columns =", "columns = 4").replace("rows =", "rows = 3").replace("square_m =", "square_m = 0.02")
}

const BOARD: [&str; 5] = ["mode = \"eye_in_hand\"", "kind = \"chessboard\"", "columns", "rows", "square_m"];

#[test]
fn what_was_found_is_filled_in_and_what_was_decided_is_read() {
    let half_turn = "1.5,2,-3,0,0,180,1,2,3,4,5,6";
    let table = format!("image,x,y,z,rx,ry,rz,q1,q2,q3,q4,q5,q6\ncam/1.png,{half_turn}\ncam/2.png,{half_turn}\n");
    let folder = folder(&[("cam/1.png", 64, 48), ("cam/2.png", 64, 48)], &[("robot poses.csv", &table)]);
    let text = template(folder.path()).expect("a template");
    for fact in [
        "2 images, from cam/1.png to cam/2.png",
        "2 of them of 64×48 px",
        "robot poses.csv: a pose table; columns image,x,y,z,rx,ry,rz,q1,q2,q3,q4,q5,q6; rows 2",
        "\nposes = \"robot poses.csv\"\n",
        "\njoints = 6\n",
        "x, y, z in metres; the largest number is 3\n",
        "the rotation in degrees; the largest number is 180\n",
        "joint angles in radians; the largest number is 6\n",
        "#? width = 64\n",
    ] {
        assert!(text.contains(fact), "{fact:?} is not in\n{text}");
    }
    let decisions = [
        &BOARD[..],
        &[
            "length_unit = \"mm\"",
            "rotation = \"rpy\"",
            "angle_unit = \"deg\"",
            "pose = \"base",
            "joint_unit = \"deg\"",
        ],
    ]
    .concat();
    fs::write(folder.path().join("dataset.toml"), decide(&text, &decisions)).expect("written");
    let data = Dataset::read(folder.path()).unwrap_or_else(|e| panic!("{e}\n{}", decide(&text, &decisions)));
    assert_eq!((data.mode, data.image_size, data.entries.len()), (Some(Mode::EyeInHand), Some((64, 48)), 2));
    let expected = Pose::<Base, Tip>::from_translation_xyzw([1.5e-3, 2e-3, -3e-3], [0.0, 0.0, 1.0, 0.0]);
    let (distance, angle) = data.entries[0].base_from_tip.expect("a pose").distance_to(&expected);
    assert!(distance < 1e-12 && angle < 1e-12, "{distance} {angle}");
    assert_eq!(data.entries[0].joints_rad.as_ref().map(|joints| joints[5]), Some(6.0_f64.to_radians()));
}

#[test]
fn every_rotation_that_is_read_has_a_template_that_is_read() {
    let cases = [
        ("qx,qy,qz,qw", "0,0,0,1", &[][..]),
        ("qw,qx,qy,qz", "1,0,0,0", &[]),
        ("rx,ry,rz", "0,0,0", &["rotation = \"rotation_vector\"", "angle_unit = \"rad\""]),
        ("roll,pitch,yaw", "0,0,0", &["angle_unit = \"rad\""]),
        ("r11,r12,r13,r21,r22,r23,r31,r32,r33", "1,0,0,0,1,0,0,0,1", &[]),
    ];
    for (columns, cells, own) in cases {
        let table = format!("image,x,y,z,{columns}\n1.png,0,0,0,{cells}\n");
        let folder = folder(&[("1.png", 8, 6)], &[("poses.csv", &table)]);
        let text = template(folder.path()).expect("a template");
        let decisions = [&BOARD[..], &["length_unit = \"m\"", "pose = \"tip_from_base\""], own].concat();
        // With all decisions it is read, and if any one is missing it is not: none has a default.
        for left_out in std::iter::once(None).chain((0..decisions.len()).map(Some)) {
            let mut taken = decisions.clone();
            if let Some(index) = left_out {
                taken.remove(index);
            }
            fs::write(folder.path().join("dataset.toml"), decide(&text, &taken)).expect("written");
            let read = Dataset::read(folder.path());
            assert_eq!(read.is_ok(), left_out.is_none(), "{columns} without {left_out:?}: {:?}", read.err());
        }
    }
}

#[test]
fn what_is_found_and_of_no_use_is_said() {
    let images = [("images/1.png", 64, 48), ("images/2.png", 48, 64), ("images/10.png", 64, 48)];
    let folder = folder(&images, &[("log.csv", "time;x;y\n1;2;3\n"), ("corners.csv", "image,column,row,u,v\n")]);
    fs::write(folder.path().join("images/broken.png"), "no image").expect("written");
    let text = template(folder.path()).expect("a template");
    for fact in [
        "4 images, from images/1.png to images/broken.png",
        "1 of them of 48×64 px",
        "1 of them cannot be read",
        "A data set is of one camera",
        "log.csv: not a table of a data set",
        "#? corners = \"corners.csv\"",
        "No pose table was found",
        "#? height = 48\n",
    ] {
        assert!(text.contains(fact), "{fact:?} is not in\n{text}");
    }
}

#[test]
fn a_folder_without_images_and_tables_has_no_template() {
    let folder = folder(&[], &[]);
    fs::write(folder.path().join("thesis.tex"), "").expect("written");
    assert_eq!(template(folder.path()), None);
    assert_eq!(template(&folder.path().join("not-there")), None);
}
