//! The expected error by number of poses: how it fell, how it will fall, and where the goal is.

use egui::{Align2, FontId, Pos2, Rect, RichText, Sense, Shape, Stroke, Ui, WidgetInfo, WidgetType};
use handeye_estimate::diagnose::Promise;
use handeye_estimate::handeye::joint::prediction::{ErrorCurve, ErrorPoint};
use handeye_estimate::stated_uncertainty::StatedUncertainty;

use super::axes::{self, Scale};
use super::instead_ui;
use crate::style::marks::Marks;
use crate::style::numbers;
use crate::style::theme::{CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::model::{CapturePurpose, Model};
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// The chart.
pub fn accuracy_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let calibration = model.solve.solved.as_ref().map(|solved| &solved.calibration);
    if calibration.is_some_and(|calibration| *calibration.stated_uncertainty() != StatedUncertainty::AsModelled) {
        // The curve only covers the noise.
        instead_ui(ui, tr!(language, "More poses do not help until what was found is corrected"));
        return;
    }
    let joint = calibration.and_then(|calibration| calibration.joint.as_ref());
    let Some((curve, now)) = joint.and_then(|joint| Some((&joint.error_curve, joint.error_curve.now()?))) else {
        instead_ui(ui, tr!(language, "The expected error appears with the first joint calibration"));
        return;
    };
    // If a tool is known the goal applies to it. Poses are then planned for it with the errors of the arm, too.
    let promised = model.solve.solved.as_ref().and_then(|solved| solved.promised(model.view.goal.0));
    let is_of_point = promised.is_none_or(|promised| promised.of == Promise::Point);
    let are_for_point = is_of_point || promised.is_some_and(|promised| promised.of == Promise::ReachByAccuracy);
    let goal_mm = is_of_point.then_some(model.view.goal.0 * 1e3);
    ui.label(RichText::new(verdict(curve, now, goal_mm).in_language(language)).color(Palette::of(ui).text));
    let room = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(room);
    let planned = if are_for_point { planned(model, now) } else { Vec::new() };
    let chart = Chart::new(curve, axes::plot_rect(room), goal_mm, planned);
    chart.paint(ui, curve, now, goal_mm, model);
    chart.hover_ui(ui, curve, language);
}

/// The present value and what the goal needs, if the goal applies to this error.
pub fn verdict(curve: &ErrorCurve, (views, error_m): (usize, f64), goal_mm: Option<f64>) -> Text {
    let error = numbers::error_mm(error_m);
    let Some(goal_mm) = goal_mm else {
        return text!(
            "{error} mm (95 %) with {views} poses by the noise alone: what the errors of the arm add is not in it",
            error = error,
            views = views
        );
    };
    let goal = format!("{goal_mm:.2}");
    if error_m * 1e3 <= goal_mm {
        return text!(
            "{error} mm (95 %) with {views} poses: the goal of {goal} mm is reached",
            error = error,
            views = views,
            goal = goal
        );
    }
    match curve.views_for(goal_mm * 1e-3) {
        Some(needed) => text!(
            "{error} mm (95 %) with {views} poses: about {more} more like these reach the goal of {goal} mm",
            error = error,
            views = views,
            more = needed.saturating_sub(views),
            goal = goal
        ),
        None => text!("{error} mm (95 %) with {views} poses", error = error, views = views),
    }
}

/// Where everything is.
struct Chart {
    plot: Rect,
    scale: Scale,
    most_views: usize,
    fewest_views: usize,
    /// Numbers of poses and errors [mm] that guided capture plans.
    planned: Vec<(usize, f64)>,
}

/// What guided capture expects of the poses that it has planned: numbers of poses and errors [mm].
fn planned(model: &Model, (views, error_m): (usize, f64)) -> Vec<(usize, f64)> {
    // A check is not for the fit, and what a first turn contributes is not known.
    let is_fit = model.sequence.as_ref().is_some_and(|sequence| sequence.purpose == Some(CapturePurpose::Calibrate));
    let chosen = model.planned_poses().iter().enumerate().filter(|(_, pose)| is_fit && pose.error_ratio < 1.0);
    chosen.map(|(index, pose)| (views + index + 1, error_m * 1e3 * pose.error_ratio)).collect()
}

fn all(curve: &ErrorCurve) -> impl Iterator<Item = (&ErrorPoint, f64, bool)> {
    let known = |point: &'_ ErrorPoint| point.tip_error_95_m.filter(|error| error.is_finite() && *error > 0.0);
    let gathered = curve.gathered.iter().map(|point| (point, false));
    let further = curve.further.iter().map(|point| (point, true));
    gathered.chain(further).filter_map(move |(point, later)| Some((point, known(point)? * 1e3, later)))
}

