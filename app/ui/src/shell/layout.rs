//! Where the panes are: a tree of tiles that the user can rearrange, and that is remembered.

use egui_tiles::{Container, Linear, LinearDir, Tile, TileId, Tiles, Tree};
use serde::{Deserialize, Serialize};

use handeye_workbench::model::{Model, Moves, Pane, Step};

/// Key of the layout in eframe's storage.
#[cfg(feature = "window")]
pub const STORAGE_KEY: &str = "layout";

/// The upper left: what the camera sees.
const IMAGE: [Pane; 1] = [Pane::Colour];
/// The tabs at the upper right: the same in space.
const SPACE: [Pane; 2] = [Pane::Depth, Pane::Scene];
/// The tabs at the lower left: the records.
const RECORDS: [Pane; 3] = [Pane::Poses, Pane::Charts, Pane::Log];
/// The tabs at the lower right: the tools.
const TOOLS: [Pane; 8] =
    [Pane::Connect, Pane::Target, Pane::Jog, Pane::Taught, Pane::Result, Pane::Verify, Pane::Export, Pane::Track];

/// Share of the height for the images.
const UPPER: f32 = 0.52;
/// Share of the lower row's width for the records: the tabs of the tools all fit next to it in the smallest window.
const LOWER_LEFT: f32 = 0.47;

/// A pane in the tree, by name, so that a layout of another version of the program can still be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Slot(String);

impl Slot {
    /// The pane; `None` when this version has none of that name.
    pub(crate) fn pane(&self) -> Option<Pane> {
        Pane::ALL.into_iter().find(|&pane| Self::from(pane) == *self)
    }
}

impl From<Pane> for Slot {
    fn from(pane: Pane) -> Self {
        Self(format!("{pane:?}"))
    }
}

/// The arrangement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Layout {
    /// The tiles, for drawing.
    pub tree: Tree<Slot>,
}

/// The panes of a step, the most important one last.
fn panes_of(step: Step) -> &'static [Pane] {
    match step {
        Step::Connect => &[Pane::Connect],
        Step::Target => &[Pane::Target],
        Step::Capture => &[Pane::Poses, Pane::Jog],
        Step::Solve => &[Pane::Charts, Pane::Result],
        Step::Verify => &[Pane::Poses, Pane::Verify],
        Step::Export => &[Pane::Export],
        Step::Track => &[Pane::Scene, Pane::Track],
    }
}

impl Default for Layout {
    fn default() -> Self {
        let mut tiles = Tiles::default();
        let mut tabs = |panes: &[Pane]| {
            let children = panes.iter().map(|&pane| tiles.insert_pane(Slot::from(pane))).collect();
            tiles.insert_tab_tile(children)
        };
        let (image, space, records, tools) = (tabs(&IMAGE), tabs(&SPACE), tabs(&RECORDS), tabs(&TOOLS));
        let mut row = |[left, right]: [TileId; 2], part| {
            tiles.insert_container(Linear::new_binary(LinearDir::Horizontal, [left, right], part))
        };
        let upper = row([image, space], 0.5);
        let lower = row([records, tools], LOWER_LEFT);
        let root = tiles.insert_container(Linear::new_binary(LinearDir::Vertical, [upper, lower], UPPER));
        Self { tree: Tree::new("panes", root, tiles) }
    }
}

impl Layout {
    /// A remembered layout, without the panes that no longer exist and with those that are new.
    #[must_use]
    pub fn brought_up_to_date(mut self) -> Self {
        // What the previous cell did not have may be there now.
        let all: Vec<TileId> = self.tree.tiles.tile_ids().collect();
        for id in all {
            self.tree.tiles.set_visible(id, true);
        }
        let mut seen = Vec::new();
        let mut superfluous = Vec::new();
        let mut tiles: Vec<_> = self.tree.tiles.iter().collect();
        tiles.sort_by_key(|(id, _)| id.0);
        for (id, tile) in tiles {
            if let Tile::Pane(slot) = tile {
                match slot.pane() {
                    Some(pane) if !seen.contains(&pane) && self.tree.is_visible(*id) => seen.push(pane),
                    _ => superfluous.push(*id),
                }
            }
        }
        for id in superfluous {
            self.tree.remove_recursively(id);
        }
        for pane in Pane::ALL {
            if !seen.contains(&pane) && !self.add(pane) {
                return Self::default();
            }
        }
        if Pane::ALL.into_iter().all(|pane| self.is_reachable(pane)) { self } else { Self::default() }
    }

