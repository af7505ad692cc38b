use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;

const HELLO: &str = r#"{"type":"hello","protocol":1,"name":"x","can":["state","joints","image","depth","move_joints"],"joints":[{"name":"a","kind":"revolute","min":-3,"max":3}],"camera":{"width":4,"height":2,"intrinsics":{"fx":4,"fy":4,"cx":1.5,"cy":0.5}},"depth_limits_m":[0.1,3]}"#;
const STATE: &str = r#"{"type":"state","stamp":1.5,"joints_rad":[0.1],"base_from_tip":{"translation_m":[0.1,0,0.3],"rotation_xyzw":[0,0,0,1]},"moving":false}"#;
const IMAGE: &str = r#"{"type":"image","id":1,"stamp":1.4,"width":4,"height":2,"encoding":"mono8","bytes":8}"#;
const DEPTH: &str = r#"{"type":"depth","id":1,"stamp":1.4,"width":4,"height":2,"encoding":"u16_mm","bytes":16}"#;
const PONG: &str = r#"{"type":"pong","id":7,"stamp":2.25}"#;
const REFUSED: &str = r#"{"type":"refused","id":3,"why":"the door is open"}"#;

fn conversation() -> Vec<u8> {
    let mut bytes = format!("{HELLO}\n{STATE}\n{IMAGE}\n").into_bytes();
    bytes.extend([0x10, 0x20, 0x30, b'\n', 0x50, 0x60, 0xff, 0x80]);
    bytes.extend(format!("{DEPTH}\n").bytes());
    bytes.extend([7; 16]);
    bytes.extend(format!("{PONG}\r\n{REFUSED}\n").bytes());
    bytes
}

fn all(bytes: &[u8]) -> Result<Vec<Incoming>, WireError> {
    let mut reader = MessageReader::new(bytes);
    let mut messages = Vec::new();
    while let Some(incoming) = reader.read()? {
        messages.push(incoming);
    }
    Ok(messages)
}

fn refusal(bytes: &[u8]) -> String {
    all(bytes).unwrap_err().to_string()
}

#[test]
fn lines_and_the_bytes_after_them_are_told_apart() {
    let messages = all(&conversation()).unwrap();
    assert_eq!(messages.len(), 6);
    assert!(matches!(&messages[0].message, FromDriver::Hello(hello) if hello.joints.len() == 1));
    assert_eq!(messages[2].bytes, [0x10, 0x20, 0x30, b'\n', 0x50, 0x60, 0xff, 0x80]);
    assert_eq!(messages[3].bytes, [7; 16]);
    assert!(matches!(&messages[4].message, FromDriver::Pong(pong) if pong.id == 7));
    assert_eq!((messages[5].number, messages[5].line.as_str()), (6, REFUSED));
}

