//! The harmonic planner: hazard cells to a guidance field, equation (11).
