//! The hypotheses about a recording, tried against what the camera saw.
//!
//! Under each of them closed forms are solved, and the distance between where the chain puts the target and where it was seen
//! is measured on the camera's side in metres, so that it means the same under all of them: as the [doctor](crate::diagnose::doctor)
//! does with gross faults.
//!
//! Poses that map the other way with the camera in the other place give the same equations, so no data tell them apart. Both
//! are listed; the one that puts the camera nearer to what carries it than the target is comes first.

use nalgebra::Isometry3;

use super::conventions::{AngleUnit, Direction, LengthUnit, Reading, RotationForm, angles_for, lengths_for};
use super::error::ImportError;
use super::hypothesis::{Fit, Hypothesis, Source};
use super::pairing::{self, Pairing, pairings};
use super::recording::{ImageFile, Numbers, Recording, Role, Sample, Stated, Track};
use super::settings::Settings;
use super::sight::Sight;
use crate::diagnose::doctor::agreement::{self, agreement};
use crate::estimate::handeye::closed_form::ClosedFormSolution;
use crate::estimate::handeye::{Mode, PosePair, subset};
use crate::geometry::frames::Pose;
use crate::geometry::statistics::median;
use crate::progress::CancelToken;
use crate::targets::TargetSpec;

/// A hypothesis that explains the views leaves less than this part of the target's distance.
pub(super) const EXPLAINED: f64 = 0.05;
/// And another one is ruled out when it leaves so many times more.
pub const TIMES: f64 = 3.0;
/// Views with which hypotheses can be told apart: with three any of them fits.
pub const NEED: usize = 4;
/// A view disagrees beyond so many times the median, and beyond this part of the distance.
const DISAGREES: f64 = 5.0;
const DISAGREES_OF_DISTANCE: f64 = 3e-3;
/// A hypothesis that leaves less than this part of the target's distance needs no second look at the others.
const CLEAR: f64 = 0.01;
/// Views that are looked at to sort hypotheses.
const MOST_QUICK: usize = 20;
/// And to judge the best of them.
const MOST_VIEWS: usize = 400;
/// Hypotheses that are judged thoroughly.
const MOST_JUDGED: usize = 40;
/// Hypotheses that are kept for the list.
const MOST_LISTED: usize = 24;
/// Targets are not seen from nearer or farther than this, metres.
const NEAREST_M: f64 = 0.03;
const FARTHEST_M: f64 = 20.0;
/// Within this factor two hypotheses explain the same, and the commoner one comes first.
const TIE: f64 = 1.05;

/// What was seen in each source: streams by their corners, series by themselves.
#[derive(Debug, Default)]
pub struct Sights {
    /// Of [`Recording::streams`], where the target was found.
    pub streams: Vec<Option<Sight>>,
    /// The target, where it is known.
    pub target: Option<TargetSpec>,
}

/// All hypotheses and what follows.
#[derive(Debug)]
pub struct Judgement {
    /// The best first.
    pub hypotheses: Vec<Hypothesis>,
    /// How many were tried.
    pub tried: usize,
    /// Median distance of the target from the camera under the best, metres.
    pub distance_m: f64,
    /// What follows.
    pub verdict: Verdict,
}

/// What follows from the hypotheses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The first is the only one that explains the views.
    Decided,
    /// The first so many explain them about as well: a person has to say which it is.
    Ambiguous(usize),
    /// None explains them.
    Unexplained,
}

/// A hypothesis as it is tried: both places of the camera that give its equations are one.
struct Case {
    source: Source,
    robot: usize,
    pairing: usize,
    reading: Reading,
    target_reading: Option<(Reading, Direction)>,
    /// `anchor_from_mount` is what is written, or its inverse.
    class: Direction,
    /// The places of the camera and the directions that mean it.
    labels: Vec<(Mode, Direction)>,
}

impl Case {
    /// The case of a hypothesis, without its pairing.
    fn of(h: &Hypothesis) -> Self {
        let class = match (h.mode, h.direction) {
            (Mode::EyeInHand, direction) => direction,
            (Mode::EyeToHand, Direction::Forward) => Direction::Inverse,
            (Mode::EyeToHand, Direction::Inverse) => Direction::Forward,
        };
        Self {
            source: h.source,
            robot: h.robot,
            pairing: 0,
            reading: h.reading,
            target_reading: h.target_reading,
            class,
            labels: Vec::new(),
        }
    }
}

/// A way to pair a source with a series.
struct Paired {
    source: Source,
    robot: usize,
    pairing: Pairing,
}

