//! Colours, fonts, icons, numbers and small widgets that every pane uses.

pub(crate) mod action;
pub(crate) mod empty;
pub(crate) mod fonts;
pub(crate) mod form;
pub(crate) mod icons;
pub(crate) mod marks;
pub(crate) mod numbers;
pub mod parts;
pub mod theme;
