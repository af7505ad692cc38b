use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};

use super::*;
use crate::testing::{Answer, Event, Log, args, ask, connection, err, func, ret};
use handeye_wire::{self as wire, Reader};

fn has(request: &Value, key: &str) -> bool {
    request.get(key).is_some()
}

fn ended(log: &Log) -> usize {
    let is_end = |event: &&Event| matches!(event, Event::SentLast(request) if func(request) == END);
    log.events().iter().filter(is_end).count()
}

#[test]
fn only_the_first_message_introduces_the_client() {
    let (mut connection, log) = connection(|_| ret([Value::from(1)]));
    connection.call("sim.a", vec![]).expect("answered");
    connection.call("sim.b", vec![]).expect("answered");
    let requests = log.requests();
    assert_eq!(requests[0].get("ver").and_then(Reader::integer), Some(2));
    assert_eq!(requests[0].get("lang").and_then(|v| v.text()), Some("rust"));
    assert!(!has(&requests[1], "ver") && !has(&requests[1], "lang"));
    // A server that forgot the client in between would otherwise keep its locks for ten minutes.
    for request in &requests {
        assert_eq!(request.get("timeout").and_then(Reader::integer), Some(8));
    }
    assert_eq!(requests[0].get("uuid"), requests[1].get("uuid"));
}

#[test]
fn a_refusal_keeps_the_servers_words() {
    let (mut connection, log) = connection(|_| err("354: in sim._getObject: object does not exist"));
    let error = connection.call("sim.getObject", vec![]).expect_err("refused");
    let message = "354: in sim._getObject: object does not exist".to_owned();
    assert_eq!(error, LinkError::Remote { call: "sim.getObject".to_owned(), message });
    assert_eq!(log.events().len(), 1, "a refusal is an answer: nothing is reset");
}

/// A server after CoppeliaSim 4.10, which another client may restart.
fn newest(loaded: &Arc<AtomicBool>) -> (Connection, Log) {
    let loaded = Arc::clone(loaded);
    connection(move |request| match func(request) {
        REQUIRE => {
            loaded.store(args(request)[0].text() == Some("sim"), Ordering::SeqCst);
            ret([])
        }
        "sim.a" if loaded.load(Ordering::SeqCst) => ret([args(request)[0].clone()]),
        name => err(&format!("No such function: {name}")),
    })
}

#[test]
fn a_name_that_is_not_known_is_asked_for_again_with_its_module_loaded() {
    let loaded = Arc::new(AtomicBool::new(false));
    let (mut connection, log) = newest(&loaded);
    for value in [5, 6] {
        let returned = connection.call("sim.a", vec![Value::from(value)]).expect("loaded");
        assert_eq!(returned.integer(0), Ok(value));
    }
    assert_eq!(log.functions(), ["sim.a", REQUIRE, "sim.a", "sim.a"]);

    // A restart of the server is seen as a new connection.
    loaded.store(false, Ordering::SeqCst);
    connection.renew();
    connection.call("sim.a", vec![Value::from(1)]).expect("loaded again");
    assert_eq!(log.functions()[4..], ["sim.a", REQUIRE, "sim.a"]);
}

#[test]
fn a_name_that_the_module_lacks_is_said_so_once_it_is_loaded() {
    let (mut connection, log) = newest(&Arc::default());
    for _ in 0..2 {
        let error = connection.call("sim.b", vec![]).expect_err("no such function");
        assert!(error.is_unknown_function() && error.to_string().starts_with("sim.b failed"), "{error}");
    }
    assert_eq!(log.functions(), ["sim.b", REQUIRE, "sim.b", "sim.b"]);
    // Other modules are the caller's matter.
    connection.call("handeye.stop", vec![]).expect_err("no such function");
    assert_eq!(log.functions().len(), 5);
}

#[test]
fn waiting_and_repeating_end_in_the_result() {
    let mut turn = 0;
    let (mut connection, log) = connection(move |_| {
        turn += 1;
        match turn {
            3 => ask(REPEAT),
            1..=4 => ask(WAIT),
            _ => ret([Value::from(5)]),
        }
    });
    assert_eq!(connection.call("sim.step", vec![]).expect("done").integer(0), Ok(5));
    // The message that was refused is sent again, whichever it was.
    assert_eq!(log.functions(), ["sim.step", EXECUTED, EXECUTED, EXECUTED, EXECUTED]);
}

