//! A case against the views: what it leaves, and images that contradict it.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::rc::Rc;

use nalgebra::Isometry3;

use super::Sights;
use super::cases::{Case, Paired};
use super::field_of_view;
use super::own_poses::{self, PoseOwner};
use crate::conventions::{Direction, Reading};
use crate::formats::tree::LEAST_POSES;
use crate::hypothesis::{Fit, Hypothesis, Source};
use crate::pairing::{self, Pairing};
use crate::recording::{Recording, Role, Sample};
use crate::settings::Settings;
use crate::sight::Sight;
use handeye_estimate::diagnose::hypotheses::agreement::chain;
use handeye_estimate::diagnose::hypotheses::pairing::aligned;
use handeye_estimate::diagnose::hypotheses::{self, EXPLAINED, EXPLAINED_RAD, Hypothesis as _, SeenTarget, rules_out};
use handeye_estimate::handeye::closed_form::ClosedFormSolution;
use handeye_estimate::handeye::{Mode, PosePair};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median;
use handeye_geometry::targets::{AprilGrid, AprilTag, TargetSpec};
use handeye_wording::text;
use handeye_wording::{Text, Value};

/// A view disagrees beyond this many times the median, and beyond this part of the distance.
const DISAGREES: f64 = 5.0;
const DISAGREES_OF_DISTANCE: f64 = 3e-3;
/// Views by which the best are judged.
const MOST_VIEWS: usize = 400;
/// Views that disagree for which a pose that fits better is searched among all.
const MOST_LOOKED_FOR: usize = 50;

/// Views of a source, by how its poses were read where they are a series.
type SightsRead = HashMap<(Source, Option<(Reading, Direction)>), Rc<Sight>>;

/// Shared data for trying hypotheses.
pub(super) struct Judge<'a> {
    pub recording: &'a Recording,
    pub sights: &'a Sights,
    pub paired: &'a [Paired],
    pub settings: &'a Settings,
    pub cancel: &'a CancelToken,
    /// Views of sources that were read already: many cases share them.
    pub read: RefCell<SightsRead>,
    /// Series whose poses were found to be a camera's own, and why: they are not a robot's for any other camera either.
    pub own: RefCell<BTreeMap<usize, Text>>,
}

/// A case in a pairing, with what the camera saw.
pub(super) struct Trial<'a> {
    case: &'a Case,
    samples: &'a [Sample],
    sight: Rc<Sight>,
    /// Poses of the series whose image shows the target, by their places, and that image.
    seen: Vec<(usize, usize)>,
}

/// A pose of the robot with what the camera saw there.
struct View {
    sample: usize,
    image: usize,
    pair: PosePair,
}

impl Trial<'_> {
    /// A pose of the series with what an image shows.
    fn pair_of(&self, sample: usize, image: usize) -> Option<PosePair> {
        let written = self.case.reading.transform(&self.samples.get(sample)?.numbers)?;
        Some(PosePair {
            anchor_from_mount: Pose::from_isometry(self.case.class.of(&written)),
            camera_from_target: Pose::from_isometry((*self.sight.seen.get(image)?)?),
        })
    }

    fn all_views(&self) -> Vec<View> {
        let view = |&(sample, image): &(usize, usize)| Some(View { sample, image, pair: self.pair_of(sample, image)? });
        self.seen.iter().filter_map(view).collect()
    }

    /// Distance of the target of an image by a solution and a pose of the series from where it was seen, metres.
    fn misfit_at(&self, solution: &ClosedFormSolution, sample: usize, image: usize) -> Option<f64> {
        Some(self.sight.target.misfit(solution, &self.pair_of(sample, image)?).0)
    }

    /// A pose that an image fits better than its own.
    fn better(&self, solution: &ClosedFormSolution, view: &View, own_m: f64, limit: f64) -> Option<(usize, f64)> {
        let others = (0..self.samples.len()).filter(|sample| *sample != view.sample);
        let of = |sample: usize| Some((sample, self.misfit_at(solution, sample, view.image)?));
        let best = others.filter_map(of).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 <= limit && rules_out(best.1, own_m)).then_some(best)
    }
}

impl hypotheses::Hypothesis for Trial<'_> {
    fn target(&self) -> &SeenTarget {
        &self.sight.target
    }

    fn views(&self) -> usize {
        self.seen.len()
    }

    fn pair(&self, view: usize) -> Option<PosePair> {
        let (sample, image) = self.seen[view];
        self.pair_of(sample, image)
    }
}

