//! The device itself, through the crate `v4l`.

use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nix::time::{ClockId, clock_gettime};
use v4l::buffer::{Flags, Metadata, Type};
use v4l::format::Quantization;
use v4l::framesize::FrameSizeEnum;
use v4l::io::mmap::Stream;
use v4l::io::traits::CaptureStream as _;
use v4l::video::Capture as _;
use v4l::video::capture::Parameters;
use v4l::{Format, FourCC};

use super::choice::{self, Offer, Sizes};
use super::pixels::{self, Layout, PixelFormat, Range};
use super::stamps::{self, Stamped};
use super::trouble;
use crate::drivers::{Device, Fault, Frame, Outlet};
use crate::message::{Ability, CameraMessage, Hello, LogLevel, PROTOCOL};

/// Longest wait for a frame: a camera that has to adapt to the dark takes its time with the first.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often it is asked whether the workbench has gone.
const LOOK_MS: i32 = 250;
/// `poll`'s word for "there is something to read".
const POLLIN: i16 = 1;
/// Buffers of the kernel: one is read, one waits, one is filled.
const BUFFERS: u32 = 3;
/// Taken for the time between two frames where the device does not say it \[s\]: longer than that of any usual camera, so that what
/// is stated of stamps is not too little.
const SLOW_S: f64 = 0.1;
/// Frames in a row that are not whole before the driver gives up.
const MOST_BROKEN: u32 = 100;

/// Which camera, and how it is read.
#[derive(Debug, Clone)]
pub struct V4lOptions {
    /// The device.
    pub device: PathBuf,
    /// Which format; the one that loses least if absent.
    pub format: Option<PixelFormat>,
    /// Width and height in pixels; the largest if absent.
    pub size: Option<(u32, u32)>,
    /// Frames a second; the device's choice if absent.
    pub rate_hz: Option<u32>,
}

/// A camera of Video4Linux.
pub struct V4l {
    options: V4lOptions,
    open: Option<Open>,
}

struct Open {
    device: v4l::Device,
    layout: Layout,
    interval_s: f64,
}

impl V4l {
    /// Nothing is opened yet.
    pub fn new(options: V4lOptions) -> Self {
        Self { options, open: None }
    }

    fn fault(&self, doing: &str, error: &io::Error) -> Fault {
        trouble::fault(&self.options.device, doing, error, &cameras())
    }

    fn layout(&self, device: &v4l::Device) -> Result<Layout, Fault> {
        let offers = offers(device).map_err(|error| self.fault("asking which images it has", &error))?;
        let (format, [width, height]) =
            choice::choose(&offers, self.options.format, self.options.size).map_err(Fault)?;
        let code = FourCC::new(&format.code());
        let taken = device
            .set_format(&Format::new(width, height, code))
            .map_err(|error| self.fault("setting format and size", &error))?;
        // The kernel takes the nearest that it can.
        if (taken.width, taken.height, taken.fourcc.repr) != (width, height, format.code()) {
            return Err(Fault(format!(
                "{} was asked for {format} of {width}x{height} and gives {} of {}x{}: choose another --size or --format",
                self.options.device.display(),
                String::from_utf8_lossy(&taken.fourcc.repr),
                taken.width,
                taken.height
            )));
        }
        let range = match taken.quantization {
            Quantization::FullRange => Range::Full,
            // What V4L2 has for the default of Y'CbCr.
            Quantization::Default | Quantization::LimitedRange => Range::Limited,
        };
        Ok(Layout { format, width, height, stride: taken.stride, range })
    }

    /// Time between two frames \[s\].
    fn interval_s(&self, device: &v4l::Device) -> f64 {
        if let Some(rate_hz) = self.options.rate_hz
            && let Err(error) = device.set_params(&Parameters::with_fps(rate_hz))
        {
            tracing::warn!("{} takes no rate, it keeps its own: {error}", self.options.device.display());
        }
        let interval = device.params().map(|params| params.interval).ok();
        let interval_s = interval.map(|interval| f64::from(interval.numerator) / f64::from(interval.denominator));
        interval_s.filter(|seconds| seconds.is_finite() && (1e-4..=10.0).contains(seconds)).unwrap_or(SLOW_S)
    }
}

