//! The estimate from pose pairs alone, for sessions that kept target poses but no corners.
//!
//! Minimises `Σ eᵢᵀ Vᵢ⁻¹ eᵢ` of `eᵢ = log(camera_from_target_i⁻¹ * predicted_i)` over `mount_from_camera` and
//! `anchor_from_target`. `Vᵢ` has three levels, [`Levels`], by restricted maximum likelihood: positions, rotations of the
//! target, and rotations of the robot, which move the target by its distance from the mount and are separated from the
//! others by that.
//!
//! The unit of the target poses may be unknown, as for a single moving camera or markers of unknown size. Then a scale of
//! their translations is one more unknown, which the robot's translations determine.
//!
//! Reference: Andreff, Horaud & Espiau 2001, "Robot hand-eye calibration using structure-from-motion" (scale); Strobl & Hirzinger
//! 2006, "Optimal hand-eye calibration", with the weights re-estimated from residuals; Harville 1977, "Maximum likelihood
//! approaches to variance component estimation and to related problems", JASA 72 (levels).

use nalgebra::{Cholesky, Matrix3, Matrix6, Point3, SMatrix, SVector, Unit, Vector3, Vector6};

use super::closed_form::ClosedFormSolution;
use super::motion::MIN_VIEWS;
use super::screening::{Judged, limit};
use super::{HandEyeError, PosePair};
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::se3;

/// A length that no robot resolves, metres: the repeatability of the best arms is 0.01 to 0.02 mm (ISO 9283).
pub const PLACE_M: f64 = 1e-5;
/// An angle that no robot resolves, radians: a thousandth of a degree, which moves a point at half a metre by that
/// length.
pub const ANGLE_RAD: f64 = 1e-3 * std::f64::consts::PI / 180.0;

/// The estimate from pose pairs.
#[derive(Debug, Clone)]
pub struct PoseGraphSolution {
    /// Hand-eye transform.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// Place of the target.
    pub anchor_from_target: Pose<Anchor, Target>,
    /// Covariance of both, right perturbations, metres and radians.
    pub covariance: SMatrix<f64, 12, 12>,
    /// Standard deviations between the two poses of a pair, per axis.
    pub levels: Levels,
    /// The true length of a target pose's translation over the stated one; 1 when it is taken as exact.
    pub scale: f64,
    /// Its standard deviation; `None` when it is taken as exact.
    pub scale_sigma: Option<f64>,
}

/// Standard deviations between the two poses of a pair, per axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// Of position, without the displacement of the target by rotations of the robot; metres.
    pub position_m: f64,
    /// Of rotations about the target's origin, like errors of the target's pose; radians.
    pub target_rad: f64,
    /// Of rotations about the mount's origin, like errors of the robot's pose; radians.
    pub robot_rad: f64,
}

impl Levels {
    /// Standard deviation of the rotation between both, radians.
    pub fn rotation_rad(&self) -> f64 {
        self.target_rad.hypot(self.robot_rad)
    }

    /// The levels, none below what a robot resolves, see [`resolution`].
    fn judged_by(self) -> Self {
        Self {
            position_m: self.position_m.max(PLACE_M),
            target_rad: self.target_rad.max(ANGLE_RAD),
            robot_rad: self.robot_rad.max(ANGLE_RAD),
        }
    }

    /// The part of each level in the covariance of a residual, at a level of 1.
    fn parts(target_from_mount: &Vector3<f64>) -> [Matrix6<f64>; 3] {
        let (position, rotation) =
            (Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0), Vector6::new(0.0, 0.0, 0.0, 1.0, 1.0, 1.0));
        let mut moved = SMatrix::<f64, 6, 3>::zeros();
        moved.fixed_view_mut::<3, 3>(0, 0).copy_from(&se3::skew(target_from_mount));
        moved.fixed_view_mut::<3, 3>(3, 0).copy_from(&Matrix3::identity());
        [Matrix6::from_diagonal(&position), Matrix6::from_diagonal(&rotation), moved * moved.transpose()]
    }

    fn variances(&self) -> [f64; 3] {
        [self.position_m, self.target_rad, self.robot_rad].map(|level| level * level)
    }

    /// The covariance of a residual in the axes of the target.
    fn covariance(&self, parts: &[Matrix6<f64>; 3]) -> Matrix6<f64> {
        parts.iter().zip(self.variances()).map(|(part, variance)| part * variance).sum()
    }
}

