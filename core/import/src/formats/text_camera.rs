//! A camera in a text: its matrix and its distortion as printed or saved by a script, with or without words, in one file or in two.

use std::path::Path;

use super::intrinsics;
use super::names::is_call;
use crate::folder;
use crate::recording::FoundCamera;
use crate::value::{Value, number};

/// Most numbers of a text: a camera has about twenty.
const MOST_NUMBERS: usize = 200;

/// Numbers, and the words before them.
struct Run {
    words: Vec<String>,
    numbers: Vec<f64>,
}

impl Run {
    fn has(&self, parts: &[&str]) -> bool {
        self.words.iter().any(|word| parts.iter().any(|part| word.contains(part)))
    }

    fn is_called(&self, names: &[&str]) -> bool {
        self.words.last().is_some_and(|word| names.contains(&word.as_str()))
    }

    /// Words of coefficients of distortion, and no other kind of distortion.
    fn is_distortion(&self) -> bool {
        self.has(&["dist", "coef"]) || self.is_called(&["d"])
    }
}

/// The camera of a text. Where it has a matrix and no distortion, the distortion is read from a file next to it with
/// that name.
pub(super) fn read(text: &str, file: &Path, root: &Path) -> Option<FoundCamera> {
    let runs = runs(text)?;
    let (at, matrix) = matrix(&runs)?;
    let mut fields = vec![("camera_matrix".to_owned(), list(&matrix))];
    let own = distortion(&runs, at);
    let beside = || {
        let text = folder::text(&root.join(distortion_next_to(file, root)?)).ok()?;
        let runs = self::runs(&text)?;
        let numbers: Vec<f64> = runs.iter().flat_map(|run| run.numbers.iter().copied()).collect();
        is_coefficients(numbers.len()).then_some(numbers)
    };
    if let Some(coefficients) = own.or_else(beside) {
        fields.push(("distortion_coefficients".to_owned(), list(&coefficients)));
    }
    let has_word = |parts: &[&str]| runs.iter().any(|run| run.has(parts));
    if has_word(&["fisheye", "equidistant"]) {
        fields.push(("distortion_model".to_owned(), Value::Text("fisheye".to_owned())));
    }
    for (name, keys) in [("width", ["width", "w"]), ("height", ["height", "h"])] {
        let side = runs.iter().find(|run| run.is_called(&keys) && run.numbers.len() == 1);
        fields.extend(side.map(|run| (name.to_owned(), Value::Number(run.numbers[0]))));
    }
    let size = runs.iter().find(|run| run.has(&["resolution", "size"]) && run.numbers.len() == 2);
    fields.extend(size.map(|run| ("image_size".to_owned(), list(&run.numbers))));
    let mut found = intrinsics::of_document(&Value::Map(fields), &file.display().to_string()).pop()?;
    found.why = "a camera matrix in a text";
    Some(found)
}

fn list(numbers: &[f64]) -> Value {
    Value::List(numbers.iter().map(|number| Value::Number(*number)).collect())
}

/// Whether a lens model has this many coefficients.
fn is_coefficients(count: usize) -> bool {
    matches!(count, 4 | 5 | 8 | 12 | 14)
}

fn runs(text: &str) -> Option<Vec<Run>> {
    let is_between = |c: char| {
        c.is_whitespace() || matches!(c, ',' | ';' | '[' | ']' | '(' | ')' | '{' | '}' | '|' | ':' | '=' | '"' | '\'')
    };
    let mut runs: Vec<Run> = Vec::new();
    let mut count = 0;
    for line in text.lines() {
        let mut is_new_line = true;
        for word in line.split(is_between).filter(|word| word.chars().any(char::is_alphanumeric) && !is_call(word)) {
            let is_first = std::mem::take(&mut is_new_line);
            if let Some(number) = number(word) {
                count += 1;
                if count > MOST_NUMBERS {
                    return None;
                }
                match runs.last_mut() {
                    Some(run) => run.numbers.push(number),
                    None => runs.push(Run { words: Vec::new(), numbers: vec![number] }),
                }
                continue;
            }
            let word = word.to_lowercase();
            // A name is on one line; what was reported on lines before is about other things.
            match runs.last_mut().filter(|run| run.numbers.is_empty() && !is_first) {
                Some(run) => run.words.push(word),
                None => runs.push(Run { words: vec![word], numbers: Vec::new() }),
            }
        }
    }
    runs.retain(|run| !run.numbers.is_empty());
    Some(runs)
}

