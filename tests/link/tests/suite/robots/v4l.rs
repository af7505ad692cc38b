//! `handeye driver v4l` with a module that replaces OpenCV and provides a webcam: no camera is needed.

use std::path::Path;
use std::process::Command;

use handeye_driver::message::{Ability, FromDriver, ImageEncoding};
use handeye_geometry::testing::python;

use super::{Talk, driver_file};

/// The driver with the webcam at a device.
fn start(python: &Path, device: &str, options: &[&str]) -> Talk {
    let cameras = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/python/webcam");
    let mut command = Command::new(python);
    command.arg(driver_file("v4l.py")).args(["--device", device]).args(options).env("PYTHONPATH", cameras);
    Talk::with(command)
}

#[test]
fn the_format_that_loses_least_is_read_in_its_largest_size_and_jpeg_where_the_size_asks_for_it() {
    let Some(python) = python() else { return };
    let device = tempfile::NamedTempFile::new().expect("a file");
    let device = device.path().to_str().expect("letters");
    let largest_yuyv = (640, 480, ImageEncoding::Bgr8, 640 * 480 * 3);
    let large_jpeg = (1920, 1080, ImageEncoding::Jpeg, 6);
    for (options, (width, height, encoding, length)) in
        [(&[][..], largest_yuyv), (&["--size", "1920x1080"][..], large_jpeg), (&["--format", "mjpg"][..], large_jpeg)]
    {
        let mut talk = start(&python, device, options);
        let hello = talk.hello();
        assert_eq!(hello.can, [Ability::Image]);
        let (image, bytes) = talk.image(None, false);
        assert_eq!((image.width, image.height, image.encoding, bytes.len()), (width, height, encoding, length));
        // The kernel's stamp, for a camera with 25 images per second.
        assert!((image.stamp_uncertainty_s - 0.06).abs() < 1e-9, "{image:?}");
        let (next, _) = talk.image(Some(image.stamp), false);
        assert!(next.stamp > image.stamp);
        talk.bye();
    }
}

#[test]
fn what_is_not_offered_is_answered_with_what_is_given_and_how_to_list_it() {
    let Some(python) = python() else { return };
    let device = tempfile::NamedTempFile::new().expect("a file");
    let device = device.path().to_str().expect("letters");
    for (options, expected) in
        [(&["--format", "grey"][..], "offers no GREY"), (&["--size", "800x600"][..], "of 800x600")]
    {
        let text = start(&python, device, options).error();
        assert!(text.contains(expected) && text.contains("v4l2-ctl --list-formats-ext"), "{text}");
    }
}

#[test]
fn a_frame_that_is_cut_off_is_left_out_and_a_camera_that_sends_no_more_ends_the_driver() {
    let Some(python) = python() else { return };
    let device = tempfile::NamedTempFile::new().expect("a file");
    let path = device.path().to_str().expect("letters");
    // The webcam cuts off each third JPEG, and ends when its device is gone.
    let mut talk = start(&python, path, &["--format", "mjpg"]);
    talk.hello();
    talk.wait(|message, _| match message {
        FromDriver::Log(log) => log.text.contains("no whole JPEG").then_some(()),
        _ => None,
    });
    talk.image(None, false);
    device.close().expect("it is removed");
    let text = talk.error();
    assert!(text.contains("was unplugged"), "{text}");
}

#[test]
fn a_device_that_is_no_camera_is_named() {
    let Some(python) = python() else { return };
    // OpenCV itself.
    let text = Talk::run(&python, "v4l.py", &["--device", "/dev/there-is-no-such-camera"]).error();
    assert!(text.contains("there is no /dev/there-is-no-such-camera"), "{text}");
    let text = Talk::run(&python, "v4l.py", &["--device", "/dev/null"]).error();
    assert!(text.contains("/dev/null is no camera that sends images"), "{text}");
}
