//! Which joint offsets a session of the cell can tell beside the hand-eye transform.

#[path = "../../../studies/information.rs"]
mod information;

use handeye_cell::scene::Scene;
use handeye_plan::ViewOptions;
use information::{Information, Noise, random_views};

#[test]
fn the_first_and_the_last_joint_are_absorbed_and_the_four_between_are_told() {
    let scene = Scene::realistic().expect("built in");
    let noise = Noise { corner_px: 0.1, robot_m: 0.05e-3, robot_rad: 0.01_f64.to_radians() };
    for seed in 1..=3 {
        let truth = scene.resolve(seed).expect("valid");
        let views = random_views(&truth, 20, &ViewOptions { seed, ..ViewOptions::default() });
        let information = Information::of(&truth, &views, &noise);
        let directions = information.directions();
        // Nothing is known of two directions but rounding: a part in 10¹² of the information on the best known.
        for (sigma_deg, direction) in &directions[..2] {
            assert!(*sigma_deg > 100.0, "seed {seed}: {sigma_deg}° along {direction}");
            assert!(direction.rows(1, 4).norm() < 1e-3, "seed {seed}: {direction}");
        }
        for (sigma_deg, direction) in &directions[2..] {
            assert!(*sigma_deg < 0.2, "seed {seed}: {sigma_deg}° along {direction}");
        }
        // What is absorbed does no harm to what is not asked: the place of the board takes joint 1, the hand-eye joint 6.
        let offset = 0.2_f64.to_radians();
        let (first, last) = (information.bias(0, offset), information.bias(5, offset));
        assert!(first.rows(0, 6).norm() < 1e-6 * offset, "joint 1 moves the hand-eye by {first}");
        assert!(last.rows(6, 6).norm() < 1e-6 * offset, "joint 6 moves the board by {last}");
        assert!((last.rows(3, 3).norm() - offset).abs() < 1e-6 * offset, "the hand-eye turns by as much as joint 6");
    }
}
