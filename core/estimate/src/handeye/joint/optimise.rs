//! Levenberg–Marquardt on the joint cost at given noise levels.

use super::normal::System;
use super::state::State;
use super::{JointProblem, Noise};
use crate::handeye::{HandEyeError, determined};
use handeye_geometry::progress::CancelToken;

/// Steps of one minimisation; a handful is usual.
const MAX_STEPS: usize = 100;
/// Ends when the quadratic model predicts a decrease of less than this part of the cost.
const COST_TOLERANCE: f64 = 1e-12;
/// Damping of the first step from a start that may be far off, relative to the diagonal.
pub const FAR: f64 = 1e-4;
/// And of one from near the optimum, where damping only holds the weak directions back.
pub const NEAR: f64 = 1e-10;
/// Past this damping a step is too small to matter.
const LARGEST_DAMPING: f64 = 1e12;

/// What is minimised, and from how far.
#[derive(Clone, Copy)]
pub struct Descent<'a> {
    pub problem: &'a JointProblem<'a>,
    pub noise: &'a Noise,
    /// First damping.
    pub damping: f64,
}

/// Minimises the cost from `state`, which holds the best point found afterwards; `system` is linearised there. Returns the
/// system at that point and the number of steps.
pub fn minimise(
    Descent { problem, noise, mut damping }: Descent<'_>,
    state: &mut State,
    mut system: System,
    cancel: &CancelToken,
) -> Result<(System, usize), HandEyeError> {
    let mut cost = system.cost(noise);
    for step in 0..MAX_STEPS {
        loop {
            let trial = system.reduce_damped(noise, damping).map(|reduced| {
                let shared = reduced.shared_step();
                let own = reduced.own_steps(&shared);
                (state.stepped(problem, &shared, &own), reduced.decrease())
            });
            let (next, promised) = match trial {
                Ok(trial) => trial,
                Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
                Err(error) if damping >= LARGEST_DAMPING => return Err(error),
                Err(_) => {
                    damping = (damping * 10.0).max(1e-9);
                    continue;
                }
            };
            if promised <= COST_TOLERANCE * cost.max(f64::MIN_POSITIVE) {
                return Ok((system, step));
            }
            // Two systems of many views are half of all memory, and few steps are refused, so the previous state is
            // linearised once more for those.
            drop(system);
            match determined(System::new(problem, &next, cancel))? {
                Some(next_system) if next_system.cost(noise) < cost => {
                    (*state, system) = (next, next_system);
                    cost = system.cost(noise);
                    damping = (damping * 0.1).max(1e-12);
                    break;
                }
                // A step that puts the target behind the camera is as bad as one that raises the cost.
                _ => system = System::new(problem, state, cancel)?,
            }
            damping *= 10.0;
            if damping > LARGEST_DAMPING {
                return Ok((system, step));
            }
        }
    }
    Ok((system, MAX_STEPS))
}
