//! What a session says about hand-eye transform, place of the board and joint offsets: the linear model at the truth.

use handeye_arm::JointValues;
use handeye_cell::scene::ResolvedScene;
use handeye_geometry::frames::Pose;
use handeye_geometry::se3::{adjoint, skew};
use handeye_plan::{ViewOptions, ViewSetup, views_of_board};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, SMatrix, SymmetricEigen, Vector6};

/// Hand-eye transform and place of the board.
pub const POSES: usize = 12;
/// Joints of the arm.
pub const JOINTS: usize = 6;
/// Where the scale of the board is among the unknowns.
pub const SCALE: usize = POSES + JOINTS;
/// All of them.
pub const UNKNOWNS: usize = SCALE + 1;

/// One standard deviation per axis.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    pub corner_px: f64,
    pub robot_m: f64,
    pub robot_rad: f64,
}

/// Normal matrix of `[tip_from_camera (6), base_from_target (6), joint offsets (6), scale of the board]`, right
/// perturbations, metres, radians and relative, with the robot's corrections of every view eliminated.
pub struct Information(pub DMatrix<f64>);

/// Joint values of so many random views of the board, as a person without a plan would choose them.
///
/// # Panics
/// When the cell has fewer.
pub fn random_views(truth: &ResolvedScene, count: usize, options: &ViewOptions) -> Vec<JointValues> {
    let views = views_of_board(&ViewSetup::from(truth), options);
    assert!(views.len() >= count, "{} views", views.len());
    views.into_iter().take(count).map(|view| view.joints).collect()
}

/// `camera_from_target · exp(A · [x; y; δ] + B · e)` for the unknowns and the correction `e` of the tip.
struct Linear {
    unknowns: SMatrix<f64, 6, UNKNOWNS>,
    correction: Matrix6<f64>,
}

impl Information {
    /// Of views from these joint values.
    pub fn of(truth: &ResolvedScene, views: &[JointValues], noise: &Noise) -> Self {
        let mut normal = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
        let robot = Matrix6::from_diagonal(&Vector6::from_fn(|i, _| {
            (if i < 3 { noise.robot_m } else { noise.robot_rad }).powi(2)
        }));
        for joints in views {
            let tip = truth.reported_tip(joints).expect("joints of the arm");
            let camera_from_target = *truth.camera_from_target(&tip).isometry();
            let Linear { unknowns, correction } = linear(truth, joints, tip.isometry(), &camera_from_target);
            let seen = pose_information(truth, &camera_from_target) / noise.corner_px.powi(2);
            let spread =
                seen.try_inverse().expect("70 corners determine a pose") + correction * robot * correction.transpose();
            let weight = spread.try_inverse().expect("a covariance is positive");
            let add = unknowns.transpose() * weight * unknowns;
            normal += DMatrix::from_fn(UNKNOWNS, UNKNOWNS, |i, j| add[(i, j)]);
        }
        Self(normal)
    }

    /// The information on the joint offsets with the poses eliminated, per square radian.
    pub fn of_offsets(&self) -> DMatrix<f64> {
        let by_poses = self.0.view((0, POSES), (POSES, JOINTS));
        let poses = self.0.view((0, 0), (POSES, POSES)).into_owned();
        let solved = poses.cholesky().expect("the views determine both poses").solve(&by_poses.into_owned());
        let offsets = self.0.view((POSES, POSES), (JOINTS, JOINTS)).into_owned() - by_poses.transpose() * solved;
        0.5 * (&offsets + offsets.transpose())
    }

    /// Eigenvalues, smallest first, as standard deviations in degrees, with their directions.
    pub fn directions(&self) -> Vec<(f64, DVector<f64>)> {
        let eigen = SymmetricEigen::new(self.of_offsets());
        let mut out: Vec<(f64, DVector<f64>)> = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter())
            .map(|(value, direction)| (value.max(0.0).sqrt().recip().to_degrees(), direction.into_owned()))
            .collect();
        out.sort_by(|a, b| b.0.total_cmp(&a.0));
        out
    }

    /// What an offset of one joint that nobody reckons with does to `[x; y]`, to first order.
    pub fn bias(&self, joint: usize, offset_rad: f64) -> DVector<f64> {
        let poses = self.0.view((0, 0), (POSES, POSES)).into_owned();
        let pull = self.0.view((0, POSES + joint), (POSES, 1)).into_owned() * offset_rad;
        let bias = poses.cholesky().expect("the views determine both poses").solve(&pull);
        DVector::from_column_slice(bias.as_slice())
    }
}

fn linear(
    truth: &ResolvedScene,
    joints_rad: &[f64],
    base_from_tip: &Isometry3<f64>,
    camera_from_target: &Isometry3<f64>,
) -> Linear {
    let target_from_base = truth.base_from_target.isometry().inverse();
    let correction = -adjoint(&(target_from_base * base_from_tip));
    let mut unknowns = SMatrix::<f64, 6, UNKNOWNS>::zeros();
    unknowns.fixed_view_mut::<6, 6>(0, 0).copy_from(&-adjoint(&camera_from_target.inverse()));
    unknowns.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
    let arm = &truth.arm;
    let placed = arm.clone().mounted(truth.world_from_arm * arm.base_from_first, arm.flange_from_tip);
    let twists = placed.tip_by_joint_at(&Pose::from_isometry(*base_from_tip), joints_rad).expect("six joints");
    for (j, twist) in twists.iter().enumerate() {
        unknowns.set_column(POSES + j, &(correction * twist));
    }
    // A board that is larger by a part s looks as if it were nearer by it: at 1/(1 + s) of the distance.
    let nearer = -(camera_from_target.rotation.inverse() * camera_from_target.translation.vector);
    unknowns.fixed_view_mut::<3, 1>(0, SCALE).copy_from(&nearer);
    Linear { unknowns, correction }
}

/// `JᵀJ` of all corners in the pose of the target, per square pixel.
fn pose_information(truth: &ResolvedScene, camera_from_target: &Isometry3<f64>) -> Matrix6<f64> {
    let rotation = camera_from_target.rotation.to_rotation_matrix();
    truth.target.points().iter().fold(Matrix6::zeros(), |sum, point| {
        let seen = truth
            .intrinsics
            .project_with_jacobians(&(camera_from_target * point))
            .expect("planned views show the board");
        let by_point = seen.px_by_point * rotation.matrix();
        let mut by_pose = SMatrix::<f64, 2, 6>::zeros();
        by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
        by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&(-by_point * skew(&point.coords)));
        sum + by_pose.transpose() * by_pose
    })
}
