//! Times our solvers on corners from a file, for `tests/bench/solvers.py`.
//!
//!     cargo run --release -p handeye_studies --example solver_times -- FILE REPEATS
//!
//! The first line of FILE is `width height columns rows square_m`, every other a view: `base_from_tip` as three metres and
//! the quaternion `w x y z`, then `u v` of all corners. Prints one JSON object: the camera, its cost in squared pixels,
//! and the best of this many batches in seconds of processor time: of the intrinsics from a flat board, of the same as in
//! `calibrate` (wrong corners, a bend, what may be stated) and of the whole calibration; and the peak memory in megabytes,
//! with the intrinsics and with the whole.

use std::error::Error;

use handeye_estimate::diagnose::calibrate;
use handeye_estimate::handeye::Mode;
use handeye_estimate::intrinsics::{Bend, Options, SeenView, solve, solve_screened};
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView};
use handeye_geometry::camera::Distortion;
use handeye_geometry::frames::Pose;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_geometry::targets::{Grid, TargetSpec};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector2};

fn read(path: &str) -> Result<Observations, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let head: Vec<f64> = numbers(lines.next().ok_or("the file is empty")?)?;
    let &[width, height, columns, rows, square_m] = &head[..] else { return Err("five numbers come first".into()) };
    let model = Distortion::BrownConrady([0.0; 5]);
    let mut views = Vec::new();
    for (i, line) in lines.enumerate() {
        let n = numbers(line)?;
        let (&[x, y, z, qw, qx, qy, qz], px) = n.split_first_chunk::<7>().ok_or("a view begins with a pose")?;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
        let corners = px.chunks_exact(2).enumerate().map(|(i, p)| Corner::new(i, Vector2::new(p[0], p[1])));
        let base_from_tip = Pose::from_isometry(Isometry3::from_parts(Translation3::new(x, y, z), rotation));
        views.push(ObservedView::new(i.to_string(), Some(base_from_tip), Some(corners.collect())));
    }
    Ok(Observations {
        mode: Some(Mode::EyeInHand),
        target: TargetSpec::Chessboard(Grid { columns: columns as usize, rows: rows as usize, square_m }),
        image_size: (width as u32, height as u32),
        camera: CameraKnowledge::Estimate { model, start: None },
        views,
    })
}

fn numbers(line: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    line.split_ascii_whitespace().map(str::parse).collect()
}

/// Hertz of the clock that counts processor time in `/proc`.
const TICKS: f64 = 100.0;
/// A batch of runs takes this many seconds of processor time, thirty ticks.
const BATCH: f64 = 0.3;

/// Processor time of the process and its peak memory so far, as counted by Linux: seconds and megabytes.
fn usage() -> Option<(f64, f64)> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The name of the program, in brackets, may have spaces in it.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_ascii_whitespace().collect();
    let ticks = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some((ticks / TICKS, peak.split_ascii_whitespace().next()?.parse::<f64>().ok()? / 1024.0))
}

/// The result and the processor time of a run, seconds: the best of this many batches.
fn timed<T, E: Into<Box<dyn Error>>>(
    repeats: usize,
    work: impl Fn() -> Result<T, E>,
) -> Result<(T, f64), Box<dyn Error>> {
    let clock = || usage().map(|(seconds, _)| seconds).ok_or("processor time is read from /proc, which only Linux has");
    let mut best = f64::INFINITY;
    for _ in 0..repeats {
        let (before, mut runs) = (clock()?, 0.0);
        while clock()? < before + BATCH {
            // Its result is dropped before the next run, so that the peak memory is that of one.
            work().map_err(Into::into)?;
            runs += 1.0;
        }
        best = best.min((clock()? - before) / runs);
    }
    Ok((work().map_err(Into::into)?, best))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, repeats] = &arguments[..] else { return Err("usage: solver_times FILE REPEATS".into()) };
    let repeats = repeats.parse()?;
    let observations = read(path)?;
    let CameraKnowledge::Estimate { model, .. } = observations.camera else { return Err("no model".into()) };
    let seen: Vec<SeenView<'_>> =
        observations.views.iter().filter_map(|v| v.corners.as_deref()).map(SeenView::unweighted).collect();
    let cancel = CancelToken::default();
    let (found, seconds) =
        timed(repeats, || solve(&seen, &observations.target, observations.image_size, &Options::new(model), &cancel))?;
    let corners: Vec<&Corners> = observations.views.iter().filter_map(|v| v.corners.as_ref()).collect();
    let options = Options { bend: Bend::IfShown, ..Options::new(model) };
    let (target, size) = (&observations.target, observations.image_size);
    let (_, screened) = timed(repeats, || solve_screened(&corners, target, size, &options, false, &cancel))?;
    let memory_mb = || usage().map(|(_, megabytes)| megabytes);
    let with_intrinsics = memory_mb();
    let (_, whole) = timed(repeats, || calibrate(&observations, Method::Joint, &cancel))?;
    let camera = found.intrinsics.parameters();
    println!(
        "{}",
        serde_json::json!({
            "camera": camera, "cost": found.cost, "seconds": seconds, "screened_seconds": screened,
            "whole_seconds": whole, "memory_mb": with_intrinsics, "whole_memory_mb": memory_mb(),
        })
    );
    Ok(())
}
