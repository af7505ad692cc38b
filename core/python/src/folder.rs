//! Dataset folders as arrays.

use std::fs;
use std::path::PathBuf;

use handeye_dataset::{Dataset, Entry};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde_json::json;

use crate::error::Failure;
use crate::input::{Lens, Observations};
use crate::numbers::{bytes_of, of_pose};

/// Numbers (int64) and pixels of the corners of a view.
type CornerBytes<'py> = (Bound<'py, PyBytes>, Bound<'py, PyBytes>);

/// A dataset folder that was read.
pub struct Folder {
    dataset: Dataset,
    /// Output of `sha256sum` for its text files, which may change until there is a result.
    listing: String,
}

impl Folder {
    /// `handeye_dataset::Dataset::input_sha256`, by the SHA-256 of Python.
    pub fn input_sha256(&self, py: Python<'_>) -> Result<String, Failure> {
        let mut listing = self.listing.clone();
        for entry in &self.dataset.entries {
            if let Some(name) = self.dataset.image_name(entry) {
                listing += &sha256_line(py, &name, &self.dataset.image_bytes(entry).map_err(Failure::input)?)?;
            }
        }
        sha256(py, listing.as_bytes())
    }
}

fn sha256_line(py: Python<'_>, name: &str, bytes: &[u8]) -> Result<String, Failure> {
    Ok(format!("{}  {name}\n", sha256(py, bytes)?))
}

fn sha256(py: Python<'_>, bytes: &[u8]) -> Result<String, Failure> {
    let hash = py.import("hashlib")?.call_method1("sha256", (PyBytes::new(py, bytes),))?;
    Ok(hash.call_method0("hexdigest")?.extract()?)
}

/// A dataset folder: what a calibration is made from, what is small as JSON, and arrays by their names. An array that no
/// view has is left out; a pose that one view lacks is not finite.
#[pyfunction]
pub fn read_folder(py: Python<'_>, folder: PathBuf) -> Result<(Observations, String, Bound<'_, PyDict>), Failure> {
    let dataset = py.detach(|| Dataset::read(&folder)).map_err(Failure::input)?;
    let mut listing = String::new();
    for (name, path) in dataset.text_files() {
        let bytes = fs::read(&path).map_err(|error| Failure::Input(format!("{}: {error}", path.display())))?;
        listing += &sha256_line(py, name, &bytes)?;
    }
    let entries = &dataset.entries;
    let arrays = PyDict::new(py);
    if entries.iter().any(|entry| entry.base_from_tip.is_some()) {
        let numbers = entries.iter().flat_map(|entry| matrix(entry.base_from_tip.as_ref().map(of_pose)));
        arrays.set_item("base_from_tip", bytes_of(py, numbers))?;
    }
    if entries.iter().any(|entry| entry.camera_from_target.is_some()) {
        let numbers = entries.iter().flat_map(|entry| matrix(entry.camera_from_target.as_ref().map(of_pose)));
        arrays.set_item("camera_from_target", bytes_of(py, numbers))?;
    }
    if entries.iter().any(|entry| entry.corners.is_some()) {
        let corners: Vec<_> = entries.iter().map(|entry| corners(py, entry)).collect();
        arrays.set_item("corners", corners)?;
    }
    let lens = dataset.camera.as_ref().and_then(|camera| camera.intrinsics.as_ref()).map(Lens::from);
    let described = json!({
        "mode": dataset.mode,
        "target": dataset.target,
        "image_size": dataset.image_size,
        "intrinsics": lens,
        "intrinsics_accuracy_px": dataset.camera.and_then(|camera| camera.accuracy_px),
        "intrinsics_are_known": dataset.camera.is_some_and(|camera| camera.fixed),
        "lens_model": dataset.camera.map(|camera| camera.model.name()),
        "names": entries.iter().map(|entry| &entry.name).collect::<Vec<_>>(),
        "image_paths": entries.iter().map(|entry| &entry.image_path).collect::<Vec<_>>(),
        "joints_rad": entries.iter().map(|entry| &entry.joints_rad).collect::<Vec<_>>(),
        "robot_accuracy_mm": dataset.robot_accuracy_mm,
        "notes": dataset.outside,
    });
    let observed = dataset.observations(|_image| None);
    let (arm, robot_accuracy) = (dataset.arm_of_views(), dataset.robot_accuracy());
    let folder = Some(Folder { dataset, listing });
    Ok((Observations { observed, folder, target_is_known: true, arm, robot_accuracy }, described.to_string(), arrays))
}

fn matrix(pose: Option<Vec<f64>>) -> Vec<f64> {
    pose.unwrap_or_else(|| vec![f64::NAN; 16])
}

fn corners<'py>(py: Python<'py>, entry: &Entry) -> Option<CornerBytes<'py>> {
    let corners = entry.corners.as_ref().filter(|corners| !corners.is_empty())?;
    let numbers: Vec<u8> = corners.iter().flat_map(|corner| (corner.index as i64).to_ne_bytes()).collect();
    let pixels = corners.iter().flat_map(|corner| [corner.px.x, corner.px.y]);
    Some((PyBytes::new(py, &numbers), bytes_of(py, pixels)))
}
