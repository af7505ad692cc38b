//! The calibration against captures that never entered its fit.
