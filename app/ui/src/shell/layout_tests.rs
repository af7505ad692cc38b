use egui_tiles::Tabs;

use super::*;

fn stored(layout: &Layout) -> Layout {
    serde_json::from_str(&serde_json::to_string(layout).expect("it can be written")).expect("it can be read")
}

#[test]
fn a_layout_is_the_same_after_it_was_stored() {
    let layout = Layout::default();
    assert_eq!(stored(&layout).brought_up_to_date(), layout);
}

#[test]
fn a_pane_of_another_version_goes_and_a_new_one_comes_to_its_kin() {
    let text = serde_json::to_string(&Layout::default()).expect("it can be written").replace("\"Jog\"", "\"Gone\"");
    let layout: Layout = serde_json::from_str(&text).expect("an unknown pane is no reason to forget the others");
    let layout = layout.brought_up_to_date();
    assert!(layout.tree.tiles.find_pane(&Slot("Gone".to_owned())).is_none());
    let parent = |pane| layout.tree.tiles.parent_of(layout.tree.tiles.find_pane(&Slot::from(pane)).expect("there"));
    assert_eq!(parent(Pane::Jog), parent(Pane::Taught));
}

#[test]
fn a_layout_from_before_the_3d_pane_gets_it_beside_the_depth_image_and_behind_it() {
    let text = serde_json::to_string(&Layout::default()).expect("it can be written").replace("\"Scene\"", "\"Gone\"");
    let layout: Layout = serde_json::from_str(&text).expect("a layout");
    let layout = layout.brought_up_to_date();
    let parent = |pane| layout.tree.tiles.parent_of(layout.tree.tiles.find_pane(&Slot::from(pane)).expect("there"));
    assert_eq!(parent(Pane::Scene), parent(Pane::Depth));
    assert_ne!(parent(Pane::Scene), parent(Pane::Colour));
    assert!(layout.is_in_front(Pane::Depth));
}

#[test]
fn a_layout_without_a_root_or_with_all_panes_gone_is_the_first_one_again() {
    let empty = Layout { tree: Tree::empty("panes") };
    assert_eq!(empty.brought_up_to_date(), Layout::default());
    let mut rootless = Layout::default();
    rootless.tree.root = None;
    assert_eq!(rootless.brought_up_to_date(), Layout::default());
}

#[test]
fn a_pane_that_is_there_twice_is_drawn_once() {
    let mut layout = Layout::default();
    let second = layout.tree.tiles.insert_pane(Slot::from(Pane::Log));
    let tabs = layout.tree.tiles.insert_container(Tabs::new(vec![second]));
    if let Some(Tile::Container(root)) = layout.tree.root.and_then(|root| layout.tree.tiles.get_mut(root)) {
        root.add_child(tabs);
    }
    let layout = layout.brought_up_to_date();
    let slot = Slot::from(Pane::Log);
    assert_eq!(layout.tree.tiles.tiles().filter(|tile| matches!(tile, Tile::Pane(other) if *other == slot)).count(), 1);
}

#[test]
fn a_step_brings_its_panes_to_the_front() {
    let mut layout = Layout::default();
    for step in Step::ALL {
        layout.go_to(step);
        for &pane in panes_of(step) {
            assert!(layout.is_in_front(pane), "{step:?} {pane:?}");
        }
    }
}