#[test]
fn a_repeated_first_request_is_the_same_request() {
    let mut turn = 0;
    let (mut connection, log) = connection(move |_| {
        turn += 1;
        if turn == 1 { ask(REPEAT) } else { ret([]) }
    });
    connection.call("sim.x", vec![Value::from(3)]).expect("done");
    let requests = log.requests();
    assert_eq!(requests[0], requests[1]);
}

#[test]
fn an_unknown_callback_is_answered_with_nothing() {
    let mut turn = 0;
    let (mut connection, log) = connection(move |_| {
        turn += 1;
        if turn == 1 { ask("someones_button") } else { ret([]) }
    });
    connection.call("sim.x", vec![]).expect("done");
    assert!(args(&log.requests()[1]).is_empty());
}

#[test]
fn silence_is_a_timeout_and_keeps_the_client_id() {
    let mut turn = 0;
    let (mut connection, log) = connection(move |_| {
        turn += 1;
        if turn == 1 { Answer::Silence } else { ret([]) }
    });
    let uuid = connection.uuid().to_owned();
    let error = connection.call("sim.x", vec![]).expect_err("silence");
    assert!(matches!(error, LinkError::Timeout { .. }), "{error}");
    connection.call("sim.x", vec![]).expect("the next call works");
    assert_eq!(connection.uuid(), uuid);
    assert_eq!(ended(&log), 0);
    assert!(has(&log.requests()[1], "ver"), "a server that restarted must be told again");
    assert_eq!(connection.epoch(), 1);
}

#[test]
fn silence_in_the_middle_of_a_conversation_ends_the_clients_record() {
    let mut turn = 0;
    let (mut connection, log) = connection(move |_| {
        turn += 1;
        match turn {
            1 => ask(WAIT),
            2 => Answer::Silence,
            _ => ret([]),
        }
    });
    let uuid = connection.uuid().to_owned();
    connection.call("sim.moveToConfig", vec![]).expect_err("silence");
    assert_eq!(ended(&log), 1);
    connection.call("sim.x", vec![]).expect("the next call works");
    assert_ne!(connection.uuid(), uuid, "an old message to the old record must not touch the new one");
}

#[test]
fn a_server_that_always_waits_is_stopped_by_the_total_time() {
    let (mut connection, log) = connection(|_| ask(WAIT));
    let error = connection.call("sim.step", vec![]).expect_err("endless");
    assert!(matches!(error, LinkError::Timeout { after, .. } if after >= Duration::from_millis(300)), "{error}");
    assert_eq!(ended(&log), 1);
}

#[test]
fn cancelling_ends_a_wait_and_the_clients_record() {
    let cancel = CancelToken::default();
    let flag = cancel.clone();
    let (mut connection, log) = connection(move |_| {
        flag.cancel();
        Answer::Silence
    });
    let options = CallOptions::long(Duration::from_secs(30), &cancel);
    let error = connection.call_with("sim.moveToConfig", vec![], &options).expect_err("cancelled");
    assert_eq!(error, LinkError::Cancelled { call: "sim.moveToConfig".to_owned() });
    assert_eq!(ended(&log), 1);
}

#[test]
fn a_call_that_was_cancelled_before_it_began_is_not_sent() {
    let cancel = CancelToken::default();
    cancel.cancel();
    let (mut connection, log) = connection(|_| ret([]));
    let options = CallOptions::cancelled_by(&cancel);
    assert!(matches!(connection.call_with("sim.x", vec![], &options), Err(LinkError::Cancelled { .. })));
    assert_eq!(log.events(), []);
}

#[test]
fn the_end_of_the_program_ends_every_wait() {
    let (mut connection, _log) = connection(|_| Answer::Silence);
    connection.options.shutdown.cancel();
    assert!(matches!(connection.call("sim.x", vec![]), Err(LinkError::Cancelled { .. })));
}

