//! The folder as a driver shows it.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use handeye_arm::JointKind;
use handeye_dataset::PoseFormat;

use super::watch::{Capture, Watch};
use crate::drivers::{Device, Fault, Frame, Outlet};
use crate::message::{Ability, CameraMessage, Hello, JointMessage, LogLevel, PROTOCOL, PoseMessage, StateMessage};

/// How often the state is said: the protocol asks for ten times a second or more.
const STATE: Duration = Duration::from_millis(40);
/// How often the image is shown anew. It is looked at as a camera is, at any time.
const SHOW_S: f64 = 0.2;
/// How often the folder is looked at. Polling works on every file system, network shares too.
const LOOK_S: f64 = 0.25;
/// How long files that are there at the start may take to be known: less than the workbench waits for `hello`.
const FIRST: Duration = Duration::from_secs(6);

/// Which folder, and how poses are written there.
#[derive(Debug, Clone)]
pub struct FolderOptions {
    /// The folder.
    pub folder: PathBuf,
    /// How poses are written; `None` for images alone.
    pub format: Option<PoseFormat>,
    /// Size of the images, needed while there is none yet.
    pub size: Option<(u32, u32)>,
    /// How long a capture is shown at least before the next.
    pub hold: Duration,
}

/// Shows what is put into a folder.
#[derive(Debug)]
pub struct Folder {
    options: FolderOptions,
    open: Option<(Watch, Option<Capture>)>,
}

impl Folder {
    /// Nothing is read yet.
    pub fn new(options: FolderOptions) -> Self {
        Self { options, open: None }
    }

    /// The newest of the captures that are there already, with how many there are.
    fn newest(watch: &mut Watch, outlet: &Outlet) -> Result<(Option<Capture>, usize), Fault> {
        let start = Instant::now();
        let mut newest: Option<Capture> = None;
        let mut count = 0;
        let mut looks = 0;
        loop {
            for capture in watch.look(outlet.own_time())? {
                count += 1;
                if newest.as_ref().is_none_or(|newest| capture.modified >= newest.modified) {
                    newest = Some(capture);
                }
            }
            looks += 1;
            // The second look can find what the first has seen.
            let is_known = looks > 2 && (!watch.is_waiting() || newest.is_some());
            if is_known || start.elapsed() > FIRST || outlet.has_ended() {
                return Ok((newest, count));
            }
            thread::sleep(Duration::from_secs_f64(LOOK_S));
        }
    }
}

impl Device for Folder {
    fn open(&mut self, outlet: &Outlet) -> Result<Hello, Fault> {
        let folder = &self.options.folder;
        if !folder.is_dir() {
            return Err(Fault(format!("{} is no folder", folder.display())));
        }
        let mut watch = Watch::new(folder.clone(), self.options.format.clone());
        let (newest, _) = Self::newest(&mut watch, outlet)?;
        let Some((width, height)) = newest.as_ref().map(|capture| capture.size).or(self.options.size) else {
            let why = watch.remarks.join("\n");
            return Err(Fault(format!(
                "{} has no image with its pose yet: put the first there, or say how large images are with --size \
                 WIDTHxHEIGHT. {why}",
                folder.display()
            )));
        };
        let count = self.options.format.as_ref().map_or(0, PoseFormat::joint_count);
        let mut can = vec![Ability::Image];
        if self.options.format.is_some() {
            can.push(Ability::State);
        }
        if count > 0 {
            can.push(Ability::Joints);
        }
        let joint =
            |number| JointMessage { name: format!("q{number}"), kind: JointKind::Revolute, min: None, max: None };
        let hello = Hello {
            protocol: PROTOCOL,
            name: format!("folder {}", folder.display()),
            version: env!("CARGO_PKG_VERSION").into(),
            clock: "monotonic".into(),
            can,
            joints: (1..=count).map(joint).collect(),
            arm: None,
            base_from_arm: None,
            camera: Some(CameraMessage { width, height, intrinsics: None }),
            depth_limits_m: None,
        };
        self.open = Some((watch, newest));
        Ok(hello)
    }

    fn run(&mut self, outlet: &Outlet) -> Result<(), Fault> {
        let Some((mut watch, mut current)) = self.open.take() else {
            return Err(Fault("the folder was not opened".into()));
        };
        let mut size = current.as_ref().map(|capture| capture.size).or(self.options.size);
        let mut next = VecDeque::new();
        let (mut looked_s, mut shown_s, mut changed_s) = (f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
        if let Some(capture) = &current {
            outlet.log(LogLevel::Info, format!("{} is shown; what comes next is shown as it comes", capture.name));
        }
        while !outlet.has_ended() {
            let now_s = outlet.own_time();
            if now_s - looked_s >= LOOK_S {
                looked_s = now_s;
                for capture in watch.look(now_s)? {
                    let expected = *size.get_or_insert(capture.size);
                    if capture.size == expected {
                        next.push_back(capture);
                    } else {
                        outlet.log(LogLevel::Error, other_size(&capture, expected));
                    }
                }
                for remark in watch.remarks.drain(..) {
                    outlet.log(LogLevel::Warn, remark);
                }
            }
            if now_s - changed_s >= self.options.hold.as_secs_f64()
                && let Some(capture) = next.pop_front()
            {
                outlet.log(LogLevel::Info, format!("{} is shown", capture.name));
                (current, changed_s) = (Some(capture), now_s);
                // The state at the new pose comes before the image.
                shown_s = now_s;
            }
            if let Some(capture) = &current {
                say(capture, now_s, outlet);
                if now_s - shown_s >= SHOW_S {
                    shown_s = now_s;
                    outlet.frame(frame(capture, now_s));
                }
            }
            thread::sleep(STATE);
        }
        Ok(())
    }
}

fn say(capture: &Capture, stamp: f64, outlet: &Outlet) {
    let Some(pose) = &capture.pose else { return };
    outlet.state(&StateMessage {
        stamp,
        joints_rad: pose.joints_rad.as_deref().and_then(|values| values.try_into().ok()),
        base_from_flange: None,
        flange_from_tcp: None,
        base_from_tip: Some(PoseMessage::of(&pose.base_from_tip)),
        moving: Some(false),
    });
}

fn frame(capture: &Capture, stamp: f64) -> Frame {
    let (width, height) = capture.size;
    let (encoding, bytes) = (capture.encoding, capture.bytes.clone());
    Frame { stamp, stamp_uncertainty_s: 0.0, width, height, encoding, bytes, intrinsics: None, depth: None }
}

fn other_size(capture: &Capture, (width, height): (u32, u32)) -> String {
    let (w, h) = capture.size;
    format!("{} is {w}×{h} and the images before it {width}×{height}: it is not shown", capture.name)
}
