//! The results as Markdown.

use std::fmt::Write as _;

use handeye_estimate::handeye::Mode;

use crate::scene::Cell;
use crate::tally::{Performance, Ratio, Summary};

fn mode(cell: &Cell) -> &'static str {
    match cell.mode {
        Mode::EyeInHand => "in hand",
        Mode::EyeToHand => "to hand",
    }
}

fn robot(cell: &Cell) -> String {
    if cell.noise.robot_m == 0.0 {
        return "exact".to_owned();
    }
    let field = if cell.noise.field_m > 0.0 { ", affine field" } else { "" };
    format!("{:.1} mm, {:.2}°{field}", cell.noise.robot_m * 1e3, cell.noise.robot_rad.to_degrees())
}

fn lead(cell: &Cell) -> String {
    let robot = robot(cell);
    let lens = if cell.free_intrinsics { "unknown" } else { "known" };
    format!("| {} | {lens} | {} | {robot} | {:.2} px |", mode(cell), cell.poses, cell.noise.corner_px)
}

const LEAD: &str = "| eye | lens | poses | robot | corners |";
const LEAD_RULE: &str = "| --- | --- | --- | --- | --- |";

fn ratio(r: &Ratio) -> String {
    format!("{:.3} ± {:.3}", r.value, r.sigma)
}

/// Writing into a `String` cannot fail.
macro_rules! append {
    ($out:expr, $($arg:tt)*) => {{
        let _infallible = write!($out, $($arg)*);
    }};
}

fn joined(parts: impl Iterator<Item = String>) -> String {
    parts.collect::<Vec<_>>().concat()
}

/// Errors of the joint estimate and of every closed form relative to the bound.
pub fn errors(summaries: &[Summary]) -> String {
    let names = summaries.first().map(|s| s.closed_forms.iter().map(|c| c.0).collect::<Vec<_>>()).unwrap_or_default();
    let mut out = format!(
        "{LEAD} bound mm | bound ° | given: t | given: r | estimated: t | estimated: r |{}\n{LEAD_RULE} --- | --- | --- | --- | --- | --- |{}\n",
        joined(names.iter().map(|n| format!(" {n} |"))),
        " --- |".repeat(names.len()),
    );
    for s in summaries {
        let closed = joined(s.closed_forms.iter().map(|(_, t, r, _)| format!(" {:.1} / {:.1} |", t.value, r.value)));
        append!(
            out,
            "{} {:.4} | {:.4} | {} | {} | {} | {} |{closed}\n",
            lead(&s.cell),
            s.bound.0 * 1e3,
            s.bound.1.to_degrees(),
            ratio(&s.given.translation),
            ratio(&s.given.rotation),
            ratio(&s.estimated.translation),
            ratio(&s.estimated.rotation),
        );
    }
    out
}

/// Coverage of the stated regions.
pub fn coverage(summaries: &[Summary]) -> String {
    let mut out = format!(
        "{LEAD} given: region % | tip % | mean m²/6 | estimated: region % | tip % | mean m²/6 | outliers too many | trials | failed | ms a trial |\n{LEAD_RULE}{}\n",
        " --- |".repeat(10)
    );
    for s in summaries {
        let covered = |p: &Performance| {
            format!("{:.1} | {:.1} | {:.2}", p.covered * 100.0, p.tip_covered * 100.0, p.mean_mahalanobis2 / 6.0)
        };
        append!(
            out,
            "{} {} | {} | {:.3} | {} | {} + {} | {:.1} |\n",
            lead(&s.cell),
            covered(&s.given),
            covered(&s.estimated),
            s.estimated.outliers,
            s.trials,
            s.given.failures,
            s.estimated.failures,
            s.seconds * 1e3 / s.trials.max(1) as f64,
        );
    }
    out
}

/// Estimated over true noise levels: root mean square, and their scatter next to the smallest possible.
pub fn levels(summaries: &[Summary]) -> String {
    let mut out = format!(
        "{LEAD} corner noise | scatter (least) | robot, translation | scatter (least) | robot, rotation | scatter (least) |\n{LEAD_RULE}{}\n",
        " --- |".repeat(6)
    );
    for s in summaries {
        out += &lead(&s.cell);
        for i in 0..3 {
            let e = &s.estimated;
            let unit = [" px", " µm", " m°"][i];
            if i > 0 && s.cell.noise.robot_m == 0.0 {
                append!(out, " {:.2}{unit} | {:.2}{unit} |", e.noise[i], e.noise_scatter[i]);
            } else {
                append!(out, " {:.3} | {:.3} ({:.3}) |", e.noise[i], e.noise_scatter[i], s.level_scatter[i]);
            }
        }
        out.push('\n');
    }
    out
}

/// Coverage with estimated noise levels over all cells of a lens, a robot and a number of views, with its standard error
/// and how many cells there are.
pub fn pooled(summaries: &[Summary]) -> String {
    let mut out = "| lens | robot | poses | cells | region % | tip % | cells with a tip beyond 93 to 97 % |\n| --- | --- | --- | --- | --- | --- | --- |\n".to_owned();
    let lens = |s: &Summary| if s.cell.free_intrinsics { "unknown" } else { "known" };
    let key = |s: &Summary| (lens(s), robot(&s.cell), s.cell.poses);
    let mut rows: Vec<(&str, String, usize)> = Vec::new();
    for summary in summaries {
        if !rows.contains(&key(summary)) {
            rows.push(key(summary));
        }
    }
    for row in rows {
        let cells: Vec<&Summary> = summaries.iter().filter(|s| key(s) == row).collect();
        let trials: f64 = cells.iter().map(|s| s.trials as f64).sum();
        let pooled = |of: fn(&Performance) -> f64| {
            let share = cells.iter().map(|s| of(&s.estimated) * s.trials as f64).sum::<f64>() / trials;
            format!("{:.1} ± {:.1}", share * 100.0, (share * (1.0 - share) / trials).sqrt() * 100.0)
        };
        let beyond = cells.iter().filter(|s| !(0.93..=0.97).contains(&s.estimated.tip_covered)).count();
        let (lens, robot, poses) = row;
        let (region, tip) = (pooled(|p| p.covered), pooled(|p| p.tip_covered));
        append!(out, "| {lens} | {robot} | {poses} | {} | {region} | {tip} | {beyond} |\n", cells.len());
    }
    out
}

/// Failures, one line per cell.
pub fn failures(summaries: &[Summary]) -> String {
    let mut out = String::new();
    for s in summaries {
        let all = [
            (s.unusable, s.first_unusable.as_ref()),
            (s.given.failures, s.given.first_failure.as_ref()),
            (s.estimated.failures, s.estimated.first_failure.as_ref()),
        ];
        for (count, words) in all {
            if let Some(words) = words {
                append!(out, "{} {count} failed, the first: {words}\n", lead(&s.cell));
            }
        }
        if !s.far.is_empty() {
            let trials: Vec<String> = s.far.iter().map(|(number, times)| format!("{number} ({times:.0}×)")).collect();
            append!(out, "{} far from the truth, trial (times its bound): {}\n", lead(&s.cell), trials.join(", "));
        }
        for (name, _, _, failed) in s.closed_forms.iter().filter(|c| c.3 > 0) {
            append!(out, "{} {name} failed in {failed}\n", lead(&s.cell));
        }
    }
    out
}