impl PoseGraphSolution {
    /// A target pose with its translation in metres.
    fn in_metres(&self, pair: &PosePair) -> Pose<Camera, Target> {
        scaled(&pair.camera_from_target, self.scale)
    }

    /// Where the chain puts the target in a pair.
    pub fn predicted(&self, pair: &PosePair) -> Pose<Camera, Target> {
        predict(pair, &self.mount_from_camera, &self.anchor_from_target)
    }

    /// Distance of every one of `pairs` from the expectation of a solution from those `kept`, ascending; `middle` is a point
    /// of the target, metres.
    pub fn judge(&self, pairs: &[PosePair], kept: &[usize], middle: &Point3<f64>) -> Vec<Judged> {
        let unknowns = 12 + usize::from(self.scale_sigma.is_some());
        let freedom = 0.5 * (6.0 * kept.len() as f64 - unknowns as f64);
        let limit = limit(pairs.len(), freedom.max(4.0));
        let judged = pairs.iter().enumerate().map(|(index, pair)| {
            let (seen, predicted) = (self.in_metres(pair), self.predicted(pair));
            let own = self.levels.judged_by().covariance(&Levels::parts(&lever(pair, &self.anchor_from_target)));
            let jacobian = jacobian(&seen, &predicted).fixed_columns::<12>(0).into_owned();
            let shared = jacobian * self.covariance * jacobian.transpose();
            let expected = if kept.binary_search(&index).is_ok() { own - shared } else { own + shared };
            // Where the others do not determine a pair it cannot disagree with them.
            let expected = Cholesky::new(expected).or_else(|| Cholesky::new(own));
            let error = residual(&seen, &predicted);
            let metres = (seen.isometry() * middle - predicted.isometry() * middle).norm();
            Judged {
                squared: expected.map_or(f64::INFINITY, |v| error.dot(&v.solve(&error))),
                limit,
                metres,
                radians: seen.rotation().angle_to(&predicted.rotation()),
            }
        });
        judged.collect()
    }
}

/// A pose with its translation multiplied.
pub fn scaled(pose: &Pose<Camera, Target>, scale: f64) -> Pose<Camera, Target> {
    let mut isometry = *pose.isometry();
    isometry.translation.vector *= scale;
    Pose::from_isometry(isometry)
}

/// Steps; Gauss–Newton from a closed form needs about five, the levels more.
const MAX_STEPS: usize = 200;
/// A step below a tenth of a nanometre and nanoradian ends the iteration.
const STEP_TOLERANCE: f64 = 1e-10;
/// Both links, and the logarithm of the scale.
const UNKNOWNS: usize = 13;
const SCALE_AT: usize = 12;
/// Name of the method in errors.
pub const METHOD: &str = "the pose graph";
/// Floor of the levels, so that exact data do not divide by zero.
const LEVEL_FLOOR: f64 = 1e-12;
/// Largest change of the log of a variance in a step.
const LARGEST_STEP: f64 = 2.0;
/// A step that changes the levels by less than this part of them ends the iteration.
const SETTLED: f64 = 1e-6;
/// The least part of the rotation's level that either of its two has: a lower one changes nothing, and a level of zero
/// would stay there.
const LEAST_PART: f64 = 1e-2;

/// Refines a closed-form answer.
///
/// # Needs
/// Three pairs with rotations about two axes.
///
/// # Errors
/// [`HandEyeError::TooFewViews`], [`HandEyeError::NoSolution`] for a singular system.
pub fn refine(pairs: &[PosePair], start: &ClosedFormSolution) -> Result<PoseGraphSolution, HandEyeError> {
    refine_with(pairs, start, None, None)
}

/// As [`refine`], with the scale of the target poses unknown; `scale` is near it.
///
/// # Errors
/// As [`refine`]; a robot without translations does not determine the scale.
pub fn refine_scaled(
    pairs: &[PosePair],
    start: &ClosedFormSolution,
    scale: f64,
) -> Result<PoseGraphSolution, HandEyeError> {
    refine_with(pairs, start, None, Some(scale))
}

/// Standard deviation of the open component of a camera's place beforehand, metres: farther than any camera is from the
/// origin of its carrier.
const OPEN_M: f64 = 10.0;
/// Least information on it as a part of the largest: the rounding error with exact data.
const LEAST_INFORMATION: f64 = 1e-9;