/// Tries every hypothesis that the files and the settings leave open.
///
/// # Errors
/// [`ImportError::NoPoses`] without a series to try, [`ImportError::NothingLeft`] where settings exclude all,
/// [`ImportError::BadChoice`] for a name that there is not.
pub fn judge(
    recording: &Recording,
    sights: &Sights,
    settings: &Settings,
    cancel: &CancelToken,
) -> Result<Judgement, ImportError> {
    let paired = sources(recording, sights, settings)?;
    let cases = cases(recording, &paired, settings);
    if cases.is_empty() {
        return Err(ImportError::NothingLeft("these settings".into()));
    }
    let judge = Judge { recording, sights, paired: &paired, settings };
    let tried = cases.len();
    let mut quick: Vec<(f64, usize)> = Vec::with_capacity(tried);
    for robust in [false, true] {
        // A pairing of which a part is wrong spoils a plain solution: then each hypothesis is given the chance to leave
        // views out.
        quick.clear();
        for (i, case) in cases.iter().enumerate() {
            if cancel.is_cancelled() {
                break;
            }
            let fit = judge.solve(case, MOST_QUICK, robust).map(|(_, median_m)| median_m / judge.distance_of(case));
            quick.push((fit.unwrap_or(f64::INFINITY), i));
        }
        quick.sort_by(|a, b| a.0.total_cmp(&b.0));
        let best = quick.first().map_or(f64::INFINITY, |(fit, _)| *fit);
        if best < CLEAR {
            break;
        }
    }
    let mut chosen: Vec<usize> = quick.iter().take(MOST_JUDGED).map(|(_, i)| *i).collect();
    // The best of every pairing is worth a look, whatever else is better.
    for number in 0..paired.len() {
        if let Some((_, i)) = quick.iter().find(|(_, i)| cases[*i].pairing == number)
            && !chosen.contains(i)
        {
            chosen.push(*i);
        }
    }
    let mut hypotheses: Vec<Hypothesis> = chosen.iter().flat_map(|i| judge.judged(&cases[*i])).collect();
    sort(recording, &mut hypotheses);
    let mended = judge.mended(&hypotheses);
    hypotheses.extend(mended);
    merge_equal(recording, &mut hypotheses);
    sort(recording, &mut hypotheses);
    hypotheses.truncate(MOST_LISTED);
    let distance_m = hypotheses.first().map_or(0.0, |h| judge.sight_distance(h));
    let verdict = verdict(&mut hypotheses);
    Ok(Judgement { hypotheses, tried, distance_m, verdict })
}

fn verdict(hypotheses: &mut [Hypothesis]) -> Verdict {
    // Those that explain come first, also before a better fit that is contradicted.
    hypotheses.sort_by_key(|h| !h.explains());
    let alone = hypotheses.len() == 1;
    let Some(best) = hypotheses.first().filter(|best| best.explains()) else { return Verdict::Unexplained };
    let (limit, views) = best.fit.as_ref().map_or((0.0, 0), |fit| (TIMES * fit.relative.max(1e-4), fit.views));
    let is_near =
        |h: &&Hypothesis| h.explains() && h.fit.as_ref().is_some_and(|fit| fit.relative <= limit || fit.views < NEED);
    let near = hypotheses.iter().take_while(is_near).count();
    // With too few views to tell hypotheses apart, all of them are open. What was paired by what the images show rests on
    // the answer itself.
    if near == 1 && !best.pairing.is_by_content && (views >= NEED || alone) {
        Verdict::Decided
    } else {
        Verdict::Ambiguous(near)
    }
}

/// How common something is; fewer is commoner.
fn rarity(recording: &Recording, h: &Hypothesis) -> (usize, usize, usize, usize, usize) {
    // Which of the two places of the camera is the likelier one.
    let far = h.fit.as_ref().is_some_and(|fit| (fit.camera_at_m < fit.target_at_m) != (h.mode == Mode::EyeInHand));
    let numbers = recording.tracks[h.robot].samples.first().map(|s| s.numbers);
    let forms = numbers.map(|n| RotationForm::all_for(&n)).unwrap_or_default();
    let rotation = forms.iter().position(|form| *form == h.reading.rotation).unwrap_or(99);
    let unit = LengthUnit::ALL.iter().position(|unit| *unit == h.reading.length).unwrap_or(9);
    let angle = usize::from(h.reading.angle == AngleUnit::Degree);
    (
        usize::from(h.pairing.is_by_content),
        usize::from(far),
        unit + angle,
        usize::from(h.direction == Direction::Inverse),
        rotation,
    )
}

