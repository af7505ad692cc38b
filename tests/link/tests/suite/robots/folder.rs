//! `handeye driver folder`: files appear as other programs write them, whole, in halves, and wrong.

use std::io::Write as _;
use std::path::Path;

use handeye_driver::message::{Ability, FromDriver, ImageEncoding};
use handeye_geometry::testing::python;
use image::{ImageFormat, Rgb, RgbImage};

use super::Talk;

const HEADER: &str = "image,x,y,z,rx,ry,rz\n";

const SIZE: [&str; 2] = ["--size", "8x6"];

/// The driver of a folder in which poses are rotation vectors in millimetres and degrees.
fn start(python: &Path, folder: &Path, more: &[&str]) -> Talk {
    let folder = folder.to_str().expect("a name of letters");
    let words =
        ["--length-unit", "mm", "--rotation", "rotation_vector", "--angle-unit", "deg", "--pose", "base_from_tip"];
    Talk::run(python, "folder.py", &[&[folder, "--hold", "0"], words.as_slice(), more].concat())
}

/// An image of a single grey level, as a file.
fn image(grey: u8, format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    RgbImage::from_pixel(8, 6, Rgb([grey; 3])).write_to(&mut bytes, format).expect("an image");
    bytes.into_inner()
}

fn append(path: &Path, text: &str) {
    let mut file = std::fs::OpenOptions::new().append(true).create(true).open(path).expect("a file");
    file.write_all(text.as_bytes()).expect("written");
}

/// Waits for the pose whose x is this, in millimetres.
fn wait_for_x(talk: &mut Talk, x_mm: f64) {
    talk.wait(|message, _| match message {
        FromDriver::State(state) => {
            let x_m = state.base_from_tip.expect("a pose").translation_m[0];
            ((x_m * 1e3 - x_mm).abs() < 1e-9).then_some(())
        }
        FromDriver::Error(error) => panic!("{}", error.text),
        _ => None,
    });
}

fn wait_for_log(talk: &mut Talk, text: &str) {
    talk.wait(|message, _| match message {
        FromDriver::Log(log) => log.text.contains(text).then_some(()),
        FromDriver::Error(error) => panic!("{}", error.text),
        _ => None,
    });
}

#[test]
fn an_image_is_shown_with_its_pose_once_both_are_whole() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let (table, file) = (folder.path().join("poses.csv"), folder.path().join("a_1.png"));
    let mut talk = start(&python, folder.path(), &SIZE);
    let hello = talk.hello();
    assert!(hello.can.contains(&Ability::State) && hello.can.contains(&Ability::Image));

    // Half of the file, then the row, then the rest.
    let bytes = image(77, ImageFormat::Png);
    std::fs::write(&file, &bytes[..bytes.len() / 2]).expect("written");
    append(&table, HEADER);
    append(&table, "a_1.png,100,0,0,0,0,90\n");
    wait_for_log(&mut talk, "a_1.png");
    std::fs::write(&file, &bytes).expect("written");
    wait_for_x(&mut talk, 100.0);
    let (image_message, got) = talk.image(None, false);
    assert_eq!((image_message.width, image_message.height, image_message.encoding), (8, 6, ImageEncoding::Png));
    assert_eq!(got, bytes);
    // The pose at the instant of the image is the one that belongs to it, before and after it.
    let after = talk.state();
    assert!(after.stamp >= image_message.stamp && after.moving == Some(false));
    talk.bye();
}

#[test]
fn images_that_come_together_are_shown_in_natural_order_each_with_its_own_pose() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let mut talk = start(&python, folder.path(), &SIZE);
    talk.hello();
    for number in [10, 9, 2] {
        let name = format!("view_{number}.jpg");
        std::fs::write(folder.path().join(&name), image(number, ImageFormat::Jpeg)).expect("written");
    }
    append(&folder.path().join("poses.csv"), HEADER);
    append(
        &folder.path().join("poses.csv"),
        "view_9.jpg,9,0,0,0,0,0\nview_10.jpg,10,0,0,0,0,0\nview_2.jpg,2,0,0,0,0,0\n",
    );
    for x_mm in [2.0, 9.0, 10.0] {
        wait_for_x(&mut talk, x_mm);
    }
    talk.bye();
}

#[test]
fn a_pose_may_lie_beside_its_image() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("first.bmp"), image(9, ImageFormat::Bmp)).expect("written");
    std::fs::write(folder.path().join("first.txt"), "5 0 0 0 0 0").expect("written");
    let mut talk = start(&python, folder.path(), &[]);
    assert_eq!(talk.hello().camera.map(|camera| (camera.width, camera.height)), Some((8, 6)));
    wait_for_x(&mut talk, 5.0);
    let (message, bytes) = talk.image(None, false);
    assert_eq!((message.encoding, bytes), (ImageEncoding::Rgb8, vec![9; 8 * 6 * 3]));
    std::fs::write(folder.path().join("second.png"), image(10, ImageFormat::Png)).expect("written");
    std::fs::write(folder.path().join("second.json"), r#"{"x":6,"y":0,"z":0,"rx":0,"ry":0,"rz":0}"#).expect("written");
    wait_for_x(&mut talk, 6.0);
    talk.bye();
}

#[test]
fn what_is_missing_or_wrong_is_named_and_the_rest_goes_on() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let table = folder.path().join("poses.csv");
    let mut talk = start(&python, folder.path(), &SIZE);
    talk.hello();
    std::fs::write(folder.path().join("alone.png"), image(1, ImageFormat::Png)).expect("written");
    append(&table, HEADER);
    append(&table, "gone.png,1,0,0,0,0,0\n");
    let mut expected = vec!["alone.png has no pose", "there is no image gone.png"];
    talk.wait(|message, _| {
        if let FromDriver::Log(log) = message {
            expected.retain(|text| !log.text.contains(text));
        }
        expected.is_empty().then_some(())
    });
    append(&table, "alone.png,3,0,0,0,0,east\n");
    wait_for_log(&mut talk, "east");
    let repaired = format!("{HEADER}gone.png,1,0,0,0,0,0\nalone.png,3,0,0,0,0,0\n");
    std::fs::write(&table, repaired).expect("written");
    wait_for_x(&mut talk, 3.0);
    let mut other = std::io::Cursor::new(Vec::new());
    RgbImage::new(9, 6).write_to(&mut other, ImageFormat::Png).expect("an image");
    append(&table, "other.png,4,0,0,0,0,0\n");
    std::fs::write(folder.path().join("other.png"), other.into_inner()).expect("written");
    wait_for_log(&mut talk, "other.png is 9×6");
    talk.bye();
}

#[test]
fn images_alone_are_a_camera() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("only.png"), image(3, ImageFormat::Png)).expect("written");
    let mut talk = Talk::run(&python, "folder.py", &[folder.path().to_str().expect("letters"), "--images-only"]);
    assert_eq!(talk.hello().can, [Ability::Image]);
    let (first, _) = talk.image(None, false);
    // As with a camera that looks at a static scene: there is always a newer image.
    let (second, _) = talk.image(Some(first.stamp), false);
    assert!(second.stamp > first.stamp);
    talk.bye();
}

#[test]
fn an_empty_folder_is_refused_with_what_to_do_when_the_size_of_images_is_unknown() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let text = start(&python, folder.path(), &[]).error();
    assert!(text.contains("--size"), "{text}");
    let text = start(&python, &folder.path().join("nowhere"), &SIZE).error();
    assert!(text.contains("is no folder"), "{text}");
}
