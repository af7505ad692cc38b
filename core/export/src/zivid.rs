//! Zivid's `Matrix4x4` YAML, in **millimetres**: `zivid.Matrix4x4.save`, `save_load_matrix.py` of its samples.

use super::input::NamedTransform;
use super::text::{Rotation, about_transform, numbers};
use super::yaml::{Leaf, Yaml};
use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_wording::Text;

pub(super) struct Zivid;

fn rows_mm(transform: &NamedTransform<'_>) -> [[f64; 4]; 4] {
    let mut rows = transform.rows();
    for row in rows.iter_mut().take(3) {
        row[3] *= 1e3;
    }
    rows
}

impl Format for Zivid {
    fn name(&self) -> &'static str {
        "zivid"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("4x4 matrix in millimetres for the Zivid SDK and its hand-eye samples")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let transform = input.optical(self.name())?;
        let rows: Vec<String> = rows_mm(&transform).iter().map(|row| format!("      [{}],\n", numbers(row))).collect();
        let text = format!(
            "# {}\n__version__:\n  serializer: 1\n  data: 1\nFloatMatrix:\n  Data:\n    [\n{}    ]\n",
            about_transform(&transform, "Millimetres", Rotation::Matrix, input.result),
            rows.concat(),
        );
        Ok(vec![ExportFile::new("hand_eye_transform.yaml", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let transform = input.optical(self.name()).map_err(|e| e.to_string())?;
        Yaml::parse(&file.text)?.compare(&[
            ("__version__.serializer", Leaf::Number(1.0)),
            ("__version__.data", Leaf::Number(1.0)),
            ("FloatMatrix.Data", Leaf::Numbers(rows_mm(&transform).as_flattened().to_vec())),
        ])
    }
}
