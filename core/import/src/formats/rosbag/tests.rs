use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Read as _, Write as _};
use std::path::Path;
use std::time::Duration;

use mcap::records::MessageHeader;

use super::wire::Encoding;
use super::*;
use handeye_files::budget::{Limits, Spent};
use handeye_geometry::progress::CancelToken;

/// Reads it without a limit of time.
fn read_all(parts: &[PathBuf], recording: &mut Recording) -> Result<(), Text> {
    let cancel = CancelToken::default();
    read("bag", parts, &Budget::new(Limits::default(), &|| Duration::ZERO, &cancel), recording)
}

/// A message of a bag: topic, type, time, bytes.
type Recorded = (&'static str, &'static str, i64, Vec<u8>);

/// Writes CDR, little endian, or what ROS 1 has.
struct Message(Vec<u8>, Encoding);

impl Message {
    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        if self.1 == Encoding::Cdr {
            self.0.resize(self.0.len().next_multiple_of(N), 0);
        }
        self.0.extend_from_slice(&bytes);
        self
    }

    fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    fn f64(self, value: f64) -> Self {
        self.number(value.to_le_bytes())
    }

    fn text(self, text: &str) -> Self {
        let end: &[u8] = if self.1 == Encoding::Cdr { &[0] } else { &[] };
        let mut out = self.u32((text.len() + end.len()) as u32);
        out.0.extend_from_slice(text.as_bytes());
        out.0.extend_from_slice(end);
        out
    }

    fn header(self, stamp_ns: i64, frame: &str) -> Self {
        let this = if self.1 == Encoding::Ros1 { self.u32(7) } else { self };
        this.u32((stamp_ns / 1_000_000_000) as u32).u32((stamp_ns % 1_000_000_000) as u32).text(frame)
    }

    fn transform(self, pose: &Isometry3<f64>) -> Self {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        [t.x, t.y, t.z, q.x, q.y, q.z, q.w].into_iter().fold(self, Message::f64)
    }

    fn done(self) -> Vec<u8> {
        let head: &[u8] = if self.1 == Encoding::Cdr { &[0, 1, 0, 0] } else { &[] };
        [head, &self.0].concat()
    }
}

/// A robot that goes from pose to pose and rests at each for a second; images come all the time.
fn messages(poses: &[Isometry3<f64>]) -> Vec<Recorded> {
    encoded(poses, Encoding::Cdr)
}

fn encoded(poses: &[Isometry3<f64>], encoding: Encoding) -> Vec<Recorded> {
    const STEP_NS: i64 = 50_000_000;
    const FRAMES: &str = "tf2_msgs/msg/TFMessage";
    let begin = || Message(Vec::new(), encoding);
    let flange = Isometry3::translation(0.0, 0.0, 0.1);
    let static_tf = begin().u32(1).header(0, "link6").text("tool0").transform(&flange).done();
    let mut out = vec![("/tf_static", FRAMES, 0, static_tf)];
    let mut time = 10_000_000_000i64;
    for (view, pose) in poses.iter().enumerate() {
        let next = poses.get(view + 1).unwrap_or(pose);
        for step in 0..40 {
            // The second half of the time it moves.
            let part = f64::from(step - 20).max(0.0) / 20.0;
            let link6 = pose.lerp_slerp(next, part) * flange.inverse();
            let frames = begin().u32(1).header(time, "base_link").text("link6").transform(&link6).done();
            out.push(("/tf", FRAMES, time, frames));
            let mut pixels = vec![0u8; 16 * 12];
            // A moving image is of no view; after the last pose nothing moves.
            pixels[0] = if step <= 20 || view + 1 == poses.len() { view as u8 } else { 255 };
            let mut image = begin().header(time, "camera").u32(12).u32(16).text("mono8").number([0u8]).u32(16);
            image = image.u32(pixels.len() as u32);
            image.0.extend_from_slice(&pixels);
            out.push(("/camera/image_raw", "sensor_msgs/msg/Image", time + 3_000_000, image.done()));
            time += STEP_NS;
        }
    }
    out
}

fn mcap_of(messages: &[Recorded]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    {
        let mut writer = mcap::Writer::new(&mut out).expect("begun");
        let mut channels: BTreeMap<&str, u16> = BTreeMap::new();
        for (topic, kind, time, data) in messages {
            let channel_id = *channels.entry(topic).or_insert_with(|| {
                let schema = writer.add_schema(kind, "ros2msg", b"").expect("added");
                writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("added")
            });
            let time = *time as u64;
            let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, data).expect("written");
        }
        writer.finish().expect("finished");
    }
    out.into_inner()
}