/// As [`refine`] where all turns are about `axis` of the mount, so that the camera's place along it is open. It has a prior
/// of 10 m about the origin of the mount, which is part of the covariance; everything else includes the uncertainty due to
/// it.
pub(super) fn refine_one_axis(
    pairs: &[PosePair],
    start: &ClosedFormSolution,
    axis: &Unit<Vector3<f64>>,
) -> Result<PoseGraphSolution, HandEyeError> {
    refine_with(pairs, start, Some(axis), None)
}

fn refine_with(
    pairs: &[PosePair],
    start: &ClosedFormSolution,
    open: Option<&Unit<Vector3<f64>>>,
    free_scale: Option<f64>,
) -> Result<PoseGraphSolution, HandEyeError> {
    if pairs.len() < MIN_VIEWS {
        return Err(HandEyeError::TooFewViews { got: pairs.len(), need: MIN_VIEWS });
    }
    let mut x = start.mount_from_camera;
    let mut y = start.anchor_from_target;
    let mut scale = free_scale.unwrap_or(1.0);
    let singular = || HandEyeError::NoSolution {
        method: METHOD,
        views: pairs.len(),
        reason: "the normal equations are singular: add views turned about other axes",
    };
    let mut levels = Levels { position_m: 1e-3, target_rad: 1e-3, robot_rad: 1e-3 };
    let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::identity();
    for step_number in 0..MAX_STEPS {
        let mut rows: Vec<Row> = pairs
            .iter()
            .map(|pair| Row::new(pair, &x, &y, scale, &levels))
            .collect::<Option<_>>()
            .ok_or_else(singular)?;
        if free_scale.is_none() {
            for row in &mut rows {
                row.jacobian.fill_column(SCALE_AT, 0.0);
            }
        }
        normal = SMatrix::zeros();
        let mut gradient = SVector::<f64, UNKNOWNS>::zeros();
        for row in &rows {
            let weighted = row.weight * row.jacobian;
            normal += row.jacobian.transpose() * weighted;
            gradient += weighted.transpose() * row.error;
        }
        if free_scale.is_none() {
            normal[(SCALE_AT, SCALE_AT)] = 1.0;
        }
        if let Some(axis) = open {
            let mut along = SVector::<f64, UNKNOWNS>::zeros();
            along.fixed_rows_mut::<3>(0).copy_from(&(x.rotation().inverse() * axis.into_inner()));
            let precision = OPEN_M.powi(-2).max(LEAST_INFORMATION * normal.diagonal().max());
            normal += along * along.transpose() * precision;
            gradient += along * (precision * axis.dot(&x.translation()));
        }
        let factor = Cholesky::new(normal).ok_or_else(singular)?;
        let step = -factor.solve(&gradient);
        x = x.perturbed(&step.fixed_rows::<6>(0).into_owned());
        y = y.perturbed(&step.fixed_rows::<6>(6).into_owned());
        scale *= step[SCALE_AT].exp();
        // Residuals of the start give little information on the levels.
        let next = if step_number == 0 {
            scatter(pairs, &x, &y, scale)
        } else {
            let moved = |row: &Row| row.error + row.jacobian * step;
            levels.improved(&rows, &factor.inverse(), moved)
        };
        let settled = next.is_near(&levels);
        levels = next;
        if step.norm() < STEP_TOLERANCE && settled {
            break;
        }
    }
    let covariance = normal.try_inverse().unwrap_or_else(|| SMatrix::from_element(f64::INFINITY));
    Ok(PoseGraphSolution {
        mount_from_camera: x,
        anchor_from_target: y,
        covariance: covariance.fixed_view::<12, 12>(0, 0).into_owned(),
        levels,
        scale,
        scale_sigma: free_scale.map(|_| scale * covariance[(SCALE_AT, SCALE_AT)].sqrt()),
    })
}

impl PoseGraphSolution {
    fn rows(&self, pairs: &[PosePair]) -> Option<Vec<Row>> {
        let (x, y) = (&self.mount_from_camera, &self.anchor_from_target);
        pairs.iter().map(|pair| Row::new(pair, x, y, self.scale, &self.levels)).collect()
    }

