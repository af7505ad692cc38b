//! Offset between the clocks of a moving robot and of its camera, from the motion that both recorded.
//!
//! Over any interval of time the mount and the target turn by the same angle, whatever the links between them are. So the
//! offset is searched for where the angles of the robot's stream and those of the camera's agree, and every place where
//! they do is then refined with both links: `e_i(δ) = log(C_i⁻¹ X⁻¹ M(t_i + δ)⁻¹ Y)` as in [`pose_graph`], with `δ` one
//! unknown more, `M` interpolated between the robot's poses.
//!
//! # Reference
//! Furrer, Fehr, Novkovic, Sommer, Gilitschenski & Siegwart 2018, "Evaluation of combined time-offset estimation and hand-eye
//! calibration on robotic datasets", FSR (angles of rotation for alignment); Rehder, Siegwart & Furgale 2016, "A general
//! approach to spatiotemporal calibration in multisensor systems", IEEE T-RO 32 (the offset as one more unknown).

use crate::closed_form::{self, ClosedFormSolution};
use crate::consensus::consensus;
use crate::numbering::Turns;
use crate::pose_graph::{self, PoseGraphSolution, misfit};
use crate::{HandEyeError, PosePair, subset};
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median;
use handeye_wording::Text;
use handeye_wording::text;

/// Timestamps of one clock \[s\], and poses at them.
pub type Stream<Dst, Src> = [(f64, Pose<Dst, Src>)];

/// The offset of two clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    /// What is added to a timestamp of the camera to convert it to the robot's clock \[s\].
    pub offset_s: f64,
    /// Its standard deviation \[s\], for errors of the poses that are independent.
    pub sigma_s: f64,
}

/// Why the offset cannot be determined.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum ClockOffsetError {
    /// A stream that is too short.
    #[error("{got} poses of the {whose} are too few to tell the offset of its clock, at least {need} are needed", whose = named(whose))]
    TooFew {
        /// Whose poses: those of the robot, or of the camera.
        whose: &'static str,
        /// Number of poses.
        got: usize,
        /// Number needed.
        need: usize,
    },
    /// Timestamps that repeat, decrease or are not finite.
    #[error(
        "stamps of the {whose} do not rise at entry {entry}, counted from 0: sort them, and leave doubled ones out",
        whose = named(whose)
    )]
    NotRising {
        /// Whose poses: those of the robot, or of the camera.
        whose: &'static str,
        /// Index of the entry, counted from 0.
        entry: usize,
    },
    /// The streams were recorded at different times, or the offset is larger than the range searched.
    #[error(
        "the stamps of robot and camera have too little time in common within {within_s} s of each other: state the offset roughly"
    )]
    Apart {
        /// The largest offset searched for \[s\].
        within_s: f64,
    },
    /// A motion that repeats itself fits at several offsets.
    #[error(
        "offsets of {first_s:.3} s and {second_s:.3} s fit about as well: record a motion that does not repeat itself"
    )]
    Ambiguous {
        /// The best offset \[s\].
        first_s: f64,
        /// Another one \[s\].
        second_s: f64,
    },
    /// A motion without changes does not determine the offset.
    #[error(
        "the motion tells the offset of the clocks to no better than {sigma_s:.3} s: record one that turns and changes its speed"
    )]
    Uncertain {
        /// Its standard deviation \[s\].
        sigma_s: f64,
    },
    /// No links could be found at any offset.
    #[error(transparent)]
    HandEye(#[from] HandEyeError),
}

fn named(whose: &str) -> Text {
    match whose {
        "camera" => text!("camera"),
        "robot" => text!("robot"),
        other => Text::verbatim(other),
    }
}