fn write_db3(file: &Path, messages: &[Recorded]) {
    let bag = rusqlite::Connection::open(file).expect("made");
    bag.execute_batch(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
             serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
             data BLOB NOT NULL);
         BEGIN;",
    )
    .expect("made");
    let mut topics: Vec<&str> = Vec::new();
    for (topic, kind, time, data) in messages {
        let id = topics.iter().position(|known| known == topic).unwrap_or_else(|| {
            bag.execute("INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr', '')", (topics.len() as i64, topic, kind))
                .expect("added");
            topics.push(topic);
            topics.len() - 1
        });
        bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)", (id as i64, time, data))
            .expect("added");
    }
    bag.execute_batch("COMMIT").expect("written");
}

/// A bag of ROS 1, as its recorder writes them: connections and messages in chunks, an index behind each.
fn ros1_of(messages: &[Recorded], compression: &str) -> Vec<u8> {
    let header = |fields: &[(&str, &[u8])]| -> Vec<u8> {
        let fields = fields.iter().map(|(name, value)| [name.as_bytes(), b"=", value].concat());
        let fields: Vec<u8> = fields.flat_map(|f| [&(f.len() as u32).to_le_bytes()[..], &f].concat()).collect();
        [&(fields.len() as u32).to_le_bytes()[..], &fields].concat()
    };
    let with_data = |header: Vec<u8>, data: &[u8]| [&header[..], &(data.len() as u32).to_le_bytes(), data].concat();
    let mut out = b"#ROSBAG V2.0\n".to_vec();
    out.extend(with_data(header(&[("op", &[3]), ("index_pos", &[0; 8])]), &[b' '; 4027]));
    let mut topics: Vec<&str> = Vec::new();
    for part in messages.chunks(50) {
        let mut chunk = Vec::new();
        for (topic, kind, time, data) in part {
            let known = topics.iter().position(|known| known == topic);
            let id = (known.unwrap_or(topics.len()) as u32).to_le_bytes();
            if known.is_none() {
                topics.push(topic);
                let kind = kind.replacen("/msg/", "/", 1);
                let about = header(&[("topic", topic.as_bytes()), ("type", kind.as_bytes()), ("md5sum", b"*")]);
                chunk.extend(header(&[("op", &[7]), ("conn", &id), ("topic", topic.as_bytes())]));
                chunk.extend(about);
            }
            let (sec, nanosec) = ((time / 1_000_000_000) as u32, (time % 1_000_000_000) as u32);
            let time = [sec.to_le_bytes(), nanosec.to_le_bytes()].concat();
            chunk.extend(with_data(header(&[("op", &[2]), ("conn", &id), ("time", &time)]), data));
        }
        let size = (chunk.len() as u32).to_le_bytes();
        let packed = match compression {
            "bz2" => {
                let mut packer = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
                packer.write_all(&chunk).expect("written");
                packer.finish().expect("packed")
            }
            "lz4" => {
                let mut packer = lz4::EncoderBuilder::new().build(Vec::new()).expect("begun");
                packer.write_all(&chunk).expect("written");
                packer.finish().0
            }
            _ => chunk,
        };
        let fields: [(&str, &[u8]); 3] = [("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)];
        out.extend(with_data(header(&fields), &packed));
        out.extend(with_data(header(&[("op", &[4]), ("ver", &[1, 0, 0, 0])]), &[0; 12]));
    }
    out
}

fn poses() -> Vec<Isometry3<f64>> {
    let pose = |i: usize| {
        let angle = i as f64 * 0.7;
        let turn = nalgebra::Vector3::new(0.3 * angle.cos(), 0.4 * angle.sin(), 0.2 * angle);
        Isometry3::new(nalgebra::Vector3::new(0.4 + 0.05 * angle.sin(), 0.1 * angle.cos(), 0.5), turn)
    };
    (0..6).map(pose).collect()
}

/// One image of every rest, and the pose of the tip that belongs to it.
fn is_read_rightly(parts: &[PathBuf]) {
    let mut recording = Recording::default();
    read_all(parts, &mut recording).expect("read");
    assert_eq!(recording.streams[0].images.len(), 6, "{:?}", recording.beliefs);
    let track = recording.tracks.iter().find(|track| track.name == "bag:tf:base_link->tool0").expect("the tip");
    for (image, sample) in recording.streams[0].images.iter().zip(&track.samples) {
        let name = image.path.file_name().expect("a name").to_string_lossy().into_owned();
        assert_eq!(sample.image.as_deref(), Some(&*name));
        let view = image::open(&image.path).expect("an image").to_luma8().get_pixel(0, 0).0[0];
        let Numbers::Quaternion(n) = sample.numbers else { panic!("{sample:?}") };
        let truth = poses()[usize::from(view)];
        assert!((truth.translation.vector - nalgebra::Vector3::new(n[0], n[1], n[2])).norm() < 1e-12, "view {view}");
    }
}

#[test]
fn one_image_is_taken_of_every_rest_with_the_pose_of_the_tip_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mcap, db3) = (folder.path().join("bag.mcap"), folder.path().join("bag.db3"));
    fs::write(&mcap, mcap_of(&messages(&poses()))).expect("written");
    write_db3(&db3, &messages(&poses()));
    is_read_rightly(&[mcap]);
    is_read_rightly(&[db3]);
}

