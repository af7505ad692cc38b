//! What the joint estimate decided and found in addition to the answer, in words with units.

use handeye_estimate::diagnose::Calibration;
use handeye_estimate::diagnose::findings::WIDENING_WORTH_SAYING;
use handeye_estimate::handeye::joint::PrintErrors;
use handeye_estimate::verify::{DepthErrors, DepthReport};
use handeye_estimate::{ArmFit, DepthsInFit, JointFit, ShapeEstimate, ViewStatus};
use handeye_wording::shown;

use crate::text::Text;
use handeye_wording::text;

/// From this many degrees of freedom on the normal distribution is as good.
const GAUSSIAN: f64 = 1e5;

/// One thing to report.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EstimatedValue {
    pub what: Text,
    /// How much, with its unit.
    pub value: Text,
    pub meaning: Text,
    /// Why, where there is a reason.
    pub why: Option<Text>,
}

/// All of it, one line each; what is as usual is not reported.
pub fn estimated(calibration: &Calibration, depth: Option<&DepthReport>) -> Vec<EstimatedValue> {
    let mut lines = Vec::new();
    lines.extend(outlier_views(calibration));
    lines.extend(rejected_corners(calibration));
    let depths = calibration.joint.as_ref().and_then(|joint| joint.depths.as_ref());
    lines.extend(depth.and_then(|report| depth_camera(report, depths.map(|depths| &depths.in_fit))));
    let Some(joint) = &calibration.joint else { return lines };
    if let Some(shape) = &joint.shape {
        lines.extend(bend(shape));
        lines.extend(size(shape));
    }
    lines.extend(joint.print.as_ref().map(print));
    lines.extend(view_noise(joint));
    lines.extend(widening(joint));
    lines.push(freedom(joint));
    lines.extend(joint.arm.as_ref().map(arm));
    lines
}

fn outlier_views(calibration: &Calibration) -> Option<EstimatedValue> {
    let count = calibration.views.iter().filter(|view| view.status == ViewStatus::Outlier).count();
    let taken = calibration.views.iter().filter(|view| view.status == ViewStatus::Used).count();
    (count > 0).then(|| EstimatedValue {
        what: text!("Outlier views"),
        value: text!("{count} of {of}", count = count, of = count + taken),
        meaning: text!("They do not fit the others, and the answer is without them; the table of captures says which"),
        why: None,
    })
}

fn rejected_corners(calibration: &Calibration) -> Option<EstimatedValue> {
    let views = calibration.views.iter().filter(|view| !view.rejected_corners.is_empty()).count();
    let count: usize = calibration.views.iter().map(|view| view.rejected_corners.len()).sum();
    (count > 0).then(|| EstimatedValue {
        what: text!("Outlier corners"),
        value: text!("{count}, in {views} of {of} views", count = count, views = views, of = calibration.views.len()),
        meaning: text!("They are far from where the rest of their view puts them, and the answer is without them"),
        why: None,
    })
}

fn bend(shape: &ShapeEstimate) -> Option<EstimatedValue> {
    let [x_sigma, y_sigma] = shape.warp_sigma_m?.map(|metres| format!("{:.3}", metres * 1e3));
    let [x, y] = shape.shape.warp_m.map(|metres| format!("{:.3}", metres * 1e3));
    Some(EstimatedValue {
        what: text!("Bend of the board"),
        value: text!("x {x} ± {x_sigma} mm, y {y} ± {y_sigma} mm", x = x, x_sigma = x_sigma, y = y, y_sigma = y_sigma),
        meaning: text!(
            "How far the middle of the board stands out against its edges, along its x and y; ± is one standard \
             deviation. The answer allows for it"
        ),
        why: None,
    })
}

fn size(shape: &ShapeEstimate) -> Option<EstimatedValue> {
    let (percent, sigma) = (shape.shape.scale * 100.0, shape.scale_sigma? * 100.0);
    Some(EstimatedValue {
        what: text!("Size of the board"),
        value: Text::verbatim(format!("{percent:.3} ± {sigma:.3} %")),
        meaning: text!("Its true size over the stated one, by the motion of the robot; ± is one standard deviation"),
        why: None,
    })
}

