//! The hypotheses about a recording, tried against what the camera saw.
//!
//! Under each of them closed forms are solved, and the distance between where the chain puts the target and where it was seen
//! is measured on the camera's side in metres, so that it means the same under all of them: as the [doctor](crate::diagnose::doctor)
//! does with gross faults.
//!
//! Poses that map the other way with the camera in the other place give the same equations, so no data tell them apart. Both
//! are listed; the one that puts the camera nearer to what carries it than the target is comes first.

mod cases;
mod trial;

use super::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use super::error::ImportError;
use super::hypothesis::Hypothesis;
use super::recording::Recording;
use super::settings::Settings;
use super::sight::Sight;
use crate::estimate::handeye::Mode;
use crate::progress::CancelToken;
use crate::targets::TargetSpec;
use trial::Judge;

/// A hypothesis that explains the views leaves less than this part of the target's distance.
pub(in crate::project::import) const EXPLAINED: f64 = 0.05;
/// And another one is ruled out when it leaves so many times more.
pub const TIMES: f64 = 3.0;
/// Views with which hypotheses can be told apart: with three any of them fits.
pub const NEED: usize = 4;
/// A hypothesis that leaves less than this part of the target's distance needs no second look at the others.
const CLEAR: f64 = 0.01;
/// Views that are looked at to sort hypotheses.
const MOST_QUICK: usize = 20;
/// Hypotheses that are judged thoroughly.
const MOST_JUDGED: usize = 40;
/// Hypotheses that are kept for the list.
const MOST_LISTED: usize = 24;
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
    let paired = cases::sources(recording, sights, settings)?;
    let cases = cases::cases(recording, &paired, settings);
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
