//! Dataset folders with one defect each: every one is refused with one line that names the file and the row.

use std::fs;
use std::path::{Path, PathBuf};

use handeye_dataset::Dataset;
use image::{ImageFormat, Rgb, RgbImage};

const DESCRIPTION: &str = r#"mode = "eye_in_hand"
[target]
kind = "chessboard"
columns = 10
rows = 7
square_m = 0.015
[robot]
poses = "poses.csv"
length_unit = "m"
rotation = "quaternion_xyzw"
pose = "base_from_tip"
[camera]
fixed = true
width = 64
height = 48
fx = 60.0
fy = 60.0
cx = 31.5
cy = 23.5
model = "brown_conrady"
distortion = [0, 0, 0, 0, 0]
"#;

/// Line 1 is the header, so image 1 is in row 2.
const POSES: &str = "image,x,y,z,qx,qy,qz,qw\n\
    images/1.png,0.1,0.2,0.3,0,0,0,1\n\
    images/2.jpg,0.1,0.2,0.4,0,0,0.6,0.8\n\
    images/3.png,0.1,0.2,0.5,0,0.6,0,0.8\n";

const CORNERS: &str = "image,column,row,u,v\n\
    images/1.png,0,0,10.5,12.25\n\
    images/1.png,9,6,50.5,42.25\n\
    images/2.jpg,0,0,10.5,12.25\n";

/// A good data set in a temporary folder, for one mutation.
struct Folder(tempfile::TempDir);

impl Folder {
    fn good() -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(folder.path("images")).expect("create");
        folder.write("dataset.toml", DESCRIPTION);
        folder.write("poses.csv", POSES);
        for name in ["images/1.png", "images/2.jpg", "images/3.png"] {
            folder.write_image(name, 64, 48);
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("write");
    }

    fn write_image(&self, name: &str, width: u32, height: u32) {
        let image = RgbImage::from_fn(width, height, |x, y| Rgb([(x * 7) as u8, (y * 11) as u8, (x * y) as u8]));
        let format = ImageFormat::from_path(name).expect("an ending");
        image.save_with_format(self.path(name), format).expect("save");
    }

    /// Replaces text in a file, which must be there.
    fn edit(&self, name: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(name)).expect("text");
        assert!(text.contains(from), "{name} has no {from:?}");
        self.write(name, text.replacen(from, to, 1));
    }

    fn truncate(&self, name: &str, keep: impl Fn(usize) -> usize) {
        let bytes = fs::read(self.path(name)).expect("bytes");
        self.write(name, &bytes[..keep(bytes.len())]);
    }

    fn add_corners(&self) {
        self.edit("dataset.toml", "square_m = 0.015\n", "square_m = 0.015\ncorners = \"corners.csv\"\n");
        self.write("corners.csv", CORNERS);
    }
}

/// Reads the data set and then every image, as a calibration does.
fn use_all(folder: &Path) -> Result<(), String> {
    let data = Dataset::read(folder).map_err(|e| e.to_string())?;
    for entry in data.entries.iter().filter(|e| e.image_path.is_some()) {
        data.load_gray(entry).map_err(|e| e.to_string())?;
        data.load_rgb(entry).map_err(|e| e.to_string())?;
    }
    data.input_sha256().map_err(|e| e.to_string())?;
    Ok(())
}

type Mutation = fn(&Folder);

