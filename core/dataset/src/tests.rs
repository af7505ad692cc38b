use std::fs;
use std::path::Path;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use sha2::{Digest as _, Sha256};

use super::*;
use handeye_estimate::CameraKnowledge;
use handeye_files::digest::hex;
use handeye_geometry::targets::Grid;

const TARGET: &str =
    "mode = \"eye_in_hand\"\n[target]\nkind = \"chessboard\"\ncolumns = 4\nrows = 3\nsquare_m = 0.02\n";
const ROBOT: &str =
    "[robot]\nposes = \"poses.csv\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(description: &str, poses: &str, images: &[&str]) -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        folder.write("dataset.toml", description);
        if !poses.is_empty() {
            folder.write("poses.csv", poses);
        }
        for name in images {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("create");
            image::GrayImage::from_pixel(8, 6, image::Luma([90])).save(path).expect("save");
        }
        folder
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path().join(name), content).expect("write");
    }

    fn read(&self) -> Dataset {
        Dataset::read(self.path()).unwrap_or_else(|e| panic!("{e}"))
    }

    fn error(&self) -> String {
        Dataset::read(self.path()).expect_err("a defect").to_string()
    }
}

/// One pose in every convention: translation (0.1, -0.2, 0.3) m and R = Rz(1.4)·Ry(-0.2)·Rx(0.35).
fn expected_rotation() -> UnitQuaternion<f64> {
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let r = about(Vector3::z_axis(), 1.4) * about(Vector3::y_axis(), -0.2) * about(Vector3::x_axis(), 0.35);
    UnitQuaternion::from_rotation_matrix(&r)
}

#[test]
fn all_rotation_conventions_and_units_give_the_same_pose() {
    // Written by an independent program for this rotation, nine digits.
    let cases = [
        ("quaternion_xyzw", "qx,qy,qz,qw", "0.195832126,0.036412615,0.644503346,0.738200065"),
        ("quaternion_wxyz", "qw,qx,qy,qz", "-0.738200065,-0.195832126,-0.036412615,-0.644503346"),
        ("rotation_vector", "rx,ry,rz", "0.429877369,0.079930497,1.414769930"),
        ("rotation_vector", "rx,ry,rz", "24.630159,4.57968,81.060346"),
        ("rpy", "roll,pitch,yaw", "0.35,-0.2,1.4"),
        ("rpy", "rx,ry,rz", "20.05352283,-11.4591559,80.2140913"),
        (
            "matrix",
            "r11,r12,r13,r21,r22,r23,r31,r32,r33",
            "0.166579116,-0.937283305,0.306188511,0.965806345,0.092530430,-0.242190471,0.198669331,0.336062681,0.920647800",
        ),
    ];
    for (rotation, columns, cells) in cases {
        let in_degrees = cells.starts_with('2');
        let (unit, t) = if in_degrees { ("deg", "100,-200,300") } else { ("rad", "0.1,-0.2,0.3") };
        let length_unit = if in_degrees { "mm" } else { "m" };
        let robot = format!(
            "[robot]\nposes = \"poses.csv\"\nlength_unit = \"{length_unit}\"\nrotation = \"{rotation}\"\n\
             angle_unit = \"{unit}\"\npose = \"base_from_tip\"\n"
        );
        let table = format!("image,x,y,z,{columns}\na.png,{t},{cells}\n");
        let folder = Folder::new(&format!("{TARGET}{robot}"), &table, &["a.png"]);
        let pose = folder.read().entries[0].base_from_tip.expect("a pose");
        assert!((pose.translation() - Vector3::new(0.1, -0.2, 0.3)).norm() < 1e-12, "{rotation} {unit}");
        // The cells carry six to nine digits.
        assert!(pose.rotation().angle_to(&expected_rotation()) < 1e-7, "{rotation} {unit}");

        let inverted = robot.replace("base_from_tip", "tip_from_base");
        folder.write("dataset.toml", format!("{TARGET}{inverted}"));
        let inverse = folder.read().entries[0].base_from_tip.expect("a pose");
        let (distance, angle) = (inverse.inverse().relabel::<Base, Tip>()).distance_to(&pose);
        assert!(distance < 1e-12 && angle < 1e-7, "{rotation} as tip_from_base");
    }
}

