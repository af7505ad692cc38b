//! The result JSON itself: the only format with covariances and quality.

use super::{ExportError, ExportFile, ExportInput, Format};
use handeye_result::CalibrationResult;
use handeye_wording::Text;

pub(super) struct Json;

impl Format for Json {
    fn name(&self) -> &'static str {
        "json"
    }

    fn description(&self) -> Text {
        handeye_wording::text!("handeye's own result with covariances, quality and provenance")
    }

    fn render(&self, input: &ExportInput<'_>) -> Result<Vec<ExportFile>, ExportError> {
        let text = input.result.to_json().map_err(ExportError::BadResult)?;
        Ok(vec![ExportFile::new("calibration.json", text)])
    }

    fn compare(&self, file: &ExportFile, input: &ExportInput<'_>) -> Result<(), String> {
        let read = CalibrationResult::from_json(&file.text).map_err(|e| e.to_string())?;
        if read == *input.result { Ok(()) } else { Err("not the same result".into()) }
    }
}
