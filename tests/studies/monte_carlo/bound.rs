//! The Cramér–Rao bound of the hand-eye transform, from the model alone.
//!
//! It shares nothing with the estimator: the projection, the chain and the rotations are written out here, and every
//! derivative is a central difference. `docs/maths/uncertainty.md` has the formula.

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point3, Vector3, Vector6};

use super::scene::Trial;

/// Step of the differences in metres, radians and lens coefficients: far above rounding (1e-13 of 500 px) and far below
/// where the second-order term matters.
const STEP: f64 = 1e-6;
/// Step of the differences in focal lengths and principal point, pixels; the projection is linear in them.
const STEP_PX: f64 = 1e-2;
/// fx fy cx cy k1 k2 p1 p2 k3.
const LENS: usize = 9;

#[derive(Clone, Copy)]
struct Rigid {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Rigid {
    fn of(pose: &Isometry3<f64>) -> Self {
        Self { rotation: *pose.rotation.to_rotation_matrix().matrix(), translation: pose.translation.vector }
    }

    fn to(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * p + self.translation
    }

    fn back(&self, p: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (p - self.translation)
    }

    /// Moved and rotated by `step` along and about axis `axis % 3` of its source frame.
    fn nudged(&self, axis: usize, step: f64) -> Self {
        let mut unit = Vector3::zeros();
        unit[axis % 3] = step;
        if axis < 3 {
            return Self { translation: self.translation + self.rotation * unit, ..*self };
        }
        // Rodrigues: a rotation by `step` about a unit axis.
        let cross = Matrix3::new(0.0, -unit.z, unit.y, unit.z, 0.0, -unit.x, -unit.y, unit.x, 0.0) / step;
        let turn = Matrix3::identity() + cross * step.sin() + cross * cross * (1.0 - step.cos());
        Self { rotation: self.rotation * turn, ..*self }
    }
}

#[derive(Clone, Copy)]
struct Model {
    eye_in_hand: bool,
    hand_eye: Rigid,
    target: Rigid,
    tip: Rigid,
    lens: [f64; LENS],
}

/// Unknowns of a model: 6 of the hand-eye, 6 of the target, 9 of the lens, 6 of the tip.
const UNKNOWNS: usize = 12 + LENS + 6;

impl Model {
    fn nudged(&self, unknown: usize, by: f64) -> Self {
        let mut out = *self;
        match unknown {
            0..6 => out.hand_eye = self.hand_eye.nudged(unknown, by),
            6..12 => out.target = self.target.nudged(unknown - 6, by),
            12..21 => out.lens[unknown - 12] += by,
            _ => out.tip = self.tip.nudged(unknown - 21, by),
        }
        out
    }

    fn pixel(&self, point: &Vector3<f64>) -> [f64; 2] {
        let placed = self.target.to(point);
        let at_mount = if self.eye_in_hand { self.tip.back(&placed) } else { self.tip.to(&placed) };
        let p = self.hand_eye.back(&at_mount);
        let [fx, fy, cx, cy, k1, k2, p1, p2, k3] = self.lens;
        let (x, y) = (p.x / p.z, p.y / p.z);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
        [fx * u + cx, fy * v + cy]
    }

    /// Derivatives of both coordinates of a pixel with respect to every unknown.
    fn by_unknowns(nudged: &[(Self, Self, f64)], point: &Vector3<f64>) -> [[f64; UNKNOWNS]; 2] {
        let mut out = [[0.0; UNKNOWNS]; 2];
        for (k, (plus, minus, width)) in nudged.iter().enumerate() {
            let (a, b) = (plus.pixel(point), minus.pixel(point));
            out[0][k] = (a[0] - b[0]) / width;
            out[1][k] = (a[1] - b[1]) / width;
        }
        out
    }
}

/// First of the six columns of the tip.
const TIP: usize = 12 + LENS;

/// `Jᵀ J` of every view that is not grossly wrong, at the truth and without weights.
pub struct Normals {
    /// Unknowns that all views share: 6 of the hand-eye, 6 of the target and 9 of the lens if it is unknown.
    pub shared: usize,
    /// Scalar residuals.
    pub residuals: usize,
    views: Vec<DMatrix<f64>>,
}

/// One view's part.
pub struct Blocks {
    /// Shared by shared unknowns.
    pub shared: DMatrix<f64>,
    /// Tip by shared unknowns.
    pub cross: DMatrix<f64>,
    /// Tip by tip.
    pub own: DMatrix<f64>,
}

impl Normals {
    pub fn new(trial: &Trial) -> Self {
        let mut lens = [0.0; LENS];
        lens.copy_from_slice(&trial.intrinsics.parameters()[..LENS]);
        let of_view = |tip: &Isometry3<f64>| {
            let model = Model {
                eye_in_hand: trial.cell.mode == Mode::EyeInHand,
                hand_eye: Rigid::of(trial.links.mount_from_camera.isometry()),
                target: Rigid::of(trial.links.anchor_from_target.isometry()),
                tip: Rigid::of(tip),
                lens,
            };
            let nudged: Vec<(Model, Model, f64)> = (0..UNKNOWNS)
                .map(|k| {
                    let step = if (12..16).contains(&k) { STEP_PX } else { STEP };
                    (model.nudged(k, step), model.nudged(k, -step), 2.0 * step)
                })
                .collect();
            view_normal(&trial.points, &nudged)
        };
        let clean = trial.true_base_from_tip.iter().zip(&trial.wrong).filter(|(_, wrong)| !**wrong);
        let views: Vec<_> = clean.map(|(tip, _)| of_view(tip.isometry())).collect();
        let shared = 12 + if trial.cell.free_intrinsics { LENS } else { 0 };
        Self { shared, residuals: 2 * trial.points.len() * views.len(), views }
    }

