//! Against bytes recorded between the vendor's Python client 2.0.4 and the vendor's server script.

use proptest::prelude::*;

use super::*;
use handeye_wire::Reader;

const UUID: &str = "c06b3832-5008-4cbb-b372-46ff92cacfe5";
/// The `uuid` entry of every recorded request.
const U: &str = "6475756964782463303662333833322d353030382d346362622d623337322d343666663932636163666535";

const SENDER: Sender<'_> = Sender { uuid: UUID, idle_timeout_s: 600, introduces: None };

/// A recorded request with the client's time limit, which the recorded client sends only once.
fn limited(hex: &str) -> Vec<u8> {
    let mut bytes = bytes(&format!("{hex} 67 74696d656f7574 190258"));
    bytes[0] += 1;
    bytes
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<char> = hex.chars().filter(|c| !c.is_whitespace()).collect();
    let pair = |pair: &[char]| u8::from_str_radix(&pair.iter().collect::<String>(), 16).expect("hex");
    digits.chunks(2).map(pair).collect()
}

fn returned(hex: &str) -> Vec<Value> {
    match parse(&bytes(hex)) {
        Ok(ServerMessage::Returned { values }) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_first_message_introduces_the_client_as_recorded() {
    let recorded = format!(
        "a7 64 66756e63 74 7a6d7152656d6f74654170692e72657175697265 64 61726773 81 63 73696d 65 617267734c 01 {U} \
         63 766572 02 64 6c616e67 66 707974686f6e 67 74696d656f7574 190258"
    );
    let ours =
        request("zmqRemoteApi.require", vec![Value::from("sim")], &Sender { introduces: Some("python"), ..SENDER });
    assert_eq!(ours, bytes(&recorded));
    assert_eq!(ours.len(), 115);
}

#[test]
fn later_requests_are_the_recorded_bytes() {
    let info =
        format!("a4 6466756e63 71 7a6d7152656d6f74654170692e696e666f 6461726773 81 6373696d 65617267734c 01 {U}");
    assert_eq!(request("zmqRemoteApi.info", vec![Value::from("sim")], &SENDER), limited(&info));

    let indexed = format!(
        "a4 6466756e63 6d 73696d2e6765744f626a656374 6461726773 82 6a 2f5552352f6a6f696e74 a1 65696e646578 03 \
         65617267734c 02 {U}"
    );
    let args = vec![Value::from("/UR5/joint"), wire::map([("index", Value::from(3))])];
    assert_eq!(request("sim.getObject", args, &SENDER), limited(&indexed));

    let executed = format!("a4 6466756e63 6c 5f2a65786563757465642a5f 6461726773 80 65617267734c 00 {U}");
    assert_eq!(request(EXECUTED, Vec::new(), &SENDER), limited(&executed));

    let callback_result = format!("a4 6466756e63 6c 5f2a65786563757465642a5f 6461726773 81 f4 65617267734c 01 {U}");
    assert_eq!(request(EXECUTED, vec![Value::from(false)], &SENDER), limited(&callback_result));

    let step = format!("a4 6466756e63 68 73696d2e73746570 6461726773 80 65617267734c 00 {U}");
    assert_eq!(request("sim.step", Vec::new(), &SENDER), limited(&step));
}

#[test]
fn a_null_argument_is_sent_and_counted() {
    let ours = request("sim.addLog", vec![Value::from(450), Value::Null], &SENDER);
    let needle = bytes("6461726773 82 1901c2 f6 65617267734c 02");
    assert!(ours.windows(needle.len()).any(|window| window == needle), "{ours:02x?}");
}

#[test]
fn a_pose_goes_out_with_the_numbers_and_the_order_that_were_recorded() {
    // Recorded with integers and a double where ours has short floats: handles must agree exactly, numbers by value.
    let recorded = bytes("83 182d 20 87 00 00 fb3ff0000000000000 00 00 00 01");
    let recorded = wire::decode(&recorded).expect("valid");
    let pose = wire::floats([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let ours = request("sim.setObjectPose", vec![Value::from(45), Value::from(-1), pose], &SENDER);
    let ours = wire::decode(&ours).expect("valid");
    let (ours, recorded) =
        (ours.get("args").and_then(Value::as_array).expect("args"), recorded.as_array().expect("args"));
    assert_eq!(ours[..2], recorded[..2]);
    assert_eq!(ours[2].numbers(), recorded[2].numbers());
}

#[test]
fn recorded_results_are_read() {
    assert_eq!(returned("a1 63 726574 a0"), Vec::<Value>::new());
    assert_eq!(returned("a1 63 726574 81 18 1c"), vec![Value::from(28)]);
    let pose = returned(
        "a1 63726574 81 87 fb3fb999999999999a f9b400 f93800 f90000 f90000 fb3fe6a09e667f3bcd fb3fe6a09e667f3bcd",
    );
    assert_eq!(
        pose[0].numbers(),
        Some(vec![0.1, -0.25, 0.5, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2])
    );
    let image = returned("a1 63726574 82 46 000102fffefd 82 02 01");
    assert_eq!(image[0].blob(), Some(&[0, 1, 2, 255, 254, 253][..]));
    assert_eq!(image[1].numbers(), Some(vec![2.0, 1.0]));
    let interval = returned("a1 63726574 82 f4 82 fbc01921fb54442d18 fb402921fb54442d18");
    assert_eq!(interval[0].boolean(), Some(false));
    let tau = std::f64::consts::TAU;
    assert_eq!(interval[1].numbers(), Some(vec![-tau, 2.0 * tau]));
    let sensor = returned("a1 63726574 83 00 80 80");
    assert_eq!((sensor.len(), sensor[0].integer()), (3, Some(0)));
    assert_eq!(returned("a1 63726574 81 20"), vec![Value::from(-1)]);
}

#[test]
fn the_recorded_info_map_is_read() {
    // The recording's form with two of its entries.
    let info = returned(
        "a1 63726574 81 a2 69 6765744f626a656374 a1 64 66756e63 a0 6c 68616e646c655f776f726c64 a1 65 636f6e7374 20",
    );
    assert_eq!(info[0].get("handle_world").and_then(|c| c.get("const")).and_then(Reader::integer), Some(-1));
}

#[test]
fn recorded_errors_keep_their_text() {
    let failed = |hex| match parse(&bytes(hex)) {
        Ok(ServerMessage::Failed { message }) => message,
        other => panic!("{other:?}"),
    };
    let missing = failed(
        "a1 63 657272 78 4e 3335343a20696e2073696d2e5f6765744f626a6563743a206f626a65637420646f6573206e6f742065786973742c206f7220616c6961732f7061746820697320696c6c20666f726d61747465642e",
    );
    assert_eq!(missing, "354: in sim._getObject: object does not exist, or alias/path is ill formatted.");
    let unknown = failed("a1 63657272 78 1a 4e6f20737563682066756e6374696f6e3a2073696d2e6e6f7065");
    assert_eq!(unknown, "No such function: sim.nope");
    assert!(unknown.starts_with(UNKNOWN_FUNCTION));
}

#[test]
fn recorded_requests_of_the_server_are_read() {
    let wait = parse(&bytes("a2 6466756e63 68 5f2a776169742a5f 6461726773 a0"));
    assert_eq!(wait, Ok(ServerMessage::Ask { func: WAIT.to_owned() }));
    assert_eq!(parse(&[0xa0]), Ok(ServerMessage::Nothing));
}

#[test]
fn replies_of_protocol_1_are_told_from_all_others() {
    let text = "The client ZeroMQ remote API version does not match CoppeliaSim's version";
    let refused = wire::encode(&wire::map([("error", Value::from(text)), ("success", Value::from(false))]));
    assert_eq!(refused[..7], bytes("a2 65 6572726f72")[..]);
    let done = wire::map([("success", Value::from(true)), ("ret", Value::Array(vec![Value::from(1)]))]);
    for reply in [refused, wire::encode(&done)] {
        assert_eq!(parse(&reply), Ok(ServerMessage::OldProtocol));
    }
}

#[test]
fn text_that_came_as_bytes_is_still_a_message() {
    let reply = wire::map([("err", Value::Bytes(b"caf\xe9".to_vec()))]);
    match parse(&wire::encode(&reply)) {
        Ok(ServerMessage::Failed { message }) => assert_eq!(message, "caf\u{fffd}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn client_ids_are_uuids_of_version_4_and_follow_the_seed() {
    let draw = |seed| ClientIds::new(seed).draw();
    let id = draw(Some(1));
    assert_eq!(id, draw(Some(1)));
    assert_ne!(id, draw(Some(2)));
    assert_ne!(draw(None), draw(None));
    let groups: Vec<usize> = id.split('-').map(str::len).collect();
    assert_eq!(groups, [8, 4, 4, 4, 12]);
    assert_eq!(&id[14..15], "4");
    assert!("89ab".contains(&id[19..20]), "{id}");
}

/// Replies that a server could send, to be damaged.
fn sound_replies() -> Vec<Vec<u8>> {
    [
        "a1 63 726574 a0",
        "a1 63726574 81 87 fb3fb999999999999a f9b400 f93800 f90000 f90000 fb3fe6a09e667f3bcd fb3fe6a09e667f3bcd",
        "a1 63726574 82 46 000102fffefd 82 02 01",
        "a1 63657272 78 1a 4e6f20737563682066756e6374696f6e3a2073696d2e6e6f7065",
        "a2 6466756e63 68 5f2a776169742a5f 6461726773 a0",
        "a2 67 73756363657373 f5 63 726574 81 01",
        "a2 67 73756363657373 f4 65 6572726f72 63 626164",
        "a1 63726574 81 a2 69 6765744f626a656374 a1 64 66756e63 a0 6c 68616e646c655f776f726c64 a1 65 636f6e7374 20",
        "a0",
    ]
    .iter()
    .map(|hex| bytes(hex))
    .collect()
}

mod slow {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500_000, ..ProptestConfig::default() })]

        #[test]
        fn random_bytes_never_panic(reply in prop::collection::vec(any::<u8>(), 0..200)) {
            let _outcome = parse(&reply);
        }

        #[test]
        fn damaged_replies_never_panic(
            which in 0usize..9,
            hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
        ) {
            let mut reply = sound_replies().swap_remove(which);
            for (at, byte, kind) in hits {
                if reply.is_empty() {
                    break;
                }
                let at = at.index(reply.len());
                match kind {
                    0 => reply[at] = byte,
                    1 => reply.insert(at, byte),
                    2 => { reply.remove(at); }
                    _ => reply.truncate(at),
                }
            }
            // Whatever is understood must also survive being read as a result.
            if let Ok(ServerMessage::Returned { values }) = parse(&reply) {
                let returned = crate::Returned::new("fuzz", values);
                let _outcome = (returned.number(0), returned.text(0), returned.blob(0), returned.resolution(1));
                let _outcome = returned.pose::<(), ()>(0);
                let _outcome = returned.into_map(0);
            }
        }
    }
}