fn print(print: &PrintErrors) -> EstimatedValue {
    let (rms, most) = (print.rms_m() * 1e3, print.largest_m() * 1e3);
    EstimatedValue {
        what: text!("Print of the board"),
        value: text!("{rms} mm off, {most} mm at most", rms = format!("{rms:.3}"), most = format!("{most:.3}")),
        meaning: text!(
            "How far the points of the board are from where its drawing has them: RMS per axis, and the farthest. The answer \
             allows for it"
        ),
        why: None,
    }
}

fn depth_camera(report: &DepthReport, in_fit: Option<&DepthsInFit>) -> Option<EstimatedValue> {
    let value = if report.is_gross() {
        text!("{ratio} times what is expected", ratio = shown(report.ratio, 3))
    } else {
        let DepthErrors { offset_m, at_m, noise_m, .. } = report.errors.as_ref()?;
        text!(
            "{offset} ± {sigma} mm at {at} mm, noise {noise} mm, {fill} % filled",
            offset = format!("{:+.2}", offset_m.value * 1e3),
            sigma = shown(offset_m.sigma * 1e3, 2),
            at = format!("{:.0}", at_m * 1e3),
            noise = shown(noise_m * 1e3, 2),
            fill = format!("{:.0}", report.fill * 1e2)
        )
    };
    let why = match in_fit {
        Some(depths) if depths.accepted && depths.weight.turned => text!(
            "The answer uses the depths, and leaves open how far the depth camera is turned: views left out are predicted to {after} px \
             with them and {before} px without",
            after = format!("{:.3}", depths.heldout_after_px),
            before = format!("{:.3}", depths.heldout_before_px)
        ),
        Some(depths) if depths.accepted => text!(
            "The answer uses the depths, as measured along the lens: views left out are predicted to {after} px with them and \
             {before} px without",
            after = format!("{:.3}", depths.heldout_after_px),
            before = format!("{:.3}", depths.heldout_before_px)
        ),
        Some(depths) => text!(
            "The answer does not use the depths: views left out are predicted to {after} px with them and {before} px without",
            after = format!("{:.3}", depths.heldout_after_px),
            before = format!("{:.3}", depths.heldout_before_px)
        ),
        None => text!("The answer does not depend on the depths"),
    };
    Some(EstimatedValue {
        what: text!("Depth camera"),
        value,
        meaning: text!(
            "Measured depth of the board minus the depth at which the calibration has it, how single depths scatter, and how \
             many pixels of the board have one; ± is one standard deviation"
        ),
        why: Some(why),
    })
}

fn view_noise(joint: &JointFit) -> Option<EstimatedValue> {
    let view_px = joint.noise.view_px;
    (view_px > 0.0).then(|| EstimatedValue {
        what: text!("Noise of views"),
        value: Text::verbatim(format!("{view_px:.3} px")),
        meaning: text!(
            "What all corners of an image are off by together, beyond their own noise: lens, board and image are not \
             quite as modelled"
        ),
        why: None,
    })
}

fn widening(joint: &JointFit) -> Option<EstimatedValue> {
    let widening = &joint.widening;
    let by = widening.by?;
    let times = widening.factor.sqrt();
    (times >= WIDENING_WORTH_SAYING).then(|| EstimatedValue {
        what: text!("Uncertainty widened"),
        value: text!("{times} times", times = format!("{times:.1}")),
        meaning: text!(
            "The stated errors are so many times what independent noise explains, because the data show more than that"
        ),
        why: Some(by.reason()),
    })
}

fn freedom(joint: &JointFit) -> EstimatedValue {
    let degrees = joint.small_sample.degrees_of_freedom;
    let value = if degrees > GAUSSIAN {
        text!("normal")
    } else {
        text!("Student's t with {n} degrees of freedom", n = format!("{degrees:.1}"))
    };
    EstimatedValue {
        what: text!("Distribution of the stated error"),
        value,
        meaning: text!(
            "The fewer degrees of freedom it rests on, the wider it is for the same noise, because the noise levels are \
             estimated"
        ),
        why: None,
    }
}

