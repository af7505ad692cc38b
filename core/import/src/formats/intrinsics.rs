//! Cameras that others have calibrated: ROS `camera_info` (`ost.yaml`), Kalibr's camchain, OpenCV's files, and JSON or YAML with a
//! matrix and its coefficients.

use crate::recording::FoundCamera;
use crate::value::Value;
use handeye_geometry::camera::{Distortion, Intrinsics};

pub(super) fn of_document(value: &Value, file: &str) -> Vec<FoundCamera> {
    let kalibr = kalibr(value, file);
    if !kalibr.is_empty() {
        return kalibr;
    }
    let found = of_matrix(value, file).or_else(|| of_four(value, file));
    let nested = || {
        ["camera", "color", "intrinsics", "camera_info", "rgb"]
            .iter()
            .filter_map(|key| value.get(key))
            .find_map(|v| of_matrix(v, file).or_else(|| of_four(v, file)))
    };
    found.or_else(nested).into_iter().collect()
}

pub(super) fn camera(
    file: &str,
    why: &'static str,
    four: [f64; 4],
    size: Option<(u32, u32)>,
    distortion: Distortion,
) -> Option<FoundCamera> {
    let [fx, fy, cx, cy] = four;
    let usable = four.iter().all(|v| v.is_finite()) && fx > 1.0 && fy > 1.0 && cx > 0.0 && cy > 0.0;
    let (width, height) = size.unwrap_or_default();
    usable.then(|| FoundCamera {
        name: file.to_owned(),
        intrinsics: Intrinsics { width, height, fx, fy, cx, cy, distortion },
        why,
    })
}

pub(super) fn size_of(value: &Value) -> Option<(u32, u32)> {
    let whole = |keys: &[&str]| keys.iter().find_map(|key| value.get(key)).and_then(Value::whole).map(|n| n as u32);
    let sides = (whole(&["image_width", "width", "w"]), whole(&["image_height", "height", "h"]));
    if let (Some(width), Some(height)) = sides {
        return Some((width, height));
    }
    let list = ["resolution", "image_size", "imagersize", "img_size", "size"].iter().find_map(|key| value.get(key));
    match list?.numbers(2)?.as_slice() {
        [width, height] if *width > 0.0 && *height > 0.0 => Some((*width as u32, *height as u32)),
        _ => None,
    }
}

/// Coefficients in OpenCV's order: none, 4, 5 or 8 of them.
pub(super) fn brown(k: &[f64]) -> Option<Distortion> {
    if k.iter().any(|v| !v.is_finite()) {
        return None;
    }
    match *k {
        _ if k.iter().all(|v| *v == 0.0) => Some(Distortion::None),
        [k1, k2, p1, p2] => Some(Distortion::BrownConrady([k1, k2, p1, p2, 0.0])),
        [k1, k2, p1, p2, k3] => Some(Distortion::BrownConrady([k1, k2, p1, p2, k3])),
        [k1, k2, p1, p2, k3, k4, k5, k6, ref rest @ ..] if rest.iter().all(|v| *v == 0.0) => {
            Some(Distortion::Rational([k1, k2, p1, p2, k3, k4, k5, k6]))
        }
        _ => None,
    }
}

/// A 3×3 matrix with coefficients.
fn of_matrix(value: &Value, file: &str) -> Option<FoundCamera> {
    let first = |keys: &[&str]| keys.iter().find_map(|key| value.get(key));
    let matrix = first(&[
        "camera_matrix",
        "cameraMatrix",
        "intrinsic",
        "intrinsics",
        "K",
        "camera_intrinsics",
        "mtx",
        "intrinsic_matrix",
        "CameraMatrix",
        "Camera_Matrix",
        "k_matrix",
    ])?;
    let k = match matrix.numbers(9) {
        Some(numbers) => numbers,
        None => matrix.get("data")?.numbers(9)?,
    };
    let &[fx, _, cx, _, fy, cy, ..] = k.as_slice() else { return None };
    if k.len() != 9 || k[8] != 1.0 {
        return None;
    }
    let coefficients = first(&[
        "distortion_coefficients",
        "distortion",
        "dist",
        "dist_coeffs",
        "distCoeffs",
        "D",
        "distortion_coeffs",
        "Distortion_Coefficients",
        "dist_coef",
    ]);
    let coefficients = match coefficients {
        Some(value) => value.numbers(14).or_else(|| value.get("data")?.numbers(14))?,
        None => Vec::new(),
    };
    let model = value.get("distortion_model").and_then(Value::text).unwrap_or("plumb_bob");
    let (distortion, why) = match (model, coefficients.as_slice()) {
        ("equidistant" | "fisheye", &[a, b, c, d]) => (Distortion::Fisheye([a, b, c, d]), "camera_info of ROS"),
        _ if value.get("distortion_model").is_some() => (brown(&coefficients)?, "camera_info of ROS"),
        _ => (brown(&coefficients)?, "a camera matrix"),
    };
    camera(file, why, [fx, fy, cx, cy], size_of(value), distortion)
}

