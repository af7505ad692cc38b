//! A hypothesis against the views: a robust closed form, what it leaves, and images that contradict it.

use std::borrow::Cow;

use nalgebra::Isometry3;

use super::cases::{Case, Paired};
use super::{EXPLAINED, Sights, TIMES};
use crate::diagnose::doctor::agreement::{self, agreement};
use crate::estimate::handeye::closed_form::ClosedFormSolution;
use crate::estimate::handeye::{Mode, PosePair, subset};
use crate::geometry::frames::Pose;
use crate::geometry::statistics::median;
use crate::project::import::conventions::{Direction, Reading};
use crate::project::import::formats::tree::LEAST_POSES;
use crate::project::import::hypothesis::{Fit, Hypothesis, Source};
use crate::project::import::pairing::{self, Pairing};
use crate::project::import::recording::Recording;
use crate::project::import::settings::Settings;
use crate::project::import::sight::Sight;

/// A view disagrees beyond so many times the median, and beyond this part of the distance.
const DISAGREES: f64 = 5.0;
const DISAGREES_OF_DISTANCE: f64 = 3e-3;
/// And to judge the best of them.
const MOST_VIEWS: usize = 400;

/// What hypotheses are tried with.
pub(super) struct Judge<'a> {
    pub recording: &'a Recording,
    pub sights: &'a Sights,
    pub paired: &'a [Paired],
    pub settings: &'a Settings,
}

/// A pose of the robot with what the camera saw there.
struct View {
    sample: usize,
    image: usize,
    pair: PosePair,
}

impl Judge<'_> {
    fn sight_of(&self, source: Source, target_reading: Option<&(Reading, Direction)>) -> Option<Cow<'_, Sight>> {
        match source {
            Source::Stream(i) => self.sights.streams.get(i)?.as_ref().map(Cow::Borrowed),
            Source::Track(i) => {
                let (reading, direction) = target_reading?;
                let samples = &self.recording.tracks[i].samples;
                let seen = samples.iter().map(|s| Some(direction.of(&reading.transform(&s.numbers)?))).collect();
                Some(Cow::Owned(Sight::of_poses(self.sights.target.as_ref(), seen)))
            }
        }
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
        let view = |(sample, image): (usize, &Option<usize>)| {
            let image = (*image)?;
            let seen = (*sight.seen.get(image)?)?;
            let pair = PosePair {
                anchor_from_mount: Pose::from_isometry(self.anchor_from_mount(case, sample)?),
                camera_from_target: Pose::from_isometry(seen),
            };
            Some(View { sample, image, pair })
        };
        pairing.image_of.iter().enumerate().filter_map(view).collect()
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
        let views = self.views(case, pairing, &sight);
        let chosen: Vec<PosePair> = subset::spread(views.len(), most).into_iter().map(|i| views[i].pair).collect();
        let found = agreement(&sight.outer, &chosen, robust).ok()?;
        Some((found.solution, found.median_m))
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

    fn fit(&self, case: &Case, pairing: &Pairing, sight: &Sight, solution: &ClosedFormSolution) -> (Fit, Vec<String>) {
        let views = self.views(case, pairing, sight);
        let misfits: Vec<(f64, f64)> = views.iter().map(|v| misfit(sight, solution, &v.pair)).collect();
        let median_m = median(misfits.iter().map(|m| m.0)).unwrap_or(f64::INFINITY);
        let median_rad = median(misfits.iter().map(|m| m.1)).unwrap_or(f64::INFINITY);
        let limit = (DISAGREES * median_m).max(DISAGREES_OF_DISTANCE * sight.distance_m);
        let mut disagreeing = Vec::new();
        let mut contradictions = Vec::new();
        for (view, (misfit_m, _)) in views.iter().zip(&misfits) {
            if *misfit_m <= limit {
                continue;
            }
            disagreeing.push((view.sample, *misfit_m));
            if contradictions.len() < 3
                && let Some((other, other_m)) = self.better(case, sight, solution, view, *misfit_m, limit)
            {
                let samples = &self.recording.tracks[case.robot].samples;
                contradictions.push(format!(
                    "{} fits the pose of {} ({:.1} mm) and not that of {} ({:.1} mm)",
                    self.image_name(case.source, view.image),
                    samples[other].place,
                    other_m * 1e3,
                    samples[view.sample].place,
                    misfit_m * 1e3
                ));
            }
        }
        if 3 * disagreeing.len() > views.len() {
            contradictions.push(format!("{} of {} views disagree with the others", disagreeing.len(), views.len()));
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

    fn image_name(&self, source: Source, image: usize) -> String {
        match source {
            Source::Stream(i) => self.recording.streams[i].images[image].shown(),
            Source::Track(i) => self.recording.tracks[i].samples[image].place.clone(),
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

/// How far a solution puts the target from where it was seen, metres and radians; of a target that looks the same after half
/// a turn the nearer of both.
fn misfit(sight: &Sight, solution: &ClosedFormSolution, pair: &PosePair) -> (f64, f64) {
    let chain = solution.mount_from_camera.inverse() * pair.anchor_from_mount.inverse() * solution.anchor_from_target;
    let chain = chain.isometry();
    let seen = *pair.camera_from_target.isometry();
    let of =
        |seen: &Isometry3<f64>| (agreement::misfit(&sight.outer, chain, seen), chain.rotation.angle_to(&seen.rotation));
    let plain = of(&seen);
    match &sight.half_turn {
        Some(turn) => {
            let turned = of(&(seen * turn));
            if turned.0 < plain.0 { turned } else { plain }
        }
        None => plain,
    }
}
