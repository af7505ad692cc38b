//! `--box`: where the tool works.

use handeye_estimate::uncertainty::quality::TipBox;
use nalgebra::{Point3, Vector3};

/// A longer length \[m\] is taken for millimetres.
const FARTHEST_M: f64 = 10.0;

/// Centre and edges of a box in the camera, `x,y,z,dx,dy,dz` in metres: x to the right, y down, z forward.
///
/// # Errors
/// What is wrong with the text.
pub fn tool_box(text: &str) -> Result<TipBox, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    let numbers = numbers.map_err(|_none| format!("{text:?} has something that is not a number"))?;
    let [x, y, z, dx, dy, dz] = numbers[..] else {
        return Err(format!("{} numbers: give x,y,z,dx,dy,dz, centre and edges in metres", numbers.len()));
    };
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("a number is not finite".to_owned());
    }
    if let Some(far) = numbers.iter().find(|number| number.abs() > FARTHEST_M) {
        return Err(format!("{far} m: lengths are metres here; divide millimetres by 1000"));
    }
    if let Some(edge) = [dx, dy, dz].into_iter().find(|edge| *edge < 0.0) {
        return Err(format!("an edge of {edge} m: give the whole length of each edge, 0 or more"));
    }
    let (middle, half) = (Point3::new(x, y, z), Vector3::new(dx, dy, dz) / 2.0);
    Ok(TipBox::in_camera(middle - half, middle + half))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_and_edges_make_a_box_and_what_is_none_says_so() {
        let [low, high] = tool_box("0, 0.1,0.5,0.2,0.2,0.1").expect("a box").bounds();
        assert!((low - Point3::new(-0.1, 0.0, 0.45)).norm() < 1e-12);
        assert!((high - Point3::new(0.1, 0.2, 0.55)).norm() < 1e-12);
        for (text, says) in [
            ("1,2,3", "3 numbers"),
            ("0,0,0.5,0.1,0.1,x", "not a number"),
            ("0,0,500,100,100,100", "millimetres"),
            ("0,0,0.5,-0.1,0.1,0.1", "whole length"),
            ("0,0,nan,0.1,0.1,0.1", "finite"),
        ] {
            let error = tool_box(text).expect_err(text);
            assert!(error.contains(says), "{error}");
        }
    }
}