    /// Adds a pane to the tabs of its group; `false` if there are none.
    fn add(&mut self, pane: Pane) -> bool {
        let groups = [&IMAGE[..], &SPACE, &RECORDS, &TOOLS];
        let kin: &[Pane] = groups.into_iter().find(|all| all.contains(&pane)).unwrap_or(&[]);
        let home = kin
            .iter()
            .filter_map(|&kin| self.tree.tiles.find_pane(&Slot::from(kin)))
            .find_map(|id| self.tree.tiles.parent_of(id));
        let Some(home) = home else { return false };
        let new = self.tree.tiles.insert_pane(Slot::from(pane));
        match self.tree.tiles.get_mut(home) {
            Some(Tile::Container(container)) => {
                container.add_child(new);
                true
            }
            _ => false,
        }
    }

    /// Whether a pane is in the tree.
    fn is_reachable(&self, pane: Pane) -> bool {
        let mut at = self.tree.tiles.find_pane(&Slot::from(pane));
        // A tree that was read from a file may contain a cycle.
        for _ in 0..=self.tree.tiles.len() {
            match at {
                Some(id) if self.tree.is_root(id) => return true,
                Some(id) => at = self.tree.tiles.parent_of(id),
                None => return false,
            }
        }
        false
    }

    /// Removes what the cell does not have, and adds it again for a cell that has it.
    pub(crate) fn leave_out(&mut self, model: &Model) {
        let has_depth = model.cell.as_ref().is_none_or(|cell| cell.has_depth) || model.review.is_some();
        for (pane, is_there) in [(Pane::Depth, has_depth), (Pane::Taught, model.moves() != Moves::Never)] {
            if let Some(tile) = self.tree.tiles.find_pane(&Slot::from(pane))
                && self.tree.tiles.is_visible(tile) != is_there
            {
                self.tree.tiles.set_visible(tile, is_there);
            }
        }
    }

    /// Brings a pane to the front.
    pub(crate) fn show(&mut self, pane: Pane) {
        let slot = Slot::from(pane);
        self.tree.make_active(|_, tile| matches!(tile, Tile::Pane(other) if *other == slot));
    }

    /// Brings the panes of a step to the front.
    pub(crate) fn go_to(&mut self, step: Step) {
        for &pane in panes_of(step) {
            self.show(pane);
        }
    }

    /// Brings the most important pane of a step to the front, and no other.
    pub(crate) fn arrive_at(&mut self, step: Step) {
        if let Some(&pane) = panes_of(step).last() {
            self.show(pane);
        }
    }

    /// The panes that are drawn, and not behind another tab.
    pub(crate) fn in_front(&self) -> Vec<Pane> {
        let slots = self.tree.active_tiles().into_iter().filter_map(|id| self.tree.tiles.get_pane(&id));
        slots.filter_map(Slot::pane).collect()
    }

    /// The tab containers, which are drawn as cards.
    pub(crate) fn cards(&self) -> impl Iterator<Item = TileId> + '_ {
        self.tree
            .tiles
            .iter()
            .filter_map(|(id, tile)| matches!(tile, Tile::Container(Container::Tabs(_))).then_some(*id))
    }

    /// Whether a pane is drawn, and not behind another tab.
    pub(crate) fn is_in_front(&self, pane: Pane) -> bool {
        self.in_front().contains(&pane)
    }
}

#[cfg(test)]
#[path = "layout_tests.rs"]
mod tests;
