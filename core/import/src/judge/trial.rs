//! A hypothesis against the views: a robust closed form, what it leaves, and images that contradict it.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::ops::Deref;
use std::rc::Rc;

use nalgebra::Isometry3;

use super::cases::{Case, Paired};
use super::field_of_view;
use super::own_poses::{self, Whose};
use super::{EXPLAINED, EXPLAINED_RAD, Sights, TIMES};
use crate::conventions::{Direction, Reading};
use crate::formats::tree::LEAST_POSES;
use crate::hypothesis::{Fit, Hypothesis, Source};
use crate::pairing::{self, Pairing};
use crate::recording::{Recording, Role};
use crate::settings::Settings;
use crate::sight::Sight;
use handeye_estimate::diagnose::doctor::agreement::{self, agreement};
use handeye_estimate::handeye::closed_form::ClosedFormSolution;
use handeye_estimate::handeye::numbering::alike;
use handeye_estimate::handeye::{Mode, PosePair, subset};
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median;
use handeye_geometry::targets::{AprilGrid, AprilTag, TargetSpec};
use handeye_wording::text;
use handeye_wording::{Text, Value};

/// A view disagrees beyond so many times the median, and beyond this part of the distance.
const DISAGREES: f64 = 5.0;
const DISAGREES_OF_DISTANCE: f64 = 3e-3;
/// And to judge the best of them.
const MOST_VIEWS: usize = 400;
/// Views that disagree for which a pose that fits better is looked for among all.
const MOST_LOOKED_FOR: usize = 50;
/// Views by which the size of the target is looked at.
const MOST_SCALED: usize = 30;

/// What hypotheses are tried with.
pub(super) struct Judge<'a> {
    pub recording: &'a Recording,
    pub sights: &'a Sights,
    pub paired: &'a [Paired],
    pub settings: &'a Settings,
    pub cancel: &'a CancelToken,
    /// Series of the target that were read already: many cases share them.
    pub read: RefCell<HashMap<(usize, Reading, Direction), Rc<Sight>>>,
    /// Series of which it was found that their poses are a camera's own, and why: no robot's for any other camera either.
    pub own: RefCell<BTreeMap<usize, Text>>,
}

/// What the camera saw.
enum SightOf<'a> {
    Images(&'a Sight),
    Series(Rc<Sight>),
}

impl Deref for SightOf<'_> {
    type Target = Sight;

    fn deref(&self) -> &Sight {
        match self {
            Self::Images(sight) => sight,
            Self::Series(sight) => sight,
        }
    }
}

/// A pose of the robot with what the camera saw there.
struct View {
    sample: usize,
    image: usize,
    pair: PosePair,
}

