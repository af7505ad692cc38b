//! An arm that follows the board.

use handeye_coppeliasim::CancelToken;
use handeye_coppeliasim::cell::{FollowEnd, FollowMoment, FollowRequest as ArmRequest};
use handeye_link::{MotionGoal, MotionOutcome, MotionPort, PortError, Room};

use super::follow_line::FollowLine;
use crate::track::state::FollowRequest;

/// Makes the arm do what is requested about the tracked board, from a place where it has room if that is requested, to which it
/// moves at a share of its fastest speed; `makes_room` is notified beforehand. Returns when the arm is at rest: how following
/// ended, or why it was not begun or failed.
///
/// # Errors
/// [`PortError::Lost`] and the like.
pub fn follow(
    port: &mut dyn MotionPort,
    line: &FollowLine,
    request: FollowRequest,
    speed: f64,
    cancel: &CancelToken,
    makes_room: &mut dyn FnMut(),
) -> Result<Result<FollowEnd, MotionOutcome>, PortError> {
    let board = line.board_in_view().filter(|_| request == FollowRequest::KeepViewWithRoom);
    match board.map(|board| port.room(&board)).transpose()? {
        None | Some(Room::Enough) => line.begin(request),
        Some(Room::Nowhere(why)) => return Ok(Err(MotionOutcome::Refused(why))),
        Some(Room::At(joints)) => {
            makes_room();
            match port.move_to(&MotionGoal::Joints(joints), speed, cancel)? {
                MotionOutcome::Arrived => line.begin_elsewhere(request),
                outcome => return Ok(Err(outcome)),
            }
        }
    }
    port.follow(&mut |moment: &FollowMoment| if cancel.is_cancelled() { ArmRequest::End } else { line.request(moment) })
}