/// fx fy cx cy by name.
fn of_four(value: &Value, file: &str) -> Option<FoundCamera> {
    let number = |keys: &[&str]| keys.iter().find_map(|key| value.get(key)).and_then(Value::number);
    let four = [number(&["fx"])?, number(&["fy"])?, number(&["cx", "ppx"])?, number(&["cy", "ppy"])?];
    let coefficients =
        ["coeffs", "distortion", "dist", "D", "distortion_coefficients"].iter().find_map(|key| value.get(key));
    let coefficients = coefficients.and_then(|value| value.numbers(14)).unwrap_or_default();
    camera(file, "focal lengths and principal point by name", four, size_of(value), brown(&coefficients)?)
}

/// Kalibr's camchain: `cam0`, `cam1`, ….
fn kalibr(value: &Value, file: &str) -> Vec<FoundCamera> {
    let Value::Map(entries) = value else { return Vec::new() };
    let one = |(key, camera_value): &(String, Value)| {
        let four: [f64; 4] = camera_value.get("intrinsics")?.numbers(4)?.try_into().ok()?;
        if camera_value.get("camera_model")?.text()? != "pinhole" {
            return None;
        }
        let k = camera_value.get("distortion_coeffs").and_then(|v| v.numbers(8)).unwrap_or_default();
        let distortion = match (camera_value.get("distortion_model").and_then(Value::text), k.as_slice()) {
            (Some("radtan"), _) => brown(&k)?,
            (Some("equidistant"), &[a, b, c, d]) => Distortion::Fisheye([a, b, c, d]),
            (Some("none") | None, _) => Distortion::None,
            _ => return None,
        };
        camera(&format!("{file}:{key}"), "a camchain of Kalibr", four, size_of(camera_value), distortion)
    };
    entries.iter().filter(|(key, _)| key.starts_with("cam")).take(16).filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::cameras::mrcal;
    use crate::value::{json, yaml};

    fn only(found: &[FoundCamera]) -> Intrinsics {
        assert_eq!(found.len(), 1, "{found:?}");
        found[0].intrinsics
    }

    #[test]
    fn every_form_of_one_camera_is_the_same_camera() {
        let ros = "image_width: 1280\nimage_height: 720\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [912.4, 0.0, 640.7, 0.0, 911.8, 361.2, 0.0, 0.0, 1.0]\n\
                   distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.082, -0.191, 0.0006, -0.0004, 0.0]\n";
        let opencv = "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 720\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                      data: [ 912.4, 0., 640.7, 0., 911.8, 361.2, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   \
                      data: [ 0.082, -0.191, 0.0006, -0.0004, 0. ]\n";
        let kalibr = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.082, -0.191, 0.0006, -0.0004]\n  distortion_model: radtan\n  \
                      intrinsics: [912.4, 911.8, 640.7, 361.2]\n  resolution: [1280, 720]\n";
        let mrcal_text = "{\n    'lensmodel':  'LENSMODEL_OPENCV5',\n    'intrinsics': [ 912.4, 911.8, 640.7, 361.2, 0.082, -0.191, 0.0006, -0.0004, 0.0,],\n    \
                          'extrinsics': [ 0, 0, 0, 0, 0, 0,],\n    'imagersize': [ 1280, 720,],\n}\n";
        let own = r#"{"intrinsic": [[912.4, 0, 640.7], [0, 911.8, 361.2], [0, 0, 1]], "distortion": [[0.082, -0.191, 0.0006, -0.0004, 0]], "resolution": [1280, 720]}"#;
        let want = Intrinsics {
            width: 1280,
            height: 720,
            fx: 912.4,
            fy: 911.8,
            cx: 640.7,
            cy: 361.2,
            distortion: Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0]),
        };
        for text in [ros, opencv, kalibr] {
            assert_eq!(only(&of_document(&yaml(text).expect("YAML")[0], "f")), want);
        }
        assert_eq!(only(&of_document(&json(own).expect("JSON"), "f")), want);
        assert_eq!(only(mrcal(mrcal_text, "f").as_slice()), want);
    }
}
