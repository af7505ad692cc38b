//! Requests and replies of protocol 2 as bytes.

use std::time::Duration;

use ciborium::Value;

use handeye_wire::{self as wire, Reader, WireError};

/// Longest request that is decoded. Requests carry poses and names; decoding takes about thirty times their size.
pub const MAX_REQUEST_BYTES: usize = 1 << 20;

/// Arguments that a call may have; the longest signature has 13.
const MAX_ARGS: usize = 64;

/// Longest client id that is kept; a UUID has 36 characters.
const MAX_UUID_BYTES: usize = 128;

/// Default and longest idle time after which a client is forgotten.
const DEFAULT_IDLE_LIMIT: Duration = Duration::from_mins(10);
const MAX_IDLE_LIMIT: Duration = Duration::from_hours(24);

/// The name of a request that reports that a callback has returned, or that the client goes on waiting.
pub const EXECUTED: &str = "_*executed*_";

/// A request of a client.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// A function is to be called.
    Call {
        /// Who calls.
        uuid: String,
        /// Dotted name.
        func: String,
        /// Arguments; trailing nulls are as the client counted them.
        args: Vec<Value>,
        /// Idle time after which the client may be forgotten, where it gives one.
        idle_limit: Duration,
    },
    /// A callback has returned.
    Executed {
        /// Who ran it.
        uuid: String,
        /// Its return values.
        values: Vec<Value>,
    },
    /// The client is done.
    End { uuid: String },
    /// No function and no code: answered with an empty map.
    Nothing,
    /// A chunk of Lua.
    Eval,
    /// A client of protocol 1.
    WithoutId,
}

/// A request that cannot be understood.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadRequest {
    /// Not a CBOR item.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// Too long to be decoded.
    #[error("request of {bytes} bytes is over the limit of {MAX_REQUEST_BYTES} bytes")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// Decodes, but is not a request.
    #[error("request is not understood: {reason}")]
    Shape {
        /// Why.
        reason: &'static str,
    },
}

fn shape(reason: &'static str) -> BadRequest {
    BadRequest::Shape { reason }
}

/// Reads a request.
///
/// # Errors
/// [`BadRequest`], for anything that is not a request.
pub fn parse(bytes: &[u8]) -> Result<Request, BadRequest> {
    if bytes.len() > MAX_REQUEST_BYTES {
        return Err(BadRequest::TooLong { bytes: bytes.len() });
    }
    let message = wire::decode(bytes)?;
    if !matches!(message, Value::Map(_)) {
        return Err(shape("it is not a map"));
    }
    let Some(uuid) = message.get("uuid") else { return Ok(Request::WithoutId) };
    let uuid = uuid.text().filter(|uuid| uuid.len() <= MAX_UUID_BYTES).ok_or(shape("`uuid` is not a short text"))?;
    let uuid = uuid.to_owned();
    let func = match message.get("func") {
        None | Some(Value::Null) => "",
        Some(func) => func.text().ok_or(shape("`func` is not text"))?,
    };
    match func {
        "" if message.get("eval").is_some() => Ok(Request::Eval),
        "" => Ok(Request::Nothing),
        "_*end*_" => Ok(Request::End { uuid }),
        EXECUTED => Ok(Request::Executed { uuid, values: arguments(&message)? }),
        func => Ok(Request::Call {
            uuid,
            func: func.to_owned(),
            args: arguments(&message)?,
            idle_limit: idle_limit(&message),
        }),
    }
}

fn arguments(message: &Value) -> Result<Vec<Value>, BadRequest> {
    let mut args = match message.get("args") {
        None | Some(Value::Null) => Vec::new(),
        Some(args) => args.list().ok_or(shape("`args` is not an array"))?.to_vec(),
    };
    if let Some(count) = message.get("argsL").and_then(Reader::integer) {
        let count = usize::try_from(count).ok().ok_or(shape("`argsL` is negative"))?;
        if count > MAX_ARGS {
            return Err(shape("`argsL` is over 64"));
        }
        args.resize(count, Value::Null);
    }
    if args.len() > MAX_ARGS {
        return Err(shape("there are more than 64 arguments"));
    }
    for arg in &mut args {
        if arg.text() == Some("_*NIL*_") {
            *arg = Value::Null;
        }
    }
    Ok(args)
}

