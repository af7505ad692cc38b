//! The camera worker: fetches images, colours the depth, and puts the newest pair where window and vision find it.

use std::sync::Arc;
use std::time::Duration;

use handeye_coppeliasim::CancelToken;
use handeye_geometry::depth::ColourMap;
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::connect::state::Link;
use crate::live::depth;
use crate::live::state::{ColouredDepth, FrameImages, FrameInfo, LiveFrame};
use crate::shell::view::{DepthScale, ViewSettings};
use crate::worker::channels::{LatestSlot, Tap};
use crate::worker::link::{Duty, Outlet};
use crate::worker::rate::RateMeter;
use handeye_link::{CameraPort, Cell, Connected, Newest, PortError, RawFrame};
use handeye_wording::text;

/// Pause between two looks at the clock of the cell: a third of the pass of a simulation at its usual 50 ms.
const PERIOD: Duration = Duration::from_millis(15);

/// Requests to the camera worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraTask {
    /// Which depths the colour map covers, from the next image on.
    SetDepthScale(DepthScale),
    /// The colours of depths, from the next image on.
    SetDepthColours(ColourMap),
}

/// The job of the camera worker.
pub struct Camera {
    frames: Arc<LatestSlot<LiveFrame>>,
    for_vision: Arc<Tap<LiveFrame>>,
    scale: DepthScale,
    colours: ColourMap,
    auto_range_m: Option<[f32; 2]>,
    seen_sim_time_s: Option<f64>,
    /// Where the tip was in the last images, and when.
    seen_tip: Option<(f64, Pose<Base, Tip>)>,
    number: u64,
    rate: RateMeter,
}

impl Camera {
    /// With the slots that it shares with the application and with the vision thread.
    pub fn new(view: &ViewSettings, frames: Arc<LatestSlot<LiveFrame>>, for_vision: Arc<Tap<LiveFrame>>) -> Self {
        Self {
            frames,
            for_vision,
            scale: view.depth_scale,
            colours: view.depth_colours,
            auto_range_m: None,
            seen_sim_time_s: None,
            seen_tip: None,
            number: 0,
            rate: RateMeter::default(),
        }
    }

    /// How fast the tip has moved since the previous images, if its pose is known for both. At rest it is the noise of the
    /// encoders.
    fn speed_m_s(&mut self, raw: &RawFrame) -> f64 {
        const LEVER_M: f64 = 1.0;
        let now = raw.base_from_tip.map(|pose| (raw.sim_time_s, pose));
        let before = std::mem::replace(&mut self.seen_tip, now);
        let Some(((before_s, before), (now_s, now))) = before.zip(now).filter(|(before, now)| now.0 > before.0) else {
            return 0.0;
        };
        let (metres, radians) = before.distance_to(&now);
        (metres + LEVER_M * radians) / (now_s - before_s)
    }

