//! Which joint offsets a session can tell, and what it costs to ask: `cargo run --example joint_offset_study -- SEEDS`.

#[path = "information.rs"]
mod information;

use handeye_cell::scene::Scene;
use handeye_plan::ViewOptions;
use information::{Information, JOINTS, Noise, POSES, SCALE, UNKNOWNS, random_views};
use nalgebra::DMatrix;

type Failure = Box<dyn std::error::Error>;

/// The offset whose harm is shown, degrees.
const OFFSET_DEG: f64 = 0.2;
/// What a person knows of an offset before, degrees.
const PRIOR_DEG: f64 = 1.0;

fn main() -> Result<(), Failure> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(20), |text| text.parse())?;
    let scene = Scene::realistic()?;
    let noises = [
        ("robot 0.02 mm, 0.004°, corners 0.03 px", noise(0.02, 0.004, 0.03)),
        ("robot 0.05 mm, 0.01°, corners 0.1 px", noise(0.05, 0.01, 0.1)),
        ("robot 0.5 mm, 0.1°, corners 0.1 px", noise(0.5, 0.1, 0.1)),
    ];
    let narrow = ViewOptions { cone_rad: 15_f64.to_radians(), roll_rad: 20_f64.to_radians(), ..ViewOptions::default() };
    for (views, look, geometry) in [
        (10, ViewOptions::default(), "tilts to 45°, every roll"),
        (20, ViewOptions::default(), "tilts to 45°, every roll"),
        (40, ViewOptions::default(), "tilts to 45°, every roll"),
        (20, narrow, "tilts to 15°, rolls to 20°"),
    ] {
        for (name, noise) in noises {
            println!("\n{views} views, {geometry}, {name}, median of {seeds} sessions");
            study(&scene, views, &look, &noise, seeds)?;
        }
    }
    Ok(())
}

fn noise(robot_mm: f64, robot_deg: f64, corner_px: f64) -> Noise {
    Noise { corner_px, robot_m: robot_mm * 1e-3, robot_rad: robot_deg.to_radians() }
}

fn study(scene: &Scene, views: usize, look: &ViewOptions, noise: &Noise, seeds: u64) -> Result<(), Failure> {
    let mut table = Table::default();
    for seed in 1..=seeds {
        let truth = scene.resolve(seed)?;
        let views = random_views(&truth, views, &ViewOptions { seed, ..*look });
        let information = Information::of(&truth, &views, noise);
        let prior_rad = PRIOR_DEG.to_radians();
        for (rank, (sigma_deg, _)) in information.directions().into_iter().enumerate() {
            table.add(&format!("σ of direction {} [°], no prior", rank + 1), sigma_deg);
        }
        let inner = [false, true, true, true, true, false];
        let covariance = |joints, scale| covariance(&information, joints, scale, prior_rad);
        let (none, all, some) =
            (covariance([false; JOINTS], false)?, covariance([true; JOINTS], false)?, covariance(inner, false)?);
        let (scale, scale_and_some) = (covariance([false; JOINTS], true)?, covariance(inner, true)?);
        for j in 0..JOINTS {
            let sigma_deg = |c: &DMatrix<f64>| c[(POSES + j, POSES + j)].sqrt().to_degrees();
            table.add(&format!("σ of joint {} [°], prior {PRIOR_DEG}° on all", j + 1), sigma_deg(&all));
            if inner[j] {
                table.add(&format!("σ of joint {} [°], prior {PRIOR_DEG}°, 1 and 6 fixed", j + 1), sigma_deg(&some));
                table.add(
                    &format!("σ of joint {} [°], the same with the scale free", j + 1),
                    sigma_deg(&scale_and_some),
                );
            }
            let bias = information.bias(j, OFFSET_DEG.to_radians());
            table.add(&format!("bias of the hand-eye [mm], {OFFSET_DEG}° in joint {}", j + 1), length(&bias) * 1e3);
        }
        for (what, covariance) in [("no offsets", &none), ("2 to 5 free", &some), ("all free", &all)] {
            let sigma_m = (0..3).map(|i| covariance[(i, i)]).sum::<f64>().sqrt();
            table.add(&format!("σ of the hand-eye's translation [mm], {what}"), sigma_m * 1e3);
        }
        for (what, covariance) in [("no offsets", &scale), ("2 to 5 free", &scale_and_some)] {
            table.add(&format!("σ of the scale [%], {what}"), covariance[(SCALE, SCALE)].sqrt() * 100.0);
        }
    }
    table.print();
    Ok(())
}

/// Covariance of all unknowns when the offsets of `joints` have a prior of `prior_rad` and the others are zero, and the
/// scale is free or known. Rows of what is known are zero.
fn covariance(
    information: &Information,
    joints: [bool; JOINTS],
    scale: bool,
    prior_rad: f64,
) -> Result<DMatrix<f64>, Failure> {
    let free = |i: usize| i < POSES || if i == SCALE { scale } else { joints[i - POSES] };
    let chosen: Vec<usize> = (0..UNKNOWNS).filter(|&i| free(i)).collect();
    let mut normal = information.0.select_rows(&chosen).select_columns(&chosen);
    for (i, &unknown) in chosen.iter().enumerate() {
        if (POSES..SCALE).contains(&unknown) {
            normal[(i, i)] += prior_rad.powi(-2);
        }
    }
    let small = normal.cholesky().ok_or("the views do not determine the poses")?.inverse();
    let mut out = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
    for (i, &row) in chosen.iter().enumerate() {
        for (j, &column) in chosen.iter().enumerate() {
            out[(row, column)] = small[(i, j)];
        }
    }
    Ok(out)
}

fn length(bias: &nalgebra::DVector<f64>) -> f64 {
    bias.rows(0, 3).norm()
}

/// Values by what they are, in the order in which they came.
#[derive(Default)]
struct Table(Vec<(String, Vec<f64>)>);

impl Table {
    fn add(&mut self, what: &str, value: f64) {
        match self.0.iter_mut().find(|(name, _)| name == what) {
            Some((_, values)) => values.push(value),
            None => self.0.push((what.to_owned(), vec![value])),
        }
    }

    fn print(&mut self) {
        for (name, values) in &mut self.0 {
            values.sort_by(f64::total_cmp);
            println!("  {name:<58} {:>12.4}", values[values.len() / 2]);
        }
    }
}
