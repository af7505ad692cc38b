//! `--tool`: the tool whose tip shall arrive.

use clap::Args;
use handeye_dataset::LONGEST_TOOL_M;
use handeye_workbench::arguments::heading;

/// Option of commands that say how near a tool arrives.
#[derive(Debug, Clone, Copy, Args)]
pub struct ToolArg {
    /// Where the tip of the tool is in the frame of the TCP, metres, for the errors that a tool arrives within; what the data say if not
    /// given, or 0,0,0.1.
    #[arg(long = "tool", value_name = "X,Y,Z", value_parser = tool, allow_hyphen_values = true, help_heading = heading::ESTIMATE)]
    pub tool_m: Option<[f64; 3]>,
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
