//! Hypotheses and findings in words.

mod fine;
mod lens;

pub(super) use fine::{finding_of, fine};

use super::gross::{Gross, Tried};
use super::pairing::Pairing;
use super::views::SessionViews;
use super::{Estimate, Hypothesis};
use crate::diagnose::findings::{Evidence, Finding, FindingCode, Severity, listed};
use crate::diagnose::hypotheses::pairing::Order;
use crate::diagnose::hypotheses::steps::Step;
use crate::handeye::Mode;
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Natural logarithm of a likelihood ratio that a gross hypothesis needs after allowance for all that are tried. Of two fixed
/// distributions the wrong one is this much likelier in at most seven sessions in a thousand (Markov's inequality).
pub(super) const CERTAIN: f64 = 5.0;
/// One distance supports a set-up when it is this many times the other. It adds a sentence; nothing is decided by it.
const FARTHER: f64 = 2.0;

/// How many times better, from the logarithm.
fn times(gain: f64) -> String {
    // Beyond a few thousand times the size of the number means nothing.
    if gain < 8.0 { format!("{:.1}", gain.exp()) } else { format!("e^{gain:.0}") }
}

fn evidence(name: &'static str, value: f64, unit: &'static str) -> Evidence {
    Evidence { name, value, unit }
}

pub(super) fn not_finite(sight: &SessionViews) -> Option<Finding> {
    let names = &sight.not_finite;
    if names.is_empty() {
        return None;
    }
    let count = names.len();
    let what = text!(
        "{count} {count|view|views} with a pose or a corner that is not a number ({list}).",
        count = count,
        list = listed(names)
    );
    let text = Text::sentences([what, text!("Write the table again, or leave them out.")]);
    let mut finding = Finding::new(FindingCode::NotFinite, Severity::Problem, text);
    finding.views.clone_from(names);
    Some(finding.with("views", count as f64, ""))
}

/// Poses of a target that was seen put it in front of the camera.
pub(super) fn behind_the_camera(sight: &SessionViews) -> Option<Finding> {
    let behind = sight.views.iter().filter(|view| view.camera_from_target.translation.z <= 0.0).count();
    if 2 * behind <= sight.views.len() {
        return None;
    }
    let text = text!(
        "In {behind} of {views} views the target poses put the target behind the camera: they are target_from_camera, or the camera's z axis looks backwards. Write pose = \"target_from_camera\" in [target], or turn the axes to z forward, y down.",
        behind = behind,
        views = sight.views.len()
    );
    let finding = Finding::new(FindingCode::InvertedTargetPoses, Severity::Problem, text);
    Some(finding.with("views_behind", behind as f64, "").with("views", sight.views.len() as f64, ""))
}

pub(super) fn wrong_corners(sight: &SessionViews) -> Option<Finding> {
    let views: Vec<_> = sight.views.iter().filter(|v| !v.wrong_corners.is_empty()).collect();
    if views.is_empty() {
        return None;
    }
    let names: Vec<String> = views.iter().map(|v| v.name.clone()).collect();
    let wrong: usize = views.iter().map(|v| v.wrong_corners.len()).sum();
    let corners: usize = views.iter().map(|v| v.corners).sum();
    let text = text!(
        "{wrong} of {corners} corners are not where the rest of their view puts them ({list}). Look there for reflections, a \
         covered corner or a wrong index; leave the view out or capture it again.",
        wrong = wrong,
        corners = corners,
        list = listed(&names)
    );
    let mut finding = Finding::new(FindingCode::OutlierCorners, Severity::Warning, text);
    finding.views = names;
    Some(finding.with("wrong_corners", wrong as f64, "").with("corners", corners as f64, ""))
}

