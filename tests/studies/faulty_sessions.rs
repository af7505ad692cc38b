//! A session of the cell with one thing wrong, as a dataset folder without images:
//! `cargo run --example faulty_sessions -- --fault joint4 --seed 7 --out DIR`.
//!
//! Faults are `none`, `slip`, `square`, `joint1` to `joint6`, `motion`, `inverted` and `millimetres`. With `--seeds N`
//! there are N sessions in DIR/FAULT-SEED, from the seed on; with `--fault all` those of every studied fault and of none.

use std::path::PathBuf;

use handeye_cell::recorded::{Fault, SessionOptions, record};
use handeye_cell::scene::Scene;

type Failure = Box<dyn std::error::Error>;

struct Args {
    faults: Vec<Option<Fault>>,
    seeds: std::ops::Range<u64>,
    out: PathBuf,
    scene: Scene,
    views: usize,
    corner_px: f64,
    camera_is_known: bool,
}

fn main() -> Result<(), Failure> {
    let args = parse(std::env::args().skip(1))?;
    let one = args.faults.len() == 1 && args.seeds.end - args.seeds.start == 1;
    for fault in args.faults {
        for seed in args.seeds.clone() {
            let options = SessionOptions {
                views: args.views,
                corner_px: args.corner_px,
                seed,
                fault,
                ..SessionOptions::default()
            };
            let session = record(&args.scene, &options)?;
            let name = fault.map_or_else(|| "none".to_owned(), |fault| fault.to_string());
            let folder = if one { args.out.clone() } else { args.out.join(format!("{name}-{seed}")) };
            session.write_dataset(&folder, args.camera_is_known)?;
            println!("{}", folder.display());
        }
    }
    Ok(())
}

fn parse(mut words: impl Iterator<Item = String>) -> Result<Args, Failure> {
    let (mut fault, mut seed, mut seeds, mut out) = ("none".to_owned(), 1, 1, None);
    let (mut scene, mut views, mut corner_px, mut camera_is_known) = (Scene::realistic()?, 20, 0.1, true);
    while let Some(word) = words.next() {
        let mut value = || words.next().ok_or_else(|| format!("{word} needs a value"));
        match word.as_str() {
            "--fault" => fault = value()?,
            "--seed" => seed = value()?.parse()?,
            "--seeds" => seeds = value()?.parse()?,
            "--out" => out = Some(PathBuf::from(value()?)),
            "--scene" => scene = Scene::load(&PathBuf::from(value()?))?,
            "--views" => views = value()?.parse()?,
            "--px" => corner_px = value()?.parse()?,
            "--free-camera" => camera_is_known = false,
            other => return Err(format!("there is no option {other:?}").into()),
        }
    }
    let faults = match fault.as_str() {
        "none" => vec![None],
        "all" => std::iter::once(None).chain(Fault::STUDIED.map(Some)).collect(),
        name => vec![Some(name.parse()?)],
    };
    let out = out.ok_or("--out DIR is missing")?;
    Ok(Args { faults, seeds: seed..seed + seeds, out, scene, views, corner_px, camera_is_known })
}
