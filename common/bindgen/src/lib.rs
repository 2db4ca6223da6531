//! Nothing. iceoryx2 names bindgen among what it is built with, and its build script uses it on QNX only.
//! Elsewhere the generator and its parsers would take a tenth of the robot's build.