    /// The shift along the motion from `before` to `after`, two neighbours of these pairs, at which all of them would fit
    /// best, with both links free: 0 is no shift, 1 as far as `after` is from `before`. With its standard deviation; `None`
    /// where the data do not determine it.
    pub fn shift(&self, pairs: &[PosePair], before: &[PosePair], after: &[PosePair]) -> Option<(f64, f64)> {
        let mut normal = SMatrix::<f64, 12, 12>::zeros();
        let (mut cross, mut gradient) = (SVector::<f64, 12>::zeros(), SVector::<f64, 12>::zeros());
        let (mut own, mut own_gradient) = (0.0, 0.0);
        for ((row, before), after) in self.rows(pairs)?.iter().zip(before).zip(after) {
            let error = |pair: &PosePair| residual(&self.in_metres(pair), &self.predicted(pair));
            let along = error(after) - error(before);
            let jacobian = row.jacobian.fixed_columns::<12>(0);
            let weighted = row.weight * along;
            normal += jacobian.transpose() * row.weight * jacobian;
            cross += jacobian.transpose() * weighted;
            gradient += jacobian.transpose() * row.weight * row.error;
            own += along.dot(&weighted);
            own_gradient += weighted.dot(&row.error);
        }
        let factor = Cholesky::new(normal)?;
        let information = own - cross.dot(&factor.solve(&cross));
        let left = own_gradient - cross.dot(&factor.solve(&gradient));
        (information > 0.0).then(|| (-left / information, information.sqrt().recip()))
    }

    /// Minus twice the log-likelihood of each pair, without constants; one that is off by more than `most_off` standard deviations
    /// counts as one that is off by this many.
    pub fn deviances(&self, pairs: &[PosePair], most_off: f64) -> Vec<f64> {
        let of_row = |row: Row| {
            let squared = row.error.dot(&(row.weight * row.error)).min(most_off.powi(2));
            squared - row.weight.determinant().ln()
        };
        self.rows(pairs).unwrap_or_default().into_iter().map(of_row).collect()
    }
}

/// A pair as a part of the normal equations.
struct Row {
    error: Vector6<f64>,
    jacobian: SMatrix<f64, 6, UNKNOWNS>,
    parts: [Matrix6<f64>; 3],
    weight: Matrix6<f64>,
}

impl Row {
    /// `None` where the covariance is singular.
    fn new(
        pair: &PosePair,
        x: &Pose<Mount, Camera>,
        y: &Pose<Anchor, Target>,
        scale: f64,
        levels: &Levels,
    ) -> Option<Self> {
        let (seen, predicted) = (scaled(&pair.camera_from_target, scale), predict(pair, x, y));
        let parts = Levels::parts(&lever(pair, y));
        let weight = Cholesky::new(levels.covariance(&parts))?.inverse();
        Some(Self { error: residual(&seen, &predicted), jacobian: jacobian(&seen, &predicted), parts, weight })
    }
}

impl Levels {
    /// A step of Fisher scoring of the restricted likelihood in the logs of the variances (Harville 1977, §5); `inverse` is that of
    /// the normal matrix. The information is that of each pair alone.
    fn improved(
        &self,
        rows: &[Row],
        inverse: &SMatrix<f64, UNKNOWNS, UNKNOWNS>,
        error: impl Fn(&Row) -> Vector6<f64>,
    ) -> Self {
        let (mut gradient, mut information) = (Vector3::<f64>::zeros(), Matrix3::<f64>::zeros());
        let variances = Vector3::from(self.variances());
        for row in rows {
            let weighted = row.weight * error(row);
            let seen = row.weight * row.jacobian;
            // The part of this pair that is left after the unknowns.
            let left = row.weight - seen * inverse * seen.transpose();
            let turned = row.parts.map(|part| left * part);
            for k in 0..3 {
                gradient[k] += variances[k] * (weighted.dot(&(row.parts[k] * weighted)) - turned[k].trace());
                for l in 0..3 {
                    information[(k, l)] += variances[k] * variances[l] * (turned[k] * turned[l]).trace();
                }
            }
        }
        // A level of zero has no information either, and falls by the largest step allowed.
        let least = 1e-9 * information.trace() + f64::MIN_POSITIVE;
        let step = Cholesky::new(information + Matrix3::identity() * least).map_or_else(Vector3::zeros, |factor| {
            factor.solve(&gradient).map(|k: f64| k.clamp(-LARGEST_STEP, LARGEST_STEP))
        });
        let level = |k: usize| (variances[k] * step[k].exp()).sqrt().max(LEVEL_FLOOR);
        let least = LEAST_PART * level(1).hypot(level(2));
        Self { position_m: level(0), target_rad: level(1).max(least), robot_rad: level(2).max(least) }
    }

    /// Whether the change from one to the other is negligible.
    fn is_near(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a / b).ln().abs() < SETTLED;
        near(self.position_m, other.position_m)
            && (self.target_rad - other.target_rad).abs() < SETTLED * self.rotation_rad()
            && (self.robot_rad - other.robot_rad).abs() < SETTLED * self.rotation_rad()
    }
}