    /// Prepares the newest images for the window.
    fn prepare(&mut self, raw: RawFrame, limits_m: [f32; 2], received_s: f64) -> Result<LiveFrame, PortError> {
        let [_, far_plane_m] = limits_m;
        let image_off_m = raw.image_age_s * self.speed_m_s(&raw);
        if let Some(depth) = &raw.depth {
            self.auto_range_m = depth::range_of(depth, far_plane_m, self.auto_range_m);
        }
        let depth_range_m = match self.scale {
            DepthScale::Full => limits_m,
            DepthScale::Auto => self.auto_range_m.unwrap_or(limits_m),
        };
        let coloured = |metres| {
            ColouredDepth::new(metres, self.colours, depth_range_m, far_plane_m)
                .map_err(|error| PortError::Refused(text!("The depth image cannot be shown: {why}", why = error)))
        };
        let depth = raw.depth.map(coloured).transpose()?;
        self.number += 1;
        let info = FrameInfo {
            number: self.number,
            sim_time_s: raw.sim_time_s,
            image_age_s: raw.image_age_s,
            image_off_m,
            received_s,
            rate_hz: self.rate.rate_hz(),
            depth_range_m,
            far_plane_m,
            base_from_tip: raw.base_from_tip,
            no_pose: raw.no_pose.map(Box::new),
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

    fn connect(&mut self, connector: &dyn Cell, shutdown: &CancelToken) -> Result<Connected<Self::Port>, PortError> {
        self.seen_sim_time_s = None;
        self.rate = RateMeter::default();
        connector.camera(shutdown)
    }

    fn turn(&mut self, port: &mut Self::Port, outlet: &Outlet) -> Result<Duration, PortError> {
        let newest = port.newest(self.seen_sim_time_s)?;
        if newest != Newest::Awaited {
            self.for_vision.heard(outlet.now_s());
        }
        let Newest::Frame(raw) = newest else { return Ok(PERIOD) };
        let received_s = outlet.now_s();
        self.seen_sim_time_s = Some(raw.sim_time_s);
        self.rate.arrived(received_s);
        let frame = self.prepare(*raw, port.depth_limits_m(), received_s)?;
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
        // A paused simulation would otherwise show the old colours until it runs.
        self.seen_sim_time_s = None;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use handeye_arm::JointValues;
    use image::RgbImage;

    use super::*;

    /// Returns what it is given, the last one first.
    struct Scripted(Vec<Newest>);

    impl CameraPort for Scripted {
        fn newest(&mut self, _seen_s: Option<f64>) -> Result<Newest, PortError> {
            Ok(self.0.pop().expect("no more is asked for"))
        }

        fn depth_limits_m(&self) -> [f32; 2] {
            [0.1, 1.0]
        }
    }

    fn frame(sim_time_s: f64, x_m: f64) -> Newest {
        Newest::Frame(Box::new(RawFrame {
            rgb: RgbImage::new(4, 2),
            depth: None,
            sim_time_s,
            image_age_s: 0.03,
            base_from_tip: Some(Pose::from_translation_xyzw([x_m, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])),
            no_pose: None,
            joints_rad: JointValues::zeros(0),
            base_from_target_true: None,
            clocks: None,
        }))
    }

    /// A camera that answers belongs to a paused simulation; one that does not is slow, or gone.
    #[test]
    fn a_camera_is_heard_when_it_answers_and_the_tip_may_be_as_far_off_as_it_moves_meanwhile() {
        let (frames, tap) = (Arc::<LatestSlot<LiveFrame>>::default(), Arc::new(Tap::new().0));
        let mut camera = Camera::new(&ViewSettings::default(), Arc::clone(&frames), Arc::clone(&tap));
        let now_s = Arc::new(Mutex::new(0.0));
        let clock = Arc::clone(&now_s);
        let outlet = Outlet {
            events: crossbeam_channel::bounded(64).0,
            waker: Arc::new(|| {}),
            clock: Arc::new(move || *clock.lock().expect("no panic")),
        };
        let script = vec![frame(3.1, 0.51), frame(3.0, 0.5), frame(2.0, 0.5), Newest::Same, Newest::Awaited];
        let mut port: Box<dyn CameraPort> = Box::new(Scripted(script));
        let mut turn = |at_s: f64| {
            *now_s.lock().expect("no panic") = at_s;
            camera.turn(&mut port, &outlet).expect("connected");
            (tap.heard_s(), frames.take().map(|(frame, _)| frame.info.image_off_m))
        };
        assert_eq!(turn(1.0), (None, None));
        assert_eq!(turn(2.0), (Some(2.0), None));
        assert_eq!(turn(3.0), (Some(3.0), Some(0.0)), "where it was before is not known");
        assert_eq!(turn(4.0), (Some(4.0), Some(0.0)), "it stands");
        let (_, off_m) = turn(5.0);
        // 10 mm in 0.1 s, and 30 ms.
        assert!(off_m.is_some_and(|off_m| (off_m - 3e-3).abs() < 1e-9), "{off_m:?}");
    }
}
