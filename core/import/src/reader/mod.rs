//! Reads the files of a recording, each as what its name and its beginning say.

mod pose_files;

use std::path::{Path, PathBuf};

use super::folder;
use super::formats::tree::{self, LEAST_POSES};
use super::formats::{
    blocks, board_words, corners, easy_handeye, industrial_calibration, intrinsics, joints, npz, program, rosbag,
    table, text_camera, visp, xml,
};
use super::recording::{FoundMode, FoundTarget, Recording, Stream, Track};
use super::value::{self, Value};
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::text;

/// Files of text that are read at the most.
const MOST_DOCUMENTS: usize = 5000;
/// Lines of a table, a program or a report: ten times as many poses as are taken by hand or by a robot in a day, or as many rows as
/// a robot that is asked a hundred times a second writes in half an hour.
const MOST_LINES: usize = 200_000;

pub(super) struct Reader<'a> {
    root: &'a Path,
    pub recording: Recording,
    budget: &'a Budget<'a>,
    documents: usize,
}

impl<'a> Reader<'a> {
    /// Where the budget is spent, files that follow are not read.
    pub fn new(root: &'a Path, recording: Recording, budget: &'a Budget<'a>) -> Self {
        Self { root, recording, budget, documents: 0 }
    }

    fn warn(&mut self, file: &Path, why: Text) {
        const MOST: usize = 50;
        if self.recording.warnings.len() < MOST {
            self.recording.warnings.push(text!("{name}: {why}", name = file.display(), why = why));
        }
    }

    fn text(&mut self, file: &Path) -> Option<String> {
        self.documents += 1;
        if self.documents > MOST_DOCUMENTS || self.budget.is_spent() {
            return None;
        }
        match folder::text(&self.root.join(file)) {
            Ok(text) if is_too_long(file, &text) => {
                self.warn(
                    file,
                    text!("is not used: it has more than {most} lines, which no table of poses has", most = MOST_LINES),
                );
                None
            }
            Ok(text) => Some(text),
            Err(error) => {
                self.recording.warnings.push(error.into());
                None
            }
        }
    }

    /// The first document of a file of JSON or YAML.
    fn document(&mut self, file: &Path) -> Option<Value> {
        let text = self.text(file)?;
        let parsed = match folder::ending(file).as_str() {
            "json" | "jsonl" => value::json(&text),
            _ => value::yaml(&text).map(messages),
        };
        match parsed {
            Ok(value) => Some(value),
            Err(why) => {
                self.warn(file, not_used(why));
                None
            }
        }
    }

    /// Files of one naming.
    pub fn group(&mut self, members: &[(PathBuf, Option<u64>)]) {
        let Some((first, _)) = members.first() else { return };
        match folder::ending(first).as_str() {
            "json" | "jsonl" | "yaml" | "yml" | "samples" | "calib" => self.documents(members),
            "csv" | "txt" | "tsv" | "dat" | "" | "log" => self.tables(members),
            // Programs of robots.
            "script" | "src" | "mod" | "ls" => self.each(members, |reader, file, text| {
                reader.recording.tracks.extend(program::read(&file.display().to_string(), text));
            }),
            "npz" | "npy" => self.arrays(members),
            "xml" => {
                let mut values = Vec::new();
                for (file, number) in members {
                    let Some(text) = self.text(file) else { continue };
                    self.recording.cameras.extend(visp::camera(&text, &file.display().to_string()));
                    let value = value::opencv_xml(&text).or_else(|| xml::document(&text));
                    values.extend(value.map(|value| (file.clone(), *number, value)));
                }
                self.values(&values);
            }
            "cameramodel" => self.each(members, |reader, file, text| {
                let camera = intrinsics::mrcal(text, &file.display().to_string());
                reader.recording.cameras.extend(camera);
            }),
            "tar" => {
                for (file, _) in members {
                    let Ok(bytes) = folder::bytes(&self.root.join(file)) else { continue };
                    let Some(text) = intrinsics::ost_in_tar(&bytes) else { continue };
                    let name = file.display().to_string();
                    let documents = value::yaml(&text).unwrap_or_default();
                    self.recording.cameras.extend(documents.iter().flat_map(|v| intrinsics::of_document(v, &name)));
                }
            }
            _ => {}
        }
    }

