//! `handeye driver ur-rtde`: a controller of Universal Robots.

use clap::Args;
use handeye_arm::ArmKind;
use handeye_driver::drivers::ur_rtde::{PORT, RtdeOptions, UrRtde, UrRtdeOptions};
use handeye_driver::message::ArmMessage;

use super::serve;
use crate::Failure;
use handeye_workbench::arguments::heading;

/// Options of `handeye driver ur-rtde`.
#[derive(Debug, Args)]
pub struct UrRtdeArgs {
    /// Address of the controller, as the pendant shows it.
    #[arg(long, value_name = "ADDR", help_heading = heading::CELL)]
    host: String,
    /// Port of its RTDE.
    #[arg(long, value_name = "PORT", default_value_t = PORT, help_heading = heading::CELL)]
    port: u16,
    /// States a second: up to 125 from a CB3, up to 500 from an e-Series.
    #[arg(long, value_name = "HZ", default_value_t = 125, value_parser = clap::value_parser!(u16).range(10..=500), help_heading = heading::CELL)]
    frequency: u16,
    /// Which arm it is, such as ur5e: the controller does not say.
    #[arg(long, value_name = "NAME", help_heading = heading::CELL)]
    arm: Option<String>,
}

pub fn run(args: &UrRtdeArgs) -> Result<(), Failure> {
    let known: Vec<&str> = ArmKind::ALL.into_iter().map(ArmKind::name).collect();
    if let Some(arm) = args.arm.as_deref().filter(|arm| !known.contains(arm)) {
        let names = known.join(", ");
        return Err(Failure::unusable(anyhow::anyhow!("--arm {arm} is none of {names}: leave it out for another arm")));
    }
    let rtde =
        RtdeOptions { port: args.port, frequency_hz: f64::from(args.frequency), ..RtdeOptions::new(args.host.clone()) };
    serve(UrRtde::new(UrRtdeOptions { rtde, arm: args.arm.clone().map(ArmMessage::Name) }))
}