#[test]
fn a_bag_of_ros_1_is_read_like_one_of_ros_2_however_it_is_compressed() {
    let folder = tempfile::tempdir().expect("a folder");
    for compression in ["none", "bz2", "lz4"] {
        let file = folder.path().join(format!("{compression}.bag"));
        fs::write(&file, ros1_of(&encoded(&poses(), Encoding::Ros1), compression)).expect("written");
        is_read_rightly(&[file]);
    }
}

/// As left by a recorder that was killed: the last chunk ends early and there is no index.
#[test]
fn a_bag_of_ros_1_that_breaks_off_has_what_came_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("killed.bag");
    let twice = [poses(), poses()].concat();
    let whole = ros1_of(&encoded(&twice, Encoding::Ros1), "lz4");
    fs::write(&file, &whole[..whole.len() * 3 / 4]).expect("written");
    let mut recording = Recording::default();
    read_all(&[file], &mut recording).expect("read");
    assert!((8..11).contains(&recording.streams[0].images.len()), "{:?}", recording.beliefs);
}

#[test]
fn files_and_messages_that_rosbag2_compresses_are_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let (db3, packed) = (folder.path().join("bag.db3"), folder.path().join("bag.db3.zstd"));
    write_db3(&db3, &messages(&poses()));
    fs::write(&packed, zstd::encode_all(&*fs::read(&db3).expect("written"), 1).expect("packed")).expect("written");
    is_read_rightly(&[packed]);
    let mcap = folder.path().join("bag.mcap.zstd");
    fs::write(&mcap, zstd::encode_all(&*mcap_of(&messages(&poses())), 1).expect("packed")).expect("written");
    is_read_rightly(&[mcap]);
    let mut each = messages(&poses());
    for (.., data) in &mut each {
        *data = zstd::encode_all(&**data, 1).expect("packed");
    }
    let file = folder.path().join("messages.db3");
    write_db3(&file, &each);
    is_read_rightly(&[file]);
}

/// A few bytes that become as many as one likes must not fill the disk.
#[test]
fn a_file_that_never_stops_growing_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("bomb.db3.zstd");
    let packed = zstd::encode_all(std::io::repeat(0).take(1 << 28), 3).expect("packed");
    assert!(packed.len() < 1 << 17, "{} bytes", packed.len());
    fs::write(&file, packed).expect("written");
    let limits = Limits { unpacked_bytes: 1 << 27, ..Limits::default() };
    let cancel = CancelToken::default();
    let budget = Budget::new(limits, &|| Duration::ZERO, &cancel);
    let why = read("bag", &[file], &budget, &mut Recording::default()).expect_err("refused");
    assert!(why.to_string().contains("unpack to more than 0.1 GiB"), "{why}");
    assert_eq!(budget.check(), Err(Spent::Unpacked(limits.unpacked_bytes)));
}

