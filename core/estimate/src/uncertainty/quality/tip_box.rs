//! The expected error over a box of the workspace.

use nalgebra::{Isometry3, Point3, Vector3};

use handeye_geometry::frames::{Base, Camera, Pose};

/// A box in which points will be measured, its sides along the axes of the frame it is given in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipBox {
    /// Smallest coordinates, metres.
    low: Point3<f64>,
    /// Largest coordinates, metres.
    high: Point3<f64>,
    /// Where the frame of the box is.
    camera_from_box: Isometry3<f64>,
}

impl TipBox {
    /// A box in camera coordinates, between two opposite corners \[m\].
    pub fn in_camera(a: Point3<f64>, b: Point3<f64>) -> Self {
        Self { low: a.inf(&b), high: a.sup(&b), camera_from_box: Isometry3::identity() }
    }

    /// A box in the robot's base between two opposite corners \[m\]. For a camera next to the robot `camera_from_base`
    /// is the inverse of the calibration; for one on the tip it holds at the tip pose from which the box will be seen,
    /// because the error of a point depends on where the camera sees it.
    pub fn in_base(a: Point3<f64>, b: Point3<f64>, camera_from_base: &Pose<Camera, Base>) -> Self {
        Self { camera_from_box: *camera_from_base.isometry(), ..Self::in_camera(a, b) }
    }

    /// Its eight corners and its middle, in camera coordinates \[m\].
    pub fn corners_and_middle(&self) -> [Point3<f64>; 9] {
        std::array::from_fn(|k| {
            let bit = |axis: usize| if k == 8 { 0.5 } else { (k >> axis & 1) as f64 };
            self.camera_from_box * self.at(&Vector3::new(bit(0), bit(1), bit(2)))
        })
    }

    /// Opposite corners in the frame that it was given in \[m\]: the smallest coordinates and the largest.
    pub fn bounds(&self) -> [Point3<f64>; 2] {
        [self.low, self.high]
    }

    /// A point of the box by its place between the two corners, 0 to 1 on every axis.
    fn at(&self, part: &Vector3<f64>) -> Point3<f64> {
        self.low + (self.high - self.low).component_mul(part)
    }
}

/// The expected error over a box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxError {
    /// Largest error (95 %) of any point of the box, metres.
    pub worst_m: f64,
    /// Where, in the frame of the box, metres.
    pub worst_at: Point3<f64>,
    /// Mean over the box of the error (95 %), metres.
    pub mean_m: f64,
}

/// Nodes and weights of three-point Gauss–Legendre quadrature on [0, 1], exact for polynomials of the fifth degree; the
/// error is the root of one of the second.
const NODES: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// Expected error (95 %) of measured points over a box: the worst one, its place, and the mean.
///
/// `error_95_m` is the error at a point in camera coordinates. The error vector of a point, `t + r × p`, is linear in the
/// point, so the mean of its square is a convex function of it, as is the distance by which a transform moves it, and
/// greatest at a corner of the box; the eight corners are compared.
pub fn tip_error_95_over(error_95_m: impl Fn(&Point3<f64>) -> f64, tip_box: &TipBox) -> BoxError {
    let error = |part: &Vector3<f64>| {
        let at = tip_box.at(part);
        (error_95_m(&(tip_box.camera_from_box * at)), at)
    };
    let mut worst = (f64::NEG_INFINITY, tip_box.low);
    for corner in 0..8u8 {
        let bit = |axis: u8| f64::from(corner >> axis & 1);
        let here = error(&Vector3::new(bit(0), bit(1), bit(2)));
        // Written such that an error that is NaN is the worst.
        if here.0.is_nan() || here.0 > worst.0 {
            worst = here;
        }
    }
    let mut mean_m = 0.0;
    for (x, by_x) in NODES {
        for (y, by_y) in NODES {
            for (z, by_z) in NODES {
                mean_m += by_x * by_y * by_z * error(&Vector3::new(x, y, z)).0;
            }
        }
    }
    BoxError { worst_m: worst.0, worst_at: worst.1, mean_m }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};

    use super::*;
    use crate::handeye::joint::SmallSample;
    use crate::uncertainty::quality::tip_error_95_at;
    use handeye_geometry::se3;

    fn by(c: &Matrix6<f64>, law: SmallSample) -> impl Fn(&Point3<f64>) -> f64 {
        move |point| tip_error_95_at(c, law, point)
    }

    fn few(degrees_of_freedom: f64) -> SmallSample {
        SmallSample { degrees_of_freedom, ..SmallSample::KNOWN }
    }

    #[test]
    fn the_error_over_a_box_is_that_of_its_worst_point_and_of_its_mean() {
        // A rotation error about the z axis alone moves a point by its distance from the axis. Seen from (0.3, 0.4) to
        // (0.9, 1.2) the far edge is worst; along a line from the axis the mean is that of the distance.
        let mut c = Matrix6::zeros();
        c[(5, 5)] = 1e-6;
        let tip_box = TipBox::in_camera(Point3::new(0.9, 0.4, 0.5), Point3::new(0.3, 1.2, 0.1));
        let error = tip_error_95_over(by(&c, SmallSample::KNOWN), &tip_box);
        assert!((error.worst_m - 1.95996e-3 * 1.5).abs() < 1e-7, "{error:?}");
        assert!((error.worst_at.xy() - nalgebra::Point2::new(0.9, 1.2)).norm() < 1e-12);
        let line = TipBox::in_camera(Point3::new(0.1, 0.0, 0.5), Point3::new(0.7, 0.0, 0.5));
        assert!((tip_error_95_over(by(&c, SmallSample::KNOWN), &line).mean_m - 1.95996e-3 * 0.4).abs() < 1e-7);
        assert!(tip_error_95_over(by(&c, few(5.0)), &line).mean_m > 1.3 * 1.95996e-3 * 0.4);
    }

    #[test]
    fn no_point_of_the_box_is_worse_than_the_worst() {
        let l = Matrix6::from_fn(|i, j| ((7 * i + 3 * j) as f64).sin() * 1e-3);
        let c = l * l.transpose();
        let camera_from_base: Pose<Camera, Base> =
            Pose::from_isometry(se3::exp(&Vector6::new(0.4, -0.2, 0.9, 0.3, 2.0, -0.5)));
        let (low, high) = (Point3::new(-0.3, 0.1, 0.0), Point3::new(0.5, 0.6, 0.4));
        let tip_box = TipBox::in_base(low, high, &camera_from_base);
        let worst = tip_error_95_over(by(&c, few(8.0)), &tip_box);
        let at = |p: Point3<f64>| tip_error_95_at(&c, few(8.0), &(camera_from_base.isometry() * p));
        assert!((at(worst.worst_at) - worst.worst_m).abs() < 1e-12);
        for i in 0..125 {
            let part = Vector3::new(f64::from(i % 5), f64::from(i / 5 % 5), f64::from(i / 25)) / 4.0;
            let here = at(tip_box.at(&part));
            assert!(here <= worst.worst_m * (1.0 + 1e-9), "{part}: {here} > {}", worst.worst_m);
        }
    }
}