impl Device for V4l {
    fn open(&mut self, outlet: &Outlet) -> Result<Hello, Fault> {
        let opened = v4l::Device::with_path(&self.options.device);
        let device = opened.map_err(|error| self.fault("opening it", &error))?;
        let caps = device.query_caps().map_err(|error| self.fault("asking what it is", &error))?;
        let layout = self.layout(&device)?;
        let interval_s = self.interval_s(&device);
        outlet.log(
            LogLevel::Info,
            format!("{} of {}x{}, {:.1} a second", layout.format, layout.width, layout.height, 1.0 / interval_s),
        );
        let camera = CameraMessage { width: layout.width, height: layout.height, intrinsics: None };
        self.open = Some(Open { device, layout, interval_s });
        Ok(Hello {
            protocol: PROTOCOL,
            name: format!("{} at {}", caps.card, self.options.device.display()),
            version: env!("CARGO_PKG_VERSION").into(),
            clock: "monotonic".into(),
            can: vec![Ability::Image],
            joints: Vec::new(),
            arm: None,
            base_from_arm: None,
            camera: Some(camera),
            depth_limits_m: None,
        })
    }

    fn run(&mut self, outlet: &Outlet) -> Result<(), Fault> {
        let Some(Open { device, layout, interval_s }) = self.open.take() else {
            return Err(Fault("the camera was not opened".into()));
        };
        // Both are the kernel's steady clock, with other beginnings.
        let ahead_s = monotonic_s()? - outlet.own_time();
        let begun = Stream::with_buffers(&device, Type::VideoCapture, BUFFERS);
        let mut stream = begun.map_err(|error| self.fault("getting buffers", &error))?;
        stream.set_timeout(PATIENCE);
        let handle = stream.handle();
        let mut heard = Instant::now();
        let (mut broken, mut is_told, mut streams) = (0, false, false);
        while !outlet.has_ended() {
            // A stream that has waited in vain cannot be asked again, so it is asked once there is something; the first frame
            // is what has it stream at all.
            if streams && !handle.poll(POLLIN, LOOK_MS).is_ok_and(|ready| ready > 0) {
                if heard.elapsed() > PATIENCE {
                    return Err(self.fault("waiting for a frame", &io::ErrorKind::TimedOut.into()));
                }
                continue;
            }
            let (frame, meta) = stream.next().map_err(|error| self.fault("reading a frame", &error))?;
            (heard, streams) = (Instant::now(), true);
            let is_whole = !meta.flags.contains(Flags::ERROR);
            let used = frame.get(..meta.bytesused as usize).unwrap_or(frame);
            let image = if is_whole { pixels::image(&layout, used) } else { Err("a frame is damaged".to_owned()) };
            let bytes = match image {
                Ok(bytes) => bytes,
                Err(why) => {
                    broken += 1;
                    if broken >= MOST_BROKEN {
                        return Err(Fault(format!("{MOST_BROKEN} frames in a row are not whole: {why}")));
                    }
                    if broken == 1 {
                        outlet.log(LogLevel::Warn, format!("{why}; it is left out"));
                    }
                    continue;
                }
            };
            broken = 0;
            let stamped = stamped(meta);
            if stamped == Stamped::Unknown && !std::mem::replace(&mut is_told, true) {
                outlet.log(LogLevel::Warn, "the kernel does not stamp its frames: when they arrive counts");
            }
            let stamp_s = meta.timestamp.sec as f64 + 1e-6 * meta.timestamp.usec as f64;
            let exposure = stamps::exposure(stamped, stamp_s - ahead_s, outlet.own_time(), interval_s);
            outlet.frame(Frame {
                stamp: exposure.middle_s,
                stamp_uncertainty_s: exposure.uncertainty_s,
                width: layout.width,
                height: layout.height,
                encoding: layout.format.encoding(),
                bytes,
                intrinsics: None,
                depth: None,
            });
        }
        Ok(())
    }
}