fn sort(recording: &Recording, hypotheses: &mut [Hypothesis]) {
    let median_of = |h: &Hypothesis| h.fit.as_ref().map_or(f64::INFINITY, |fit| fit.relative);
    hypotheses.sort_by(|a, b| {
        median_of(a).total_cmp(&median_of(b)).then_with(|| rarity(recording, a).cmp(&rarity(recording, b)))
    });
    // Runs of equals, each measured by its first.
    let mut start = 0;
    while start < hypotheses.len() {
        let limit = TIE * median_of(&hypotheses[start]) + 1e-7;
        let end = start + hypotheses[start..].iter().take_while(|h| median_of(h) <= limit).count().max(1);
        hypotheses[start..end].sort_by(|a, b| {
            let views = |h: &Hypothesis| h.fit.as_ref().map_or(0, |fit| fit.views);
            (rarity(recording, a), views(b)).cmp(&(rarity(recording, b), views(a)))
        });
        start = end;
    }
}

/// Hypotheses that give the same poses are one; what the others are called is kept.
fn merge_equal(recording: &Recording, hypotheses: &mut Vec<Hypothesis>) {
    let mut out: Vec<Hypothesis> = Vec::new();
    for h in hypotheses.drain(..) {
        let same = out.iter_mut().find(|known| {
            known.source == h.source
                && known.robot == h.robot
                && known.mode == h.mode
                && known.pairing.image_of == h.pairing.image_of
                && known.target_reading == h.target_reading
                && recording.tracks[h.robot].samples.iter().all(|sample| {
                    match (known.base_from_tip(sample), h.base_from_tip(sample)) {
                        (Some(a), Some(b)) => {
                            let (metres, radians) = a.distance_to(&b);
                            metres < 1e-9 && radians < 1e-7
                        }
                        (a, b) => a.is_none() && b.is_none(),
                    }
                })
        });
        match same {
            Some(known) if known.reading == h.reading && known.direction == h.direction => {}
            Some(known) => known.same_as.push(h.reading.rotation.to_string()),
            None => out.push(h),
        }
    }
    *hypotheses = out;
}

/// Every pair of a series of the robot and a source of the target, in every pairing.
fn sources(recording: &Recording, sights: &Sights, settings: &Settings) -> Result<Vec<Paired>, ImportError> {
    let named = |name: &Option<String>, key: &str, of: Vec<&str>| match name {
        Some(name) if !of.contains(&name.as_str()) => Err(ImportError::BadChoice {
            key: key.into(),
            value: name.clone(),
            choices: if of.is_empty() { "there are none".into() } else { of.join(", ") },
        }),
        _ => Ok(()),
    };
    let track_names: Vec<&str> = recording.tracks.iter().map(|t| t.name.as_str()).collect();
    named(&settings.poses, "poses", track_names.clone())?;
    named(&settings.target_poses, "target_poses", track_names)?;
    named(&settings.images, "images", recording.streams.iter().map(|s| s.name.as_str()).collect())?;
    let is_wanted = |name: &str, wanted: &Option<String>| wanted.as_deref().is_none_or(|wanted| wanted == name);
    let robots = |track: &Track| {
        let named = settings.poses.is_some() && is_wanted(&track.name, &settings.poses);
        named || (track.role != Role::Target && settings.poses.is_none())
    };
    let mut out = Vec::new();
    let mut rules = Vec::new();
    let mut pair = |source: Source, robot: usize, images: &[ImageFile]| {
        for pairing in pairings(&recording.tracks[robot].samples, images, super::formats::tree::LEAST_POSES) {
            rules.push(pairing.rule.clone());
            // What is found by its content is made after the others.
            if settings.pairing.as_deref().is_none_or(|rule| rule == pairing.rule || rule == "aligned") {
                out.push(Paired { source, robot, pairing });
            }
        }
    };
    let with_images = settings.target_poses.is_none() && sights.streams.iter().any(Option::is_some);
    for robot in (0..recording.tracks.len()).filter(|i| robots(&recording.tracks[*i])) {
        if with_images {
            for (i, stream) in recording.streams.iter().enumerate() {
                if sights.streams.get(i).is_some_and(Option::is_some) && is_wanted(&stream.name, &settings.images) {
                    pair(Source::Stream(i), robot, &stream.images);
                }
            }
            continue;
        }
        for (i, target) in recording.tracks.iter().enumerate() {
            let is_target = if settings.target_poses.is_some() {
                is_wanted(&target.name, &settings.target_poses)
            } else {
                target.role != Role::Robot || settings.poses.is_some()
            };
            if i != robot && is_target {
                pair(Source::Track(i), robot, &as_images(target));
            }
        }
    }
    if out.is_empty() {
        if let Some(rule) = settings.pairing.as_ref().filter(|rule| !rules.contains(rule) && !rules.is_empty()) {
            let choices = rules.join(", ");
            return Err(ImportError::BadChoice { key: "pairing".into(), value: rule.clone(), choices });
        }
        let seen = if recording.tracks.is_empty() {
            "no file has poses of 6, 7, 12 or 16 numbers".to_owned()
        } else if with_images {
            "none of the series of poses has as many as images".to_owned()
        } else {
            format!(
                "there are poses in {}, and neither images in which a target was found nor poses of a target beside them",
                recording.tracks.iter().map(|t| t.name.as_str()).take(5).collect::<Vec<_>>().join(", ")
            )
        };
        let need = super::formats::tree::LEAST_POSES;
        return Err(ImportError::NoPoses { folder: recording.root.clone(), need, seen });
    }
    Ok(out)
}

