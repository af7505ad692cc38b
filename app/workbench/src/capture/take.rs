//! A capture from the request to its end, for a thread that can wait.

use handeye_detect::{DetectOptions, detect_with};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_images::gray_from_rgb;

use super::{CaptureRequest, Measured, Sequence};
use crate::capture::state::CaptureRefused;
use crate::live::state::LiveFrame;

/// Where the images of a capture come from.
pub trait Images {
    /// Why there are none.
    type Error;

    /// The clock that images arrive by \[s\].
    fn now_s(&self) -> f64;

    /// Waits for the images of a later instant than those before. Gives those of the same instant again where simulated
    /// time is paused, so that this is noticed.
    ///
    /// # Errors
    /// Whatever comes back ends the capture.
    fn next(&mut self) -> Result<LiveFrame, Self::Error>;
}

/// What came of a capture.
#[derive(Debug)]
pub enum CaptureEnd {
    /// It is good; with the last of its images.
    Good(Box<Measured>, Box<LiveFrame>),
    /// There is none.
    Refused(CaptureRefused),
}

/// Takes a capture. Ends, whatever the images are: see [`handeye_capture::Machine`].
///
/// # Errors
/// The errors of the images.
pub fn take<P: Images>(
    request: CaptureRequest,
    target: &TargetSpec,
    images: &mut P,
    cancel: &CancelToken,
) -> Result<CaptureEnd, P::Error> {
    let mut sequence = Sequence::new(request, *target, images.now_s());
    loop {
        let frame = images.next()?;
        let (number, received_s) = (frame.info.number, frame.info.received_s);
        let grey = gray_from_rgb(&frame.images.rgb);
        sequence.see(&frame, &grey);
        // An image in which the quick search does not find the board tells nothing about its corners; whether it is there
        // is decided in the average.
        if sequence.compares_corners()
            && let Ok(Some(corners)) = detect_with(&grey, target, &DetectOptions::live().cancelled_by(cancel))
        {
            sequence.saw_board(number, &corners);
        }
        sequence.pass_time(received_s, Some(received_s));
        let ended = match sequence.state() {
            Err(why) => Err(why),
            Ok(_waits) => match sequence.measure(cancel) {
                None => continue,
                Some(measured) => measured,
            },
        };
        return Ok(match ended {
            Ok(measured) => CaptureEnd::Good(Box::new(measured), Box::new(frame)),
            Err((kind, why)) => CaptureEnd::Refused(CaptureRefused { kind, why, at_s: received_s }),
        });
    }
}