#[test]
fn byte_order_mark_windows_line_ends_quotes_and_blank_lines_are_accepted() {
    let poses =
        "\u{feff}image,x,y,z,qx,qy,qz,qw\r\n\r\n\"a.png\" ,0, 0,0,0,0,0,1\r\n\"b, c.png\",\"1\",0,0,0,0,0,1\r\n\r\n";
    let description = format!("\u{feff}{TARGET}{ROBOT}").replace('\n', "\r\n");
    let folder = Folder::new(&description, poses, &["a.png", "b, c.png"]);
    let data = folder.read();
    let names: Vec<_> = data.entries.iter().map(|e| (e.name.as_str(), e.row)).collect();
    assert_eq!(names, [("a.png", Some(3)), ("b, c.png", Some(4))]);
    assert_eq!(data.image_size, Some((8, 6)));
    assert_eq!(data.mode, Some(Mode::EyeInHand));
}

#[test]
fn rows_are_counted_as_an_editor_counts_them() {
    for line_end in ["\n", "\r\n"] {
        let poses =
            ["image,x,y,z,qx,qy,qz,qw", "a.png,0,0,0,0,0,0,1", "", "", "b.png,0,0,NaN,0,0,0,1", ""].join(line_end);
        let folder = Folder::new(&format!("{TARGET}{ROBOT}"), &poses, &["a.png", "b.png"]);
        let error = folder.error();
        assert!(error.contains("poses.csv, row 5: z = \"NaN\" is not finite"), "{error}");
        let poses = ["image,x,y,z,qx,qy,qz,qw", "\"a.png\",0,0,0,0,0,0,1", "b.png,0,0,0,0,0,0"].join(line_end);
        folder.write("poses.csv", poses);
        let error = folder.error();
        assert!(error.contains("poses.csv, row 3: has 7 cells"), "{error}");
    }
}

#[test]
fn without_a_robot_all_images_are_views_in_natural_order() {
    let images = ["left10.png", "left2.png", "left1.png", ".hidden.png", "images/left3.png"];
    let folder = Folder::new(TARGET, "", &images);
    folder.write("notes.txt", "not an image");
    let data = folder.read();
    let names: Vec<_> = data.entries.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["images/left3.png", "left1.png", "left2.png", "left10.png"]);
    assert_eq!(data.mode, None);
    assert!(data.entries.iter().all(|e| e.base_from_tip.is_none() && e.corners.is_none()));
}

#[test]
fn without_a_robot_the_images_that_count_can_be_named() {
    let images = ["a.png", "b.png", "images/c.png"];
    let description = |named: &str| format!("images = {named}\n{TARGET}");
    let folder = Folder::new(&description("['images/c.png', 'a.png']"), "", &images);
    let names: Vec<String> = folder.read().entries.into_iter().map(|entry| entry.name).collect();
    assert_eq!(names, ["images/c.png", "a.png"]);
    for (named, why) in [
        ("['a.png', './a.png']", "every image once"),
        ("['a.png', '/b.png']", "a path relative to this folder"),
        ("[]", "at least one image"),
        ("['d.png']", "d.png"),
    ] {
        let error = Folder::new(&description(named), "", &images).error();
        assert!(error.contains(why), "{named}: {error}");
    }
}

#[test]
fn corners_stand_in_for_absent_images() {
    let camera = "[camera]\nfixed = false\nwidth = 640\nheight = 480\n";
    let target = format!("{TARGET}corners = \"corners.csv\"\n");
    let poses = "image,x,y,z,qx,qy,qz,qw\nimages/1.png,0,0,0,0,0,0,1\nimages/2.png,1,0,0,0,0,0,1\n";
    let folder = Folder::new(&format!("{target}{ROBOT}{camera}"), poses, &[]);
    folder.write("corners.csv", "image,column,row,u,v\n./images/2.png,1,2,10.5,20.25\nimages/2.png,0,0,3,4\n");
    let data = folder.read();
    assert_eq!(data.image_size, Some((640, 480)));
    assert_eq!(data.entries[0].corners.as_deref(), Some(&[][..]), "a view without corners stays, as not seen");
    let corners = data.entries[1].corners.as_ref().expect("corners");
    assert_eq!(corners.iter().map(|c| c.index).collect::<Vec<_>>(), [0, 9]);
    assert_eq!(corners[1].px, nalgebra::Vector2::new(10.5, 20.25));
    assert!(data.entries.iter().all(|e| e.image_path.is_none()));
    let camera = data.camera.expect("a camera");
    assert!(!camera.fixed && camera.intrinsics.is_none());
    assert_eq!(camera.model.name(), "brown_conrady");

    folder.write("corners.csv", "image,column,row,u,v\nimages/2.png,0,0,3,4\nimages/3.png,0,0,3,4\n");
    assert!(folder.error().contains("corners.csv, row 3: image \"images/3.png\" has no row in poses.csv"));
    folder.write("dataset.toml", format!("{target}{ROBOT}"));
    folder.write("corners.csv", "image,column,row,u,v\nimages/2.png,0,0,3,4\n");
    assert!(folder.error().contains("[camera] needs width"), "{}", folder.error());
}

