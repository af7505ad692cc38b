//! The least-squares equations of one view in the target's pose, the lens and the shape of the target.

mod depths;
mod gram;
mod whitener;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6, Matrix6xX, Point3, Vector3, Vector6};

use crate::camera::{CameraError, Intrinsics, MAX_PARAMETERS};
use crate::targets::bent::{BoardPoints, BoardShape};
use crate::targets::observation::Corner;
use gram::Gram;

pub use depths::DepthBias;
pub use depths::{MeasuredDepths, PredictedDepths};
pub use whitener::Whitener;

pub use gram::Pair;

/// Unknowns of a pose.
pub const POSE: usize = 6;

/// Most unknowns of lens and target shape.
pub const MAX_FORM: usize = MAX_PARAMETERS + 3 + DepthBias::COUNT;

/// Which unknowns of lens and target shape are free. Their columns are, without gaps, the lens parameters in the order of
/// [`Intrinsics::parameters`], the two warps, the scale, and the errors of a depth camera ([`DepthBias`]).
#[expect(clippy::struct_excessive_bools, reason = "each is a choice of its own")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FreeParameters {
    /// The parameters of the lens.
    pub lens: bool,
    /// The bend of the target along each of its axes.
    pub warp: bool,
    /// The size of the target.
    pub scale: bool,
    /// The errors of the depth camera.
    pub depth: bool,
}

impl FreeParameters {
    fn lens_count(self, intrinsics: &Intrinsics) -> usize {
        if self.lens { intrinsics.parameter_count() } else { 0 }
    }

    /// First of the two columns of the warp.
    pub fn warp_at(self, intrinsics: &Intrinsics) -> usize {
        self.lens_count(intrinsics)
    }

    /// Column of the scale.
    pub fn scale_at(self, intrinsics: &Intrinsics) -> usize {
        self.warp_at(intrinsics) + if self.warp { 2 } else { 0 }
    }

    /// First column of the depth camera's errors.
    pub fn depth_at(self, intrinsics: &Intrinsics) -> usize {
        self.scale_at(intrinsics) + usize::from(self.scale)
    }

    /// Number of columns.
    pub fn count(self, intrinsics: &Intrinsics) -> usize {
        self.depth_at(intrinsics) + if self.depth { DepthBias::COUNT } else { 0 }
    }
}

/// The context of one view: lens and target, and the weights of its corners.
#[derive(Debug, Clone, Copy)]
pub struct ViewInput<'a> {
    /// The lens.
    pub intrinsics: &'a Intrinsics,
    /// The points of the target.
    pub board: &'a BoardPoints,
    /// The bend of the target.
    pub shape: &'a BoardShape,
    /// The corners in the image.
    pub corners: &'a [Corner],
    /// The transform that makes their errors uncorrelated with unit variance.
    pub whitener: &'a Whitener,
    /// Depths that determine the target's pose in addition to the corners; `None` where they do not count.
    pub depths: Option<MeasuredDepths<'a>>,
}

/// Normal equations of one view, with residuals `r = predicted − measured` in pixels (whitened)
/// and the pose perturbed as `camera_from_target * exp(xi)`.
#[derive(Debug, Clone)]
pub struct PoseEquations {
    /// `Jpᵀ Jp`
    pub pose: Matrix6<f64>,
    /// `Jpᵀ Jf`
    pub pose_by_form: Matrix6xX<f64>,
    /// `Jfᵀ Jf`
    pub form: DMatrix<f64>,
    /// `Jpᵀ r`
    pub pose_gradient: Vector6<f64>,
    /// `Jfᵀ r`
    pub form_gradient: DVector<f64>,
    /// `rᵀ r`, squared pixels.
    pub squared_px: f64,
    /// Number of corners.
    pub corners: usize,
    /// Number of residuals of depths.
    pub depths: usize,
}

impl PoseEquations {
    /// Linearises the corners of a view at a pose of the target.
    pub fn new(
        seen: &ViewInput<'_>,
        camera_from_target: &Isometry3<f64>,
        free: FreeParameters,
    ) -> Result<Self, CameraError> {
        // Six columns of the pose, those of the form, and the residual, four at a time.
        match (POSE + free.count(seen.intrinsics) + 1).div_ceil(4) {
            0..=2 => Self::with_quads::<2>(seen, camera_from_target, free),
            3 => Self::with_quads::<3>(seen, camera_from_target, free),
            4 => Self::with_quads::<4>(seen, camera_from_target, free),
            5 => Self::with_quads::<5>(seen, camera_from_target, free),
            6 => Self::with_quads::<6>(seen, camera_from_target, free),
            _ => Self::with_quads::<7>(seen, camera_from_target, free),
        }
    }

    fn with_quads<const QUADS: usize>(
        seen: &ViewInput<'_>,
        camera_from_target: &Isometry3<f64>,
        free: FreeParameters,
    ) -> Result<Self, CameraError> {
        let rows = Rows::new(seen, camera_from_target, free);
        let mut equations = if matches!(seen.whitener, Whitener::Together { .. }) {
            let all = rows.all(0, |_, _, _| {})?;
            let products = all.tr_mul(&all);
            Self::from_products(|i, j| products[(i, j)], rows.count, seen.corners.len())
        } else {
            let mut gram = Gram::<QUADS>::new();
            for (i, corner) in seen.corners.iter().enumerate() {
                rows.fill(i, corner, gram.next())?;
            }
            let products = gram.finish();
            Self::from_products(|i, j| products.at(i, j), rows.count, seen.corners.len())
        };
        if let Some(depths) = &seen.depths {
            depths.add_to(&mut equations, seen, camera_from_target, free);
        }
        Ok(equations)
    }

