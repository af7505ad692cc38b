//! Frames per second of the renderer on one core: `cargo run --release -p handeye_studies --example render_bench`.
//!
//! Where the kernel tells it (Linux), time is what the thread had of the processor, so that other programs on the
//! machine do not count.

use std::time::Instant;

use handeye_cell::render::{Imaging, Renderer};
use nalgebra::Point3;

mod support;

const REPEATS: usize = 12;
/// Frames per repeat: the kernel counts in ticks of up to 4 ms.
const FRAMES: u32 = 10;

fn main() {
    let start = [0.0, 45.0, -60.0, 0.0, 90.0, 0.0];
    let board = Point3::new(-0.125, -0.4, 0.802);
    let views = [
        ("tip", support::camera_on_tip(&start)),
        ("hall", support::looking_at(Point3::new(-1.3, 0.9, 1.5), Point3::new(-0.05, -0.15, 0.55))),
        ("board", support::looking_at(Point3::new(-0.02, -0.02, 0.95), board)),
    ];
    let real = Imaging {
        blur_px: 0.7,
        noise_grey: 2.0,
        depth_noise_m: 0.0005,
        depth_noise_per_m2: 0.001,
        ..Imaging::default()
    };
    let renderer = Renderer::new(support::sensor(), 0.01, 3.5);
    println!("{:<8} {:<22} {:>8} {:>8} {:>8}", "view", "work", "min/s", "median/s", "max/s");
    for (view, camera) in views {
        let scene = support::scene(&start, camera);
        let ideal = Imaging::default();
        report(view, "rgb + depth", || drop(renderer.render(&scene, &ideal, 0)));
        report(view, "rgb", || drop(renderer.render_rgb(&scene, &ideal, 0)));
        report(view, "depth", || drop(renderer.render_depth(&scene, &ideal, 0)));
        report(view, "rgb + depth, real", || drop(renderer.render(&scene, &real, 0)));
    }
}

fn report(view: &str, work: &str, mut render: impl FnMut()) {
    render();
    let mut seconds: Vec<f64> = (0..REPEATS)
        .map(|_| {
            let (wall, processor) = (Instant::now(), processor_seconds());
            (0..FRAMES).for_each(|_| render());
            let used = processor_seconds().zip(processor).map(|(after, before)| after - before);
            used.unwrap_or_else(|| wall.elapsed().as_secs_f64()) / f64::from(FRAMES)
        })
        .collect();
    seconds.sort_by(f64::total_cmp);
    let rate = |index: usize| 1.0 / seconds[index];
    println!("{view:<8} {work:<22} {:>8.1} {:>8.1} {:>8.1}", rate(REPEATS - 1), rate(REPEATS / 2), rate(0));
}

fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    (nanoseconds > 0.0).then_some(nanoseconds * 1e-9)
}