/// What is broken, how, and what the message must contain: the place first.
const DEFECTS: &[(&str, Mutation, &[&str])] = &[
    ("no description", |f| fs::remove_file(f.path("dataset.toml")).expect("remove"), &["dataset.toml"]),
    ("an empty description", |f| f.write("dataset.toml", "\n"), &["dataset.toml:", "is empty"]),
    ("a syntax error", |f| f.edit("dataset.toml", "rows = 7", "rows = = 7"), &["dataset.toml, row 5:"]),
    (
        "an unknown key",
        |f| f.edit("dataset.toml", "square_m = 0.015", "square_mm = 15"),
        &["dataset.toml, row 6:", "square_mm", "square_m"],
    ),
    ("a missing key", |f| f.edit("dataset.toml", "pose = \"base_from_tip\"\n", ""), &["dataset.toml, row 7:", "pose"]),
    (
        "a wrong unit keyword",
        |f| f.edit("dataset.toml", "length_unit = \"m\"", "length_unit = \"inch\""),
        &["dataset.toml, row 9:", "inch", "`m`", "`mm`"],
    ),
    (
        "an unknown rotation",
        |f| f.edit("dataset.toml", "quaternion_xyzw", "euler_zyx"),
        &["dataset.toml, row 10:", "euler_zyx", "quaternion_wxyz", "rotation_vector", "rpy", "matrix"],
    ),
    (
        "an unknown mode",
        |f| f.edit("dataset.toml", "eye_in_hand", "eye_on_base"),
        &["dataset.toml, row 1:", "eye_on_base", "eye_in_hand", "eye_to_hand"],
    ),
    ("no mode", |f| f.edit("dataset.toml", "mode = \"eye_in_hand\"\n", ""), &["dataset.toml:", "eye_to_hand"]),
    (
        "angles without a unit",
        |f| f.edit("dataset.toml", "quaternion_xyzw", "rpy"),
        &["dataset.toml, row 7:", "angle_unit", "deg"],
    ),
    (
        "an unknown target",
        |f| f.edit("dataset.toml", "chessboard", "checkers"),
        &["dataset.toml, row 3:", "checkers", "chessboard", "circles"],
    ),
    (
        "a target without one of its keys",
        |f| f.edit("dataset.toml", "kind = \"chessboard\"", "kind = \"charuco\"\nmarker_m = 0.01"),
        &["dataset.toml, row 3:", "dictionary", "5x5_100"],
    ),
    (
        "a key of another kind of target",
        |f| f.edit("dataset.toml", "kind = \"chessboard\"", "kind = \"chessboard\"\nmarker_m = 0.01"),
        &["dataset.toml, row 4:", "marker_m", "chessboard"],
    ),
    (
        "a marker as large as its square",
        |f| {
            let charuco = "kind = \"charuco\"\ndictionary = \"5x5_100\"\nmarker_m = 0.02";
            f.edit("dataset.toml", "kind = \"chessboard\"", charuco);
        },
        &["dataset.toml, row 5:", "marker_m = 0.02", "square_m"],
    ),
    (
        "an unknown family of markers",
        |f| {
            let charuco = "kind = \"charuco\"\ndictionary = \"8x8_10\"\nmarker_m = 0.01";
            f.edit("dataset.toml", "kind = \"chessboard\"", charuco);
        },
        &["dataset.toml, row 4:", "8x8_10", "apriltag_36h11"],
    ),
    (
        "a square of no size",
        |f| f.edit("dataset.toml", "0.015", "0"),
        &["dataset.toml, row 6:", "square_m", "positive"],
    ),
    (
        "a negative square",
        |f| f.edit("dataset.toml", "0.015", "-0.015"),
        &["dataset.toml, row 6:", "square_m = -0.015"],
    ),
    ("a square of NaN", |f| f.edit("dataset.toml", "0.015", "nan"), &["dataset.toml, row 6:", "square_m = NaN"]),
    ("a line of corners", |f| f.edit("dataset.toml", "rows = 7", "rows = 2"), &["dataset.toml, row 5:", "rows = 2"]),
    ("an absurd board", |f| f.edit("dataset.toml", "= 10", "= 4000000000"), &["dataset.toml, row 4:", "columns"]),
    ("no focal length", |f| f.edit("dataset.toml", "fx = 60.0", "fx = 0"), &["dataset.toml, row 16:", "fx = 0"]),
    ("an infinite centre", |f| f.edit("dataset.toml", "31.5", "inf"), &["dataset.toml, row 18:", "cx = inf"]),
    ("no fy", |f| f.edit("dataset.toml", "fy = 60.0\n", ""), &["dataset.toml, row 12:", "fy"]),
    ("no height", |f| f.edit("dataset.toml", "height = 48\n", ""), &["dataset.toml, row 12:", "height"]),
    (
        "too few coefficients",
        |f| f.edit("dataset.toml", "[0, 0, 0, 0, 0]", "[0, 0, 0, 0]"),
        &["dataset.toml, row 21:", "4 numbers", "brown_conrady takes 5"],
    ),
    (
        "an unknown lens",
        |f| f.edit("dataset.toml", "brown_conrady", "plumb_bob"),
        &["dataset.toml, row 20:", "plumb_bob", "rational", "fisheye"],
    ),
    ("fixed without values", |f| f.edit("dataset.toml", "fx = 60.0\nfy = 60.0\ncx = 31.5\ncy = 23.5\n", ""), &["fx"]),
    (
        "a description that is not UTF-8",
        |f| f.write("dataset.toml", b"mode = \"eye_in_hand\"\n# 15 \xb5m\n"),
        &["dataset.toml, row 2:", "UTF-8"],
    ),
    ("no pose table", |f| fs::remove_file(f.path("poses.csv")).expect("remove"), &["poses.csv:", "cannot be read"]),
    ("an empty pose table", |f| f.write("poses.csv", ""), &["poses.csv:", "is empty"]),
    (
        "a header alone",
        |f| f.write("poses.csv", "image,x,y,z,qx,qy,qz,qw\n"),
        &["poses.csv, row 1:", "a header and no rows"],
    ),
    (
        "another header alone",
        |f| f.write("poses.csv", "image,x,y,z,rx,ry,rz\n"),
        &["poses.csv, row 1:", "\"rx\"", "qx,qy,qz,qw"],
    ),
    ("a folder for a table", |f| f.edit("dataset.toml", "poses.csv", "images"), &["images:", "not a file"]),
    ("a table that is not UTF-8", |f| f.write("poses.csv", b"image,x\nb\xe9\n"), &["poses.csv, row 2:", "UTF-8"]),
    (
        "a missing image",
        |f| fs::remove_file(f.path("images/3.png")).expect("remove"),
        &["poses.csv, row 4:", "images/3.png", "does not exist"],
    ),
    ("a NaN", |f| f.edit("poses.csv", "0.4", "nan"), &["poses.csv, row 3:", "z = \"nan\"", "not finite"]),
    ("an infinity", |f| f.edit("poses.csv", "0.6,0,0.8", "inf,0,0.8"), &["poses.csv, row 4:", "qy", "not finite"]),
    ("a number past the largest", |f| f.edit("poses.csv", "0.3", "1e999"), &["poses.csv, row 2:", "not finite"]),
    ("a word for a number", |f| f.edit("poses.csv", "0.4", "0.4m"), &["poses.csv, row 3:", "z = \"0.4m\"", "number"]),
    ("an empty cell", |f| f.edit("poses.csv", "0.4", ""), &["poses.csv, row 3:", "z = \"\""]),
    ("a decimal comma", |f| f.edit("poses.csv", "0.4", "0,4"), &["poses.csv, row 3:", "9 cells", "8"]),
    ("a short row", |f| f.edit("poses.csv", ",0.8\n", "\n"), &["poses.csv, row 3:", "7 cells"]),
    ("an unknown column", |f| f.edit("poses.csv", "qw\n", "w\n"), &["poses.csv, row 1:", "\"w\"", "qx,qy,qz,qw"]),
    (
        "a missing column",
        |f| f.write("poses.csv", "image,x,y,z,qx,qy,qz\nimages/1.png,0,0,0,0,0,0\n"),
        &["poses.csv, row 1:", "\"qw\" is missing"],
    ),
    (
        "columns that contradict the convention",
        |f| f.edit("poses.csv", "qx,qy,qz,qw", "qw,qx,qy,qz"),
        &["poses.csv, row 1:", "order", "qx,qy,qz,qw"],
    ),
    ("no header", |f| f.edit("poses.csv", "image,x,y,z,qx,qy,qz,qw\n", ""), &["poses.csv, row 1:", "header must be"]),
    ("a non-unit quaternion", |f| f.edit("poses.csv", "0.6,0.8", "0.6,0.81"), &["poses.csv, row 3:", "length 1.008"]),
    ("a zero quaternion", |f| f.edit("poses.csv", "0,0,0,1", "0,0,0,0"), &["poses.csv, row 2:", "length 0"]),
    (
        "a duplicate row",
        |f| f.edit("poses.csv", "images/3.png", "images/1.png"),
        &["poses.csv, row 4:", "images/1.png", "row 2"],
    ),
    (
        "a duplicate in another spelling",
        |f| f.edit("poses.csv", "images/3.png", "images/../images/./1.png"),
        &["poses.csv, row 4:", "row 2"],
    ),
    ("an absolute image", |f| f.edit("poses.csv", "images/3.png", "/etc/hosts"), &["poses.csv, row 4:", "relative"]),
    ("no image name", |f| f.edit("poses.csv", "images/3.png", ""), &["poses.csv, row 4:", "\"\""]),
    ("a folder for an image", |f| f.edit("poses.csv", "images/3.png", "images"), &["poses.csv, row 4:", "not a file"]),
    ("an open quote", |f| f.edit("poses.csv", "images/3.png", "\"images/3.png"), &["poses.csv, row 4:"]),
    (
        "an image of another size than stated",
        |f| f.write_image("images/2.jpg", 48, 64),
        &["poses.csv, row 3:", "images/2.jpg", "48×64", "64×48"],
    ),
    (
        "a first image of another size than the rest",
        |f| {
            f.edit("dataset.toml", "width = 64\nheight = 48\n", "");
            f.write_image("images/1.png", 32, 24);
        },
        &["poses.csv, row 2:", "images/1.png", "32×24", "64×48"],
    ),
    ("a text for an image", |f| f.write("images/1.png", "no image"), &["poses.csv, row 2:", "cannot be decoded"]),
    ("an empty image", |f| f.write("images/1.png", ""), &["poses.csv, row 2:", "images/1.png", "truncated"]),
    ("half a PNG", |f| f.truncate("images/1.png", |n| n / 2), &["poses.csv, row 2:", "images/1.png", "truncated"]),
    ("a PNG without its end", |f| f.truncate("images/3.png", |n| n - 4), &["poses.csv, row 4:", "truncated"]),
    ("half a JPEG", |f| f.truncate("images/2.jpg", |n| n / 2), &["poses.csv, row 3:", "images/2.jpg", "truncated"]),
    ("a JPEG without its end", |f| f.truncate("images/2.jpg", |n| n - 1), &["poses.csv, row 3:", "truncated"]),
    (
        "corners and target poses",
        |f| f.edit("dataset.toml", "rows = 7\n", "rows = 7\ncorners = \"c.csv\"\nposes = \"p.csv\"\n"),
        &["dataset.toml:", "corners and poses"],
    ),
    (
        "a corner beside the board",
        |f| {
            f.add_corners();
            f.edit("corners.csv", "9,6", "10,6");
        },
        &["corners.csv, row 3:", "column 10", "10×7"],
    ),
    (
        "a corner twice",
        |f| {
            f.add_corners();
            f.edit("corners.csv", "9,6", "0,0");
        },
        &["corners.csv, row 3:", "already in row 2"],
    ),
    (
        "a corner beside the image",
        |f| {
            f.add_corners();
            f.edit("corners.csv", "50.5", "150.5");
        },
        &["corners.csv, row 3:", "150.5", "64×48"],
    ),
    (
        "a corner of half a column",
        |f| {
            f.add_corners();
            f.edit("corners.csv", "9,6", "9.5,6");
        },
        &["corners.csv, row 3:", "9.5"],
    ),
    (
        "corners of an unknown image",
        |f| {
            f.add_corners();
            f.edit("corners.csv", "images/2.jpg", "images/9.jpg");
        },
        &["corners.csv, row 4:", "images/9.jpg", "poses.csv"],
    ),
    (
        "a shear for a rotation",
        |f| as_matrix(f, "1,0.01,0,0,1,0,0,0,1"),
        &["poses.csv, row 2:", "not a rotation", "0.010000"],
    ),
    ("a mirror for a rotation", |f| as_matrix(f, "1,0,0,0,1,0,0,0,-1"), &["poses.csv, row 2:", "mirrors"]),
    ("huge numbers for a rotation", |f| as_matrix(f, "1e308,1e308,0,1e308,-1e308,0,0,0,1"), &["poses.csv, row 2:"]),
    ("a scale for a rotation", |f| as_matrix(f, "1000,0,0,0,1000,0,0,0,1000"), &["poses.csv, row 2:", "orthonormal"]),
    (
        "degrees as radians",
        |f| {
            f.edit("dataset.toml", "\"quaternion_xyzw\"", "\"rpy\"\nangle_unit = \"rad\"");
            f.write("poses.csv", "image,x,y,z,roll,pitch,yaw\nimages/1.png,0,0,0,3.1,0,90\n");
        },
        &["poses.csv, row 2:", "yaw = 90 rad", "angle_unit"],
    ),
    (
        "no robot and no images",
        |f| {
            fs::remove_dir_all(f.path("images")).expect("remove");
            f.write("dataset.toml", &DESCRIPTION[..DESCRIPTION.find("[robot]").expect("a robot")]);
        },
        &["has no images", "dataset.toml needs [robot]"],
    ),
];