/// Poses of a target stand for the images that they were found in.
pub(super) fn as_images(track: &Track) -> Vec<ImageFile> {
    let image = |(i, sample): (usize, &Sample)| ImageFile {
        // In the order of the series, whatever they are called.
        path: sample.image.clone().unwrap_or_else(|| format!("{:06}", i + 1)).into(),
        number: sample.number,
        same_as: None,
    };
    track.samples.iter().enumerate().map(image).collect()
}

/// Largest magnitudes of lengths and of angles in a series.
fn largest(track: &Track) -> (f64, f64) {
    let mut out = (0.0f64, 0.0f64);
    for sample in &track.samples {
        let (lengths, angles): (Vec<f64>, Vec<f64>) = match &sample.numbers {
            Numbers::Angles(n) => (n[..3].to_vec(), n[3..].to_vec()),
            Numbers::Quaternion(n) => (n[..3].to_vec(), Vec::new()),
            Numbers::Matrix(m) => ((0..3).map(|i| m[(i, 3)]).collect(), Vec::new()),
        };
        out.0 = lengths.into_iter().map(f64::abs).fold(out.0, f64::max);
        out.1 = angles.into_iter().map(f64::abs).fold(out.1, f64::max);
    }
    out
}

/// What the numbers of a series may mean.
fn readings(
    track: &Track,
    length: Option<LengthUnit>,
    angle: Option<AngleUnit>,
    rotation: Option<RotationForm>,
) -> Vec<Reading> {
    let Some(first) = track.samples.first() else { return Vec::new() };
    let (largest_length, largest_angle) = largest(track);
    let Stated { length: said_length, angle: said_angle, rotation: said_rotation, .. } = &track.stated;
    // A person knows better than a file.
    let lengths = match (length, said_length) {
        (Some(unit), _) => vec![unit],
        (None, Some(known)) => vec![known.value],
        (None, None) => lengths_for(largest_length),
    };
    let forms = match (rotation, said_rotation) {
        (Some(form), _) => vec![form],
        (None, Some(known)) => known.value.clone(),
        (None, None) => RotationForm::all_for(&first.numbers),
    };
    let mut out = Vec::new();
    for form in forms {
        let angles = match (angle, said_angle, form.has_angles()) {
            (_, _, false) => vec![AngleUnit::Radian],
            (Some(unit), ..) => vec![unit],
            (None, Some(known), true) => vec![known.value],
            (None, None, true) => angles_for(largest_angle),
        };
        for angle in angles {
            for length in &lengths {
                let reading = Reading { length: *length, angle, rotation: form };
                if reading.transform(&first.numbers).is_some() {
                    out.push(reading);
                }
            }
        }
    }
    out
}

fn cases(recording: &Recording, paired: &[Paired], settings: &Settings) -> Vec<Case> {
    let mut out = Vec::new();
    for (number, pair) in paired.iter().enumerate() {
        let track = &recording.tracks[pair.robot];
        let mut robot_readings = readings(track, settings.length, settings.angle, settings.rotation);
        if matches!(pair.source, Source::Track(_)) {
            robot_readings = without_centimetres(robot_readings);
        }
        let target_readings: Vec<Option<(Reading, Direction)>> = match pair.source {
            Source::Stream(_) => vec![None],
            Source::Track(i) => target_readings(&recording.tracks[i], settings).into_iter().map(Some).collect(),
        };
        for class in Direction::ALL {
            let labels = labels(recording, track, class, settings);
            if labels.is_empty() {
                continue;
            }
            for reading in &robot_readings {
                for target_reading in &target_readings {
                    out.push(Case {
                        source: pair.source,
                        robot: pair.robot,
                        pairing: number,
                        reading: *reading,
                        target_reading: *target_reading,
                        class,
                        labels: labels.clone(),
                    });
                }
            }
        }
    }
    out
}

