//! Hypotheses of the linear model in words.

use nalgebra::Vector6;

use super::super::Hypothesis;
use super::super::effect::Effect;
use super::super::judge::{Judged, moved_m};
use super::super::model::Model;
use super::super::screen::Candidate;
use super::super::select::Selection;
use super::{estimate, evidence, lens};
use crate::diagnose::findings::{Evidence, Finding, FindingCode, Severity, listed};
use crate::handeye::Mode;
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Turn from which a view was more likely numbered the wrong way round than moved, degrees: views numbered from the wrong end
/// are off by half a turn or a quarter, and a board that is knocked turns by less. It chooses the words only.
const TURNED_DEG: f64 = 20.0;

/// Every hypothesis: those taken in, then the best of every other kind. Views that were left out as outliers one after the other
/// are one hypothesis.
pub(in super::super) fn fine(selection: &Selection<'_>) -> Vec<Hypothesis> {
    let mut found: Vec<Hypothesis> = Vec::new();
    let views: Vec<usize> = selection
        .taken
        .iter()
        .filter_map(|j| match &j.candidate {
            Candidate::Views(views) => Some(views.clone()),
            Candidate::Effect(_) => None,
        })
        .flatten()
        .collect();
    for judged in &selection.taken {
        let hypothesis = match &judged.candidate {
            Candidate::Effect(effect) => of_effect(&selection.model, judged, *effect),
            Candidate::Views(_) if found.iter().any(|h| h.code == FindingCode::OutlierView) => continue,
            Candidate::Views(_) => of_views(selection, judged, &views),
        };
        found.push(Hypothesis { accepted: judged.matters, ..hypothesis });
    }
    for judged in &selection.others {
        let hypothesis = match &judged.candidate {
            Candidate::Effect(effect) => of_effect(&selection.model, judged, *effect),
            Candidate::Views(views) => of_views(selection, judged, views),
        };
        found.push(if judged.as_good { others(hypothesis) } else { hypothesis });
    }
    found
}

/// A hypothesis that explains as much as the first.
fn others(hypothesis: Hypothesis) -> Hypothesis {
    let both = text!("What else was found explains much the same: check both.");
    Hypothesis { accepted: true, advice: Text::sentences([hypothesis.advice, both]), ..hypothesis }
}

/// An accepted hypothesis as a finding.
pub(in super::super) fn finding_of(hypothesis: &Hypothesis) -> Finding {
    let finding = Finding::new(hypothesis.code, Severity::Warning, hypothesis.text_with_advice());
    Finding { evidence: hypothesis.evidence.clone(), views: hypothesis.views.clone(), ..finding }
}

