//! The open conventions of a recording, as cases for the engine of
//! [`hypotheses`](handeye_estimate::diagnose::hypotheses), and the objections to those that explain the views.
//!
//! Poses that map the other way with the camera in the other place give the same equations, so no data distinguish them.
//! Both are listed; the one that puts the camera nearer to what carries it than the target is comes first.

mod cases;
mod field_of_view;
mod own_poses;
mod scale;
mod trial;
mod turns;

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use super::error::ImportError;
use super::formats::tree::LEAST_POSES;
use super::hypothesis::{Hypothesis, Source};
use super::recording::{Recording, Sample};
use super::settings::Settings;
use super::sight::Sight;
use handeye_estimate::diagnose::hypotheses::{self, Score, Search, Verdict, ranked, sort_by_misfit};
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Camera, Frame, Pose, Target, Tip};
use handeye_geometry::progress::{CancelToken, Work};
use handeye_geometry::targets::TargetSpec;
use trial::Judge;

/// Views that are used to sort hypotheses.
const MOST_QUICK: usize = 20;
/// Hypotheses whose equations are solved, and of those the ones that may leave views out, which takes some ten times as long.
/// A recording of one robot has some hundreds of either; this many take some seconds.
const MOST_SOLVED: usize = 5000;
const MOST_ROBUST: usize = 500;
/// Hypotheses that are judged thoroughly.
const MOST_JUDGED: usize = 40;
/// Hypotheses that are kept for the list.
const MOST_LISTED: usize = 24;
/// Within this factor two hypotheses explain the same, and the more common one comes first: a median of a dozen views is not
/// more accurate.
const TIE: f64 = 1.25;
/// Poses of two series that differ by less than this [m, rad] are copies of each other, rounded otherwise.
const COPY: f64 = 1e-4;

/// What was seen in each source: corners for streams, poses for series.
#[derive(Debug, Default)]
pub struct Sights {
    /// Views of [`Recording::streams`], where the target was found.
    pub streams: Vec<Option<Sight>>,
    /// The target, where it is known.
    pub target: Option<TargetSpec>,
}

/// All hypotheses and what follows.
#[derive(Debug)]
pub struct Judgement {
    /// The best first.
    pub hypotheses: Vec<Hypothesis>,
    /// Number of hypotheses that were tried.
    pub tried: usize,
    /// Number of further ones that were not tried: more than can be distinguished. Naming the series reduces them.
    pub untried: usize,
    /// Number of pairs of a robot series and a source that were not tried.
    pub sources_untried: usize,
    /// Median distance of the target from the camera under the best, metres.
    pub distance_m: f64,
    /// The conclusion.
    pub verdict: Verdict,
}

impl Judgement {
    /// Whether only the place of the camera is open, which no data show: the same files, pairing and numbers explain the
    /// recording in both places.
    pub fn is_open_in_mode_alone(&self) -> bool {
        match self.hypotheses.as_slice() {
            [a, b, ..] if self.verdict == Verdict::Ambiguous(2) => {
                a.mode != b.mode
                    && (a.source, a.robot, a.reading, a.target_reading)
                        == (b.source, b.robot, b.reading, b.target_reading)
                    && a.pairing.image_of == b.pairing.image_of
            }
            _ => false,
        }
    }
}

/// Tries every hypothesis that the files and the settings leave open.
///
/// # Errors
/// [`ImportError::NoPoses`] without a series to try, [`ImportError::NothingLeft`] where settings exclude all,
/// [`ImportError::BadChoice`] for an unknown name, [`ImportError::NoViews`] where nothing has a solution.
pub fn judge(
    recording: &Recording,
    sights: &Sights,
    settings: &Settings,
    cancel: &CancelToken,
) -> Result<Judgement, ImportError> {
    let (paired, sources_untried) = cases::sources(recording, sights, settings)?;
    let (mut cases, mut untried) = cases::cases(recording, &paired, settings);
    if cases.is_empty() {
        return Err(ImportError::NothingLeft("these settings"));
    }
    let (read, own) = (RefCell::default(), RefCell::default());
    let judge = Judge { recording, sights, paired: &paired, settings, cancel, read, own };
    let tried = cases.len();
    untried += turns::keep_alike(&judge, &mut cases, MOST_SOLVED);
    let search = Search {
        most_views: MOST_QUICK,
        most_robust: MOST_ROBUST,
        unlike_rad: &|index| cases[index].unlike_rad,
        as_stated: None,
    };
    let trial = |index: usize| judge.trial(&cases[index], judge.pairing_of(&cases[index]));
    let quick = ranked(cases.len(), trial, &search, &Work::from(cancel));
    let mut chosen: Vec<usize> = quick.iter().take(MOST_JUDGED).map(|it| it.index).collect();
    // The best of every pairing is worth a look, whatever else is better.
    for number in 0..paired.len() {
        if chosen.len() >= 2 * MOST_JUDGED {
            break;
        }
        if let Some(it) = quick.iter().find(|it| cases[it.index].pairing == number)
            && !chosen.contains(&it.index)
        {
            chosen.push(it.index);
        }
    }
    let mut hypotheses: Vec<Hypothesis> =
        chosen.iter().take_while(|_| !cancel.is_cancelled()).flat_map(|i| judge.judged(&cases[*i])).collect();
    if hypotheses.iter().all(|h| h.fit.is_none()) && !cancel.is_cancelled() {
        if let Some(stood) = cases::did_not_move(recording, &paired, settings) {
            return Err(stood);
        }
        return Err(ImportError::NoViews { folder: recording.root.clone(), need: LEAST_POSES });
    }
    sort(recording, &mut hypotheses);
    let mended = judge.mended(&hypotheses);
    hypotheses.extend(mended);
    judge.contradict_own_poses(&mut hypotheses);
    judge.contradict_outside(&mut hypotheses);
    merge_equal(recording, &mut hypotheses);
    scale::contradict(&judge, &mut hypotheses);
    sort(recording, &mut hypotheses);
    hypotheses.truncate(MOST_LISTED);
    let distance_m = hypotheses.first().map_or(0.0, |h| judge.sight_distance(h));
    let verdict = verdict_on(&mut hypotheses);
    Ok(Judgement { hypotheses, tried, untried, sources_untried, distance_m, verdict })
}