#[test]
fn corners_without_a_robot_name_their_own_views() {
    let camera = "[camera]\nfixed = false\nwidth = 640\nheight = 480\n";
    let folder = Folder::new(&format!("{TARGET}corners = \"corners.csv\"\n{camera}"), "", &[]);
    folder.write("corners.csv", "image,column,row,u,v\nb10.png,0,0,3,4\nb9.png,0,0,3,4\nb9.png,1,0,5,4\n");
    let data = folder.read();
    let found: Vec<_> = data.entries.iter().map(|e| (e.name.as_str(), e.corners.as_ref().map(Vec::len))).collect();
    assert_eq!(found, [("b9.png", Some(2)), ("b10.png", Some(1))]);
}

#[test]
fn target_poses_make_pose_pairs_without_images() {
    let target = format!("{TARGET}poses = \"target_poses.csv\"\n");
    let poses = "image,x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,0,1\n2,1,0,0,0,0,0,1\n";
    let folder = Folder::new(&format!("{target}{ROBOT}"), poses, &[]);
    folder.write("target_poses.csv", "image,x,y,z,qx,qy,qz,qw\n2,0,0,0.5,0,0,1,0\n");
    let data = folder.read();
    assert_eq!(data.image_size, None);
    assert_eq!(data.entries[0].camera_from_target, None);
    let pose = data.entries[1].camera_from_target.expect("a target pose");
    assert_eq!(pose.translation(), Vector3::new(0.0, 0.0, 0.5));
    folder.write("target_poses.csv", "image,x,y,z,qx,qy,qz,qw\n7,0,0,0.5,0,0,1,0\n");
    assert!(folder.error().contains("target_poses.csv, row 2: image \"7\" has no row in poses.csv"));
}

#[test]
fn target_poses_may_state_the_camera_in_the_target() {
    let poses = "image,x,y,z,qx,qy,qz,qw\n1,0,0,0,0,0,0,1\n";
    // Half a turn about x: the camera is in front of the target, which it sees at the same distance.
    let row = "image,x,y,z,qx,qy,qz,qw\n1,0.1,0,0.5,1,0,0,0\n";
    for (key, seen) in [("camera_from_target", [0.1, 0.0, 0.5]), ("target_from_camera", [-0.1, 0.0, 0.5])] {
        let target = format!("{TARGET}poses = \"target_poses.csv\"\npose = \"{key}\"\n");
        let folder = Folder::new(&format!("{target}{ROBOT}"), poses, &[]);
        folder.write("target_poses.csv", row);
        let pose = folder.read().entries[0].camera_from_target.expect("a target pose");
        assert!((pose.translation() - Vector3::from(seen)).norm() < 1e-12, "{key}: {pose:?}");
    }
    let folder = Folder::new(&format!("{TARGET}pose = \"target_from_camera\"\n{ROBOT}"), poses, &[]);
    assert!(folder.error().contains("[target] has pose"), "{}", folder.error());
}

#[test]
fn tables_in_other_folders_name_images_relative_to_themselves() {
    let folder = Folder::new(&format!("{TARGET}{}", ROBOT.replace("poses.csv", "robot/poses.csv")), "", &["cam/a.png"]);
    fs::create_dir(folder.path().join("robot")).expect("create");
    folder.write("robot/poses.csv", "image,x,y,z,qx,qy,qz,qw\n../cam/a.png,0,0,0,0,0,0,1\n");
    let data = folder.read();
    assert_eq!(data.entries[0].image_path, Some(folder.path().join("cam/a.png")));
    assert!(data.load_gray(&data.entries[0]).is_ok());
    folder.write(
        "robot/poses.csv",
        "image,x,y,z,qx,qy,qz,qw\n../cam/a.png,0,0,0,0,0,0,1\n.././cam/a.png,0,0,0,0,0,0,1\n",
    );
    assert!(folder.error().contains("row 3: image \".././cam/a.png\" is already in row 2"), "{}", folder.error());
}

