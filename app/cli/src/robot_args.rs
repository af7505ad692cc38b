//! `--tool` and `--robot-accuracy`: what is stated about the robot for the error of a tool.

use clap::Args;
use handeye_dataset::LONGEST_TOOL_M;
use handeye_estimate::reach_error::USUAL_TOOL;
use handeye_estimate::robot_accuracy::{ROBOT_ACCURACY_MM, RobotAccuracy};
use handeye_session::{Document, SessionObservations};
use handeye_workbench::arguments::heading;

/// Options of commands that say how near a tool arrives.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args)]
pub struct RobotArgs {
    /// Where the tip of the tool is in the frame of the TCP, metres, for the error of a tool's position; as in the data if not
    /// given, or 0,0,0.1.
    #[arg(long = "tool", value_name = "X,Y,Z", value_parser = tool, allow_hyphen_values = true, help_heading = heading::ESTIMATE)]
    pub tool_m: Option<[f64; 3]>,
    /// How far the TCP is from where the robot reports it, RMS over the region where it works: some tenths of a millimetre and
    /// more, not the repeatability of the data sheet; as in the data if not given. A tool arrives within an error that follows
    /// from it where the errors of the arm are not known.
    #[arg(long = "robot-accuracy", value_name = "MM", value_parser = accuracy, help_heading = heading::ESTIMATE)]
    pub accuracy_mm: Option<f64>,
}

impl RobotArgs {
    /// Adds it to what was observed in `document`.
    pub fn put_into(&self, seen: &mut SessionObservations, document: &Document) {
        let tool_m = self.tool_m.or(document.meta.tool_m);
        if let Some(arm) = &mut seen.arm {
            arm.tool_m = tool_m.unwrap_or(USUAL_TOOL);
        }
        let accuracy_mm = self.accuracy_mm.or(document.meta.robot_accuracy_mm);
        seen.robot_accuracy = accuracy_mm.map(|mm| RobotAccuracy::new(mm, tool_m));
    }

    /// Whether anything is stated.
    pub fn is_given(&self) -> bool {
        *self != Self::default()
    }
}

fn accuracy(text: &str) -> Result<f64, String> {
    let mm = text.trim().parse::<f64>().map_err(|_none| format!("{text:?} is not a number"))?;
    let [least, most] = [ROBOT_ACCURACY_MM.start(), ROBOT_ACCURACY_MM.end()];
    if ROBOT_ACCURACY_MM.contains(&mm) { Ok(mm) } else { Err(format!("{mm} mm: between {least} and {most} mm")) }
}

fn tool(text: &str) -> Result<[f64; 3], String> {
    let number = |word: &str| word.trim().parse::<f64>().map_err(|_none| format!("{word:?} is not a number"));
    let numbers = text.split(',').map(number).collect::<Result<Vec<_>, _>>()?;
    let count = numbers.len();
    let place: [f64; 3] = numbers.try_into().map_err(|_other| format!("{count} numbers: give x,y,z in metres"))?;
    match place.iter().find(|metres| !(-LONGEST_TOOL_M..=LONGEST_TOOL_M).contains(*metres)) {
        Some(far) => Err(format!("{far} m: lengths are metres here; divide millimetres by 1000")),
        None => Ok(place),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_accuracy_is_some_millimetres() {
        assert_eq!(accuracy("0.5"), Ok(0.5));
        for (text, says) in [("0", "between"), ("500", "between"), ("nan", "between"), ("fine", "not a number")] {
            let error = accuracy(text).expect_err(text);
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn a_tool_is_three_numbers_in_metres() {
        assert_eq!(tool("0, -0.02,0.12"), Ok([0.0, -0.02, 0.12]));
        for (text, says) in
            [("0,0,120", "millimetres"), ("0,0.1", "2 numbers"), ("0,0,x", "not a number"), ("0,0,nan", "metres")]
        {
            let error = tool(text).expect_err(text);
            assert!(error.contains(says), "{error}");
        }
    }
}
