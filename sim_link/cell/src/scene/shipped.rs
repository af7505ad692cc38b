//! Scenes that come with the program, and the choice between them and a file.

use std::convert::Infallible;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::{Scene, SceneError};

/// A scene that comes with the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShippedScene {
    /// The public UR5 hand-eye scene: exact, without noise or distortion.
    Reference,
    /// The same cell with the faults of a good real one: a lens, a little noise, a robot that repeats to 0.05 mm.
    Realistic,
    /// The realistic cell with a robot that repeats well and whose links differ from the nominal ones like those of a
    /// usual arm.
    Nominal,
    /// The realistic cell with a board that moves in a circle, and images that come as fast as a camera's.
    Tracking,
    /// The reference cell with images, depth, print and arm as CoppeliaSim's own are.
    Coppeliasim,
    /// A Franka Panda, seven joints, over a board that lies flat.
    Panda,
    /// A UFACTORY xArm 6 over a board that lies flat.
    Xarm6,
}

impl ShippedScene {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Reference, Self::Realistic, Self::Nominal, Self::Coppeliasim, Self::Tracking, Self::Panda, Self::Xarm6];

    /// The name for selecting it: that of its file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Realistic => "realistic",
            Self::Nominal => "nominal",
            Self::Coppeliasim => "coppeliasim",
            Self::Tracking => "tracking",
            Self::Panda => "panda",
            Self::Xarm6 => "xarm6",
        }
    }

    /// Text of the scene file, and of the URDF that it names.
    fn text(self) -> (&'static str, Option<&'static str>) {
        match self {
            Self::Reference => (include_str!("../../../../assets/scenes/reference.toml"), None),
            Self::Realistic => (include_str!("../../../../assets/scenes/realistic.toml"), None),
            Self::Nominal => (include_str!("../../../../assets/scenes/nominal.toml"), None),
            Self::Coppeliasim => (include_str!("../../../../assets/scenes/coppeliasim.toml"), None),
            Self::Tracking => (include_str!("../../../../assets/scenes/tracking.toml"), None),
            Self::Panda => (
                include_str!("../../../../assets/scenes/panda.toml"),
                Some(include_str!("../../../../assets/arms/panda.urdf")),
            ),
            Self::Xarm6 => (
                include_str!("../../../../assets/scenes/xarm6.toml"),
                Some(include_str!("../../../../assets/arms/xarm6.urdf")),
            ),
        }
    }

    /// The scene; no file is read.
    ///
    /// # Errors
    /// None as long as the file that is built in is valid, which a test asserts.
    pub fn scene(self) -> Result<Scene, SceneError> {
        let (text, urdf) = self.text();
        let file = format!("assets/scenes/{}.toml", self.name());
        Scene::parse(text, &file, |model| model.with_urdf(urdf))
    }
}

/// The scene of the built-in cell: one that comes with the program, by its name, or a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum SceneChoice {
    /// One that comes with the program.
    Shipped(ShippedScene),
    /// A scene file.
    File(PathBuf),
}

impl SceneChoice {
    /// Reads and checks the scene.
    ///
    /// # Errors
    /// [`SceneError`] names the file, the line and the field.
    pub fn load(&self) -> Result<Scene, SceneError> {
        match self {
            Self::Shipped(shipped) => shipped.scene(),
            Self::File(file) => Scene::load(file),
        }
    }
}

impl Default for SceneChoice {
    fn default() -> Self {
        Self::Shipped(ShippedScene::Reference)
    }
}

impl fmt::Display for SceneChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shipped(shipped) => f.write_str(shipped.name()),
            Self::File(file) => write!(f, "{}", file.display()),
        }
    }
}

impl From<String> for SceneChoice {
    fn from(words: String) -> Self {
        if words.is_empty() {
            return Self::default();
        }
        let named = ShippedScene::ALL.into_iter().find(|shipped| shipped.name() == words);
        named.map_or_else(|| Self::File(words.into()), Self::Shipped)
    }
}

impl From<SceneChoice> for String {
    fn from(choice: SceneChoice) -> Self {
        choice.to_string()
    }
}

impl FromStr for SceneChoice {
    type Err = Infallible;

    fn from_str(words: &str) -> Result<Self, Infallible> {
        Ok(words.to_owned().into())
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use std::path::Path;

    use super::*;

    /// What is built in is the text of the files, which people read and change.
    #[test]
    fn a_shipped_scene_stands_the_same_cell_as_its_file() {
        for shipped in ShippedScene::ALL {
            let file =
                Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../assets/scenes/{}.toml", shipped.name()));
            let [built_in, mut read] =
                [shipped.scene(), Scene::load(&file)].map(|scene| scene.unwrap().resolve(3).unwrap());
            // Where the URDF was read from.
            read.arm_model.clone_from(&built_in.arm_model);
            assert_eq!(built_in, read, "{}", shipped.name());
        }
    }

    #[test]
    fn a_scene_is_chosen_by_name_or_by_file() {
        for (words, choice) in [
            ("", SceneChoice::default()),
            ("panda", SceneChoice::Shipped(ShippedScene::Panda)),
            ("./panda", SceneChoice::File("./panda".into())),
            ("cells/panda.toml", SceneChoice::File("cells/panda.toml".into())),
        ] {
            assert_eq!(words.parse::<SceneChoice>().unwrap(), choice);
            assert_eq!(choice.to_string().parse::<SceneChoice>().unwrap(), choice);
        }
    }

    #[test]
    fn a_name_that_no_scene_has_is_answered_with_those_that_there_are() {
        let reported = |choice: &str| choice.parse::<SceneChoice>().unwrap().load().unwrap_err().to_string();
        assert!(
            reported("Panda").contains("reference, realistic, nominal, coppeliasim, tracking, panda, xarm6"),
            "{}",
            reported("Panda")
        );
        assert!(!reported("no/such.toml").contains("panda"), "{}", reported("no/such.toml"));
    }
}