fn as_matrix(folder: &Folder, elements: &str) {
    folder.edit("dataset.toml", "quaternion_xyzw", "matrix");
    let header = "image,x,y,z,r11,r12,r13,r21,r22,r23,r31,r32,r33";
    folder.write("poses.csv", format!("{header}\nimages/1.png,0,0,0,{elements}\n"));
}

#[test]
fn the_folder_that_the_defects_start_from_is_good() {
    let folder = Folder::good();
    assert_eq!(use_all(folder.0.path()), Ok(()));
    folder.add_corners();
    assert_eq!(use_all(folder.0.path()), Ok(()));
}

#[test]
fn every_defect_is_one_line_that_names_the_file_and_the_row() {
    let mut failures = Vec::new();
    for (what, mutate, needles) in DEFECTS {
        let folder = Folder::good();
        mutate(&folder);
        match use_all(folder.0.path()) {
            Ok(()) => failures.push(format!("{what}: accepted")),
            Err(message) => {
                let in_order = needles.iter().all(|n| message.contains(n));
                let place = message.starts_with(&folder.0.path().display().to_string());
                if !in_order || !place || message.contains('\n') || message.len() > 600 {
                    failures.push(format!("{what}: {message:?} should be one line with {needles:?}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} of {}:\n{}", failures.len(), DEFECTS.len(), failures.join("\n"));
}

#[test]
fn a_folder_that_is_not_there_is_an_error() {
    let folder = Folder::good();
    let message = Dataset::read(&folder.path("elsewhere")).expect_err("nothing there").to_string();
    assert!(message.contains("elsewhere") && message.contains("cannot be read"), "{message}");
    let message = Dataset::read(&folder.path("poses.csv")).expect_err("a file").to_string();
    assert!(message.contains("poses.csv") && message.contains("dataset.toml"), "{message}");
}

#[test]
fn a_table_cut_or_garbled_anywhere_never_panics() {
    let folder = Folder::good();
    folder.add_corners();
    for name in ["dataset.toml", "poses.csv", "corners.csv"] {
        let good = fs::read(folder.path(name)).expect("bytes");
        for i in 0..good.len() {
            folder.write(name, &good[..i]);
            check_message(&folder);
            // One of the bytes at each place, all of them all over the file: the disk is the slow part.
            for byte in [[0u8, b'"', b','], [b'\n', b'[', 0xff]][i % 2] {
                let mut bad = good.clone();
                bad[i] = byte;
                folder.write(name, &bad);
                check_message(&folder);
            }
        }
        folder.write(name, &good);
    }
}

fn check_message(folder: &Folder) {
    if let Err(error) = Dataset::read(folder.0.path()) {
        let message = error.to_string();
        assert!(!message.contains('\n') && message.len() < 600, "{message:?}");
    }
}