    /// What lies beside a file that was named: cameras and targets, and no series.
    pub fn companions(&mut self, files: &[PathBuf]) {
        let Recording { tracks, joints, rows, .. } = &self.recording;
        let (tracks, joints, rows) = (tracks.len(), joints.len(), rows.len());
        for file in files {
            self.group(&[(file.clone(), None)]);
        }
        self.recording.tracks.truncate(tracks);
        self.recording.joints.truncate(joints);
        self.recording.rows.truncate(rows);
    }

    /// The images in folders below that a file which was named says: it was named alone, and what lies around it was not looked at.
    pub fn named_images(&mut self) {
        let names = self.recording.tracks.iter().flat_map(|track| &track.samples).filter_map(|it| it.image.as_deref());
        let files = folder::images_below(self.root, names, &self.recording.bounds, self.budget);
        let known = |stream: &Stream| self.recording.streams.iter().any(|it| it.name == stream.name);
        let mut streams = folder::streams(self.root, &files, self.budget, &mut Vec::new());
        streams.retain(|stream| !known(stream));
        self.recording.streams.extend(streams);
    }

    /// Files of a bag of ROS 2 with its description beside them are one, compressed or not; others are each a bag.
    pub fn bags(&mut self, files: &[PathBuf]) {
        let folder_of = |file: &Path| file.parent().unwrap_or(Path::new("")).to_path_buf();
        let has_description = |file: &Path| {
            folder::ending(file) != "bag" && self.root.join(folder_of(file)).join("metadata.yaml").is_file()
        };
        let mut bags: Vec<Vec<&Path>> = Vec::new();
        for file in files {
            // Whoever plays a compressed bag leaves its files unpacked beside it.
            if folder::ending(file) == "zstd" && files.contains(&file.with_extension("")) {
                continue;
            }
            let open = bags.iter_mut().find(|bag| {
                has_description(file) && folder::ending(bag[0]) != "bag" && folder_of(bag[0]) == folder_of(file)
            });
            match open {
                Some(bag) => bag.push(file),
                None => bags.push(vec![file]),
            }
        }
        for files in bags {
            let parts: Vec<PathBuf> = files.iter().map(|file| self.root.join(file)).collect();
            let folder = folder_of(files[0]);
            let name = if files.len() > 1 { &folder } else { files[0] };
            let read = rosbag::read(&name.display().to_string(), &parts, self.budget, &mut self.recording);
            if let Err(why) = read {
                self.warn(files[0], not_used(why));
            }
        }
    }

    fn each(&mut self, members: &[(PathBuf, Option<u64>)], look: impl Fn(&mut Self, &Path, &str)) {
        for (file, _) in members {
            if let Some(text) = self.text(file) {
                look(self, file, &text);
            }
        }
    }

    fn documents(&mut self, members: &[(PathBuf, Option<u64>)]) {
        let mut read: Vec<(PathBuf, Option<u64>, Value)> = Vec::new();
        for (file, number) in members {
            if let Some(value) = self.document(file) {
                read.push((file.clone(), *number, value));
            }
        }
        self.values(&read);
    }

    fn values(&mut self, read: &[(PathBuf, Option<u64>, Value)]) {
        let (streams, targets) = corners::streams(read);
        self.recording.streams.extend(streams);
        self.recording.targets.extend(targets);
        if read.len() >= LEAST_POSES && self.one_to_a_file(read) {
            return;
        }
        for (file, _, value) in read {
            self.single(file, value);
        }
    }

    /// A document by itself.
    fn single(&mut self, file: &Path, value: &Value) {
        let name = file.display().to_string();
        if let Some(mode) = easy_handeye::mode(value, file) {
            let beside = file.with_extension("samples");
            // Of several recordings beside each other each has its own.
            if folder::ending(file) != "calib" || self.root.join(beside).is_file() {
                self.mode(mode);
            }
        }
        if let Some(mode) = industrial_calibration::mode(value, file) {
            self.mode(mode);
        }
        if let Some(target) = industrial_calibration::target(value) {
            self.recording.targets.push(FoundTarget { target, file: name.clone(), is_id_open: false });
        }
        let mut found: Vec<Track> = Vec::new();
        if let Some(tracks) = easy_handeye::samples(value, &name) {
            self.recording.beliefs.push(format!("{name} has samples of easy_handeye2"));
            found = tracks;
        } else {
            let documents = |path: &Path| {
                let path = self.root.join(path);
                let may_be = !self.budget.is_spent() && self.recording.bounds.has(&path);
                let text = may_be.then(|| folder::text(&path).ok()).flatten()?;
                value::yaml(&text).ok()?.into_iter().next()
            };
            if let Some(track) = industrial_calibration::pairs(value, file, documents) {
                self.recording.beliefs.push(format!("{name} lists poses and images as industrial_calibration does"));
                found.push(track);
            }
        }
        if found.is_empty() {
            found = tree::series(value, &name);
            self.recording.joints.extend(joints::of_document(value, &name));
        }
        self.recording.tracks.extend(found);
        self.recording.cameras.extend(intrinsics::of_document(value, &name));
        if self.recording.targets.is_empty() {
            self.recording.beliefs.extend(board_words::told(value, &name));
        }
    }

