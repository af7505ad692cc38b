//! STOP as a button, and where it is: the thread that listens to a page stops the arm without waiting for the frame in
//! which the press would be seen.

use egui::{Button, Color32, Context, Id, LayerId, Rect, Response, Ui};

use super::style::theme::Palette;
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// Where STOP was drawn last.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StopPlaces {
    /// Where it is pressed \[points\].
    pub rects: Vec<Rect>,
    /// The ids with which screen readers press it.
    pub controls: Vec<String>,
    /// It has the keyboard focus: Enter and the space bar press it.
    pub has_keyboard: bool,
}

/// The places, and the frame in which they were drawn.
#[derive(Debug, Clone, Default)]
struct Drawn {
    frame: u64,
    places: StopPlaces,
}

fn id() -> Id {
    Id::new("where STOP is")
}

/// Its label and its colours: the user has to know whether it can act.
pub(crate) struct Face {
    /// There is a connection to the arm.
    pub can_act: bool,
    pub words: &'static str,
    /// Colour of the button.
    pub fill: Color32,
    /// Colour of the words.
    pub ink: Color32,
    /// Its effect.
    pub hint: &'static str,
}

impl Face {
    /// For the present state; `name` is its label when it can act.
    pub fn of(ui: &Ui, model: &Model, name: &'static str) -> Self {
        let (palette, language) = (Palette::of(ui), model.view.language);
        if !model.control.is_connected() {
            return Self {
                can_act: false,
                words: tr!(language, "STOP cannot act"),
                fill: palette.raised(),
                ink: palette.weak,
                hint: tr!(
                    language,
                    "There is no connection to the arm: use its own emergency stop. If you press this, the arm is stopped \
                     as soon as the connection is back"
                ),
            };
        }
        Self {
            can_act: true,
            words: if model.stop_pending { tr!(language, "STOPPING…") } else { name },
            fill: palette.bad,
            ink: palette.on_bad,
            hint: tr!(language, "Stop the arm (Esc). Not a substitute for an emergency stop"),
        }
    }
}

/// A button that stops the arm.
pub(crate) fn stop_button_ui(ui: &mut Ui, button: Button<'_>) -> Response {
    let response = ui.add(button);
    let rect = response.interact_rect.intersect(ui.clip_rect());
    let is_covered = |layer: LayerId| layer != ui.layer_id();
    if rect.is_positive() && !ui.ctx().layer_id_at(rect.center()).is_some_and(is_covered) {
        // The context is queried before its lock is taken.
        let (frame, has_keyboard) = (ui.ctx().cumulative_frame_nr(), response.has_focus());
        ui.data_mut(|data| {
            let drawn = data.get_temp_mut_or_default::<Drawn>(id());
            if drawn.frame != frame {
                *drawn = Drawn { frame, ..Drawn::default() };
            }
            drawn.places.rects.push(rect);
            drawn.places.controls.push(response.id.value().to_string());
            drawn.places.has_keyboard |= has_keyboard;
        });
    }
    response
}

/// Where it was drawn in the last frame.
pub fn stop_places(ctx: &Context) -> StopPlaces {
    ctx.data_mut(|data| data.remove_temp::<Drawn>(id())).unwrap_or_default().places
}

#[cfg(test)]
mod tests {
    use egui::RawInput;

    use super::*;

    #[test]
    fn the_places_are_those_of_the_last_frame() {
        let ctx = Context::default();
        let draw = |is_there: bool| {
            let mut output = ctx.run_ui(RawInput::default(), |ui| {
                if is_there {
                    stop_button_ui(ui, Button::new("STOP"));
                }
            });
            output.textures_delta.clear();
            stop_places(&ctx)
        };
        draw(true);
        assert_eq!(draw(true).rects.len(), 1);
        assert_eq!(draw(false), StopPlaces::default());
    }
}
