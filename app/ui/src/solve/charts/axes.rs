//! Axes: round numbers on them, and what is where.

use egui::{Align2, FontId, Pos2, Rect, Stroke, Ui};

use crate::style::theme::{CAPTION, Palette};

/// Room for the numbers of the vertical axis.
const LEFT: f32 = 44.0;
/// Room for the name of the vertical axis.
const TOP: f32 = 18.0;
/// Room for numbers and name of the horizontal axis.
const BOTTOM: f32 = 32.0;
/// Room at the right, half a number wide.
const RIGHT: f32 = 12.0;

/// The vertical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// From 0 to a value.
    Linear {
        /// The upper end.
        to: f64,
    },
    /// From a value to the same value with the other sign.
    Symmetric {
        /// The upper end.
        to: f64,
    },
    /// By factors, between two values.
    Logarithmic {
        /// The lower end, over 0.
        from: f64,
        /// The upper end.
        to: f64,
    },
}

impl Scale {
    /// From 0 to a little more than the largest value.
    pub fn linear(largest: f64) -> Self {
        Self::Linear { to: beyond(largest) }
    }

    /// From a little less than the largest value below 0 to a little more than it above.
    pub fn symmetric(largest: f64) -> Self {
        Self::Symmetric { to: beyond(largest) }
    }

    /// Over all values that are finite and over 0.
    pub fn logarithmic(values: impl Iterator<Item = f64>) -> Self {
        let (mut from, mut to) = (f64::INFINITY, 0.0_f64);
        for value in values.filter(|value| value.is_finite() && *value > 0.0) {
            from = from.min(value);
            to = to.max(value);
        }
        if from > to {
            Self::Logarithmic { from: 0.1, to: 1.0 }
        } else {
            Self::Logarithmic { from: from / 1.3, to: to * 1.3 }
        }
    }

    /// Where a value is: 0 at the lower end, 1 at the upper.
    pub fn part(self, value: f64) -> f64 {
        match self {
            Self::Linear { to } => value / to,
            Self::Symmetric { to } => 0.5 * (value / to + 1.0),
            Self::Logarithmic { from, to } => (value.max(f64::MIN_POSITIVE) / from).ln() / (to / from).ln(),
        }
    }

    /// The value at a part; the inverse of [`part`](Self::part).
    pub fn value(self, part: f64) -> f64 {
        match self {
            Self::Linear { to } => part * to,
            Self::Symmetric { to } => (2.0 * part - 1.0) * to,
            Self::Logarithmic { from, to } => from * (to / from).powf(part),
        }
    }

    /// Round numbers, about `count` of them.
    pub fn ticks(self, count: usize) -> Vec<f64> {
        match self {
            Self::Linear { to } => {
                let step = round_step(to / count.max(1) as f64);
                (0..).map(|i| f64::from(i) * step).take_while(|tick| *tick <= to).take(50).collect()
            }
            Self::Symmetric { to } => {
                let step = round_step(2.0 * to / count.max(1) as f64);
                let most = ((to / step) as i32).min(25);
                (-most..=most).map(|i| f64::from(i) * step).collect()
            }
            Self::Logarithmic { from, to } => {
                let decades = (to / from).log10();
                // The fewer per decade the more decades there are.
                let per_decade: &[f64] = match decades {
                    0.0..0.9 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
                    0.9..2.5 => &[1.0, 2.0, 5.0],
                    _ => &[1.0],
                };
                let first = from.log10().floor() as i32;
                let last = to.log10().ceil() as i32;
                (first..=last)
                    .flat_map(|power| per_decade.iter().map(move |digit| digit * 10.0_f64.powi(power)))
                    .filter(|tick| (from..=to).contains(tick))
                    .collect()
            }
        }
    }
}

/// A little more than the largest value, or 1 if there is none.
fn beyond(largest: f64) -> f64 {
    if largest.is_finite() && largest > 0.0 { largest * 1.12 } else { 1.12 }
}

/// 1, 2 or 5 times a power of ten, at least as large as a number.
fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = 10.0_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|step| *step >= least * 0.999).unwrap_or(power)
}

