//! The result JSON itself: the only format with covariances and quality.

use super::{ExportError, ExportFile, ExportNames, Format};
use crate::result::CalibrationResult;

pub(super) struct Json;

impl Format for Json {
    fn name(&self) -> &'static str {
        "json"
    }

    fn description(&self) -> &'static str {
        "handeye's own result with covariances, quality and provenance"
    }

    fn render(&self, result: &CalibrationResult, _names: &ExportNames) -> Result<Vec<ExportFile>, ExportError> {
        let text = result.to_json().map_err(ExportError::BadResult)?;
        Ok(vec![ExportFile { name: "calibration.json".into(), text }])
    }

    fn compare(&self, text: &str, result: &CalibrationResult, _names: &ExportNames) -> Result<(), String> {
        let read = CalibrationResult::from_json(text).map_err(|e| e.to_string())?;
        if read == *result { Ok(()) } else { Err("not the same result".into()) }
    }
}
