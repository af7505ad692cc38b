//! `handeye driver fake`: a driver with the built-in cell behind it.

use std::io::BufReader;
use std::net::TcpListener;

use clap::{Args, ValueEnum};
use handeye_coppeliasim::Endpoint;
use handeye_driver::fake::{Fake, FakeError, FakeOptions, FakePart};

use crate::cell::SceneArg;
use crate::{Failure, out};
use handeye_workbench::arguments::heading;

/// Options of `handeye driver fake`.
#[derive(Debug, Args)]
pub struct FakeArgs {
    #[command(flatten)]
    scene: SceneArg,
    /// Seed of everything random in the cell; the scene's own if not given.
    #[arg(long, value_name = "N", help_heading = heading::CELL)]
    seed: Option<u64>,
    /// Serve a cell that runs already (`handeye cell`) instead of starting one.
    #[arg(long, value_name = "ADDR", conflicts_with_all = ["scene", "arm_errors", "seed"], help_heading = heading::CELL)]
    connect: Option<Endpoint>,
    /// Serve one part only, so that robot and camera are two programs.
    #[arg(long, value_name = "PART", help_heading = heading::CELL)]
    only: Option<Part>,
    /// Where the clock of the stamps begins, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, allow_hyphen_values = true, help_heading = heading::CELL)]
    clock: f64,
    /// Listen at this address for one workbench after the other, in place of standard input and output; port 0 picks one that is
    /// free. Anyone who can connect can move the arm: there is no password.
    #[arg(long, value_name = "ADDR:PORT", help_heading = heading::ACCESS)]
    listen: Option<String>,
}

/// A part of the cell.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Part {
    Robot,
    Camera,
}

pub fn run(args: &FakeArgs) -> Result<(), Failure> {
    let part = match args.only {
        None => FakePart::Both,
        Some(Part::Robot) => FakePart::Robot,
        Some(Part::Camera) => FakePart::Camera,
    };
    let options = FakeOptions {
        seed: args.seed,
        connect: args.connect.clone(),
        part,
        clock_s: args.clock,
        ..FakeOptions::new(args.scene.load()?)
    };
    let fake = Fake::start(options).map_err(Failure::failed)?;
    match &args.listen {
        None => fake.converse(std::io::stdin().lock(), std::io::stdout()).map_err(Failure::failed),
        Some(address) => listen(&fake, address),
    }
}

/// One workbench after the other, until the program is ended.
fn listen(fake: &Fake, address: &str) -> Result<(), Failure> {
    let listener = TcpListener::bind(address).map_err(|error| {
        Failure::failed(anyhow::anyhow!("cannot listen at {address}: {error}; port 0 finds a free one"))
    })?;
    let here = listener.local_addr().map_err(Failure::failed)?;
    if !here.ip().to_canonical().is_loopback() {
        out::note(format_args!(
            "warning: everybody on the network who reaches {here} can move the arm, and there is no password; \
             --listen 127.0.0.1:{} serves this machine alone",
            here.port()
        ));
    }
    out::line(format_args!("listening on tcp://{here}"))?;
    loop {
        let (stream, _) = listener.accept().map_err(Failure::failed)?;
        let served = stream
            .set_nodelay(true)
            .and_then(|()| stream.try_clone())
            .map_err(FakeError::Output)
            .and_then(|input| fake.converse(BufReader::new(input), &stream));
        // Losing a workbench is no reason to end; losing the cell is.
        match served {
            Ok(()) | Err(FakeError::Output(_)) => {}
            Err(error) => return Err(Failure::failed(error)),
        }
        let _closed_already = stream.shutdown(std::net::Shutdown::Both).is_err();
    }
}