/// A chunk that states more bytes than its LZ4 frame holds: waiting for the rest would never end.
#[test]
fn a_chunk_that_is_shorter_than_it_says_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("wait.mcap");
    let lz4_of = |bytes: &[u8]| {
        let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).expect("an encoder");
        encoder.write_all(bytes).expect("packed");
        encoder.finish().0
    };
    for (name, packed) in
        [("lz4", lz4_of(b"\x05short")), ("zstd", zstd::encode_all(&b"\x05short"[..], 1).expect("packed"))]
    {
        let mut chunk = [[0u8; 16].as_slice(), &1000u64.to_le_bytes(), &0u32.to_le_bytes()].concat();
        chunk.extend_from_slice(&(name.len() as u32).to_le_bytes());
        chunk.extend_from_slice(name.as_bytes());
        chunk.extend_from_slice(&(packed.len() as u64).to_le_bytes());
        chunk.extend_from_slice(&packed);
        let record = [&[6u8][..], &(chunk.len() as u64).to_le_bytes(), &chunk].concat();
        let bytes = [mcap::MAGIC, &record, &[0; 40]].concat();
        assert!(bytes.len() < 200, "{}", bytes.len());
        fs::write(&file, bytes).expect("written");
        assert!(read_all(std::slice::from_ref(&file), &mut Recording::default()).is_err());
    }
}

/// A database runs what is written in it as a view, and that need not end.
#[test]
fn a_view_in_the_place_of_a_table_is_not_run() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["messages", "topics"] {
        let file = folder.path().join(format!("{name}.db3"));
        write_db3(&file, &messages(&poses()));
        let bag = rusqlite::Connection::open(&file).expect("opened");
        bag.execute_batch(&format!(
            "DROP TABLE {name}; CREATE VIEW {name} AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
             SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data, '' AS name, '' AS type, 'cdr' AS
             serialization_format FROM n WHERE i < 0;"
        ))
        .expect("made");
        drop(bag);
        assert!(read_all(&[file], &mut Recording::default()).is_err());
    }
}

/// With a clock that advances whenever it is read.
#[test]
fn a_bag_of_every_kind_is_given_up_when_its_time_is_over_or_a_person_ends_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let named = |name: &str| folder.path().join(name);
    write_db3(&named("bag.db3"), &messages(&poses()));
    fs::write(named("bag.mcap"), mcap_of(&messages(&poses()))).expect("written");
    fs::write(named("lz4.bag"), ros1_of(&encoded(&poses(), Encoding::Ros1), "lz4")).expect("written");
    for name in ["bag.db3", "bag.mcap", "lz4.bag"] {
        let looks = Cell::new(0);
        let elapsed = || {
            looks.set(looks.get() + 1);
            Duration::from_secs(looks.get())
        };
        let cancel = CancelToken::default();
        let budget = Budget::new(Limits::default(), &elapsed, &cancel);
        let mut recording = Recording::default();
        let why = read("bag", &[named(name)], &budget, &mut recording).expect_err(name);
        assert!(why.to_string().contains("longer than 20 s"), "{name}: {why}");
        assert!(looks.get() < 30, "{name}: it went on after its time");
        cancel.cancel();
        let budget = Budget::new(Limits::default(), &|| Duration::ZERO, &cancel);
        assert_eq!(read("bag", &[named(name)], &budget, &mut recording), Err(Spent::Cancelled.into()), "{name}");
    }
}

/// Frames that never change are in the first file alone.
#[test]
fn a_bag_that_was_cut_into_several_files_is_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = messages(&poses());
    let mut parts = Vec::new();
    for (i, part) in all.chunks(all.len() / 3).enumerate() {
        parts.push(folder.path().join(format!("bag_{i}.db3")));
        write_db3(&parts[i], part);
    }
    is_read_rightly(&parts);
}

#[test]
fn a_broken_bag_is_no_danger() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mcap, db3) = (folder.path().join("bag.mcap"), folder.path().join("bag.db3"));
    let all = messages(&poses()[..2]);
    write_db3(&db3, &all);
    let db3_bytes = fs::read(&db3).expect("written");
    let packed = zstd::encode_all(&*db3_bytes, 1).expect("packed");
    let ros1 = |compression| ros1_of(&encoded(&poses()[..2], Encoding::Ros1), compression);
    let named = |name: &str| folder.path().join(name);
    for (file, whole) in [
        (mcap, mcap_of(&all)),
        (db3.clone(), db3_bytes),
        (named("bag.db3.zstd"), packed),
        (named("none.bag"), ros1("none")),
        (named("bz2.bag"), ros1("bz2")),
        (named("lz4.bag"), ros1("lz4")),
    ] {
        for cut in (0..whole.len()).step_by(whole.len() / 100) {
            let mut bent = whole.clone();
            bent[cut] ^= 0x55;
            for broken in [&whole[..cut], &bent] {
                fs::write(&file, broken).expect("written");
                let _read = read_all(std::slice::from_ref(&file), &mut Recording::default());
            }
        }
    }
}
