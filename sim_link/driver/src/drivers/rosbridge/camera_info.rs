//! What `sensor_msgs/CameraInfo` says about the lens.

use handeye_geometry::camera::Distortion;

use super::messages::CameraInfo;
use crate::message::LensMessage;

/// The lens of images of this size.
///
/// The raw image has `K` and `D`; the rectified one `P` and no distortion.
///
/// # Errors
/// Why it says nothing that can be used.
pub(super) fn lens(info: &CameraInfo, (width, height): (u32, u32), is_rectified: bool) -> Result<LensMessage, String> {
    if (info.width, info.height) != (width, height) {
        let (w, h) = (info.width, info.height);
        return Err(format!("it is for images of {w}×{h}, and they are {width}×{height}"));
    }
    let is_part = info.binning_x > 1
        || info.binning_y > 1
        || info.roi.as_ref().is_some_and(|region| region.x_offset > 0 || region.y_offset > 0);
    if is_part {
        return Err("it is for the whole sensor, and the images are binned or cut out of it".into());
    }
    let [fx, _, cx, _, fy, cy, ..] = info.k;
    let lens = if is_rectified {
        let [fx, _, cx, _, _, fy, cy, ..] = info.p;
        LensMessage { fx, fy, cx, cy, distortion: Distortion::None }
    } else {
        LensMessage { fx, fy, cx, cy, distortion: distortion(&info.distortion_model, &info.d)? }
    };
    if lens.fx == 0.0 {
        return Err("the camera is not calibrated: its matrix is zero".into());
    }
    lens.intrinsics(width, height).map(|_| lens).map_err(|error| error.to_string())
}

fn distortion(model: &str, d: &[f64]) -> Result<Distortion, String> {
    if d.iter().all(|&value| value == 0.0) {
        return Ok(Distortion::None);
    }
    let count = || format!("{model} with {} coefficients", d.len());
    match model {
        "plumb_bob" => match *d {
            [k1, k2, p1, p2] => Ok(Distortion::BrownConrady([k1, k2, p1, p2, 0.0])),
            [k1, k2, p1, p2, k3] => Ok(Distortion::BrownConrady([k1, k2, p1, p2, k3])),
            _ => Err(count()),
        },
        "rational_polynomial" => match d.split_first_chunk::<8>() {
            // OpenCV writes up to 14; those after the eighth are for thin prisms and tilted sensors.
            Some((first, rest)) if rest.iter().all(|&value| value == 0.0) => Ok(Distortion::Rational(*first)),
            _ => Err(count()),
        },
        "equidistant" | "fisheye" => d.try_into().map(Distortion::Fisheye).map_err(|_error| count()),
        _ => Err(format!("the lens model {model:?} is not known; plumb_bob, rational_polynomial and equidistant are")),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn info(model: &str, d: &[f64]) -> CameraInfo {
        serde_json::from_value(json!({
            "header": {"stamp": {"secs": 1, "nsecs": 2}, "frame_id": "camera"},
            "height": 480, "width": 640, "distortion_model": model, "D": d,
            "K": [600.0, 0.0, 320.5, 0.0, 601.0, 240.5, 0.0, 0.0, 1.0],
            "R": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            "P": [590.0, 0.0, 321.0, 0.0, 0.0, 591.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            "binning_x": 0, "binning_y": 0,
            "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": false},
        }))
        .expect("a message")
    }

    #[test]
    fn raw_images_have_the_matrix_and_the_distortion_and_rectified_ones_the_projection() {
        let info = info("plumb_bob", &[0.1, -0.2, 0.001, 0.002, 0.05]);
        let raw = lens(&info, (640, 480), false).expect("a lens");
        assert_eq!([raw.fx, raw.fy, raw.cx, raw.cy], [600.0, 601.0, 320.5, 240.5]);
        assert_eq!(raw.distortion, Distortion::BrownConrady([0.1, -0.2, 0.001, 0.002, 0.05]));
        let rectified = lens(&info, (640, 480), true).expect("a lens");
        assert_eq!([rectified.fx, rectified.fy, rectified.cx, rectified.cy], [590.0, 591.0, 321.0, 241.0]);
        assert_eq!(rectified.distortion, Distortion::None);
    }

    #[test]
    fn other_models_are_taken_as_opencv_orders_them_or_refused() {
        let d: Vec<f64> = (1..=8).map(f64::from).collect();
        let rational = lens(&info("rational_polynomial", &d), (640, 480), false).expect("a lens");
        assert_eq!(rational.distortion.coefficients(), d);
        let fisheye = lens(&info("equidistant", &d[..4]), (640, 480), false).expect("a lens");
        assert_eq!(fisheye.distortion, Distortion::Fisheye([1.0, 2.0, 3.0, 4.0]));
        assert!(lens(&info("plumb_bob", &d), (640, 480), false).is_err());
        assert!(lens(&info("thin_prism", &d), (640, 480), false).is_err());
        assert!(lens(&info("plumb_bob", &[]), (320, 240), false).expect_err("another size").contains("640×480"));
    }

    #[test]
    fn a_camera_that_was_never_calibrated_has_no_lens() {
        let mut info = info("plumb_bob", &[]);
        info.k = [0.0; 9];
        assert!(lens(&info, (640, 480), false).expect_err("refused").contains("not calibrated"));
    }
}
