use approx::assert_relative_eq;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::Sensor;
use handeye_geometry::frames::{Base, Camera, Tip};
use handeye_wire::axes::sensor_from_camera;
use nalgebra::Point3;
use nalgebra::Vector3;

use super::*;

type Seen = Pose<Base, Tip>;

#[test]
fn a_sensor_image_is_not_mirrored() {
    // From the sensor: y is up, x is to the left of the image, z ahead.
    let camera_from_sensor = sensor_from_camera().inverse();
    let up = camera_from_sensor.isometry() * Point3::new(0.0, 0.1, 1.0);
    let left = camera_from_sensor.isometry() * Point3::new(0.1, 0.0, 1.0);
    let camera = Intrinsics::from_view_angle(640, 480, 57.0_f64.to_radians());
    let centre = camera.project(&Point3::new(0.0, 0.0, 1.0)).expect("in front");
    assert_relative_eq!(centre.x, 319.5);
    assert_relative_eq!(centre.y, 239.5);
    // f = 320 / tan(28.5°) = 589.3667 px, so 0.1 m at 1 m is 58.94 px.
    let px = camera.project(&up).expect("in front");
    assert_relative_eq!(px.x, 319.5, epsilon = 1e-9);
    assert_relative_eq!(px.y, 239.5 - 58.93667, epsilon = 1e-4);
    let px = camera.project(&left).expect("in front");
    assert_relative_eq!(px.x, 319.5 - 58.93667, epsilon = 1e-4);
    assert_relative_eq!(px.y, 239.5, epsilon = 1e-9);
}

#[test]
fn the_reference_scene_has_its_known_camera() {
    // The sensor at (0.05, 0, 0) of the tip, turned by -90° about z, is a camera turned by +90°.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let tip_from_sensor: Pose<Tip, Sensor> = pose_from_seven(&[0.05, 0.0, 0.0, 0.0, 0.0, -half, half]).expect("a pose");
    let tip_from_camera: Pose<Tip, Camera> = tip_from_sensor * sensor_from_camera();
    let x_in_tip = tip_from_camera.rotation() * Vector3::x();
    let ahead_in_tip = tip_from_camera.rotation() * Vector3::z();
    assert_relative_eq!(x_in_tip, Vector3::y(), epsilon = 1e-12);
    assert_relative_eq!(ahead_in_tip, Vector3::z(), epsilon = 1e-12);
    assert_relative_eq!(tip_from_camera.translation(), Vector3::new(0.05, 0.0, 0.0), epsilon = 1e-12);
}

#[test]
fn a_pose_is_written_as_it_was_read() {
    let seven = [0.1, -0.2, 0.3, 0.18257418583505536, 0.3651483716701107, 0.5477225575051661, 0.7302967433402214];
    let pose: Seen = pose_from_seven(&seven).expect("a pose");
    assert_relative_eq!(seven_from_pose(&pose).as_slice(), seven.as_slice(), epsilon = 1e-12);
}

#[test]
fn numbers_that_are_no_pose_are_refused() {
    let seven = |v: [f64; 7]| pose_from_seven::<Base, Tip>(&v);
    assert_eq!(seven([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), Err(ConvertError::NotFinite));
    assert!(matches!(seven([0.0; 7]), Err(ConvertError::NotARotation { .. })));
    assert!(matches!(seven([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]), Err(ConvertError::NotARotation { .. })));
}

#[test]
fn single_precision_poses_are_accepted() {
    let single = |v: f64| f64::from(v as f32);
    let half = single(std::f64::consts::FRAC_1_SQRT_2);
    assert!(pose_from_seven::<Base, Tip>(&[0.0, 0.0, 0.0, 0.0, 0.0, half, half]).is_ok());
}

#[test]
fn the_bottom_row_of_the_buffer_is_the_last_of_the_image() {
    // 2 × 2: bottom row red, green; top row blue, white.
    let buffer = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    let image = rgb_from_bytes(&buffer, 2, 2).expect("fits");
    assert_eq!(image.get_pixel(0, 1).0, [255, 0, 0]);
    assert_eq!(image.get_pixel(1, 1).0, [0, 255, 0]);
    assert_eq!(image.get_pixel(0, 0).0, [0, 0, 255]);
    assert_eq!(image.get_pixel(1, 0).0, [255, 255, 255]);
}

#[test]
fn the_recorded_depths_are_metres() {
    let recorded = [0x00, 0x00, 0x00, 0x3f, 0x00, 0x00, 0x60, 0x40];
    let one_row = depth_from_bytes(&recorded, 2, 1).expect("fits");
    assert_eq!(one_row.metres, [0.5, 3.5]);
    let one_column = depth_from_bytes(&recorded, 1, 2).expect("fits");
    assert_eq!(one_column, DepthImage { width: 1, height: 2, metres: vec![3.5, 0.5] }, "the upper row is the second");
}

#[test]
fn a_buffer_of_another_size_is_refused() {
    let error = rgb_from_bytes(&[0; 11], 2, 2).expect_err("one byte short");
    assert_eq!(error, ConvertError::BufferSize { got: 11, expected: 12, width: 2, height: 2 });
    assert!(depth_from_bytes(&[0; 17], 2, 2).is_err());
    assert!(rgb_from_bytes(&[], 0, 0).is_err());
}

#[test]
fn only_sizes_are_sizes() {
    assert_eq!(resolution(640.0, 480.0), Ok((640, 480)));
    for (w, h) in [(0.0, 480.0), (640.0, -1.0), (640.5, 480.0), (f64::NAN, 480.0), (1e9, 480.0)] {
        assert!(resolution(w, h).is_err(), "{w} {h}");
    }
}
