//! What lies in a folder: which format each file is of, and why it is taken for that.

use std::path::{Path, PathBuf};

use super::error::ImportError;
use super::folder;
use super::formats::tree::{self, LEAST_POSES};
use super::formats::{
    easy_handeye, industrial_calibration, intrinsics, joints, moveit, npz, program, rosbag, table, visp,
};
use super::recording::{FoundTarget, Recording, Sample, Stated, Track};
use super::value::{self, Value};
use crate::project::files::own_folder::{DESCRIPTION, is_session};

/// Files of text that are read at the most.
const MOST_DOCUMENTS: usize = 5000;

/// Looks at a folder, or at a file and what lies beside it.
///
/// # Errors
/// [`ImportError`] where the folder cannot be listed, or is a data set already. A file that cannot be understood is named in
/// [`Recording::warnings`].
pub fn open(path: &Path) -> Result<Recording, ImportError> {
    if path.join(DESCRIPTION).exists() || is_session(path) {
        return Err(ImportError::AlreadyADataset(path.to_path_buf()));
    }
    let (root, files) = folder::list(path)?;
    let mut recording = Recording { root: root.clone(), ..Recording::default() };
    recording.streams = folder::streams(&root, &files, &mut recording.warnings);
    for stream in &recording.streams {
        let depth = if stream.is_depth { ", 16 bits in one channel: depth" } else { "" };
        let (first, last) = (stream.images.first(), stream.images.last());
        let ends = first.zip(last).map(|(a, b)| format!(", {} to {}", a.shown(), b.shown())).unwrap_or_default();
        let (width, height) = stream.size;
        recording.beliefs.push(format!(
            "{} images {} of {width}×{height} px{ends}{depth}",
            stream.images.len(),
            stream.name
        ));
    }
    let mut reader = Reader { root: &root, recording, documents: 0 };
    let (bags, others): (Vec<PathBuf>, Vec<PathBuf>) =
        files.iter().filter(|file| !folder::is_image(file)).cloned().partition(|file| folder::is_bag(file));
    for members in folder::groups(&others, true) {
        reader.group(&members);
    }
    reader.bags(&bags);
    let mut recording = reader.recording;
    if moveit::know(&mut recording.tracks) {
        recording.beliefs.push("the poses are samples of MoveIt calibration, by their names".into());
    }
    for track in &recording.tracks {
        let joints = track.samples.iter().filter(|s| !s.joints.is_empty()).count();
        let with = if joints > 0 { format!(", {joints} of them with joint values") } else { String::new() };
        let kind = match track.samples[0].numbers {
            super::Numbers::Angles(_) => "six numbers",
            super::Numbers::Quaternion(_) => "translation and quaternion",
            super::Numbers::Matrix(_) => "matrices",
        };
        recording.beliefs.push(format!("{} poses in {}: {kind}{with}", track.samples.len(), track.name));
    }
    for series in &recording.joints {
        let names = if series.joints.is_empty() { String::new() } else { format!(" ({})", series.joints.join(", ")) };
        let count = series.samples.len();
        recording
            .beliefs
            .push(format!("{count} rows of joint values in {}{names}: arm=… makes poses of them", series.name));
    }
    for camera in &recording.cameras {
        recording.beliefs.push(format!("a camera in {}: {}", camera.name, camera.why));
    }
    for FoundTarget { target, file, is_id_open } in &recording.targets {
        let open = if *is_id_open { ", which number of its family is not said" } else { "" };
        recording.beliefs.push(format!("a target in {file}: {target}{open}"));
    }
    Ok(recording)
}

struct Reader<'a> {
    root: &'a Path,
    recording: Recording,
    documents: usize,
}