fn of_effect(model: &Model<'_>, judged: &Judged, effect: Effect) -> Hypothesis {
    let number = |k: usize| judged.numbers.get(k).copied().unwrap_or_default();
    let sigma = |k: usize| judged.sigma.get(k).copied().unwrap_or_default();
    let mut numbers = common(judged);
    let mut views = Vec::new();
    let (code, what, to_do, estimate) = match effect {
        Effect::Scale => {
            let (percent, sigma) = (100.0 * number(0), 100.0 * sigma(0));
            let what = if percent < 0.0 {
                text!("The motion of the robot says that the target is {size} % ± {sigma} % smaller than stated.")
            } else {
                text!("The motion of the robot says that the target is {size} % ± {sigma} % larger than stated.")
            };
            let size = shown(percent.abs(), 2);
            let what = what.with("size", size).with("sigma", shown(sigma, 2));
            let scale = estimate("true_over_stated_size", 1.0 + number(0), Some(sigma / 100.0), "");
            numbers.push(evidence("true_over_stated_size", 1.0 + number(0), ""));
            numbers.push(evidence("true_over_stated_size_sigma", sigma / 100.0, ""));
            let measure = text!("Measure the target with a ruler, over as many squares as it has.");
            // Its lengths as a whole look like the size of the target.
            let or_arm = text!(
                "If it is as large as stated, this is not the arm that is named, or its kinematics are wrong: correct no commands \
                 by this calibration then."
            );
            let to_do = if model.arm().is_some() { Text::sentences([measure, or_arm]) } else { measure };
            (FindingCode::WrongScale, what, to_do, scale)
        }
        Effect::Warp => {
            let [x_mm, y_mm] = [number(0) * 1e3, number(1) * 1e3];
            let what = text!(
                "The target is bent: its middle stands {x} mm (along x) and {y} mm (along y) out.",
                x = shown(x_mm, 2),
                y = shown(y_mm, 2)
            );
            numbers.push(evidence("warp_x", x_mm, "mm"));
            numbers.push(evidence("warp_y", y_mm, "mm"));
            let k = usize::from(number(1).abs() > number(0).abs());
            let warp = estimate("warp", number(k) * 1e3, Some(sigma(k) * 1e3), "mm");
            (FindingCode::BoardBent, what, text!("Fix it to a flat plate."), warp)
        }
        Effect::Lens => {
            let fx = model.sight.intrinsics.map_or(1.0, |camera| camera.fx);
            let (percent, sigma_percent) = (100.0 * number(0) / fx, 100.0 * sigma(0) / fx);
            let what = text!(
                "The intrinsics given do not fit the images: the focal length would be {percent} % ± {sigma} % off, the \
                 centre by {x} ± {x_sigma} px and {y} ± {y_sigma} px.",
                percent = format!("{percent:+.2}"),
                sigma = shown(sigma_percent, 2),
                x = format!("{:+.2}", number(2)),
                x_sigma = shown(sigma(2), 2),
                y = format!("{:+.2}", number(3)),
                y_sigma = shown(sigma(3), 2)
            );
            numbers.push(evidence("focal_change", percent, "%"));
            let change = estimate("focal_change", percent, Some(sigma_percent), "%");
            let to_do = text!("Let them be estimated, or give those of this camera at this image size and focus.");
            (FindingCode::WrongIntrinsics, what, to_do, change)
        }
        Effect::Centre => {
            let off = [number(0), number(1)];
            numbers.push(evidence("centre_change_x", off[0], "px"));
            numbers.push(evidence("centre_change_y", off[1], "px"));
            let k = usize::from(off[1].abs() > off[0].abs());
            let name = ["centre_change_x", "centre_change_y"][k];
            let change = estimate(name, off[k], Some(sigma(k)), "px");
            let (what, to_do) = lens::centre(model.sight.intrinsics, off, [sigma(0), sigma(1)], judged.stated_px);
            (FindingCode::WrongIntrinsics, what, to_do, change)
        }
        Effect::BoardMoved(from) | Effect::CameraMoved(from) => {
            let name = model.sight.views[from].name.clone();
            let (mm, deg) = twist_size(&judged.numbers);
            let at_board_mm = moved_m(model, effect, &judged.numbers) * 1e3;
            let board = matches!(effect, Effect::BoardMoved(_));
            let code = if board { FindingCode::BoardMoved } else { FindingCode::CameraMoved };
            let who = match (board, model.sight.mode) {
                (true, Mode::EyeInHand) => text!("The target"),
                (true, Mode::EyeToHand) => text!("The target on the tip"),
                (false, Mode::EyeInHand) => text!("The camera on the tip"),
                (false, Mode::EyeToHand) => text!("The camera"),
            };
            let what = text!(
                "{who} moved before view {view}, by {mm} mm and {deg}°.",
                who = who,
                view = &name,
                mm = shown(mm, 2),
                deg = shown(deg, 3)
            );
            numbers.push(evidence("first_view_after", from as f64, ""));
            numbers.push(evidence("moved", mm, "mm"));
            numbers.push(evidence("turned", deg, "°"));
            numbers.push(evidence("moved_at_target", at_board_mm, "mm"));
            views.push(name);
            let sigma_mm = judged.sigma.iter().take(3).map(|s| s * s).sum::<f64>().sqrt() * 1e3;
            let to_do = text!("Fix it and capture again, or keep only the views before or after.");
            (code, what, to_do, estimate("moved", mm, Some(sigma_mm), "mm"))
        }
        Effect::Joint(joint) => {
            let (deg, sigma) = (number(0).to_degrees(), sigma(0).to_degrees());
            let what = text!(
                "The zero of joint {joint} is off by {offset}° ± {sigma}°.",
                joint = joint + 1,
                offset = format!("{deg:+.3}"),
                sigma = shown(sigma, 3)
            );
            numbers.push(evidence("joint", (joint + 1) as f64, ""));
            numbers.push(evidence("offset", deg, "°"));
            numbers.push(evidence("offset_sigma", sigma, "°"));
            let to_do = text!("Master the arm again, or let the offset be estimated with the calibration.");
            (FindingCode::JointOffset, what, to_do, estimate("offset", deg, Some(sigma), "°"))
        }
    };
    Hypothesis {
        code,
        with: Vec::new(),
        text: Text::sentences([what, worth(judged)]),
        advice: to_do,
        gain: judged.gain,
        estimate: Some(estimate),
        evidence: numbers,
        views,
        significant: judged.significant,
        accepted: false,
        applied: false,
    }
}

