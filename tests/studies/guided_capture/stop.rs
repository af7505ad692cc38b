//! What is true when guided capture ends by itself.

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::Noise;
use handeye_plan::guided::{Ending, GuidedOptions, Step};
use handeye_plan::testing::guided_cell::{CellArm, CellSetup, GuidedCell, GuidedRun, HiddenErrors};
use handeye_simulate::session::REALISTIC;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

pub fn stop(sessions: u64, only: &str) {
    println!("at the end of guided sessions, {sessions} for each row and set-up:");
    println!(
        "{:44}{:>8}{:>10}{:>10}{:>8}{:>8}{:>8}{:>9}",
        "", "reached", "< stated", "< goal", "views", "90 %", "failed", "promise"
    );
    let as_said = HiddenErrors::NOTHING;
    let field = Noise { field_m: 1.5e-3, ..REALISTIC };
    let rows: [(&str, f64, Noise, bool, HiddenErrors); 9] = [
        ("goal 0.1 mm, 0.1 px, 0.1 mm, 0.02°", 1e-4, REALISTIC, false, as_said),
        ("goal 0.2 mm", 2e-4, REALISTIC, false, as_said),
        ("goal 0.4 mm", 4e-4, REALISTIC, false, as_said),
        (
            "goal 0.6 mm, 0.3 px, 0.5 mm, 0.1°",
            6e-4,
            Noise { corner_px: 0.3, robot_m: 5e-4, robot_rad: 0.1_f64.to_radians(), ..Noise::EXACT },
            false,
            as_said,
        ),
        ("goal 0.5 mm, lens estimated", 5e-4, REALISTIC, true, as_said),
        ("goal 0.4 mm, board bent by 1 mm", 4e-4, REALISTIC, false, HiddenErrors { bend_m: [1e-3, 0.6e-3], ..as_said }),
        ("goal 0.5 mm, lens said to be 1 % longer", 5e-4, REALISTIC, false, HiddenErrors { focal: 0.99, ..as_said }),
        ("goal 1 mm, robot off by 1.5 mm by place", 1e-3, field, false, as_said),
        ("goal 2 mm, robot off by 1.5 mm by place", 2e-3, field, false, as_said),
    ];
    for (name, goal_m, noise, free_lens, hidden) in rows.into_iter().filter(|row| row.0.contains(only)) {
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let runs: Vec<_> = (0..sessions)
                .into_par_iter()
                .map(|seed| {
                    let arm = CellArm::ALL[seed as usize % 3];
                    GuidedCell::new(CellSetup { noise, free_lens, hidden, ..CellSetup::new(arm, mode, 1000 + seed) })
                        .run(GuidedOptions { goal_m, seed, ..GuidedOptions::default() })
                })
                .collect();
            // For runs whose last answer states an error.
            let last = |run: &GuidedRun| run.history.last().copied().filter(|last| last.0 == run.times_s.len());
            let ended: Vec<_> = runs.iter().filter_map(|run| last(run).map(|last| (run, last))).collect();
            let share = |of: &dyn Fn(&(usize, f64, f64)) -> bool, among: &dyn Fn(&Ending) -> bool| {
                let among: Vec<_> = ended.iter().filter(|(run, _)| among(&run.ending)).collect();
                100.0 * among.iter().filter(|(_, last)| of(last)).count() as f64 / among.len().max(1) as f64
            };
            let is_reached = |ending: &Ending| matches!(ending, Ending::GoalReached { .. });
            let reached = ended.iter().filter(|(run, _)| is_reached(&run.ending)).count() as f64 / sessions as f64;
            let mut views: Vec<usize> = ended.iter().map(|(_, last)| last.0).collect();
            views.sort_unstable();
            let mut promises: Vec<f64> =
                runs.iter().flat_map(|run| run.steps.iter().filter_map(Step::achieved_over_promised)).collect();
            promises.sort_by(f64::total_cmp);
            let failed = runs.iter().map(|run| run.failed).sum::<usize>() as f64 / sessions as f64;
            println!(
                "{:44}{:>7.1}%{:>9.1}%{:>9.1}%{:>8.1}{:>8}{:>8.2}{:>9.2}",
                format!("{name}, {mode:?}"),
                100.0 * reached,
                share(&|last| last.2 < last.1, &|_| true),
                share(&|last| last.2 < goal_m, &is_reached),
                views.iter().sum::<usize>() as f64 / views.len().max(1) as f64,
                views[views.len() * 9 / 10],
                failed,
                promises[promises.len() / 2],
            );
        }
    }
}
