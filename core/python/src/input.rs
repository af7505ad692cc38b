//! Observations from arrays.

use std::collections::BTreeSet;

use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::handeye::Mode;
use handeye_estimate::placement::{ArmOfViews, PlacementError};
use handeye_estimate::robot_accuracy::RobotAccuracy;
use handeye_estimate::{CameraKnowledge, DEFAULT_MODEL, KnownLens, Observations as Observed, ObservedView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};
use nalgebra::Vector2;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};

use crate::arm_of_views::{ArmDescription, placed};
use crate::error::Failure;
use crate::folder::Folder;
use crate::numbers::{bytes_of, doubles, integers, poses};

/// How far outside of the image a corner may be, pixels, as in a corner table.
const BORDER_PX: f64 = 1.0;
/// Replaces the target of pose pairs where none is stated: 0.1 m of board about the origin of its frame. Effects are
/// evaluated on it, and it enters no estimate.
const NO_TARGET: TargetSpec = TargetSpec::Circles(Grid { columns: 3, rows: 3, square_m: 0.05 });

/// Small inputs from Python.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    mode: Option<Mode>,
    target: Option<TargetSpec>,
    image_size: Option<(u32, u32)>,
    known: Option<Lens>,
    known_px: Option<f64>,
    start: Option<Lens>,
    model: Option<String>,
    names: Vec<String>,
    arm: Option<ArmDescription>,
    robot_accuracy_mm: Option<f64>,
}

/// Intrinsics as Python has them.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    model: String,
    distortion: Vec<f64>,
}

impl From<&Intrinsics> for Lens {
    fn from(k: &Intrinsics) -> Self {
        let (model, distortion) = (k.distortion.name().to_owned(), k.distortion.coefficients().to_vec());
        Self { width: k.width, height: k.height, fx: k.fx, fy: k.fy, cx: k.cx, cy: k.cy, model, distortion }
    }
}

impl Lens {
    fn intrinsics(&self) -> Result<Intrinsics, Failure> {
        let zero = model(&self.model)?;
        let (got, need) = (self.distortion.len(), zero.coefficients().len());
        if got != need {
            return Err(Failure::Input(format!("{} has {need} coefficients of distortion, not {got}", self.model)));
        }
        let distortion = zero.with_coefficients(&self.distortion);
        let Self { width, height, fx, fy, cx, cy, .. } = *self;
        let intrinsics = Intrinsics { width, height, fx, fy, cx, cy, distortion };
        intrinsics.validate().map_err(Failure::input)?;
        Ok(intrinsics)
    }
}

fn model(name: &str) -> Result<Distortion, Failure> {
    Distortion::from_name(name)
        .ok_or_else(|| Failure::Input(format!("{name:?} is no lens model: none, brown_conrady, rational or fisheye")))
}

/// Input of a calibration.
#[pyclass(frozen, module = "handeye._handeye")]
pub struct Observations {
    pub observed: Observed,
    /// The folder that it is from.
    pub folder: Option<Folder>,
    /// Whether the target was stated.
    pub target_is_known: bool,
    /// The arm, where its joints in the views are known; why they are not used otherwise.
    pub arm: Option<Result<ArmOfViews, PlacementError>>,
    /// Accuracy of the robot, where it is stated.
    pub robot_accuracy: Option<RobotAccuracy>,
}

/// Corners of a view: their numbers, all of the target where they are left out, and pixels u, v.
type CornerArrays = (Option<Vec<u8>>, Vec<u8>);

impl Observations {
    /// The arm, where it is known and belongs to the poses.
    pub fn arm(&self) -> Option<&ArmOfViews> {
        self.arm.as_ref()?.as_ref().ok()
    }

    /// Requirements for their calibration.
    pub fn wanted(&self, goal_mm: Option<f64>) -> FindingOptions<'_> {
        FindingOptions::with_goal_mm(goal_mm).with_arm(self.arm()).with_robot_accuracy(self.robot_accuracy)
    }
}

