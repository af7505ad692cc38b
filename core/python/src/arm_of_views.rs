//! The arm of the views, out of its description and joint values.

use std::path::PathBuf;

use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind, ArmModel};
use handeye_estimate::ObservedView;
use handeye_estimate::placement::{ArmOfViews, JointView, PlacementError, place_checked};
use handeye_estimate::reach_error::USUAL_TOOL;
use serde::Deserialize;

use crate::error::Failure;
use crate::numbers::doubles;

/// An arm as Python names it.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ArmDescription {
    /// One that is built in.
    Kind(String),
    /// Rows `[a, alpha, d, theta]`.
    Dh(Vec<[f64; 4]>),
    /// A file, and the links between which the arm is where the file leaves a choice.
    Urdf { path: PathBuf, base: Option<String>, tip: Option<String> },
}

impl ArmDescription {
    fn arm(self) -> Result<Arm, Failure> {
        match self {
            Self::Kind(name) => {
                let kind = ArmKind::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| {
                    let known = ArmKind::ALL.map(ArmKind::name).join(", ");
                    Failure::Input(format!(
                        "no arm {name:?} is built in: choose from {known}, or give rows [a, alpha, d, theta] or the path of a URDF \
                         file, which ends with .urdf"
                    ))
                })?;
                Ok(kind.arm())
            }
            Self::Dh(rows) => {
                ArmModel::Dh(rows).arm().map_err(|error| Failure::Input(format!("the rows of the arm: {error}")))
            }
            Self::Urdf { path, base, tip } => {
                Urdf::read(&path).and_then(|urdf| urdf.arm(base.as_deref(), tip.as_deref())).map_err(Failure::input)
            }
        }
    }
}

/// Places the arm where the views show it, and adds its joints to the views. Joint values that do not belong to the poses, and
/// poses that do not determine where the arm is, are not an error yet: a diagnosis goes on without the arm.
pub fn placed(
    description: ArmDescription,
    joints: &[u8],
    views: &mut [ObservedView],
) -> Result<Result<ArmOfViews, PlacementError>, Failure> {
    let arm = description.arm()?;
    let (values, need) = (doubles(joints), arm.joint_count());
    if values.len() != need * views.len() {
        let each = values.len() / views.len().max(1);
        return Err(Failure::Input(format!(
            "joints have {each} values for each view, and the arm has {need} joints: one value for each is needed, radians"
        )));
    }
    let joints_rad: Vec<Vec<f64>> = values.chunks(need).map(<[f64]>::to_vec).collect();
    let mut posed = Vec::with_capacity(views.len());
    for (view, joints_rad) in views.iter().zip(&joints_rad) {
        if !joints_rad.iter().all(|value| value.is_finite()) {
            let name = &view.name;
            return Err(Failure::Input(format!("joints of view {name:?}: a value is not finite: leave this view out")));
        }
        let missing = || Failure::Input("base_from_tip is missing: joints belong to poses of the tip".to_owned());
        posed.push(JointView { base_from_tip: view.base_from_tip.ok_or_else(missing)?, joints_rad });
    }
    match place_checked(&arm, &posed) {
        Ok((placement, of_views)) => {
            for (view, frames) in views.iter_mut().zip(of_views) {
                view.tip_from_joints = frames;
            }
            let (tool_m, joints_rad) = (USUAL_TOOL, joints_rad.into_iter().map(Some).collect());
            Ok(Ok(ArmOfViews { placement, tool_m, joints_rad }))
        }
        Err(why) => Ok(Err(why)),
    }
}
