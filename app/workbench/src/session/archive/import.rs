//! A data set becomes a session: its images and poses are copied, and it is left unchanged.

use std::fs;
use std::path::Path;

use handeye_dataset::{DESCRIPTION, Dataset};
use handeye_files::atomic_file;
use handeye_files::bounds::Bounds;
use handeye_session::{Capture, Document, Role, Store};

use super::{Archive, free_folder, timestamp_rfc3339};
use crate::import::state::Converted;
use crate::messages::state::Severity;
use crate::sample;
use crate::session;
use crate::session::start;
use crate::text::Text;
use handeye_wording::text;

/// How a recording was interpreted, in the session made from it.
const IMPORTED: &str = "imported.toml";

impl Archive {
    pub(super) fn import(&mut self, dataset: &Path, bounds: &Bounds) {
        let name = dataset.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.import_as(dataset, &name, bounds);
    }

    pub(super) fn import_sample(&mut self) {
        let unpacked = tempfile::tempdir().and_then(|folder| sample::write(folder.path()).map(|()| folder));
        match unpacked {
            Ok(folder) => {
                self.import_as(folder.path(), sample::NAME, &Bounds::within(folder.path()));
            }
            Err(error) => {
                let why = text!("The data set was not opened: {why}", why = error);
                self.outlet.report(session::Event::Failed { why });
            }
        }
    }

    /// The session keeps how the recording was interpreted.
    pub(super) fn import_converted(&mut self, converted: &Converted) {
        let described = converted.folder.path().join(DESCRIPTION);
        let bounds = Bounds::within(converted.folder.path());
        let Some(store) = self.import_as(converted.folder.path(), &converted.name, &bounds) else { return };
        let kept = fs::read(&described).and_then(|bytes| atomic_file::write(&store.folder().join(IMPORTED), &bytes));
        if let Err(error) = kept {
            tracing::warn!(%error, "how the recording was understood was not kept");
        }
        let left_out = converted.left_out.len();
        if left_out > 0 {
            let text = text!(
                "{count} {count|pose or image was|poses and images were} left out; {file} in the session says why",
                count = left_out,
                file = IMPORTED
            );
            self.outlet.notice(Severity::Warning, text);
        }
    }

    fn import_as(&mut self, dataset: &Path, name: &str, bounds: &Bounds) -> Option<&Store> {
        let imported =
            self.copy(dataset, name, bounds).map_err(|why| text!("The data set was not opened: {why}", why = why));
        match imported {
            Ok((store, outside)) => {
                let folder = store.folder().display().to_string();
                self.store = Some(store);
                self.report_document();
                self.outlet.report(session::Event::Opened { exported: false });
                let text = text!("The data set was copied to the session {folder}", folder = folder);
                self.outlet.notice(Severity::Info, text);
                if outside > 0 {
                    let text = text!(
                        "{count} {count|file of the data set lies|files of the data set lie} outside of its folder",
                        count = outside
                    );
                    self.outlet.notice(Severity::Warning, text);
                }
            }
            Err(why) => {
                self.outlet.report(session::Event::Failed { why });
                return None;
            }
        }
        self.store.as_ref()
    }