    pub fn blocks(&self) -> impl Iterator<Item = Blocks> + '_ {
        self.views.iter().map(|m| Blocks {
            shared: m.view((0, 0), (self.shared, self.shared)).into_owned(),
            cross: m.view((TIP, 0), (6, self.shared)).into_owned(),
            own: m.view((TIP, TIP), (6, 6)).into_owned(),
        })
    }
}

/// The smallest covariance that an unbiased estimate of the hand-eye transform can have, `[t; r]` as a right perturbation
/// in metres and radians, from the views that are not grossly wrong. Target and robot errors are unknown too, and the
/// lens if the cell is configured so. `None` when the views do not determine an answer.
pub fn hand_eye(normals: &Normals, noise: &Noise) -> Option<Matrix6<f64>> {
    let robot_exact = noise.robot_m == 0.0 && noise.robot_rad == 0.0;
    let weight = noise.corner_px.powi(-2);
    let mut information = DMatrix::zeros(normals.shared, normals.shared);
    for Blocks { shared, cross, mut own } in normals.blocks() {
        information += shared * weight;
        if !robot_exact {
            // The robot's errors are unknown with a prior, and integrated out.
            own *= weight;
            for i in 0..6 {
                own[(i, i)] += if i < 3 { noise.robot_m } else { noise.robot_rad }.powi(-2);
            }
            let cross = cross * weight;
            information -= cross.transpose() * own.cholesky()?.solve(&cross);
        }
    }
    let inverse = scaled_inverse(&information)?;
    Some(inverse.fixed_view::<6, 6>(0, 0).into_owned())
}

/// Inverse of a symmetric matrix whose rows may differ by many orders (metres, radians, pixels, coefficients); `None` when
/// it is not positive definite.
pub fn scaled_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(|d: f64| d.sqrt().recip());
    let by_scale = |m: &DMatrix<f64>| DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| m[(i, j)] * scale[i] * scale[j]);
    Some(by_scale(&by_scale(matrix).cholesky()?.inverse()))
}

/// `Jᵀ J` of one view in all unknowns.
fn view_normal(points: &[Point3<f64>], nudged: &[(Model, Model, f64)]) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(2 * points.len(), UNKNOWNS);
    for (i, point) in points.iter().enumerate() {
        let by = Model::by_unknowns(nudged, &point.coords);
        for k in 0..UNKNOWNS {
            rows[(2 * i, k)] = by[0][k];
            rows[(2 * i + 1, k)] = by[1][k];
        }
    }
    rows.tr_mul(&rows)
}

/// Square roots of the summed variances of translation \[m\] and rotation \[rad\].
pub fn levels(bound: &Matrix6<f64>) -> (f64, f64) {
    let of = |range: std::ops::Range<usize>| range.map(|i| bound[(i, i)]).sum::<f64>().sqrt();
    (of(0..3), of(3..6))
}

/// The tangent vector of an error, in the convention of the bound.
pub fn error_twist(truth: &Isometry3<f64>, estimate: &Isometry3<f64>) -> Vector6<f64> {
    let d = truth.inverse() * estimate;
    let r = d.rotation.scaled_axis();
    Vector6::new(d.translation.x, d.translation.y, d.translation.z, r.x, r.y, r.z)
}
