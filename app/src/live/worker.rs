//! The camera worker: fetches images, colours the depth, and puts the newest pair where window and vision find it.

use std::sync::Arc;
use std::time::Duration;

use handeye_core::depth::{ColourMap, DepthImage};
use handeye_sim_link::client::CancelToken;

use crate::live::depth;
use crate::model::{ColouredDepth, DepthScale, FrameImages, FrameInfo, Link, LiveFrame, ViewSettings};
use crate::text;
use crate::worker::link::{Duty, Outlet};
use crate::worker::port::{CameraPort, Connected, Connector, PortError, RawFrame};
use crate::worker::rate::RateMeter;
use crate::worker::slot::{LatestSlot, Tap};

/// Rest between two looks at the clock of the cell: a third of the pass of a simulation at its usual 50 ms.
const PERIOD: Duration = Duration::from_millis(15);

/// What the camera worker can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraTask {
    /// Which depths the colour map covers, from the next image on.
    SetDepthScale(DepthScale),
    /// The colours of depths, from the next image on.
    SetDepthColours(ColourMap),
}

/// The duty of the camera worker.
pub struct Camera {
    frames: Arc<LatestSlot<LiveFrame>>,
    for_vision: Arc<Tap<LiveFrame>>,
    scale: DepthScale,
    colours: ColourMap,
    auto_range_m: Option<[f32; 2]>,
    seen_sim_time_s: Option<f64>,
    number: u64,
    rate: RateMeter,
}

impl Camera {
    /// With the places that it shares with the application and with the vision thread.
    pub fn new(view: &ViewSettings, frames: Arc<LatestSlot<LiveFrame>>, for_vision: Arc<Tap<LiveFrame>>) -> Self {
        Self {
            frames,
            for_vision,
            scale: view.depth_scale,
            colours: view.depth_colours,
            auto_range_m: None,
            seen_sim_time_s: None,
            number: 0,
            rate: RateMeter::default(),
        }
    }

    /// Prepares the newest images for the window.
    fn prepare(&mut self, raw: RawFrame, limits_m: [f32; 2], received_s: f64) -> Result<LiveFrame, PortError> {
        let [_, far_plane_m] = limits_m;
        if let Some(depth) = &raw.depth {
            self.auto_range_m = depth::range_of(depth, far_plane_m, self.auto_range_m);
        }
        let depth_range_m = match self.scale {
            DepthScale::Full => limits_m,
            DepthScale::Auto => self.auto_range_m.unwrap_or(limits_m),
        };
        let [near_m, far_m] = depth_range_m;
        let coloured = |metres: DepthImage| match metres.colours(self.colours, near_m, far_m, far_plane_m) {
            Ok(colours) => Ok(ColouredDepth { metres, colours }),
            Err(error) => Err(PortError::Refused(text!("The depth image cannot be shown: {why}", why = error))),
        };
        let depth = raw.depth.map(coloured).transpose()?;
        self.number += 1;
        let info = FrameInfo {
            number: self.number,
            sim_time_s: raw.sim_time_s,
            image_age_s: raw.image_age_s,
            received_s,
            rate_hz: self.rate.rate_hz(),
            depth_range_m,
            far_plane_m,
            base_from_tip: raw.base_from_tip,
            joints_rad: raw.joints_rad,
            base_from_target_true: raw.base_from_target_true,
            clocks: raw.clocks,
        };
        Ok(LiveFrame { info, images: Arc::new(FrameImages { rgb: raw.rgb, depth }) })
    }
}

impl Duty for Camera {
    type Port = Box<dyn CameraPort>;
    type Task = CameraTask;
    const LINK: Link = Link::Camera;

    fn connect(
        &mut self,
        connector: &dyn Connector,
        shutdown: &CancelToken,
    ) -> Result<Connected<Self::Port>, PortError> {
        self.seen_sim_time_s = None;
        self.rate = RateMeter::default();
        connector.connect_camera(shutdown)
    }

    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError> {
        let newest = port.newest(self.seen_sim_time_s)?;
        self.for_vision.heard(outlet.now_s());
        let Some(raw) = newest else { return Ok(PERIOD) };
        let received_s = outlet.now_s();
        self.seen_sim_time_s = Some(raw.sim_time_s);
        self.rate.arrived(received_s);
        let frame = self.prepare(raw, port.depth_limits_m(), received_s)?;
        // The pixels are shared, not copied.
        self.for_vision.put(frame.clone());
        self.frames.put(frame);
        (outlet.waker)();
        Ok(PERIOD)
    }

    fn perform(&mut self, _port: Option<&mut Self::Port>, task: Self::Task, _outlet: &Outlet) -> Result<(), PortError> {
        match task {
            CameraTask::SetDepthScale(scale) => self.scale = scale,
            CameraTask::SetDepthColours(colours) => self.colours = colours,
        }
        // A resting simulation would otherwise show the old colours until it runs.
        self.seen_sim_time_s = None;
        Ok(())
    }
}