    fn from_products(product: impl Fn(usize, usize) -> f64, count: usize, corners: usize) -> Self {
        let residual = POSE + count;
        Self {
            pose: Matrix6::from_fn(&product),
            pose_by_form: Matrix6xX::from_fn(count, |i, j| product(i, POSE + j)),
            form: DMatrix::from_fn(count, count, |i, j| product(POSE + i, POSE + j)),
            pose_gradient: Vector6::from_fn(|i, _| product(i, residual)),
            form_gradient: DVector::from_fn(count, |i, _| product(POSE + i, residual)),
            squared_px: product(residual, residual),
            corners,
            depths: 0,
        }
    }
}

/// The rows of a view's equations.
pub struct Rows<'a> {
    seen: &'a ViewInput<'a>,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    free: FreeParameters,
    lens_count: usize,
    /// Columns of the form.
    pub count: usize,
}

impl<'a> Rows<'a> {
    /// The rows of a view at a pose of the target.
    pub fn new(seen: &'a ViewInput<'a>, camera_from_target: &Isometry3<f64>, free: FreeParameters) -> Self {
        Self {
            seen,
            rotation: camera_from_target.rotation.to_rotation_matrix().into_inner(),
            translation: camera_from_target.translation.vector,
            free,
            lens_count: free.lens_count(seen.intrinsics),
            count: free.count(seen.intrinsics),
        }
    }

    /// The rows of all corners, whitened: six columns of the pose, those of the form, the residual, and `more` columns after
    /// them, which `fill` computes for every corner from its rows before whitening.
    pub fn all(&self, more: usize, fill: impl Fn(&Corner, &[Pair], &mut [Pair])) -> Result<DMatrix<f64>, CameraError> {
        let columns = POSE + self.count + 1;
        let mut row = vec![Pair::default(); columns + more];
        let mut all = DMatrix::zeros(2 * self.seen.corners.len(), columns + more);
        for (i, corner) in self.seen.corners.iter().enumerate() {
            let (own, beside) = row.split_at_mut(columns);
            self.fill(i, corner, own)?;
            beside.fill(Pair::default());
            fill(corner, own, beside);
            for (j, [x, y]) in row.iter().enumerate() {
                (all[(2 * i, j)], all[(2 * i + 1, j)]) = (*x, *y);
            }
        }
        Ok(self.seen.whitener.together(&all).unwrap_or(all))
    }

    /// The two rows of corner `i`: six columns of the pose, those of the form, and the residual; times the whitener of the
    /// corner, where it has its own.
    #[expect(clippy::inline_always, reason = "the loop over the corners is the hot one, and has to see it")]
    #[inline(always)]
    pub fn fill(&self, i: usize, corner: &Corner, columns: &mut [Pair]) -> Result<(), CameraError> {
        let Self { seen: ViewInput { intrinsics, board, shape, whitener, .. }, rotation, free, .. } = self;
        let (lens_count, count) = (self.lens_count, self.count);
        let point = board.point(corner.index, shape);
        let projection = intrinsics.linearise(&(rotation * point.coords + self.translation))?;
        let [a, b, c] = projection.by_point;
        let by_target_point: [Pair; 3] = std::array::from_fn(|k| {
            let axis = rotation.column(k);
            [0, 1].map(|row| a[row] * axis[0] + b[row] * axis[1] + c[row] * axis[2])
        });
        let [bx, by, bz] = by_target_point;
        let Point3 { coords: p } = point;
        columns[..3].copy_from_slice(&by_target_point);
        // Rows of `-by_target_point [p]×` are `p × row`.
        columns[3] = [0, 1].map(|row| p.y * bz[row] - p.z * by[row]);
        columns[4] = [0, 1].map(|row| p.z * bx[row] - p.x * bz[row]);
        columns[5] = [0, 1].map(|row| p.x * by[row] - p.y * bx[row]);
        columns[POSE..POSE + lens_count].copy_from_slice(&projection.by_parameters[..lens_count]);
        if free.warp || free.scale {
            let (by_warp, by_scale) = board.derivatives(corner.index, shape);
            if free.warp {
                let at = POSE + free.warp_at(intrinsics);
                columns[at] = bz.map(|d| d * by_warp[0]);
                columns[at + 1] = bz.map(|d| d * by_warp[1]);
            }
            if free.scale {
                columns[POSE + free.scale_at(intrinsics)] =
                    [0, 1].map(|row| bx[row] * by_scale.x + by[row] * by_scale.y + bz[row] * by_scale.z);
            }
        }
        if free.depth {
            let at = POSE + free.depth_at(intrinsics);
            columns[at..at + DepthBias::COUNT].fill([0.0; 2]);
        }
        columns[POSE + count] = [projection.px[0] - corner.px.x, projection.px[1] - corner.px.y];
        if let Some(w) = whitener.of(i) {
            for column in &mut columns[..=POSE + count] {
                let [x, y] = *column;
                *column = [w.m11 * x + w.m12 * y, w.m21 * x + w.m22 * y];
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
