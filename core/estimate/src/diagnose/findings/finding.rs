//! A finding: a code, values and a sentence.

use std::fmt;

use serde::Serialize;

use crate::diagnose::record::{EvidenceRecord, FindingRecord};
use handeye_wording::text;
use handeye_wording::{English, Text};

/// One number that supports a finding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Evidence {
    /// Name of the number, as in the JSON.
    pub name: &'static str,
    /// The number, in its unit.
    pub value: f64,
    /// Its unit; empty for a count or a ratio.
    pub unit: &'static str,
}

/// What was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FindingCode {
    /// Fewer views than a calibration takes, or than a good one does.
    TooFewViews,
    /// A pose or a corner is not a number.
    NotFinite,
    /// The target was not found in some views.
    TargetNotFound,
    /// The robot hardly turned between the views.
    ViewsAlike,
    /// All turns are about one axis.
    OneRotationAxis,
    /// Turns about the other axes are small.
    WeakRotation,
    /// The board is hardly tilted, which leaves the focal length weak.
    LittleTilt,
    /// Part of the image was never covered.
    PoorCoverage,
    /// The robot poses are inverted: tip from base where base from tip was stated, or the other way round.
    InvertedPoses,
    /// The camera is on the other side: eye-in-hand where eye-to-hand was stated, or the other way round.
    WrongMode,
    /// The target's poses are inverted: target from camera where camera from target was stated, or the other way round.
    InvertedTargetPoses,
    /// Numbers of quaternions are in another order than stated.
    WrongQuaternionOrder,
    /// Robot poses are in millimetres where metres were stated, or the other way round.
    WrongLengthUnit,
    /// Angles of the robot poses are in radians where degrees were stated.
    WrongAngleUnit,
    /// Images and robot poses are out of step by one row.
    ShiftedPoses,
    /// The target is not of the stated size.
    WrongScale,
    /// The intrinsics given do not fit the images.
    WrongIntrinsics,
    /// fx and fy differ by more than those of a lens and a sensor do.
    PixelAspect,
    /// Sessions that are calibrated with one lens differ in it.
    LensesDiffer,
    /// The target moved during the session.
    BoardMoved,
    /// The camera moved on its mount during the session.
    CameraMoved,
    /// The zero of a joint is off.
    JointOffset,
    /// The target is bent.
    BoardBent,
    /// Views that contradict the others.
    OutlierView,
    /// Corners that are not where the rest of their view puts them.
    OutlierCorners,
    /// The target looks the same from both ends and was counted from the other one in some views.
    Renumbered,
    /// The data scatter more than independent noise explains, and the stated uncertainty was widened.
    UncertaintyWidened,
    /// Robot and corner noise cannot be told apart.
    NoiseUnclear,
    /// The robot poses contradict the images by more than the errors of any arm.
    InconsistentPoses,
    /// One direction of the answer is known much worse than the others.
    WeakDirection,
    /// One view moves the answer a lot.
    InfluentialView,
    /// One view fits much worse than the others.
    LargeResidual,
    /// The robot pose of one view was corrected much more than those of the others.
    LargeCorrection,
    /// Views outside the fit are predicted worse than the noise levels explain.
    PoorPrediction,
    /// The robot's noise, not the corners', limits the answer.
    RobotNoise,
    /// The lens model folds back within the image, beyond where the target was seen.
    LensFolds,
    /// The lens was given and taken as exact, and the answer depends on it.
    LensTakenAsExact,
    /// The robot's errors depend on its pose.
    RobotField,
    /// The points of the target are displaced from its drawing.
    PrintErrors,
    /// The lens has a distortion beyond its model.
    ResidualDistortion,
    /// Depths of the target do not agree with its pose.
    DepthError,
    /// The closed forms do not agree.
    ClosedFormsDisagree,
    /// The error that the goal refers to is below it.
    GoalReached,
    /// The error that the goal refers to is above it.
    GoalNotReached,
}

/// How much it matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Info,
    /// Following it makes the answer better.
    Advice,
    /// The answer may be much worse than it could be.
    Warning,
    /// There is no answer, or it is not to be used.
    Problem,
}

/// What was found, by which evidence. As text it is a sentence or two with what to do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The kind of finding; part of the contract.
    pub code: FindingCode,
    /// How much it matters.
    pub severity: Severity,
    /// The numbers behind it.
    pub evidence: Vec<Evidence>,
    /// The views concerned, by name; empty when it concerns the whole set.
    pub views: Vec<String>,
    /// The finding in words; in documents in English.
    #[serde(serialize_with = "Text::serialize_english")]
    pub text: Text,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text.in_language(English))
    }
}

impl Finding {
    pub(crate) fn new(code: FindingCode, severity: Severity, text: Text) -> Self {
        Self { code, severity, evidence: Vec::new(), views: Vec::new(), text }
    }

    pub(crate) fn with(mut self, name: &'static str, value: f64, unit: &'static str) -> Self {
        self.evidence.push(Evidence { name, value, unit });
        self
    }

    pub(crate) fn of_view(mut self, name: &str) -> Self {
        self.views.push(name.to_owned());
        self
    }

    /// The finding as written in a document.
    pub fn to_record(&self) -> FindingRecord {
        // Both are plain names in snake case.
        let name =
            |value: Option<serde_json::Value>| value.and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default();
        let evidence = |e: &Evidence| EvidenceRecord {
            name: e.name.to_owned(),
            value: Some(e.value).filter(|v| v.is_finite()),
            unit: e.unit.to_owned(),
        };
        FindingRecord {
            code: name(serde_json::to_value(self.code).ok()),
            severity: name(serde_json::to_value(self.severity).ok()),
            text: self.to_string(),
            views: self.views.clone(),
            evidence: self.evidence.iter().map(evidence).collect(),
        }
    }

    /// The value of the evidence of that name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.evidence.iter().find(|e| e.name == name).map(|e| e.value)
    }
}

/// The names of views for a sentence: all of them if few, else the first and how many more.
pub(crate) fn listed(names: &[String]) -> Text {
    const SHOWN: usize = 4;
    let shown = Text::list(names.iter().take(SHOWN).map(Text::verbatim));
    if names.len() <= SHOWN {
        return shown;
    }
    text!("{names} and {more} more", names = shown, more = names.len() - SHOWN)
}
