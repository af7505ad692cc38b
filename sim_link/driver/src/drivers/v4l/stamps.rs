//! The middle of the exposure, from what the kernel stamps a frame with.

/// What a stamp of the kernel is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamped {
    /// Begin of the exposure, or for most USB cameras the first packet of the frame; on the kernel's steady clock.
    Begin,
    /// The last byte of the frame; on the kernel's steady clock.
    End,
    /// No steady clock: when the frame arrived here counts.
    Unknown,
}

/// An instant with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Middle of the exposure \[s\].
    pub middle_s: f64,
    /// It is within ± this \[s\].
    pub uncertainty_s: f64,
}

/// The middle of the exposure of a frame that was stamped at `stamp_s`, or had arrived at `arrived_s` where the stamp says nothing;
/// all on one clock.
///
/// What V4L2 leaves open is how long the exposure was. With frames every `interval_s` it is at most that, and so is reading out
/// the sensor. A stamp of the begin is either before the middle by half the exposure or, where the first packet is meant, behind it
/// by half of it and more: within an interval either way. One of the end is behind exposure and read-out together, within two
/// intervals: one before it, ± one. What arrives may have waited for another interval.
pub fn exposure(stamped: Stamped, stamp_s: f64, arrived_s: f64, interval_s: f64) -> Exposure {
    let (middle_s, intervals) = match stamped {
        Stamped::Begin => (stamp_s, 1.0),
        Stamped::End => (stamp_s - interval_s, 1.0),
        Stamped::Unknown => (arrived_s - 1.5 * interval_s, 1.5),
    };
    Exposure { middle_s, uncertainty_s: intervals * interval_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_every_exposure_that_is_possible_is_within_what_is_stated() {
        let interval_s = 1.0 / 30.0;
        for exposed in [0.001, 0.5, 1.0] {
            for read_out in [0.1, 0.5, 1.0] {
                for waited in [0.0, 1.0] {
                    let [exposed_s, read_out_s, waited_s] = [exposed, read_out, waited].map(|part| part * interval_s);
                    let (begin_s, middle_s) = (100.0, 100.0 + 0.5 * exposed_s);
                    let end_s = begin_s + exposed_s + read_out_s;
                    let arrived_s = end_s + waited_s;
                    let stamps = [
                        (Stamped::Begin, begin_s),
                        (Stamped::Begin, begin_s + exposed_s),
                        (Stamped::End, end_s),
                        (Stamped::Unknown, 0.0),
                    ];
                    for (stamped, stamp_s) in stamps {
                        let stated = exposure(stamped, stamp_s, arrived_s, interval_s);
                        let off_s = (stated.middle_s - middle_s).abs();
                        assert!(off_s <= stated.uncertainty_s + 1e-9, "{stamped:?}: {off_s} of {stated:?}");
                    }
                }
            }
        }
    }
}
