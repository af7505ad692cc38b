//! The table `[target]`: the kinds of targets and the keys of each.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;

use super::error::DatasetProblem;
use handeye_geometry::targets::{AprilGrid, AprilTag, Charuco, Dictionary, Grid, IdOrder, Layout, TargetSpec};

/// An error, and where it is.
type Spanning = (Range<usize>, DatasetProblem);

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawKind {
    Chessboard,
    Charuco,
    #[serde(rename = "aprilgrid")]
    AprilGrid,
    #[serde(rename = "apriltag")]
    AprilTag,
    Circles,
    AsymmetricCircles,
}

impl RawKind {
    fn name(self) -> &'static str {
        match self {
            Self::Chessboard => "chessboard",
            Self::Charuco => "charuco",
            Self::AprilGrid => "aprilgrid",
            Self::AprilTag => "apriltag",
            Self::Circles => "circles",
            Self::AsymmetricCircles => "asymmetric_circles",
        }
    }

    /// Keys that it has, in addition to `kind`, `corners`, `poses` and `pose`.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Chessboard | Self::Circles | Self::AsymmetricCircles => &["columns", "rows", "square_m"],
            Self::Charuco => &["columns", "rows", "square_m", "marker_m", "dictionary", "layout"],
            Self::AprilGrid => {
                &["columns", "rows", "tag_m", "spacing_m", "spacing_ratio", "first_id", "family", "border_bits", "ids"]
            }
            Self::AprilTag => &["tag_m", "id", "family", "border_bits"],
        }
    }
}

/// The table as it is written. The kind determines which keys belong together.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTarget {
    kind: Spanned<RawKind>,
    columns: Option<Spanned<i64>>,
    rows: Option<Spanned<i64>>,
    square_m: Option<Spanned<f64>>,
    marker_m: Option<Spanned<f64>>,
    dictionary: Option<Spanned<Dictionary>>,
    layout: Option<Spanned<Layout>>,
    tag_m: Option<Spanned<f64>>,
    spacing_m: Option<Spanned<f64>>,
    spacing_ratio: Option<Spanned<f64>>,
    first_id: Option<Spanned<i64>>,
    id: Option<Spanned<i64>>,
    family: Option<Spanned<Dictionary>>,
    border_bits: Option<Spanned<i64>>,
    ids: Option<Spanned<IdOrder>>,
    pub corners: Option<String>,
    pub poses: Option<String>,
    /// Direction of the target's poses.
    pub pose: Option<TargetPoseDirection>,
}

/// Direction of a row of target poses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum TargetPoseDirection {
    #[default]
    CameraFromTarget,
    TargetFromCamera,
}

impl RawTarget {
    /// The target, checked.
    pub fn spec(&self) -> Result<TargetSpec, Spanning> {
        let kind = *self.kind.get_ref();
        let spans = self.spans();
        if let Some((key, Some(span))) = spans.iter().find(|(key, span)| span.is_some() && !kind.keys().contains(key)) {
            return Err((span.clone(), DatasetProblem::ForeignKey { key, kind: kind.name() }));
        }
        let target = match kind {
            RawKind::Chessboard => TargetSpec::Chessboard(self.grid()?),
            RawKind::Circles => TargetSpec::Circles(self.grid()?),
            RawKind::AsymmetricCircles => TargetSpec::AsymmetricCircles(self.grid()?),
            RawKind::Charuco => {
                let Grid { columns, rows, square_m } = self.grid()?;
                let marker_m =
                    self.length("marker_m", self.marker_m.as_ref(), "the side of a marker, border included")?;
                let why = "the family of the markers, such as \"5x5_100\" or \"apriltag_36h11\"";
                let dictionary = *self.need("dictionary", self.dictionary.as_ref(), why)?;
                let layout = self.layout.as_ref().map(|l| *l.get_ref());
                TargetSpec::Charuco(Charuco { columns, rows, square_m, marker_m, dictionary, layout })
            }
            RawKind::AprilGrid => TargetSpec::AprilGrid(self.april_grid()?),
            RawKind::AprilTag => TargetSpec::AprilTag(AprilTag {
                tag_m: self.length("tag_m", self.tag_m.as_ref(), "the side of the tag, border included")?,
                id: whole("id", self.need_raw("id", self.id.as_ref(), "the number of the tag in its family")?)?,
                family: self.family()?,
                border_bits: self.border_bits()?,
            }),
        };
        target.check().map_err(|bad| {
            let span = |key| spans.iter().find(|(name, _)| *name == key).and_then(|(_, span)| span.clone());
            let at = span(bad.key).or_else(|| span("spacing_ratio")).unwrap_or_else(|| self.kind.span());
            (at, DatasetProblem::BadValue { key: bad.key, value: bad.value, want: bad.want })
        })?;
        Ok(target)
    }

