//! The crate `vision-calibration` on corners from files; see `tests/studies/solver_times.rs` for the format.
//!
//! ```text
//! solver_peers FILE REPEATS                                        times the calibration of the camera
//! solver_peers hand-eye eye_in_hand|eye_to_hand estimate|FX,…,K3 FILE…      calibrates camera and hand-eye
//! ```
//!
//! Prints a line of JSON for each file.

mod hand_eye;

use std::error::Error;
use std::time::Instant;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use vision_calibration::core::{CameraFix, DistortionParams, Iso3};
use vision_calibration::planar_intrinsics::{PlanarIntrinsicsConfig, run_calibration};
use vision_calibration::prelude::*;

fn numbers(line: &str, separator: char) -> Result<Vec<f64>, std::num::ParseFloatError> {
    line.split(separator).filter(|part| !part.is_empty()).map(|part| part.trim().parse()).collect()
}

/// What a file has.
struct Session {
    views: Vec<CorrespondenceView>,
    base_from_tip: Vec<Iso3>,
}

fn session(path: &str) -> Result<Session, Box<dyn Error>> {
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let head = numbers(lines.next().ok_or("the file is empty")?, ' ')?;
    let &[_, _, columns, rows, square_m] = &head[..] else { return Err("five numbers come first".into()) };
    let points: Vec<Pt3> = (0..(columns * rows) as usize)
        .map(|i| Pt3::new((i % columns as usize) as f64 * square_m, (i / columns as usize) as f64 * square_m, 0.0))
        .collect();
    let mut session = Session { views: Vec::new(), base_from_tip: Vec::new() };
    for line in lines {
        let n = numbers(line, ' ')?;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[3], n[4], n[5], n[6]));
        session.base_from_tip.push(Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation));
        let pixels = n[7..].chunks_exact(2).map(|p| Pt2::new(p[0], p[1])).collect();
        session.views.push(CorrespondenceView::new(points.clone(), pixels)?);
    }
    Ok(session)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [command, mode, lens, files @ ..] = &arguments[..]
        && command == "hand-eye"
    {
        let lens = if lens == "estimate" { None } else { Some(numbers(lens, ',')?) };
        hand_eye::run(mode, lens.as_deref(), files);
        return Ok(());
    }
    let [path, repeats] = &arguments[..] else { return Err("usage: solver_peers FILE REPEATS".into()) };
    let repeats: usize = repeats.parse()?;
    let Session { views, .. } = session(path)?;
    let mut best: Option<(f64, String)> = None;
    for _ in 0..repeats.max(1) {
        let dataset = PlanarDataset::new(views.iter().cloned().map(View::without_meta).collect())?;
        let mut session = CalibrationSession::<PlanarIntrinsicsProblem>::new();
        let mut config = PlanarIntrinsicsConfig::default();
        // By default it keeps k3 at zero.
        config.camera.fix = CameraFix { distortion: Some(Vec::new()), ..CameraFix::default() };
        session.set_config(config)?;
        session.set_input(dataset)?;
        let start = Instant::now();
        run_calibration(&mut session)?;
        let seconds = start.elapsed().as_secs_f64();
        let output = session.output().ok_or("no result")?;
        let k = output.params.camera.intrinsics;
        let DistortionParams::BrownConrady5 { params: d } = output.params.camera.distortion else {
            return Err("another lens model".into());
        };
        // Its cost is half the sum of squares.
        let text = format!(
            r#"{{"camera": [{}, {}, {}, {}, {}, {}, {}, {}, {}], "cost": {}, "seconds": {seconds}}}"#,
            k.fx,
            k.fy,
            k.cx,
            k.cy,
            d.k1,
            d.k2,
            d.p1,
            d.p2,
            d.k3,
            2.0 * output.report.final_cost
        );
        if best.as_ref().is_none_or(|(fastest, _)| seconds < *fastest) {
            best = Some((seconds, text));
        }
    }
    println!("{}", best.ok_or("no run")?.1);
    Ok(())
}
