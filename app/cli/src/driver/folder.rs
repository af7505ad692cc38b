//! `handeye driver folder`: a folder that fills with images and poses.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use handeye_dataset::PoseFormat;
use handeye_driver::drivers::folder::{Folder, FolderOptions};

use super::{serve, size};
use crate::Failure;
use handeye_workbench::arguments::heading;

/// Options of `handeye driver folder`.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// The folder.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// There are no poses, only images.
    #[arg(long, conflicts_with_all = ["poses", "length_unit", "rotation", "angle_unit", "pose", "joints", "joint_unit"], help_heading = heading::MEANING)]
    images_only: bool,
    /// Table of poses in the folder; poses.csv if not given.
    #[arg(long, value_name = "FILE", help_heading = heading::MEANING)]
    poses: Option<String>,
    /// Unit of positions: m or mm. This and what follows are the keys of [robot] in a dataset.toml, which are taken from there
    /// where the folder has one.
    #[arg(long, value_name = "UNIT", help_heading = heading::MEANING)]
    length_unit: Option<String>,
    /// How rotations are written: quaternion_xyzw, quaternion_wxyz, rotation_vector, rpy or matrix.
    #[arg(long, value_name = "WORD", help_heading = heading::MEANING)]
    rotation: Option<String>,
    /// Unit of rotation_vector and rpy: rad or deg.
    #[arg(long, value_name = "UNIT", help_heading = heading::MEANING)]
    angle_unit: Option<String>,
    /// What a pose states: base_from_tip or tip_from_base.
    #[arg(long, value_name = "WORD", help_heading = heading::MEANING)]
    pose: Option<String>,
    /// How many joint angles follow the rotation.
    #[arg(long, value_name = "N", requires = "joint_unit", help_heading = heading::MEANING)]
    joints: Option<u8>,
    /// Unit of joint angles: rad or deg.
    #[arg(long, value_name = "UNIT", requires = "joints", help_heading = heading::MEANING)]
    joint_unit: Option<String>,
    /// Size of the images, needed while there is none yet.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size, help_heading = heading::CELL)]
    size: Option<(u32, u32)>,
    /// How long each capture is shown at least before the next, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = seconds, help_heading = heading::CELL)]
    hold: f64,
}

pub fn run(args: &FolderArgs) -> Result<(), Failure> {
    let format = if args.images_only { None } else { Some(format(args)?) };
    let hold = Duration::from_secs_f64(args.hold);
    serve(Folder::new(FolderOptions { folder: args.folder.clone(), format, size: args.size, hold }))
}

/// From the options, or from the folder's `dataset.toml` where there are none.
fn format(args: &FolderArgs) -> Result<PoseFormat, Failure> {
    let given = [
        ("poses", &args.poses),
        ("length_unit", &args.length_unit),
        ("rotation", &args.rotation),
        ("angle_unit", &args.angle_unit),
        ("pose", &args.pose),
        ("joint_unit", &args.joint_unit),
    ];
    let is_given = |(_, value): &(&str, &Option<String>)| value.is_some();
    if !given.iter().any(is_given) && args.joints.is_none() {
        return PoseFormat::of_folder(&args.folder).map_err(Failure::unusable)?.ok_or_else(|| {
            Failure::unusable(anyhow::anyhow!(
                "how are poses written in {}? Say it with --length-unit m|mm, --rotation \
                 quaternion_xyzw|quaternion_wxyz|rotation_vector|rpy|matrix, --angle-unit rad|deg (of rotation_vector and rpy) \
                 and --pose base_from_tip|tip_from_base, or in a dataset.toml there; --images-only where there are no poses",
                args.folder.display()
            ))
        });
    }
    let mut keys = String::new();
    for (key, value) in given {
        let default = if key == "poses" { Some("poses.csv") } else { None };
        if let Some(value) = value.as_deref().or(default) {
            let value = toml::Value::String(value.to_owned());
            writeln!(keys, "{key} = {value}").map_err(Failure::failed)?;
        }
    }
    if let Some(joints) = args.joints {
        writeln!(keys, "joints = {joints}").map_err(Failure::failed)?;
    }
    PoseFormat::parse(Path::new("options"), &keys).map_err(Failure::unusable)
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
    number.ok_or_else(|| "seconds from 0 to 3600".into())
}
