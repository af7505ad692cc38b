//! What a screen reader gets of the window, and its actions.
//!
//! The tree that egui makes for screen readers becomes a list of everything with a name, in the order of the tree. A page
//! that requests it has it as elements of its own, which the browser's screen reader can read and press.

use std::collections::HashMap;

use egui::Event;
use egui::accesskit::{Action, ActionRequest, Node, NodeId, Role, Toggled, TreeId, TreeUpdate};
use serde::Serialize;

/// Limit of controls that are sent.
const MOST: usize = 2000;

/// Something with a name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Control {
    /// Number in the tree; too large for JavaScript numbers.
    pub id: String,
    /// Its ARIA role; `None`: text.
    pub role: Option<&'static str>,
    /// Its name, or its text.
    pub label: String,
    /// It can be pressed.
    pub enabled: bool,
    /// It is switched on, or chosen; `None`: it is not a switch.
    pub pressed: Option<bool>,
}

/// The controls of a window, in the order of its tree.
pub fn controls(update: &TreeUpdate) -> Vec<Control> {
    let nodes: HashMap<NodeId, &Node> = update.nodes.iter().map(|(id, node)| (*id, node)).collect();
    let mut open: Vec<NodeId> = update.tree.iter().map(|tree| tree.root).collect();
    let mut controls = Vec::new();
    while let Some(id) = open.pop() {
        let Some(node) = nodes.get(&id).filter(|node| !node.is_hidden()) else { continue };
        controls.extend(control(id, node));
        if controls.len() >= MOST {
            break;
        }
        open.extend(node.children().iter().rev());
    }
    controls
}

fn control(id: NodeId, node: &Node) -> Option<Control> {
    let role = match node.role() {
        // The letters of its parent's text.
        Role::TextRun => return None,
        Role::Button => Some("button"),
        Role::CheckBox => Some("checkbox"),
        Role::RadioButton => Some("radio"),
        Role::Link => Some("link"),
        Role::ComboBox => Some("combobox"),
        Role::TextInput | Role::MultilineTextInput | Role::SpinButton | Role::Slider => Some("textbox"),
        _ => None,
    };
    let mut label = node.label().unwrap_or_default().to_owned();
    if let Some(value) = node.value().filter(|value| !value.is_empty() && *value != label) {
        label = if label.is_empty() { value.to_owned() } else { format!("{label}: {value}") };
    }
    if label.is_empty() {
        return None;
    }
    let pressed = match node.toggled() {
        Some(Toggled::True) => Some(true),
        Some(_) => Some(false),
        None => node.is_selected(),
    };
    Some(Control { id: id.0.to_string(), role, label, enabled: !node.is_disabled(), pressed })
}

/// The event that presses a control, or gives it the keyboard focus.
pub fn event(id: &str, press: bool) -> Option<Event> {
    let action = if press { Action::Click } else { Action::Focus };
    let target_node = NodeId(id.parse().ok()?);
    Some(Event::AccessKitActionRequest(ActionRequest { action, target_tree: TreeId::ROOT, target_node, data: None }))
}

#[cfg(test)]
mod tests {
    use egui::{Context, RawInput};

    use super::*;

    fn draw(ctx: &Context, events: Vec<Event>, on: &mut bool, presses: &mut u32) -> Vec<Control> {
        ctx.enable_accesskit();
        let mut output = ctx.run_ui(RawInput { events, ..RawInput::default() }, |ui| {
            ui.label("First words");
            if ui.button("Capture").clicked() {
                *presses += 1;
            }
            ui.checkbox(on, "Corners");
            ui.add_enabled(false, egui::Button::new("Solve"));
        });
        // Nothing is drawn here.
        output.textures_delta.clear();
        controls(&output.platform_output.accesskit_update.expect("a tree"))
    }

    #[test]
    fn what_has_a_name_is_told_in_order_and_can_be_pressed() {
        let (ctx, mut on, mut presses) = (Context::default(), false, 0);
        draw(&ctx, Vec::new(), &mut on, &mut presses);
        let reported = draw(&ctx, Vec::new(), &mut on, &mut presses);
        let short: Vec<_> = reported.iter().map(|c| (c.role, c.label.as_str(), c.enabled, c.pressed)).collect();
        assert_eq!(
            short,
            [
                (None, "First words", true, None),
                (Some("button"), "Capture", true, None),
                (Some("checkbox"), "Corners", true, Some(false)),
                (Some("button"), "Solve", false, None),
            ]
        );
        let press = |index: usize| vec![event(&reported[index].id, true).expect("a number")];
        draw(&ctx, press(1), &mut on, &mut presses);
        let reported = draw(&ctx, press(2), &mut on, &mut presses);
        assert_eq!((presses, on), (1, true));
        assert_eq!(draw(&ctx, Vec::new(), &mut on, &mut presses)[2].pressed, Some(true), "{reported:?}");
        assert_eq!(event("12x", true), None);
    }
}
