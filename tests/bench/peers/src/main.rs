//! Times the crate `vision-calibration` on corners from a file; see `core/studies/solver_times.rs` for the format.
//! Prints a line of JSON.

use std::error::Error;
use std::time::Instant;

use vision_calibration::core::{CameraFix, DistortionParams};
use vision_calibration::planar_intrinsics::{PlanarIntrinsicsConfig, run_calibration};
use vision_calibration::prelude::*;

fn numbers(line: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    line.split_ascii_whitespace().map(str::parse).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, repeats] = &arguments[..] else { return Err("usage: solver_peers FILE REPEATS".into()) };
    let repeats: usize = repeats.parse()?;
    let text = std::fs::read_to_string(path)?;
    let mut lines = text.lines();
    let head = numbers(lines.next().ok_or("the file is empty")?)?;
    let &[_, _, columns, rows, square_m] = &head[..] else { return Err("five numbers come first".into()) };
    let points: Vec<Pt3> = (0..(columns * rows) as usize)
        .map(|i| Pt3::new((i % columns as usize) as f64 * square_m, (i / columns as usize) as f64 * square_m, 0.0))
        .collect();
    let mut views = Vec::new();
    for line in lines {
        let n = numbers(line)?;
        let pixels = n[7..].chunks_exact(2).map(|p| Pt2::new(p[0], p[1])).collect();
        views.push(CorrespondenceView::new(points.clone(), pixels)?);
    }
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
