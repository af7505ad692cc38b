//! The current values of all unknowns.

use nalgebra::{DVector, Point3, Vector6};

use crate::handeye::joint::arm_errors::{ArmErrors, KINDS};
use crate::handeye::joint::chain::Chain;
use crate::handeye::joint::pose_dependent_error::PoseDependentError;
use crate::handeye::joint::view_block::Layout;
use crate::handeye::joint::{JointProblem, JointSolution, JointStart};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::se3;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::View;
use handeye_geometry::view_equations::DepthBias;

/// The current values of all unknowns.
#[derive(Debug, Clone)]
pub struct State {
    pub mount_from_camera: Pose<Mount, Camera>,
    pub anchor_from_target: Pose<Anchor, Target>,
    pub intrinsics: Intrinsics,
    pub shape: BoardShape,
    /// Zero where it is not free.
    pub depth: DepthBias,
    /// `None` when they are not free, and where a view has no joint values.
    pub arm: Option<ArmErrors>,
    /// `None` when it is not free, and where it belongs to the errors of the arm.
    pub field: Option<PoseDependentError>,
    /// Correction of every view, beyond that of the field.
    pub corrections: Vec<Vector6<f64>>,
}

impl State {
    pub fn new(problem: &JointProblem<'_>, start: &JointStart) -> Self {
        Self {
            mount_from_camera: start.mount_from_camera,
            anchor_from_target: start.anchor_from_target,
            intrinsics: start.intrinsics,
            shape: start.shape,
            depth: DepthBias::default(),
            arm: problem.arm(),
            field: problem.field(),
            corrections: vec![Vector6::zeros(); problem.views.len()],
        }
    }

    /// The state that a solution was found in.
    pub fn of(solution: &JointSolution) -> Self {
        Self {
            mount_from_camera: solution.hand_eye.mount_from_camera(),
            anchor_from_target: solution.hand_eye.anchor_from_target(),
            intrinsics: solution.intrinsics,
            shape: solution.shape,
            depth: solution.depth,
            arm: solution.arm.clone(),
            field: solution.field.clone(),
            corrections: solution.views.iter().map(|view| view.correction).collect(),
        }
    }

    pub fn layout(&self, problem: &JointProblem<'_>) -> Layout {
        Layout {
            form: problem.free.form().count(&self.intrinsics),
            field: self.slope_count(),
            arm: self.arm.as_ref().map_or([0; KINDS], ArmErrors::counts),
        }
    }

    /// Slopes of the field and errors of the arm, in the order of the unknowns.
    pub fn effects(&self) -> Vec<f64> {
        let of_field = self.field.iter().flat_map(PoseDependentError::slopes);
        of_field.copied().chain(self.arm.iter().flat_map(ArmErrors::numbers)).collect()
    }

    /// Whether there are pose-dependent errors of the robot, alone or in addition to those of its links.
    pub fn has_field(&self) -> bool {
        self.slope_count() > 0
    }

    fn slope_count(&self) -> usize {
        let of_arm = self.arm.as_ref().map_or(0, ArmErrors::slope_count);
        self.field.as_ref().map_or(of_arm, |field| field.slopes().len())
    }

    /// The same field, affine out to these views, too.
    pub fn reaching(mut self, views: &[View]) -> Self {
        let reaching = |field: PoseDependentError| field.reaching(views.iter().map(|view| &view.base_from_tip));
        self.field = self.field.map(reaching);
        self.arm = self.arm.map(|arm| {
            let field = arm.field().cloned().map(reaching);
            arm.with_field(field)
        });
        self
    }

    /// Correction of a view by the field.
    fn by_field(&self, view: &View) -> Vector6<f64> {
        self.field.as_ref().map_or_else(Vector6::zeros, |field| field.correction(&view.base_from_tip))
    }

    /// The chain of one view with a correction beyond that of the field.
    pub fn chain(&self, problem: &JointProblem<'_>, view: &View, correction: &Vector6<f64>) -> Chain {
        Chain::with_arm(
            problem.mode,
            view,
            self.arm.as_ref(),
            &(correction + self.by_field(view)),
            &self.mount_from_camera,
            &self.anchor_from_target,
        )
    }

