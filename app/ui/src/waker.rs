//! Wakes the window from other threads.

use std::io;
use std::sync::Arc;
use std::thread::Builder;
use std::time::Duration;

use handeye_workbench::worker::Waker;
use handeye_workbench::worker::channels::Bell;

/// What the workers report within this time is drawn at once: an image and the board in it, the robot's state.
const GATHER: Duration = Duration::from_millis(20);

/// Makes a window redraw. egui's own request blocks while text is laid out, which may take longer than an arm may continue
/// to move: only a thread of its own waits there.
///
/// # Errors
/// When the system cannot start more threads.
pub fn waker_of(ctx: &egui::Context) -> io::Result<Waker> {
    let (bell, rung) = Bell::new();
    let ctx = ctx.clone();
    Builder::new().name("waker".to_owned()).spawn(move || {
        for () in rung {
            ctx.request_repaint_after(GATHER);
        }
    })?;
    Ok(Arc::new(move || {
        bell.ring();
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_wakes_the_window_does_not_wait_while_it_lays_out_text() {
        let ctx = egui::Context::default();
        let waker = waker_of(&ctx).expect("a thread");
        // As long as this runs, egui answers no other request.
        ctx.data_mut(|_locked| {
            let woken = std::thread::spawn(move || (0..100).for_each(|_| waker()));
            woken.join().expect("it does not wait for this");
        });
    }
}