    /// The session, and how many files of the data set lie outside of its folder.
    fn copy(&self, folder: &Path, name: &str, bounds: &Bounds) -> Result<(Store, usize), Text> {
        let dataset = Dataset::read_within(folder, bounds)?;
        let target_folder = free_folder(&self.sessions, name);
        let mut meta = start::meta(None, timestamp_rfc3339());
        meta.target = dataset.target;
        meta.camera = dataset.camera;
        meta.arm = dataset.arm.as_ref().map(|arm| arm.model.clone());
        meta.tool_m = dataset.tool_m;
        meta.robot_accuracy_mm = dataset.robot_accuracy_mm;
        if let Some(mode) = dataset.mode {
            meta.mode = mode;
        }
        // Everything is read before anything is written, so that a bad row leaves nothing behind.
        let mut captures = Vec::with_capacity(dataset.entries.len());
        for (index, entry) in dataset.entries.iter().enumerate() {
            let (row, name) = (index + 1, &entry.name);
            if entry.image_path.is_none() {
                return Err(text!(
                    "row {row} ({name}) has no image: solve this data set with “handeye calibrate” instead",
                    row = row,
                    name = name
                ));
            }
            captures.push(entry);
        }
        let mut store = Store::create_with(&target_folder, Document::new(meta))?;
        for entry in captures {
            let image = dataset.load_rgb(entry)?;
            let added = store.add_capture(&Capture {
                image: &image,
                depth_m: None,
                base_from_tip: entry.base_from_tip,
                joints_rad: entry.joints_rad.as_deref(),
                sim_time_s: None,
                role: Role::Calibration,
                frames: 1,
                corner_noise_px: None,
                settled_s: None,
                pose_name: Some(&entry.name),
            });
            added?;
        }
        Ok((store, dataset.outside.len()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::command::Event;
    use crate::text::Language;
    use crate::worker::link::Outlet;

    #[test]
    fn a_data_set_without_images_is_refused_in_the_language_of_the_window_and_leaves_nothing_behind() {
        let home = tempfile::tempdir().expect("a folder");
        let (dataset, sessions) = (home.path().join("tuesday"), home.path().join("sessions"));
        fs::create_dir(&dataset).expect("made");
        let described = "mode = \"eye_in_hand\"\n\
            [target]\nkind = \"chessboard\"\ncolumns = 10\nrows = 7\nsquare_m = 0.015\ncorners = \"corners.csv\"\n\
            [robot]\nposes = \"poses.csv\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n\
            [camera]\nfixed = false\nwidth = 640\nheight = 480\nmodel = \"none\"\n";
        let poses = "image,x,y,z,qx,qy,qz,qw\n1.png,0.4,0,0.3,0,0,0,1\n";
        let corners = "image,column,row,u,v\n1.png,0,0,10,20\n";
        for (name, text) in [("dataset.toml", described), ("poses.csv", poses), ("corners.csv", corners)] {
            fs::write(dataset.join(name), text).expect("written");
        }
        let (events, reported) = crossbeam_channel::unbounded();
        let outlet = Outlet { events, waker: Arc::new(|| {}), clock: Arc::new(|| 0.0) };
        Archive::new(sessions.clone(), outlet).import(&dataset, &Bounds::ANYWHERE);
        let Ok(Event::Session(session::Event::Failed { why })) = reported.try_recv() else { panic!("it was opened") };
        assert_eq!(
            why.in_language(Language::English),
            "The data set was not opened: row 1 (1.png) has no image: solve this data set with “handeye calibrate” \
             instead"
        );
        let chinese = why.in_language(Language::Chinese);
        assert!(chinese.contains("第 1 行（1.png）没有图像") && !chinese.contains("has no"), "{chinese}");
        assert!(!sessions.exists(), "nothing was begun");
    }

    /// The uploader of a data set chooses what its tables contain.
    #[test]
    fn an_upload_that_names_an_image_outside_of_it_is_refused_by_every_way_and_nothing_is_copied() {
        let home = tempfile::tempdir().expect("a folder");
        let (upload, sessions) = (home.path().join("uploads/1"), home.path().join("sessions"));
        let private = home.path().join("private.png");
        fs::create_dir_all(&upload).expect("made");
        image::RgbImage::new(64, 48).save(&private).expect("saved");
        std::os::unix::fs::symlink(&private, upload.join("linked.png")).expect("linked");
        let described = "mode = \"eye_in_hand\"\n\
            [target]\nkind = \"chessboard\"\ncolumns = 10\nrows = 7\nsquare_m = 0.015\n\
            [robot]\nposes = \"POSES\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n";
        let header = "image,x,y,z,qx,qy,qz,qw\n";
        fs::write(home.path().join("secret.csv"), "root:secret\n").expect("written");
        let (events, reported) = crossbeam_channel::unbounded();
        let outlet = Outlet { events, waker: Arc::new(|| {}), clock: Arc::new(|| 0.0) };
        let mut archive = Archive::new(sessions.clone(), outlet);
        let absolute = private.display().to_string();
        for (poses, image) in [
            ("poses.csv", "../../private.png"),
            ("poses.csv", "linked.png"),
            ("poses.csv", absolute.as_str()),
            ("poses.csv", "../../not-there.png"),
            ("../../secret.csv", "own.png"),
        ] {
            fs::write(upload.join("dataset.toml"), described.replace("POSES", poses)).expect("written");
            fs::write(upload.join("poses.csv"), format!("{header}{image},0.4,0,0.3,0,0,0,1\n")).expect("written");
            archive.open(&upload, &Bounds::within(&upload));
            let Ok(Event::Session(session::Event::Failed { why })) = reported.try_recv() else {
                panic!("{image} was opened")
            };
            let why = why.in_language(Language::English);
            assert!(why.contains("outside of the folder") || why.contains("not a path relative"), "{image}: {why}");
            assert!(!why.contains("secret:") && !why.contains("root"), "{why}");
            assert!(!sessions.exists(), "nothing was begun");
        }
        let alone = "[target]\nkind = \"chessboard\"\ncolumns = 10\nrows = 7\nsquare_m = 0.015\n";
        for image in ["../../private.png", "linked.png", absolute.as_str(), "../../not-there.png"] {
            fs::write(upload.join("dataset.toml"), format!("images = ['{image}']\n{alone}")).expect("written");
            archive.open(&upload, &Bounds::within(&upload));
            let Ok(Event::Session(session::Event::Failed { why })) = reported.try_recv() else {
                panic!("{image} was opened")
            };
            let why = why.in_language(Language::English);
            assert!(why.contains("outside of the folder") || why.contains("a path relative"), "{image}: {why}");
            assert!(!sessions.exists(), "nothing was begun");
        }
        // A user at this machine may do it.
        fs::write(upload.join("dataset.toml"), described.replace("POSES", "poses.csv")).expect("written");
        fs::write(upload.join("poses.csv"), format!("{header}../../private.png,0.4,0,0.3,0,0,0,1\n")).expect("written");
        archive.open(&upload, &Bounds::ANYWHERE);
        assert!(sessions.exists());
    }
}
