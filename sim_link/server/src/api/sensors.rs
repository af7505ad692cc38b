//! `sim.*`: images and depths.

use ciborium::Value;

use super::{Call, Outcome, Table, one, several};
use crate::args::ApiError;
use crate::message;
use crate::task::Answer;
use handeye_cell::world::{Sensors, VisionSensor, WorldError};
use handeye_wire as wire;

pub(super) const FUNCTIONS: Table = &[
    ("getVisionSensorImg", get_vision_sensor_img),
    ("getVisionSensorDepth", get_vision_sensor_depth),
    ("getVisionSensorRes", get_vision_sensor_res),
    ("handleVisionSensor", handle_vision_sensor),
    ("readVisionSensor", read_vision_sensor),
];

const GREY: i64 = 1;
const ALPHA: i64 = 2;
const METRES: i64 = 1;
const HANDLE_ALL: i64 = -2;
const HANDLE_ALL_EXCEPT_EXPLICIT: i64 = -3;

/// A part of an image, pixels from the bottom left.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Crop {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

impl Crop {
    /// From two arguments `[x, y]` and `[width, height]`, where a size of zero means all of it.
    fn read(call: &Call<'_>, at: usize, sensor: &VisionSensor) -> Result<Self, ApiError> {
        let pair = |at| -> Result<[usize; 2], ApiError> {
            let Some(numbers) = call.args.optional_numbers(at)? else { return Ok([0, 0]) };
            let [a, b]: [f64; 2] = numbers.try_into().ok().ok_or(ApiError::WrongSize)?;
            let whole = |v: f64| {
                let is_whole = v >= 0.0 && v.fract() == 0.0 && v < 1e6;
                if is_whole { Ok(v as usize) } else { Err(WorldError::InvalidArguments) }
            };
            Ok([whole(a)?, whole(b)?])
        };
        let ([x, y], [width, height]) = (pair(at)?, pair(at + 1)?);
        let (full_width, full_height) = (sensor.intrinsics.width as usize, sensor.intrinsics.height as usize);
        let crop = Self {
            x,
            y,
            width: if width == 0 { full_width } else { width },
            height: if height == 0 { full_height } else { height },
        };
        if crop.x + crop.width > full_width || crop.y + crop.height > full_height {
            return Err(WorldError::InvalidArguments.into());
        }
        Ok(crop)
    }

    fn is_all_of(&self, sensor: &VisionSensor) -> bool {
        self.width == sensor.intrinsics.width as usize && self.height == sensor.intrinsics.height as usize
    }

    /// Cuts the part out of rows of `full_width` pixels.
    fn cut(&self, bytes: &[u8], full_width: usize, pixel_bytes: usize) -> Vec<u8> {
        bytes
            .chunks_exact(full_width * pixel_bytes)
            .skip(self.y)
            .take(self.height)
            .flat_map(|row| &row[self.x * pixel_bytes..(self.x + self.width) * pixel_bytes])
            .copied()
            .collect()
    }
}

/// The resolution that is returned is always the sensor's, even for a part of the image: the simulator does so.
fn full_resolution(sensor: &VisionSensor) -> [u32; 2] {
    [sensor.intrinsics.width, sensor.intrinsics.height]
}

fn get_vision_sensor_img(call: &mut Call<'_>) -> Outcome {
    let handle = call.args.handle(0)?;
    let sensor = call.cell.world.tree.sensor(handle)?;
    let options = call.args.integer_or(1, 0)?;
    let cutoff = call.args.number_or(2, 0.0)?;
    let crop = Crop::read(call, 3, sensor)?;
    let (stage, cameras) = (&call.cell.stage, &mut call.cell.cameras);
    if options & (GREY | ALPHA) == 0 && crop.is_all_of(sensor) {
        return Ok(Answer::Encoded(cameras.colour(handle, sensor, stage).reply.clone()));
    }
    let full_width = sensor.intrinsics.width as usize;
    let alpha = (options & ALPHA != 0).then(|| {
        let depth = crop.cut(&cameras.depth(handle, sensor, stage).bytes, full_width, 4);
        let linear = metres(&depth).map(|z| (z - sensor.near_m) / (sensor.far_m - sensor.near_m));
        linear.map(|v| if v <= cutoff { 255 } else { 0 }).collect::<Vec<u8>>()
    });
    let colour = crop.cut(&cameras.colour(handle, sensor, stage).bytes, full_width, 3);
    let mut bytes = Vec::with_capacity(colour.len() / 3 * 4);
    for (index, pixel) in colour.chunks_exact(3).enumerate() {
        if options & GREY == 0 {
            bytes.extend_from_slice(pixel);
        } else {
            bytes.push((pixel.iter().map(|&c| u16::from(c)).sum::<u16>() / 3) as u8);
        }
        bytes.extend(alpha.as_ref().and_then(|alpha| alpha.get(index)));
    }
    Ok(Answer::Encoded(message::returned_image(&bytes, full_resolution(sensor))))
}

fn metres(bytes: &[u8]) -> impl Iterator<Item = f64> + '_ {
    bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])))
}

/// Depths in metres, or from 0 at the near to 1 at the far plane.
fn get_vision_sensor_depth(call: &mut Call<'_>) -> Outcome {
    let handle = call.args.handle(0)?;
    let sensor = call.cell.world.tree.sensor(handle)?;
    let in_metres = call.args.integer_or(1, 0)? & METRES != 0;
    let crop = Crop::read(call, 2, sensor)?;
    let image = call.cell.cameras.depth(handle, sensor, &call.cell.stage);
    if in_metres && crop.is_all_of(sensor) {
        return Ok(Answer::Encoded(image.reply.clone()));
    }
    let mut bytes = crop.cut(&image.bytes, sensor.intrinsics.width as usize, 4);
    if !in_metres {
        let range_m = sensor.far_m - sensor.near_m;
        bytes = metres(&bytes).flat_map(|z| (((z - sensor.near_m) / range_m) as f32).to_le_bytes()).collect();
    }
    Ok(Answer::Encoded(message::returned_image(&bytes, full_resolution(sensor))))
}

fn get_vision_sensor_res(call: &mut Call<'_>) -> Outcome {
    let sensor = call.cell.world.tree.sensor(call.args.handle(0)?)?;
    one(wire::integers(full_resolution(sensor).map(i64::from)))
}

/// A detection count and two empty packets: the sensors of the cell have no filters that detect.
fn packets(detections: i64) -> Outcome {
    several([Value::from(detections), Value::Array(Vec::new()), Value::Array(Vec::new())])
}

fn handle_vision_sensor(call: &mut Call<'_>) -> Outcome {
    let which = match call.args.integer(0)? {
        HANDLE_ALL => Sensors::All,
        HANDLE_ALL_EXCEPT_EXPLICIT => Sensors::AllButExplicit,
        handle => Sensors::One(handle),
    };
    call.cell.world.handle_sensors(which)?;
    packets(0)
}

fn read_vision_sensor(call: &mut Call<'_>) -> Outcome {
    let sensor = call.cell.world.tree.sensor(call.args.handle(0)?)?;
    packets(if sensor.shown().is_some() { 0 } else { -1 })
}
