//! What is wrong with a device, in words.

use std::io;
use std::path::Path;

use nix::errno::Errno;

use crate::drivers::Fault;

/// Why a device cannot be used; `doing` is what was tried. `others` are the devices that there are.
pub fn fault(device: &Path, doing: &str, error: &io::Error, others: &[String]) -> Fault {
    let device = device.display();
    let listed = if others.is_empty() {
        "There is no /dev/video* at all: plug the camera in, and look at what the kernel says of it (dmesg)".to_owned()
    } else {
        format!("There are {}: say which with --device", others.join(", "))
    };
    Fault(match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENOENT | Errno::ENXIO) => format!("there is no {device}. {listed}"),
        Some(Errno::ENODEV) => format!("{device} was unplugged, or its driver gave it up. {listed}"),
        Some(Errno::EACCES | Errno::EPERM) => format!(
            "{device} may not be opened by this user: cameras belong to the group `video`. Add the user to it (sudo usermod -aG \
             video $USER) and log in again"
        ),
        Some(Errno::EBUSY) => format!(
            "{device} is used by another program, and a camera serves one at a time: end that one (fuser -v {device} says which it is)"
        ),
        Some(Errno::ENOTTY | Errno::EINVAL) => {
            format!("{device} is no camera that sends images to a program, {doing} is refused ({error}). {listed}")
        }
        Some(Errno::EIO | Errno::EPROTO | Errno::EPIPE) => format!(
            "{device}: {doing} failed ({error}): a cable or a hub loses data, or the USB port has not enough power or bandwidth for \
             this size and rate"
        ),
        _ => format!("{device}: {doing} failed: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(errno: Errno, others: &[&str]) -> String {
        let others: Vec<String> = others.iter().map(ToString::to_string).collect();
        let error = io::Error::from_raw_os_error(errno as i32);
        fault(Path::new("/dev/video7"), "reading a frame", &error, &others).0
    }

    #[test]
    fn each_trouble_says_what_to_do() {
        let none = said(Errno::ENOENT, &[]);
        assert!(none.contains("no /dev/video7") && none.contains("no /dev/video* at all"), "{none}");
        let other = said(Errno::ENOENT, &["/dev/video0 (USB camera)", "/dev/video1"]);
        assert!(other.contains("/dev/video0 (USB camera), /dev/video1: say which with --device"), "{other}");
        assert!(said(Errno::EACCES, &[]).contains("group `video`"));
        assert!(said(Errno::EBUSY, &[]).contains("another program"));
        assert!(said(Errno::ENODEV, &["/dev/video0"]).contains("unplugged"));
        assert!(said(Errno::ENOTTY, &["/dev/video0"]).contains("no camera that sends images"));
        assert!(said(Errno::ENOMEM, &[]).contains("reading a frame failed"));
    }
}
