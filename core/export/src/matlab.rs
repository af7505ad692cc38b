//! A MATLAB script that makes a `cameraParameters` and a `rigidtform3d` (R2022b or later).
//!
//! MATLAB counts pixels from 1: its principal point is one larger. Its lens has k1 k2 k3 and p1 p2; its fisheye model
//! is another one (Scaramuzza's), so a fisheye or rational lens is refused.

use super::input::NamedTransform;
use super::text::{Rotation, about_intrinsics, about_transform, compare_numbers, compare_text, numbers, parse_number};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_wording::Text;

pub(super) struct Matlab;

/// A variable with its rows of numbers.
type Variable = (&'static str, Vec<Vec<f64>>);

/// k1 k2 p1 p2 k3.
fn coefficients(k: &Intrinsics) -> Result<[f64; 5], ExportError> {
    match k.distortion {
        Distortion::None => Ok([0.0; 5]),
        Distortion::BrownConrady(coefficients) => Ok(coefficients),
        Distortion::Rational(_) | Distortion::Fisheye(_) => Err(ExportError::NeedsModel {
            format: Matlab.name(),
            model: k.distortion.name(),
            holds: "k1 k2 k3 and p1 p2, and a fisheye of another kind",
            instead: "model = \"brown_conrady\" or \"none\"",
        }),
    }
}

fn camera_variables(k: &Intrinsics) -> Result<Vec<Variable>, ExportError> {
    let [k1, k2, p1, p2, k3] = coefficients(k)?;
    let matrix = vec![vec![k.fx, 0.0, k.cx + 1.0], vec![0.0, k.fy, k.cy + 1.0], vec![0.0, 0.0, 1.0]];
    Ok(vec![
        ("K", matrix),
        ("imageSize", vec![vec![k.height.into(), k.width.into()]]),
        ("radialDistortion", vec![vec![k1, k2, k3]]),
        ("tangentialDistortion", vec![vec![p1, p2]]),
    ])
}

fn transform_variables(transform: &NamedTransform<'_>) -> Vec<Variable> {
    let rotation = transform.rows().iter().take(3).map(|row| row[..3].to_vec()).collect();
    vec![("R", rotation), ("t", vec![transform.translation().to_vec()])]
}

fn frames(transform: &NamedTransform<'_>) -> String {
    format!(
        "parentFrame = \"{}\";\nchildFrame = \"{}\";\nparentFromChild = rigidtform3d(R, t);\n",
        transform.parent, transform.child
    )
}

fn assignments(variables: &[Variable]) -> String {
    let line = |(name, rows): &Variable| {
        let rows: Vec<String> = rows.iter().map(|row| numbers(row)).collect();
        format!("{name} = [{}];\n", rows.join("; "))
    };
    variables.iter().map(line).collect()
}

/// The text between `name = ` and `;` in its line.
fn value<'a>(text: &'a str, name: &str) -> Result<&'a str, String> {
    let mut found = text.lines().filter_map(|line| line.strip_prefix(name)?.strip_prefix(" = ")?.strip_suffix(';'));
    let value = found.next().ok_or_else(|| format!("no {name}"))?;
    if found.next().is_some() { Err(format!("{name} is there twice")) } else { Ok(value) }
}

fn rows_of(text: &str, name: &str) -> Result<Vec<Vec<f64>>, String> {
    let list = value(text, name)?.strip_prefix('[').and_then(|t| t.strip_suffix(']'));
    let row = |row: &str| row.split(',').map(|v| parse_number(name, v)).collect();
    list.ok_or_else(|| format!("{name} is no matrix"))?.split(';').map(row).collect()
}

impl Format for Matlab {
    fn name(&self) -> &'static str {
        "matlab"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("script with cameraParameters and rigidtform3d (MATLAB R2022b or later)")
    }

    /// Writes what the result has, camera, hand-eye or both.
    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.optical(self.name());
        let camera = match input.intrinsics(self.name()) {
            Ok(k) => Some(camera_variables(&k)?),
            Err(error) if transform.is_err() => return Err(error),
            Err(_) => None,
        };
        let about = match &transform {
            Ok(transform) => about_transform(transform, "Metres", Rotation::Matrix, input.result),
            Err(_) => about_intrinsics(input.result),
        };
        let mut text = format!("% {about}\n");
        if let Some(variables) = camera {
            text.push_str("% In K pixel (1, 1) is the centre of the top-left pixel, as MATLAB counts.\n");
            text.push_str(&assignments(&variables));
            text.push_str(
                "cameraParams = cameraParameters(\"K\", K, \"ImageSize\", imageSize, ...\n    \
                 \"RadialDistortion\", radialDistortion, \"TangentialDistortion\", tangentialDistortion);\n",
            );
        }
        if let Ok(transform) = &transform {
            text.push_str(&assignments(&transform_variables(transform)));
            text.push_str(&frames(transform));
        }
        Ok(vec![ExportFile::new("handeye_calibration.m", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let mut expected = Vec::new();
        if let Ok(k) = input.intrinsics(self.name()) {
            expected.extend(camera_variables(&k).map_err(|e| e.to_string())?);
        }
        if let Ok(transform) = input.optical(self.name()) {
            expected.extend(transform_variables(&transform));
            let name = |variable| value(&file.text, variable).map(|v| v.trim_matches('"'));
            compare_text("parentFrame", name("parentFrame")?, transform.parent)?;
            compare_text("childFrame", name("childFrame")?, transform.child)?;
        }
        for (variable, rows) in &expected {
            let got = rows_of(&file.text, variable)?;
            let shape = |rows: &[Vec<f64>]| rows.iter().map(|row| row.len() as f64).collect::<Vec<_>>();
            compare_numbers(&format!("the shape of {variable}"), &shape(&got), &shape(rows))?;
            compare_numbers(variable, &got.concat(), &rows.concat())?;
        }
        if expected.is_empty() { Err("there is nothing to compare".into()) } else { Ok(()) }
    }
}
