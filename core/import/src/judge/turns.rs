//! Which conventions the turns alone rule out.
//!
//! From one view to another robot and target turn by the same angle, wherever camera and target sit and whichever way the
//! poses map: with `A` of the robot and `C` of the target as the camera sees it, `A_i⁻¹ A_j X = X C_i C_j⁻¹`, and a rotation
//! has the angle of every rotation that it is similar to (Shiu and Ahmad 1989, the rotational part of AX = XB). So all units of
//! length, directions and places of the camera are one case here, and no equations are solved.

use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::UnitQuaternion;

use super::EXPLAINED_RAD;
use super::cases::Case;
use super::trial::Judge;
use crate::conventions::{AngleUnit, Reading, RotationForm};
use crate::hypothesis::Source;
use handeye_estimate::handeye::numbering::Turns;
use handeye_estimate::handeye::subset;

/// Views that are compared, each with each.
const MOST_VIEWS: usize = 20;
/// With this many times the difference of the best a case is not ruled out, so that something is listed where nothing
/// explains.
const NEAR: f64 = 2.0;
/// Of all pairs of views this part decides: half of the views may be wrong.
const PART: f64 = 0.25;

/// Numbers of rotations, whatever else is said of a pose.
type Rotations = (RotationForm, AngleUnit);

fn rotations(reading: &Reading) -> Rotations {
    (reading.rotation, reading.angle)
}

/// The rotations of a series by a reading; `None` where there is none.
type Turned = Rc<Vec<Option<UnitQuaternion<f64>>>>;

/// Rotations that were read already: many cases share them.
struct Read<'a> {
    judge: &'a Judge<'a>,
    of_tracks: HashMap<(usize, Rotations), Turned>,
    of_streams: HashMap<usize, Turned>,
}

impl Read<'_> {
    fn track(&mut self, track: usize, reading: &Reading) -> Turned {
        let samples = &self.judge.recording.tracks[track].samples;
        let read = || samples.iter().map(|sample| Some(reading.transform(&sample.numbers)?.rotation)).collect();
        Rc::clone(self.of_tracks.entry((track, rotations(reading))).or_insert_with(|| Rc::new(read())))
    }

    fn source(&mut self, case: &Case) -> Option<Turned> {
        match (case.source, &case.target_reading) {
            (Source::Track(track), Some((reading, _))) => Some(self.track(track, reading)),
            (Source::Track(_), None) => None,
            (Source::Stream(stream), _) => {
                let sight = self.judge.sights.streams.get(stream)?.as_ref()?;
                let read = || sight.seen.iter().map(|seen| Some(seen.as_ref()?.rotation)).collect();
                Some(Rc::clone(self.of_streams.entry(stream).or_insert_with(|| Rc::new(read()))))
            }
        }
    }

    /// By how much the angles of robot and target differ, radians: that of the better quarter of the pairs of views.
    fn apart_rad(&mut self, case: &Case) -> Option<f64> {
        let (robot, target) = (self.track(case.robot, &case.reading), self.source(case)?);
        let turns = match case.source {
            Source::Stream(stream) => self.judge.sights.streams.get(stream)?.as_ref()?.turns.clone(),
            Source::Track(_) => Turns::default(),
        };
        let view =
            |(sample, image): (usize, &Option<usize>)| Some(((*robot.get(sample)?)?, (*target.get((*image)?)?)?));
        let views: Vec<_> =
            self.judge.paired[case.pairing].pairing.image_of.iter().enumerate().filter_map(view).collect();
        let chosen = subset::spread(views.len(), MOST_VIEWS);
        let mut apart = Vec::with_capacity(chosen.len() * chosen.len() / 2);
        for (i, (robot, seen)) in chosen.iter().map(|i| &views[*i]).enumerate() {
            for (other_robot, other_seen) in chosen[..i].iter().map(|i| &views[*i]) {
                let turned = robot.angle_to(other_robot);
                let ways = turns.quarters().map(|quarters| {
                    let seen = turns.motion(quarters).map_or(*seen, |motion| seen * motion.rotation);
                    (turned - seen.angle_to(other_seen)).abs()
                });
                apart.push(ways.fold(f64::INFINITY, f64::min));
            }
        }
        apart.sort_by(f64::total_cmp);
        apart.get((PART * apart.len() as f64) as usize).copied()
    }
}

/// Keeps the cases in which robot and target turn alike, the most alike where there are more than `most`; how many of them are
/// left out for that alone.
pub(super) fn keep_alike(judge: &Judge<'_>, cases: &mut Vec<Case>, most: usize) -> usize {
    let mut read = Read { judge, of_tracks: HashMap::new(), of_streams: HashMap::new() };
    let mut known: HashMap<(usize, Rotations, Option<Rotations>), f64> = HashMap::new();
    for case in cases.iter_mut() {
        if judge.cancel.is_cancelled() {
            return 0;
        }
        let target = case.target_reading.as_ref().map(|(reading, _)| rotations(reading));
        let key = (case.pairing, rotations(&case.reading), target);
        case.apart_rad = *known.entry(key).or_insert_with(|| read.apart_rad(case).unwrap_or(f64::INFINITY));
    }
    let best = cases.iter().map(|case| case.apart_rad).fold(f64::INFINITY, f64::min);
    // Without anything to compare nothing is ruled out.
    let limit = if best.is_finite() { (NEAR * best).max(EXPLAINED_RAD) } else { f64::INFINITY };
    cases.retain(|case| case.apart_rad <= limit);
    let left_out = cases.len().saturating_sub(most);
    if left_out > 0 {
        cases.sort_by(|a, b| a.apart_rad.total_cmp(&b.apart_rad));
        cases.truncate(most);
    }
    left_out
}