    /// Two files that say different things leave it open.
    fn mode(&mut self, mode: FoundMode) {
        match &self.recording.mode {
            Some(known) if known.value != mode.value => {
                let warning =
                    text!("{first} and {second} contradict each other", first = known.why(), second = mode.why());
                self.recording.warnings.push(warning);
                self.recording.mode = None;
            }
            _ => self.recording.mode = Some(mode),
        }
    }

    fn tables(&mut self, members: &[(PathBuf, Option<u64>)]) {
        let (mut texts, mut values) = (Vec::new(), Vec::new());
        for (file, number) in members {
            let Some(text) = self.text(file) else { continue };
            // Some call everything that they write a text.
            match document(&text) {
                Some(value) => values.push((file.clone(), *number, value)),
                None => texts.push((file.clone(), *number, text)),
            }
        }
        self.values(&values);
        if texts.len() >= LEAST_POSES && self.one_pose_to_a_text(&texts) {
            return;
        }
        for (file, _, text) in texts {
            let name = file.display().to_string();
            self.recording.targets.extend(visp::target(&text, &name));
            self.recording.cameras.extend(text_camera::read(&text, &file, self.root));
            if let Some(track) = program::read(&name, &text) {
                self.recording.tracks.push(track);
                continue;
            }
            let mut tracks = table::read(&name, &text);
            if tracks.is_empty() {
                let joints = table::joints(&name, &text);
                if joints.is_none() {
                    tracks = blocks::document(&text).map(|value| tree::series(&value, &name)).unwrap_or_default();
                }
                self.recording.joints.extend(joints);
            }
            self.recording.rows.extend(table::unnamed(&name, &text));
            self.recording.tracks.extend(tracks);
        }
    }

    fn arrays(&mut self, members: &[(PathBuf, Option<u64>)]) {
        if members.len() >= LEAST_POSES && self.one_pose_to_an_array(members) {
            return;
        }
        for (file, _) in members {
            if self.budget.is_spent() {
                return;
            }
            let name = file.display().to_string();
            match folder::bytes(&self.root.join(file)) {
                Err(error) => self.recording.warnings.push(error.into()),
                Ok(bytes) => match npz::read(&name, &bytes, self.budget) {
                    Err(why) => self.warn(file, not_used(why)),
                    Ok((tracks, warnings)) => {
                        self.recording.tracks.extend(tracks);
                        self.recording.warnings.extend(warnings);
                    }
                },
            }
        }
    }
}

/// That a file is left out.
fn not_used(why: Text) -> Text {
    text!("is not used: {why}", why = why)
}

/// Whether a text is a table, a program or a report of more lines than are read.
fn is_too_long(file: &Path, text: &str) -> bool {
    let is_document = matches!(&*folder::ending(file), "json" | "jsonl" | "yaml" | "yml" | "samples" | "calib" | "xml");
    !is_document && text.bytes().filter(|b| *b == b'\n').nth(MOST_LINES).is_some()
}

/// The documents of a file of YAML as one value.
fn messages(mut documents: Vec<Value>) -> Value {
    match documents.len() {
        // A document to a message, as `ros2 topic echo` writes them.
        LEAST_POSES.. => Value::List(documents),
        1.. => documents.swap_remove(0),
        0 => Value::Other,
    }
}

/// The value of a text that begins as a document does, whatever its file is called.
fn document(text: &str) -> Option<Value> {
    let text = text.trim_start();
    if text.starts_with("%YAML") {
        return value::yaml(text).ok().map(messages);
    }
    if text.starts_with('<') {
        return value::opencv_xml(text);
    }
    // What else begins with a brace, as frames of KRL, is no JSON; lists of numbers are tables.
    let inner = text.strip_prefix('[').unwrap_or(text).trim_start();
    if inner.starts_with('{') { value::json(text).ok() } else { None }
}

#[cfg(test)]
mod tests;
