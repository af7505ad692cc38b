//! Looks at recordings and converts them, off the window's thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use handeye_files::bounds::Bounds;
use handeye_files::budget::{Budget, Limits, Spent};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_import::{self as import, ImportError, Plan, Recording, Settings, Source, write};
use image::RgbImage;

use super::Event;
use super::state::{Converted, Found, ImportWork};
use super::understand::{self, NotUnderstood};
use crate::capture::thumbnail;
use crate::text::Text;
use crate::worker::link::Outlet;
use handeye_wording::text;

/// Images of a stream that are shown before anything is written.
const PREVIEWS: usize = 4;

/// What can be asked for.
pub struct ImportJob {
    pub number: u64,
    pub task: ImportTask,
}

/// What can be asked for.
pub enum ImportTask {
    /// Read the files and look for the target.
    Look {
        /// The recording.
        path: PathBuf,
        /// What its files may refer to.
        bounds: Bounds,
        /// How long its files may be read.
        time: Duration,
        /// What was found in it before.
        known: Option<Arc<Found>>,
        /// The target; `None`: as the files have it.
        target: Option<TargetSpec>,
        /// What was fixed.
        settings: Settings,
    },
    /// Try the hypotheses again with other settings, on what was already searched.
    Judge {
        /// What was found.
        known: Arc<Found>,
        /// What was fixed.
        settings: Settings,
    },
    /// Make a data set of a hypothesis.
    Convert {
        /// What was found.
        known: Arc<Found>,
        /// Its index.
        hypothesis: usize,
        /// Whether the user chose it out of several.
        is_taken: bool,
    },
    /// Make a data set of the images alone.
    ConvertImages {
        /// What was found.
        known: Arc<Found>,
    },
}

/// Does it and reports.
pub fn perform(job: &ImportJob, cancel: &CancelToken, outlet: &Outlet) {
    let number = job.number;
    let defect = |_panic| {
        // A panic must not end the thread, nor leave the user waiting.
        tracing::error!("a recording was not read by a defect of this program: report it");
        text!("it was not read because of a defect of this program: please report it")
    };
    let event = match &job.task {
        ImportTask::Convert { known, hypothesis, is_taken } => {
            let work = || convert(known, *hypothesis, *is_taken, number, outlet);
            let converted = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(defect(panic)));
            Event::Converted { number, converted: converted.map(Arc::new) }
        }
        ImportTask::ConvertImages { known } => {
            let work = || convert_images(known, number, outlet);
            let converted = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(defect(panic)));
            Event::Converted { number, converted: converted.map(Arc::new) }
        }
        ImportTask::Look { path, bounds, time, known, target, settings } => {
            let open = || {
                let begun = Instant::now();
                let elapsed = || begun.elapsed();
                let limits = Limits::default().with_time(*time);
                import::open_within(path, bounds, &Budget::new(limits, &elapsed, cancel)).map(Arc::new)
            };
            let work = || look(open, known.as_deref(), *target, settings, number, cancel, outlet);
            let (found, trouble) =
                catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| (None, Some(defect(panic))));
            Event::Looked { number, found: found.map(Arc::new), trouble }
        }
        ImportTask::Judge { known, settings } => {
            let work = || judged(known, settings, cancel);
            let (found, trouble) =
                catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| (None, Some(defect(panic))));
            Event::Looked { number, found: found.map(Arc::new), trouble }
        }
    };
    if !cancel.is_cancelled() {
        outlet.report(event);
    }
}

/// What was found, and why no more was.
type Answer = (Option<Found>, Option<Text>);

fn error_text(error: NotUnderstood) -> Text {
    match error {
        NotUnderstood::Target(why) => why,
        NotUnderstood::Import(ImportError::Stopped { why: Spent::Time(time), .. }) => text!(
            "Reading was stopped after {seconds} s: open the folder or file of one recording, or allow more time",
            seconds = time.as_secs()
        ),
        NotUnderstood::Import(ImportError::Stopped { why: Spent::Unpacked(bytes), .. }) => text!(
            "Reading was stopped: its compressed files unpack to more than {size} GiB. Unpack them yourself, or use \
             “handeye import --unpack”",
            size = bytes >> 30
        ),
        error => error.into(),
    }
}

