use super::*;
use crate::handeye::Mode;
use crate::handeye::joint::optimise::{self, Descent};
use crate::handeye::joint::problem::Free;
use crate::handeye::joint::state::State;
use crate::handeye::joint::variance::{evaluate, to_logs};
use crate::handeye::joint::{JointProblem, Noise};
use crate::test_sessions::Estimated as _;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::session::{Setup, session};

/// The count of a level is `θ_k tr(P V_k)`, so its derivative by the log of another variance is minus twice the information.
#[test]
fn counts_change_with_the_levels_as_the_information_says() {
    let noise = Noise {
        view_px: 0.2,
        field_m: 8e-4,
        field_rad: 2e-3,
        link_rad: 1e-3,
        link_m: 3e-4,
        compliance_rad: 8e-4,
        ..Noise { corner_px: 0.15, robot_m: 3e-4, robot_rad: 5e-4, ..Noise::EXACT }
    };
    let nothing = Levels { view: false, field: false, arm: false };
    for levels in [Levels { view: true, field: true, arm: true }, Levels { arm: true, ..nothing }, nothing] {
        let t = session(&Setup { joints: true, noise, ..Setup::new(Mode::EyeInHand, 12, 7) });
        let mut noise = noise;
        if !levels.field {
            (noise.view_px, noise.field_m, noise.field_rad) = (0.0, 0.0, 0.0);
        }
        if !levels.arm {
            (noise.link_rad, noise.link_m, noise.compliance_rad) = (0.0, 0.0, 0.0);
        }
        let plain = t.problem(true, Some(noise));
        let problem =
            JointProblem { free: Free { field: levels.field, arm: levels.arm, warp: true, ..plain.free }, ..plain };
        let mut state = State::new(&problem, &t.start());
        let cancel = CancelToken::default();
        let start = System::new(&problem, &state, &cancel).expect("regular");
        let descent = Descent { problem: &problem, noise: &noise, damping: optimise::FAR };
        let (system, _) = optimise::minimise(descent, &mut state, start, &cancel).expect("solves");
        let logs = to_logs(&noise);
        let at = evaluate(&system, &logs, levels).expect("regular");
        let found = information(&system, &noise, &at, levels);
        for l in levels.estimated() {
            const STEP: f64 = 1e-4;
            let counts = |sign: f64| {
                let mut moved = logs;
                moved[l] += sign * STEP;
                if l == 0 && !levels.view {
                    moved[3] += sign * STEP;
                }
                levels.folded(evaluate(&system, &moved, levels).expect("regular").counts)
            };
            let slope = (counts(1.0) - counts(-1.0)) / (2.0 * STEP);
            let own = levels.folded(at.counts);
            for k in levels.estimated() {
                let expected = f64::from(k == l) * own[k] - 2.0 * found[(k, l)];
                assert!(
                    (slope[k] - expected).abs() < 1e-5 * own[k].max(1.0),
                    "{levels:?} {k} {l}: {} {expected}",
                    slope[k]
                );
            }
        }
    }
}