/// The only matrix of a camera among the numbers: the place of its run and where it ends there.
fn matrix(runs: &[Run]) -> Option<((usize, usize), Vec<f64>)> {
    let is_camera = |k: &[f64]| {
        let &[fx, skew, cx, zero, fy, cy, g, h, one] = k else { return false };
        fx > 1.0
            && fy > 1.0
            && cx > 0.0
            && cy > 0.0
            && skew.abs() < 0.05 * fx
            && [zero, g, h, one] == [0.0, 0.0, 0.0, 1.0]
    };
    let mut found: Vec<((usize, usize), Vec<f64>)> = Vec::new();
    for (at, run) in runs.iter().enumerate() {
        let windows = run.numbers.windows(9).enumerate().filter(|(_, k)| is_camera(k));
        found.extend(windows.map(|(first, k)| ((at, first + 9), k.to_vec())));
    }
    let first = found.first()?.clone();
    // With several different cameras it is not known which one is meant.
    found.iter().all(|(_, k)| *k == first.1).then_some(first)
}

/// The coefficients: those that are called so, or without any words the numbers behind the matrix.
fn distortion(runs: &[Run], (at, end): (usize, usize)) -> Option<Vec<f64>> {
    let behind = || runs[at].numbers[end..].to_vec();
    let called = runs.iter().enumerate().find(|(i, run)| *i != at && run.is_distortion());
    let numbers = called.map(|(_, run)| run.numbers.clone());
    let numbers = numbers.or_else(|| runs.iter().all(|run| run.words.is_empty()).then(behind))?;
    is_coefficients(numbers.len()).then_some(numbers)
}

/// The file next to it that is named after the distortion.
fn distortion_next_to(file: &Path, root: &Path) -> Option<std::path::PathBuf> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut names: Vec<_> =
        std::fs::read_dir(root.join(folder)).ok()?.flatten().map(|entry| entry.file_name()).collect();
    names.sort();
    let is_it = |name: &&std::ffi::OsString| {
        let lower = name.to_string_lossy().to_lowercase();
        let is_text = ["txt", "csv", "dat"].contains(&&*folder::ending(Path::new(name.as_os_str())));
        is_text && Some(name.as_os_str()) != file.file_name() && (lower.contains("dist") || lower.contains("coef"))
    };
    let mut those = names.iter().filter(is_it);
    let only = those.next()?;
    those.next().is_none().then(|| folder.join(only))
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_geometry::camera::{Distortion, Intrinsics};

    const K: &str = "912.4 0 640.7\n0 911.8 361.2\n0 0 1\n";

    fn camera(text: &str) -> Option<Intrinsics> {
        read(text, Path::new("camera.txt"), Path::new("/nowhere")).map(|found| found.intrinsics)
    }

    #[test]
    fn every_way_to_print_a_camera_gives_the_same_one() {
        let k = [0.082, -0.191, 0.0006, -0.0004, 0.01];
        let plain = format!("{K}0.082 -0.191 0.0006 -0.0004 0.01\n");
        let worded = format!("Camera matrix:\n{K}\nDistortion coefficients:\n0.082, -0.191, 0.0006, -0.0004, 0.01\n");
        let python = "mtx = array([[912.4, 0., 640.7], [0., 911.8, 361.2], [0., 0., 1.]])\n\
                      dist = array([[ 8.2e-02, -1.91e-01, 6e-04, -4e-04, 1e-02]])\n";
        let short = format!("RMS 0.23\nK\n{K}D\n0.082 -0.191 0.0006 -0.0004 0.01\n");
        let other_order = format!("dist: 0.082 -0.191 0.0006 -0.0004 0.01\nintrinsics {K}");
        for text in [plain.as_str(), &worded, python, &short, &other_order] {
            let found = camera(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!((found.fx, found.fy, found.cx, found.cy), (912.4, 911.8, 640.7, 361.2), "{text}");
            assert_eq!(found.distortion, Distortion::BrownConrady(k), "{text}");
        }
        let sized = camera(&format!("width: 1280 height: 720\nK: {K}")).expect("a camera");
        assert_eq!((sized.width, sized.height, sized.distortion), (1280, 720, Distortion::None));
    }

    #[test]
    fn the_distortion_may_lie_in_a_file_beside() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("distortion.txt"), "0.1\n-0.2\n0\n0\n0\n").expect("written");
        let found = read(K, Path::new("camera_matrix.txt"), folder.path()).expect("a camera");
        assert_eq!(found.intrinsics.distortion, Distortion::BrownConrady([0.1, -0.2, 0.0, 0.0, 0.0]));
    }

    #[test]
    fn poses_and_two_cameras_are_no_camera() {
        assert_eq!(camera("1 0 0\n0 1 0\n0 0 1\n"), None);
        assert_eq!(camera("0.5 0.2 0.1 1 2 3\n"), None);
        assert_eq!(camera(&format!("left {K}right 900 0 640.7 0 911.8 361.2 0 0 1")), None);
        assert_eq!(camera(&format!("{K}0.1 0.2 0.3")).map(|k| k.distortion), Some(Distortion::None));
    }
}
