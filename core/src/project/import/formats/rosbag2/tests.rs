use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use mcap::records::MessageHeader;

use super::*;

/// A message of a bag: topic, type, time, bytes.
type Recorded = (&'static str, &'static str, i64, Vec<u8>);

/// Writes CDR, little endian.
#[derive(Default)]
struct Message(Vec<u8>);

impl Message {
    fn number<const N: usize>(mut self, bytes: [u8; N]) -> Self {
        self.0.resize(self.0.len().next_multiple_of(N), 0);
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
        let mut out = self.u32(text.len() as u32 + 1);
        out.0.extend_from_slice(text.as_bytes());
        out.0.push(0);
        out
    }

    fn header(self, stamp_ns: i64, frame: &str) -> Self {
        self.u32((stamp_ns / 1_000_000_000) as u32).u32((stamp_ns % 1_000_000_000) as u32).text(frame)
    }

    fn transform(self, pose: &Isometry3<f64>) -> Self {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        [t.x, t.y, t.z, q.x, q.y, q.z, q.w].into_iter().fold(self, Message::f64)
    }

    fn done(self) -> Vec<u8> {
        [vec![0, 1, 0, 0], self.0].concat()
    }
}

/// A robot that goes from pose to pose and rests at each for a second; images come all the time.
fn messages(poses: &[Isometry3<f64>]) -> Vec<Recorded> {
    const STEP_NS: i64 = 50_000_000;
    const FRAMES: &str = "tf2_msgs/msg/TFMessage";
    let flange = Isometry3::translation(0.0, 0.0, 0.1);
    let static_tf = Message::default().u32(1).header(0, "link6").text("tool0").transform(&flange).done();
    let mut out = vec![("/tf_static", FRAMES, 0, static_tf)];
    let mut time = 10_000_000_000i64;
    for (view, pose) in poses.iter().enumerate() {
        let next = poses.get(view + 1).unwrap_or(pose);
        for step in 0..40 {
            // The second half of the time it moves.
            let part = f64::from(step - 20).max(0.0) / 20.0;
            let link6 = pose.lerp_slerp(next, part) * flange.inverse();
            let frames = Message::default().u32(1).header(time, "base_link").text("link6").transform(&link6).done();
            out.push(("/tf", FRAMES, time, frames));
            let mut pixels = vec![0u8; 16 * 12];
            // A moving image is of no view; after the last pose nothing moves.
            pixels[0] = if step <= 20 || view + 1 == poses.len() { view as u8 } else { 255 };
            let mut image =
                Message::default().header(time, "camera").u32(12).u32(16).text("mono8").number([0u8]).u32(16);
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
    read("bag", parts, &mut recording).expect("read");
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
    for (file, whole) in [(mcap, mcap_of(&all)), (db3.clone(), fs::read(&db3).expect("written"))] {
        for cut in (0..whole.len()).step_by(whole.len() / 100) {
            let mut bent = whole.clone();
            bent[cut] ^= 0x55;
            for broken in [&whole[..cut], &bent] {
                fs::write(&file, broken).expect("written");
                let _read = read("bag", std::slice::from_ref(&file), &mut Recording::default());
            }
        }
    }
}