/// What was tried: the best when it is accused, and the best of every single change.
pub(super) fn gross(sight: &SessionViews, gross: &Gross) -> Vec<Hypothesis> {
    let mut found: Vec<Hypothesis> = Vec::new();
    for (rank, tried) in gross.tried.iter().enumerate() {
        let codes = tried.change.codes();
        let best = rank == 0 && gross.accused;
        // Of those that accuse nothing, one of every simple kind is enough to see that it was tried.
        if !best && (codes.len() != 1 || found.iter().any(|h| h.code == codes[0])) {
            continue;
        }
        let mut hypothesis = gross_hypothesis(sight, gross, tried, &codes);
        hypothesis.significant = best && hypothesis.gain > CERTAIN + (gross.tried.len() as f64).ln();
        hypothesis.accepted = best;
        let twin = twin(sight, tried).filter(|_| codes == [FindingCode::InvertedPoses]);
        let Some(camera_elsewhere) = twin else {
            found.push(hypothesis);
            continue;
        };
        // For poses measured elsewhere nothing confirms that they are camera_from_target.
        let (first, also) = if sight.intrinsics.is_none() {
            (FindingCode::InvertedTargetPoses, vec![FindingCode::WrongMode])
        } else {
            (FindingCode::WrongMode, Vec::new())
        };
        let with = std::iter::once(FindingCode::InvertedPoses).chain(also.iter().copied()).collect();
        let mut other = Hypothesis { code: first, with, ..hypothesis.clone() };
        hypothesis.with = std::iter::once(first).chain(also).collect();
        // One finding for both: the likelier one.
        if camera_elsewhere {
            hypothesis.accepted = false;
            found.extend([other, hypothesis]);
        } else {
            other.accepted = false;
            found.extend([hypothesis, other]);
        }
    }
    found
}

/// Inverted poses and the other set-up are the same equations. Whether the distances support the other set-up: what is
/// carried by the tip is nearer to it than what is fixed in the cell.
fn twin(sight: &SessionViews, tried: &Tried) -> Option<bool> {
    let (camera_m, target_m) = distances(tried);
    let stands_elsewhere = match sight.mode {
        Mode::EyeInHand => camera_m > FARTHER * target_m,
        Mode::EyeToHand => target_m > FARTHER * camera_m,
    };
    (camera_m.is_finite() && target_m.is_finite()).then_some(stands_elsewhere)
}

fn distances(tried: &Tried) -> (f64, f64) {
    let solution = &tried.agreement.solution;
    (solution.mount_from_camera.translation().norm(), solution.anchor_from_target.translation().norm())
}

fn gross_hypothesis(sight: &SessionViews, gross: &Gross, tried: &Tried, codes: &[FindingCode]) -> Hypothesis {
    // Where the poses as given have no solution at all, the place of the board is undetermined.
    let given_m = gross.as_given.as_ref().map_or(sight.target.distance_m, |a| a.median_m);
    let so_m = tried.agreement.median_m;
    let (given_mm, so_mm) = (given_m * 1e3, so_m * 1e3);
    let freedom = 0.5 * (6.0 * gross.views as f64 - 12.0).max(1.0);
    let ratio = (given_m.max(1e-9) / so_m.max(1e-9)).ln();
    let so_read = text!(
        "Read this way, the views agree on the position of the board within {so} mm; as stated, within {given} mm (median view).",
        so = shown(so_mm, 2),
        given = shown(given_mm, 2)
    );
    let what = codes.iter().filter_map(|code| gross_words(sight, *code, tried));
    let (camera_m, target_m) = distances(tried);
    Hypothesis {
        code: codes.first().copied().unwrap_or(FindingCode::InconsistentPoses),
        with: codes.iter().skip(1).copied().collect(),
        text: Text::sentences(what.chain([so_read])),
        advice: Text::sentences(codes.iter().filter_map(|code| gross_advice(sight, *code))),
        gain: freedom * ratio,
        estimate: None,
        evidence: vec![
            evidence("misfit_as_stated", given_mm, "mm"),
            evidence("misfit_so", so_mm, "mm"),
            evidence("camera_distance", camera_m, "m"),
            evidence("target_distance", target_m, "m"),
        ],
        views: match tried.change.pairing {
            Pairing::Stepped(step) => vec![sight.views[step.from].name.clone()],
            _ => Vec::new(),
        },
        significant: false,
        accepted: false,
        applied: false,
    }
}