fn arm(arm: &ArmFit) -> EstimatedValue {
    let noise = arm.noise;
    let why = arm.heldout_px.map(|[reported, corrected]| {
        let (before, after) = (format!("{reported:.3}"), format!("{corrected:.3}"));
        if arm.contradicted {
            text!(
                "Do not correct by them: views left out are predicted to {after} px with them and {before} px without",
                after = after,
                before = before
            )
        } else {
            text!(
                "Views left out are predicted to {after} px by corrected poses instead of {before} px by reported ones",
                after = after,
                before = before
            )
        }
    });
    EstimatedValue {
        what: text!("Errors of the arm"),
        value: text!(
            "angles {angle}°, lengths {length} mm, compliance {compliance}°",
            angle = format!("{:.3}", noise.link_rad.to_degrees()),
            length = format!("{:.3}", noise.link_m * 1e3),
            compliance = format!("{:.3}", noise.compliance_rad.to_degrees())
        ),
        meaning: text!(
            "How far the links of this arm typically are from what its controller takes them to be, one standard deviation; \
             handeye correct makes commands that allow for it. The answer above is for the controller as it is"
        ),
        why,
    }
}

#[cfg(test)]
mod tests {
    use handeye_estimate::uncertainty::overdispersion::{Evidence, Overdispersion};
    use handeye_geometry::targets::bent::BoardShape;

    use super::*;
    use crate::testing::sample;
    use crate::text::Language;

    fn reported(change: impl FnOnce(&mut Calibration)) -> Vec<(String, String)> {
        let model = sample::solved();
        let mut calibration = model.solve.current().expect("solved").calibration.clone();
        let joint = calibration.joint.as_mut().expect("a joint estimate");
        (joint.shape, joint.arm) = (None, None);
        joint.widening = Overdispersion { factor: 1.0, by: None, lens: 1.0, checks: Vec::new() };
        joint.noise.view_px = 0.0;
        change(&mut calibration);
        let lines = estimated(&calibration, None);
        lines
            .iter()
            .map(|it| (it.what.in_language(Language::English), it.value.in_language(Language::English)))
            .collect()
    }

    fn has(lines: &[(String, String)], what: &str, value: &str) -> bool {
        lines.iter().any(|(a, b)| a == what && b == value)
    }

    #[test]
    fn nothing_is_said_of_what_is_as_usual() {
        let lines = reported(|_| ());
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert_eq!(lines[0].0, "Distribution of the stated error");
        assert!(lines[0].1.ends_with(" degrees of freedom"), "{lines:?}");
    }

    #[test]
    fn a_widening_that_changes_no_figure_is_not_said() {
        let widened = |times: f64| Overdispersion {
            factor: times * times,
            by: Some(Evidence::Neighbours),
            lens: 1.0,
            checks: Vec::new(),
        };
        let is_reported = |times| {
            let lines = reported(|calibration| calibration.joint.as_mut().expect("joint").widening = widened(times));
            lines.iter().any(|(what, _)| what == "Uncertainty widened")
        };
        assert!(!is_reported(1.01) && is_reported(1.1));
    }

    #[test]
    fn everything_is_said_with_its_unit() {
        let lines = reported(|c| {
            c.views[0].status = ViewStatus::Outlier;
            c.views[1].rejected_corners = vec![3, 4];
            c.views[2].rejected_corners = vec![5];
            let joint = c.joint.as_mut().expect("a joint estimate");
            joint.shape = Some(ShapeEstimate {
                shape: BoardShape { warp_m: [4e-4, -1e-4], scale: 1.001 },
                warp_sigma_m: Some([3e-5, 2e-5]),
                scale_sigma: Some(2e-4),
            });
            joint.noise.view_px = 0.12;
            joint.widening =
                Overdispersion { factor: 4.0, by: Some(Evidence::Neighbours), lens: 1.0, checks: Vec::new() };
            joint.small_sample.degrees_of_freedom = f64::INFINITY;
        });
        for (what, value) in [
            ("Outlier views", "1 of 10"),
            ("Outlier corners", "3, in 2 of 10 views"),
            ("Bend of the board", "x 0.400 ± 0.030 mm, y -0.100 ± 0.020 mm"),
            ("Size of the board", "100.100 ± 0.020 %"),
            ("Noise of views", "0.120 px"),
            ("Uncertainty widened", "2.0 times"),
            ("Distribution of the stated error", "normal"),
        ] {
            assert!(has(&lines, what, value), "{what}: {value} in {lines:?}");
        }
    }
}
