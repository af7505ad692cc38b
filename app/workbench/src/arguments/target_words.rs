//! Targets in words, as options of a command line or as a text.

use anyhow::anyhow;
use clap::{Args, Parser, ValueEnum};
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, Layout, TargetSpec};

use super::heading;

#[derive(Debug, Args)]
pub struct DescribedTarget {
    #[arg(long, value_enum, help_heading = heading::TARGET)]
    kind: Kind,
    /// Inner corners, dots or tags along x.
    #[arg(long, value_name = "N", help_heading = heading::TARGET)]
    columns: Option<usize>,
    /// Inner corners, dots or tags along y.
    #[arg(long, value_name = "N", help_heading = heading::TARGET)]
    rows: Option<usize>,
    /// Side of a square, distance of dots, or distance of the rows of asymmetric dots.
    #[arg(long, value_name = "MM", help_heading = heading::TARGET)]
    square: Option<f64>,
    /// Side of a marker of a ChArUco board, with its black border.
    #[arg(long, value_name = "MM", help_heading = heading::TARGET)]
    marker: Option<f64>,
    /// Family of the markers of a ChArUco board, such as 5x5_100.
    #[arg(long, value_name = "NAME", help_heading = heading::TARGET)]
    dictionary: Option<Dictionary>,
    /// Which squares of a ChArUco board have markers: those of OpenCV from 4.6 on (new), or of OpenCV before (legacy).
    #[arg(long, value_enum, help_heading = heading::TARGET)]
    layout: Option<LayoutName>,
    /// Side of a tag, with its black border.
    #[arg(long, value_name = "MM", help_heading = heading::TAGS)]
    tag: Option<f64>,
    /// Gap between tags.
    #[arg(long, value_name = "MM", help_heading = heading::TAGS)]
    spacing: Option<f64>,
    /// Number of the first tag of a board of tags [default: 0].
    #[arg(long, value_name = "N", help_heading = heading::TAGS)]
    first_id: Option<usize>,
    /// Number of a single tag [default: 0].
    #[arg(long, value_name = "N", help_heading = heading::TAGS)]
    id: Option<usize>,
    /// Family of tags [default: apriltag_36h11].
    #[arg(long, value_name = "NAME", help_heading = heading::TAGS)]
    family: Option<Dictionary>,
    /// Width of the black border of tags in bits [default: 2 on boards, as Kalibr has it, 1 for a single tag].
    #[arg(long, value_name = "N", help_heading = heading::TAGS)]
    border_bits: Option<usize>,
}

/// Kinds of targets, as named in data sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
enum Kind {
    Chessboard,
    Charuco,
    #[value(name = "aprilgrid")]
    AprilGrid,
    #[value(name = "apriltag")]
    AprilTag,
    Circles,
    AsymmetricCircles,
}

/// Layouts of ChArUco boards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LayoutName {
    New,
    Legacy,
}

/// The target of a text: `10x7x15`, inner corners and square in mm of a chessboard, or `kind=charuco,columns=4,…` with the
/// options of `handeye target`.
///
/// # Errors
/// A sentence that says what is wrong with it.
pub fn of_text(text: &str) -> anyhow::Result<TargetSpec> {
    let sides: Vec<&str> = text.split(['x', 'X', '×']).collect();
    if let [columns, rows, square_mm] = sides.as_slice()
        && let (Ok(columns), Ok(rows), Ok(square_mm)) = (columns.parse(), rows.parse(), square_mm.parse::<f64>())
    {
        let target = TargetSpec::Chessboard(Grid { columns, rows, square_m: metres("the square", Some(square_mm))? });
        target.check()?;
        return Ok(target);
    }
    let mut words = vec!["--target".to_owned()];
    for pair in text.split(',') {
        let (key, value) = pair.split_once('=').ok_or_else(|| {
            anyhow!("--target {text}: 10x7x15 is inner corners and square in mm; others begin with kind=charuco,…")
        })?;
        words.push(format!("--{}", key.trim()));
        words.push(value.trim().to_owned());
    }
    let parsed = TextTarget::try_parse_from(words)
        .map_err(|e| anyhow!("--target {text}: {}", e.to_string().lines().next().unwrap_or_default()))?;
    let is_open = parsed.target.layout.is_none();
    Ok(match parsed.target.spec()? {
        // A board that is printed has today's layout unless another is given; for one in images, the images decide.
        TargetSpec::Charuco(board) if is_open => TargetSpec::Charuco(Charuco { layout: None, ..board }),
        target => target,
    })
}