fn gross_words(sight: &SessionViews, code: FindingCode, tried: &Tried) -> Option<Text> {
    let (camera_m, target_m) = distances(tried);
    Some(match code {
        FindingCode::InvertedPoses if sight.intrinsics.is_none() => text!(
            "The robot poses or the target poses are the inverse of what is stated, or the camera sits on the other side \
             (eye in hand against eye to hand): all three are the same equations. With the robot poses inverted the camera \
             would be {camera} m from what carries it and the target {target} m; with the target poses inverted it is the \
             other way round.",
            camera = shown(camera_m, 2),
            target = shown(target_m, 2)
        ),
        FindingCode::InvertedPoses => text!(
            "The robot poses are the inverse of what is stated, or the camera sits on the other side (eye in hand against \
             eye to hand): both are the same equations. The camera would be {camera} m from what carries it and the board \
             {target} m.",
            camera = shown(camera_m, 2),
            target = shown(target_m, 2)
        ),
        FindingCode::WrongQuaternionOrder => {
            let (has, stated) = if tried.change.w_first() { ("w x y z", "x y z w") } else { ("x y z w", "w x y z") };
            text!(
                "The quaternions of the robot poses are in the order {has} and were read as {stated}.",
                has = has,
                stated = stated
            )
        }
        FindingCode::WrongAngleUnit => text!("The angles of the robot poses are in {has} where {stated} were stated.")
            .with("has", text!("radians"))
            .with("stated", text!("degrees")),
        FindingCode::WrongLengthUnit if !is_a_thousand(tried.change.unit) => {
            let factor = factor_text(tried.change.unit);
            if factor.contains("25") {
                text!(
                    "The stated size of the target is {factor} times the true one, by an inch: inches and millimetres were mixed up \
                     in it or in the positions of the robot poses.",
                    factor = factor
                )
            } else {
                text!(
                    "The stated size of the target is {factor} times the true one, a power of ten: millimetres, centimetres and \
                     metres were mixed up in it or in the positions of the robot poses.",
                    factor = factor
                )
            }
        }
        FindingCode::WrongLengthUnit => {
            let (metres, millimetres) = (text!("metres"), text!("millimetres"));
            let (has, stated) = if tried.change.unit < 1.0 { (millimetres, metres) } else { (metres, millimetres) };
            text!(
                "The positions of the robot poses are in {has} where {stated} were stated, or the size of the target is in \
                 the wrong unit.",
                has = has,
                stated = stated
            )
        }
        FindingCode::ShiftedPoses => pairing_words(sight, tried.change.pairing)?,
        _ => return None,
    })
}

fn is_a_thousand(unit: f64) -> bool {
    [1e-3, 1e3].contains(&unit)
}

/// A factor between units of length as people write it.
fn factor_text(unit: f64) -> String {
    if (1.0..30.0).contains(&unit) {
        format!("{unit}")
    } else if unit > 30.0 && unit < 40.0 {
        "1/0.0254".into()
    } else if unit > 1.0 {
        format!("{unit:.0}")
    } else if (unit - 1.0 / 25.4).abs() < 1e-9 {
        "1/25.4".into()
    } else {
        format!("{unit}")
    }
}

/// Which rows images and poses were paired by.
fn pairing_words(sight: &SessionViews, pairing: Pairing) -> Option<Text> {
    let rows = |by: isize| if by.unsigned_abs() == 1 { text!("one row") } else { text!("two rows") };
    Some(match pairing {
        Pairing::AsGiven => return None,
        Pairing::Shifted(by) if by > 0 => {
            text!("Every image belongs to the robot pose that stands {rows} after its own.", rows = rows(by))
        }
        Pairing::Shifted(by) => {
            text!("Every image belongs to the robot pose that stands {rows} before its own.", rows = rows(by))
        }
        Pairing::Stepped(Step { from, before, after }) => text!(
            "From view {view} on images and robot poses are out of step by {rows} against the views before it: an image or \
             a pose is missing there, or is there twice.",
            view = &sight.views[from].name,
            rows = rows(after - before)
        ),
        Pairing::Listed(Order::ByNumber) => text!(
            "Images and robot poses were paired in different orders: the images letter by letter (1, 10, 2), the poses by \
             number (1, 2, 10)."
        ),
        Pairing::Listed(Order::ByLetters) => text!(
            "Images and robot poses were paired in different orders: the images by number (1, 2, 10), the poses letter by \
             letter (1, 10, 2)."
        ),
    })
}