impl Chart {
    fn new(curve: &ErrorCurve, plot: Rect, goal_mm: Option<f64>, planned: Vec<(usize, f64)>) -> Self {
        let errors = all(curve).map(|(_, error_mm, _)| error_mm);
        let scale = Scale::logarithmic(errors.chain(planned.iter().map(|(_, mm)| *mm)).chain(goal_mm));
        let views = || all(curve).map(|(point, _, _)| point.views).chain(planned.iter().map(|(views, _)| *views));
        Self { plot, scale, most_views: views().max().unwrap_or(1), fewest_views: views().min().unwrap_or(0), planned }
    }

    fn x(&self, views: usize) -> f32 {
        let span = self.most_views.saturating_sub(self.fewest_views).max(1) as f32;
        self.plot.left() + (views as f32 - self.fewest_views as f32) / span * self.plot.width()
    }

    fn at(&self, views: usize, error_mm: f64) -> Pos2 {
        Pos2::new(self.x(views), axes::y(self.plot, self.scale, error_mm))
    }

    fn paint(&self, ui: &Ui, curve: &ErrorCurve, now: (usize, f64), goal_mm: Option<f64>, model: &Model) {
        let (language, fresh) = (model.view.language, model.solve.fresh);
        let palette = Palette::of(ui);
        let colour = if fresh { Marks::of(ui).fit } else { palette.weak };
        let ticks: Vec<(f32, String)> =
            (self.fewest_views..=self.most_views).map(|views| (self.x(views), views.to_string())).collect();
        let y_name = tr!(language, "Expected error, 95 % [mm]");
        axes::axes_ui(ui, self.plot, self.scale, y_name, tr!(language, "Number of poses"), &ticks);
        let painter = ui.painter();
        if let Some(goal_mm) = goal_mm {
            let goal_y = axes::y(self.plot, self.scale, goal_mm);
            let goal_line = [Pos2::new(self.plot.left(), goal_y), Pos2::new(self.plot.right(), goal_y)];
            painter.extend(Shape::dashed_line(&goal_line, Stroke::new(1.5, palette.good), 6.0, 4.0));
            let words = text!("Goal {goal} mm", goal = format!("{goal_mm:.2}")).in_language(language);
            let at = Pos2::new(self.plot.right() - 4.0, goal_y - 2.0);
            painter.text(at, Align2::RIGHT_BOTTOM, words, FontId::proportional(CAPTION), palette.good);
        }

        let line = |later: bool| -> Vec<Pos2> {
            all(curve)
                .filter(|(_, _, l)| *l == later)
                .map(|(point, error_mm, _)| self.at(point.views, error_mm))
                .collect()
        };
        let (gathered, mut further) = (line(false), line(true));
        painter.line(gathered.clone(), Stroke::new(2.0, colour));
        further.splice(0..0, gathered.last().copied());
        painter.extend(Shape::dashed_line(&further, Stroke::new(1.5, colour.gamma_multiply(0.7)), 4.0, 4.0));
        let here = self.at(now.0, now.1 * 1e3);
        let chosen: Vec<Pos2> =
            std::iter::once(here).chain(self.planned.iter().map(|(views, mm)| self.at(*views, *mm))).collect();
        if chosen.len() > 1 {
            painter.extend(Shape::dashed_line(&chosen, Stroke::new(1.5, palette.text), 4.0, 4.0));
            for at in &chosen[1..] {
                painter.circle_stroke(*at, 3.0, Stroke::new(1.5, palette.text));
            }
            let words = tr!(language, "Planned poses");
            let at = chosen[chosen.len() - 1] + egui::vec2(-4.0, 6.0);
            painter.text(at, Align2::RIGHT_TOP, words, FontId::proportional(CAPTION), palette.text);
        }
        painter.circle_filled(here, 5.0, colour);
        painter.circle_stroke(here, 5.0, Stroke::new(1.5, palette.card));
        let words = text!("Now {error} mm", error = numbers::error_mm(now.1)).in_language(language);
        let at = here + egui::vec2(7.0, -7.0);
        painter.text(at, Align2::LEFT_BOTTOM, words, FontId::proportional(CAPTION), palette.text);
    }

    /// The value at the number of poses under the pointer.
    fn hover_ui(&self, ui: &mut Ui, curve: &ErrorCurve, language: Language) {
        let response = ui.interact(self.plot, ui.id().with("accuracy"), Sense::hover());
        let name = tr!(language, "Expected error by number of poses");
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, name));
        let Some(pointer) = response.hover_pos() else { return };
        let distance = |views: usize| (self.x(views) - pointer.x).abs();
        let Some((point, error_mm, later)) =
            all(curve).min_by(|(a, ..), (b, ..)| distance(a.views).total_cmp(&distance(b.views)))
        else {
            return;
        };
        let at = self.at(point.views, error_mm);
        ui.painter().circle_stroke(at, 5.0, Stroke::new(1.5, Palette::of(ui).text));
        let error = format!("{error_mm:.3}");
        let words = if later {
            text!("{views} poses: {error} mm expected", views = point.views, error = error)
        } else {
            text!("The first {views} poses: {error} mm", views = point.views, error = error)
        };
        response.on_hover_text_at_pointer(words.in_language(language));
    }
}