/// The mount as seen from the target.
fn lever(pair: &PosePair, y: &Pose<Anchor, Target>) -> Vector3<f64> {
    (y.inverse() * pair.anchor_from_mount).translation()
}

fn predict(pair: &PosePair, x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>) -> Pose<Camera, Target> {
    x.inverse() * pair.anchor_from_mount.inverse() * *y
}

/// Distance of a pair, its target pose `scale` times as far away as stated, from its place by a solution; a radian counts as a
/// metre.
pub fn misfit(pair: &PosePair, solution: &ClosedFormSolution, scale: f64) -> f64 {
    let predicted = predict(pair, &solution.mount_from_camera, &solution.anchor_from_target);
    residual(&scaled(&pair.camera_from_target, scale), &predicted).norm()
}

fn residual(seen: &Pose<Camera, Target>, predicted: &Pose<Camera, Target>) -> Vector6<f64> {
    se3::log((seen.inverse() * *predicted).isometry())
}

/// Jacobian of the residual by both links, right perturbations, and the logarithm of the scale, at small residuals.
fn jacobian(seen: &Pose<Camera, Target>, predicted: &Pose<Camera, Target>) -> SMatrix<f64, 6, UNKNOWNS> {
    let mut jacobian = SMatrix::<f64, 6, UNKNOWNS>::zeros();
    jacobian.fixed_view_mut::<6, 6>(0, 0).copy_from(&-se3::adjoint(&predicted.isometry().inverse()));
    jacobian.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
    let nearer = -(seen.rotation().inverse() * seen.translation());
    jacobian.fixed_view_mut::<3, 1>(0, SCALE_AT).copy_from(&nearer);
    jacobian
}

/// Levels from the residuals, with the unknowns' share of the degrees of freedom subtracted evenly: the start of the
/// iteration.
fn scatter(pairs: &[PosePair], x: &Pose<Mount, Camera>, y: &Pose<Anchor, Target>, scale: f64) -> Levels {
    let mut squares = (0.0, 0.0);
    for pair in pairs {
        let r = residual(&scaled(&pair.camera_from_target, scale), &predict(pair, x, y));
        squares.0 += r.fixed_rows::<3>(0).norm_squared();
        squares.1 += r.fixed_rows::<3>(3).norm_squared();
    }
    let freedom = 3.0 * pairs.len() as f64 - 6.0;
    let level = |squares: f64| (squares / freedom).sqrt().max(LEVEL_FLOOR);
    let half = level(0.5 * squares.1);
    Levels { position_m: level(squares.0), target_rad: half, robot_rad: half }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_pairs_give_the_exact_answer_from_a_poor_start() {
        let pose =
            |k: f64| se3::exp(&Vector6::new(0.3 * k.sin(), 0.2 * k.cos(), 0.1 * k, 0.5 * k.cos(), 0.4 * k.sin(), 0.3));
        let x: Pose<Mount, Camera> = Pose::from_isometry(pose(0.3));
        let y: Pose<Anchor, Target> = Pose::from_isometry(pose(5.0));
        let pairs: Vec<PosePair> = (0..6)
            .map(|k| {
                let anchor_from_mount = Pose::from_isometry(pose(f64::from(k)));
                let camera_from_target = x.inverse() * anchor_from_mount.inverse() * y;
                PosePair { anchor_from_mount, camera_from_target }
            })
            .collect();
        let off = Vector6::new(0.02, -0.01, 0.03, 0.05, 0.04, -0.06);
        let start = ClosedFormSolution { mount_from_camera: x.perturbed(&off), anchor_from_target: y.perturbed(&off) };
        let solution = refine(&pairs, &start).expect("solves");
        let (metres, radians) = solution.mount_from_camera.distance_to(&x);
        assert!(metres < 1e-9 && radians < 1e-7, "{metres} {radians}");
        assert_eq!((solution.scale, solution.scale_sigma), (1.0, None));
        let halves: Vec<PosePair> = pairs
            .iter()
            .map(|pair| PosePair { camera_from_target: scaled(&pair.camera_from_target, 0.5), ..*pair })
            .collect();
        let solution = refine_scaled(&halves, &start, 1.8).expect("solves");
        let (metres, radians) = solution.mount_from_camera.distance_to(&x);
        assert!(metres < 1e-9 && radians < 1e-7 && (solution.scale - 2.0).abs() < 1e-9, "{solution:?}");
    }
}