    fn spans(&self) -> [(&'static str, Option<Range<usize>>); 14] {
        fn of<T>(value: Option<&Spanned<T>>) -> Option<Range<usize>> {
            value.map(Spanned::span)
        }
        [
            ("columns", of(self.columns.as_ref())),
            ("rows", of(self.rows.as_ref())),
            ("square_m", of(self.square_m.as_ref())),
            ("marker_m", of(self.marker_m.as_ref())),
            ("dictionary", of(self.dictionary.as_ref())),
            ("layout", of(self.layout.as_ref())),
            ("tag_m", of(self.tag_m.as_ref())),
            ("spacing_m", of(self.spacing_m.as_ref())),
            ("spacing_ratio", of(self.spacing_ratio.as_ref())),
            ("first_id", of(self.first_id.as_ref())),
            ("id", of(self.id.as_ref())),
            ("family", of(self.family.as_ref())),
            ("border_bits", of(self.border_bits.as_ref())),
            ("ids", of(self.ids.as_ref())),
        ]
    }

    fn grid(&self) -> Result<Grid, Spanning> {
        let (columns, rows) = self.counts()?;
        let square_m = self.length("square_m", self.square_m.as_ref(), "the distance between neighbours")?;
        Ok(Grid { columns, rows, square_m })
    }

    fn counts(&self) -> Result<(usize, usize), Spanning> {
        let columns = self.need_raw("columns", self.columns.as_ref(), "how many there are along x")?;
        let rows = self.need_raw("rows", self.rows.as_ref(), "how many there are along y")?;
        Ok((whole("columns", columns)?, whole("rows", rows)?))
    }

    fn april_grid(&self) -> Result<AprilGrid, Spanning> {
        let (columns, rows) = self.counts()?;
        let tag_m = self.length("tag_m", self.tag_m.as_ref(), "the side of a tag, border included")?;
        let spacing_m = match (&self.spacing_m, &self.spacing_ratio) {
            (Some(metres), None) => *metres.get_ref(),
            (None, Some(ratio)) => *ratio.get_ref() * tag_m,
            (Some(_), Some(ratio)) => {
                let why = "[target] has both spacing_m and spacing_ratio: keep the one that was measured";
                return Err((ratio.span(), DatasetProblem::Conflict(why)));
            }
            (None, None) => {
                return Err(self.missing("spacing_m", "the gap between tags (or spacing_ratio, the gap over tag_m)"));
            }
        };
        Ok(AprilGrid {
            columns,
            rows,
            tag_m,
            spacing_m,
            first_id: self.first_id.as_ref().map_or(Ok(0), |id| whole("first_id", id))?,
            family: self.family()?,
            border_bits: self.border_bits()?,
            ids: self.ids.as_ref().map_or(IdOrder::default(), |ids| *ids.get_ref()),
        })
    }

    fn family(&self) -> Result<Dictionary, Spanning> {
        self.need("family", self.family.as_ref(), "the family of the tags, such as \"apriltag_36h11\"").copied()
    }

    fn border_bits(&self) -> Result<Option<usize>, Spanning> {
        self.border_bits.as_ref().map(|bits| whole("border_bits", bits)).transpose()
    }

    fn length(&self, key: &'static str, value: Option<&Spanned<f64>>, why: &'static str) -> Result<f64, Spanning> {
        self.need(key, value, why).copied()
    }

    fn need<'a, T>(
        &self,
        key: &'static str,
        value: Option<&'a Spanned<T>>,
        why: &'static str,
    ) -> Result<&'a T, Spanning> {
        self.need_raw(key, value, why).map(Spanned::get_ref)
    }

    fn need_raw<'a, T>(
        &self,
        key: &'static str,
        value: Option<&'a Spanned<T>>,
        why: &'static str,
    ) -> Result<&'a Spanned<T>, Spanning> {
        value.ok_or_else(|| self.missing(key, why))
    }

    fn missing(&self, key: &'static str, why: &'static str) -> Spanning {
        (self.kind.span(), DatasetProblem::MissingKey { table: "target", key, why })
    }
}

fn whole(key: &'static str, value: &Spanned<i64>) -> Result<usize, Spanning> {
    let n = *value.get_ref();
    usize::try_from(n).map_err(|_negative| {
        let want = "a whole number that is not negative";
        (value.span(), DatasetProblem::BadValue { key, value: n.to_string(), want })
    })
}