/// Poses of a stream that are needed. Six numbers each, less the thirteen of two links and the offset, leave a hundred degrees
/// of freedom: the standard deviation of the offset is then itself known to a fifteenth.
const NEED: usize = 20;
/// Length of the intervals over which angles are compared \[s\]: arms change their motion within less.
const WINDOW_S: f64 = 0.3;
/// Most intervals and pairs that are used: a bound on the time it takes, without influence on decisions. Four times as
/// many would halve a standard deviation that is a small part of the time between two images by then.
const MOST: usize = 400;
/// Part of the intervals that has to agree: a tenth of the poses may be wrong, each the end of two intervals.
const AGREEING: f64 = 0.8;
/// Offsets that are refined: those at which the mean square of the disagreement is no more than this many times that at the
/// best one, and at most `CANDIDATES` of them. The limits are generous, since refining one only costs some time: which of them
/// is right is decided by their likelihoods, see [`BEATS`].
const NEARLY: f64 = 4.0;
const CANDIDATES: usize = 16;
/// A pair is left out beyond this many times the median misfit. For six Gaussian numbers that is eleven standard deviations,
/// where no right pair is; a pair of two different moments is off by the robot's motion in between.
const OUTLIER: f64 = 5.0;
/// Gauss–Newton steps.
const MAX_STEPS: usize = 20;
/// An offset beats another one when the likelihood of a pair is larger on average by this many of its standard errors: by
/// chance once in a thousand (Vuong 1989, "Likelihood ratio tests for model selection and non-nested hypotheses").
const BEATS: f64 = 3.09;
/// A pair counts no more than one that is off by this many standard deviations: one wrong pair among a hundred that are right
/// must not outvote them, and right ones, of which one in 4·10⁷ is as far off, count in full.
const MOST_OFF: f64 = 7.0;

/// Estimates the offset between the clocks of `robot` (anchor_from_mount) and `camera`, when it is within `within_s` seconds of
/// zero.
///
/// # Needs
/// Both while the robot moves: turning about several axes, with changes of speed. A robot that is at rest at every view needs
/// no common clock.
///
/// # Errors
/// [`ClockOffsetError`].
pub fn clock_offset(
    robot: &Stream<Anchor, Mount>,
    camera: &Stream<Camera, Target>,
    within_s: f64,
    cancel: &CancelToken,
) -> Result<ClockOffset, ClockOffsetError> {
    check("robot", robot)?;
    check("camera", camera)?;
    let step_s = 0.5 * spacing(robot).max(spacing(camera));
    let found = candidates(robot, camera, within_s, step_s, cancel);
    if cancel.is_cancelled() {
        return Err(HandEyeError::Cancelled.into());
    }
    if found.is_empty() {
        return Err(ClockOffsetError::Apart { within_s });
    }
    // The same pairs for all of them, so that they can be compared.
    let stays = |index: &usize| {
        let reach = |start_s: &f64| [-2.0, 2.0].map(|by| pose_at(robot, camera[*index].0 + start_s + by * step_s));
        found.iter().flat_map(reach).all(|pose| pose.is_some())
    };
    let inside: Vec<usize> = (0..camera.len()).filter(stays).collect();
    if inside.len() < NEED {
        return Err(ClockOffsetError::Apart { within_s });
    }
    let chosen: Vec<usize> = subset::spread(inside.len(), MOST).into_iter().map(|i| inside[i]).collect();
    let mut refined: Vec<Refined> = Vec::new();
    let mut failure = None;
    for start_s in found {
        match refine(robot, camera, &chosen, start_s, step_s, cancel) {
            Ok(one) => refined.push(one),
            Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled.into()),
            Err(error) => failure = Some(error),
        }
    }
    let deviance = |one: &Refined| one.deviances.iter().sum::<f64>();
    refined.sort_by(|a, b| deviance(a).total_cmp(&deviance(b)));
    let Some(best) = refined.first() else {
        return Err(failure.map_or(ClockOffsetError::Apart { within_s }, ClockOffsetError::HandEye));
    };
    let ClockOffset { offset_s, sigma_s } = best.offset;
    // Within the uncertainty of the offset the motion has not changed.
    if 2.0 * sigma_s >= WINDOW_S {
        return Err(ClockOffsetError::Uncertain { sigma_s });
    }
    let is_other = |other: &&Refined| (other.offset.offset_s - offset_s).abs() > step_s + 3.0 * sigma_s;
    if let Some(second) = refined.iter().find(is_other)
        && !beats(best, second)
    {
        return Err(ClockOffsetError::Ambiguous { first_s: offset_s, second_s: second.offset.offset_s });
    }
    if offset_s.abs() > within_s + step_s {
        return Err(ClockOffsetError::Apart { within_s });
    }
    Ok(best.offset)
}