impl Judge<'_> {
    fn sight_of(&self, source: Source, target_reading: Option<(Reading, Direction)>) -> Option<Rc<Sight>> {
        let mut known = self.read.borrow_mut();
        if let Some(sight) = known.get(&(source, target_reading)) {
            return Some(Rc::clone(sight));
        }
        let sight = match source {
            Source::Stream(i) => self.sights.streams.get(i)?.clone()?,
            Source::Track(i) => {
                let (reading, direction) = target_reading?;
                let samples = &self.recording.tracks[i].samples;
                let seen = samples.iter().map(|s| Some(direction.of(&reading.transform(&s.numbers)?))).collect();
                Sight::of_poses(self.sights.target.as_ref(), seen)
            }
        };
        let sight = Rc::new(sight);
        known.insert((source, target_reading), Rc::clone(&sight));
        Some(sight)
    }

    pub fn sight_distance(&self, h: &Hypothesis) -> f64 {
        self.sight_of(h.source, h.target_reading).map_or(0.0, |sight| sight.target.distance_m)
    }

    pub fn pairing_of(&self, case: &Case) -> &Pairing {
        &self.paired[case.pairing].pairing
    }

    /// A case in a pairing; `None` where the camera saw nothing.
    pub fn trial<'b>(&'b self, case: &'b Case, pairing: &Pairing) -> Option<Trial<'b>> {
        let sight = self.sight_of(case.source, case.target_reading)?;
        let of = |(sample, image): (usize, &Option<usize>)| {
            image.filter(|image| matches!(sight.seen.get(*image), Some(Some(_)))).map(|image| (sample, image))
        };
        let seen = pairing.image_of.iter().enumerate().filter_map(of).collect();
        Some(Trial { case, samples: &self.recording.tracks[case.robot].samples, sight, seen })
    }

    /// The target of a hypothesis, and its views without those that disagree.
    pub fn agreeing(&self, h: &Hypothesis) -> Option<(SeenTarget, Vec<PosePair>)> {
        let case = Case::of(h);
        let trial = self.trial(&case, &h.pairing)?;
        let disagrees =
            |sample: usize| h.fit.as_ref().is_some_and(|fit| fit.disagreeing.iter().any(|(it, _)| *it == sample));
        let views = trial.all_views().into_iter().filter(|view| !disagrees(view.sample));
        Some((trial.sight.target.clone(), views.map(|view| view.pair).collect()))
    }

    /// The name of the target's size.
    pub fn size_of_target(&self, scale: f64) -> Option<Text> {
        let mm = |length_m: f64| format!("{:.2}", length_m * scale * 1e3);
        Some(match self.sights.target? {
            TargetSpec::Chessboard(grid) => text!("squares of {mm} mm", mm = mm(grid.square_m)),
            TargetSpec::Charuco(board) => text!("squares of {mm} mm", mm = mm(board.square_m)),
            TargetSpec::Circles(grid) | TargetSpec::AsymmetricCircles(grid) => {
                text!("dots {mm} mm apart", mm = mm(grid.square_m))
            }
            TargetSpec::AprilGrid(AprilGrid { tag_m, .. }) | TargetSpec::AprilTag(AprilTag { tag_m, .. }) => {
                text!("tags of {mm} mm", mm = mm(tag_m))
            }
        })
    }

    /// A case with all its views, under each of its names.
    pub fn judged(&self, case: &Case) -> Vec<Hypothesis> {
        self.judged_paired(case, self.pairing_of(case))
    }

    fn judged_paired(&self, case: &Case, pairing: &Pairing) -> Vec<Hypothesis> {
        let fit = self.trial(case, pairing).and_then(|trial| {
            let solution = trial.solve(MOST_VIEWS, true).ok()?.solution;
            Some(self.fit(&trial, &solution))
        });
        let (fit, contradictions) = fit.map_or((None, Vec::new()), |(fit, why)| (Some(fit), why));
        let one = |(mode, direction): &(Mode, Direction)| Hypothesis {
            source: case.source,
            robot: case.robot,
            pairing: pairing.clone(),
            reading: case.reading,
            direction: *direction,
            target_reading: case.target_reading,
            mode: *mode,
            fit: fit.clone(),
            same_as: Vec::new(),
            contradictions: contradictions.clone(),
        };
        case.labels.iter().map(one).collect()
    }

    fn fit(&self, trial: &Trial<'_>, solution: &ClosedFormSolution) -> (Fit, Vec<Text>) {
        let (case, target) = (trial.case, &trial.sight.target);
        let views = trial.all_views();
        let misfits: Vec<(f64, f64)> = views.iter().map(|view| target.misfit(solution, &view.pair)).collect();
        let median_m = median(misfits.iter().map(|m| m.0)).unwrap_or(f64::INFINITY);
        let median_rad = median(misfits.iter().map(|m| m.1)).unwrap_or(f64::INFINITY);
        let limit = disagrees_m(median_m, target);
        let mut disagreeing = Vec::new();
        let is_near = median_m < EXPLAINED * target.distance_m && median_rad < EXPLAINED_RAD;
        let own = is_near.then(|| self.own_poses(trial, solution, &views)).flatten();
        let mut contradictions: Vec<Text> = own.into_iter().collect();
        let agrees = |sample: usize| {
            views.iter().zip(&misfits).any(|(view, (misfit_m, _))| view.sample == sample && *misfit_m <= limit)
        };
        for (view, (misfit_m, _)) in views.iter().zip(&misfits) {
            if *misfit_m <= limit {
                continue;
            }
            disagreeing.push((view.sample, *misfit_m));
            // Views that were exchanged or shifted leave the other pose without its image. Where that has it, this view's own
            // pose is wrong, or its image a copy: one view less, without consequence for the others.
            if contradictions.len() < 3
                && disagreeing.len() <= MOST_LOOKED_FOR
                && let Some((other, other_m)) = trial.better(solution, view, *misfit_m, limit)
                && !agrees(other)
            {
                contradictions.push(text!(
                    "{image} fits the pose of {other} ({other_mm} mm) and not that of {own} ({own_mm} mm)",
                    image = self.image_name(case.source, view.image),
                    other = &*trial.samples[other].place,
                    other_mm = format!("{:.1}", other_m * 1e3),
                    own = &*trial.samples[view.sample].place,
                    own_mm = format!("{:.1}", misfit_m * 1e3)
                ));
            }
        }
        if 3 * disagreeing.len() > views.len() {
            contradictions.push(text!(
                "{off} of {views} views disagree with the others",
                off = disagreeing.len(),
                views = views.len()
            ));
        }
        let fit = Fit {
            median_m,
            relative: median_m / target.distance_m,
            median_rad,
            views: views.len(),
            disagreeing,
            camera_at_m: solution.mount_from_camera.translation().norm(),
            target_at_m: solution.anchor_from_target.translation().norm(),
        };
        (fit, contradictions)
    }

    /// The reason, if these poses are those of a camera and not of a robot.
    fn own_poses(&self, trial: &Trial<'_>, solution: &ClosedFormSolution, views: &[View]) -> Option<Text> {
        let (case, sight) = (trial.case, &*trial.sight);
        let over_noise = |view: &View| {
            // However the target was counted: its numbers do not affect the noise.
            let covariance = sight.covariances.get(view.image).filter(|_| sight.target.turns.is_empty())?.as_ref()?;
            own_poses::over_noise(&chain(solution, &view.pair), view.pair.camera_from_target.isometry(), covariance)
        };
        let over_noise: Vec<f64> = views.iter().filter_map(over_noise).collect();
        let of = self.source_name(case.source);
        let track = &self.recording.tracks[case.robot];
        match own_poses::whose(sight, solution, &over_noise)? {
            PoseOwner::Camera => {
                let why = text!(
                    "these poses are the camera's own poses, computed from the target in {of} as calibrateCamera and solvePnP do \
                     (the target in the camera, or the camera as seen from the target), and none of a robot",
                    of = of
                );
                self.own.borrow_mut().insert(case.robot, why.clone());
                Some(why)
            }
            // A user who names the series has decided whose it is, and so has a file that names it the robot's. With a single
            // camera and neutral names the base may be the target's frame.
            PoseOwner::OtherCamera => {
                let cameras = self.recording.streams.iter().filter(|stream| !stream.is_depth).count();
                let may_be = matches!(case.source, Source::Track(_)) || cameras > 1;
                (may_be && track.role == Role::Unknown && self.settings.poses.is_none()).then(|| {
                    text!(
                        "these poses are in the frame of the target that {of} shows, as another camera's own poses of it are, and \
                         none of a robot; if they are a robot's, say --set poses={series}",
                        of = of,
                        series = &track.name
                    )
                })
            }
        }
    }

    /// Contradicts every hypothesis with a series that was found to be a camera's own.
    pub fn contradict_own_poses(&self, hypotheses: &mut [Hypothesis]) {
        let tracks = &self.recording.tracks;
        let own = self.own.borrow();
        let is_reading = |a: usize, b: usize| tracks[a].reading_of.as_ref() == Some(&tracks[b].name);
        for h in hypotheses {
            let is_same = |track: usize| track == h.robot || is_reading(track, h.robot) || is_reading(h.robot, track);
            let Some((_, why)) = own.iter().find(|(track, _)| is_same(**track)) else { continue };
            if !h.contradictions.contains(why) {
                h.contradictions.insert(0, why.clone());
            }
        }
    }

    /// Contradicts hypotheses that put a recorded target where no lens sees it, where another one explains the recording and does
    /// not: a marker's frame need not be that of a lens, so this alone proves nothing.
    pub fn contradict_outside(&self, hypotheses: &mut [Hypothesis]) {
        let outside = |h: &Hypothesis| {
            let case = Case::of(h);
            let views = self.trial(&case, &h.pairing)?.all_views();
            let seen: Vec<Isometry3<f64>> = views.iter().map(|view| *view.pair.camera_from_target.isometry()).collect();
            field_of_view::outside(&seen)
        };
        let is_recorded = |h: &Hypothesis| matches!(h.source, Source::Track(_));
        let found: Vec<Option<Text>> = hypotheses.iter().map(|h| outside(h).filter(|_| is_recorded(h))).collect();
        let is_seen = |(h, why): (&Hypothesis, &Option<Text>)| is_recorded(h) && h.explains() && why.is_none();
        if hypotheses.iter().zip(&found).any(is_seen) {
            for (h, why) in hypotheses.iter_mut().zip(found) {
                h.contradictions.extend(why);
            }
        }
    }

    fn source_name(&self, source: Source) -> &str {
        match source {
            Source::Stream(i) => &self.recording.streams[i].name,
            Source::Track(i) => &self.recording.tracks[i].name,
        }
    }

    fn image_name(&self, source: Source, image: usize) -> Value {
        match source {
            Source::Stream(i) => self.recording.streams[i].images[image].shown().into(),
            Source::Track(i) => Value::from(&*self.recording.tracks[i].samples[image].place),
        }
    }

    /// The best hypotheses in order with gaps where the images show them.
    pub fn mended(&self, hypotheses: &[Hypothesis]) -> Vec<Hypothesis> {
        const MOST: usize = 1000;
        let mut out: Vec<Hypothesis> = Vec::new();
        let wants = |h: &&Hypothesis| {
            !h.contradictions.is_empty()
                && self.settings.pairing.as_deref().is_none_or(|rule| rule == "aligned")
                && h.fit.as_ref().is_some_and(|fit| fit.relative < EXPLAINED)
        };
        for h in hypotheses.iter().filter(wants).take(4) {
            let mut case = Case::of(h);
            let mut pairing = h.pairing.clone();
            for _ in 0..2 {
                let Some(trial) = self.trial(&case, &pairing) else { break };
                let (poses, images) = (trial.samples.len(), trial.sight.seen.len());
                if poses > MOST || images > MOST {
                    break;
                }
                let Ok(found) = trial.solve(MOST_VIEWS, true) else { break };
                let leave_out = disagrees_m(found.median_m, &trial.sight.target);
                let cost = |sample: usize, image: usize| match trial.sight.seen.get(image) {
                    Some(Some(_)) => trial.misfit_at(&found.solution, sample, image).unwrap_or(f64::INFINITY),
                    // An image without the target does not contradict a pose.
                    _ => 1.5 * leave_out,
                };
                pairing = pairing::by_content(aligned(poses, images, leave_out, cost));
            }
            if pairing.count() < LEAST_POSES || pairing.image_of == h.pairing.image_of {
                continue;
            }
            case.labels = vec![(h.mode, h.direction)];
            out.extend(self.judged_paired(&case, &pairing));
        }
        out
    }
}

/// Misfit beyond which a view disagrees, metres.
fn disagrees_m(median_m: f64, target: &SeenTarget) -> f64 {
    (DISAGREES * median_m).max(DISAGREES_OF_DISTANCE * target.distance_m)
}
