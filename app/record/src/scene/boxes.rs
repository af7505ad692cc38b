//! Boxes that the arm keeps clear of.

use handeye_plan::{Obstacle, Surroundings};
use rerun::{Boxes3D, Quaternion};

use super::error::RecordError;
use super::paths;
use super::pen::Pen;
use super::style;

/// Writes the obstacles that the cell reports and the boxes of the user, replacing earlier ones.
pub(super) fn write(pen: Pen<'_>, scene_obstacles: &Surroundings, own: &Surroundings) -> Result<(), RecordError> {
    pen.write(paths::STANDING, &boxes(&scene_obstacles.obstacles).with_colors([style::STANDING]))?;
    let names = own.obstacles.iter().map(|obstacle| obstacle.name.as_str());
    pen.write(paths::KEEP_OUT, &boxes(&own.obstacles).with_colors([style::KEEP_OUT]).with_labels(names))
}

fn boxes(obstacles: &[Obstacle]) -> Boxes3D {
    let centres = obstacles.iter().map(|it| it.world_from_centre.translation.vector.map(|m| m as f32).into());
    let halves = obstacles.iter().map(|it| it.size_m.map(|edge_m| (edge_m / 2.0) as f32));
    let turns = obstacles.iter().map(|it| {
        let turn = it.world_from_centre.rotation.coords;
        Quaternion::from_xyzw([turn.x, turn.y, turn.z, turn.w].map(|part| part as f32))
    });
    Boxes3D::from_centers_and_half_sizes(centres.collect::<Vec<[f32; 3]>>(), halves).with_quaternions(turns)
}
