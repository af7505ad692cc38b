//! The numeric limits of the workbench for a driver. `docs/drivers.md` lists them for authors of drivers, and a test keeps
//! both equal.

use std::time::Duration;

use handeye_capture::NO_IMAGES_S;

/// The states before and after an image are no farther apart than this \[s\]: with longer gaps the pose between them is not
/// known well enough.
pub const STATES_APART_S: f64 = 0.25;
/// An image waits this long for the state after it: three states of the slowest driver.
pub(crate) const STATE_AFTER_IMAGE: Duration = Duration::from_millis(300);
/// An image is no older than this on arrival \[s\]: the view should show the present.
pub(crate) const IMAGE_AGE_S: f64 = 1.0;
/// The first state and the first image come within this time after `hello`, which is answered before anything slow is loaded.
pub const FIRST: Duration = Duration::from_secs(10);
/// The next image comes within this time: as long as a capture waits for one.
pub(crate) const IMAGE_WAIT: Duration = Duration::from_secs(NO_IMAGES_S as u64);
/// After `done` each joint is this close to its goal \[rad\], and so is the orientation of a tip that was sent to a pose.
pub(crate) const GOAL_RAD: f64 = 2e-3;
/// The same of a prismatic joint and of the place of a tip \[m\].
pub(crate) const GOAL_M: f64 = 2e-3;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_about_drivers_states_the_limits_that_are_asked_for() {
        const PAGE: &str = include_str!("../../../docs/drivers.md");
        let table = PAGE.split("## Limits").nth(1).and_then(|rest| rest.split("\n## ").next()).expect("a section");
        let stated = [
            format!("{STATES_APART_S} s apart"),
            format!("at most {} s after it", STATE_AFTER_IMAGE.as_secs_f64()),
            format!("within {} s after `hello`", FIRST.as_secs()),
            format!("{IMAGE_AGE_S} s old"),
            format!("within {} s", IMAGE_WAIT.as_secs()),
            format!("{} mrad", GOAL_RAD * 1e3),
            format!("{} mm", GOAL_M * 1e3),
        ];
        for limit in stated {
            assert!(table.contains(&limit), "{limit} is not in:{table}");
        }
    }
}
