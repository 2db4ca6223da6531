//! The on-demand safety map: range samples to hazard cells, equations (8)-(10), (18), (19).
