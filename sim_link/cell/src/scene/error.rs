//! What can be wrong with a scene file.

use handeye_arm::urdf::UrdfError;

use super::{ShippedScene, locate};
use handeye_wording::Text;
use handeye_wording::text;

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read.
    #[error("the scene file {file} cannot be read{scenes}", scenes = or_a_name(file))]
    Read {
        /// Path as given.
        file: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown field, or a value of the wrong type.
    #[error("{message}{at}. {place}", at = in_field(field), place = place(file, *line))]
    Syntax {
        /// Path as given.
        file: String,
        /// Line, counted from 1, where known.
        line: Option<usize>,
        /// Dotted name of the field, empty where the error is outside of any.
        field: String,
        /// What is wrong.
        message: String,
    },
    /// The file of the arm is missing, is not a URDF, or has no such chain.
    #[error("robot.model: {why}. Name a built-in arm, or a URDF file with its base and tip links. {place}", place = place(file, *line))]
    Arm {
        /// Path of the scene as given.
        file: String,
        /// Line, counted from 1, where known.
        line: Option<usize>,
        /// What is wrong with the arm. It is part of the sentence, so it is not reported again as the source.
        why: Box<UrdfError>,
    },
    /// A number out of its range.
    #[error("{field} is {value}, it must be {need}. {place}", place = place(file, *line))]
    Field {
        /// Path as given.
        file: String,
        /// Line, counted from 1; absent where the value is a default.
        line: Option<usize>,
        /// Dotted name of the field.
        field: String,
        value: String,
        /// The valid range.
        need: String,
    },
}

/// Who names no folder and no ending may have meant a scene that comes with the program.
fn or_a_name(file: &str) -> Text {
    if file.contains(['/', '\\', '.']) {
        return Text::default();
    }
    let names: Vec<&str> = ShippedScene::ALL.into_iter().map(ShippedScene::name).collect();
    text!(" (scenes that come with the program: {scenes})", scenes = names.join(", "))
}

fn in_field(field: &str) -> Text {
    if field.is_empty() { Text::default() } else { text!(" in `{field}`", field = field) }
}

fn place(file: &str, line: Option<usize>) -> Text {
    match line {
        Some(line) => text!("File: {file}, line {line}", file = file, line = line),
        None => text!("File: {file}", file = file),
    }
}

impl SceneError {
    pub(super) fn arm(file: &str, line: Option<usize>, why: UrdfError) -> Self {
        Self::Arm { file: file.to_owned(), line, why: Box::new(why) }
    }

    pub(super) fn syntax(file: &str, text: &str, error: &toml::de::Error) -> Self {
        let start = error.span().map(|span| span.start);
        Self::Syntax {
            file: file.to_owned(),
            line: start.map(|start| locate::line_at(text, start)),
            field: start.map(|start| locate::field_at(text, start)).unwrap_or_default(),
            message: error.message().trim_end().to_owned(),
        }
    }
}

/// A range that is not kept, before file and line are known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Violation {
    pub field: String,
    pub value: String,
    pub need: String,
}

impl Violation {
    pub fn at(self, file: &str, line: Option<usize>) -> SceneError {
        let Self { field, value, need } = self;
        SceneError::Field { file: file.to_owned(), line, field, value, need }
    }
}
