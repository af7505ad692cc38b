//! Which cell a command works with, and what is allowed there.

use clap::Args;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::Endpoint;
use handeye_coppeliasim::cell::CellPaths;
use handeye_driver::DriverSpec;
use handeye_link::{CellSource, Drivers};

use super::cell::SceneArg;
use crate::{Failure, ObjectArgs};
use handeye_workbench::arguments::heading;

/// The share of its fastest speed at which a robot behind a driver is moved if not given, as in the window.
const REAL_SPEED: f64 = 0.25;

/// Options that say which cell, and what is allowed there.
#[derive(Debug, Args)]
pub struct CellChoice {
    /// Address of a CoppeliaSim or cell; without it, and without drivers, the built-in cell is started.
    #[arg(long, value_name = "ADDR", help_heading = heading::CELL)]
    pub connect: Option<String>,
    /// Driver of the robot, or of robot and camera: a command, or tcp://HOST:PORT (docs/drivers.md).
    #[arg(long, value_name = "DRIVER", conflicts_with = "connect", help_heading = heading::CELL)]
    pub driver: Option<String>,
    /// Driver of the camera, where it is another program.
    #[arg(long, value_name = "DRIVER", requires = "driver", help_heading = heading::CELL)]
    pub camera_driver: Option<String>,
    /// Let this command move the robot behind the driver. Without it that robot is only read. Ctrl-C stops it.
    #[arg(long, requires = "driver", help_heading = heading::CELL)]
    pub allow_motion: bool,
    /// Connect, print where the robot would be moved, and move nothing.
    #[arg(long, help_heading = heading::CELL)]
    pub dry_run: bool,
    /// Share of its fastest speed at which the robot moves, percent; 100 of a simulated one and 25 of one behind a driver if
    /// not given.
    #[arg(long, value_name = "PERCENT", value_parser = percent, help_heading = heading::CELL)]
    speed: Option<f64>,
    #[command(flatten)]
    objects: ObjectArgs,
    #[command(flatten)]
    scene: SceneArg,
    /// Seed of everything random in the built-in cell, and of planned poses.
    #[arg(long, value_name = "N", help_heading = heading::CELL)]
    pub seed: Option<u64>,
}

fn percent(text: &str) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_none| "not a number".to_owned())?;
    if number > 0.0 && number <= 100.0 { Ok(number) } else { Err("above 0 and at most 100 is needed".to_owned()) }
}

impl CellChoice {
    /// Whether it is an existing cell, and not one that is started for this command alone.
    pub fn is_given(&self) -> bool {
        self.connect.is_some() || self.driver.is_some()
    }

    /// The scene of the built-in cell.
    ///
    /// # Errors
    /// When it cannot be read, and when it is given with another cell.
    pub fn scene(&self) -> Result<Scene, Failure> {
        if self.is_given()
            && let Some(option) = self.scene.given()
        {
            return Err(Failure::unusable(anyhow::anyhow!(
                "{option} describes the built-in cell and --connect or --driver takes another: give one of them"
            )));
        }
        self.scene.load()
    }

    /// The named cell; `None` if the built-in one has to be started. An invalid address or driver is found here.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn source(&self) -> Result<Option<CellSource>, Failure> {
        if let Some(address) = &self.connect {
            let _is_one: Endpoint = address.parse().map_err(Failure::unusable)?;
            return Ok(Some(CellSource::Address(address.clone())));
        }
        let Some(robot) = &self.driver else { return Ok(None) };
        for named in std::iter::once(robot).chain(&self.camera_driver) {
            let _is_one: DriverSpec = named.parse().map_err(Failure::unusable)?;
        }
        Ok(Some(CellSource::Drivers(Drivers { robot: Some(robot.clone()), camera: self.camera_driver.clone() })))
    }

    /// Where the scene has the parts of the cell; `robot` is the name of the built-in cell's.
    pub fn paths(&self, robot: &str) -> CellPaths {
        let usual = if self.connect.is_some() { CellPaths::default() } else { CellPaths::below(robot) };
        self.objects.paths(usual)
    }

    /// The share of its fastest speed at which the robot moves.
    pub fn speed(&self) -> f64 {
        let usual = if self.driver.is_some() { REAL_SPEED } else { 1.0 };
        self.speed.map_or(usual, |percent| percent / 100.0)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use handeye_cell::scene::ArmErrorsSpec;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        choice: CellChoice,
    }

    fn scene(words: &[&str]) -> Result<Scene, Failure> {
        let line = Line::try_parse_from(std::iter::once("handeye").chain(words.iter().copied()));
        line.unwrap_or_else(|error| panic!("{error}")).choice.scene()
    }

    #[test]
    fn the_arm_has_the_errors_that_are_asked_for_and_else_those_of_its_scene() {
        for (words, expected) in [
            (&[][..], ArmErrorsSpec::NONE),
            (&["--arm-errors", "nominal"], ArmErrorsSpec::NOMINAL),
            (&["--scene", "panda", "--arm-errors", "nominal"], ArmErrorsSpec::NOMINAL),
            (&["--scene", "nominal"], ArmErrorsSpec::NOMINAL),
            (&["--scene", "nominal", "--arm-errors", "none"], ArmErrorsSpec::NONE),
        ] {
            let scene = scene(words).unwrap_or_else(|failure| panic!("{words:?}: {failure}"));
            assert_eq!(scene.robot.arm_errors, expected, "{words:?}");
        }
    }

    #[test]
    fn what_describes_the_built_in_cell_is_refused_with_another() {
        for other in [["--connect", "tcp://127.0.0.1:23000"], ["--driver", "python3 mine.py"]] {
            for own in [["--scene", "panda"], ["--arm-errors", "none"]] {
                let failure = scene(&[other, own].concat()).expect_err(own[0]);
                assert!(failure.to_string().contains(own[0]), "{failure}");
            }
        }
    }
}
