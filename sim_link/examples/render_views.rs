//! Writes images of the cell: `cargo run --release -p handeye_sim_link --example render_views -- FOLDER`.

use std::path::PathBuf;

use handeye_sim_link::cell::render::{Imaging, Renderer};
use nalgebra::Point3;

mod support;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: render_views FOLDER")?);
    std::fs::create_dir_all(&folder)?;
    let start = [0.0, 45.0, -60.0, 0.0, 90.0, 0.0];
    let reach = [20.0, 10.0, -80.0, -20.0, 80.0, 30.0];
    let board = Point3::new(-0.125, -0.4, 0.802);
    let views = [
        ("tip", start, support::camera_on_tip(&start)),
        ("tip_reach", reach, support::camera_on_tip(&reach)),
        ("hall", start, support::looking_at(Point3::new(-1.3, 0.9, 1.5), Point3::new(-0.05, -0.15, 0.55))),
        ("hall_reach", reach, support::looking_at(Point3::new(1.2, 1.2, 1.1), Point3::new(0.0, -0.1, 0.45))),
        ("board", start, support::looking_at(Point3::new(-0.02, -0.02, 0.95), board)),
        ("behind", start, support::looking_at(Point3::new(-0.6, -1.1, 1.2), board)),
    ];
    let renderer = Renderer::new(support::sensor(), 0.01, 3.5);
    let imaging = Imaging { blur_px: 0.6, noise_grey: 1.5, ..Imaging::default() };
    for (name, joints, camera) in views {
        let frame = renderer.render(&support::scene(&joints, camera), &imaging, 1);
        frame.rgb.save(folder.join(format!("{name}.png")))?;
        println!("{name}: nearest {:.3} m", frame.depth_m.iter().copied().fold(f32::INFINITY, f32::min));
    }
    Ok(())
}