/// The pose of a stream at a time, interpolated between the two around it with a uniform rotation and a straight
/// motion; `None` outside.
pub fn pose_at<Dst: Copy, Src: Copy>(stream: &Stream<Dst, Src>, time_s: f64) -> Option<Pose<Dst, Src>> {
    let next = stream.partition_point(|(stamp_s, _)| *stamp_s < time_s);
    let (after_s, after) = stream.get(next)?;
    if *after_s == time_s {
        return Some(*after);
    }
    let (before_s, before) = stream.get(next.checked_sub(1)?)?;
    let part = (time_s - before_s) / (after_s - before_s);
    Some(Pose::from_isometry(
        before.isometry().try_lerp_slerp(after.isometry(), part, 1e-9).unwrap_or(*before.isometry()),
    ))
}

fn check<Dst, Src>(whose: &'static str, stream: &Stream<Dst, Src>) -> Result<(), ClockOffsetError> {
    let rises = |pair: &[(f64, Pose<Dst, Src>)]| pair[0].0.is_finite() && pair[1].0 > pair[0].0;
    if let Some(entry) = stream.windows(2).position(|pair| !rises(pair)) {
        return Err(ClockOffsetError::NotRising { whose, entry: entry + 1 });
    }
    if stream.len() < NEED {
        return Err(ClockOffsetError::TooFew { whose, got: stream.len(), need: NEED });
    }
    Ok(())
}

/// Median time between two poses \[s\].
fn spacing<Dst, Src>(stream: &Stream<Dst, Src>) -> f64 {
    median(stream.windows(2).map(|pair| pair[1].0 - pair[0].0)).unwrap_or(0.0)
}

/// Offsets at which the angles of both streams agree best, the best first.
fn candidates(
    robot: &Stream<Anchor, Mount>,
    camera: &Stream<Camera, Target>,
    within_s: f64,
    step_s: f64,
    cancel: &CancelToken,
) -> Vec<f64> {
    let window = ((WINDOW_S / spacing(camera)).round() as usize).clamp(1, camera.len() - 1);
    let starts = subset::spread(camera.len() - window, MOST);
    let seen: Vec<(f64, f64, f64)> = starts
        .into_iter()
        .map(|i| {
            let ((from_s, from), (to_s, to)) = (&camera[i], &camera[i + window]);
            (*from_s, *to_s, from.rotation().angle_to(&to.rotation()))
        })
        .collect();
    let disagreement = |offset_s: f64| -> Option<f64> {
        let mut squares: Vec<f64> = seen
            .iter()
            .filter_map(|(from_s, to_s, angle)| {
                let (from, to) = (pose_at(robot, from_s + offset_s)?, pose_at(robot, to_s + offset_s)?);
                Some((from.rotation().angle_to(&to.rotation()) - angle).powi(2))
            })
            .collect();
        if 2 * squares.len() < seen.len() || squares.len() < NEED / 2 {
            return None;
        }
        squares.sort_by(f64::total_cmp);
        let agreeing = (AGREEING * squares.len() as f64).ceil() as usize;
        Some(squares[..agreeing].iter().sum::<f64>() / agreeing as f64)
    };
    // Beyond these the streams do not overlap.
    let ends = |at: usize, of: usize| robot[at].0 - camera[of].0;
    let low_s = ends(0, camera.len() - 1).max(-within_s);
    let high_s = ends(robot.len() - 1, 0).min(within_s);
    let (first, last) = ((low_s / step_s).floor() as i64, (high_s / step_s).ceil() as i64);
    let of: Vec<Option<f64>> =
        (first..=last).map(|k| if cancel.is_cancelled() { None } else { disagreement(k as f64 * step_s) }).collect();
    let at = |k: usize| of[k].unwrap_or(f64::INFINITY);
    let is_least =
        |k: &usize| (*k == 0 || at(*k) <= at(k - 1)) && (*k + 1 == of.len() || at(*k) < at(k + 1)) && of[*k].is_some();
    let mut least: Vec<usize> = (0..of.len()).filter(is_least).collect();
    least.sort_by(|a, b| at(*a).total_cmp(&at(*b)));
    let limit = least.first().map_or(0.0, |best| NEARLY * at(*best));
    least.into_iter().filter(|k| at(*k) <= limit).take(CANDIDATES).map(|k| (k as i64 + first) as f64 * step_s).collect()
}

