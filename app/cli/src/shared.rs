//! Several sessions of one camera: read, calibrated together with one lens, and written.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use handeye_estimate::shared_lens::{NamedSession, SharedLensError, calibrate_sharing_lens};
use handeye_estimate::{Method, Options};
use handeye_geometry::progress::CancelToken;
use handeye_result::CalibrationResult;

use super::output::Output;
use super::solve::{self, Input, Solution};
use super::{Failure, out};
use handeye_workbench::{report, worker};

/// The key under which a result lists with which other sessions its lens was estimated: the digests of their input.
const OPTION: &str = "share_intrinsics";

/// Reads folders and calibrates them together; one answer for each, in their order.
pub fn folders(paths: &[PathBuf], options: Options, cancel: &CancelToken) -> Result<Vec<Solution>, Failure> {
    let inputs: Vec<Input> = paths.iter().map(|path| solve::read(path, cancel)).collect::<Result<_, _>>()?;
    check_different(paths, &inputs)?;
    let names: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
    let sessions: Vec<NamedSession<'_>> = names
        .iter()
        .zip(&inputs)
        .map(|(name, input)| NamedSession { name, observations: &input.seen.observations })
        .collect();
    let fits = calibrate_sharing_lens(&sessions, options, cancel).map_err(refused)?;
    let digests: Vec<String> = inputs.iter().map(|input| input.sha256.clone()).collect();
    let mut solutions = Vec::with_capacity(paths.len());
    for (((i, path), input), fit) in paths.iter().enumerate().zip(inputs).zip(fits) {
        let job = solve::job(&input, Method::Joint, options);
        let examined = worker::examined(&job, fit, cancel.into());
        let mut solved = examined.map_err(|error| solve::unsolved(error, path, &input.seen.observations, cancel))?;
        let others = digests.iter().enumerate().filter(|(j, _)| *j != i);
        let others: Vec<&str> = others.map(|(_, digest)| digest.as_str()).collect();
        solved.result.provenance.options.insert(OPTION.to_owned(), others.into());
        solutions.push(Solution::new(path, input, solved));
    }
    Ok(solutions)
}

/// Captures that are given twice would count twice.
fn check_different(paths: &[PathBuf], inputs: &[Input]) -> Result<(), Failure> {
    for (i, input) in inputs.iter().enumerate() {
        if let Some(first) = inputs[..i].iter().position(|other| other.sha256 == input.sha256) {
            return Err(Failure::unusable(anyhow!(
                "{} and {} hold the same captures, which count once: leave one of them out",
                paths[first].display(),
                paths[i].display()
            )));
        }
    }
    Ok(())
}

fn refused(error: SharedLensError) -> Failure {
    if error.is_usage() {
        return Failure::unusable(error);
    }
    match &error {
        SharedLensError::Session { session, .. } if !error.is_cancelled() => {
            Failure::failed(anyhow!("{error}; `handeye doctor {session}` examines the data"))
        }
        _ => Failure::failed(error),
    }
}

/// Writes every result with its exports into a folder of its own.
pub fn write_exports(folder: &Path, solutions: &[Solution]) -> Result<(), Failure> {
    let paths: Vec<&Path> = solutions.iter().map(Solution::folder).collect();
    for (solution, name) in solutions.iter().zip(folder_names(&paths)) {
        solve::write_exports(&folder.join(name), solution.result())?;
    }
    Ok(())
}

/// The last part of each path, with a number where another has the same.
fn folder_names(paths: &[&Path]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let mut names = Vec::with_capacity(paths.len());
    for path in paths {
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let last = whole.file_name().map_or_else(|| "session".to_owned(), |name| name.to_string_lossy().into_owned());
        let numbered = std::iter::once(last.clone()).chain((2..).map(|n| format!("{last}-{n}")));
        let name = numbered.into_iter().find(|name| taken.insert(name.clone())).unwrap_or(last);
        names.push(name);
    }
    names
}

/// Writes the array of all results where requested and prints a report, unless the array is printed instead.
pub fn publish(solutions: &[Solution], json: Option<&Output>) -> Result<(), Failure> {
    if let Some(output) = json {
        let results: Vec<&CalibrationResult> = solutions.iter().map(Solution::result).collect();
        let texts: Vec<String> =
            results.iter().map(|result| result.to_json()).collect::<Result<_, _>>().map_err(Failure::failed)?;
        output.write(array(&texts).as_bytes())?;
    }
    if json.is_some_and(Output::is_standard) { Ok(()) } else { out::print(&text(solutions)) }
}

/// Documents as one array. It ends with a newline.
fn array(documents: &[String]) -> String {
    let documents: Vec<&str> = documents.iter().map(|document| document.trim_end()).collect();
    format!("[\n{}\n]\n", documents.join(",\n"))
}

fn text(solutions: &[Solution]) -> String {
    let mut text = String::new();
    for solution in solutions {
        text += &report::of_session(&solution.folder().display().to_string(), solution.result());
    }
    if let Some(first) = solutions.first() {
        text += &report::shared_camera(solutions.len(), solutions.iter().map(Solution::views).sum(), first.result());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sessions_of_the_same_name_get_folders_of_their_own() {
        let paths = ["/a/x", "/b/x", "/c/y", "/d/x-2", "/e/x"].map(Path::new);
        assert_eq!(folder_names(&paths), ["x", "x-2", "y", "x-2-2", "x-3"]);
    }

    #[test]
    fn results_are_written_as_one_array() {
        let texts = ["{\n  \"a\": 1\n}\n".to_owned(), "{}".to_owned()];
        let read: serde_json::Value = serde_json::from_str(&array(&texts)).expect("JSON");
        assert_eq!(read, serde_json::json!([{"a": 1}, {}]));
    }
}
