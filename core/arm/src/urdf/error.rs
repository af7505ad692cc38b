//! What can be wrong with a URDF file.

use crate::{ArmError, MAX_JOINTS};
use handeye_wording::Text;
use handeye_wording::text;

/// What is wrong, in which file, and where in it: `FILE, line N: what, and what to do`.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[error("{place}: {problem}", place = place(file, *line))]
#[non_exhaustive]
pub struct UrdfError {
    /// The name of the file as given.
    pub file: String,
    /// Line of the element, counted from 1; `None` for the file as a whole.
    pub line: Option<u32>,
    /// What is wrong there.
    pub problem: Box<UrdfProblem>,
}

/// The place of an error on one line, for any name of the file.
fn place(file: &str, line: Option<u32>) -> Text {
    let file = if file.contains(char::is_control) { format!("{file:?}") } else { file.to_owned() };
    match line {
        Some(line) => text!("{file}, line {line}", file = file, line = line),
        None => text!("{file}", file = file),
    }
}

/// A defect of a URDF file, or of a request to it.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum UrdfProblem {
    /// The file system cannot read it, or it is not text.
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// Not well-formed.
    #[error("is not XML: {0}")]
    NotXml(String),
    /// A xacro file, the source of a URDF.
    #[error("is xacro source, from which a URDF is made first: run `xacro FILE > robot.urdf` and name robot.urdf")]
    Xacro,
    /// XML of another format.
    #[error("is not a URDF: its root element is <{root}> instead of <robot>")]
    NotUrdf {
        /// The element.
        root: String,
    },
    /// A missing attribute or child that every element of this kind has.
    #[error("{element} has no {what}")]
    Missing {
        /// The element, with its name where it has one.
        element: String,
        /// What it lacks.
        what: &'static str,
    },
    /// Two elements with the same name.
    #[error("{element} is there twice: names of links and of joints are unique")]
    Twice {
        /// The element with its name.
        element: String,
    },
    /// A joint at a link that does not exist.
    #[error(
        "the {end} of joint \"{joint}\" is link \"{link}\", which the file does not have: add the link or correct the name"
    )]
    UnknownLink {
        /// Name of the joint in the file.
        joint: String,
        /// `parent` or `child`.
        end: &'static str,
        /// The link that it names.
        link: String,
    },
    /// A link behind two joints.
    #[error(
        "link \"{link}\" is the child of two joints, \"{first}\" and \"{second}\": a URDF is a tree, and a loop of links \
         cannot be computed with; leave one of the joints out"
    )]
    TwoParents {
        /// Name of the link in the file.
        link: String,
        /// One joint.
        first: String,
        /// The other.
        second: String,
    },
    /// Links in a loop.
    #[error("joints lead in a loop through link \"{link}\" and back to it: leave out the joint that closes it")]
    Loop {
        /// A link of the loop.
        link: String,
    },
    /// More than one link that could be the base.
    #[error("has {count} links without a parent, {links}: name the one that the arm stands on as the base link", count = links.len(), links = quoted(links))]
    SeveralRoots {
        /// All of them.
        links: Vec<String>,
    },
    /// More than one link that could carry the tool.
    #[error("has {count} links at an end, {links}: name the one that is the tip", count = links.len(), links = quoted(links))]
    SeveralLeaves {
        /// All of them.
        links: Vec<String>,
    },
    /// A name that is not that of a link.
    #[error("has no link \"{name}\"; it has {links}", links = quoted(links))]
    NoSuchLink {
        /// The requested name.
        name: String,
        /// The links of the file.
        links: Vec<String>,
    },
    /// The tip is not carried by the base.
    #[error("link \"{tip}\" does not hang on link \"{base}\": name a base link that the joints lead from to the tip")]
    NotBelow {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// A joint that is neither revolute nor prismatic.
    #[error(
        "joint \"{joint}\" between base and tip is {kind}: a chain has revolute, continuous, prismatic and fixed joints; \
         name a base link behind it"
    )]
    Unsupported {
        /// Name of the joint in the file.
        joint: String,
        /// Its type in the file.
        kind: String,
    },
    /// A joint that follows another.
    #[error(
        "joint \"{joint}\" between base and tip follows joint \"{of}\" (mimic), which a chain of independent joints cannot: \
         name a tip link in front of it, or make it fixed"
    )]
    Mimic {
        /// Name of the joint in the file.
        joint: String,
        /// The one it follows.
        of: String,
    },
    /// Text where numbers are expected, too many of them, or one that is not finite.
    #[error("{attribute} of joint \"{joint}\" is \"{text}\": it takes {needs}")]
    BadNumber {
        /// Name of the joint in the file.
        joint: String,
        /// Element and attribute.
        attribute: &'static str,
        /// Its text.
        text: String,
        /// The expected content.
        needs: &'static str,
    },
    /// An axis without a direction.
    #[error("the axis of joint \"{joint}\" is 0 0 0: give its direction, for example 0 0 1")]
    ZeroAxis {
        /// Name of the joint in the file.
        joint: String,
    },
    /// A revolute or prismatic joint without an end.
    #[error(
        "{kind} joint \"{joint}\" has no <limit> with lower and upper: add them; a joint that turns without end is continuous"
    )]
    NoLimit {
        /// Name of the joint in the file.
        joint: String,
        /// Its type.
        kind: String,
    },
    /// Limits without room between them.
    #[error("joint \"{joint}\" goes from {lower} to {upper}: lower has to be below upper")]
    InvertedLimit {
        /// Name of the joint in the file.
        joint: String,
        /// Lower limit, radians or metres.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// A speed with which the joint can never move.
    #[error("the velocity of joint \"{joint}\" is {speed}: it has to be above zero, or left out when it is not known")]
    BadSpeed {
        /// Name of the joint in the file.
        joint: String,
        /// The stated speed.
        speed: f64,
    },
    /// A length beyond that of any arm.
    #[error(
        "{what} of joint \"{joint}\" is {length_m} m, longer than any arm: lengths of a URDF are in metres, are these millimetres?"
    )]
    TooLong {
        /// Name of the joint in the file.
        joint: String,
        /// What has this length.
        what: &'static str,
        /// Its length.
        length_m: f64,
    },
    /// No arm at all, or more joints than one has.
    #[error(
        "has {got} joints that move between \"{base}\" and \"{tip}\": a chain has 1 to {MAX_JOINTS}; name other links"
    )]
    JointCount {
        /// Number of joints.
        got: usize,
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
    },
    /// An error of the chain itself.
    #[error("between \"{base}\" and \"{tip}\": {error}")]
    Arm {
        /// The base link.
        base: String,
        /// The tip link.
        tip: String,
        /// The error.
        error: ArmError,
    },
}

/// Names in quotes, with commas between; only the first if there are very many.
fn quoted(names: &[String]) -> Text {
    const SHOWN: usize = 12;
    let shown: Vec<String> = names.iter().take(SHOWN).map(|name| format!("\"{name}\"")).collect();
    let more = names.len().saturating_sub(SHOWN);
    let shown = shown.join(", ");
    if more > 0 { text!("{names} and {more} more", names = shown, more = more) } else { Text::verbatim(shown) }
}
