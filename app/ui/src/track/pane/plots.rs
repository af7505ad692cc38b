//! The last half minute: error and uncertainty of the position, and where the board went.

use std::collections::VecDeque;

use egui::{Pos2, Rect, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};

use crate::solve::charts::axes::{self, Scale};
use crate::style::marks::Marks;
use crate::style::parts;
use crate::style::theme::{CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::model::{Model, TrackPoint};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Length of the time axis \[s\].
const WINDOW_S: f64 = 30.0;
/// Distance of the numbers on the time axis \[s\].
const TICK_S: f64 = 10.0;
/// Height of a plot.
const HEIGHT: f32 = 128.0;
/// Points further apart than this are not joined: no image was tracked meanwhile \[s\].
const GAP_S: f64 = 0.5;

/// A line of a plot.
struct Curve {
    name: &'static str,
    colour: egui::Color32,
    /// Seconds before the newest image, and values; `None` where there is none.
    points: Vec<(f64, Option<f64>)>,
}

/// Both plots; nothing before the first image.
pub fn plots_ui(ui: &mut Ui, model: &Model) {
    let history = &model.track.history;
    let Some(newest) = history.back() else { return };
    let language = model.view.language;
    let (palette, marks) = (Palette::of(ui), Marks::of(ui));
    parts::section_ui(ui, tr!(language, "Last 30 s"));
    let curve = |name, colour, value: &dyn Fn(&TrackPoint) -> Option<f64>| Curve {
        name,
        colour,
        points: history.iter().map(|point| (newest.time_s - point.time_s, value(point))).collect(),
    };
    let within = curve(tr!(language, "95 %"), palette.weak, &|point| point.position_95_m.map(|metres| metres * 1e3));
    let off = curve(tr!(language, "error against the truth"), marks.truth, &|point| {
        point.error.map(|error| error.position_m * 1e3)
    });
    let curves: Vec<Curve> = [within, off].into_iter().filter(Curve::has_values).collect();
    if !curves.is_empty() {
        let scale = Scale::linear(curves.iter().map(Curve::largest).fold(0.0, f64::max));
        plot_ui(ui, tr!(language, "Error of the position [mm]"), scale, &curves, language);
    }
    let Some(mean) = mean_m(history) else { return };
    let names = ["x", "y", "z"];
    let curves: Vec<Curve> = (0..3)
        .map(|axis| {
            let value = move |point: &TrackPoint| point.position_m.map(|position| (position[axis] - mean[axis]) * 1e3);
            curve(names[axis], marks.axes[axis], &value)
        })
        .collect();
    let scale = Scale::symmetric(curves.iter().map(Curve::largest).fold(0.0, f64::max));
    plot_ui(ui, tr!(language, "x, y, z about their means [mm]"), scale, &curves, language);
}

/// Mean position in the history; `None` while there is none.
fn mean_m(history: &VecDeque<TrackPoint>) -> Option<[f64; 3]> {
    let known: Vec<[f64; 3]> = history.iter().filter_map(|point| point.position_m).collect();
    (!known.is_empty()).then(|| {
        std::array::from_fn(|axis| known.iter().map(|position| position[axis]).sum::<f64>() / known.len() as f64)
    })
}

impl Curve {
    /// The values that are in the window.
    fn values(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let in_window = self.points.iter().filter(|(ago_s, _)| (0.0..=WINDOW_S).contains(ago_s));
        in_window.filter_map(|(ago_s, value)| Some((*ago_s, value.filter(|value| value.is_finite())?)))
    }

    fn has_values(&self) -> bool {
        self.values().next().is_some()
    }

    fn largest(&self) -> f64 {
        self.values().map(|(_, value)| value.abs()).fold(0.0, f64::max)
    }

    /// Pieces without a gap.
    fn pieces(&self) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
        for (ago_s, value) in self.values() {
            match pieces.last_mut() {
                Some(piece) if piece.last().is_some_and(|(last_s, _)| last_s - ago_s <= GAP_S) => {
                    piece.push((ago_s, value));
                }
                _ => pieces.push(vec![(ago_s, value)]),
            }
        }
        pieces
    }
}

