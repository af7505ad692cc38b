//! A window that is not larger than the screen it opens on.

use egui::{Context, Pos2, Rect, Vec2, ViewportCommand, pos2, vec2};

use super::LEAST_SIZE;

/// Height that the bars of desktops take from the screen \[points\]; a window cannot find out which ones there are.
const BARS: f32 = 48.0;

/// Makes the window fit, as soon as its place is known; whether it was known.
pub fn fit(ctx: &Context) -> bool {
    let viewport = ctx.input(|input| input.viewport().clone());
    let (Some(monitor), Some(inner), Some(outer)) = (viewport.monitor_size, viewport.inner_rect, viewport.outer_rect)
    else {
        return false;
    };
    if viewport.maximized != Some(true)
        && viewport.fullscreen != Some(true)
        && let Some((size, place)) = fitted(monitor, inner, outer)
    {
        ctx.send_viewport_cmd(ViewportCommand::InnerSize(size));
        ctx.send_viewport_cmd(ViewportCommand::OuterPosition(place));
    }
    true
}

/// Size of the content and place of the frame; `None` where the window fits as it is.
fn fitted(monitor: Vec2, inner: Rect, outer: Rect) -> Option<(Vec2, Pos2)> {
    let frame = outer.size() - inner.size();
    let room = monitor - frame - vec2(0.0, BARS);
    let size = inner.size().min(room).max(Vec2::from(LEAST_SIZE).min(inner.size()));
    (size != inner.size()).then(|| (size, pos2(((monitor - frame - size).x / 2.0).max(0.0), 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted_to(monitor: Vec2) -> Option<(Vec2, Pos2)> {
        let inner = Rect::from_min_size(pos2(1.0, 31.0), Vec2::from(crate::SIZE));
        let outer = Rect::from_min_max(inner.min - vec2(1.0, 31.0), inner.max + vec2(1.0, 1.0));
        fitted(monitor, inner, outer)
    }

    #[test]
    fn title_bar_and_edges_are_on_the_screen() {
        assert_eq!(fitted_to(vec2(1920.0, 1080.0)), None);
        for monitor in [vec2(1440.0, 900.0), vec2(1366.0, 768.0), vec2(1280.0, 1024.0)] {
            let (size, place) = fitted_to(monitor).expect("it does not fit");
            let outer = Rect::from_min_size(place, size + vec2(2.0, 32.0));
            assert!(Rect::from_min_size(Pos2::ZERO, monitor).contains_rect(outer), "{outer:?} on {monitor:?}");
        }
    }

    #[test]
    fn it_is_never_smaller_than_its_panes_need() {
        let (size, _) = fitted_to(vec2(800.0, 600.0)).expect("it does not fit");
        assert_eq!(size, Vec2::from(LEAST_SIZE));
    }
}
