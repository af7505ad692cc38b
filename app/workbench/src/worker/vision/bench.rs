//! A vision thread on the bench: fed by a test turn by turn, or by a built-in cell over sockets.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, bounded, select};
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::{CellClient, CellPaths, GroundTruth};
use handeye_coppeliasim::{CancelToken, ConnectionOptions};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Target, Tip};
use handeye_geometry::targets::observation::{Corner, Corners};
use handeye_server::{CellConfig, CellServer};
use image::RgbImage;

use super::super::{Cell, Clock, Waker, threads::Workers};
use super::{LatestSlot, Outlet, Tap, Vision, VisionSlots, VisionTask};
use crate::capture::drawn::BOARD;
use crate::capture::state::{CaptureOptions, CapturePurpose, CaptureRefused, CaptureWait, LiveDetection};
use crate::capture::{CaptureRequest, Measured};
use crate::command::Event;
use crate::live::state::{ColouredDepth, FrameImages, FrameInfo, LiveFrame};
use crate::shell::view::{DepthScale, ViewSettings};
use crate::{capture, live};
use handeye_link::CellSource;
use handeye_link::RemoteCell;

/// A healthy cell answers within milliseconds; this is for a machine that is busy.
const PATIENCE: Duration = Duration::from_mins(1);

pub fn request(number: u64, frames: u32) -> CaptureRequest {
    CaptureRequest {
        number,
        purpose: CapturePurpose::Calibrate,
        options: CaptureOptions { frames, ..CaptureOptions::default() },
        pose_name: Some("view".to_owned()),
        others: Vec::new(),
    }
}

/// A vision worker without a thread: a test puts images in, sets the clock and runs its turns.
pub struct Table {
    pub vision: Vision,
    pub tap: Arc<Tap<LiveFrame>>,
    pub tasks: Option<Sender<VisionTask>>,
    pub detections: Arc<LatestSlot<LiveDetection>>,
    pub measured: Receiver<Measured>,
    pub events: Receiver<Event>,
    pub now_s: Arc<Mutex<f64>>,
    pub shutdown: CancelToken,
    pub frames: u64,
}

impl Table {
    pub(crate) fn new() -> Self {
        let (tap, bell) = Tap::new();
        let tap = Arc::new(tap);
        let (sender, tasks) = bounded(8);
        let (measured_sender, measured) = bounded(1);
        let (events_sender, events) = bounded(256);
        let detections = Arc::new(LatestSlot::default());
        let now_s = Arc::new(Mutex::new(100.0));
        let clock = Arc::clone(&now_s);
        let outlet = Outlet {
            events: events_sender,
            waker: Arc::new(|| {}),
            clock: Arc::new(move || *clock.lock().expect("no panic")),
        };
        let shutdown = CancelToken::default();
        let vision = Vision::new(
            Arc::clone(&tap),
            bell,
            tasks,
            VisionSlots { detections: Arc::clone(&detections), ..VisionSlots::default() },
            measured_sender,
            outlet,
            shutdown.clone(),
        );
        Self { vision, tap, tasks: Some(sender), detections, measured, events, now_s, shutdown, frames: 0 }
    }

    pub(crate) fn ask(&mut self, task: VisionTask) {
        self.tasks.as_ref().expect("open").send(task).expect("there is room");
        self.turn();
    }

    /// One turn; whether it continues after it.
    pub(crate) fn turn(&mut self) -> bool {
        self.vision.turn().is_ok()
    }

    /// Puts an image of the next pass in.
    pub(crate) fn put(&mut self, rgb: &RgbImage) {
        self.frames += 1;
        let mut now_s = self.now_s.lock().expect("no panic");
        *now_s += 0.05;
        let info = FrameInfo {
            number: self.frames,
            sim_time_s: self.frames as f64 * 0.05,
            image_age_s: 0.0,
            image_off_m: 0.0,
            no_pose: None,
            received_s: *now_s,
            rate_hz: 20.0,
            depth_range_m: [0.1, 3.5],
            far_plane_m: 3.5,
            base_from_tip: Some(Pose::identity()),
            joints_rad: [0.0; 6].into(),
            base_from_target_true: None,
            clocks: None,
        };
        let metres = DepthImage { width: 1, height: 1, metres: vec![0.5] };
        let depth = ColouredDepth { metres, colours: RgbImage::new(1, 1) };
        let images = FrameImages { rgb: rgb.clone(), depth: Some(depth) };
        self.tap.heard(*now_s);
        self.tap.put(LiveFrame { info, images: Arc::new(images) });
    }

    /// Images until the capture has ended.
    pub(crate) fn feed(&mut self, rgb: &RgbImage, most: usize) -> Result<Measured, CaptureRefused> {
        for _ in 0..most {
            self.put(rgb);
            self.turn();
            if let Ok(measured) = self.measured.try_recv() {
                return Ok(measured);
            }
            if self.vision.capture.is_none() {
                break;
            }
        }
        Err(self.refused().expect("a capture ends with an image or a reason"))
    }