    pub fn stepped(&self, problem: &JointProblem<'_>, shared: &DVector<f64>, own: &[Vector6<f64>]) -> Self {
        let mut next = self.clone();
        next.mount_from_camera = self.mount_from_camera.perturbed(&shared.fixed_rows::<6>(0).into_owned());
        next.anchor_from_target = self.anchor_from_target.perturbed(&shared.fixed_rows::<6>(6).into_owned());
        let form = problem.free.form();
        let at = |column: usize| shared[Layout::FORM_AT + column];
        if form.lens {
            let parameters: Vec<f64> =
                self.intrinsics.parameters().iter().enumerate().map(|(i, p)| p + at(i)).collect();
            next.intrinsics = self.intrinsics.with_parameters(&parameters);
        }
        if form.warp {
            let first = form.warp_at(&self.intrinsics);
            for (k, warp) in next.shape.warp_m.iter_mut().enumerate() {
                *warp += at(first + k);
            }
        }
        if form.scale {
            next.shape.scale += at(form.scale_at(&self.intrinsics));
        }
        if form.depth {
            let first = form.depth_at(&self.intrinsics);
            let before = self.depth.values();
            next.depth = DepthBias::new(std::array::from_fn(|k| before[k] + at(first + k)));
        }
        let layout = self.layout(problem);
        let of_field = next.field.iter_mut().flat_map(PoseDependentError::slopes_mut);
        let effects = of_field.chain(next.arm.iter_mut().flat_map(ArmErrors::numbers_mut));
        effects.zip(shared.iter().skip(layout.field_at())).for_each(|(effect, step)| *effect += step);
        for (correction, step) in next.corrections.iter_mut().zip(own) {
            *correction += step;
        }
        next
    }

    /// The step of the shared unknowns that leads to another state with the same unknowns.
    pub fn step_to(&self, other: &Self, problem: &JointProblem<'_>) -> DVector<f64> {
        let layout = self.layout(problem);
        let mut step = DVector::zeros(layout.count());
        let mount = self.mount_from_camera.inverse() * other.mount_from_camera;
        let anchor = self.anchor_from_target.inverse() * other.anchor_from_target;
        step.fixed_rows_mut::<6>(0).copy_from(&se3::log(mount.isometry()));
        step.fixed_rows_mut::<6>(6).copy_from(&se3::log(anchor.isometry()));
        let mut put = |at: usize, from: &[f64], to: &[f64]| {
            for (k, (from, to)) in from.iter().zip(to).enumerate() {
                step[at + k] = to - from;
            }
        };
        let form = problem.free.form();
        let at = |column: usize| Layout::FORM_AT + column;
        if form.lens {
            put(at(0), &self.intrinsics.parameters(), &other.intrinsics.parameters());
        }
        if form.warp {
            put(at(form.warp_at(&self.intrinsics)), &self.shape.warp_m, &other.shape.warp_m);
        }
        if form.scale {
            put(at(form.scale_at(&self.intrinsics)), &[self.shape.scale], &[other.shape.scale]);
        }
        if form.depth {
            put(at(form.depth_at(&self.intrinsics)), &self.depth.values(), &other.depth.values());
        }
        put(layout.field_at(), &self.effects(), &other.effects());
        step
    }

    /// Mean over the views of the target's middle in camera coordinates.
    pub fn mean_target_centre(&self, problem: &JointProblem<'_>) -> Point3<f64> {
        let points = problem.board.points(&self.shape);
        let centre =
            Point3::from(points.iter().map(|p| p.coords).sum::<nalgebra::Vector3<f64>>() / points.len().max(1) as f64);
        let sum: nalgebra::Vector3<f64> = problem
            .views
            .iter()
            .zip(&self.corrections)
            .map(|(view, correction)| {
                let chain = self.chain(problem, view, correction);
                (chain.camera_from_target * centre).coords
            })
            .sum();
        Point3::from(sum / problem.views.len().max(1) as f64)
    }
}