impl Judge<'_> {
    fn sight_of(&self, source: Source, target_reading: Option<&(Reading, Direction)>) -> Option<SightOf<'_>> {
        let (track, (reading, direction)) = match source {
            Source::Stream(i) => return self.sights.streams.get(i)?.as_ref().map(SightOf::Images),
            Source::Track(i) => (i, *target_reading?),
        };
        let read = || {
            let samples = &self.recording.tracks[track].samples;
            let seen = samples.iter().map(|s| Some(direction.of(&reading.transform(&s.numbers)?))).collect();
            Rc::new(Sight::of_poses(self.sights.target.as_ref(), seen))
        };
        let mut known = self.read.borrow_mut();
        Some(SightOf::Series(Rc::clone(known.entry((track, reading, direction)).or_insert_with(read))))
    }

    pub fn distance_of(&self, case: &Case) -> f64 {
        self.sight_of(case.source, case.target_reading.as_ref()).map_or(0.0, |sight| sight.distance_m)
    }

    pub fn sight_distance(&self, h: &Hypothesis) -> f64 {
        self.sight_of(h.source, h.target_reading.as_ref()).map_or(0.0, |sight| sight.distance_m)
    }

    fn anchor_from_mount(&self, case: &Case, sample: usize) -> Option<Isometry3<f64>> {
        let sample = self.recording.tracks[case.robot].samples.get(sample)?;
        Some(case.class.of(&case.reading.transform(&sample.numbers)?))
    }

    fn views(&self, case: &Case, pairing: &Pairing, sight: &Sight) -> Vec<View> {
        let view = |(sample, image): (usize, &Option<usize>)| self.view(case, sight, sample, (*image)?);
        pairing.image_of.iter().enumerate().filter_map(view).collect()
    }

    fn view(&self, case: &Case, sight: &Sight, sample: usize, image: usize) -> Option<View> {
        let pair = PosePair {
            anchor_from_mount: Pose::from_isometry(self.anchor_from_mount(case, sample)?),
            camera_from_target: Pose::from_isometry((*sight.seen.get(image)?)?),
        };
        Some(View { sample, image, pair })
    }

    /// A solution and its median misfit.
    pub fn solve(&self, case: &Case, most: usize, robust: bool) -> Option<(ClosedFormSolution, f64)> {
        self.solve_paired(case, &self.paired[case.pairing].pairing, most, robust)
    }

    fn solve_paired(
        &self,
        case: &Case,
        pairing: &Pairing,
        most: usize,
        robust: bool,
    ) -> Option<(ClosedFormSolution, f64)> {
        let sight = self.sight_of(case.source, case.target_reading.as_ref())?;
        let is_seen = |image: usize| matches!(sight.seen.get(image), Some(Some(_)));
        let seen: Vec<(usize, usize)> = pairing
            .image_of
            .iter()
            .enumerate()
            .filter_map(|(sample, image)| image.filter(|image| is_seen(*image)).map(|image| (sample, image)))
            .collect();
        let chosen = subset::spread(seen.len(), most).into_iter().map(|i| seen[i]);
        let chosen: Vec<PosePair> =
            chosen.filter_map(|(sample, image)| Some(self.view(case, &sight, sample, image)?.pair)).collect();
        let found = agreement(&sight.outer, &alike(&chosen, &sight.turns), robust).ok()?;
        Some((found.solution, found.median_m))
    }

    /// What is left at the median where the target is so many times as large, by the size that was said, metres.
    pub fn misfit_of_scaled(&self, h: &Hypothesis, scale: f64) -> Option<f64> {
        let case = Case::of(h);
        let sight = self.sight_of(h.source, h.target_reading.as_ref())?;
        let views = self.views(&case, &h.pairing, &sight);
        let is_wrong =
            |sample: usize| h.fit.as_ref().is_some_and(|fit| fit.disagreeing.iter().any(|(it, _)| *it == sample));
        let right: Vec<&View> = views.iter().filter(|view| !is_wrong(view.sample)).collect();
        let chosen: Vec<PosePair> =
            subset::spread(right.len(), MOST_SCALED).into_iter().map(|i| right[i].pair).collect();
        let scaled = |pair: PosePair| {
            let mut seen = *pair.camera_from_target.isometry();
            seen.translation.vector *= scale;
            PosePair { camera_from_target: Pose::from_isometry(seen), ..pair }
        };
        let pairs: Vec<PosePair> = alike(&chosen, &sight.turns).into_iter().map(scaled).collect();
        let outer = sight.outer.map(|point| point * scale);
        Some(agreement(&outer, &pairs, false).ok()?.median_m / scale)
    }

    /// What the size of the target would be called.
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
        self.judged_paired(case, &self.paired[case.pairing].pairing)
    }

    fn judged_paired(&self, case: &Case, pairing: &Pairing) -> Vec<Hypothesis> {
        let sight = self.sight_of(case.source, case.target_reading.as_ref());
        let solution = self.solve_paired(case, pairing, MOST_VIEWS, true).map(|(solution, _)| solution);
        let judged = sight.zip(solution).map(|(sight, solution)| self.fit(case, pairing, &sight, &solution));
        let (fit, contradictions) = judged.map_or((None, Vec::new()), |(fit, why)| (Some(fit), why));
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

    fn fit(&self, case: &Case, pairing: &Pairing, sight: &Sight, solution: &ClosedFormSolution) -> (Fit, Vec<Text>) {
        let views = self.views(case, pairing, sight);
        let misfits: Vec<(f64, f64)> = views.iter().map(|v| misfit(sight, solution, &v.pair)).collect();
        let median_m = median(misfits.iter().map(|m| m.0)).unwrap_or(f64::INFINITY);
        let median_rad = median(misfits.iter().map(|m| m.1)).unwrap_or(f64::INFINITY);
        let limit = (DISAGREES * median_m).max(DISAGREES_OF_DISTANCE * sight.distance_m);
        let mut disagreeing = Vec::new();
        let is_near = median_m < EXPLAINED * sight.distance_m && median_rad < EXPLAINED_RAD;
        let own = is_near.then(|| self.own_poses(case, sight, solution, &views)).flatten();
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
            // pose is wrong, or its image a copy: one view less, which says nothing of the others.
            if contradictions.len() < 3
                && disagreeing.len() <= MOST_LOOKED_FOR
                && let Some((other, other_m)) = self.better(case, sight, solution, view, *misfit_m, limit)
                && !agrees(other)
            {
                let samples = &self.recording.tracks[case.robot].samples;
                contradictions.push(text!(
                    "{image} fits the pose of {other} ({other_mm} mm) and not that of {own} ({own_mm} mm)",
                    image = self.image_name(case.source, view.image),
                    other = &*samples[other].place,
                    other_mm = format!("{:.1}", other_m * 1e3),
                    own = &*samples[view.sample].place,
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
            relative: median_m / sight.distance_m,
            median_rad,
            views: views.len(),
            disagreeing,
            camera_at_m: solution.mount_from_camera.translation().norm(),
            target_at_m: solution.anchor_from_target.translation().norm(),
        };
        (fit, contradictions)
    }

    /// That these poses are those of a camera, and none of a robot.
    fn own_poses(&self, case: &Case, sight: &Sight, solution: &ClosedFormSolution, views: &[View]) -> Option<Text> {
        let over_noise = |view: &View| {
            // However the target was counted: its numbers say nothing of the noise.
            let covariance = sight.covariances.get(view.image).filter(|_| sight.turns.is_empty())?.as_ref()?;
            own_poses::over_noise(&chain(solution, &view.pair), view.pair.camera_from_target.isometry(), covariance)
        };
        let over_noise: Vec<f64> = views.iter().filter_map(over_noise).collect();
        let of = self.source_name(case.source);
        let track = &self.recording.tracks[case.robot];
        match own_poses::whose(sight, solution, &over_noise)? {
            Whose::Camera => {
                let why = text!(
                    "these poses are the camera's own poses, computed from the target in {of} as calibrateCamera and solvePnP do \
                     (the target in the camera, or the camera as seen from the target), and none of a robot",
                    of = of
                );
                self.own.borrow_mut().insert(case.robot, why.clone());
                Some(why)
            }
            // A person who names the series has said whose it is, and so has a file that calls it the robot's. Of one camera alone
            // with neutral names the base may be the target's frame.
            Whose::OtherCamera => {
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
    /// not: a marker's frame need not be that of a lens, so that alone it says nothing.
    pub fn contradict_outside(&self, hypotheses: &mut [Hypothesis]) {
        let outside = |h: &Hypothesis| {
            let case = Case::of(h);
            let sight = self.sight_of(h.source, h.target_reading.as_ref())?;
            let views = self.views(&case, &h.pairing, &sight);
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

    /// A pose that an image fits better than its own.
    fn better(
        &self,
        case: &Case,
        sight: &Sight,
        solution: &ClosedFormSolution,
        view: &View,
        own_m: f64,
        limit: f64,
    ) -> Option<(usize, f64)> {
        let count = self.recording.tracks[case.robot].samples.len();
        let of = |sample: usize| {
            let anchor_from_mount = Pose::from_isometry(self.anchor_from_mount(case, sample)?);
            let (misfit_m, _) = misfit(sight, solution, &PosePair { anchor_from_mount, ..view.pair });
            Some((sample, misfit_m))
        };
        let best = (0..count).filter(|s| *s != view.sample).filter_map(of).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 <= limit && TIMES * best.1 < own_m).then_some(best)
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
            let Some(sight) = self.sight_of(h.source, h.target_reading.as_ref()) else { continue };
            let samples = self.recording.tracks[h.robot].samples.len();
            let images = sight.seen.len();
            if samples > MOST || images > MOST {
                continue;
            }
            let mut case = Case::of(h);
            let mut pairing = h.pairing.clone();
            for _ in 0..2 {
                let Some((solution, median_m)) = self.solve_paired(&case, &pairing, MOST_VIEWS, true) else { break };
                let leave_out = (DISAGREES * median_m).max(DISAGREES_OF_DISTANCE * sight.distance_m);
                let cost = |sample: usize, image: usize| {
                    // An image without the target says nothing against a pose.
                    let Some(Some(seen)) = sight.seen.get(image) else { return 1.5 * leave_out };
                    let Some(pose) = self.anchor_from_mount(&case, sample) else { return f64::INFINITY };
                    let pair = PosePair {
                        anchor_from_mount: Pose::from_isometry(pose),
                        camera_from_target: Pose::from_isometry(*seen),
                    };
                    misfit(&sight, &solution, &pair).0
                };
                pairing = pairing::aligned(samples, images, leave_out, cost);
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

/// Where a solution puts the target as the camera sees it.
fn chain(solution: &ClosedFormSolution, pair: &PosePair) -> Isometry3<f64> {
    let chain = solution.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * solution.anchor_from_target;
    *chain.isometry()
}

/// How far a solution puts the target from where it was seen, metres and radians; of a target that looks the same after a
/// turn in the nearest way to count it.
fn misfit(sight: &Sight, solution: &ClosedFormSolution, pair: &PosePair) -> (f64, f64) {
    let chain = chain(solution, pair);
    let seen = *pair.camera_from_target.isometry();
    let of = |seen: &Isometry3<f64>| {
        (agreement::misfit(&sight.outer, &chain, seen), chain.rotation.angle_to(&seen.rotation))
    };
    let ways = std::iter::once(seen).chain(sight.turns.others(&seen)).map(|seen| of(&seen));
    // The first of equals, which is as it was detected.
    ways.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, f64::INFINITY))
}