#[pymethods]
impl Observations {
    /// `description` is JSON; arrays are bytes, a 4 × 4 matrix for every view, numbers of corners as int64,
    /// the joint values of every view.
    #[new]
    fn new(
        description: &str,
        base_from_tip: Option<&[u8]>,
        corners: Option<Vec<Option<CornerArrays>>>,
        camera_from_target: Option<&[u8]>,
        joints: Option<&[u8]>,
    ) -> Result<Self, Failure> {
        let described: Description = serde_json::from_str(description).map_err(Failure::input)?;
        let Description { mode, target, image_size, known, known_px, start, model: lens_model, names, arm, .. } =
            described;
        let robot_accuracy = described.robot_accuracy_mm.map(|mm| RobotAccuracy::new(mm, None));
        if let Some(target) = &target {
            target.check().map_err(Failure::input)?;
        }
        let unique: BTreeSet<&String> = names.iter().collect();
        if unique.len() < names.len() {
            return Err(Failure::Input("two views have the same name: names tell the views apart".to_owned()));
        }
        let spec = target.unwrap_or(NO_TARGET);
        let camera = match (known, start) {
            (Some(known), _) => match (known.intrinsics()?, known_px) {
                (intrinsics, None) => CameraKnowledge::Fixed(intrinsics),
                (intrinsics, Some(accuracy_px)) => CameraKnowledge::Near(KnownLens { intrinsics, accuracy_px }),
            },
            (None, start) => {
                let start = start.as_ref().map(Lens::intrinsics).transpose()?;
                let stated = lens_model.as_deref().map(model).transpose()?;
                let model = stated.or(start.map(|start| start.distortion)).unwrap_or(DEFAULT_MODEL);
                CameraKnowledge::Estimate { model, start }
            }
        };
        let base_from_tip: Option<Vec<Pose<Base, Tip>>> =
            base_from_tip.map(|bytes| poses("base_from_tip", bytes, &names)).transpose()?;
        let camera_from_target: Option<Vec<Pose<Camera, Target>>> =
            camera_from_target.map(|bytes| poses("camera_from_target", bytes, &names)).transpose()?;
        if corners.as_ref().is_some_and(|corners| corners.len() != names.len()) {
            return Err(Failure::Input(format!("corners are needed for each of the {} views", names.len())));
        }
        let mut corners = corners.unwrap_or_default().into_iter();
        let mut views = Vec::with_capacity(names.len());
        for (index, name) in names.into_iter().enumerate() {
            let seen = corners.next().flatten().map(|arrays| {
                view_corners(&arrays, &spec, image_size.unwrap_or_default())
                    .map_err(|why| Failure::Input(format!("corners of view {name:?}: {why}")))
            });
            views.push(ObservedView {
                camera_from_target: camera_from_target.as_ref().map(|poses| poses[index]),
                ..ObservedView::new(name, base_from_tip.as_ref().map(|poses| poses[index]), seen.transpose()?)
            });
        }
        let arm = arm.zip(joints).map(|(arm, joints)| placed(arm, joints, &mut views)).transpose()?;
        let image_size = image_size.unwrap_or_default();
        let observed = Observed { mode, target: spec, image_size, camera, views };
        Ok(Self { observed, folder: None, target_is_known: target.is_some(), arm, robot_accuracy })
    }

    /// Why joint values that are there are not used; nothing where they are.
    #[getter]
    fn joints_unused(&self) -> Option<String> {
        self.arm.as_ref()?.as_ref().err().map(ToString::to_string)
    }
}

fn view_corners(
    (numbers, pixels): &CornerArrays,
    target: &TargetSpec,
    (width, height): (u32, u32),
) -> Result<Corners, String> {
    let pixels = doubles(pixels);
    let (pixels, _none) = pixels.as_chunks::<2>();
    let (all, grid) = (target.len(), target.grid());
    let numbers = match numbers {
        Some(numbers) => integers(numbers),
        None if pixels.len() == all => (0..all as i64).collect(),
        None => {
            return Err(format!(
                "there are {} and the target ({target}) has {all} points: give them all, row by row, or with corner_ids say \
                 which they are",
                pixels.len()
            ));
        }
    };
    if numbers.len() != pixels.len() {
        return Err(format!("{} corner_ids for {} corners", numbers.len(), pixels.len()));
    }
    let is_inside = |px: f64, side: u32| (-BORDER_PX..=f64::from(side) - 1.0 + BORDER_PX).contains(&px);
    let mut seen = BTreeSet::new();
    let mut corners = Vec::with_capacity(pixels.len());
    for (number, [u, v]) in numbers.into_iter().zip(pixels) {
        let index = usize::try_from(number).ok().filter(|index| *index < all).ok_or_else(|| {
            format!(
                "corner {number} is not on the target, whose {} × {} points are 0 to {}",
                grid.columns,
                grid.rows,
                all - 1
            )
        })?;
        if !seen.insert(index) {
            return Err(format!("corner {index} is there twice"));
        }
        if !(u.is_finite() && v.is_finite()) {
            return Err(format!(
                "corner {index} is not finite: leave it out, and with corner_ids say which the others are"
            ));
        }
        if !(is_inside(*u, width) && is_inside(*v, height)) {
            return Err(format!("corner {index} at {u}, {v} is outside of the image of {width} × {height} pixels"));
        }
        corners.push(Corner::new(index, Vector2::new(*u, *v)));
    }
    corners.sort_by_key(|corner| corner.index);
    Ok(corners.into())
}

/// All points of a target (JSON) as doubles x, y, z in metres.
#[pyfunction]
pub fn target_points<'py>(py: Python<'py>, target: &str) -> Result<Bound<'py, PyBytes>, Failure> {
    let target: TargetSpec = serde_json::from_str(target).map_err(Failure::input)?;
    target.check().map_err(Failure::input)?;
    Ok(bytes_of(py, target.points().into_iter().flat_map(|point| [point.x, point.y, point.z])))
}
