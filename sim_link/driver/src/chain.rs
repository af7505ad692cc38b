//! The chain of joints that a driver's `hello` names.

use std::path::Path;

use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind};

use super::message::{ArmMessage, Hello};

/// The arm, where `hello` names one.
///
/// # Errors
/// What is wrong: an unknown name, a URDF that cannot be read, another number of joints than `joints` has.
pub fn arm_of(hello: &Hello) -> Result<Option<Arm>, String> {
    let arm = match &hello.arm {
        None => return Ok(None),
        Some(ArmMessage::Name(name)) => built_in(name)?,
        Some(ArmMessage::Urdf { urdf, base_link, tip_link }) => {
            let is_text = urdf.trim_start().starts_with('<');
            let read = if is_text { Urdf::parse(urdf, "the driver's URDF") } else { Urdf::read(Path::new(urdf)) };
            let arm = read.and_then(|urdf| urdf.arm(base_link.as_deref(), tip_link.as_deref()));
            arm.map_err(|error| error.to_string())?
        }
    };
    let (has, need) = (arm.joint_count(), hello.joints.len());
    if need > 0 && has != need {
        return Err(format!("the chain has {has} joints and `joints` has {need}"));
    }
    Ok(Some(arm))
}

fn built_in(name: &str) -> Result<Arm, String> {
    let kind = ArmKind::ALL.into_iter().find(|kind| kind.name() == name);
    kind.map(ArmKind::arm).ok_or_else(|| {
        let names: Vec<&str> = ArmKind::ALL.into_iter().map(ArmKind::name).collect();
        format!("{name} is not built in; {} are, and any other arm is given as {{\"urdf\": FILE}}", names.join(", "))
    })
}