fn verdict_on(found: &mut [Hypothesis]) -> Verdict {
    // Those that explain come first, also before a better fit that is contradicted.
    found.sort_by_key(|h| !h.explains());
    let score = |h: &Hypothesis| Score {
        misfit: misfit(h),
        views: h.fit.as_ref().map_or(0, |fit| fit.views),
        explains: h.explains(),
    };
    let scores: Vec<Score> = found.iter().map(score).collect();
    match hypotheses::verdict(&scores) {
        // A pairing by image content depends on the answer itself.
        Verdict::Decided if found[0].pairing.is_by_content => Verdict::Ambiguous(1),
        verdict => verdict,
    }
}

/// The misfit of a hypothesis, infinite without a solution.
fn misfit(h: &Hypothesis) -> f64 {
    h.fit.as_ref().map_or(f64::INFINITY, |fit| fit.relative)
}

/// How uncommon a hypothesis is; smaller is more common.
fn rarity(recording: &Recording, h: &Hypothesis) -> (usize, usize, usize, usize, usize) {
    // Which of the two places of the camera is more likely.
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
    let views = |h: &Hypothesis| h.fit.as_ref().map_or(0, |fit| fit.views);
    sort_by_misfit(hypotheses, TIE, misfit, |h| (rarity(recording, h), Reverse(views(h))));
}

/// Hypotheses that give the same poses are one; what the others are called is kept.
fn merge_equal(recording: &Recording, hypotheses: &mut Vec<Hypothesis>) {
    let mut out: Vec<Hypothesis> = Vec::new();
    for h in hypotheses.drain(..) {
        let same = out.iter_mut().find(|known| {
            known.mode == h.mode && sees_the_same(recording, known, &h) && poses_are_equal(recording, known, &h)
        });
        match same {
            Some(known) if known.robot != h.robot || known.source != h.source => {
                let (of, from) = (&recording.tracks[h.robot].name, h.target_series(recording));
                let name = from.map_or_else(|| of.clone(), |from| format!("{of} with {from}"));
                if !known.same_as.contains(&name) {
                    known.same_as.push(name);
                }
            }
            Some(known) if known.reading == h.reading && known.direction == h.direction => {}
            Some(known) => known.same_as.push(h.reading.rotation.to_string()),
            None => out.push(h),
        }
    }
    *hypotheses = out;
}

/// Whether what the camera saw is the same: the same images, or poses of the target that are the same numbers or copies.
fn sees_the_same(recording: &Recording, a: &Hypothesis, b: &Hypothesis) -> bool {
    if a.source == b.source {
        return a.target_reading == b.target_reading;
    }
    let (Source::Track(of_a), Source::Track(of_b)) = (a.source, b.source) else { return false };
    let (of_a, of_b) = (&recording.tracks[of_a].samples, &recording.tracks[of_b].samples);
    let seen =
        |h: &Hypothesis, sample: &Sample| h.camera_from_target(sample).map(Pose::<Camera, Target>::from_isometry);
    of_a.len() == of_b.len()
        && of_a.iter().zip(of_b).all(|(of_a, of_b)| are_equal(seen(a, of_a), seen(b, of_b), (COPY, COPY)))
}

/// Whether every image has the same pose of the robot under both, however and wherever it is written.
fn poses_are_equal(recording: &Recording, a: &Hypothesis, b: &Hypothesis) -> bool {
    let by_image = |h: &Hypothesis| -> BTreeMap<usize, Option<Pose<Base, Tip>>> {
        let samples = &recording.tracks[h.robot].samples;
        let pose = |(sample, image): (usize, &Option<usize>)| Some(((*image)?, h.base_from_tip(samples.get(sample)?)));
        h.pairing.image_of.iter().enumerate().filter_map(pose).collect()
    };
    let is_same_series = a.robot == b.robot;
    if is_same_series && a.pairing.image_of != b.pairing.image_of {
        return false;
    }
    let within = if is_same_series { (1e-9, 1e-7) } else { (COPY, COPY) };
    let (of_a, of_b) = (by_image(a), by_image(b));
    of_a.len() == of_b.len()
        && of_a.iter().zip(&of_b).all(|((image_a, a), (image_b, b))| image_a == image_b && are_equal(*a, *b, within))
}

/// Whether two poses are the same within metres and radians, or both are absent.
fn are_equal<A: Frame, B: Frame>(a: Option<Pose<A, B>>, b: Option<Pose<A, B>>, within: (f64, f64)) -> bool {
    let Some((a, b)) = a.zip(b) else { return a.is_none() && b.is_none() };
    let (metres, radians) = a.distance_to(&b);
    metres < within.0 && radians < within.1
}
