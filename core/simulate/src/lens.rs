//! Projection of a point by a lens, written out from the published formulas: no line of it is shared with the estimator's lenses,
//! which a test compares it with.

use nalgebra::{Point3, Vector2};

use handeye_geometry::camera::{Distortion, Intrinsics};

/// The pixel of a point in the camera's frame; `None` where there is none.
pub fn pixel(camera: &Intrinsics, point: &Point3<f64>) -> Option<Vector2<f64>> {
    let across = point.x.hypot(point.y);
    let on_image = match camera.distortion {
        Distortion::Fisheye(k) => {
            let angle = across.atan2(point.z);
            let stretched: f64 =
                (1..).step_by(2).zip([1.0, k[0], k[1], k[2], k[3]]).map(|(n, k)| k * angle.powi(n)).sum();
            // On the axis the image is as that of a pinhole.
            point.coords.xy() * if across > 0.0 { stretched / across } else { point.z.recip() }
        }
        _ if point.z.is_nan() || point.z <= 0.0 => return None,
        Distortion::None => point.coords.xy() / point.z,
        Distortion::BrownConrady([k1, k2, p1, p2, k3]) => {
            brown([k1, k2, k3], [0.0; 3], [p1, p2], point.coords.xy() / point.z)
        }
        Distortion::Rational([k1, k2, p1, p2, k3, k4, k5, k6]) => {
            brown([k1, k2, k3], [k4, k5, k6], [p1, p2], point.coords.xy() / point.z)
        }
    };
    Some(Vector2::new(camera.fx * on_image.x + camera.cx, camera.fy * on_image.y + camera.cy))
}

/// Radial and tangential distortion of a point of the plane at depth 1: `above` over `below` in even powers of the distance from
/// the axis, and decentred by `p`.
fn brown(above: [f64; 3], below: [f64; 3], p: [f64; 2], at: Vector2<f64>) -> Vector2<f64> {
    let square = at.norm_squared();
    let series = |k: [f64; 3]| 1.0 + k[0] * square + k[1] * square.powi(2) + k[2] * square.powi(3);
    // Both tangential terms as one vector: the decentring is the vector (p2, p1).
    let decentring = Vector2::new(p[1], p[0]);
    at * (series(above) / series(below) + 2.0 * decentring.dot(&at)) + decentring * square
}

/// Whether a pixel is in the image, whose outermost pixels are whole.
pub fn is_in_image(camera: &Intrinsics, px: &Vector2<f64>) -> bool {
    let within = |value: f64, count: u32| (-0.5..f64::from(count) - 0.5).contains(&value);
    within(px.x, camera.width) && within(px.y, camera.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two programs of the same formulas: rounding of numbers of some hundred pixels is 10⁻¹³.
    #[test]
    fn every_lens_puts_points_where_that_of_the_estimator_does() {
        for distortion in [
            Distortion::None,
            Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
            Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
            Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
        ] {
            let camera = Intrinsics { distortion, fy: 579.0, cx: 322.4, ..Intrinsics::pinhole(640, 480, 581.0) };
            for i in 0..100 {
                let point = Point3::new(
                    f64::from(i % 10) * 0.05 - 0.2,
                    f64::from(i / 10) * 0.04 - 0.16,
                    0.4 + 0.003 * f64::from(i),
                );
                let (here, there) = (pixel(&camera, &point), camera.project(&point));
                let (Some(here), Ok(there)) = (here, there) else { panic!("{point} has a pixel") };
                assert!((here - there).norm() < 1e-11, "{distortion:?}: {here} {there}");
            }
            let behind = Point3::new(0.1, 0.1, -0.3);
            assert_eq!(pixel(&camera, &behind).is_some(), camera.project(&behind).is_ok(), "{distortion:?}");
        }
    }
}