/// When both sides are in one unit no data tell which it is, and nobody has recorded both in centimetres: only where it is
/// the one that is left.
fn without_centimetres(readings: Vec<Reading>) -> Vec<Reading> {
    let is_other = |reading: &Reading| reading.length != LengthUnit::Centimetre;
    if readings.iter().any(is_other) { readings.into_iter().filter(is_other).collect() } else { readings }
}

fn target_readings(track: &Track, settings: &Settings) -> Vec<(Reading, Direction)> {
    let readings = readings(track, settings.target_length, None, settings.target_rotation);
    let mut readings = without_centimetres(readings);
    readings.retain(|reading| {
        let distances = track.samples.iter().filter_map(|s| reading.transform(&s.numbers));
        let distance_m = median(distances.map(|pose| pose.translation.vector.norm()));
        distance_m.is_some_and(|distance_m| (NEAREST_M..FARTHEST_M).contains(&distance_m))
    });
    // Poses of a target are written by programs, which have vectors, quaternions and matrices, and seldom angles.
    if readings.len() > 12 {
        use super::conventions::Euler;
        let common = [RotationForm::Vector, RotationForm::Euler(Euler::RPY), RotationForm::Euler(Euler::KUKA)];
        readings.retain(|reading| common.contains(&reading.rotation));
    }
    let directions = match (settings.target_direction, &track.stated.direction) {
        (Some(direction), _) => vec![direction],
        (None, Some(known)) => vec![known.value],
        (None, None) => Direction::ALL.to_vec(),
    };
    directions.iter().flat_map(|d| readings.iter().map(move |r| (*r, *d))).collect()
}

/// The places of the camera and the directions that give these equations and that nothing rules out.
fn labels(recording: &Recording, track: &Track, class: Direction, settings: &Settings) -> Vec<(Mode, Direction)> {
    let other = match class {
        Direction::Forward => Direction::Inverse,
        Direction::Inverse => Direction::Forward,
    };
    let mode = settings.mode.or(recording.mode.as_ref().map(|known| known.value));
    let allowed = |(place, direction): &(Mode, Direction)| {
        let by_mode = mode.is_none_or(|mode| mode == *place);
        let by_direction = match (settings.direction, &track.stated.direction, &track.stated.direction_in) {
            (Some(set), ..) => set == *direction,
            (None, Some(known), _) => known.value == *direction,
            (None, None, Some(known)) => known.value.contains(&(*place, *direction)),
            (None, None, None) => true,
        };
        by_mode && by_direction
    };
    [(Mode::EyeInHand, class), (Mode::EyeToHand, other)].into_iter().filter(allowed).collect()
}

struct Judge<'a> {
    recording: &'a Recording,
    sights: &'a Sights,
    paired: &'a [Paired],
    settings: &'a Settings,
}

/// A pose of the robot with what the camera saw there.
struct View {
    sample: usize,
    image: usize,
    pair: PosePair,
}

impl Judge<'_> {
    fn sight_of(
        &self,
        source: Source,
        target_reading: Option<&(Reading, Direction)>,
    ) -> Option<std::borrow::Cow<'_, Sight>> {
        match source {
            Source::Stream(i) => self.sights.streams.get(i)?.as_ref().map(std::borrow::Cow::Borrowed),
            Source::Track(i) => {
                let (reading, direction) = target_reading?;
                let samples = &self.recording.tracks[i].samples;
                let seen = samples.iter().map(|s| Some(direction.of(&reading.transform(&s.numbers)?))).collect();
                Some(std::borrow::Cow::Owned(Sight::of_poses(self.sights.target.as_ref(), seen)))
            }
        }
    }

    fn distance_of(&self, case: &Case) -> f64 {
        self.sight_of(case.source, case.target_reading.as_ref()).map_or(0.0, |sight| sight.distance_m)
    }

    fn sight_distance(&self, h: &Hypothesis) -> f64 {
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
    fn solve(&self, case: &Case, most: usize, robust: bool) -> Option<(ClosedFormSolution, f64)> {
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
    fn judged(&self, case: &Case) -> Vec<Hypothesis> {
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
    fn mended(&self, hypotheses: &[Hypothesis]) -> Vec<Hypothesis> {
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
            if pairing.count() < super::formats::tree::LEAST_POSES || pairing.image_of == h.pairing.image_of {
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