/// A number on an axis, without trailing zeros.
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}").replace('-', "−");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Where the chart itself is.
pub fn plot_rect(room: Rect) -> Rect {
    let min = room.min + egui::vec2(LEFT, TOP);
    Rect::from_min_max(min, (room.max - egui::vec2(RIGHT, BOTTOM)).max(min + egui::vec2(1.0, 1.0)))
}

/// The room next to the name of the horizontal axis.
pub fn next_to_name(plot: Rect) -> Rect {
    let bottom = plot.bottom() + BOTTOM;
    Rect::from_x_y_ranges(plot.x_range(), bottom - CAPTION - 4.0..=bottom)
}

/// The height of a value on the screen.
pub fn y(plot: Rect, scale: Scale, value: f64) -> f32 {
    plot.bottom() - (scale.part(value).clamp(-0.01, 1.02) as f32) * plot.height()
}

/// Lines, numbers and names. `x_ticks` are places on the screen with their labels.
pub fn axes_ui(ui: &Ui, plot: Rect, scale: Scale, y_name: &str, x_name: &str, x_ticks: &[(f32, String)]) {
    let palette = Palette::of(ui);
    let painter = ui.painter();
    let font = FontId::proportional(CAPTION);
    let faint = Stroke::new(1.0, palette.edge.gamma_multiply(0.7));
    let mut last = f32::INFINITY;
    for tick in scale.ticks((plot.height() / 36.0).max(2.0) as usize) {
        let y = y(plot, scale, tick);
        painter.hline(plot.x_range(), y, faint);
        if (last - y).abs() > 12.0 {
            painter.text(
                Pos2::new(plot.left() - 6.0, y),
                Align2::RIGHT_CENTER,
                short(tick),
                font.clone(),
                palette.weak,
            );
            last = y;
        }
    }
    painter.hline(plot.x_range(), plot.bottom(), Stroke::new(1.0, palette.weak.gamma_multiply(0.7)));
    // Numbers that would touch are left out.
    let mut free_from = f32::NEG_INFINITY;
    for (x, words) in x_ticks {
        let galley = painter.layout_no_wrap(words.clone(), font.clone(), palette.weak);
        let left = x - galley.size().x / 2.0;
        if left >= free_from {
            free_from = left + galley.size().x + 8.0;
            painter.galley(Pos2::new(left, plot.bottom() + 3.0), galley, palette.weak);
        }
    }
    let left = plot.left() - LEFT + 4.0;
    painter.text(Pos2::new(left, plot.top() - TOP), Align2::LEFT_TOP, y_name, font.clone(), palette.weak);
    let bottom = Pos2::new(plot.right(), plot.bottom() + BOTTOM);
    painter.text(bottom, Align2::RIGHT_BOTTOM, x_name, font, palette.weak);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_on_axes_are_round_and_within_them() {
        assert_eq!(Scale::Linear { to: 0.23 }.ticks(5), [0.0, 0.05, 0.1, 0.15000000000000002, 0.2]);
        assert_eq!(Scale::Logarithmic { from: 0.15, to: 6.0 }.ticks(5), [0.2, 0.5, 1.0, 2.0, 5.0]);
        assert_eq!(Scale::Symmetric { to: 11.0 }.ticks(4), [-10.0, 0.0, 10.0]);
        assert!(Scale::linear(f64::NAN).ticks(4).len() > 1);
        assert_eq!(Scale::logarithmic([f64::INFINITY, -1.0].into_iter()), Scale::Logarithmic { from: 0.1, to: 1.0 });
        for (value, words) in [(0.0, "0"), (0.15000000000000002, "0.15"), (20.0, "20"), (1500.0, "1500")] {
            assert_eq!(short(value), words);
        }
    }

    #[test]
    fn a_place_on_an_axis_is_the_place_of_its_value() {
        for scale in
            [Scale::Linear { to: 0.7 }, Scale::Symmetric { to: 3.0 }, Scale::Logarithmic { from: 0.1, to: 30.0 }]
        {
            for part in [0.0, 0.3, 1.0] {
                assert!((scale.part(scale.value(part)) - part).abs() < 1e-12);
            }
        }
        assert!((Scale::Logarithmic { from: 0.1, to: 10.0 }.value(0.5) - 1.0).abs() < 1e-12);
    }
}