#[test]
fn all_camera_models_are_read() {
    let pinhole = "fx = 600\nfy = 601.5\ncx = 3.5\ncy = 2.5\n";
    let cases = [
        ("none", "distortion = []\n", Distortion::None),
        ("none", "", Distortion::None),
        ("brown_conrady", "distortion = [0.1, 0, 0, 0, -0.2]\n", Distortion::BrownConrady([0.1, 0.0, 0.0, 0.0, -0.2])),
        ("rational", "distortion = [1, 2, 3, 4, 5, 6, 7, 8]\n", Distortion::Rational([1., 2., 3., 4., 5., 6., 7., 8.])),
        ("fisheye", "distortion = [1, 2, 3, 4]\n", Distortion::Fisheye([1.0, 2.0, 3.0, 4.0])),
    ];
    let folder = Folder::new(TARGET, "", &["a.png"]);
    for (model, distortion, expected) in cases {
        for fixed in [true, false] {
            let camera = format!("[camera]\nfixed = {fixed}\nmodel = \"{model}\"\n{pinhole}{distortion}");
            folder.write("dataset.toml", format!("{TARGET}{camera}"));
            let camera = folder.read().camera.expect("a camera");
            assert_eq!(camera.fixed, fixed);
            let k = camera.intrinsics.expect("values");
            assert_eq!((k.width, k.height, k.fx, k.fy, k.distortion), (8, 6, 600.0, 601.5, expected));
            assert!(k.validate().is_ok());
        }
    }
}

#[test]
fn the_accuracy_of_known_intrinsics_is_a_positive_number_of_pixels() {
    let folder = Folder::new(TARGET, "", &["a.png"]);
    let with = |fixed: bool, accuracy: &str| {
        let lens = "model = \"none\"\nfx = 600\nfy = 600\ncx = 3.5\ncy = 2.5\n";
        folder.write("dataset.toml", format!("{TARGET}[camera]\nfixed = {fixed}\naccuracy_px = {accuracy}\n{lens}"));
    };
    with(true, "0.5");
    let camera = folder.read().camera.expect("a camera");
    let knowledge = CameraInput::knowledge(Some(&camera));
    assert!(matches!(knowledge, CameraKnowledge::Near(known) if known.accuracy_px == 0.5), "{knowledge:?}");
    for (fixed, accuracy) in [(true, "0"), (true, "-1.0"), (true, "nan"), (false, "0.5")] {
        with(fixed, accuracy);
        let error = folder.error();
        assert!(error.contains("accuracy_px") && error.contains("row 9"), "{fixed} {accuracy}: {error}");
    }
}

#[test]
fn the_input_hash_is_what_sha256sum_gives_and_does_not_depend_on_the_place() {
    let poses = "image,x,y,z,qx,qy,qz,qw\na.png,0,0,0,0,0,0,1\n";
    let make = || Folder::new(&format!("{TARGET}{ROBOT}"), poses, &["a.png"]);
    let folder = make();
    let hash = folder.read().input_sha256().expect("a hash");
    assert_eq!(make().read().input_sha256().expect("a hash"), hash);

    let digest = |name: &str| hex(&Sha256::digest(fs::read(folder.path().join(name)).expect("read")));
    let names = ["dataset.toml", "poses.csv", "a.png"];
    let listing = names.map(|n| format!("{}  {n}\n", digest(n))).concat();
    assert_eq!(hash, hex(&Sha256::digest(listing.as_bytes())));
    assert_eq!(hex(&Sha256::digest(b"")), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");

    image::GrayImage::from_pixel(8, 6, image::Luma([91])).save(folder.path().join("a.png")).expect("save");
    assert_ne!(folder.read().input_sha256().expect("a hash"), hash);
}

#[test]
fn what_is_written_reads_back_to_the_same_numbers() {
    let target = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });
    let model = Distortion::Fisheye([1e-7, -0.25, 1.0 / 3.0, 1e20]);
    let intrinsics = Intrinsics { width: 8, height: 6, fx: 589.37, fy: 1e3, cx: 1.0 / 7.0, cy: 3.0, distortion: model };
    let camera = CameraInput { fixed: true, accuracy_px: Some(0.3), intrinsics: Some(intrinsics), model };
    let pose = Pose::from_translation_xyzw([0.1, -1e-9, 3.0], [0.195832126, 0.036412615, 0.644503346, -0.738200065]);
    let names = ["images/0001.png", "b, \"c\".png"];
    let folder = Folder::new(
        &write::description(Mode::EyeToHand, &target, Some(&camera), write::Robot::default()),
        &write::pose_table(names.map(|n| (n, &pose))),
        &names,
    );
    let data = folder.read();
    assert_eq!((data.mode, data.target, data.camera), (Some(Mode::EyeToHand), target, Some(camera)));
    for (entry, name) in data.entries.iter().zip(names) {
        assert_eq!(entry.name, name);
        let read = entry.base_from_tip.expect("a pose");
        assert_eq!((read.translation(), read.xyzw()), (pose.translation(), pose.xyzw()));
    }
}