#[test]
fn what_a_later_version_adds_is_passed_over_with_its_bytes() {
    let mut bytes = br#"{"type":"point_cloud","of":["x"],"bytes":4}"#.to_vec();
    bytes.extend(b"\n{\n\n}");
    bytes.extend(br#"{"type":"pong","id":1,"stamp":0.5,"mood":"good"}"#);
    bytes.push(b'\n');
    let messages = all(&bytes).unwrap();
    assert_eq!(messages[0].message, FromDriver::Unknown("point_cloud".to_owned()));
    assert!(messages[0].bytes.is_empty() && matches!(messages[1].message, FromDriver::Pong(_)));
}

#[test]
fn each_way_to_break_the_framing_is_named_with_the_line() {
    let long = [b'x'].repeat(100_000_000);
    assert!(refusal(&long).starts_with("message 1: longer than 65536 bytes"));
    assert!(refusal(&long).len() < 400, "a line is shown in its beginning");
    assert!(refusal(b"\n").contains("an empty line"));
    assert!(refusal(b"starting up\n").contains("print to standard error: starting up"));
    assert!(refusal(b"{\"type\":\"pong\"").contains("ended before the end of the line"));
    assert!(refusal(b"\xff\xfe{\"type\"}\n").contains("not UTF-8"));
    assert!(refusal(b"{\"type\":\"pong\",\"id\":1}\n").contains("pong: missing field `stamp`"));
    assert!(refusal(b"{\"id\":1}\n").contains("missing field `type`"));
    let nan = STATE.replace("1.5", "NaN");
    assert!(refusal(format!("{nan}\n").as_bytes()).contains("JSON has no NaN"));
    let cut = format!("{PONG}\n{IMAGE}\n123");
    assert!(refusal(cut.as_bytes()).starts_with("message 2: the output ended after 3 of 8 bytes"));
    let wrong = IMAGE.replace("\"bytes\":8", "\"bytes\":24");
    assert!(refusal(format!("{wrong}\n").as_bytes()).contains("bytes: 24, where width, height and encoding make 8"));
    let many = IMAGE.replace("mono8", "jpeg").replace("\"bytes\":8", "\"bytes\":99999999999");
    assert!(refusal(format!("{many}\n").as_bytes()).contains("at most 67108864"));
    let pong = PONG.replace('}', ",\"bytes\":3}");
    assert!(refusal(format!("{pong}\nabc").as_bytes()).contains("only image and depth"));
}

#[test]
fn numbers_that_mean_nothing_are_named() {
    let state = |from: &str, to: &str| {
        let (message, _) = FromDriver::parse(&STATE.replace(from, to)).unwrap();
        let FromDriver::State(state) = message else { panic!("a state") };
        super::super::states::Reading::of(&state, 1, None).map_err(|bad| bad.to_string())
    };
    assert!(state("[0,0,0,1]", "[0,0,0,2]").unwrap_err().contains("norm 2.0000"));
    assert!(state("[0,0,0,1]", "[0,0,0,0]").unwrap_err().contains("unit quaternion"));
    assert!(state("[0,0,0,1]", "[0.0001,0,0,0.99999]").is_ok(), "single precision is no error");
    assert!(state("[0.1,0,0.3]", "[420.0,0,311]").unwrap_err().contains("not millimetres"));
    let hello = |from: &str, to: &str| FromDriver::parse(&HELLO.replace(from, to)).map_err(|bad| bad.to_string());
    assert!(hello("\"protocol\":1", "\"protocol\":2").unwrap_err().contains("speaks 1"));
    assert!(hello("\"min\":-3", "\"min\":4").unwrap_err().contains("min 4 over max 3"));
    assert!(hello("\"camera\"", "\"kamera\"").unwrap_err().contains("image needs camera"));
    assert!(hello("\"width\":4", "\"width\":0").unwrap_err().contains("no size of an image"));
    assert!(hello("\"fx\":4", "\"fx\":-4").unwrap_err().contains("fx = -4"));
    assert!(hello("\"state\",", "").unwrap_err().contains("state in can"));
    assert!(hello("\"state\",", "\"state\",\"singing\",").is_ok(), "abilities of later versions are ignored");
}

/// Conversations with bytes changed, taken out, put in, doubled and cut: each ends in messages or in an error that can be
/// shown, and nothing that is held is larger than what was sent.
fn mutated(count: usize, seed: u64) {
    let whole = conversation();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut refused, mut longest) = (0, 0);
    for _ in 0..count {
        let mut bytes = whole.clone();
        for _ in 0..rng.random_range(1..6) {
            if bytes.is_empty() {
                break;
            }
            let at = rng.random_range(0..bytes.len());
            let structural = *b"{}[]\",:\n0129-+eE.\\u".get(rng.random_range(0..19)).unwrap();
            match rng.random_range(0..6) {
                0 => bytes[at] = rng.random(),
                1 => bytes[at] = structural,
                2 => bytes.insert(at, structural),
                3 => drop(bytes.remove(at)),
                4 => {
                    let end = (at + rng.random_range(1..40)).min(bytes.len());
                    let piece = bytes[at..end].to_vec();
                    bytes.splice(at..at, piece);
                }
                _ => bytes.truncate(at.max(1)),
            }
        }
        let mut reader = MessageReader::new(bytes.as_slice());
        loop {
            match reader.read() {
                Ok(Some(incoming)) => longest = longest.max(incoming.line.len() + incoming.bytes.len()),
                Ok(None) => break,
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().len() < 1000 && !error.to_string().contains('\n'), "{error}");
                    break;
                }
            }
        }
        assert!(reader.line.capacity() <= 2 * MAX_LINE);
    }
    assert!(longest <= 2 * whole.len(), "{longest}");
    assert!(refused > count / 3, "only {refused} of {count} were noticed: the mutations are too mild");
}

#[test]
fn mutated_messages_are_messages_or_errors() {
    mutated(100_000, 1);
}

mod slow {
    #[test]
    fn a_million_mutated_messages_are_messages_or_errors() {
        for seed in 2..11 {
            super::mutated(100_000, seed);
        }
    }
}
