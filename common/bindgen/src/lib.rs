//! Empty replacement of bindgen. iceoryx2 lists it as a build dependency and uses it only on QNX;
//! elsewhere it would take a tenth of the robot's build.