impl Reader<'_> {
    fn warn(&mut self, file: &Path, why: impl std::fmt::Display) {
        const MOST: usize = 50;
        if self.recording.warnings.len() < MOST {
            self.recording.warnings.push(format!("{}: {why}", file.display()));
        }
    }

    fn text(&mut self, file: &Path) -> Option<String> {
        self.documents += 1;
        if self.documents > MOST_DOCUMENTS {
            return None;
        }
        match folder::text(&self.root.join(file)) {
            Ok(text) => Some(text),
            Err(error) => {
                self.recording.warnings.push(error.to_string());
                None
            }
        }
    }

    /// The first document of a file of JSON or YAML.
    fn document(&mut self, file: &Path) -> Option<Value> {
        let text = self.text(file)?;
        let parsed = match folder::ending(file).as_str() {
            "json" | "jsonl" => value::json(&text),
            _ => value::yaml(&text).map(|mut documents| match documents.len() {
                // A document to a message, as `ros2 topic echo` writes them.
                LEAST_POSES.. => Value::List(documents),
                1.. => documents.swap_remove(0),
                0 => Value::Other,
            }),
        };
        match parsed {
            Ok(value) => Some(value),
            Err(why) => {
                self.warn(file, format_args!("is not used: {}", why.lines().next().unwrap_or_default()));
                None
            }
        }
    }

    /// Files of one naming.
    fn group(&mut self, members: &[(PathBuf, Option<u64>)]) {
        match folder::ending(&members[0].0).as_str() {
            "json" | "jsonl" | "yaml" | "yml" | "samples" | "calib" => self.documents(members),
            "csv" | "txt" | "tsv" | "dat" | "" | "log" => self.tables(members),
            // Programs of robots.
            "script" | "src" | "mod" | "ls" => self.each(members, |reader, file, text| {
                reader.recording.tracks.extend(program::read(&file.display().to_string(), text));
            }),
            "npz" | "npy" => self.arrays(members),
            "xml" => self.each(members, |reader, file, text| {
                let name = file.display().to_string();
                reader.recording.cameras.extend(visp::camera(text, &name));
                if let Some(value) = value::opencv_xml(text) {
                    reader.single(file, &value);
                }
            }),
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

    /// Files of a bag of ROS 2 with its description beside them are one, compressed or not; others are each a bag.
    fn bags(&mut self, files: &[PathBuf]) {
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
            let read = rosbag::read(&name.display().to_string(), &parts, &mut self.recording);
            if let Err(why) = read {
                self.warn(files[0], format_args!("is not used: {why}"));
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
        let mut read: Vec<(&Path, Option<u64>, Value)> = Vec::new();
        for (file, number) in members {
            if let Some(value) = self.document(file) {
                read.push((file.as_path(), *number, value));
            }
        }
        if members.len() >= LEAST_POSES && self.one_to_a_file(&read) {
            return;
        }
        for (file, _, value) in &read {
            self.single(file, value);
        }
    }

    /// A pose to a file; whether it is so.
    fn one_to_a_file(&mut self, read: &[(&Path, Option<u64>, Value)]) -> bool {
        let are_vectors = read.iter().filter(|(.., value)| visp::is_pose(value)).count() * 2 > read.len();
        let mut by_path: Vec<(String, Stated, Vec<Sample>)> = Vec::new();
        for (file, number, value) in read {
            let fields = tree::fields(value);
            for (path, numbers, stated) in fields.poses {
                let sample = Sample {
                    image: fields.image.clone(),
                    number: number.or(fields.number),
                    place: file.display().to_string(),
                    numbers,
                    joints: fields.joints.clone(),
                };
                match by_path.iter_mut().find(|(known, ..)| *known == path) {
                    Some((.., samples)) => samples.push(sample),
                    None => by_path.push((path, stated, vec![sample])),
                }
            }
        }
        let (naming, _) = folder::naming(read.first().map_or(Path::new(""), |(file, ..)| file), true);
        let files = naming.shown();
        let before = self.recording.tracks.len();
        for (path, stated, mut samples) in by_path {
            if 2 * samples.len() < read.len() {
                continue;
            }
            samples.sort_by(|a, b| crate::natural_order::compare(&a.place, &b.place));
            let hint = if path.is_empty() { &files } else { &path };
            let Some(mut track) = tree::track(tree::track_name(&files, &path), hint, stated, samples) else { continue };
            if are_vectors {
                visp::know(&mut track);
            }
            self.recording.tracks.push(track);
        }
        if self.recording.tracks.len() > before {
            return true;
        }
        let values = read.iter().filter_map(|(file, number, value)| {
            let fields = tree::fields(value);
            let place = file.display().to_string();
            let has_alone = fields.poses.is_empty() && !fields.joints.is_empty();
            has_alone.then(|| joints::sample(place, fields.image, number.or(fields.number), fields.joints))
        });
        let values: Vec<_> = values.collect();
        let series =
            joints::series(files, Vec::new(), None, values).filter(|series| 2 * series.samples.len() >= read.len());
        let is_series = series.is_some();
        self.recording.joints.extend(series);
        is_series
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
                let text = folder::text(&self.root.join(path)).ok()?;
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
    }

    /// Two files that say different things leave it open.
    fn mode(&mut self, mode: super::Known<crate::estimate::handeye::Mode>) {
        match &self.recording.mode {
            Some(known) if known.value != mode.value => {
                let warning = format!("{} and {} contradict each other", known.why, mode.why);
                self.recording.warnings.push(warning);
                self.recording.mode = None;
            }
            _ => self.recording.mode = Some(mode),
        }
    }

    fn tables(&mut self, members: &[(PathBuf, Option<u64>)]) {
        let mut texts = Vec::new();
        for (file, number) in members {
            if let Some(text) = self.text(file) {
                texts.push((file.clone(), *number, text));
            }
        }
        if members.len() >= LEAST_POSES && self.one_pose_to_a_text(&texts) {
            return;
        }
        for (file, _, text) in texts {
            let name = file.display().to_string();
            self.recording.targets.extend(visp::target(&text, &name));
            if let Some(track) = program::read(&name, &text) {
                self.recording.tracks.push(track);
                continue;
            }
            let tracks = table::read(&name, &text);
            if tracks.is_empty() {
                self.recording.joints.extend(table::joints(&name, &text));
            }
            self.recording.tracks.extend(tracks);
        }
    }

    /// A matrix or a row to a file of text; whether it is so.
    fn one_pose_to_a_text(&mut self, texts: &[(PathBuf, Option<u64>, String)]) -> bool {
        let one = |(file, number, text): &(PathBuf, Option<u64>, String)| {
            let is_sign = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']' | '(' | ')');
            let words: Vec<&str> = text.split(is_sign).filter(|w| !w.is_empty()).take(20).collect();
            let numbers: Vec<f64> = words.iter().map(|word| value::number(word)).collect::<Option<_>>()?;
            let (numbers, _) = tree::of_numbers(&numbers, "")?;
            let place = file.display().to_string();
            Some(Sample { image: None, number: *number, place, numbers, joints: Vec::new() })
        };
        let samples: Vec<Sample> = texts.iter().filter_map(one).collect();
        if 2 * samples.len() < texts.len() {
            return false;
        }
        let (naming, _) = folder::naming(&texts[0].0, true);
        let name = naming.shown();
        let Some(track) = tree::track(name.clone(), &name, Stated::default(), samples) else { return false };
        self.recording.tracks.push(track);
        true
    }

    fn arrays(&mut self, members: &[(PathBuf, Option<u64>)]) {
        if members.len() >= LEAST_POSES && self.one_pose_to_an_array(members) {
            return;
        }
        for (file, _) in members {
            let name = file.display().to_string();
            match folder::bytes(&self.root.join(file)) {
                Err(error) => self.recording.warnings.push(error.to_string()),
                Ok(bytes) => match npz::read(&name, &bytes) {
                    Err(why) => self.warn(file, format_args!("is not used: {why}")),
                    Ok((tracks, warnings)) => {
                        self.recording.tracks.extend(tracks);
                        self.recording.warnings.extend(warnings);
                    }
                },
            }
        }
    }

    /// A pose to a file of NumPy; whether it is so.
    fn one_pose_to_an_array(&mut self, members: &[(PathBuf, Option<u64>)]) -> bool {
        // Files of many poses are large, and looked at by themselves.
        const LARGEST: u64 = 1 << 16;
        let one = |(file, number): &(PathBuf, Option<u64>)| {
            let path = self.root.join(file);
            if std::fs::metadata(&path).ok()?.len() > LARGEST {
                return None;
            }
            let numbers = npz::pose(&folder::bytes(&path).ok()?)?;
            let place = file.display().to_string();
            Some(Sample { image: None, number: *number, place, numbers, joints: Vec::new() })
        };
        let samples: Vec<Sample> = members.iter().filter_map(one).collect();
        if 2 * samples.len() < members.len() {
            return false;
        }
        let (naming, _) = folder::naming(&members[0].0, true);
        let name = naming.shown();
        let Some(track) = tree::track(name.clone(), &name, Stated::default(), samples) else { return false };
        self.recording.tracks.push(track);
        true
    }
}