struct Refined {
    offset: ClockOffset,
    /// Minus twice the log-likelihood of every pair, without constants.
    deviances: Vec<f64>,
}

fn beats(best: &Refined, other: &Refined) -> bool {
    let gains: Vec<f64> = best.deviances.iter().zip(&other.deviances).map(|(best, other)| other - best).collect();
    let count = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / count;
    let scatter = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / count;
    mean > BEATS * (scatter / count).sqrt()
}

fn refine(
    robot: &Stream<Anchor, Mount>,
    camera: &Stream<Camera, Target>,
    chosen: &[usize],
    start_s: f64,
    step_s: f64,
    cancel: &CancelToken,
) -> Result<Refined, HandEyeError> {
    let pair_at = |index: usize, offset_s: f64| -> Option<PosePair> {
        let (stamp_s, camera_from_target) = camera[index];
        Some(PosePair { anchor_from_mount: pose_at(robot, stamp_s + offset_s)?, camera_from_target })
    };
    let pairs_at = |of: &[usize], offset_s: f64| -> Vec<PosePair> {
        of.iter().filter_map(|index| pair_at(*index, offset_s)).collect()
    };
    let pairs = pairs_at(chosen, start_s);
    let start = begin(&pairs)?;
    let misfits: Vec<f64> = pairs.iter().map(|pair| misfit(pair, &start, 1.0)).collect();
    let limit = OUTLIER * median(misfits.iter().copied()).unwrap_or(f64::INFINITY);
    let kept: Vec<usize> = chosen.iter().zip(&misfits).filter(|(_, m)| **m <= limit).map(|(index, _)| *index).collect();
    let mut solution = pose_graph::refine(&pairs_at(&kept, start_s), &start)?;
    let mut offset = ClockOffset { offset_s: start_s, sigma_s: f64::INFINITY };
    for _ in 0..MAX_STEPS {
        if cancel.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let [before, now, after] = [-0.5 * step_s, 0.0, 0.5 * step_s].map(|by| pairs_at(&kept, offset.offset_s + by));
        if before.len() != kept.len() || after.len() != kept.len() {
            break;
        }
        solution = pose_graph::refine(&now, &of_solution(&solution))?;
        let Some((by, sigma)) = solution.shift(&now, &before, &after) else { break };
        // In units of the time between before and after.
        let by_s = (by * step_s)
            .clamp(-step_s, step_s)
            .clamp(start_s - 1.5 * step_s - offset.offset_s, start_s + 1.5 * step_s - offset.offset_s);
        offset = ClockOffset { offset_s: offset.offset_s + by_s, sigma_s: sigma * step_s };
        if by_s.abs() < 1e-3 * offset.sigma_s {
            break;
        }
    }
    let deviances = solution.deviances(&pairs_at(chosen, offset.offset_s), MOST_OFF);
    Ok(Refined { offset, deviances })
}

fn of_solution(solution: &PoseGraphSolution) -> ClosedFormSolution {
    ClosedFormSolution {
        mount_from_camera: solution.mount_from_camera,
        anchor_from_target: solution.anchor_from_target,
    }
}

fn begin(pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
    let outcomes: Vec<_> = closed_form::all().iter().map(|form| form.solve(pairs)).collect();
    let solved: Vec<ClosedFormSolution> = outcomes.iter().filter_map(|outcome| outcome.clone().ok()).collect();
    let of_view = |solution: &ClosedFormSolution, view: usize, _| misfit(&pairs[view], solution, 1.0);
    consensus(pairs, &solved, &Turns::default(), of_view).map(|found| found.solution).ok_or_else(|| {
        let none =
            HandEyeError::NoSolution { method: pose_graph::METHOD, views: pairs.len(), reason: "no closed form" };
        outcomes.into_iter().find_map(Result::err).unwrap_or(none)
    })
}

#[cfg(test)]
#[path = "clock_offset_tests.rs"]
mod tests;