fn gross_advice(sight: &SessionViews, code: FindingCode) -> Option<Text> {
    Some(match code {
        FindingCode::InvertedPoses if sight.intrinsics.is_none() => text!(
            "Check whether the target poses are camera_from_target or target_from_camera, whether the table has base_from_tip \
             or tip_from_base, and whether the camera is on the tip."
        ),
        FindingCode::InvertedPoses => {
            text!("Check whether the table has base_from_tip or tip_from_base, and whether the camera is on the tip.")
        }
        FindingCode::WrongQuaternionOrder => text!("Check the order of the columns."),
        FindingCode::WrongAngleUnit => text!("Check the unit of the angles: angle_unit in [robot] of a data set."),
        FindingCode::WrongLengthUnit => text!("Check the unit of the poses and the size of the target."),
        FindingCode::ShiftedPoses => text!("Check how images and poses were paired."),
        _ => return None,
    })
}

/// An accused gross hypothesis as findings, one per code.
pub(super) fn gross_findings(hypotheses: &[Hypothesis]) -> Vec<Finding> {
    let Some(h) = hypotheses.iter().find(|h| h.accepted) else { return Vec::new() };
    // The twin is reported in the same sentence.
    let is_twin = |code: FindingCode| {
        matches!(code, FindingCode::WrongMode | FindingCode::InvertedPoses | FindingCode::InvertedTargetPoses)
    };
    let others = h.with.iter().copied().filter(|c| !(is_twin(h.code) && is_twin(*c)));
    std::iter::once(h.code)
        .chain(others)
        .map(|code| {
            let finding = Finding::new(code, Severity::Problem, h.text_with_advice());
            Finding { evidence: h.evidence.clone(), views: h.views.clone(), ..finding }
        })
        .collect()
}

pub(super) fn hopeless(sight: &SessionViews, misfit_m: f64) -> Finding {
    let text = text!(
        "Robot poses and images contradict each other: the views agree on the position of the board within {misfit} mm only, at a distance of {distance} mm. Inverted poses, the other mode, millimetres, quaternion order and rows out of step do not explain \
         it. Check that the poses belong to these images, and the axes and angles that the poses were made from.",
        misfit = format!("{:.0}", misfit_m * 1e3),
        distance = format!("{:.0}", sight.target.distance_m * 1e3)
    );
    let finding = Finding::new(FindingCode::InconsistentPoses, Severity::Problem, text);
    finding.with("misfit", misfit_m * 1e3, "mm").with("distance", sight.target.distance_m * 1e3, "mm")
}

/// Noise beyond that of an arm, whatever else was found.
pub(super) fn implausible(robot_m: f64, robot_rad: f64, beside: bool) -> Finding {
    let (mm, deg) = (robot_m * 1e3, robot_rad.to_degrees());
    let what = if beside {
        text!(
            "Even allowing for what else was found the robot poses scatter about what the images say by more than the error of an arm (2 mm and 0.5° per axis)."
        )
    } else {
        text!(
            "The robot poses scatter by {mm} mm and {deg}° per axis about what the images say, more than the error of an arm (below 2 mm and 0.5°).",
            mm = shown(mm, 2),
            deg = shown(deg, 3)
        )
    };
    let advice = text!(
        "The arm may have been moving, poses and images may not be of the same moment, or the arm's own geometry is wrong. \
         Capture again at rest; no solver can correct it."
    );
    let text = Text::sentences([what, advice]);
    let finding = Finding::new(FindingCode::InconsistentPoses, Severity::Warning, text);
    finding.with("robot_sigma", mm, "mm").with("robot_sigma_angle", deg, "°")
}

fn estimate(name: &'static str, value: f64, sigma: Option<f64>, unit: &'static str) -> Estimate {
    Estimate { name, value, sigma, unit }
}
