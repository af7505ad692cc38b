//! Sessions of one camera separately and with a shared lens: errors relative to the truth, coverage, and agreement.
//!
//!     cargo run --release -p handeye_studies --example shared_lens -- 100 3 10
//!
//! draws this many groups of this many sessions of this many views each (eye in hand, corners 0.1 px, robot 0.1 mm and 0.02°,
//! nine unknown lens parameters) through the whole path of `calibrate`, and prints Markdown. All sessions of a group have the
//! same hand-eye transform, which the estimator does not know. One row each for a lens of the model, for one that the model
//! does not fit (waves of 0.1 px across the image, the same in all), and for a last session with 1 % more focal length.

use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Calibration, calibrate, examine};
use handeye_estimate::handeye::Mode;
use handeye_estimate::shared_lens::{NamedSession, calibrate_sharing_lens};
use handeye_estimate::{CameraKnowledge, Method, Observations, Options};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{REALISTIC, Session, camera, trial};
use rayon::prelude::*;

/// A mild barrel lens, as in the Monte-Carlo study.
const DISTORTION: Distortion = Distortion::BrownConrady([-0.08, 0.05, 0.0006, -0.0004, -0.01]);
/// Amplitude of the deviation from the lens model, pixels.
const WAVE_PX: f64 = 0.1;
/// Length of its waves, pixels.
const WAVE_LENGTH_PX: f64 = 300.0;
/// Focal length of the session that was zoomed over that of the others.
const ZOOM: f64 = 1.01;

/// The camera of a row.
#[derive(Clone, Copy, PartialEq)]
enum Lens {
    Model,
    Waves,
    Zoomed,
}

impl Lens {
    fn name(self) -> &'static str {
        match self {
            Self::Model => "of the model",
            Self::Waves => "waves of 0.1 px",
            Self::Zoomed => "last zoomed by 1 %",
        }
    }
}

/// One answer compared with the truth.
struct Answer {
    /// Estimated minus true reference point, metres.
    off_m: nalgebra::Vector3<f64>,
    stated_m: f64,
}

/// One group, separately and shared.
struct Group {
    own: Vec<Answer>,
    shared: Vec<Answer>,
    p_value: f64,
    odd: usize,
    last_alone_is_odd: bool,
}

fn session(lens: Lens, views: usize, is_last: bool, seed: u64) -> (Session, Observations) {
    let focal_px = if lens == Lens::Zoomed && is_last { camera().fx * ZOOM } else { camera().fx };
    let intrinsics = Intrinsics { distortion: DISTORTION, fx: focal_px, fy: focal_px, ..camera() };
    let mut trial = trial(Mode::EyeInHand, views, &REALISTIC, intrinsics, seed);
    if lens == Lens::Waves {
        trial.add_waves(WAVE_PX, WAVE_LENGTH_PX);
    }
    let observations = Observations { camera: CameraKnowledge::NOTHING, ..trial.observations(true) };
    (trial, observations)
}

/// `None` if nothing is stated.
fn answer(trial: &Session, calibration: &Calibration) -> Option<Answer> {
    let point = calibration.joint.as_ref()?.reference_point;
    let found = calibration.hand_eye?.mount_from_camera();
    let off_m = found.isometry() * point - trial.mount_from_camera.isometry() * point;
    Some(Answer { off_m, stated_m: calibration.tip_error_95_m()? })
}

fn group(lens: Lens, sessions: usize, views: usize, number: usize) -> Result<Group, String> {
    let cancel = CancelToken::default();
    let seed = |k: usize| (number * sessions + k) as u64 + 1;
    let drawn: Vec<_> = (0..sessions).map(|k| session(lens, views, k + 1 == sessions, seed(k))).collect();
    let names: Vec<String> = (0..sessions).map(|k| k.to_string()).collect();
    let own = drawn.iter().map(|(trial, observations)| {
        let found = calibrate(observations, Method::Joint, &cancel).map_err(|e| e.to_string())?;
        answer(trial, &found).ok_or_else(|| "nothing is stated".to_owned())
    });
    let own = own.collect::<Result<Vec<_>, String>>()?;
    let named: Vec<_> =
        names.iter().zip(&drawn).map(|(name, (_, observations))| NamedSession { name, observations }).collect();
    let found = calibrate_sharing_lens(&named, Options::default(), &cancel).map_err(|e| e.to_string())?;
    let lens = found[0].shared_lens.clone().ok_or("no shared lens")?;
    let shared = drawn.iter().zip(found).map(|((trial, observations), fit)| {
        let found = examine(observations, fit, &FindingOptions::default(), &cancel).map_err(|e| e.to_string())?;
        answer(trial, &found).ok_or_else(|| "nothing is stated".to_owned())
    });
    let last_alone_is_odd = lens.odd.len() == 1 && lens.odd[0].name == names[sessions - 1];
    let shared = shared.collect::<Result<Vec<_>, _>>()?;
    Ok(Group { own, shared, p_value: lens.p_value, odd: lens.odd.len(), last_alone_is_odd })
}

fn percent(part: usize, of: usize) -> f64 {
    100.0 * part as f64 / of as f64
}

/// RMS error \[mm\], mean stated error \[mm\], share that is covered and share of pairs that cover each other.
fn columns<'a>(groups: &(impl Iterator<Item = &'a Vec<Answer>> + Clone)) -> String {
    let all = || groups.clone().flatten();
    let count = all().count();
    let rms = (all().map(|a| a.off_m.norm_squared()).sum::<f64>() / count as f64).sqrt() * 1e3;
    let stated = all().map(|a| a.stated_m).sum::<f64>() / count as f64 * 1e3;
    let covered = percent(all().filter(|a| a.off_m.norm() <= a.stated_m).count(), count);
    let (mut agree, mut pairs) = (0, 0);
    for group in groups.clone() {
        for (i, a) in group.iter().enumerate() {
            for b in &group[..i] {
                pairs += 1;
                agree += usize::from((a.off_m - b.off_m).norm() <= a.stated_m.hypot(b.stated_m));
            }
        }
    }
    format!("{rms:.3} | {stated:.3} | {covered:.1} | {:.1}", percent(agree, pairs))
}

fn main() -> Result<(), String> {
    let numbers: Vec<usize> = std::env::args()
        .skip(1)
        .map(|word| word.parse().map_err(|_not_a_number| format!("{word:?} is not a number")))
        .collect::<Result<_, String>>()?;
    let &[groups, sessions, views] = numbers.as_slice() else {
        return Err("three numbers: groups, sessions of a group, views of a session".to_owned());
    };
    println!(
        "| lens | groups | sessions | views | own: RMS mm | stated mm | covered % | pairs % | shared: RMS mm | stated mm | \
         covered % | pairs % | p < 5 % | found to differ | the last alone |"
    );
    println!("|{}", " --- |".repeat(15));
    for lens in [Lens::Model, Lens::Waves, Lens::Zoomed] {
        let all: Vec<Group> = (0..groups)
            .into_par_iter()
            .map(|number| group(lens, sessions, views, number))
            .collect::<Result<_, String>>()?;
        let small = all.iter().filter(|group| group.p_value < 0.05).count();
        let odd = all.iter().filter(|group| group.odd > 0).count();
        let last = all.iter().filter(|group| group.last_alone_is_odd).count();
        println!(
            "| {} | {groups} | {sessions} | {views} | {} | {} | {:.1} % | {odd} | {last} |",
            lens.name(),
            columns(&all.iter().map(|group| &group.own)),
            columns(&all.iter().map(|group| &group.shared)),
            percent(small, groups)
        );
    }
    Ok(())
}