fn plot_ui(ui: &mut Ui, name: &str, scale: Scale, curves: &[Curve], language: Language) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 10.0;
        for curve in curves {
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 4.0;
                let (line, _) = ui.allocate_exact_size(Vec2::new(12.0, 12.0), Sense::hover());
                ui.painter().hline(line.x_range(), line.center().y, Stroke::new(2.0, curve.colour));
                ui.label(RichText::new(curve.name).size(CAPTION).color(Palette::of(ui).weak));
            });
        }
    });
    let (room, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), HEIGHT), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, name));
    let plot = axes::plot_rect(room);
    let x = |ago_s: f64| plot.right() - (ago_s / WINDOW_S) as f32 * plot.width();
    let ticks: Vec<(f32, String)> = (0..=(WINDOW_S / TICK_S) as i32)
        .rev()
        .map(|tick| f64::from(tick) * TICK_S)
        .map(|ago_s| (x(ago_s), if ago_s > 0.0 { format!("−{ago_s:.0}") } else { "0".to_owned() }))
        .collect();
    axes::axes_ui(ui, plot, scale, name, tr!(language, "Time before the newest image [s]"), &ticks);
    for curve in curves {
        for piece in curve.pieces() {
            let line: Vec<Pos2> =
                piece.into_iter().map(|(ago_s, value)| Pos2::new(x(ago_s), axes::y(plot, scale, value))).collect();
            ui.painter().line(line, Stroke::new(1.6, curve.colour));
        }
    }
    hover_ui(ui, plot, &response, curves, language);
}

/// The values at the time under the pointer.
fn hover_ui(ui: &Ui, plot: Rect, response: &egui::Response, curves: &[Curve], language: Language) {
    let Some(pointer) = response.hover_pos().filter(|at| plot.contains(*at)) else { return };
    let ago_s = f64::from((plot.right() - pointer.x) / plot.width()) * WINDOW_S;
    ui.painter().vline(pointer.x, plot.y_range(), Stroke::new(1.0, Palette::of(ui).weak));
    let mut lines = vec![text!("{time} s ago", time = format!("{ago_s:.1}")).in_language(language)];
    for curve in curves {
        let nearest = curve.values().min_by(|(a, _), (b, _)| (a - ago_s).abs().total_cmp(&(b - ago_s).abs()));
        if let Some((_, value)) = nearest.filter(|(at_s, _)| (at_s - ago_s).abs() < GAP_S) {
            lines.push(format!("{} {value:.3} mm", curve.name));
        }
    }
    response.clone().on_hover_text_at_pointer(lines.join("\n"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_breaks_where_the_board_was_not_known_and_ends_with_the_window() {
        let mut points: Vec<(f64, Option<f64>)> = (0..800).rev().map(|n| (0.05 * f64::from(n), Some(1.0))).collect();
        for (ago_s, value) in &mut points {
            if (10.0..12.0).contains(ago_s) {
                *value = None;
            }
        }
        let curve = Curve { name: "x", colour: egui::Color32::WHITE, points };
        let pieces = curve.pieces();
        assert_eq!(pieces.len(), 2);
        assert!(pieces[0][0].0 <= WINDOW_S && pieces[0].last().expect("points").0 >= 12.0);
        assert!(pieces[1][0].0 < 10.0);
    }

    #[test]
    fn positions_are_drawn_about_the_mean_of_those_that_are_known() {
        let point =
            |position_m| TrackPoint { time_s: 0.0, position_m, position_95_m: None, error: None, latency_s: 0.0 };
        let history = VecDeque::from([point(Some([1.0, 0.0, 4.0])), point(None), point(Some([3.0, 0.0, 0.0]))]);
        assert_eq!(mean_m(&history), Some([2.0, 0.0, 2.0]));
        assert_eq!(mean_m(&VecDeque::from([point(None)])), None);
    }
}