    pub(crate) fn refused(&self) -> Option<CaptureRefused> {
        self.events.try_iter().find_map(|event| match event {
            Event::Capture(capture::Event::Refused { refused, .. }) => Some(refused),
            _ => None,
        })
    }

    pub(crate) fn waits(&self) -> Vec<(u64, CaptureWait)> {
        let waits = self.events.try_iter().filter_map(|event| match event {
            Event::Capture(capture::Event::Waits { number, wait }) => Some((number, wait)),
            _ => None,
        });
        waits.collect()
    }
}

/// All workers on a built-in cell, over sockets.
pub(crate) struct CellBench {
    pub workers: Workers,
    measured: Receiver<Measured>,
    woken: Receiver<()>,
    pub events: Vec<Event>,
    pub client: CellClient,
    pub truth: GroundTruth,
    server: CellServer,
}

impl CellBench {
    pub(crate) fn start(scene: Scene, real_time: bool) -> Self {
        let config = CellConfig { real_time: Some(real_time), ..CellConfig::new(scene) };
        let server = CellServer::start(config).expect("a cell");
        let source = CellSource::Address(server.endpoint());
        let connector: Arc<dyn Cell> = Arc::new(RemoteCell::at(server.endpoint(), CellPaths::default()));
        let (wake, woken) = bounded(1);
        let waker: Waker = Arc::new(move || {
            let _full = wake.try_send(()).is_err();
        });
        let began = Instant::now();
        let clock: Clock = Arc::new(move || began.elapsed().as_secs_f64());
        let (sender, measured) = bounded(2);
        let view = ViewSettings { depth_scale: DepthScale::Full, ..ViewSettings::default() };
        let workers =
            Workers::start(&source, &view, &connector, sender, &Arc::default(), &clock, &waker).expect("threads");
        let mut client = connect(&server);
        client.arm().sim().start_simulation().expect("it starts");
        let truth = client.camera().ground_truth().expect("the cell is simulated");
        workers.ask_vision(VisionTask::SetTarget(BOARD)).expect("it takes tasks");
        workers.ask_vision(VisionTask::SetIntrinsics(truth.intrinsics)).expect("it takes tasks");
        Self { workers, measured, woken, events: Vec::new(), client, truth, server }
    }

    /// Another connection.
    pub(crate) fn connect(&self) -> CellClient {
        connect(&self.server)
    }

    /// Requests a capture and waits for its result.
    pub(crate) fn capture(&mut self, request: CaptureRequest) -> Result<Measured, CaptureRefused> {
        let number = request.number;
        self.workers.ask_vision(VisionTask::Capture(request)).expect("it takes tasks");
        let deadline = crossbeam_channel::after(PATIENCE);
        loop {
            select! {
                recv(self.measured) -> measured => return Ok(measured.expect("the thread lives")),
                recv(self.woken) -> _ => {}
                recv(deadline) -> _ => panic!("no capture: {:?}", self.events.last()),
            }
            let before = self.events.len();
            let Self { workers, events, .. } = self;
            workers.drain(|event| events.push(event));
            for event in &self.events[before..] {
                if let Event::Capture(capture::Event::Refused { number: which, refused }) = event
                    && *which == number
                {
                    return Err(refused.clone());
                }
            }
        }
    }

    /// Live detections until this many have come.
    pub(crate) fn live(&mut self, count: usize) -> Vec<LiveDetection> {
        let mut found = Vec::new();
        while found.len() < count {
            self.woken.recv_timeout(PATIENCE).expect("images come");
            self.workers.drain(|event| {
                if let Event::Live(live::Event::Detection(detection)) = event {
                    found.push(*detection);
                }
            });
        }
        found
    }

    /// Where the corners truly are, seen from a pose of the tip.
    pub(crate) fn projected(&self, base_from_tip: &Pose<Base, Tip>) -> Corners {
        let base_from_target: Pose<Base, Target> = self.truth.base_from_target.expect("published");
        let camera: &Intrinsics = &self.truth.intrinsics;
        let camera_from_target = (*base_from_tip * self.truth.tip_from_camera).inverse() * base_from_target;
        let project = |(index, point)| {
            let px = camera.project(&(camera_from_target.isometry() * point)).expect("in front of the camera");
            Corner::new(index, px)
        };
        BOARD.points().into_iter().enumerate().map(project).collect()
    }

    /// Largest distance of the corners of a capture from their true positions \[px\].
    pub(crate) fn worst_px(&self, measured: &Measured) -> f64 {
        let truth = self.projected(&measured.base_from_tip);
        measured.corners.iter().map(|corner| (corner.px - truth[corner.index].px).norm()).fold(0.0, f64::max)
    }
}

fn connect(server: &CellServer) -> CellClient {
    let endpoint = server.endpoint().parse().expect("an address");
    // A machine that is busy with other tests may be silent for longer than a server that has died.
    let options = ConnectionOptions { heartbeat: None, ..ConnectionOptions::default() };
    CellClient::connect(&endpoint, &options, &CellPaths::default()).expect("it answers")
}