/// Parses a described target on its own.
#[derive(Debug, Parser)]
struct TextTarget {
    #[command(flatten)]
    target: DescribedTarget,
}

impl DescribedTarget {
    /// The target.
    ///
    /// # Errors
    /// A sentence that names the option that is missing, does not belong, or is out of range.
    pub fn spec(&self) -> anyhow::Result<TargetSpec> {
        spec(self)
    }
}

fn spec(args: &DescribedTarget) -> anyhow::Result<TargetSpec> {
    use Kind as K;
    let of = |kinds: &[Kind]| kinds.contains(&args.kind);
    let tags = [K::AprilGrid, K::AprilTag];
    let lattices = [K::Chessboard, K::Charuco, K::Circles, K::AsymmetricCircles];
    let grids = [K::Chessboard, K::Charuco, K::Circles, K::AsymmetricCircles, K::AprilGrid];
    for (name, given, belongs) in [
        ("--columns", args.columns.is_some(), of(&grids)),
        ("--rows", args.rows.is_some(), of(&grids)),
        ("--square", args.square.is_some(), of(&lattices)),
        ("--marker", args.marker.is_some(), of(&[K::Charuco])),
        ("--dictionary", args.dictionary.is_some(), of(&[K::Charuco])),
        ("--layout", args.layout.is_some(), of(&[K::Charuco])),
        ("--tag", args.tag.is_some(), of(&tags)),
        ("--spacing", args.spacing.is_some(), of(&[K::AprilGrid])),
        ("--first-id", args.first_id.is_some(), of(&[K::AprilGrid])),
        ("--id", args.id.is_some(), of(&[K::AprilTag])),
        ("--family", args.family.is_some(), of(&tags)),
        ("--border-bits", args.border_bits.is_some(), of(&tags)),
    ] {
        if given && !belongs {
            return Err(anyhow!("{name} does not belong to a target of that kind: leave it out"));
        }
    }
    let columns = || needed("--columns", args.columns);
    let rows = || needed("--rows", args.rows);
    let grid = || anyhow::Ok(Grid { columns: columns()?, rows: rows()?, square_m: metres("--square", args.square)? });
    let family = args.family.unwrap_or(Dictionary::APRILTAG_36H11);
    let target = match args.kind {
        K::Chessboard => TargetSpec::Chessboard(grid()?),
        K::Circles => TargetSpec::Circles(grid()?),
        K::AsymmetricCircles => TargetSpec::AsymmetricCircles(grid()?),
        K::Charuco => {
            let Grid { columns, rows, square_m } = grid()?;
            TargetSpec::Charuco(Charuco {
                columns,
                rows,
                square_m,
                marker_m: metres("--marker", args.marker)?,
                dictionary: needed("--dictionary", args.dictionary)?,
                layout: Some(match args.layout.unwrap_or(LayoutName::New) {
                    LayoutName::New => Layout::New,
                    LayoutName::Legacy => Layout::Legacy,
                }),
            })
        }
        K::AprilGrid => TargetSpec::AprilGrid(AprilGrid {
            columns: columns()?,
            rows: rows()?,
            tag_m: metres("--tag", args.tag)?,
            spacing_m: metres("--spacing", args.spacing)?,
            first_id: args.first_id.unwrap_or(0),
            family,
            border_bits: Some(args.border_bits.unwrap_or(2)),
            ids: IdOrder::BottomUp,
        }),
        K::AprilTag => TargetSpec::AprilTag(AprilTag {
            tag_m: metres("--tag", args.tag)?,
            id: args.id.unwrap_or(0),
            family,
            border_bits: Some(args.border_bits.unwrap_or(1)),
        }),
    };
    target.check()?;
    Ok(target)
}

fn needed<T>(option: &str, value: Option<T>) -> anyhow::Result<T> {
    value.ok_or_else(|| anyhow!("{option} is needed for a target of that kind"))
}

fn metres(option: &str, value: Option<f64>) -> anyhow::Result<f64> {
    let mm = needed(option, value)?;
    if mm.is_finite() && mm > 0.0 {
        Ok(mm * 1e-3)
    } else {
        Err(anyhow!("{option} {mm} is not usable: it must be a length in mm"))
    }
}