fn look(
    open: impl FnOnce() -> Result<Arc<Recording>, ImportError>,
    known: Option<&Found>,
    target: Option<TargetSpec>,
    settings: &Settings,
    number: u64,
    cancel: &CancelToken,
    outlet: &Outlet,
) -> Answer {
    let opened = match known.map(|known| Arc::clone(&known.opened)).map_or_else(open, Ok) {
        Ok(opened) => opened,
        Err(error) => return (None, Some(error_text(error.into()))),
    };
    let progress = |done, of| outlet.report(Event::Progress { number, work: ImportWork::Looking(done, of) });
    let looked = understand::look(&opened, target, settings, &progress, cancel);
    let recording = looked.as_ref().map_or_else(|_| Arc::clone(&opened), |looked| Arc::clone(&looked.recording));
    // Only some of the images of a moving robot are kept.
    let known = known.filter(|known| Arc::ptr_eq(&known.recording, &recording));
    let previews = known.map_or_else(|| Arc::new(previews(&recording)), |known| Arc::clone(&known.previews));
    let settings_used = settings.clone();
    let mut found =
        Found { opened, recording, looked: None, given: target, settings: settings_used, judgement: None, previews };
    let outcome = looked.and_then(|looked| {
        let judgement = looked.judge(settings, cancel);
        found.looked = Some(Arc::new(looked));
        found.judgement = Some(judgement?);
        Ok(())
    });
    (Some(found), outcome.err().map(error_text))
}

fn judged(known: &Found, settings: &Settings, cancel: &CancelToken) -> Answer {
    let Found { opened, recording, looked, given, previews, .. } = known;
    let (opened, recording, previews) = (Arc::clone(opened), Arc::clone(recording), Arc::clone(previews));
    let looked = looked.clone();
    let judgement = looked.as_ref().map(|looked| looked.judge(settings, cancel)).transpose();
    let (judgement, trouble) = match judgement {
        Ok(judgement) => (judgement, None),
        Err(error) => (None, Some(error_text(error))),
    };
    let (given, settings) = (*given, settings.clone());
    (Some(Found { opened, recording, looked, given, settings, judgement, previews }), trouble)
}

fn previews(recording: &Recording) -> Vec<Vec<Arc<RgbImage>>> {
    let small =
        |path: &PathBuf| handeye_images::load_rgb(path).map_or_else(|_| RgbImage::new(1, 1), |image| thumbnail(&image));
    let of_stream = |stream: usize| {
        let has_images = recording.streams[stream].points.is_none();
        let paths = if has_images { recording.image_paths(stream) } else { Vec::new() };
        paths.iter().take(PREVIEWS).map(|path| Arc::new(small(path))).collect()
    };
    (0..recording.streams.len()).map(of_stream).collect()
}

fn convert(known: &Found, hypothesis: usize, is_taken: bool, number: u64, outlet: &Outlet) -> Result<Converted, Text> {
    let Found { recording, looked, settings, judgement, .. } = known;
    let (Some(looked), Some(judgement)) = (looked, judgement) else { return Err(text!("nothing was found")) };
    let Some(chosen) = judgement.hypotheses.get(hypothesis) else { return Err(text!("nothing was found")) };
    if matches!(chosen.source, Source::Track(_)) {
        return Err(text!(
            "this recording has poses of the target and no images, which a session needs: “handeye import” and “handeye \
             calibrate” solve it"
        ));
    }
    if let Source::Stream(stream) = chosen.source
        && recording.streams.get(stream).is_some_and(|stream| stream.points.is_some())
    {
        return Err(text!(
            "this recording has corners in the place of images, which a session needs: “handeye import” and “handeye \
             calibrate” solve it"
        ));
    }
    let plan = import::plan(chosen, &looked.context(judgement, settings, chosen, is_taken), None);
    written(plan, recording, number, outlet)
}

fn convert_images(known: &Found, number: u64, outlet: &Outlet) -> Result<Converted, Text> {
    let plan = known.target().and_then(|target| import::plan_images(&known.recording, &known.settings, &target));
    written(plan.ok_or_else(|| text!("nothing was found"))?, &known.recording, number, outlet)
}

fn written(plan: Plan, recording: &Recording, number: u64, outlet: &Outlet) -> Result<Converted, Text> {
    let folder = tempfile::tempdir()
        .map_err(|why| text!("There is no room for the data set on the way to a session: {why}", why = why))?;
    let progress = |done, of| outlet.report(Event::Progress { number, work: ImportWork::Writing(done, of) });
    write::write(&plan, folder.path(), progress)?;
    let name =
        recording.root.file_name().map_or_else(|| "recording".into(), |name| name.to_string_lossy().into_owned());
    Ok(Converted { folder, name, left_out: plan.left_out })
}
