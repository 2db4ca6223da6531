//! The velocity synchroniser: guidance to wheel speeds, equations (14)-(17).