fn of_views(selection: &Selection<'_>, judged: &Judged, views: &[usize]) -> Hypothesis {
    let model = &selection.model;
    let names: Vec<String> = views.iter().map(|i| model.sight.views[*i].name.clone()).collect();
    let mut numbers = common(judged);
    // The view that is off by most; its displacement is by the fit without those left out as an outlier.
    let size = |i: &usize| model.displacement_m(&selection.fit.residuals[*i]);
    let worst = views.iter().copied().max_by(|a, b| size(a).total_cmp(&size(b)));
    let mm = worst.map_or(0.0, |i| size(&i) * 1e3);
    // The same as a correction of the robot's pose.
    let by_robot =
        worst.and_then(|i| model.rows[i].by_robot.try_inverse().map(|inverse| inverse * selection.fit.residuals[i]));
    let deg = by_robot.map_or(0.0, |c: Vector6<f64>| c.fixed_rows::<3>(3).norm().to_degrees());
    numbers.push(evidence("displacement", mm, "mm"));
    numbers.push(evidence("turn", deg, "°"));
    let what = if views.len() == 1 {
        text!("View {list} contradicts the others: the board is out by up to {mm} mm and {deg}°.")
    } else {
        text!("Views {list} contradict the others: the board is out by up to {mm} mm and {deg}°.")
    };
    let what = what.with("list", listed(&names)).with("mm", shown(mm, 2)).with("deg", shown(deg, 2));
    let why = if deg > TURNED_DEG {
        text!("The board may have been read the wrong way round, or the pose belongs to another image.")
    } else {
        text!("The arm or the board may have been moving, or the pose belongs to another image.")
    };
    Hypothesis {
        code: FindingCode::OutlierView,
        with: Vec::new(),
        text: Text::sentences([what, worth(judged)]),
        advice: Text::sentences([why, text!("Leave it out and see what changes.")]),
        gain: judged.gain,
        estimate: Some(estimate("displacement", mm, None, "mm")),
        evidence: numbers,
        views: names,
        significant: judged.significant,
        accepted: false,
        applied: false,
    }
}

/// Length and angle of a twist, millimetres and degrees.
fn twist_size(numbers: &[f64]) -> (f64, f64) {
    let norm = |part: &[f64]| part.iter().map(|v| v * v).sum::<f64>().sqrt();
    let split = numbers.len().min(3);
    (norm(&numbers[..split]) * 1e3, norm(&numbers[split..]).to_degrees())
}

/// Evidence that every hypothesis has.
fn common(judged: &Judged) -> Vec<Evidence> {
    let [(without_m, with_m), (without_rad, with_rad)] = judged.robot;
    let mut numbers = vec![
        evidence("log_likelihood_gain", judged.gain, ""),
        evidence("robot_sigma_without", without_m * 1e3, "mm"),
        evidence("robot_sigma_with", with_m * 1e3, "mm"),
        evidence("robot_angle_without", without_rad.to_degrees(), "°"),
        evidence("robot_angle_with", with_rad.to_degrees(), "°"),
    ];
    if let Some((without, with)) = &judged.held_out {
        numbers.push(evidence("held_out_without", without.rms_m * 1e3, "mm"));
        numbers.push(evidence("held_out_with", with.rms_m * 1e3, "mm"));
    }
    numbers
}

/// By how much it explains the data better. The robot's noise without it and with it is evidence; in words a report has one
/// number for that noise, which is that of the answer.
fn worth(judged: &Judged) -> Text {
    if !judged.significant {
        return text!("It is within chance.");
    }
    let held_out = judged.held_out.as_ref().map(|(without, with)| {
        text!(
            "Views left out are predicted to {with} mm instead of {without} mm.",
            with = shown(with.rms_m * 1e3, 2),
            without = shown(without.rms_m * 1e3, 2)
        )
    });
    let explained = text!("This explains the data {times} times better.", times = super::times(judged.gain));
    Text::sentences([explained].into_iter().chain(held_out))
}
