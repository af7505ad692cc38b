//! What the arm keeps out of.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use handeye_plan::Surroundings;
use handeye_plan::surroundings::{KeepOutBox, KeepOutFile, SurroundingsError};

use crate::text::Text;

/// Height of a box that is drawn on the ground \[m\].
const DRAWN_HEIGHT_M: f64 = 0.2;
/// Shortest edge of a box that is drawn \[m\]: less is a slip of the hand.
const LEAST_DRAWN_M: f64 = 0.01;

/// The boxes, and what the cell reports.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct KeepOut {
    /// As they are edited.
    pub content: KeepOutFile,
    /// What the arm avoids: every valid entry of the content.
    pub around: Arc<Surroundings>,
    /// What is invalid in the content.
    pub fault: Option<Text>,
    /// Why the arm keeps out of none of them.
    pub unkept: Option<Text>,
    /// Where they are kept; nowhere if that cannot be read or the system has no folder for it.
    pub file: Option<PathBuf>,
    /// Why they are not saved.
    pub unsaved: Option<Text>,
    /// Since when \[s\] they are waiting to be written.
    pub unwritten_since_s: Option<f64>,
    /// The obstacles that the cell reports; `None` before it has reported them.
    pub scene_obstacles: Option<Arc<Surroundings>>,
}

impl KeepOut {
    /// Takes in other boxes. An invalid entry is shown but ignored, all others are used.
    pub fn set(&mut self, content: KeepOutFile) {
        let file = self.file.as_deref().unwrap_or_else(|| Path::new("keep-out boxes"));
        self.fault = content.surroundings(file).err().map(|error| match error {
            SurroundingsError::Entry { entry, fault, .. } => entry.with_fault(&fault),
            other => other.into(),
        });
        self.around = Arc::new(content.sensible());
        self.content = content;
    }
}

/// A name that no box has.
fn free_name(boxes: &[KeepOutBox]) -> String {
    let is_free = |name: &String| boxes.iter().all(|other| other.name != *name);
    // One of them is free: there are more numbers than boxes.
    (1..=boxes.len() + 1).map(|number| format!("box {number}")).find(is_free).unwrap_or_default()
}

/// With one more box, over a rectangle of the ground from one corner to the opposite one \[m\]; `None` if that is too small.
pub fn with_drawn(content: &KeepOutFile, from: [f64; 2], to: [f64; 2]) -> Option<KeepOutFile> {
    let edge = |axis: usize| (to[axis] - from[axis]).abs();
    if edge(0) < LEAST_DRAWN_M || edge(1) < LEAST_DRAWN_M {
        return None;
    }
    let millimetres = |m: f64| (m * 1e3).round() / 1e3;
    let middle = |axis: usize| millimetres(f64::midpoint(from[axis], to[axis]));
    let mut content = content.clone();
    content.boxes.push(KeepOutBox {
        name: free_name(&content.boxes),
        centre_m: [middle(0), middle(1), DRAWN_HEIGHT_M / 2.0],
        size_m: [millimetres(edge(0)), millimetres(edge(1)), DRAWN_HEIGHT_M],
        rotation_xyzw: None,
        yaw_deg: None,
    });
    Some(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_shown_and_the_arm_keeps_to_everything_else() {
        let mut keep_out = KeepOut::default();
        let one = with_drawn(&keep_out.content, [0.5, 0.3], [0.2, -0.1]).expect("a rectangle");
        keep_out.set(one.clone());
        assert_eq!((keep_out.around.obstacles.len(), keep_out.fault.is_some()), (1, false));
        let [size, centre] = [keep_out.content.boxes[0].size_m, keep_out.content.boxes[0].centre_m];
        assert_eq!((size, centre), ([0.3, 0.4, 0.2], [0.35, 0.1, 0.1]));
        // A name is being typed while another box is drawn.
        let mut two = with_drawn(&one, [0.0, 0.5], [0.1, 0.7]).expect("a rectangle");
        two.boxes[0].size_m[1] = 0.0;
        two.boxes[1].name.clear();
        keep_out.set(two.clone());
        assert!(keep_out.fault.is_some() && keep_out.content == two);
        assert_eq!(keep_out.around.obstacles.len(), 1, "the one without a name is a box all the same");
        keep_out.set(one);
        assert_eq!(keep_out.fault, None);
    }

    #[test]
    fn a_slip_of_the_hand_is_no_box_and_names_are_told_apart() {
        let none = KeepOutFile::default();
        assert_eq!(with_drawn(&none, [0.1, 0.1], [0.4, 0.105]), None);
        let mut content = none;
        for _ in 0..3 {
            content = with_drawn(&content, [0.0, 0.0], [0.1, 0.1]).expect("a rectangle");
        }
        content.boxes.remove(0);
        content = with_drawn(&content, [0.0, 0.0], [0.1, 0.1]).expect("a rectangle");
        let names: Vec<&str> = content.boxes.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["box 2", "box 3", "box 1"]);
    }
}