fn stamped(meta: &Metadata) -> Stamped {
    let is_monotonic = (meta.flags & Flags::TIMESTAMP_MASK) == Flags::TIMESTAMP_MONOTONIC;
    let is_begin = (meta.flags & Flags::TSTAMP_SRC_MASK) == Flags::TSTAMP_SRC_SOE;
    match (is_monotonic, is_begin) {
        (false, _) => Stamped::Unknown,
        (true, true) => Stamped::Begin,
        (true, false) => Stamped::End,
    }
}

fn monotonic_s() -> Result<f64, Fault> {
    let now = clock_gettime(ClockId::CLOCK_MONOTONIC).map_err(Fault::of)?;
    Ok(Duration::from(now).as_secs_f64())
}

/// What a device offers. A format whose sizes cannot be listed has that which is set.
fn offers(device: &v4l::Device) -> io::Result<Vec<Offer>> {
    let now = device.format()?;
    let offer = |format: v4l::format::Description| {
        let sizes =
            device.enum_framesizes(format.fourcc).map(|sizes| sizes.into_iter().map(|size| of(&size.size)).collect());
        Offer {
            code: format.fourcc.repr,
            name: format.description,
            sizes: sizes.unwrap_or_else(|_| vec![Sizes::One([now.width, now.height])]),
        }
    };
    Ok(device.enum_formats()?.into_iter().map(offer).collect())
}

fn of(size: &FrameSizeEnum) -> Sizes {
    match size {
        FrameSizeEnum::Discrete(size) => Sizes::One([size.width, size.height]),
        FrameSizeEnum::Stepwise(steps) => Sizes::Steps {
            least: [steps.min_width, steps.min_height],
            greatest: [steps.max_width, steps.max_height],
            step: [steps.step_width, steps.step_height],
        },
    }
}

/// The video devices of the system, with their names.
fn cameras() -> Vec<String> {
    let Ok(entries) = std::fs::read_dir("/dev") else { return Vec::new() };
    let mut names: Vec<String> = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()).collect();
    names.retain(|name| name.strip_prefix("video").is_some_and(|number| number.parse::<u32>().is_ok()));
    names.sort_by_key(|name| (name.len(), name.clone()));
    let said = |name: String| {
        let card = std::fs::read_to_string(Path::new("/sys/class/video4linux").join(&name).join("name"));
        let card = card.map(|card| format!(" ({})", card.trim())).unwrap_or_default();
        format!("/dev/{name}{card}")
    };
    names.into_iter().map(said).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(device: &str) -> Fault {
        let options = V4lOptions { device: device.into(), format: None, size: None, rate_hz: None };
        V4l::new(options).open(&Outlet::new(io::sink())).expect_err("it is no camera")
    }

    #[test]
    fn what_is_no_camera_is_said_to_be_none() {
        let missing = opened("/dev/there-is-no-such-camera").0;
        assert!(missing.contains("there is no /dev/there-is-no-such-camera"), "{missing}");
        let other = opened("/dev/null").0;
        assert!(other.contains("/dev/null is no camera that sends images"), "{other}");
    }

    #[test]
    fn the_flags_of_the_kernel_say_what_is_stamped() {
        let of = |flags| stamped(&Metadata { flags, ..Metadata::default() });
        assert_eq!(of(Flags::TIMESTAMP_MONOTONIC | Flags::TSTAMP_SRC_SOE | Flags::MAPPED), Stamped::Begin);
        assert_eq!(of(Flags::TIMESTAMP_MONOTONIC | Flags::DONE), Stamped::End);
        assert_eq!(of(Flags::TIMESTAMP_COPY | Flags::TSTAMP_SRC_SOE), Stamped::Unknown);
        assert_eq!(of(Flags::MAPPED), Stamped::Unknown);
    }
}
