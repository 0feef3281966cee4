//! A body of triads: magnetometers and further inertial units on one carrier.