#[test]
fn nonsense_is_named_and_the_next_call_works() {
    let mut turn = 0;
    let (mut connection, _log) = connection(move |_| {
        turn += 1;
        match turn {
            1 => Answer::Raw(b"HTTP/1.1 400 Bad Request".to_vec()),
            2 => Answer::Raw(Vec::new()),
            3 => Answer::Say(Value::from(3)),
            4 => Answer::Say(wire::map([("ret", Value::from(3))])),
            5 => Answer::Say(Value::Map(Vec::new())),
            6 => Answer::Fault(TransportFault::ManyParts(2)),
            _ => ret([]),
        }
    });
    for turn in 1..=2 {
        let error = connection.call("sim.x", vec![]).expect_err("nonsense");
        assert!(matches!(error, LinkError::Malformed { .. }), "{turn}: {error}");
    }
    for turn in 3..=6 {
        let error = connection.call("sim.x", vec![]).expect_err("nonsense");
        assert!(matches!(error, LinkError::UnexpectedReply { .. }), "{turn}: {error}");
    }
    connection.call("sim.x", vec![]).expect("the next call works");
}

/// The reply of CoppeliaSim 4.2 to 4.5 to any call.
#[test]
fn a_server_of_protocol_1_is_too_old_whether_it_did_what_it_was_asked_or_not() {
    let done = [("success", Value::from(true)), ("ret", Value::Array(vec![Value::from(40_501)]))];
    let refused = [("success", Value::from(false)), ("error", Value::from("No such function: zmqRemoteApi.require"))];
    for reply in [wire::map(done), wire::map(refused)] {
        let (mut connection, log) = connection(move |_| Answer::Say(reply.clone()));
        let error = connection.call("sim.getInt32Param", vec![Value::from(1)]).expect_err("too old");
        assert_eq!(error, LinkError::TooOld { version: None });
        assert_eq!(
            error.to_string(),
            "this is CoppeliaSim 4.5 or older, and 4.7 or newer is needed: update CoppeliaSim"
        );
        assert_eq!(log.requests().len(), 1, "nothing else is asked for");
    }
}

#[test]
fn leaving_is_announced() {
    let (mut connection, log) = connection(|_| ret([]));
    connection.call("sim.x", vec![]).expect("answered");
    let uuid = Value::from(connection.uuid());
    drop(connection);
    let Some(Event::SentLast(farewell)) = log.events().pop() else { panic!("{:?}", log.events()) };
    assert_eq!(func(&farewell), END);
    assert_eq!(farewell.get("uuid"), Some(&uuid));
}

#[test]
fn a_client_that_never_reached_a_server_leaves_in_silence() {
    let (connection, log) = connection(|_| ret([]));
    drop(connection);
    assert_eq!(log.events(), []);
}

#[test]
fn a_connection_can_move_to_another_thread() {
    let (mut connection, _log) = connection(|_| ret([Value::from(4)]));
    let (send, receive) = mpsc::channel();
    std::thread::spawn(move || send.send(connection.call("sim.x", vec![])).expect("listening"));
    assert_eq!(receive.recv().expect("answered").expect("answered").integer(0), Ok(4));
}

/// Nobody can start it again, and no window of a simulator shows why it is late.
#[test]
fn a_cell_in_this_process_is_not_to_be_started_by_anybody() {
    type Server = fn() -> Answer;
    let servers: [(Server, &str); 2] = [
        (|| Answer::Fault(TransportFault::Disconnected), "has ended by a defect of this program"),
        (|| Answer::Silence, "this computer has too much to do"),
    ];
    for (server, says) in servers {
        let (mut connection, _log) = connection(move |_| server());
        connection.options.is_own_cell = true;
        let error = connection.call("sim.a", vec![]).expect_err("no answer");
        let reported = error.to_string();
        assert!(error.is_connection_loss() && reported.contains(says), "{reported}");
        for word in ["start", "simulator", "CoppeliaSim", "server"] {
            assert!(!reported.contains(word), "{word}: {reported}");
        }
    }
    assert_eq!(ConnectionOptions::own_cell().heartbeat, None, "its silence does not mean that it has gone");
}
