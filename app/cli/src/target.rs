//! `handeye target`: a target on paper.

use clap::Args;
use handeye_dataset::write::target_table;
use handeye_print::{Page, PrintError, Sheet, pdf};

use super::output::Output;
use crate::{Failure, out};
use handeye_workbench::arguments::{DescribedTarget, heading};

pub const EXAMPLES: &str = "Examples:
  handeye target --kind charuco --columns 6 --rows 8 --square 22 \\
      --marker 16 --dictionary 5x5_100 --pdf charuco.pdf
  handeye target --kind aprilgrid --columns 4 --rows 6 --tag 30 \\
      --spacing 9 --family apriltag_36h11 --pdf grid.pdf
  handeye target --kind chessboard --columns 10 --rows 7 --square 40 \\
      --page fit --pdf board.pdf";

/// Options of `handeye target`.
#[derive(Debug, Args)]
pub struct TargetArgs {
    #[command(flatten)]
    target: DescribedTarget,
    /// File to write; `-` for standard output.
    #[arg(long, value_name = "FILE", help_heading = heading::OUTPUT)]
    pdf: Output,
    /// Page: a4, a3, letter, or fit for one as large as the target needs.
    #[arg(long, value_name = "PAGE", default_value = "a4", help_heading = heading::OUTPUT)]
    page: Page,
}

pub fn run(args: &TargetArgs) -> Result<(), Failure> {
    let target = args.target.spec().map_err(Failure::unusable)?;
    let sheet = Sheet::new(&target, args.page).map_err(|error| match error {
        PrintError::Markers { .. } => Failure::failed(error),
        _ => Failure::unusable(error),
    })?;
    args.pdf.write(&pdf(&sheet))?;
    let [width, height] = sheet.size_mm;
    out::note(format_args!("{target}, on a page of {width} × {height} mm"));
    out::note("print at 100 % (actual size); both rulers must then be 100 mm long");
    out::note(format_args!("wrote {}", args.pdf));
    // Its description for a data set, to be copied.
    let table = target_table(&target);
    if args.pdf.is_standard() {
        out::note(table.trim_end());
        return Ok(());
    }
    out::print(&table)
}
