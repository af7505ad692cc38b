//! How many reachable goals the inverse kinematics reaches, and how long it takes.
//!
//!     cargo run --release -p handeye_studies --example inverse_kinematics -- GOALS
//!
//! A goal is where the tip is with joint values drawn evenly from their ranges; the search starts at others, drawn the same
//! way. One line for each arm: goals reached to 1e-6 m and rad within the ranges, time of one goal in milliseconds (median,
//! 99th percentile, longest), and the median of the largest joint motion, for the answer and for the values that produced
//! the goal.

use std::error::Error;
use std::time::Instant;

use handeye_arm::testing as arms;
use handeye_arm::{Arm, ArmKind};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

fn draw(rng: &mut ChaCha8Rng, arm: &Arm) -> Vec<f64> {
    let parts: Vec<f64> = (0..arm.joint_count()).map(|_| rng.random_range(0.0..1.0)).collect();
    arms::values_at(arm, parts)
}

fn largest_move(from: &[f64], to: &[f64]) -> f64 {
    from.iter().zip(to).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn quantile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * part).round() as usize]
}

fn study(name: &str, arm: &Arm, goals: usize) -> Result<(), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(14);
    let (mut reached, mut times_ms, mut moves, mut made) = (0, Vec::new(), Vec::new(), Vec::new());
    for _ in 0..goals {
        let (makes, near) = (draw(&mut rng, arm), draw(&mut rng, arm));
        let goal = arm.forward(&makes)?;
        let begun = Instant::now();
        let found = arm.inverse(&goal, &near);
        times_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        if let Ok(found) = found {
            let (distance_m, angle_rad) = arm.forward(&found)?.distance_to(&goal);
            reached += usize::from(distance_m < 1e-6 && angle_rad < 1e-6 && arm.first_violation(&found).is_none());
            moves.push(largest_move(&near, &found));
            made.push(largest_move(&near, &makes));
        }
    }
    let mut time = |part| quantile(&mut times_ms, part);
    println!(
        "{name:16} {:2} joints  {:7.3} % of {goals} reached  {:6.3} / {:6.3} / {:6.3} ms  moves {:.2} (made with {:.2})",
        arm.joint_count(),
        100.0 * f64::from(u32::try_from(reached)?) / goals as f64,
        time(0.5),
        time(0.99),
        time(1.0),
        quantile(&mut moves, 0.5),
        quantile(&mut made, 0.5),
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let goals = std::env::args().nth(1).map_or(Ok(10_000), |text| text.parse())?;
    for kind in ArmKind::ALL {
        study(kind.name(), &kind.arm(), goals)?;
    }
    for file in arms::ALL {
        study(file.name, &file.arm()?, goals)?;
    }
    Ok(())
}