fn idle_limit(message: &Value) -> Duration {
    match message.get("timeout").and_then(Reader::number) {
        Some(seconds) if seconds > 0.0 => Duration::try_from_secs_f64(seconds).unwrap_or(MAX_IDLE_LIMIT),
        _ => DEFAULT_IDLE_LIMIT,
    }
    .min(MAX_IDLE_LIMIT)
}

/// The reply of a function that returned `values`. Nothing is an empty map, as in the simulator.
pub fn returned(values: Vec<Value>) -> Vec<u8> {
    wire::encode(&wire::map([("ret", list(values))]))
}

/// The reply of a function that failed, with the line breaks and tabs spelt out as the simulator does.
pub fn failed(text: &str) -> Vec<u8> {
    let text = text.replace('\n', "_=NL=_").replace('\t', "_=TB=_");
    wire::encode(&wire::map([("err", Value::from(text))]))
}

/// Asks the client to run a callback.
pub fn callback(name: &str, args: Vec<Value>) -> Vec<u8> {
    wire::encode(&wire::map([("func", Value::from(name)), ("args", list(args))]))
}

/// Asks the client to go on waiting for its call, and to confirm that.
pub fn wait() -> Vec<u8> {
    callback("_*wait*_", Vec::new())
}

/// The reply to clients of protocol 1.
pub fn version_mismatch() -> Vec<u8> {
    let text = "The client ZeroMQ remote API version does not match CoppeliaSim's version";
    wire::encode(&wire::map([("error", Value::from(text)), ("success", Value::from(false))]))
}

/// An empty map.
pub fn empty() -> Vec<u8> {
    wire::encode(&Value::Map(Vec::new()))
}

/// `{"ret": [bytes, [width, height]]}`, written directly: an image would otherwise be copied three times.
pub fn returned_image(bytes: &[u8], resolution: [u32; 2]) -> Vec<u8> {
    let mut message = Vec::with_capacity(bytes.len() + 32);
    message.extend_from_slice(b"\xa1\x63ret\x82");
    head(&mut message, 2, bytes.len() as u64);
    message.extend_from_slice(bytes);
    message.push(0x82);
    for side in resolution {
        head(&mut message, 0, u64::from(side));
    }
    message
}

/// A CBOR head in its shortest form (RFC 8949, section 3).
fn head(message: &mut Vec<u8>, major: u8, value: u64) {
    let major = major << 5;
    match value {
        0..24 => message.push(major + value as u8),
        24..0x100 => message.extend_from_slice(&[major + 24, value as u8]),
        0x100..0x1_0000 => {
            message.push(major + 25);
            message.extend_from_slice(&(value as u16).to_be_bytes());
        }
        0x1_0000..0x1_0000_0000 => {
            message.push(major + 26);
            message.extend_from_slice(&(value as u32).to_be_bytes());
        }
        _ => {
            message.push(major + 27);
            message.extend_from_slice(&value.to_be_bytes());
        }
    }
}

