use handeye_geometry::frames::{Base, Pose, Tip};

use super::*;

const PAGE: &str = include_str!("../../../../docs/drivers.md");

/// The messages of the page's conversation from one side, lines that are broken for the page put together again.
fn messages(side: &str) -> Vec<String> {
    let mut messages: Vec<String> = Vec::new();
    let mut is_open = false;
    for line in PAGE.lines() {
        if let Some(message) = line.strip_prefix("    ").and_then(|line| line.strip_prefix(side)) {
            messages.push(message.to_owned());
            is_open = true;
        } else if is_open && line.starts_with("       ") {
            messages.last_mut().unwrap().push_str(line.trim_start());
        } else {
            is_open = false;
        }
    }
    let complete = messages.into_iter().filter(|message| !message.contains('…'));
    // Bytes and remarks follow the last brace.
    complete.map(|message| message[..=message.rfind('}').unwrap()].to_owned()).collect()
}

#[test]
fn every_message_of_the_page_is_one() {
    let sent = messages("> ");
    assert!(sent.len() >= 6, "{sent:?}");
    for message in sent {
        let read: ToDriver = serde_json::from_str(&message).unwrap_or_else(|error| panic!("{message}: {error}"));
        assert_eq!(read.line(), format!("{message}\n"), "as the workbench writes it");
    }
    let received = messages("< ");
    assert!(received.len() >= 7, "{received:?}");
    for message in received {
        let (read, _) = FromDriver::parse(&message).unwrap_or_else(|error| panic!("{message}: {error}"));
        assert!(!matches!(read, FromDriver::Unknown(_)), "{message}");
    }
}

#[test]
fn the_page_names_every_type_every_ability_and_every_limit() {
    let names = ["hello", "ping", "next_image", "arm", "move", "stop", "bye"];
    let names = names
        .into_iter()
        .chain(["pong", "state", "image", "depth", "accepted", "done", "stopped", "refused", "disarmed"]);
    let names =
        names.chain(["log", "error", "joints", "move_joints", "move_tip", "rgb8", "bgr8", "mono8", "jpeg", "png"]);
    for name in
        names.chain(["u16_mm", "f32_m", "base_from_flange", "flange_from_tcp", "base_from_tip", "depth_limits_m"])
    {
        assert!(PAGE.contains(&format!("`{name}`")), "{name}");
    }
    for limit in ["65 536 bytes", "67 108 864", "10 to 500 times a second"] {
        assert!(PAGE.contains(limit), "{limit}");
    }
    assert_eq!((crate::wire::MAX_LINE, crate::wire::MAX_BYTES), (65_536, 67_108_864));
}

#[test]
fn poses_go_over_the_wire_and_back() {
    let pose = Pose::<Base, Tip>::from_translation_xyzw([0.1, -0.2, 0.3], [0.5, -0.5, 0.5, 0.5]);
    let back = PoseMessage::of(&pose).pose::<Base, Tip>("base_from_tip").unwrap();
    let (off_m, off_rad) = pose.distance_to(&back);
    assert!(off_m < 1e-12 && off_rad < 1e-7);
}
