//! The results of the checks of the stated uncertainty for every set.

use handeye_estimate::handeye::joint::{Free, ShownEffects};
use handeye_estimate::uncertainty::{overdispersion, quality};
use handeye_geometry::progress::CancelToken;

use crate::methods::Choice;
use crate::sets::Set;

pub fn run(set: &Set) {
    if !set.has_corners() {
        return;
    }
    let all: Vec<usize> = (0..set.views.len()).collect();
    let choice = Choice::new(set, &all);
    let mut variants = vec![("joint", Free::default())];
    variants.extend(crate::methods::variants(set));
    for (name, free) in variants {
        let Some(kept) = choice.joint(set, free) else {
            println!("{}, {name}: no answer", set.name);
            continue;
        };
        let (problem, solution) = (kept.problem(set), &kept.solution);
        let before = std::time::Instant::now();
        let widening = match overdispersion::check(&problem, solution, ShownEffects::default(), &CancelToken::default())
        {
            Ok(widening) => widening,
            Err(error) => {
                println!("{}: {error}", set.name);
                continue;
            }
        };
        let took = before.elapsed();
        let covariance = solution.hand_eye_covariance();
        let mut widened = solution.clone();
        widened.widen(&widening);
        let mm = |c| quality::tip_error_95_at(&c, solution.small_sample, &solution.reference_point) * 1e3;
        let t_mm = solution.hand_eye.mount_from_camera().translation() * 1e3;
        println!(
            "\n{}, {name}: {} of {} views; robot {:.3} mm {:.4}°, corners {:.4} px, view {:.4} px; scale {:.4} ± {:.4}; t {:.2} {:.2} \
             {:.2} mm; {:.0} degrees of freedom; expected tip error {:.3} mm, widened {:.3} mm by {:?} ({:.1} ms)",
            set.name,
            kept.views.len(),
            all.len(),
            solution.noise.robot_m * 1e3,
            solution.noise.robot_rad.to_degrees(),
            solution.noise.corner_px,
            solution.noise.view_px,
            solution.shape.scale,
            solution.scale_sigma().unwrap_or(0.0),
            t_mm.x,
            t_mm.y,
            t_mm.z,
            solution.small_sample.degrees_of_freedom,
            mm(covariance),
            mm(widened.hand_eye_covariance()),
            widening.by,
            took.as_secs_f64() * 1e3,
        );
        for check in &widening.checks {
            let mark = if check.is_significant() { " *" } else { "" };
            println!("    {:?}: ratio {:.2}, p {:.3}{mark}", check.by, check.ratio, check.p_value);
        }
    }
}
