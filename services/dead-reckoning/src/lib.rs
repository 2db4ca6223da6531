//! Naive dead reckoning: encoder counts to pose, equations (20) and (21).