fn list(values: Vec<Value>) -> Value {
    if values.is_empty() { Value::Map(Vec::new()) } else { Value::Array(values) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UUID: &str = "c06b3832-5008-4cbb-b372-46ff92cacfe5";

    fn hex(text: &str) -> Vec<u8> {
        let digits: Vec<u8> = text.bytes().filter(u8::is_ascii_hexdigit).collect();
        digits
            .chunks(2)
            .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).expect("ascii"), 16).expect("hex"))
            .collect()
    }

    /// The id's 43 bytes as the Python client writes them.
    const ID: &str = "6475756964 7824 63303662333833322d353030382d346362622d623337322d343666663932636163666535";

    fn call(func: &str, args: Vec<Value>) -> Request {
        let idle_limit = Duration::from_mins(10);
        Request::Call { uuid: UUID.to_owned(), func: func.to_owned(), args, idle_limit }
    }

    #[test]
    fn requests_recorded_from_the_python_client_are_understood() {
        let require = hex(&format!(
            "a7 6466756e63 74 7a6d7152656d6f74654170692e72657175697265 6461726773 81 6373696d 65617267734c 01 {ID} \
             63766572 02 646c616e67 66707974686f6e 6774696d656f7574 190258"
        ));
        assert_eq!(require.len(), 115);
        assert_eq!(parse(&require), Ok(call("zmqRemoteApi.require", vec![Value::from("sim")])));
        let joint = hex(&format!(
            "a4 6466756e63 6d73696d2e6765744f626a656374 6461726773 82 6a2f5552352f6a6f696e74 a165696e64657803 \
             65617267734c 02 {ID}"
        ));
        let options = wire::map([("index", Value::from(3))]);
        assert_eq!(parse(&joint), Ok(call("sim.getObject", vec![Value::from("/UR5/joint"), options])));
        let step = hex(&format!("a4 6466756e63 6873696d2e73746570 6461726773 80 65617267734c 00 {ID}"));
        assert_eq!(parse(&step), Ok(call("sim.step", vec![])));
        let executed = hex(&format!("a4 6466756e63 6c5f2a65786563757465642a5f 6461726773 81f4 65617267734c 01 {ID}"));
        let values = vec![Value::from(false)];
        assert_eq!(parse(&executed), Ok(Request::Executed { uuid: UUID.to_owned(), values }));
    }

    #[test]
    fn replies_are_the_recorded_bytes() {
        assert_eq!(returned(vec![]), hex("a1 63726574 a0"));
        assert_eq!(returned(vec![Value::from(28)]), hex("a1 63726574 81 181c"));
        assert_eq!(
            failed("No such function: sim.nope"),
            hex("a1 63657272 781a 4e6f20737563682066756e6374696f6e3a2073696d2e6e6f7065")
        );
        assert_eq!(returned_image(&hex("000102fffefd"), [2, 1]), hex("a1 63726574 82 46 000102fffefd 82 02 01"));
        let image = returned_image(&vec![7; 921_600], [640, 480]);
        assert!(image.starts_with(&hex("a1 63726574 82 5a000e1000")) && image.ends_with(&hex("82 190280 1901e0")));
        assert_eq!(empty(), hex("a0"));
        assert!(version_mismatch().starts_with(&hex("a2 656572726f72 7849")));
    }

    #[test]
    fn a_null_at_the_end_survives_and_the_text_for_it_becomes_one() {
        let args = vec![Value::from(450), Value::from("_*NIL*_")];
        let request = wire::map([
            ("func", Value::from("sim.addLog")),
            ("args", Value::Array(args)),
            ("argsL", Value::from(3)),
            ("uuid", Value::from(UUID)),
        ]);
        let parsed = parse(&wire::encode(&request));
        assert_eq!(parsed, Ok(call("sim.addLog", vec![Value::from(450), Value::Null, Value::Null])));
    }

    #[test]
    fn an_argument_count_without_arguments_costs_no_memory() {
        let request = wire::map([
            ("func", Value::from("sim.step")),
            ("argsL", Value::from(u64::MAX >> 1)),
            ("uuid", Value::from(UUID)),
        ]);
        assert!(matches!(parse(&wire::encode(&request)), Err(BadRequest::Shape { .. })));
    }

    #[test]
    fn a_request_without_id_is_told_apart_from_one_without_function() {
        assert_eq!(parse(&hex("a1 6466756e63 6173")), Ok(Request::WithoutId));
        assert_eq!(parse(&hex(&format!("a1 {ID}"))), Ok(Request::Nothing));
        assert!(parse(&hex("80")).is_err());
    }
}
